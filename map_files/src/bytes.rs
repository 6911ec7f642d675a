//! A reader of bytes and lines with errors that name the position.

use std::borrow::Cow;

use super::FormatError;

/// Longest piece of a file that an error repeats, in bytes.
const SHOWN_MAX: usize = 40;

/// What some editors and programs put before a text in UTF-8.
pub(super) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// A file as it is, or a text of UTF-16 with a byte order mark, as Windows writes it, in UTF-8.
pub(super) fn in_utf8(bytes: &[u8]) -> Cow<'_, [u8]> {
    let unit: fn([u8; 2]) -> u16 = match bytes {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ => return Cow::Borrowed(bytes),
    };
    let units = bytes[2..].chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    let text: String = char::decode_utf16(units).map(|letter| letter.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    Cow::Owned(text.into_bytes())
}

/// The rest of a file from a position on.
pub(super) struct Bytes<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    /// What ends a line.
    end: u8,
}

impl<'a> Bytes<'a> {
    /// A reader at the first byte.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let first = bytes.iter().position(|byte| matches!(byte, b'\r' | b'\n')).unwrap_or(0);
        // Old programs end lines with a carriage return alone.
        let is_alone = matches!(bytes.get(first..first + 2), Some([b'\r', next]) if !matches!(next, b'\r' | b'\n'));
        Self { bytes, at: 0, line: 0, end: if is_alone { b'\r' } else { b'\n' } }
    }

    /// The position of the next byte.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// All bytes that are left.
    pub(super) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// The next `count` bytes.
    ///
    /// # Errors
    /// If the file ends before; the error names `what`.
    pub(super) fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8], FormatError> {
        let rest = self.rest();
        if rest.len() < count {
            let reason = format!("the file ends here, {what} takes {count} bytes and {} are left", rest.len());
            return Err(FormatError::byte(self.at, reason));
        }
        self.at += count;
        Ok(&rest[..count])
    }

    /// The next four bytes as a little-endian number.
    ///
    /// # Errors
    /// If the file ends before.
    pub(super) fn u32(&mut self, what: &str) -> Result<u32, FormatError> {
        let bytes = self.take(4, what)?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    /// The next line, without its end and without a byte order mark at the start of the file, and
    /// its number from 1; `None` at the end.
    pub(super) fn line(&mut self) -> Option<(usize, &'a [u8])> {
        if self.at == 0 && self.bytes.starts_with(BYTE_ORDER_MARK) {
            self.at = BYTE_ORDER_MARK.len();
        }
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let length = memchr::memchr(self.end, rest).unwrap_or(rest.len());
        self.at += (length + 1).min(rest.len());
        self.line += 1;
        Some((self.line, rest[..length].trim_ascii_end()))
    }

    /// The next line of a header that is not complete yet.
    ///
    /// # Errors
    /// If the file ends first.
    pub(super) fn header_line(&mut self, until: &str) -> Result<(usize, &'a [u8]), FormatError> {
        let at = self.at;
        self.line().ok_or_else(|| FormatError::byte(at, format!("the file ends within its header, before {until}")))
    }
}

/// The words of a line.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// Most digits of a number that 64 bits hold, whatever they are.
const DIGITS_MAX: usize = 18;

/// A word of a few digits as a number, which is most of a mesh as text.
pub(super) fn digits(word: &[u8]) -> Option<i64> {
    if !(1..=DIGITS_MAX).contains(&word.len()) {
        return None;
    }
    word.iter().try_fold(0, |number, byte| byte.is_ascii_digit().then(|| number * 10 + i64::from(byte - b'0')))
}

/// A word as a number.
///
/// # Errors
/// If it is not a number; the error names the line and `what`.
pub(super) fn number<T: std::str::FromStr>(line: usize, word: Option<&[u8]>, what: &str) -> Result<T, FormatError> {
    let Some(word) = word else {
        return Err(FormatError::line(line, format!("{what} is missing")));
    };
    let parsed = str::from_utf8(word).ok().and_then(|word| word.parse().ok());
    parsed.ok_or_else(|| FormatError::line(line, format!("{what} is {}, expected a number", shown(word))))
}

/// A word as a number with a fraction, or as one that is not finite in the words of any C library.
///
/// # Errors
/// If it is not a number; the error names the line and `what`.
pub(super) fn float(line: usize, word: Option<&[u8]>, what: &str) -> Result<f64, FormatError> {
    let Some(word) = word else {
        return Err(FormatError::line(line, format!("{what} is missing")));
    };
    parse_float(word).ok_or_else(|| {
        let advice = match decimal_comma(word) {
            Some(_) => "; write numbers with a point (LC_NUMERIC=C)",
            None => "",
        };
        FormatError::line(line, format!("{what} is {}, expected a number{advice}", shown(word)))
    })
}

/// As [`float`], without a reason.
pub(super) fn parse_float(word: &[u8]) -> Option<f64> {
    if let Ok(number) = str::from_utf8(word).ok()?.parse() {
        return Some(number);
    }
    // Those of Fortran: 0.5D+00.
    if word.iter().all(|byte| byte.is_ascii_digit() || b"+-.dD".contains(byte)) {
        return str::from_utf8(word).ok()?.replace(['d', 'D'], "e").parse().ok();
    }
    // Those of Windows: 1.#QNAN, -1.#IND00 and nan(ind); of others: -nan(0x7ffff).
    let lower = word.to_ascii_lowercase();
    let unsigned = lower.strip_prefix(b"-").or(lower.strip_prefix(b"+")).unwrap_or(&lower);
    let is_nan = [b"1.#qnan".as_slice(), b"1.#snan", b"1.#ind", b"nan("].iter().any(|nan| unsigned.starts_with(nan));
    (is_nan || unsigned.starts_with(b"1.#inf")).then_some(f64::NAN)
}

/// A word with a comma between digits, as some languages write fractions, as a number.
pub(super) fn decimal_comma(word: &[u8]) -> Option<f64> {
    let at = word.iter().position(|&byte| byte == b',')?;
    let is_digit = |byte: Option<&u8>| byte.is_some_and(u8::is_ascii_digit);
    if !is_digit(word[..at].last()) || !is_digit(word.get(at + 1)) {
        return None;
    }
    let mut pointed = word.to_vec();
    pointed[at] = b'.';
    parse_float(&pointed)
}

/// Three numbers.
///
/// # Errors
/// If one is missing or not a number.
pub(super) fn three<'a>(
    line: usize,
    words: &mut impl Iterator<Item = &'a [u8]>,
    what: &str,
) -> Result<[f64; 3], FormatError> {
    let mut place = [0.0; 3];
    for along in &mut place {
        *along = float(line, words.next(), what)?;
    }
    Ok(place)
}

/// An excerpt of a file for an error message: one line, whatever the file contains.
pub(super) fn shown(piece: &[u8]) -> String {
    format!("{:?}", String::from_utf8_lossy(&piece[..piece.len().min(SHOWN_MAX)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_as_the_first_one_does() {
        let lines = |text: &'static str| {
            let mut bytes = Bytes::new(text.as_bytes());
            std::iter::from_fn(|| bytes.line()).map(|(_, line)| str::from_utf8(line).unwrap()).collect::<Vec<_>>()
        };
        for text in ["a\nb\n\nc", "a\r\nb\r\n\r\nc\r\n", "a\rb\r\rc\r"] {
            assert_eq!(lines(text), ["a", "b", "", "c"], "{text:?}");
        }
        assert_eq!(lines("a\r\r\nb"), ["a", "b"]);
        assert_eq!(lines("a\r"), ["a"]);
    }

    #[test]
    fn numbers_are_read_in_all_spellings() {
        for nan in ["nan", "-nan", "NaN", "-nan(ind)", "nan(snan)", "1.#QNAN", "-1.#IND00", "-nan(0x8000)", "1.#INF"] {
            assert!(parse_float(nan.as_bytes()).is_some_and(|number| !number.is_finite()), "{nan}");
        }
        assert_eq!(["1.5", "-2e3", "+4"].map(|word| parse_float(word.as_bytes())), [Some(1.5), Some(-2e3), Some(4.0)]);
        assert_eq!(["0.5D+00", "-2d3", "D"].map(|word| parse_float(word.as_bytes())), [Some(0.5), Some(-2e3), None]);
        for bytes in [b"\xff\xfe1\0 \0", b"\xfe\xff\x001\0 "] {
            assert_eq!(*in_utf8(bytes), *b"1 ");
        }
        assert_eq!(*in_utf8(b"1 "), *b"1 ");
        assert_eq!(
            ["0", "007", "123456789012345678"].map(|word| digits(word.as_bytes())),
            [Some(0), Some(7), Some(123_456_789_012_345_678)]
        );
        assert_eq!(["", "-1", "+1", "1.5", "1234567890123456789"].map(|word| digits(word.as_bytes())), [None; 5]);
        assert_eq!(["", "x", "1.#", "1,5", "nano"].map(|word| parse_float(word.as_bytes())), [None; 5]);
        assert_eq!(["-1,5", "2,25e1"].map(|word| decimal_comma(word.as_bytes())), [Some(-1.5), Some(22.5)]);
        assert_eq!(["1,", ",5", "1,2,3", "1.5,2", "15"].map(|word| decimal_comma(word.as_bytes())), [None; 5]);
        let refused = float(3, Some(b"0,5"), "a coordinate").unwrap_err().to_string();
        assert_eq!(
            refused,
            "line 3: a coordinate is \"0,5\", expected a number; write numbers with a point (LC_NUMERIC=C)"
        );
    }
}
