//! Point clouds of the Point Cloud Library (PCD 0.7 and before): ascii, binary and
//! binary_compressed.
//!
//! The fields x, y and z are used, of any numeric type, and as the position of the sensor the
//! fields vp_x, vp_y and vp_z of each point, or VIEWPOINT, unless it is the origin of the file,
//! which stands for none. Compressed data are LZF, field by field, or stored as they are where LZF
//! would not make them shorter.

use std::borrow::Cow;

use super::bytes::{Bytes, float, number, shown, three, words};
use super::cloud::{self, Cloud, Points, Records, Sensors};
use super::{FormatError, ImportSpec, Imported, MapReader, Note, cell_length};

/// A point cloud of the Point Cloud Library.
pub(super) const READER: MapReader = MapReader {
    stored_cell_m: Some(cell_length::in_comment),
    in_pieces: Some(in_pieces),
    ..MapReader::new("point cloud of PCL", &["pcd"], cloud::OPTIONS, read)
};

/// Largest size of a point, bytes.
const STRIDE_MAX: usize = 1 << 16;

/// Bytes that three bytes of LZF can expand to: the longest repetition.
const LZF_GROWTH: usize = 264;

/// Fields of a point, and of where it was seen from.
const AXES: [&str; 3] = ["x", "y", "z"];
const SEEN_FROM: [&str; 3] = ["vp_x", "vp_y", "vp_z"];

/// Names of the field with the time of a point.
const TIMES: [&str; 5] = ["timestamp", "time", "t", "gps_time", "GpsTime"];

/// Type of a field.
#[derive(Clone, Copy)]
enum Number {
    Signed,
    Unsigned,
    Float,
}

/// A field of a point.
struct Field {
    name: Vec<u8>,
    size: usize,
    number: Number,
    count: usize,
}

/// The data after the header.
#[derive(Clone, Copy)]
enum Data {
    Ascii,
    Binary,
    Compressed,
}

struct Header {
    fields: Vec<Field>,
    points: usize,
    data: Data,
    viewpoint: [f64; 3],
}

/// The position of a coordinate in a point.
struct Coordinate {
    /// The field, by its number among all fields.
    field: usize,
    /// Values of other fields before it.
    values: usize,
    /// Bytes of other fields before it.
    bytes: usize,
}

/// A map of a PCD file.
///
/// # Errors
/// If the file is malformed, or its points do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let mut bytes = Bytes::new(&spec.bytes);
    let header = header(&mut bytes)?;
    let mut wanted: Vec<Coordinate> = header.coordinates(1, AXES)?.into();
    let seen_from = header.coordinates(1, SEEN_FROM).ok();
    let has_sensors = seen_from.is_some();
    wanted.extend(seen_from.into_iter().flatten());
    let time = TIMES.iter().find_map(|name| header.coordinate(1, name).ok());
    let time = time.filter(|_| spec.options.trajectory.is_some());
    let has_times = time.is_some();
    wanted.extend(time);
    let own_position = || {
        let is_known = header.viewpoint != [0.0; 3];
        if is_known { Sensors::One(header.viewpoint) } else { Sensors::None }
    };
    if let (Data::Binary, false, false) = (header.data, has_sensors, has_times) {
        let (stride, start) = (header.stride(), bytes.at());
        let points = Points::Records(Records::new(spec, start, stride, header.points, header.decoder(&wanted))?);
        let left = spec.length() - (start + header.points * stride) as u64;
        let notes = note_of_rest(left).into_iter().collect();
        return cloud::map(spec, Cloud { points, sensors: own_position(), notes, ..Cloud::default() });
    }
    let read = match header.data {
        Data::Ascii => ascii(&mut bytes, &header, &wanted)?,
        Data::Binary => binary(&mut bytes, &header, &wanted)?,
        Data::Compressed => compressed(&mut bytes, &header, &wanted)?,
    };
    let three = |values: &[f64]| [values[0], values[1], values[2]];
    let points: Vec<[f64; 3]> = read.chunks_exact(wanted.len()).map(three).collect();
    let notes = note_of_rest(bytes.rest().len() as u64);
    let times_s = if has_times {
        let unit = header.unit_of_time(&wanted);
        read.chunks_exact(wanted.len()).map(|values| values[wanted.len() - 1] * unit).collect()
    } else {
        Vec::new()
    };
    let sensors = if has_sensors {
        Sensors::Each(read.chunks_exact(wanted.len()).map(|values| three(&values[3..])).collect())
    } else {
        own_position()
    };
    cloud::map(spec, Cloud { points: points.into(), sensors, times_s, notes: notes.into_iter().collect() })
}

fn note_of_rest(bytes: u64) -> Option<Note> {
    (bytes > 0).then(|| Note::new("ignored", format!("{bytes} bytes after the last point")))
}

/// Whether a file is read a piece at a time, of which the header is at hand: binary points without
/// positions of the sensor or times of their own.
fn in_pieces(spec: &ImportSpec) -> bool {
    let Ok(header) = header(&mut Bytes::new(&spec.bytes)) else { return false };
    let has_times = spec.options.trajectory.is_some() && TIMES.iter().any(|name| header.coordinate(1, name).is_ok());
    matches!(header.data, Data::Binary) && header.coordinates(1, SEEN_FROM).is_err() && !has_times
}

fn header(bytes: &mut Bytes<'_>) -> Result<Header, FormatError> {
    let mut fields: Vec<Field> = Vec::new();
    let mut points = None;
    let (mut width, mut height): (Option<usize>, usize) = (None, 1);
    let mut viewpoint = [0.0; 3];
    loop {
        let (at, line) = bytes.header_line("DATA")?;
        let mut words = words(line);
        let Some(key) = words.next() else { continue };
        match key {
            b"VERSION" => {}
            b"WIDTH" => width = Some(number(at, words.next(), "WIDTH")?),
            b"HEIGHT" => height = number(at, words.next(), "HEIGHT")?,
            b"VIEWPOINT" => viewpoint = three(at, &mut words, "VIEWPOINT")?,
            _ if key.starts_with(b"#") => {}
            // Before version 0.6 they were columns.
            b"FIELDS" | b"COLUMNS" => {
                let field = |name: &[u8]| Field { name: name.to_vec(), size: 4, number: Number::Float, count: 1 };
                fields = words.map(field).collect();
            }
            b"SIZE" => {
                let words = each(at, words.collect(), &fields)?;
                for (field, word) in fields.iter_mut().zip(words) {
                    field.size = number(at, Some(word), "SIZE")?;
                    if !matches!(field.size, 1 | 2 | 4 | 8) {
                        return Err(FormatError::line(at, format!("SIZE {}, expected 1, 2, 4 or 8", field.size)));
                    }
                }
            }
            b"TYPE" => {
                let words = each(at, words.collect(), &fields)?;
                for (field, word) in fields.iter_mut().zip(words) {
                    field.number = match word {
                        b"I" => Number::Signed,
                        b"U" => Number::Unsigned,
                        b"F" => Number::Float,
                        _ => return Err(FormatError::line(at, format!("TYPE {}, expected I, U or F", shown(word)))),
                    };
                }
            }
            b"COUNT" => {
                let words = each(at, words.collect(), &fields)?;
                for (field, word) in fields.iter_mut().zip(words) {
                    field.count = number(at, Some(word), "COUNT")?;
                    if !(1..=STRIDE_MAX).contains(&field.count) {
                        let reason = format!("COUNT {}, expected 1 to {STRIDE_MAX}", field.count);
                        return Err(FormatError::line(at, reason));
                    }
                }
            }
            b"POINTS" => points = Some(number(at, words.next(), "POINTS")?),
            b"DATA" => {
                let data = match words.next() {
                    Some(b"ascii") => Data::Ascii,
                    Some(b"binary") => Data::Binary,
                    // The second name is pypcd4's (1.5.1), of the same data.
                    Some(b"binary_compressed" | b"binaryscompressed") => Data::Compressed,
                    word => {
                        let reason = format!(
                            "DATA {}, expected ascii, binary or binary_compressed",
                            shown(word.unwrap_or_default())
                        );
                        return Err(FormatError::line(at, reason));
                    }
                };
                let points = points.or(width.map(|width| width.saturating_mul(height)));
                let points = points.ok_or_else(|| FormatError::line(at, "DATA comes before POINTS or WIDTH"))?;
                let header = Header { fields, points, data, viewpoint };
                if header.stride() > STRIDE_MAX {
                    return Err(FormatError::line(at, format!("a point has more than {STRIDE_MAX} bytes")));
                }
                header.coordinates(at, AXES)?;
                return Ok(header);
            }
            _ => return Err(FormatError::line(at, format!("{} is no key of a PCD header", shown(key)))),
        }
    }
}

/// One word for each field.
fn each<'a>(line: usize, words: Vec<&'a [u8]>, fields: &[Field]) -> Result<Vec<&'a [u8]>, FormatError> {
    if words.len() == fields.len() {
        return Ok(words);
    }
    Err(FormatError::line(line, format!("{} for {} fields", words.len(), fields.len())))
}

impl Header {
    /// Bytes of a point.
    fn stride(&self) -> usize {
        self.fields.iter().map(|field| field.size * field.count).sum()
    }

    /// The positions of three fields.
    fn coordinates(&self, line: usize, names: [&str; 3]) -> Result<[Coordinate; 3], FormatError> {
        let [x, y, z] = names.map(|name| self.coordinate(line, name));
        Ok([x?, y?, z?])
    }

    /// The position of a field.
    fn coordinate(&self, line: usize, name: &str) -> Result<Coordinate, FormatError> {
        let field = self.fields.iter().position(|field| field.name == name.as_bytes());
        let missing = || FormatError::line(line, format!("there is no field '{name}' in FIELDS"));
        let field = field.ok_or_else(missing)?;
        let before = &self.fields[..field];
        let values = before.iter().map(|field| field.count).sum();
        let bytes = before.iter().map(|field| field.size * field.count).sum();
        let Field { size, number, .. } = self.fields[field];
        if matches!(number, Number::Float) && size < 4 {
            return Err(FormatError::line(line, format!("field {field} is a TYPE F of SIZE {size}, expected 4 or 8")));
        }
        Ok(Coordinate { field, values, bytes })
    }

    /// What reads the coordinates of a point.
    fn decoder(&self, wanted: &[Coordinate]) -> impl Fn(&[u8]) -> Option<[f64; 3]> + '_ {
        let at = [0, 1, 2].map(|axis| wanted[axis].bytes);
        let fields = [0, 1, 2].map(|axis| &self.fields[wanted[axis].field]);
        let are_floats = fields.iter().all(|field| matches!(field.number, Number::Float) && field.size == 4);
        move |point| {
            Some(if are_floats {
                at.map(|at| f32::from_le_bytes([point[at], point[at + 1], point[at + 2], point[at + 3]]).into())
            } else {
                [0, 1, 2].map(|axis| value(&point[at[axis]..], fields[axis]))
            })
        }
    }

    /// Seconds of a unit of the last of these fields: drivers write nanoseconds as integers.
    fn unit_of_time(&self, wanted: &[Coordinate]) -> f64 {
        let field = wanted.last().map(|last| &self.fields[last.field]);
        if field.is_some_and(|field| !matches!(field.number, Number::Float)) { 1e-9 } else { 1.0 }
    }
}

/// The wanted values of each point, one after the other.
fn ascii(bytes: &mut Bytes<'_>, header: &Header, wanted: &[Coordinate]) -> Result<Vec<f64>, FormatError> {
    let mut read = Vec::new();
    let mut points = 0;
    let mut values: Vec<&[u8]> = Vec::new();
    while points < header.points {
        let Some((line, text)) = bytes.line() else {
            let reason = format!("the file ends here after {points} of {} points", header.points);
            return Err(FormatError::byte(bytes.at(), reason));
        };
        if text.is_empty() {
            continue;
        }
        values.clear();
        values.extend(words(text));
        for coordinate in wanted {
            read.push(float(line, values.get(coordinate.values).copied(), "a coordinate")?);
        }
        points += 1;
    }
    Ok(read)
}

/// See [`ascii`].
fn binary(bytes: &mut Bytes<'_>, header: &Header, wanted: &[Coordinate]) -> Result<Vec<f64>, FormatError> {
    let stride = header.stride();
    let length = header.points.saturating_mul(stride);
    let data = bytes.take(length, &format!("data of {} points", header.points))?;
    let value =
        |point: &[u8], coordinate: &Coordinate| value(&point[coordinate.bytes..], &header.fields[coordinate.field]);
    Ok(data.chunks_exact(stride).flat_map(|point| wanted.iter().map(move |one| value(point, one))).collect())
}

/// See [`ascii`].
fn compressed(bytes: &mut Bytes<'_>, header: &Header, wanted: &[Coordinate]) -> Result<Vec<f64>, FormatError> {
    let at = bytes.at();
    let packed = bytes.u32("the length of compressed data")? as usize;
    let length = bytes.u32("the length of the data")? as usize;
    let expected = header.points.saturating_mul(header.stride());
    if length != expected {
        let reason = format!("data of {length} bytes, {} points have {expected}", header.points);
        return Err(FormatError::byte(at + 4, reason));
    }
    let start = bytes.at();
    let stored = bytes.take(packed, "the compressed data")?;
    let data = match unpack(stored, length, start) {
        Err(_) if packed == length => Cow::Borrowed(stored),
        data => Cow::Owned(data?),
    };
    // All values of a field stand together.
    let value = |point: usize, coordinate: &Coordinate| {
        let field = &header.fields[coordinate.field];
        let first = coordinate.bytes * header.points;
        value(&data[first + point * field.size * field.count..], field)
    };
    let value = &value;
    Ok((0..header.points).flat_map(|point| wanted.iter().map(move |one| value(point, one))).collect())
}

/// The number that bytes begin with.
fn value(bytes: &[u8], field: &Field) -> f64 {
    let mut low = [0; 8];
    low[..field.size].copy_from_slice(&bytes[..field.size]);
    let (bits, unused) = (u64::from_le_bytes(low), 64 - 8 * field.size as u32);
    match field.number {
        Number::Float if field.size == 4 => f32::from_bits(bits as u32).into(),
        Number::Float => f64::from_bits(bits),
        Number::Unsigned => bits as f64,
        Number::Signed => ((bits << unused) as i64 >> unused) as f64,
    }
}

/// The `length` bytes that LZF data stand for; they begin at byte `start` of the file.
fn unpack(packed: &[u8], length: usize, start: usize) -> Result<Vec<u8>, FormatError> {
    let longest = packed.len().saturating_mul(LZF_GROWTH);
    if length > longest {
        let reason = format!("{} bytes of LZF cannot become {length}, at most {longest}", packed.len());
        return Err(FormatError::byte(start, reason));
    }
    let ends = |at: usize| FormatError::byte(start + at, "the compressed data end within a piece");
    let mut data: Vec<u8> = Vec::with_capacity(length);
    let mut at = 0;
    while let Some(&control) = packed.get(at) {
        let control = usize::from(control);
        at += 1;
        if control < 32 {
            data.extend(packed.get(at..at + control + 1).ok_or_else(|| ends(at))?);
            at += control + 1;
        } else {
            let mut count = control >> 5;
            if count == 7 {
                count += usize::from(*packed.get(at).ok_or_else(|| ends(at))?);
                at += 1;
            }
            let back = (control & 31) << 8 | usize::from(*packed.get(at).ok_or_else(|| ends(at))?);
            at += 1;
            let from = data.len().checked_sub(back + 1).ok_or_else(|| {
                let reason = format!("a repetition reaches back {} bytes of {}", back + 1, data.len());
                FormatError::byte(start + at - 1, reason)
            })?;
            let end = from + count + 2;
            if end <= data.len() {
                data.extend_from_within(from..end);
            } else {
                // A repetition may overlap its own output.
                for byte in from..end {
                    data.push(data[byte]);
                }
            }
        }
        if data.len() > length {
            break;
        }
    }
    if data.len() != length {
        let reason = format!("the compressed data are {} bytes or more, expected {length}", data.len());
        return Err(FormatError::byte(start, reason));
    }
    Ok(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "# .PCD v0.7\nVERSION 0.7\nFIELDS intensity z x y\nSIZE 1 4 8 2\nTYPE U F F I\nCOUNT 2 1 1 1\n\
                          WIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ";

    fn spec(bytes: Vec<u8>) -> ImportSpec {
        ImportSpec::new("a.pcd", bytes)
    }

    fn text(imported: &Imported) -> String {
        imported.terrain.to_text()
    }

    /// Two points, (1, -2, 0.5) and (3, 0, 0.5), point by point and field by field.
    fn points() -> [Vec<u8>; 2] {
        let point = |x: f64, y: i16| {
            [vec![9, 9], 0.5f32.to_le_bytes().to_vec(), x.to_le_bytes().to_vec(), y.to_le_bytes().to_vec()]
        };
        let [a, b] = [point(1.0, -2), point(3.0, 0)];
        let by_field = a.iter().zip(&b).flat_map(|(a, b)| [a.clone(), b.clone()].concat()).collect();
        [[a.concat(), b.concat()].concat(), by_field]
    }

    /// LZF of bytes that are only copied.
    fn copied(bytes: &[u8]) -> Vec<u8> {
        bytes.chunks(32).flat_map(|piece| [&[piece.len() as u8 - 1], piece].concat()).collect()
    }

    fn with_lengths(packed: &[u8], length: usize) -> Vec<u8> {
        [&(packed.len() as u32).to_le_bytes(), &(length as u32).to_le_bytes()[..], packed].concat()
    }

    #[test]
    fn all_encodings_give_the_same_map() {
        let [by_point, by_field] = points();
        let ascii = read(&spec(format!("{HEADER}ascii\n9 9 0.5 1 -2\n\n9 9 0.5 3 0\n").into_bytes())).unwrap();
        let binary = read(&spec([format!("{HEADER}binary\n").as_bytes(), &by_point].concat())).unwrap();
        let data = with_lengths(&copied(&by_field), by_field.len());
        let compressed = read(&spec([format!("{HEADER}binary_compressed\n").as_bytes(), &data].concat())).unwrap();
        let wall = "#####\n".repeat(5);
        assert_eq!(text(&ascii), format!("{wall}\n#####\n#..##\n#...#\n##..#\n#####\n\n{wall}"));
        assert_eq!(ascii, binary);
        assert_eq!(ascii, compressed);
        let stored = with_lengths(&by_field, by_field.len());
        let stored = read(&spec([format!("{HEADER}binary_compressed\n").as_bytes(), &stored].concat())).unwrap();
        assert_eq!(ascii, stored);
    }

    #[test]
    fn headers_of_old_and_short_files_are_read() {
        let points = "0 0 0\n3 0 0\n";
        let read = |header: &str, more: &str| read(&spec(format!("{header}DATA ascii\n{points}{more}").into_bytes()));
        let today = read("FIELDS x y z\nPOINTS 2\n", "").unwrap();
        for header in ["COLUMNS x y z\nPOINTS 2\n", "FIELDS x y z\nWIDTH 1\nHEIGHT 2\n", "COLUMNS x y z\nWIDTH 2\n"] {
            assert_eq!(read(header, "").unwrap(), today, "{header}");
        }
        let windows = read("FIELDS x y z\nPOINTS 4\n", "-nan(ind) 1.#QNAN nan\n-1.#IND 1 2\n").unwrap();
        assert_eq!(windows.terrain, today.terrain);
        assert_eq!(windows.notes[0].text, "2 in 2 cells, 2 dropped because they are not finite");
    }

    #[test]
    fn points_may_say_where_they_were_seen_from() {
        let header = "FIELDS x y z vp_x vp_y vp_z\nVIEWPOINT 9 9 9 1 0 0 0\nPOINTS 2\nDATA ascii\n";
        let seen =
            read(&spec(format!("{header}0.5 0.5 0.5 4.5 0.5 0.5\n0.5 2.5 0.5 3.5 2.5 0.5\n").into_bytes())).unwrap();
        let free = |x: i32, y: i32| seen.terrain.get(voxels::Cell::new(x, y, 1)) == Some(&voxels::Terrain::Free);
        // Cells 1 to 4 in the first row, 1 to 3 in the other one, after a layer of wall.
        let row = |y: i32| (0..7).map(|x| if free(x, y) { '.' } else { '#' }).collect::<String>();
        assert_eq!([row(1), row(2), row(3)], ["##....#", "#######", "##...##"]);
    }

    #[test]
    fn repetitions_are_unpacked() {
        // "ab", then 9 bytes from 2 back, then 2 + 7 + 1 bytes from 1 back.
        let packed = [1, b'a', b'b', 7 << 5, 0, 1, 7 << 5, 1, 0];
        assert_eq!(unpack(&packed, 21, 0).unwrap(), b"abababababaaaaaaaaaaa");
        let refuse = |packed: &[u8], length| unpack(packed, length, 100).unwrap_err().to_string();
        assert_eq!(refuse(&packed[..5], 11), "byte 105: the compressed data end within a piece");
        assert_eq!(refuse(&[0, b'a', 1 << 5, 1], 4), "byte 103: a repetition reaches back 2 bytes of 1");
        assert_eq!(refuse(&packed, 20), "byte 100: the compressed data are 21 bytes or more, expected 20");
        assert_eq!(refuse(&[0], 265), "byte 100: 1 bytes of LZF cannot become 265, at most 264");
    }

    #[test]
    fn errors_name_the_place() {
        let refuse = |text: &str| read(&spec(text.as_bytes().to_vec())).unwrap_err().to_string();
        assert_eq!(refuse(""), "byte 0: the file ends within its header, before DATA");
        assert_eq!(refuse("FIELDS x y\nSIZE 4\n"), "line 2: 1 for 2 fields");
        assert_eq!(refuse("FIELDS x\nSIZE 3\n"), "line 2: SIZE 3, expected 1, 2, 4 or 8");
        assert_eq!(refuse("PONITS 3\n"), "line 1: \"PONITS\" is no key of a PCD header");
        assert_eq!(refuse("FIELDS x y\nPOINTS 1\nDATA ascii\n"), "line 3: there is no field 'z' in FIELDS");
        let xyz = |rest: &str| refuse(&format!("FIELDS x y z\n{rest}"));
        assert_eq!(xyz("DATA ascii\n"), "line 2: DATA comes before POINTS or WIDTH");
        assert_eq!(xyz("POINTS 9\nDATA ascii\n1 2 3\n"), "byte 39: the file ends here after 1 of 9 points");
        assert_eq!(xyz("POINTS 1\nDATA ascii\n1 2 z\n"), "line 4: a coordinate is \"z\", expected a number");
        assert_eq!(
            xyz("POINTS 18446744073709551615\nDATA binary\n1234"),
            "byte 53: the file ends here, data of 18446744073709551615 points takes 18446744073709551615 bytes and 4 are left"
        );
    }
}
