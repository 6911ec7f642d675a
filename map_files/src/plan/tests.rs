use super::*;
use crate::ImportOptions;

fn spec(bytes: &[u8], height: u32, threshold: Option<f64>) -> ImportSpec {
    let options = ImportOptions { height_cells: Some(height), threshold, ..ImportOptions::default() };
    ImportSpec { options, ..ImportSpec::new("a.pgm", bytes.to_vec()) }
}

#[test]
fn a_pixel_is_a_column_and_the_first_row_is_the_farthest() {
    let text = b"P2 # a plan\n# of two rows\n3 2\n10\n0 9 0\n8 10 0\n";
    let Imported { terrain, notes, .. } = read(&spec(text, 2, None)).unwrap();
    let (wall, layer) = ("#####\n#####\n#####\n#####\n", "#####\n##.##\n##.##\n#####\n");
    // The sides were open; floor and ceiling are there twice then.
    let expected = [wall, wall, layer, layer, wall, wall].join("\n");
    assert_eq!(terrain.to_text(), expected);
    assert_eq!(notes[0].text, "2 free, 4 wall, as bright as 0.9 of 10 is free");
    assert_eq!(notes.len(), 2);
}
#[test]
fn binary_and_ascii_give_the_same_map() {
    let text = read(&spec(b"P2 2 2 255 0 255 127 254", 1, Some(0.5))).unwrap();
    let bytes = read(&spec(b"P5\n2 2 # plan\n255\n\x00\xff\x7f\xfe, and more", 1, Some(0.5))).unwrap();
    let wide = read(&spec(b"P5 2 2 65535 \x00\xff\xff\xff\x7f\x00\xfe\x00", 1, Some(0.5))).unwrap();
    assert_eq!(text.terrain, bytes.terrain);
    assert_eq!(bytes.notes[1].text, "10 bytes after the last pixel are not read");
    assert_eq!(text.terrain, wide.terrain);
    assert_eq!(mapgen::free_cells(&text.terrain), 2);
}

/// Pictures in colours and in black and white, as text and bytes, are those in grey.
#[test]
fn colours_and_bits_are_read() {
    let map = |bytes: &[u8]| read(&spec(bytes, 1, Some(0.5))).unwrap_or_else(|error| panic!("{error}")).terrain;
    let grey = map(b"P2 10 2 255 0 255 0 0 0 0 0 0 255 255 255 0 0 0 0 0 0 0 0 0");
    let is_bright = |at: usize| [1, 8, 9, 10].contains(&at);
    let samples: Vec<u8> = (0..20).flat_map(|at| if is_bright(at) { [255, 255, 255] } else { [255, 0, 9] }).collect();
    let words: Vec<String> = samples.iter().map(u8::to_string).collect();
    assert_eq!(map(&[b"P6 10 2 255\n".as_slice(), &samples].concat()), grey);
    assert_eq!(map(format!("P3\n10 2 255\n{}", words.join(" ")).as_bytes()), grey);
    assert_eq!(map(b"P1\n10 2\n1011111100\n# below\n0 1 1 1 1 1 1 1 1 1"), grey);
    assert_eq!(map(b"P4\n10 2\n\xbf\x00\x7f\xff"), grey);
    let refuse = |bytes: &[u8]| read(&spec(bytes, 1, None)).unwrap_err().to_string();
    assert_eq!(refuse(b"P1 2 1 02"), "byte 8: a pixel is none, allowed are 0 and 1");
    assert_eq!(refuse(b"P1 2 1 0"), "byte 8: the file ends here, before a pixel");
    assert_eq!(refuse(b"P4 9 1 \xff"), "byte 8: the file ends here, expected length 9 bytes");
    assert_eq!(refuse(b"P6 1 1 255 ab"), "byte 13: the file ends here, expected length 14 bytes");
}

#[test]
fn errors_name_the_byte() {
    let refuse = |bytes: &[u8]| read(&spec(bytes, 1, None)).unwrap_err().to_string();
    assert_eq!(refuse(b""), "byte 0: the file ends here, before P1 to P6");
    assert_eq!(
        refuse(b"P7 1 1"),
        "byte 0: the file begins as no picture, read are PNM (P1 to P6), PNG, BMP and JPEG; save it as PNG"
    );
    assert_eq!(refuse(b"P2 x"), "byte 3: the width is none, allowed is a number up to 4294967295");
    assert_eq!(refuse(b"P2 2000 1 9"), "map size along x is 2000 cells, allowed are 1 to 1024");
    assert_eq!(refuse(b"P2 1 1 0 0"), "byte 8: the largest brightness is 0, allowed is 1 to 65535");
    assert_eq!(refuse(b"P2 1 1 9 10"), "byte 9: a pixel is none, allowed is a number up to 9");
    assert_eq!(refuse(b"P2 1000 1000 9 1"), "byte 16: the file ends here, 1000000 pixels do not fit in");
    assert_eq!(refuse(b"P5 2 1 9 12"), "byte 9: a pixel is 49, allowed is 0 to 9");
    assert_eq!(refuse(b"P5 2 2 9 \x01"), "byte 10: the file ends here, expected length 13 bytes");
}

fn yaml(text: &str, image: &[u8]) -> ImportSpec {
    ImportSpec::new("map.yaml", text.into()).with_companions(vec![image.to_vec()])
}

const KEYS: &str = "image: map.pgm # beside it\nresolution: 0.05\norigin: [-10.5, 3, 0.0]\nnegate: 0\n\
                    occupied_thresh: 0.65\nfree_thresh: 0.196\n";

#[test]
fn a_map_of_the_map_server_is_read_with_its_metres_and_origin() {
    // Black, unknown, white; and a border of black.
    let image = b"P2 5 3 255  0 0 0 0 0  0 0 205 254 0  0 0 0 0 0";
    let spec = yaml(KEYS, image);
    assert_eq!(ImportSpec::new("map.yaml", KEYS.into()).missing(), [PathBuf::from("map.pgm")]);
    assert_eq!(spec.missing(), Vec::<PathBuf>::new());
    assert_eq!(spec.stored_cell_m(), Some(0.05));
    let imported = spec.read().unwrap();
    assert_eq!((imported.terrain.extent().size(), imported.terrain.extent().cell_m()), ([5, 3, 52], 0.05));
    assert_eq!((imported.origin_m, imported.yaw_rad), (Some([-10.5, 3.0, -0.05]), 0.0));
    assert_eq!(mapgen::free_cells(&imported.terrain), 50);
    assert_eq!(imported.notes[0].text, "13 occupied, 1 free, 1 unknown, which become wall");
    let options = ImportOptions { unknown: Some(Kind::Free), height_cells: Some(1), ..ImportOptions::default() };
    assert_eq!(mapgen::free_cells(&ImportSpec { options, ..spec.clone() }.read().unwrap().terrain), 2);
    // Two cells of the file along an edge: occupied if one of them is.
    let coarse = ImportSpec { cell_m: Some(0.1), ..spec.clone() }.read().unwrap();
    assert_eq!((coarse.terrain.extent().size()[0], mapgen::free_cells(&coarse.terrain)), (3, 0));
    let error = ImportSpec { cell_m: Some(0.07), ..spec }.read().unwrap_err().to_string();
    assert!(error.contains("the file has cells of 0.05 m, asked for are cells of 0.07 m"), "{error}");
}

#[test]
fn thresholds_negation_and_modes_are_those_of_the_map_server() {
    let free = |text: &str, pixel: u32| {
        let image = format!("P2 3 3 255 0 0 0 0 {pixel} 0 0 0 0");
        let imported = yaml(text, image.as_bytes()).read().unwrap();
        imported.notes[0].text.contains(" 1 free")
    };
    assert!(free(KEYS, 206) && !free(KEYS, 205));
    assert!(free(&KEYS.replace("0.196", "0.25"), 206));
    let negated = "image: m\nresolution: 1\norigin:\n- 0\n- 0.5\n- 0\nnegate: 1\n";
    let counts = |text: &str, pixel: u32| {
        let image = format!("P2 3 3 255 255 255 255 255 {pixel} 255 255 255 255");
        yaml(text, image.as_bytes()).read().unwrap().notes[0].text.clone()
    };
    assert!(counts(negated, 3).starts_with("8 occupied, 1 free, 0 unknown"));
    // The map server lowers the letters of the mode.
    for mode in ["Raw", "RAW", "raw"] {
        assert!(counts(&format!("{negated}mode: {mode}\n"), 0).starts_with("0 occupied, 1 free, 8 unknown"), "{mode}");
    }
    assert!(free(&format!("{KEYS}mode: Trinary\n"), 206) && !free(&format!("{KEYS}mode: TRINARY\n"), 205));
    // Values of raw maps are not negated.
    assert!(counts(&format!("{negated}mode: raw\n"), 0).starts_with("0 occupied, 1 free, 8 unknown"));
    assert!(counts(&format!("{negated}mode: raw\n"), 100).starts_with("1 occupied, 0 free, 8 unknown"));
}

/// What `map_saver` of nav2 writes: unknown around a room with black walls.
fn saved(maximum: u32, is_negated: bool) -> Vec<u8> {
    let drawn = "?????? ?####? ?#..#? ?#..#? ?####? ??????";
    let grey = |character| match character {
        '?' => 205,
        '#' => 0,
        _ => 254,
    };
    let pixel = |character| if is_negated { 255 - grey(character) } else { grey(character) } * maximum / 255;
    let pixels: Vec<String> =
        drawn.chars().filter(|&character| character != ' ').map(|character| pixel(character).to_string()).collect();
    format!("P2 6 6 {maximum} {}", pixels.join(" ")).into_bytes()
}

#[test]
fn grey_of_map_saver_is_unknown_whatever_the_thresholds() {
    let keys = "image: m\nresolution: 1\norigin: [0, 0, 0]\noccupied_thresh: 0.65\n";
    for (thresh, is_told) in
        [("free_thresh: 0.196\n", false), ("free_thresh: 0.25\n", true), ("free_thresh: 0.3\n", true), ("", true)]
    {
        for (maximum, is_negated) in [(255, false), (255, true), (65535, false), (510, true)] {
            let text = format!("{keys}{thresh}negate: {}\n", u8::from(is_negated));
            let imported = yaml(&text, &saved(maximum, is_negated)).read().unwrap();
            assert_eq!(imported.notes[0].text, "12 occupied, 4 free, 20 unknown, which become wall", "{text}");
            let grey = if is_negated { 50 } else { 205 };
            let told = format!(
                "20 pixels of grey {grey}, which map_saver writes for unknown cells; the thresholds alone would make \
                 them free, and do with mode: scale"
            );
            let note = imported.notes.iter().find(|note| note.name == "unknown").map(|note| note.text.clone());
            // The negative of 205 has an occupancy of 0.19608, too.
            assert_eq!(note, is_told.then_some(told), "{text}");
        }
    }
    // In scale mode this grey is an occupancy of a fifth, in raw mode no occupancy.
    let read = |mode: &str| {
        let text = format!("{keys}free_thresh: 0.25\nnegate: 0\nmode: {mode}\n");
        yaml(&text, &saved(255, false)).read().unwrap().notes[0].text.clone()
    };
    assert!(read("scale").starts_with("12 occupied, 24 free, 0 unknown"), "{}", read("scale"));
    assert!(read("raw").starts_with("0 occupied, 12 free, 24 unknown"), "{}", read("raw"));
}

/// Pictures that were scaled or saved by other programs have greys beside that of unknown cells.
#[test]
fn greys_beside_that_of_unknown_cells_are_warned_of() {
    let read = |grey: u32, free_thresh: f64| {
        let text = format!("image: m\nresolution: 1\norigin: [0, 0, 0]\nnegate: 0\nfree_thresh: {free_thresh}\n");
        let drawn = String::from_utf8(saved(255, false)).unwrap().replace("205", &grey.to_string());
        let imported = yaml(&text, drawn.as_bytes()).read().unwrap();
        let warning = imported.notes.iter().find(|note| note.name == "grey").map(|note| note.text.clone());
        (imported.notes[0].text.contains(" 20 unknown"), warning)
    };
    for grey in [198, 204, 206, 213] {
        let (is_unknown, warning) = read(grey, 0.25);
        let warning = warning.unwrap_or_else(|| panic!("{grey}"));
        assert!(!is_unknown && warning.starts_with("20 pixels are free whose grey is almost that"), "{warning}");
        // What it says is right.
        let advised = warning.split("free_thresh: ").nth(1).and_then(|rest| rest.split(' ').next());
        let advised = advised.and_then(|thresh| thresh.parse().ok()).unwrap();
        assert_eq!(read(grey, advised), (true, None), "{grey}");
    }
    assert_eq!([read(205, 0.25), read(196, 0.196), read(254, 0.25)].map(|(_, warning)| warning), [None, None, None]);
}

/// What lies between the thresholds is rounded to whole percent of the way between them, as nav2
/// does, and its ends are free and occupied.
#[test]
fn scale_mode_rounds_to_whole_percent() {
    let counts = |thresholds: &str, greys: &[u8]| {
        let keys = "image: m\nresolution: 1\norigin: [0, 0, 0]\nnegate: 0\nmode: scale\n";
        let greys_text = greys.iter().map(u8::to_string).collect::<Vec<_>>().join(" ");
        let picture = format!("P2 {} 1 255 {greys_text}", greys.len());
        let imported = yaml(&format!("{keys}{thresholds}"), picture.as_bytes()).read().unwrap();
        imported.notes[0].text.split(" unknown").next().unwrap().to_owned()
    };
    let wide = "free_thresh: 0.0\noccupied_thresh: 0.65\n";
    assert_eq!(counts(wide, &[255]), "0 occupied, 1 free, 0");
    // 0.6, 98.9 and 99.5 percent of the way.
    assert_eq!(counts(wide, &[255, 254, 91, 90, 0]), "2 occupied, 1 free, 2");
    // The grey of unknown cells is 0.02 percent of the way.
    assert_eq!(counts("free_thresh: 0.196\noccupied_thresh: 0.65\n", &[205, 203]), "0 occupied, 1 free, 1");
}

/// JPEG makes other greys of that of unknown cells, and of free and occupied cells beside each
/// other.
#[test]
fn greys_near_that_of_unknown_cells_are_unknown_in_jpeg() {
    let picture = |of_unknown: u8, quality: u8| {
        let grey = |x: u32, y: u32| match (x.min(59 - x), y.min(39 - y)) {
            (0..10, _) | (_, 0..10) => of_unknown,
            (10, _) | (_, 10) => 0,
            _ => 254,
        };
        let pixels = (0..2400).map(|at| grey(at % 60, at / 60)).collect();
        let luma = image::GrayImage::from_raw(60, 40, pixels).unwrap();
        let mut bytes = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality).encode_image(&luma).unwrap();
        bytes
    };
    let keys = "image: m\nresolution: 1\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.25\n";
    for quality in [75, 95] {
        let imported = yaml(&format!("{keys}negate: 0\n"), &picture(205, quality)).read().unwrap();
        assert_eq!(imported.notes[0].text, "116 occupied, 684 free, 1600 unknown, which become wall", "{quality}");
        let note = imported.notes.iter().find(|note| note.name == "unknown").unwrap();
        assert!(
            note.text.contains("pixels of grey 205 or near it, as JPEG makes it, which map_saver"),
            "{}",
            note.text
        );
        // Without unknown cells the thresholds decide.
        let known = yaml(&format!("{keys}negate: 0\n"), &picture(254, quality)).read().unwrap();
        assert_eq!(known.notes[0].text, "116 occupied, 2284 free, 0 unknown, which become wall", "{quality}");
        let scale = yaml(&format!("{keys}mode: scale\n"), &picture(205, quality)).read().unwrap();
        // But for a few dark ones beside the walls.
        assert!(scale.notes[0].text.starts_with("116 occupied, 22"), "{quality}: {}", scale.notes[0].text);
    }
}

/// Transparency as nav2 reads it: one more colour in trinary mode, unknown in scale mode, nothing
/// in raw mode.
#[test]
fn transparent_pixels_are_those_of_the_map_server() {
    let pixels = [[254, 255], [254, 0], [0, 255], [0, 0], [205, 255], [205, 0], [100, 254], [3, 255], [0, 127]];
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 3, 3);
    encoder.set_color(png::ColorType::GrayscaleAlpha);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(pixels.as_flattened()).unwrap();
    writer.finish().unwrap();
    let read = |text: &str| {
        let imported = yaml(&format!("{KEYS}{text}"), &bytes).read().unwrap();
        imported.notes[0].text.split(", which").next().unwrap().to_owned()
    };
    // Occupancies of 0.003, 0.253, 0.75, 1, grey, grey, 0.46, 0.741 and 0.876.
    assert_eq!(read(""), "4 occupied, 1 free, 4 unknown");
    assert_eq!(read("mode: scale\n"), "2 occupied, 2 free, 5 unknown");
    assert_eq!(read("mode: raw\n"), "1 occupied, 4 free, 4 unknown");
}

#[test]
fn byte_order_mark_and_other_line_ends_change_nothing() {
    let image = b"P2 5 3 255  0 0 0 0 0  0 0 205 254 0  0 0 0 0 0";
    let plain = yaml(KEYS, image).read().unwrap();
    assert_eq!(yaml(&format!("\u{feff}{}", KEYS.replace('\n', "\r\n")), image).read().unwrap(), plain);
}

#[test]
fn an_open_map_gets_a_layer_that_its_origin_takes_into_account() {
    let imported = yaml(KEYS, b"P2 1 1 255 254").read().unwrap();
    assert_eq!(imported.terrain.extent().size(), [3, 3, 54]);
    assert_eq!(imported.origin_m, Some([-10.5 - 0.05, 3.0 - 0.05, -0.1]));
}

#[test]
fn errors_of_a_yaml_name_line_or_key() {
    let refuse = |text: &str| yaml(text, b"P2 1 1 255 254").read().unwrap_err().to_string();
    assert_eq!(refuse("image\n"), "map.yaml: line 1: a line is \"image\", expected KEY: VALUE");
    assert_eq!(refuse("resolution: x\n"), "map.yaml: line 1: resolution is \"x\", expected a number");
    assert_eq!(
        refuse("resolution: -1\n"),
        "map.yaml: line 1: cell_m is -1, allowed are finite lengths in metres above 0"
    );
    assert_eq!(refuse("origin: 3\n"), "map.yaml: line 1: origin is \"3\", expected [x, y, yaw]");
    assert_eq!(refuse("origin: [1, 2]\n"), "map.yaml: origin: 2 numbers, expected [x, y, yaw]");
    assert_eq!(refuse("origin: [1, 2, 0]\n"), "map.yaml: the file has no key image");
    for (kind, beginning) in
        [("GIF", &b"GIF89a"[..]), ("TIFF", b"II*\0"), ("TIFF", b"MM\0*"), ("WebP", b"RIFF\x01\0\0\0WEBPVP8 ")]
    {
        let error = yaml(KEYS, beginning).read().unwrap_err().to_string();
        assert!(
            error.ends_with(&format!("begins as {kind}, read are PNM (P1 to P6), PNG, BMP and JPEG; save it as PNG"))
        );
    }
    assert_eq!(refuse("mode: best\n"), "map.yaml: line 1: mode is \"best\", expected trinary, scale or raw");
    let without = ImportSpec::new("map.yaml", KEYS.into()).read().unwrap_err().to_string();
    assert_eq!(without, "map.yaml: image \"map.pgm\": it is not at hand");
    let broken = yaml(KEYS, b"P7").read().unwrap_err().to_string();
    assert_eq!(
        broken,
        "map.yaml: image \"map.pgm\": byte 0: the file begins as no picture, read are PNM (P1 to P6), PNG, BMP and JPEG; save it as PNG"
    );
    let wide = yaml(KEYS, b"P5 2000 2 255 ").read().unwrap_err().to_string();
    assert_eq!(
        wide,
        "map.yaml: image \"map.pgm\": map size along x is 2000 cells, allowed are 1 to 1024, with cells of 0.05 m; choose \
         longer ones, a multiple of 0.05 m (--cell-m)"
    );
}

#[test]
fn lists_may_go_on_in_the_next_lines() {
    let image = b"P2 5 3 255  0 0 0 0 0  0 0 205 254 0  0 0 0 0 0";
    let whole = yaml(KEYS, image).read().unwrap();
    for list in ["[-10.5,\n         3, 0.0]", "[ # the corner\n  -10.5,\r\n  3,\n  0.0,\n]", "\n- -10.5\n- 3\n-  0.0"] {
        let keys = KEYS.replace("[-10.5, 3, 0.0]", list);
        assert_eq!(yaml(&keys, image).read().unwrap(), whole, "{list}");
        assert_eq!(yaml(&format!("\u{feff}{}", keys.replace('\n', "\r\n")), image).read().unwrap(), whole, "{list}");
    }
    let open = yaml(&KEYS.replace("0.0]", "0.0"), image).read().unwrap_err().to_string();
    assert!(open.contains("line 4: no YAML: "), "{open}");
}

#[test]
fn picture_that_lies_elsewhere_is_named_and_never_shown() {
    let image = b"P2 5 3 255  0 0 0 0 0  0 0 205 254 0  0 0 0 0 0";
    for (name, is_noted) in
        [("map.pgm", false), ("./plans/map.pgm", false), ("../map.pgm", true), ("/srv/map.pgm", true)]
    {
        let notes = yaml(&KEYS.replace("map.pgm", name), image).read().unwrap().notes;
        assert_eq!(notes.iter().any(|note| note.name == "image"), is_noted, "{name}: {notes:?}");
    }
    for secret in ["root:x:0:0", "P2 secret 1", "P2 1 1 9 secret", "P2 1 1 secret", "BMsecret", "\u{fffd}"] {
        let error = yaml(KEYS, secret.as_bytes()).read().unwrap_err().to_string();
        assert!(!error.contains("secret") && !error.contains("root"), "{error}");
    }
}

/// Photographs lie on their side in the file, and viewers turn them; the map server does not.
#[test]
fn plans_of_cameras_are_upright() {
    // Wide, with a bright left half; turned by a quarter its upper half is bright.
    let luma = image::GrayImage::from_fn(32, 16, |x, _| image::Luma([if x < 16 { 255 } else { 0 }]));
    let mut jpeg = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 100).encode_image(&luma).unwrap();
    // One entry: orientation (tag 0x112, a short), in the order of Intel.
    let exif = |orientation: u8| {
        let entry = [0x12, 1, 3, 0, 1, 0, 0, 0, orientation, 0, 0, 0];
        let tiff = [&b"II*\0\x08\0\0\0\x01\0"[..], &entry, &[0; 4]].concat();
        let segment = [&b"Exif\0\0"[..], &tiff].concat();
        let length = (segment.len() as u16 + 2).to_be_bytes();
        [&jpeg[..2], &[0xff, 0xe1], &length, &segment, &jpeg[2..]].concat()
    };
    let read = |bytes: Vec<u8>| ImportSpec::new("plan.jpg", bytes).read().unwrap();
    // The white half is open at its sides, so that a layer surrounds the map.
    let stored = read(jpeg.clone());
    assert_eq!(stored.terrain.extent().size(), [34, 18, 9]);
    assert!(stored.notes.iter().all(|note| note.name != "turned"));
    let upright = read(exif(6));
    assert_eq!(upright.terrain.extent().size(), [18, 34, 9]);
    assert!(upright.notes.iter().any(|note| note.name == "turned"));
    let at = |y| upright.terrain.get(voxels::Cell { x: 9, y, z: 4 }).copied();
    assert_eq!([at(29), at(5)], [Some(Terrain::Free), Some(Terrain::Wall)]);
    let keys = "image: m\nresolution: 1\norigin: [0, 0, 0]\n";
    assert_eq!(yaml(keys, &exif(6)).read().unwrap().terrain.extent().size(), [34, 18, 7]);
}

#[test]
fn pictures_may_be_bmp_and_jpeg() {
    let image =
        b"P2 8 8 255  ".iter().copied().chain((0..64).flat_map(|at| if at % 8 < 4 { *b"  0 " } else { *b"254 " }));
    let grey = yaml(KEYS, &image.collect::<Vec<u8>>()).read().unwrap();
    let pixels = (0..64u32).map(|at| if at % 8 < 4 { 0 } else { 254 }).collect();
    let luma = image::GrayImage::from_raw(8, 8, pixels).unwrap();
    for picture in [image::DynamicImage::from(luma.clone()), image::DynamicImage::from(luma).to_rgb8().into()] {
        for format in [image::ImageFormat::Bmp, image::ImageFormat::Jpeg] {
            let mut bytes = std::io::Cursor::new(Vec::new());
            picture.write_to(&mut bytes, format).unwrap();
            let bytes = bytes.into_inner();
            assert_eq!(yaml(KEYS, &bytes).read().unwrap().terrain, grey.terrain, "{format:?}");
            let cut = yaml(KEYS, &bytes[..bytes.len() / 2]).read();
            assert!(cut.is_err() || format == image::ImageFormat::Jpeg, "{cut:?}");
        }
    }
}

#[test]
fn a_picture_may_be_png() {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
    encoder.set_color(png::ColorType::GrayscaleAlpha);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[255, 255, 255, 0, 0, 255, 254, 255]).unwrap();
    writer.finish().unwrap();
    let plan = ImportSpec::new("a.png", bytes.clone()).read().unwrap();
    assert_eq!(plan.notes[0].text, "2 free, 2 wall, as bright as 0.9 of 255 is free");
    let server = yaml(KEYS, &bytes).read().unwrap();
    assert_eq!(server.notes[0].text, "1 occupied, 2 free, 1 unknown, which become wall");
    assert!(ImportSpec::new("a.png", bytes[..40].to_vec()).read().is_err());
}

#[test]
fn long_files_are_refused() {
    let text = |lines: usize| format!("{KEYS}more: [1,\n{} 1]\n", " 2,\n".repeat(lines));
    assert!(Keys::read(text(10_000).as_bytes()).is_ok());
    let error = Keys::read(text(20_000).as_bytes()).map(drop).unwrap_err().to_string();
    assert_eq!(error, "the file: 80133 bytes, allowed are 65536");
}

#[test]
fn only_keys_of_the_map_itself_count() {
    let image = b"P2 5 3 255  0 0 0 0 0  0 0 205 254 0  0 0 0 0 0";
    let plain = yaml(KEYS, image).read().unwrap();
    let flow = "{image: map.pgm, resolution: 0.05, origin: [-10.5, 3, 0.0], negate: no, free_thresh: 0.196}\n";
    for text in [
        format!("{KEYS}saved:\n  by: slam\n  resolution: 0.1\n"),
        format!("{KEYS}meta:\n  text: |\n    a [ b\n    resolution: 7\n"),
        format!("layers:\n- name: a\n  image: b.pgm\n{KEYS}"),
        format!("%YAML 1.1\n---\n{KEYS}"),
        // Long values of other programs go on in the next line, or begin there.
        KEYS.replace("image: map.pgm", "image: >-\n  map.pgm"),
        KEYS.replace("image: map.pgm", "image:\n  map.pgm"),
        KEYS.replace("map.pgm", "\"map\\\n  .pgm\""),
        KEYS.replace("origin: [", "origin:\n  ["),
        KEYS.replace('\n', "\r"),
        KEYS.replace('\n', "\r\n"),
        KEYS.lines().map(|line| format!("  {line}\n")).collect(),
        KEYS.replace("negate: 0", "negate: off"),
        flow.to_owned(),
        flow.replace(", ", ",\n  ").replace("no,", "false, # none\n more: {a: 1, resolution: 7},"),
        r#"{"image": "map.pgm", "resolution": 0.05, "origin": [-10.5, 3, 0], "note": "a, {b", "free_thresh": 0.196}"#
            .to_owned(),
    ] {
        let imported = yaml(&text, image).read().unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!(imported, plain, "{text}");
    }
    let refuse = |text: &str| yaml(text, image).read().unwrap_err().to_string();
    assert_eq!(
        refuse(&format!("{KEYS}resolution: 0.1\n")),
        "map.yaml: line 7: resolution is given twice; leave out one of them"
    );
    for reference in
        [KEYS.replace("negate: 0", "negate: &no 0").replace("0.65", "*no"), KEYS.replace("0.196", "{a: 0}")]
    {
        let error = refuse(&reference);
        assert!(error.contains("_thresh is a mapping or a reference, expected the value itself"), "{error}");
    }
    assert!(
        refuse(&format!("{{a: 1}}\n{KEYS}")).contains("line 2: no YAML: "),
        "{}",
        refuse(&format!("{{a: 1}}\n{KEYS}"))
    );
    assert!(refuse("- a\n").contains("line 1: a list, expected KEY: VALUE"));
    assert!(refuse("a: \"b\n").contains("no YAML: "), "{}", refuse("a: \"b\n"));
    assert!(refuse("").contains("the file has no key origin"), "{}", refuse(""));
    assert!(refuse("{image: m,\n resolution: x}").contains("line 2: resolution is \"x\""));
}
