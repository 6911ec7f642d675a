//! Buffer views compressed by `EXT_meshopt_compression` and `KHR_meshopt_compression` of glTF,
//! whose specifications have the formats: versions 0 and 1 of attributes and of triangles, and
//! sequences of indices.
//!
//! Looked at: the crate meshopt builds the whole of meshoptimizer in C++; what is needed is here.
//!
//! The memory that a view takes when it is unpacked is bounded by its reader before.

/// Bytes of a block of vertices, and most vertices of one.
const BLOCK_BYTES: usize = 8192;
const BLOCK_VERTICES: usize = 256;

/// Vertices of a group, which share the number of bits of a byte.
const GROUP: usize = 16;

/// Least bytes after the blocks, which end with the first vertex and, from version 1, the channels:
/// how the numbers in each four bytes of a vertex follow from those of the vertex before.
const TAIL_BYTES: [usize; 2] = [32, 24];

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
    let (channels_bytes, tail_min) = match rest.byte()? {
        0xa0 => (0, TAIL_BYTES[0]),
        0xa1 => (stride / 4, TAIL_BYTES[1]),
        _ => return None,
    };
    let tail_bytes = stride + channels_bytes;
    let blocks_end = rest.0.len().checked_sub(tail_bytes.max(tail_min))?;
    let (mut last, channels) = {
        let (first, channels) = rest.0[rest.0.len() - tail_bytes..].split_at(stride);
        (first.to_vec(), channels.iter().map(|&channel| Channel::of(channel)).collect::<Option<Vec<_>>>()?)
    };
    rest.0 = &rest.0[..blocks_end];
    let block = ((BLOCK_BYTES / stride) & !(GROUP - 1)).min(BLOCK_VERTICES);
    let mut unpacked = vec![0; count.checked_mul(stride)?];
    let mut columns: [Vec<u8>; 4] = Default::default();
    for vertices in unpacked.chunks_mut(block * stride) {
        let vertex_count = vertices.len() / stride;
        let control = rest.take(channels_bytes)?;
        for four in 0..stride / 4 {
            for (byte, column) in columns.iter_mut().enumerate() {
                // Four ways of version 1, of which two differ in the numbers of bits.
                let way = control.get(four).map(|control| control >> (2 * byte) & 3);
                column.clear();
                match way {
                    None => unpack_column(&mut rest, vertex_count, [0, 2, 4, 8], column)?,
                    Some(0) => unpack_column(&mut rest, vertex_count, [0, 1, 2, 4], column)?,
                    Some(1) => unpack_column(&mut rest, vertex_count, [1, 2, 4, 8], column)?,
                    Some(2) => column.resize(vertex_count, 0),
                    Some(_) => column.extend(rest.take(vertex_count)?),
                }
            }
            let channel = channels.get(four).copied().unwrap_or(Channel::Bytes);
            let last: &mut [u8; 4] = (&mut last[4 * four..4 * four + 4]).try_into().ok()?;
            for vertex in 0..vertex_count {
                *last = channel.next(*last, [0, 1, 2, 3].map(|byte| columns[byte][vertex]));
                vertices[vertex * stride + 4 * four..][..4].copy_from_slice(last);
            }
        }
    }
    Some(unpacked)
}

/// How four bytes of a vertex follow from those of the vertex before.
#[derive(Clone, Copy)]
enum Channel {
    /// Differences of each byte.
    Bytes,
    /// Differences of two numbers of 16 bits.
    Halves,
    /// Bits that differ, turned right by so many.
    Bits(u32),
}

impl Channel {
    fn of(channel: u8) -> Option<Self> {
        match channel & 3 {
            0 => Some(Self::Bytes),
            1 => Some(Self::Halves),
            2 => Some(Self::Bits(u32::from(channel >> 4))),
            _ => None,
        }
    }

    fn next(self, last: [u8; 4], delta: [u8; 4]) -> [u8; 4] {
        // Zigzag: the lowest bit is the sign.
        match self {
            Self::Bytes => {
                [0, 1, 2, 3].map(|byte| last[byte].wrapping_add(delta[byte] >> 1 ^ (delta[byte] & 1).wrapping_neg()))
            }
            Self::Halves => {
                let halves = |bytes: [u8; 4]| [0, 2].map(|at| u16::from_le_bytes([bytes[at], bytes[at + 1]]));
                let (last, delta) = (halves(last), halves(delta));
                let next = [0, 1].map(|half| {
                    let delta: u16 = delta[half];
                    last[half].wrapping_add(delta >> 1 ^ (delta & 1).wrapping_neg()).to_le_bytes()
                });
                [next[0][0], next[0][1], next[1][0], next[1][1]]
            }
            Self::Bits(right) => {
                (u32::from_le_bytes(last) ^ u32::from_le_bytes(delta).rotate_right(right)).to_le_bytes()
            }
        }
    }
}

/// One byte of all vertices of a block: groups, of which two bits each say which of these numbers
/// of bits its deltas have.
fn unpack_column(rest: &mut Rest<'_>, count: usize, bits: [usize; 4], column: &mut Vec<u8>) -> Option<()> {
    let groups = count.div_ceil(GROUP);
    let chosen = rest.take(groups.div_ceil(4))?;
    for group in 0..groups {
        let bits = bits[usize::from(chosen[group / 4] >> (group % 4 * 2) & 3)];
        column.extend(deltas(rest, bits)?);
    }
    // The last group may not be full.
    column.truncate(count);
    Some(())
}

/// The deltas of a group, of so many bits each: 0, 1, 2, 4 or 8.
fn deltas(rest: &mut Rest<'_>, bits: usize) -> Option<[u8; GROUP]> {
    match bits {
        0 => return Some([0; GROUP]),
        8 => return rest.take(GROUP)?.try_into().ok(),
        _ => {}
    }
    let packed = rest.take(GROUP * bits / 8)?;
    let most = (1u8 << bits) - 1;
    let mut deltas = [0; GROUP];
    for (place, delta) in deltas.iter_mut().enumerate() {
        let bit = place * bits;
        // Single bits begin with the lowest of a byte, others with the highest.
        let shift = if bits == 1 { bit % 8 } else { 8 - bits - bit % 8 };
        let short = packed[bit / 8] >> shift & most;
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

/// Rotations of four numbers of 16 bits: the three smallest components of a quaternion, and the
/// scale of them, whose lowest two bits say which the largest is. As normalised numbers.
pub(super) fn from_rotations(bytes: &mut [u8]) {
    for rotation in bytes.chunks_exact_mut(8) {
        let number = |at: usize| i16::from_le_bytes([rotation[2 * at], rotation[2 * at + 1]]);
        let scale = std::f64::consts::FRAC_1_SQRT_2 / f64::from(number(3) | 3);
        let largest = (number(3) & 3) as usize;
        let small = [0, 1, 2].map(|at| f64::from(number(at)) * scale);
        let rest = 1.0 - small.iter().map(|component| component * component).sum::<f64>();
        let mut whole = [0.0; 4];
        whole[largest] = rest.max(0.0).sqrt();
        for (at, component) in small.into_iter().enumerate() {
            whole[(largest + 1 + at) % 4] = component;
        }
        for (two, component) in rotation.chunks_exact_mut(2).zip(whole) {
            let normalised = (component * f64::from(i16::MAX)).round() as i16;
            two.copy_from_slice(&normalised.to_le_bytes());
        }
    }
}
