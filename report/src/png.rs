//! Rasterised figures: PNG from SVG, with an embedded font, so that a figure does not depend on the
//! fonts of the machine.

use std::sync::Arc;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{self, Options, Tree, fontdb::Database};
use thiserror::Error;

/// Pixels of the PNG file per pixel of the SVG file: enough for a column of a paper.
const SCALE: f32 = 2.0;

#[derive(Debug, Error)]
pub enum PngError {
    #[error("invalid SVG: {0}")]
    Svg(#[from] usvg::Error),
    #[error("cannot allocate {0} x {1} pixels")]
    Size(u32, u32),
    #[error("cannot encode PNG: {0}")]
    Encode(String),
}

pub(super) struct Renderer {
    options: Options<'static>,
}

impl Renderer {
    pub(super) fn new() -> Self {
        let mut fonts = Database::new();
        fonts.load_font_data(dejavu::sans::regular().to_vec());
        fonts.load_font_data(dejavu::sans::bold().to_vec());
        Self { options: Options { fontdb: Arc::new(fonts), ..Options::default() } }
    }

    pub(super) fn png(&self, svg: &str) -> Result<Vec<u8>, PngError> {
        let tree = Tree::from_str(svg, &self.options)?;
        let size = tree.size();
        let (width, height) = ((size.width() * SCALE).ceil() as u32, (size.height() * SCALE).ceil() as u32);
        let mut pixels = Pixmap::new(width, height).ok_or(PngError::Size(width, height))?;
        resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
        pixels.encode_png().map_err(|error| PngError::Encode(error.to_string()))
    }
}
