//! Grey pictures of floor plans: PNM (P1 to P3 in text and P4 to P6 in bytes), PNG, BMP and JPEG.
//!
//! Errors repeat nothing of a picture: a map.yaml may name any file as its picture.

use std::io::Cursor;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::bytes::words;
use super::{FormatError, Note};

/// The largest maximum grey value of PNM.
const MAXIMUM: u32 = 65535;

/// Longest side of a picture, pixels: eight pixels for each cell of a map.
const SIDE_MAX: u32 = 8 * 1024;

/// Memory for what a PNG file has beside its pixels, bytes.
const PNG_BYTES_MAX: usize = 1 << 26;

/// What becomes of the orientation that a camera writes into a JPEG file (Exif).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Rows {
    /// Nothing: the rows are taken as the file has them, as the map server does.
    AsStored,
    /// The picture is turned, as those who show it do.
    Upright,
}

/// A picture; its first row is the upper one.
pub(super) struct Picture {
    /// Pixels along a row.
    pub(super) width: u32,
    /// Rows.
    pub(super) height: u32,
    /// The largest brightness.
    pub(super) maximum: u32,
    /// Whether the file has a channel, or a colour, for transparency.
    pub(super) has_alpha: bool,
    /// Whether it was compressed in a way that changes brightness.
    pub(super) is_lossy: bool,
    /// The pixels, row by row.
    pub(super) pixels: Vec<Pixel>,
    /// Bytes after the last pixel of a PNM file.
    pub(super) excess_bytes: usize,
    /// Whether it was turned because its file says so.
    pub(super) is_turned: bool,
}

/// A pixel, in parts of the largest brightness.
#[derive(Clone, Copy)]
pub(super) struct Pixel {
    /// The mean of its colours.
    pub(super) brightness: f32,
    /// 0 if it is transparent, the largest brightness if it is opaque.
    pub(super) alpha: f32,
}

/// The brightness that counts as white in a picture, or in all pictures of a stack.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum White {
    /// The largest of the format; transparent pixels are black.
    OfFormat,
    /// That of transparent pixels, because no opaque one is as bright as the threshold.
    Transparent,
    /// This share of the largest of the format, because no pixel is as bright as the threshold.
    Brightest(f64),
}

impl White {
    /// That of pictures, so that some pixel is bright.
    ///
    /// # Errors
    /// If all of them are black.
    pub(super) fn of(pictures: &Summary, threshold: f64) -> Result<Self, FormatError> {
        match pictures.brightest {
            brightest if brightest >= threshold => Ok(Self::OfFormat),
            _ if pictures.has_transparent => Ok(Self::Transparent),
            brightest if brightest > 0.0 => Ok(Self::Brightest(brightest)),
            _ => Err(FormatError::Nothing("pixel that is not black")),
        }
    }

    /// A warning that the white is not that of the format.
    pub(super) fn note(self) -> Option<Note> {
        let text = match self {
            Self::OfFormat => return None,
            Self::Transparent => "no opaque pixel is bright: the transparent ones count as white".to_owned(),
            Self::Brightest(share) => format!(
                "the brightest pixel has {share:.4} of the largest brightness and counts as white; --threshold counts \
                 from there"
            ),
        };
        Some(Note::warning("white", text))
    }
}

/// What decides the [`White`] of pictures.
#[derive(Clone, Copy, Default)]
pub(super) struct Summary {
    /// The brightest opaque pixel, as a share of the largest brightness.
    brightest: f64,
    has_transparent: bool,
}

impl Summary {
    /// That of one more picture as well.
    pub(super) fn and(self, picture: &Picture) -> Self {
        let maximum = f64::from(picture.maximum);
        picture.pixels.iter().fold(self, |Self { brightest, has_transparent }, pixel| match pixel.is_opaque(maximum) {
            true => Self { brightest: brightest.max(f64::from(pixel.brightness) / maximum), has_transparent },
            false => Self { brightest, has_transparent: true },
        })
    }
}

impl Pixel {
    /// Whether it is more opaque than transparent.
    fn is_opaque(self, maximum: f64) -> bool {
        f64::from(self.alpha) * 2.0 > maximum
    }

    /// Whether its brightness is at least `threshold` times the white.
    pub(super) fn is_bright(self, threshold: f64, white: White, maximum: u32) -> bool {
        let maximum = f64::from(maximum);
        let [brightness, alpha] = [self.brightness, self.alpha].map(f64::from);
        match white {
            White::OfFormat => self.is_opaque(maximum) && brightness >= threshold * maximum,
            White::Transparent => brightness * alpha / maximum + (maximum - alpha) >= threshold * maximum,
            // Without rounding of the share, so that the brightest pixel is bright.
            White::Brightest(share) => brightness / maximum >= threshold * share,
        }
    }
}

impl Picture {
    /// A file of the format that it begins as, whatever its name. `check` refuses a size before
    /// there are pixels.
    ///
    /// # Errors
    /// If the file is malformed.
    pub(super) fn read(
        bytes: &[u8],
        rows: Rows,
        check: impl Fn([u32; 2]) -> Result<(), FormatError>,
    ) -> Result<Self, FormatError> {
        let check = |size: [u32; 2]| match size.into_iter().find(|side| !(1..=SIDE_MAX).contains(side)) {
            Some(side) => {
                Err(FormatError::byte(0, format!("a side of the picture is {side}, allowed is 1 to {SIDE_MAX}")))
            }
            None => check(size),
        };
        match bytes {
            [0x89, b'P', b'N', b'G', ..] => png(bytes, check),
            [b'B', b'M', ..] => other(bytes, ImageFormat::Bmp, rows, check),
            [0xff, 0xd8, 0xff, ..] => other(bytes, ImageFormat::Jpeg, rows, check),
            _ => pnm(bytes, check),
        }
    }

    /// A warning of bytes after the last pixel, or a note that it was turned.
    pub(super) fn note(&self) -> Option<Note> {
        let text = format!("{} bytes after the last pixel are not read", self.excess_bytes);
        let turned = || Note::new("turned", "the picture is upright as its file says (Exif orientation)".to_owned());
        (self.excess_bytes > 0).then(|| Note::warning("rest", text)).or_else(|| self.is_turned.then(turned))
    }
}

/// The kind of a picture that is not read, by its first bytes.
fn kind_not_read(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [b'G', b'I', b'F', b'8', ..] => Some("GIF"),
        [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..] => Some("TIFF"),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Some("WebP"),
        _ => None,
    }
}

fn png(bytes: &[u8], check: impl Fn([u32; 2]) -> Result<(), FormatError>) -> Result<Picture, FormatError> {
    let fault = |error: png::DecodingError| {
        FormatError::byte(0, format!("the PNG file is damaged: {}", error.to_string().escape_debug()))
    };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: PNG_BYTES_MAX });
    decoder.set_ignore_text_chunk(true);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(fault)?;
    let (width, height) = reader.info().size();
    check([width, height])?;
    let length = reader.output_buffer_size().ok_or(FormatError::Memory(width as usize * height as usize))?;
    let mut data = vec![0; length];
    let info = reader.next_frame(&mut data).map_err(fault)?;
    let channels = info.color_type.samples();
    let has_alpha = matches!(channels, 2 | 4);
    let (width_bytes, maximum) = if info.bit_depth == png::BitDepth::Sixteen { (2, MAXIMUM) } else { (1, 255) };
    let pixel = |samples: &[u8]| {
        let sample = |bytes: &[u8]| bytes.iter().fold(0, |sample, &byte| sample << 8 | u32::from(byte));
        let colours = if has_alpha { channels - 1 } else { channels };
        let sum: u32 = samples.chunks_exact(width_bytes).take(colours).map(sample).sum();
        let alpha = samples.chunks_exact(width_bytes).nth(colours).map_or(maximum, sample);
        // Numbers of 18 bits have their place in 24.
        Pixel { brightness: sum as f32 / colours as f32, alpha: alpha as f32 }
    };
    let pixels = data[..info.buffer_size()].chunks_exact(channels * width_bytes).map(pixel).collect();
    Ok(Picture { width, height, maximum, has_alpha, is_lossy: false, pixels, excess_bytes: 0, is_turned: false })
}

/// A picture of a format of the crate `image`.
fn other(
    bytes: &[u8],
    format: ImageFormat,
    rows: Rows,
    check: impl Fn([u32; 2]) -> Result<(), FormatError>,
) -> Result<Picture, FormatError> {
    // Its reasons may repeat bytes of the file.
    let fault = |_| FormatError::byte(0, format!("the {format:?} file is damaged, or of a kind that is not read"));
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIDE_MAX);
    limits.max_image_height = Some(SIDE_MAX);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(fault)?;
    let orientation = match rows {
        Rows::AsStored => Orientation::NoTransforms,
        Rows::Upright => decoder.orientation().map_err(fault)?,
    };
    let (width, height) = decoder.dimensions();
    let is_on_its_side = matches!(
        orientation,
        Orientation::Rotate90 | Orientation::Rotate270 | Orientation::Rotate90FlipH | Orientation::Rotate270FlipH
    );
    let (width, height) = if is_on_its_side { (height, width) } else { (width, height) };
    check([width, height])?;
    let mut picture = DynamicImage::from_decoder(decoder).map_err(fault)?;
    picture.apply_orientation(orientation);
    let has_alpha = picture.color().has_alpha();
    let pixel = |pixel: &image::Rgba<u8>| {
        let [red, green, blue, alpha] = pixel.0;
        let sum: u16 = [red, green, blue].into_iter().map(u16::from).sum();
        Pixel { brightness: f32::from(sum) / 3.0, alpha: f32::from(alpha) }
    };
    let pixels = picture.to_rgba8().pixels().map(pixel).collect();
    let is_lossy = format == ImageFormat::Jpeg;
    let is_turned = orientation != Orientation::NoTransforms;
    Ok(Picture { width, height, maximum: 255, has_alpha, is_lossy, pixels, excess_bytes: 0, is_turned })
}

fn pnm(bytes: &[u8], check: impl Fn([u32; 2]) -> Result<(), FormatError>) -> Result<Picture, FormatError> {
    let mut tokens = Tokens { bytes, at: 0 };
    let (at, kind) = tokens.next("P1 to P6")?;
    let (is_text, channels) = match kind {
        b"P1" | b"P4" => return pbm(tokens, kind == b"P1", check),
        b"P2" => (true, 1),
        b"P3" => (true, 3),
        b"P5" => (false, 1),
        b"P6" => (false, 3),
        _ => {
            let kind = kind_not_read(bytes).unwrap_or("no picture");
            let reason =
                format!("the file begins as {kind}, read are PNM (P1 to P6), PNG, BMP and JPEG; save it as PNG");
            return Err(FormatError::byte(at, reason));
        }
    };
    let (width, height) = (tokens.number("the width", u32::MAX)?, tokens.number("the height", u32::MAX)?);
    let maximum = tokens.number("the largest brightness", MAXIMUM)?;
    if maximum == 0 {
        return Err(FormatError::byte(tokens.at, format!("the largest brightness is 0, allowed is 1 to {MAXIMUM}")));
    }
    check([width, height])?;
    let pixels = width as usize * height as usize;
    let samples = if is_text {
        // A number and its separator.
        let room = (bytes.len() - tokens.at).div_ceil(2);
        if room < pixels * channels {
            return Err(FormatError::byte(bytes.len(), format!("the file ends here, {pixels} pixels do not fit in")));
        }
        (0..pixels * channels).map(|_| tokens.number("a pixel", maximum)).collect::<Result<Vec<_>, _>>()?
    } else {
        raster(&mut tokens, pixels * channels, maximum)?
    };
    // Sums of three numbers of 16 bits have their place in 24.
    let brightness = samples.chunks_exact(channels).map(|colours| colours.iter().sum::<u32>() as f32 / channels as f32);
    Ok(opaque([width, height], maximum, brightness, tokens.excess_bytes(is_text)))
}

/// A picture in black, 1, and white.
fn pbm(
    mut tokens: Tokens<'_>,
    is_text: bool,
    check: impl Fn([u32; 2]) -> Result<(), FormatError>,
) -> Result<Picture, FormatError> {
    let (width, height) = (tokens.number("the width", u32::MAX)?, tokens.number("the height", u32::MAX)?);
    check([width, height])?;
    let (pixels, row) = (width as usize * height as usize, (width as usize).div_ceil(8));
    let is_black: Vec<bool> = if is_text {
        // Digits may stand side by side.
        let mut digits: Vec<bool> = Vec::new();
        while digits.len() < pixels {
            let (at, word) = tokens.next("a pixel")?;
            if let Some(place) = word.iter().position(|digit| !matches!(digit, b'0' | b'1')) {
                return Err(FormatError::byte(at + place, "a pixel is none, allowed are 0 and 1"));
            }
            digits.extend(word.iter().map(|&digit| digit == b'1'));
        }
        digits
    } else {
        // Each row begins a byte.
        let bytes = raster(&mut tokens, row * height as usize, 255)?;
        let bits = |row: &[u32]| (0..width as usize).map(|x| row[x / 8] >> (7 - x % 8) & 1 == 1).collect::<Vec<bool>>();
        bytes.chunks_exact(row).flat_map(bits).collect()
    };
    let brightness = is_black[..pixels].iter().map(|&is_black| if is_black { 0.0 } else { 255.0 });
    Ok(opaque([width, height], 255, brightness, tokens.excess_bytes(is_text)))
}

fn opaque(
    [width, height]: [u32; 2],
    maximum: u32,
    brightness: impl Iterator<Item = f32>,
    excess_bytes: usize,
) -> Picture {
    let pixels = brightness.map(|brightness| Pixel { brightness, alpha: maximum as f32 }).collect();
    Picture { width, height, maximum, has_alpha: false, is_lossy: false, pixels, excess_bytes, is_turned: false }
}

/// The pixels of a binary file, of one byte or, beyond 255, two.
fn raster(header: &mut Tokens<'_>, pixels: usize, maximum: u32) -> Result<Vec<u32>, FormatError> {
    let width = if maximum > 255 { 2 } else { 1 };
    let (bytes, at, length) = (header.bytes, header.at, pixels * width);
    // A program that writes the header as text of Windows ends it with two bytes.
    let is_crlf = bytes[at..].starts_with(b"\r\n") && bytes.len() >= at + 2 + length;
    let start = at + if is_crlf { 2 } else { 1 };
    let expected = start + length;
    header.at = expected;
    let Some(data) = bytes.get(start..expected) else {
        return Err(FormatError::byte(bytes.len(), format!("the file ends here, expected length {expected} bytes")));
    };
    let pixel = |bytes: &[u8]| bytes.iter().fold(0, |pixel, &byte| pixel << 8 | u32::from(byte));
    let brightness: Vec<u32> = data.chunks_exact(width).map(pixel).collect();
    match brightness.iter().position(|&pixel| pixel > maximum) {
        Some(place) => {
            let reason = format!("a pixel is {}, allowed is 0 to {maximum}", brightness[place]);
            Err(FormatError::byte(start + place * width, reason))
        }
        None => Ok(brightness),
    }
}

/// The words of the header and of ascii data, without comments.
struct Tokens<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Tokens<'a> {
    /// Bytes after the last pixel that are neither space nor comments.
    fn excess_bytes(&mut self, is_text: bool) -> usize {
        match is_text {
            true => self.next("more").map_or(0, |(at, _)| self.bytes.len() - at),
            false => self.bytes[self.at..].trim_ascii().len(),
        }
    }

    /// The next word and its position.
    fn next(&mut self, what: &str) -> Result<(usize, &'a [u8]), FormatError> {
        loop {
            let rest = &self.bytes[self.at..];
            self.at += rest.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
            let rest = &self.bytes[self.at..];
            if rest.first() == Some(&b'#') {
                self.at += rest.iter().take_while(|&&byte| byte != b'\n').count();
                continue;
            }
            let end = rest.iter().position(|byte| byte.is_ascii_whitespace()).unwrap_or(rest.len());
            let Some(word) = words(&rest[..end]).next() else {
                return Err(FormatError::byte(self.at, format!("the file ends here, before {what}")));
            };
            let at = self.at;
            self.at += end;
            return Ok((at, word));
        }
    }

    /// The next word as a number.
    fn number(&mut self, what: &str, largest: u32) -> Result<u32, FormatError> {
        let (at, word) = self.next(what)?;
        let number = str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        number
            .filter(|&number| number <= largest)
            .ok_or_else(|| FormatError::byte(at, format!("{what} is none, allowed is a number up to {largest}")))
    }
}

#[cfg(test)]
mod tests;
