//! Bit strings in bytes: the first bit is the lowest of the first byte.
//!
//! A *word* is a number of a given width, lowest bit first. A *gap* is a number n >= 0 in an
//! Elias-gamma-like code, short for small numbers: with k bits of n + 1 after its top one, k ones,
//! a zero, and these k bits as a word.

/// Greatest width of a word, bits.
const WORD_BITS_MAX: u32 = 32;

/// Appends bits to bytes.
pub(super) struct Writer<'a> {
    bytes: &'a mut Vec<u8>,
    /// Fewer than 32 bits that are not written yet.
    rest: u64,
    rest_bits: u32,
}

impl<'a> Writer<'a> {
    /// Appends to whole bytes.
    pub(super) fn new(bytes: &'a mut Vec<u8>) -> Self {
        Self { bytes, rest: 0, rest_bits: 0 }
    }

    /// A word of 0 to 32 bits; all higher bits must be 0.
    pub(super) fn word(&mut self, word: u32, bits: u32) {
        debug_assert!(bits == WORD_BITS_MAX || word >> bits == 0);
        self.rest |= u64::from(word) << self.rest_bits;
        self.rest_bits += bits;
        if self.rest_bits >= 32 {
            self.bytes.extend_from_slice(&(self.rest as u32).to_le_bytes());
            self.rest >>= 32;
            self.rest_bits -= 32;
        }
    }

    /// A gap below 2^30.
    pub(super) fn gap(&mut self, gap: u32) {
        let bits = (gap + 1).ilog2();
        self.word((1 << bits) - 1, bits + 1);
        self.word(gap + 1 - (1 << bits), bits);
    }

    /// Pads the last byte with zeros.
    pub(super) fn end(self) {
        let bytes = self.rest_bits.div_ceil(8) as usize;
        self.bytes.extend_from_slice(&self.rest.to_le_bytes()[..bytes]);
    }
}

/// Length of a gap, bits.
pub(super) fn gap_bits(gap: u32) -> u32 {
    2 * (gap + 1).ilog2() + 1
}

/// Reads bits. Beyond the end it reads zeros, which [`Reader::has_overrun`] reports.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    /// Number of bits read.
    at: usize,
}

impl<'a> Reader<'a> {
    /// Reads from the first bit on.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next bits, at least 57.
    pub(super) fn ahead(&self) -> u64 {
        let byte = self.at / 8;
        let next = match self.bytes.get(byte..byte + 8).and_then(|bytes| bytes.first_chunk()) {
            Some(chunk) => u64::from_le_bytes(*chunk),
            None => {
                let rest = self.bytes.get(byte..).unwrap_or_default();
                rest.iter().rev().fold(0, |bits, &byte| bits << 8 | u64::from(byte))
            }
        };
        next >> (self.at % 8)
    }

    /// Advances by this many bits.
    pub(super) fn skip(&mut self, bits: u32) {
        self.at += bits as usize;
    }

    /// A word of 0 to 32 bits.
    pub(super) fn word(&mut self, bits: u32) -> u32 {
        let word = self.ahead() & ((1 << bits) - 1);
        self.at += bits as usize;
        word as u32
    }

    /// One bit.
    pub(super) fn bit(&mut self) -> bool {
        self.word(1) != 0
    }

    /// A gap; `None` if it is too large for a map.
    pub(super) fn gap(&mut self) -> Option<u32> {
        let ahead = self.ahead();
        let bits = ahead.trailing_ones();
        if bits > 24 {
            return None;
        }
        self.at += 2 * bits as usize + 1;
        let word = (ahead >> (bits + 1)) as u32 & ((1 << bits) - 1);
        Some(word + (1 << bits) - 1)
    }

    /// Whether bits beyond the end were read.
    pub(super) fn has_overrun(&self) -> bool {
        self.at > 8 * self.bytes.len()
    }

    /// Number of unread whole bytes, and the unread bits of the byte before them.
    pub(super) fn rest(&self) -> (usize, u8) {
        let touched = self.at.div_ceil(8);
        let bits = if self.at.is_multiple_of(8) { 0 } else { self.bytes[touched - 1] >> (self.at % 8) };
        (self.bytes.len() - touched, bits)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn bit_for_bit_as_documented() {
        let mut bytes = vec![9];
        let mut writer = Writer::new(&mut bytes);
        writer.word(0b101, 3);
        (0..4).for_each(|gap| writer.gap(gap));
        writer.end();
        assert_eq!(bytes, [9, 0b1001_0101, 0b0000_1110]);
        assert_eq!([0, 1, 2, 3, 6, 7, 1 << 24].map(gap_bits), [1, 3, 3, 5, 5, 7, 49]);
        let mut reader = Reader::new(&bytes[1..]);
        assert_eq!((reader.word(3), reader.gap(), reader.gap(), reader.gap()), (0b101, Some(0), Some(1), Some(2)));
        assert_eq!((reader.rest(), reader.has_overrun()), ((0, 0b11), false));
        assert_eq!((reader.gap(), reader.has_overrun()), (Some(3), false));
        assert_eq!((reader.rest(), reader.word(2), reader.has_overrun()), ((0, 0), 0, true));
        assert_eq!(Reader::new(&[0xff; 8]).gap(), None);
    }

    proptest! {
        #[test]
        fn bits_round_trip(words in prop::collection::vec((any::<bool>(), any::<u32>(), 0u32..=24), 0..60)) {
            let mut bytes = Vec::new();
            let mut writer = Writer::new(&mut bytes);
            let masked = |(is_gap, word, bits): (bool, u32, u32)| (is_gap, word & ((1 << bits) - 1), bits);
            let words: Vec<(bool, u32, u32)> = words.into_iter().map(masked).collect();
            let mut bits_written = 0;
            for &(is_gap, word, bits) in &words {
                if is_gap {
                    writer.gap(word);
                    bits_written += gap_bits(word);
                } else {
                    writer.word(word, bits);
                    bits_written += bits;
                }
            }
            writer.end();
            prop_assert_eq!(bytes.len(), bits_written.div_ceil(8) as usize);
            let mut reader = Reader::new(&bytes);
            for (is_gap, word, bits) in words {
                prop_assert_eq!(if is_gap { reader.gap().unwrap() } else { reader.word(bits) }, word);
            }
            prop_assert!(!reader.has_overrun());
            prop_assert_eq!(reader.rest(), (0, 0));
        }
    }
}
