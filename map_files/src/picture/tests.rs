use super::*;
use crate::{ImportOptions, ImportSpec, Imported};

fn plan(bytes: &[u8], threshold: Option<f64>) -> Imported {
    let options = ImportOptions { height_cells: Some(1), threshold, ..ImportOptions::default() };
    ImportSpec { options, ..ImportSpec::new("plan.png", bytes.to_vec()) }.read().unwrap()
}

/// A PNG file of 2 x 2 pixels.
fn png_of(color: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(data).unwrap();
    bytes
}

#[test]
fn header_of_windows_does_not_shift_pixels() {
    let free = |bytes: &[u8]| {
        let picture = Picture::read(bytes, Rows::AsStored, |_| Ok(())).unwrap();
        (picture.pixels.iter().map(|pixel| pixel.brightness as u32).collect::<Vec<_>>(), picture.excess_bytes)
    };
    assert_eq!(free(b"P5\r\n2 2\r\n255\r\n\x01\x02\x03\x04"), (vec![1, 2, 3, 4], 0));
    assert_eq!(free(b"P5\r\n2 2\r\n255\r\n\x01\x02\x03\x04xx"), (vec![1, 2, 3, 4], 2));
    assert_eq!(free(b"P5\r\n2 1\r\n300\r\n\x01\x02\x00\x04"), (vec![258, 4], 0));
    assert_eq!(free(b"P6\r\n1 1\r\n255\r\n\x03\x03\x03"), (vec![3], 0));
    assert_eq!(free(b"P4\r\n2 1\r\n\x80xx"), (vec![0, 255], 2));
    // The first pixel may be a line feed.
    assert_eq!(free(b"P5 2 2 255\r\n\x02\x03\x04"), (vec![10, 2, 3, 4], 0));
    assert_eq!(free(b"P5 2 2 255\n\x01\x02\x03\x04\n"), (vec![1, 2, 3, 4], 0));
    assert_eq!(free(b"P2 2 1 9 1 2 3 4"), (vec![1, 2], 3));
    let notes = plan(b"P5 1 1 255 \xffxyz", None).notes;
    assert!(notes.iter().any(|note| note.text == "3 bytes after the last pixel are not read"), "{notes:?}");
}

#[test]
fn white_is_the_brightest_pixel_of_a_dark_picture() {
    use png::BitDepth::{Eight, Sixteen};
    use png::ColorType::{Grayscale, GrayscaleAlpha, Rgb, Rgba};
    for (what, bytes, free, warns) in [
        ("white", png_of(Grayscale, Eight, &[0, 255, 240, 200]), 2, false),
        ("mask of 0 and 1", png_of(Grayscale, Eight, &[0, 1, 1, 1]), 3, true),
        ("grey", png_of(Grayscale, Eight, &[0, 200, 190, 100]), 2, true),
        ("colour", png_of(Rgb, Eight, &[0, 0, 0, 128, 0, 0, 0, 0, 0, 0, 0, 0]), 1, true),
        ("16 bits", png_of(Grayscale, Sixteen, &[0, 0, 255, 255, 255, 255, 0, 9]), 2, false),
        ("mask in 16 bits", png_of(Grayscale, Sixteen, &[0, 0, 0, 1, 0, 1, 0, 1]), 3, true),
        ("PGM mask", b"P2 2 2 255 0 1 1 0".to_vec(), 2, true),
        ("black on transparent", png_of(Rgba, Eight, &[[0, 0, 0, 255], [0; 4], [0; 4], [0; 4]].concat()), 3, true),
        ("fading", png_of(GrayscaleAlpha, Eight, &[0, 255, 0, 200, 0, 20, 0, 0]), 2, true),
        ("16 bits with alpha", png_of(GrayscaleAlpha, Sixteen, &[0, 0, 255, 255, 0, 0, 0, 0].repeat(2)), 2, true),
        ("white on transparent", png_of(GrayscaleAlpha, Eight, &[255, 255, 0, 0, 255, 0, 0, 255]), 1, false),
    ] {
        let notes = plan(&bytes, None).notes;
        assert!(notes[0].text.starts_with(&format!("{free} free, {} wall", 4 - free)), "{what}: {notes:?}");
        assert_eq!(notes.iter().any(|note| note.is_warning), warns, "{what}: {notes:?}");
    }
    let notes = plan(&png_of(Grayscale, Eight, &[0, 1, 1, 1]), Some(0.003)).notes;
    assert!(notes[0].text.starts_with("3 free") && !notes[1].is_warning, "{notes:?}");
}
