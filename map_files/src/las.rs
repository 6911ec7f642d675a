//! Point clouds of the ASPRS: LAS 1.0 to 1.4, all formats of points, and the same compressed (LAZ).
//!
//! Of a point, its coordinates are used.

use super::bytes::Bytes;
use super::cloud::{self, Sensors};
use super::laz::Compressed;
use super::work::Work;
use super::{FormatError, ImportSpec, Imported, MapReader, Note};

/// Points of a laser scanner, plain or compressed.
pub(super) const READER: MapReader = MapReader::new("points of a laser scanner", &["las", "laz"], cloud::OPTIONS, read);

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
    let (points, packing) = if bytes[POINT_FORMAT] & COMPRESSED == 0 {
        let data = bytes.get(start..).unwrap_or_default();
        if count > (data.len() / length) as u64 {
            let reason =
                format!("the file ends here, {count} points of {length} bytes from byte {start} on do not fit in");
            return Err(FormatError::byte(bytes.len(), reason));
        }
        (data.chunks_exact(length).take(count as usize).map(point).collect(), "")
    } else {
        let (header, records) = (usize::from(u16_at(HEADER_LENGTH)), u32_at(RECORDS));
        let mut points: Vec<[f64; 3]> = Vec::new();
        let compressed = Compressed { bytes, header, records, start, length, count };
        compressed.points(&mut work, |record| points.push(point(record)))?;
        (points, ", compressed")
    };
    let note = Note::new("las", format!("point format {format}, {count} points{packing}"));
    cloud::map_with(spec, &points, &Sensors::None, vec![note], work)
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
