//! Point clouds of the ASPRS: LAS 1.0 to 1.4, all formats of points, and the same compressed (LAZ).
//!
//! Of a point, its coordinates, class, flags and time are used. Points that are flagged as withheld
//! are deleted ones, which stay in the file; so they are dropped unless an option says otherwise.

use super::bytes::Bytes;
use super::cloud::{self, Cloud, Points, Records};
use super::formats::joined;
use super::laz::Compressed;
use super::options::PointFlag;
use super::work::Work;
use super::{FormatError, ImportSpec, Imported, MapReader, Note};

/// Points of a laser scanner, plain or compressed.
pub(super) const READER: MapReader = MapReader {
    in_pieces: Some(in_pieces),
    ..MapReader::new("points of a laser scanner", &["las", "laz"], OPTIONS, read)
};

const OPTIONS: &[&str] = &joined::<{ cloud::OPTIONS.len() + OF_LAS.len() }>(&[cloud::POINTS, OF_LAS, cloud::LIMITS]);
const OF_LAS: &[&str] = &["classes", "drop_flags"];

/// Classes of low and high noise.
const NOISE: [u8; 2] = [7, 18];

/// The class that stood for the flag of overlaps before point format 6.
const OVERLAP: u8 = 12;

/// The first point format with a byte for the class, and the last one of LAS 1.4.
const LONG_FORMAT: u8 = 6;
const FORMAT_MAX: u8 = 10;

/// Offsets in the header.
const VERSION_MINOR: usize = 25;
const HEADER_LENGTH: usize = 94;
const OFFSET_OF_POINTS: usize = 96;
const RECORDS: usize = 100;
const POINT_FORMAT: usize = 104;
const POINT_LENGTH: usize = 105;
const POINTS: usize = 107;
const SCALES: usize = 131;
const OFFSETS: usize = 155;
const POINTS_OF_1_4: usize = 247;

/// Length of the header up to version 1.2.
const HEADER: usize = 227;

/// The bits of the point format that say that the points are compressed.
const COMPRESSED: u8 = 0xc0;

/// A map of a LAS or LAZ file, which of the two is in its header.
///
/// # Errors
/// If the file is malformed, or its points do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let bytes = spec.bytes.as_slice();
    let mut file = Bytes::new(bytes);
    if file.take(4, "the mark LASF")? != b"LASF" {
        return Err(FormatError::byte(0, "the file does not begin with LASF"));
    }
    if bytes.len() < HEADER {
        return Err(FormatError::byte(bytes.len(), format!("the file ends within its header of {HEADER} bytes")));
    }
    let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
    let u32_at = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|byte| bytes[at + byte]));
    let f64_at = |at: usize| f64::from_le_bytes([0, 1, 2, 3, 4, 5, 6, 7].map(|byte| bytes[at + byte]));
    let format = bytes[POINT_FORMAT] & !COMPRESSED;
    let mut count = u64::from(u32_at(POINTS));
    if count == 0 && bytes[VERSION_MINOR] >= 4 && bytes.len() >= POINTS_OF_1_4 + 8 {
        count = u64::from(u32_at(POINTS_OF_1_4)) | u64::from(u32_at(POINTS_OF_1_4 + 4)) << 32;
    }
    let (start, length) = (u32_at(OFFSET_OF_POINTS) as usize, usize::from(u16_at(POINT_LENGTH)));
    if length < 12 {
        return Err(FormatError::byte(POINT_LENGTH, format!("a point has {length} bytes, expected 12 or more")));
    }
    let (scales, offsets) = ([0, 8, 16].map(|at| f64_at(SCALES + at)), [0, 8, 16].map(|at| f64_at(OFFSETS + at)));
    let point = |record: &[u8]| {
        [0, 1, 2].map(|axis| {
            let whole = i32::from_le_bytes([0, 1, 2, 3].map(|byte| record[4 * axis + byte]));
            f64::from(whole) * scales[axis] + offsets[axis]
        })
    };
    let mut work = Work::new(spec);
    let mut chosen = Chosen::new(spec, format);
    let mut kept_in_file = None;
    let packing = if bytes[POINT_FORMAT] & COMPRESSED == 0 {
        if count > spec.length().saturating_sub(start as u64) / length as u64 {
            let reason =
                format!("the file ends here, {count} points of {length} bytes from byte {start} on do not fit in");
            return Err(FormatError::byte(usize::try_from(spec.length()).unwrap_or(usize::MAX), reason));
        }
        let choice = Choice::new(spec, format);
        let decode = move |record: &[u8]| choice.keeps(record).then(|| point(record));
        let records = Records::new(spec, start, length, count as usize, decode)?;
        let is_held = chosen.has_times;
        records.each(|record| chosen.add(record, if is_held { Some(point(record)) } else { None }));
        if !is_held {
            kept_in_file = Some(records);
        }
        ""
    } else {
        let (header, records) = (usize::from(u16_at(HEADER_LENGTH)), u32_at(RECORDS));
        let compressed = Compressed { bytes, header, records, start, length, count };
        compressed.points(&mut work, |record| chosen.add(record, Some(point(record))))?;
        ", compressed"
    };
    let note = Note::new("las", format!("point format {format}, {count} points{packing}"));
    let notes = std::iter::once(note).chain(chosen.notes()).collect();
    if chosen.kept == 0 && count > 0 {
        return Err(FormatError::Nothing("point of these classes and flags (classes, drop_flags)"));
    }
    let points = kept_in_file.map_or(Points::Held(chosen.points), Points::Records);
    cloud::map_with(spec, Cloud { points, times_s: chosen.times_s, notes, ..Cloud::default() }, work)
}

/// Whether a file is read a piece at a time, of which the header is at hand: plain points whose
/// times are of no use.
fn in_pieces(spec: &ImportSpec) -> bool {
    let is_plain = spec.bytes.get(POINT_FORMAT).is_some_and(|format| format & COMPRESSED == 0);
    is_plain && spec.options.trajectory.is_none()
}

/// The class, the flags and the time of a point.
struct Attributes {
    class: u8,
    /// Bits: synthetic, key point, withheld, overlap.
    flags: u8,
    time_s: Option<f64>,
}

impl Attributes {
    /// Those of a record; nothing of a format that is not known.
    fn of(record: &[u8], format: u8) -> Self {
        let byte = |at: usize| record.get(at).copied().unwrap_or(0);
        let time_at = |at: usize| {
            let bytes = record.get(at..at + 8)?;
            Some(f64::from_le_bytes(bytes.try_into().ok()?))
        };
        match format {
            0..LONG_FORMAT => {
                let class = byte(15) & 0x1f;
                let flags = byte(15) >> 5 | if class == OVERLAP { 8 } else { 0 };
                Self { class, flags, time_s: if matches!(format, 0 | 2) { None } else { time_at(20) } }
            }
            LONG_FORMAT..=FORMAT_MAX => Self { class: byte(16), flags: byte(15) & 0xf, time_s: time_at(22) },
            _ => Self { class: 0, flags: 0, time_s: None },
        }
    }
}

/// Which points the options choose.
#[derive(Clone)]
struct Choice {
    format: u8,
    /// `None`: all.
    classes: Option<Vec<u8>>,
    /// Bits of the flags of points to drop.
    unwanted: u8,
}

impl Choice {
    fn new(spec: &ImportSpec, format: u8) -> Self {
        let options = &spec.options;
        let flags = options.drop_flags.as_deref().unwrap_or(&[PointFlag::Withheld]);
        let unwanted = (0..FLAGS.len()).filter(|&bit| flags.contains(&FLAGS[bit].0)).map(|bit| 1 << bit).sum();
        Self { format, classes: options.classes.clone(), unwanted }
    }

    /// Whether a point is one of them.
    fn keeps(&self, record: &[u8]) -> bool {
        let Attributes { class, flags, .. } = Attributes::of(record, self.format);
        flags & self.unwanted == 0 && self.has_class(class)
    }

    fn has_class(&self, class: u8) -> bool {
        self.classes.as_ref().is_none_or(|classes| classes.contains(&class))
    }
}

/// The points that the options choose.
struct Chosen {
    choice: Choice,
    /// Those that are not read again, with their times.
    points: Vec<[f64; 3]>,
    times_s: Vec<f64>,
    has_times: bool,
    kept: u64,
    dropped: [u64; FLAGS.len()],
    of_other_classes: u64,
    noise: u64,
}

/// The flags of a point, in the order of their bits.
const FLAGS: [(PointFlag, &str); 4] = [
    (PointFlag::Synthetic, "synthetic"),
    (PointFlag::KeyPoint, "key points"),
    (PointFlag::Withheld, "withheld"),
    (PointFlag::Overlap, "overlap"),
];

impl Chosen {
    fn new(spec: &ImportSpec, format: u8) -> Self {
        Self {
            choice: Choice::new(spec, format),
            points: Vec::new(),
            times_s: Vec::new(),
            has_times: spec.options.trajectory.is_some(),
            kept: 0,
            dropped: [0; FLAGS.len()],
            of_other_classes: 0,
            noise: 0,
        }
    }

    /// Counts a point, and why it is dropped if it is; `point` is to be held.
    fn add(&mut self, record: &[u8], point: Option<[f64; 3]>) {
        let Attributes { class, flags, time_s } = Attributes::of(record, self.choice.format);
        let unwanted = flags & self.choice.unwanted;
        if unwanted != 0 {
            self.dropped[unwanted.trailing_zeros() as usize] += 1;
        } else if !self.choice.has_class(class) {
            self.of_other_classes += 1;
        } else {
            self.kept += 1;
            self.noise += u64::from(NOISE.contains(&class));
            self.points.extend(point);
            self.times_s.extend(time_s.filter(|_| self.has_times));
        }
    }

    fn notes(&self) -> Vec<Note> {
        let mut notes: Vec<Note> = FLAGS
            .iter()
            .zip(self.dropped)
            .filter(|&(_, count)| count > 0)
            .map(|((_, name), count)| {
                Note::new("flags", format!("{count} points dropped that are flagged as {name} (drop_flags)"))
            })
            .collect();
        if let Some(classes) = &self.choice.classes {
            let text = format!("{classes:?}; {} points of other classes dropped", self.of_other_classes);
            notes.push(Note::new("classes", text));
        } else if self.noise > 0 {
            let text = format!(
                "{} points are of the classes 7 and 18, which stand for noise; map.import.classes (--classes) names those to \
                 keep",
                self.noise
            );
            notes.push(Note::warning("noise", text));
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(points: &[[i32; 3]]) -> Vec<u8> {
        let mut bytes = vec![0; HEADER];
        bytes[..4].copy_from_slice(b"LASF");
        (bytes[24], bytes[25]) = (1, 2);
        bytes[OFFSET_OF_POINTS..][..4].copy_from_slice(&(HEADER as u32).to_le_bytes());
        bytes[POINT_LENGTH..][..2].copy_from_slice(&20u16.to_le_bytes());
        bytes[POINTS..][..4].copy_from_slice(&(points.len() as u32).to_le_bytes());
        for axis in 0..3 {
            bytes[SCALES + 8 * axis..][..8].copy_from_slice(&0.5f64.to_le_bytes());
            bytes[OFFSETS + 8 * axis..][..8].copy_from_slice(&1000f64.to_le_bytes());
        }
        for point in points {
            bytes.extend(point.iter().flat_map(|along| along.to_le_bytes()));
            bytes.extend([0; 8]);
        }
        bytes
    }

    #[test]
    fn points_have_scales_and_offsets() {
        let imported = read(&ImportSpec::new("a.las", file(&[[0, 0, 0], [4, 2, 1]]))).unwrap();
        assert_eq!(imported.terrain.extent().size(), [5, 4, 3]);
        assert_eq!(imported.origin_m, Some([999.0; 3]));
        assert_eq!(mapgen::free_cells(&imported.terrain), 3 * 2 - 2);
    }

    /// A file of point format 0 or 6 whose points have these classes and flags.
    fn file_with(format: u8, attributes: &[(u8, u8)]) -> Vec<u8> {
        let length = if format == 0 { 20 } else { 30 };
        let mut bytes = file(&[]);
        bytes[POINT_FORMAT] = format;
        bytes[POINT_LENGTH] = length;
        bytes[POINTS..][..4].copy_from_slice(&(attributes.len() as u32).to_le_bytes());
        for (number, &(class, flags)) in attributes.iter().enumerate() {
            let mut record = vec![0; usize::from(length)];
            record[..4].copy_from_slice(&(number as u32 * 4).to_le_bytes());
            if format == 0 {
                record[15] = class | flags << 5;
            } else {
                (record[15], record[16]) = (flags, class);
            }
            bytes.extend(record);
        }
        bytes
    }

    #[test]
    fn classes_and_flags_choose_points() {
        const SYNTHETIC: u8 = 1;
        const WITHHELD: u8 = 4;
        for format in [0, 6] {
            let points = [(2, 0), (6, 0), (2, WITHHELD), (7, 0), (2, SYNTHETIC), (2, WITHHELD | SYNTHETIC)];
            let with = |classes: Option<&[u8]>, drop_flags: Option<&[PointFlag]>| {
                let (classes, drop_flags) = (classes.map(<[u8]>::to_vec), drop_flags.map(<[PointFlag]>::to_vec));
                let options = crate::ImportOptions { classes, drop_flags, ..Default::default() };
                read(&ImportSpec { options, ..ImportSpec::new("a.las", file_with(format, &points)) })
            };
            let of = |classes, flags| {
                let imported = with(classes, flags).unwrap();
                let used = imported.notes.iter().find(|note| note.name == "points").unwrap().text.clone();
                (used.split(' ').next().unwrap().parse::<u32>().unwrap(), imported.notes)
            };
            let (used, notes) = of(None, None);
            assert_eq!(used, 4, "{format}");
            assert_eq!(notes[1].text, "2 points dropped that are flagged as withheld (drop_flags)");
            assert!(notes[2].is_warning && notes[2].text.starts_with("1 points are of the classes 7 and 18"));
            assert_eq!(of(None, Some(&[PointFlag::None])).0, 6);
            assert_eq!(of(None, Some(&[PointFlag::Synthetic])).0, 4);
            assert_eq!(of(None, Some(&[PointFlag::Synthetic, PointFlag::Withheld])).0, 3);
            let (used, notes) = of(Some(&[2, 6]), None);
            assert_eq!((used, notes.iter().any(|note| note.is_warning)), (3, false));
            assert!(notes.iter().any(|note| note.text == "[2, 6]; 1 points of other classes dropped"), "{notes:?}");
            assert!(with(Some(&[9]), None).unwrap_err().to_string().contains("(classes, drop_flags)"));
        }
    }

    #[test]
    fn errors_name_the_byte() {
        let refuse = |bytes: Vec<u8>| read(&ImportSpec::new("a.las", bytes)).unwrap_err().to_string();
        assert_eq!(refuse(b"LASX".to_vec()), "byte 0: the file does not begin with LASF");
        assert_eq!(refuse(b"LASF".to_vec()), "byte 4: the file ends within its header of 227 bytes");
        let mut laz = file(&[[0; 3]]);
        laz[POINT_FORMAT] = 0x81;
        assert_eq!(refuse(laz), "byte 0: the file has no record of the compression of its points");
        let mut short = file(&[[0; 3]]);
        short[POINTS + 3] = 255;
        assert!(refuse(short).starts_with("byte 247: the file ends here, 4278190081 points of 20 bytes"));
    }
}
