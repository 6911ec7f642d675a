//! Bits of packed maps: exponential Golomb codes, most significant bit first.

/// Length of the code of `value` of order `order`, in bits.
pub(super) fn code_bits(value: u32, order: u8) -> u32 {
    let above = bit_length((u64::from(value) >> order) + 1);
    2 * above - 1 + u32::from(order)
}

fn bit_length(value: u64) -> u32 {
    u64::BITS - value.leading_zeros()
}

/// Codes as bytes.
#[derive(Default)]
pub(super) struct BitWriter {
    bytes: Vec<u8>,
    /// Number of bits used in the last byte; 0: the last byte is complete.
    used: u32,
}

impl BitWriter {
    /// Adds the code of `value`.
    pub(super) fn code(&mut self, value: u32, order: u8) {
        let above = (u64::from(value) >> order) + 1;
        let length = bit_length(above);
        // The leading zeros are those of a longer number.
        self.bits(above, 2 * length - 1);
        self.bits(u64::from(value), order.into());
    }

    /// Adds the lowest `count` bits of `value`, at most 64 of which are not 0.
    fn bits(&mut self, value: u64, count: u32) {
        for bit in (0..count).rev() {
            if self.used == 0 {
                self.bytes.push(0);
            }
            let is_set = bit < u64::BITS && value >> bit & 1 == 1;
            if is_set && let Some(last) = self.bytes.last_mut() {
                *last |= 0x80 >> self.used;
            }
            self.used = (self.used + 1) % 8;
        }
    }

    /// All bytes, the last one padded with zeros.
    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}

/// Codes from bytes.
pub(super) struct BitReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> BitReader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next value; `None` if the bits end first or it has more than 32 bits.
    pub(super) fn code(&mut self, order: u8) -> Option<u32> {
        let mut zeros = 0;
        while !self.bit()? {
            zeros += 1;
            if zeros > u32::BITS {
                return None;
            }
        }
        let mut value = 1u64;
        for _ in 0..zeros {
            value = value << 1 | u64::from(self.bit()?);
        }
        value -= 1;
        for _ in 0..order {
            value = value << 1 | u64::from(self.bit()?);
        }
        u32::try_from(value).ok()
    }

    fn bit(&mut self) -> Option<bool> {
        let byte = *self.bytes.get(self.at / 8)?;
        let bit = byte << (self.at % 8) & 0x80 != 0;
        self.at += 1;
        Some(bit)
    }

    /// Whether only the zero padding of the last byte is left.
    pub(super) fn is_at_end(&self) -> bool {
        let rest = self.bytes.len() * 8 - self.at;
        let is_clear =
            self.bytes.last().is_none_or(|&last| rest == 0 || u32::from(last) << (8 - rest.min(8)) & 0xff == 0);
        rest < 8 && is_clear
    }
}
