//! M3DM map files: the format of MAES3D, byte for byte (docs/reference-model.md, "Map file
//! format").
//!
//! A bit stream, most significant bit first: `W:7 | H:7 | D:7 | offset:3`, then `offset` zero bits
//! that make the file a whole number of bytes, then W * H * D bits (1 = wall) with the first
//! coordinate slowest and the last fastest. The axes of MAES3D are left-handed with y up, ours are
//! right-handed with z up: our x is its x, our y its z, our z its y. That change mirrors nothing.
//! So W, H, D are our sizes along x, z, y, and the bits run with our x slowest, then z, y fastest.
//!
//! The file holds no cell length: cells read from it are 1 m long. Larger maps and smaller files:
//! [`crate::packed`]. Open shells and pockets are not repaired here but by the importer.

use thiserror::Error;

use crate::{Extent, Grid, Terrain};

/// Length of the header in bytes.
const HEADER: usize = 3;

/// The largest size along an axis: seven bits.
pub const AXIS_MAX: u32 = 127;

/// The reason why bytes are not an M3DM map, or why a map cannot be written as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum M3dmError {
    /// The file is shorter than its header.
    #[error("byte {got}: the file ends within its header, expected length at least 3 bytes")]
    Header {
        /// Length of the file.
        got: usize,
    },
    /// An axis of size 0.
    #[error(
        "byte {byte}: size {axis} is 0, allowed are 1 to 127; \
         expected length 3 + (W * H * D + offset) / 8 bytes"
    )]
    EmptyAxis {
        /// The byte in which the size begins.
        byte: usize,
        /// `W`, `H` or `D`.
        axis: char,
    },
    /// The header's number of padding bits does not fit its size.
    #[error(
        "byte 2: offset is {got}, a map of W x H x D = {w} x {h} x {d} cells needs {needed}; \
         expected length {length} bytes"
    )]
    Offset {
        /// The padding bits that the header announces.
        got: u32,
        /// The padding bits that make the file a whole number of bytes.
        needed: u32,
        /// First size.
        w: u32,
        /// Second size.
        h: u32,
        /// Third size.
        d: u32,
        /// The length of the file that the header requires, bytes.
        length: usize,
    },
    /// Bytes are missing at the end.
    #[error("byte {got}: the file ends here, expected length {length} bytes")]
    Truncated {
        /// Length of the file.
        got: usize,
        /// The length of the file that the header requires, bytes.
        length: usize,
    },
    /// Bytes follow the last cell.
    #[error("byte {length}: {surplus} bytes follow the last cell, expected length {length} bytes")]
    Trailing {
        /// The length of the file that the header requires, bytes.
        length: usize,
        /// Number of bytes too many.
        surplus: usize,
    },
    /// A padding bit is set.
    #[error(
        "byte 3: the {offset} padding bits are not all 0 (byte value {value:#04x}); \
         expected length {length} bytes"
    )]
    Padding {
        /// Number of padding bits.
        offset: u32,
        /// The byte that holds them.
        value: u8,
        /// The length of the file that the header requires, bytes.
        length: usize,
    },
    /// The map to be written has an axis that seven bits cannot hold.
    #[error("map size along {axis} is {cells} cells, an M3DM file holds 1 to 127")]
    TooLarge {
        /// `x`, `y` or `z`.
        axis: char,
        /// Number of cells along it.
        cells: u32,
    },
}

/// The header, and what follows from it.
struct Header {
    w: u32,
    h: u32,
    d: u32,
    offset: u32,
}

impl Header {
    fn of(extent: Extent) -> Self {
        let [w, d, h] = extent.size();
        Self { w, h, d, offset: (w * h * d).wrapping_neg() % 8 }
    }

    fn file_length(&self) -> usize {
        HEADER + ((self.w * self.h * self.d + self.offset) / 8) as usize
    }

    fn to_bytes(&self) -> [u8; HEADER] {
        let bits = self.w << 17 | self.h << 10 | self.d << 3 | self.offset;
        let [_, bytes @ ..] = bits.to_be_bytes();
        bytes
    }

    fn from_bytes(bytes: [u8; HEADER]) -> Self {
        let [a, b, c] = bytes.map(u32::from);
        let bits = a << 16 | b << 8 | c;
        Self { w: bits >> 17, h: bits >> 10 & 0x7f, d: bits >> 3 & 0x7f, offset: bits & 7 }
    }
}

/// Reads a map from the bytes of an M3DM file; cells are 1 m long.
///
/// # Errors
/// If the header, a size, the padding or the length is wrong; the error names the byte offset and
/// the expected length.
pub fn read(bytes: &[u8]) -> Result<Grid<Terrain>, M3dmError> {
    let got = bytes.len();
    let &[a, b, c, ref cells @ ..] = bytes else {
        return Err(M3dmError::Header { got });
    };
    let header = Header::from_bytes([a, b, c]);
    let extent = check(&header, got, cells)?;

    let mut terrain = Grid::new(extent, Terrain::Free);
    for (bit, index) in (header.offset as usize..).zip(file_order(extent)) {
        if cells[bit / 8] << (bit % 8) & 0x80 != 0 {
            terrain[index] = Terrain::Wall;
        }
    }
    Ok(terrain)
}

fn check(header: &Header, got: usize, cells: &[u8]) -> Result<Extent, M3dmError> {
    let &Header { w, h, d, offset } = header;
    for (byte, axis, size) in [(0, 'W', w), (0, 'H', h), (1, 'D', d)] {
        if size == 0 {
            return Err(M3dmError::EmptyAxis { byte, axis });
        }
    }
    let extent = Extent::new([w, d, h], 1.0).expect("sizes are 1 to 127");
    let sound = Header::of(extent);
    let length = sound.file_length();
    if offset != sound.offset {
        return Err(M3dmError::Offset { got: offset, needed: sound.offset, w, h, d, length });
    }
    if got < length {
        return Err(M3dmError::Truncated { got, length });
    }
    if got > length {
        return Err(M3dmError::Trailing { length, surplus: got - length });
    }
    let value = cells[0];
    if u32::from(value) >> (8 - offset) != 0 {
        return Err(M3dmError::Padding { offset, value, length });
    }
    Ok(extent)
}

/// Writes a map as the bytes of an M3DM file; the length of its cells is lost.
///
/// # Errors
/// If an axis has more than [`AXIS_MAX`] cells.
pub fn write(terrain: &Grid<Terrain>) -> Result<Vec<u8>, M3dmError> {
    let extent = terrain.extent();
    for (axis, cells) in ['x', 'y', 'z'].into_iter().zip(extent.size()) {
        if cells > AXIS_MAX {
            return Err(M3dmError::TooLarge { axis, cells });
        }
    }
    let header = Header::of(extent);
    let mut bytes = vec![0; header.file_length()];
    bytes[..HEADER].copy_from_slice(&header.to_bytes());
    for (bit, index) in (header.offset as usize..).zip(file_order(extent)) {
        if terrain[index] == Terrain::Wall {
            bytes[HEADER + bit / 8] |= 0x80 >> (bit % 8);
        }
    }
    Ok(bytes)
}

/// The cell indices in the order of the file's bits.
fn file_order(extent: Extent) -> impl Iterator<Item = usize> {
    let [size_x, size_y, size_z] = extent.size().map(|cells| cells as usize);
    (0..size_x)
        .flat_map(move |x| (0..size_z).flat_map(move |z| (0..size_y).map(move |y| (z * size_y + y) * size_x + x)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cell;
    use proptest::prelude::*;

    /// 2 x 3 x 1 cells, walls at (0, 0), (0, 2) and (1, 1): W 2, H 1, D 3, two padding bits.
    const SMALL: [u8; 4] = [0b0000_0100, 0b0000_0100, 0b0001_1010, 0b0010_1010];

    fn small() -> Grid<Terrain> {
        Grid::from_text("#.\n.#\n#.\n").unwrap()
    }

    fn message(bytes: &[u8]) -> String {
        read(bytes).unwrap_err().to_string()
    }

    #[test]
    fn a_small_map_has_exactly_these_bytes() {
        assert_eq!(write(&small()).unwrap(), SMALL);
        assert_eq!(read(&SMALL).unwrap(), small());
    }

    #[test]
    fn x_is_slowest_and_y_fastest() {
        let mut terrain = Grid::new(Extent::new([2, 2, 2], 1.0).unwrap(), Terrain::Free);
        let bits = |terrain: &Grid<Terrain>| write(terrain).unwrap()[3];
        for (cell, byte) in
            [(Cell::new(0, 1, 0), 0b0100_0000), (Cell::new(0, 0, 1), 0b0110_0000), (Cell::new(1, 0, 0), 0b0110_1000)]
        {
            terrain.set(cell, Terrain::Wall);
            assert_eq!(bits(&terrain), byte, "{cell:?}");
        }
    }

    #[test]
    fn the_header_of_a_50_cube() {
        let terrain = Grid::new(Extent::new([50; 3], 1.0).unwrap(), Terrain::Wall);
        let bytes = write(&terrain).unwrap();
        assert_eq!(bytes[..3], [0x64, 0xC9, 0x90]);
        assert_eq!(bytes.len(), 15_628);
        assert!(bytes[3..].iter().all(|&byte| byte == 0xFF));
    }

    #[test]
    fn a_35_cube_has_5_padding_bits() {
        let terrain = Grid::new(Extent::new([35; 3], 1.0).unwrap(), Terrain::Wall);
        let bytes = write(&terrain).unwrap();
        assert_eq!((bytes[2] & 7, bytes[3], bytes.len()), (5, 0b0000_0111, 3 + 5360));
        assert_eq!(read(&bytes), Ok(terrain));
    }

    #[test]
    fn errors_name_the_byte_and_the_expected_length() {
        let expected = "byte 2: the file ends within its header, expected length at least 3 bytes";
        assert_eq!(message(&SMALL[..2]), expected);
        assert_eq!(message(&SMALL[..3]), "byte 3: the file ends here, expected length 4 bytes");
        let long = [SMALL.as_slice(), &[0, 0]].concat();
        assert_eq!(message(&long), "byte 4: 2 bytes follow the last cell, expected length 4 bytes");

        let with = |byte: usize, value: u8| {
            let mut bytes = SMALL;
            bytes[byte] = value;
            message(&bytes)
        };
        assert_eq!(
            with(2, 0b0001_1000),
            "byte 2: offset is 0, a map of W x H x D = 2 x 1 x 3 cells needs 2; \
             expected length 4 bytes"
        );
        assert_eq!(
            with(3, 0b0110_1010),
            "byte 3: the 2 padding bits are not all 0 (byte value 0x6a); expected length 4 bytes"
        );
        assert!(with(0, 0).starts_with("byte 0: size W is 0, allowed are 1 to 127; expected"));
        assert!(with(1, 0).starts_with("byte 0: size H is 0"));
        assert!(with(2, 2).starts_with("byte 1: size D is 0"));
    }

    #[test]
    fn sizes_beyond_seven_bits_are_refused() {
        let terrain = Grid::new(Extent::new([127, 128, 1], 1.0).unwrap(), Terrain::Free);
        let error = write(&terrain).unwrap_err();
        assert_eq!(error.to_string(), "map size along y is 128 cells, an M3DM file holds 1 to 127");
        let largest = Grid::new(Extent::new([127; 3], 1.0).unwrap(), Terrain::Wall);
        assert_eq!(read(&write(&largest).unwrap()), Ok(largest));
    }

    fn any_map() -> impl Strategy<Value = Grid<Terrain>> {
        prop::array::uniform3(1u32..12).prop_flat_map(|size| {
            let extent = Extent::new(size, 1.0).unwrap();
            let cell = prop_oneof![Just(Terrain::Free), Just(Terrain::Wall)];
            prop::collection::vec(cell, extent.volume()).prop_map(move |cells| Grid::from_vec(extent, cells).unwrap())
        })
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(terrain in any_map()) {
            let bytes = write(&terrain).unwrap();
            prop_assert_eq!(read(&bytes), Ok(terrain));
        }

        #[test]
        fn only_the_bytes_of_a_map_are_read(bytes in prop::collection::vec(any::<u8>(), 0..12)) {
            if let Ok(terrain) = read(&bytes) {
                prop_assert_eq!(write(&terrain).unwrap(), bytes);
            }
        }

        #[test]
        fn a_damaged_map_is_refused_or_another_map(
            terrain in any_map(), at in any::<prop::sample::Index>(), flip in 1u8..=255,
        ) {
            let mut bytes = write(&terrain).unwrap();
            let at = at.index(bytes.len());
            bytes[at] ^= flip;
            if let Ok(other) = read(&bytes) {
                prop_assert_ne!(&other, &terrain);
                prop_assert_eq!(write(&other).unwrap(), bytes);
            }
        }
    }
}
