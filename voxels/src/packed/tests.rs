use super::*;
use crate::m3dm;
use proptest::prelude::*;

fn small() -> Grid<Terrain> {
    let drawn = Grid::from_text("####\n#..#\n#.##\n####\n").unwrap();
    Grid::from_vec(Extent::new([4, 4, 1], 0.5).unwrap(), drawn.into_vec()).unwrap()
}

fn message(bytes: &[u8]) -> String {
    message_within(bytes, usize::MAX)
}

fn message_within(bytes: &[u8], cells_max: usize) -> String {
    read(bytes, cells_max).unwrap_err().to_string()
}

/// The bytes with a corrected checksum.
fn with_sum(mut bytes: Vec<u8>) -> Vec<u8> {
    let sum = sum_of(&bytes);
    bytes[SUM].copy_from_slice(&sum.to_le_bytes());
    bytes
}

#[test]
fn a_small_map_has_these_fields() {
    let bytes = write(&small());
    assert_eq!(bytes[..9], *b"\0M3DMRLE\x01");
    assert_eq!(bytes[12..24], [4, 0, 0, 0, 4, 0, 0, 0, 1, 0, 0, 0]);
    assert_eq!(bytes[24..32], 0.5f64.to_le_bytes());
    assert!(is_packed(&bytes) && is_packed(&bytes[..3]));
    assert_eq!(read(&bytes, 16), Ok(small()));
    assert_eq!(extent(&bytes), Ok(small().extent()));
}

#[test]
fn no_plain_map_is_taken_for_a_packed_one() {
    for wall in [Terrain::Free, Terrain::Wall] {
        for size_x in 1..=127 {
            let plain = m3dm::write(&Grid::new(Extent::new([size_x, 1, 1], 1.0).unwrap(), wall)).unwrap();
            assert!(!is_packed(&plain) && plain[0] >= 2);
        }
    }
    assert!(!is_packed(&[]));
    assert!(m3dm::read(&write(&small())).is_err());
}

#[test]
fn checksum_is_crc_32() {
    assert_eq!(crc32fast::hash(b"123456789"), 0xCBF4_3926);
}

#[test]
fn a_solid_cube_of_any_size_is_a_header() {
    let solid = Grid::new(Extent::new([300, 200, 1024], 0.1).unwrap(), Terrain::Wall);
    let bytes = write(&solid);
    assert_eq!(bytes.len(), HEADER);
    assert_eq!(read(&bytes, usize::MAX), Ok(solid));
    assert_eq!(message_within(&bytes, 1 << 20), "byte 12: the map has 61440000 cells, allowed are 1048576");
}

#[test]
fn errors_name_the_byte() {
    let bytes = write(&small());
    assert_eq!(message(&bytes[..51]), "byte 51: the file ends here, expected length at least 52 bytes");
    let end = bytes.len();
    assert!(message(&bytes[..end - 1]).starts_with(&format!("byte {}: the file ends here", end - 1)));
    let long = [bytes.as_slice(), &[0, 0]].concat();
    assert!(message(&long).starts_with(&format!("byte {end}: 2 bytes follow the last run")));
    let with = |byte: usize, value: u8| {
        let mut bytes = bytes.clone();
        bytes[byte] = value;
        message(&with_sum(bytes))
    };
    assert_eq!(with(8, 2), "byte 8: the version is 2, allowed is 1");
    assert_eq!(with(9, 25), "byte 9: the order of the codes is 25, allowed is 0 to 24");
    assert_eq!(with(11, 1), "byte 11: the reserved byte is 1, allowed is 0");
    assert_eq!(with(12, 0), "byte 12: map size along x is 0 cells, allowed are 1 to 1024");
    assert!(with(31, 0xff).starts_with("byte 24: cell_m is -"));
    assert_eq!(with(32, 17), "byte 32: the number of runs is 17, allowed is 0 to 16, the number of cells");
    assert!(with(32, 16).contains("is not a code of order"));
    assert!(with(32, 0).contains("do not fill their"), "{}", with(32, 0));
    assert!(with(12, 3).contains("left after its last cell"), "{}", with(12, 3));
    let mut damaged = bytes.clone();
    damaged[end - 1] ^= 1;
    assert!(message(&damaged).contains("the file is damaged"));
}

fn any_map() -> impl Strategy<Value = Grid<Terrain>> {
    (prop::array::uniform3(1u32..9), 0.01f64..10.0).prop_flat_map(|(size, cell_m)| {
        let extent = Extent::new(size, cell_m).unwrap();
        let cell = prop_oneof![1 => Just(Terrain::Free), 3 => Just(Terrain::Wall)];
        prop::collection::vec(cell, extent.volume()).prop_map(move |cells| Grid::from_vec(extent, cells).unwrap())
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read(terrain in any_map()) {
        prop_assert_eq!(read(&write(&terrain), terrain.extent().volume()), Ok(terrain));
    }

    #[test]
    fn truncated_or_damaged_file_is_refused(
        terrain in any_map(), at in any::<prop::sample::Index>(), flip in 1u8..=255,
    ) {
        let mut bytes = write(&terrain);
        let at = at.index(bytes.len());
        prop_assert!(read(&bytes[..at], usize::MAX).is_err());
        bytes[at] ^= flip;
        prop_assert!(at < 8 || read(&bytes, usize::MAX).is_err());
    }

    #[test]
    fn any_fields_and_codes_with_the_right_sum_are_refused_or_a_map(
        terrain in any_map(), changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        let mut bytes = write(&terrain);
        for (at, value) in changes {
            let at = 8 + at.index(bytes.len() - 8);
            bytes[at] = value;
        }
        if let Ok(other) = read(&with_sum(bytes), 1 << 16) {
            prop_assert_eq!(read(&write(&other), 1 << 16), Ok(other));
        }
    }

    #[test]
    fn codes_are_read_as_they_were_written(values in prop::collection::vec(any::<u32>(), 0..20), order in 0u8..=24) {
        let mut written = BitWriter::default();
        values.iter().for_each(|&value| written.code(value, order));
        let bytes = written.into_bytes();
        let bits: u32 = values.iter().map(|&value| code_bits(value, order)).sum();
        prop_assert_eq!(bytes.len(), bits.div_ceil(8) as usize);
        let mut reader = BitReader::new(&bytes);
        for &value in &values {
            prop_assert_eq!(reader.code(order), Some(value));
        }
        prop_assert!(reader.is_at_end());
        prop_assert!(bytes.is_empty() == values.is_empty());
    }
}
