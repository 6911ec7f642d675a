//! PNG files from SVG. The font is built in, so that a figure does not depend on the fonts of a machine.

use std::sync::Arc;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{self, Options, Tree, fontdb::Database};
use thiserror::Error;

/// Pixels of a PNG file for each pixel of its SVG file: enough for a column of a paper.
const SCALE: f32 = 2.0;

/// Why there is no PNG file.
#[derive(Debug, Error)]
pub enum PngError {
    /// The SVG file is faulty.
    #[error("its SVG is faulty: {0}")]
    Svg(#[from] usvg::Error),
    /// There is no memory for so many pixels.
    #[error("{0} x {1} pixels are too many or none")]
    Size(u32, u32),
    /// The pixels cannot be packed.
    #[error("cannot pack its pixels: {0}")]
    Pack(String),
}

/// Turns SVG into PNG.
pub(super) struct Renderer {
    options: Options<'static>,
}

impl Renderer {
    /// With the built-in font.
    pub(super) fn new() -> Self {
        let mut fonts = Database::new();
        fonts.load_font_data(dejavu::sans::regular().to_vec());
        fonts.load_font_data(dejavu::sans::bold().to_vec());
        Self { options: Options { fontdb: Arc::new(fonts), ..Options::default() } }
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// If the SVG is faulty or the picture does not fit into memory.
    pub(super) fn png(&self, svg: &str) -> Result<Vec<u8>, PngError> {
        let tree = Tree::from_str(svg, &self.options)?;
        let size = tree.size();
        let (width, height) = ((size.width() * SCALE).ceil() as u32, (size.height() * SCALE).ceil() as u32);
        let mut pixels = Pixmap::new(width, height).ok_or(PngError::Size(width, height))?;
        resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
        pixels.encode_png().map_err(|error| PngError::Pack(error.to_string()))
    }
}
