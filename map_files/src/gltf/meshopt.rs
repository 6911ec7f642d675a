//! Buffer views compressed by `EXT_meshopt_compression` of glTF, whose specification has the
//! formats: version 0 of attributes, version 1 of triangles, and sequences of indices.
//!
//! The memory that a view takes when it is unpacked is bounded by its reader before.

/// Bytes of a block of vertices, and most vertices of one.
const BLOCK_BYTES: usize = 8192;
const BLOCK_VERTICES: usize = 256;

/// Vertices of a group, which share the number of bits of a byte.
const GROUP: usize = 16;

/// Least bytes after the blocks, which begin with the first vertex.
const TAIL_BYTES: usize = 32;

/// Bytes after a sequence of indices.
const SEQUENCE_TAIL: usize = 4;

/// What the bytes of a view are.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// Elements of a fixed length.
    Attributes,
    /// Three indices for each triangle.
    Triangles,
    /// Indices.
    Indices,
}

/// Bytes that are left of compressed data.
struct Rest<'a>(&'a [u8]);

impl<'a> Rest<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|taken| taken[0])
    }

    /// A number in groups of seven bits, the lowest first.
    fn varint(&mut self) -> Option<u32> {
        let mut number = 0u32;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            number |= u32::from(byte & 0x7f).wrapping_shl(shift);
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }
}

/// The bytes of `count` elements of `stride` bytes; `None` if the data are damaged or not of these
/// formats.
pub(super) fn unpack(data: &[u8], mode: Mode, count: usize, stride: usize) -> Option<Vec<u8>> {
    match mode {
        Mode::Attributes => attributes(data, count, stride),
        Mode::Triangles => with_width(&triangles(data, count)?, stride),
        Mode::Indices => with_width(&sequence(data, count)?, stride),
    }
}

fn with_width(indices: &[u32], stride: usize) -> Option<Vec<u8>> {
    let is_width = matches!(stride, 2 | 4);
    is_width.then(|| indices.iter().flat_map(|index| index.to_le_bytes()[..stride].to_vec()).collect())
}

fn attributes(data: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    if !(4..=256).contains(&stride) || !stride.is_multiple_of(4) {
        return None;
    }
    let mut rest = Rest(data);
    if rest.byte()? != 0xa0 {
        return None;
    }
    let blocks_end = rest.0.len().checked_sub(stride.max(TAIL_BYTES))?;
    let mut last = rest.0[rest.0.len() - stride..].to_vec();
    rest.0 = &rest.0[..blocks_end];
    let block = ((BLOCK_BYTES / stride) & !(GROUP - 1)).min(BLOCK_VERTICES);
    let mut unpacked = vec![0; count.checked_mul(stride)?];
    for vertices in unpacked.chunks_mut(block * stride) {
        let groups = (vertices.len() / stride).div_ceil(GROUP);
        for (at, last) in last.iter_mut().enumerate() {
            let bits = rest.take(groups.div_ceil(4))?;
            for group in 0..groups {
                let deltas = deltas(&mut rest, bits[group / 4] >> (group % 4 * 2) & 3)?;
                for (place, delta) in deltas.into_iter().enumerate() {
                    // Zigzag: the lowest bit is the sign.
                    *last = last.wrapping_add(delta >> 1 ^ (delta & 1).wrapping_neg());
                    if let Some(byte) = vertices.get_mut((group * GROUP + place) * stride + at) {
                        *byte = *last;
                    } else {
                        break;
                    }
                }
            }
        }
        // A group that is not full has moved on beyond the last vertex.
        last.copy_from_slice(&vertices[vertices.len() - stride..]);
    }
    Some(unpacked)
}

/// The deltas of a byte of the vertices of a group.
fn deltas(rest: &mut Rest<'_>, mode: u8) -> Option<[u8; GROUP]> {
    let bits = match mode {
        0 => return Some([0; GROUP]),
        1 => 2,
        2 => 4,
        _ => return rest.take(GROUP)?.try_into().ok(),
    };
    let packed = rest.take(GROUP * bits / 8)?;
    let most = (1u8 << bits) - 1;
    let mut deltas = [0; GROUP];
    for (place, delta) in deltas.iter_mut().enumerate() {
        let bit = place * bits;
        let short = packed[bit / 8] >> (8 - bits - bit % 8) & most;
        // The largest stands for a whole byte behind them.
        *delta = if short == most { rest.byte()? } else { short };
    }
    Some(deltas)
}

/// The last sixteen of something, the newest first.
struct Recent<T> {
    items: [T; 16],
    next: usize,
}

impl<T: Copy + Default> Recent<T> {
    fn new() -> Self {
        Self { items: [T::default(); 16], next: 0 }
    }

    fn push(&mut self, item: T) {
        self.items[self.next] = item;
        self.next = (self.next + 1) % 16;
    }

    /// The newest one is 0.
    fn get(&self, back: u8) -> T {
        self.items[(self.next + 31 - usize::from(back)) % 16]
    }
}

/// The next index as a difference to the last one.
fn index(rest: &mut Rest<'_>, last: &mut u32) -> Option<u32> {
    let delta = rest.varint()?;
    *last = last.wrapping_add(delta >> 1 ^ (delta & 1).wrapping_neg());
    Some(*last)
}

fn triangles(data: &[u8], count: usize) -> Option<Vec<u32>> {
    if !count.is_multiple_of(3) {
        return None;
    }
    let mut rest = Rest(data);
    let header = rest.byte()?;
    let far_codes = match header {
        0xe0 => 15,
        0xe1 => 13,
        _ => return None,
    };
    let codes = rest.take(count / 3)?;
    let (data, pairs) = rest.0.split_at_checked(rest.0.len().checked_sub(16)?)?;
    let mut rest = Rest(data);
    let mut edges: Recent<[u32; 2]> = Recent::new();
    let mut vertices: Recent<u32> = Recent::new();
    let (mut next, mut last) = (0u32, 0u32);
    let mut indices = Vec::with_capacity(count);
    for &code in codes {
        let fresh = |next: &mut u32| {
            *next = next.wrapping_add(1);
            next.wrapping_sub(1)
        };
        let triangle = if code < 0xf0 {
            // An edge of one of the last triangles, and a vertex.
            let [a, b] = edges.get(code >> 4);
            let way = code & 15;
            let c = match way {
                0 => fresh(&mut next),
                way if way < far_codes => vertices.get(way),
                13 => {
                    last = last.wrapping_sub(1);
                    last
                }
                14 => {
                    last = last.wrapping_add(1);
                    last
                }
                _ => index(&mut rest, &mut last)?,
            };
            if way == 0 || way >= far_codes {
                vertices.push(c);
            }
            edges.push([c, b]);
            edges.push([a, c]);
            [a, b, c]
        } else {
            // A vertex of its own, and two others.
            let is_far = code >= 0xfe;
            let pair = if is_far { rest.byte()? } else { pairs[usize::from(code & 15)] };
            if is_far && pair == 0 {
                next = 0;
            }
            let ways = [if code == 0xff { 15 } else { 0 }, pair >> 4, pair & 15];
            let before = vertices.next;
            let of_before = |way: u8| vertices.items[(before + 16 - usize::from(way)) % 16];
            let mut corners = ways.map(of_before);
            for (corner, way) in corners.iter_mut().zip(ways) {
                if way == 0 {
                    *corner = fresh(&mut next);
                }
            }
            for (corner, way) in corners.iter_mut().zip(ways) {
                if is_far && way == 15 {
                    *corner = index(&mut rest, &mut last)?;
                }
            }
            for (corner, way) in corners.into_iter().zip(ways) {
                if way == 0 || (is_far && way == 15) {
                    vertices.push(corner);
                }
            }
            let [a, b, c] = corners;
            edges.push([b, a]);
            edges.push([c, b]);
            edges.push([a, c]);
            corners
        };
        indices.extend(triangle);
    }
    Some(indices)
}

fn sequence(data: &[u8], count: usize) -> Option<Vec<u32>> {
    let mut rest = Rest(data);
    if !matches!(rest.byte()?, 0xd0 | 0xd1) {
        return None;
    }
    rest.0 = &rest.0[..rest.0.len().checked_sub(SEQUENCE_TAIL)?];
    let mut last = [0u32; 2];
    (0..count)
        .map(|_| {
            let number = rest.varint()?;
            // The lowest bit names one of two indices, the next one is the sign.
            let (last, delta) = (&mut last[number as usize & 1], number >> 1);
            *last = last.wrapping_add(delta >> 1 ^ (delta & 1).wrapping_neg());
            Some(*last)
        })
        .collect()
}

/// The values of exponential floats, as floats: an exponent in the upper eight bits of each four
/// bytes, and a factor in the others.
pub(super) fn from_exponents(bytes: &mut [u8]) {
    for number in bytes.chunks_exact_mut(4) {
        let packed = i32::from_le_bytes([number[0], number[1], number[2], number[3]]);
        let (exponent, factor) = (packed >> 24, packed << 8 >> 8);
        let value = libm::ldexp(f64::from(factor), exponent) as f32;
        number.copy_from_slice(&value.to_le_bytes());
    }
}
