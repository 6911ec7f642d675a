use super::*;
use mapgen::free_cells;

fn chunk(name: &str, content: &[u8]) -> Vec<u8> {
    [name.as_bytes(), &(content.len() as u32).to_le_bytes(), &[0; 4], content].concat()
}

fn numbers(numbers: &[u32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

fn pair(key: &str, value: &str) -> Vec<u8> {
    [&numbers(&[1, key.len() as u32]), key.as_bytes(), &numbers(&[value.len() as u32]), value.as_bytes()].concat()
}

fn file(chunks: &[Vec<u8>]) -> ImportSpec {
    let bytes = [b"VOX \x96\0\0\0".to_vec(), chunk("MAIN", &[]), chunks.concat()].concat();
    ImportSpec::new("a.vox", bytes)
}

/// A model of 3 x 2 x 1 cells with voxels at its first cell and at (2, 1, 0).
fn model() -> Vec<u8> {
    let voxels = [numbers(&[2]), vec![0, 0, 0, 1, 2, 1, 0, 7]].concat();
    [chunk("SIZE", &numbers(&[3, 2, 1])), chunk("XYZI", &voxels)].concat()
}

fn transform(id: u32, child: u32, key: &str, value: &str) -> Vec<u8> {
    chunk("nTRN", &[numbers(&[id, 0, child, u32::MAX, 0, 1]), pair(key, value)].concat())
}

fn shape(id: u32, model: u32) -> Vec<u8> {
    chunk("nSHP", &numbers(&[id, 0, 1, model, 0]))
}

fn refuse(spec: &ImportSpec) -> String {
    read(spec).unwrap_err().to_string()
}

#[test]
fn a_model_is_walls_in_its_box() {
    let Imported { terrain, notes, .. } = read(&file(&[model(), model()])).unwrap();
    let wall = "#####\n".repeat(4);
    assert_eq!(terrain.to_text(), format!("{wall}\n#####\n#..##\n##..#\n#####\n\n{wall}"));
    assert_eq!(notes[0].text, "the first is read, 1 without a place are dropped");
    assert!(notes[0].is_warning);
    assert!(!read(&file(&[model()])).unwrap().notes[0].is_warning);
}

#[test]
fn bytes_after_the_last_chunk_are_ignored() {
    let plain = read(&file(&[model()])).unwrap();
    let with = |children: usize, rest: &[u8]| {
        let mut bytes = [file(&[model()]).bytes, rest.to_vec()].concat();
        bytes[16..20].copy_from_slice(&(children as u32).to_le_bytes());
        read(&ImportSpec::new("a.vox", bytes))
    };
    let whole = model().len();
    for rest in [&[0][..], &[0; 3], &[0; 12], b"\n", b"made by hand", b"TAIL\xff\xff\0\0\0\0\0\0"] {
        let imported = with(whole, rest).unwrap_or_else(|error| panic!("{rest:?}: {error}"));
        assert_eq!(imported.terrain, plain.terrain);
        assert_eq!(imported.notes[0].text, format!("{} bytes after the last chunk are ignored", rest.len()));
    }
    // A length that is wrong loses no chunk.
    assert_eq!(with(1, b"").unwrap().terrain, plain.terrain);
    assert_eq!(with(9999, b"").unwrap().terrain, plain.terrain);
    assert!(with(9999, b"TAIL\xff\xff\0\0\0\0\0\0").unwrap_err().to_string().contains("the file ends here"));
}

/// The layer around an open map is none of the cells that a file may have.
#[test]
fn largest_model_is_read() {
    let voxels = [numbers(&[2]), vec![0, 0, 0, 1, 255, 255, 255, 7]].concat();
    let largest = file(&[chunk("SIZE", &numbers(&[256; 3])), chunk("XYZI", &voxels)]);
    let imported = read(&largest).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(imported.terrain.extent().size(), [258; 3]);
    assert_eq!(free_cells(&imported.terrain), (1 << 24) - 2);
}

#[test]
fn a_scene_puts_models_where_they_belong() {
    let group = chunk("nGRP", &numbers(&[1, 0, 2, 2, 4]));
    // The second one is turned a quarter about z, x to y, and shifted.
    let scene = [
        model(),
        transform(0, 1, "_t", "5 5 5"),
        group,
        transform(2, 3, "_t", "0 0 0"),
        shape(3, 0),
        transform(4, 5, "_r", "17"),
        shape(5, 0),
    ];
    let Imported { terrain, notes, .. } = read(&file(&scene)).unwrap();
    assert_eq!(notes[0].text, "2 put into the scene, of 1 models");
    // x from -1 to 1 and y from -1 to 0, and turned: x from -1 to 0 (y negated), y from -1 to 1.
    assert_eq!(terrain.extent().size(), [5, 5, 3]);
    let wall = "#####\n".repeat(5);
    let walls = terrain.as_slice().len() as u64 - free_cells(&terrain);
    assert!((2 * 25 + 16 + 2..=2 * 25 + 16 + 4).contains(&walls), "{}\n{wall}", terrain.to_text());
}

#[test]
fn hidden_models_are_left_out() {
    let group = chunk("nGRP", &numbers(&[1, 0, 2, 2, 4]));
    // The second model lies in a group of its own.
    let scene = |[hidden_node, hidden_layer, hidden_group, hidden_shape]: [&[u8]; 4]| {
        let second = [hidden_node, &numbers(&[6, u32::MAX, 7, 1]), &pair("_t", "9 0 0")].concat();
        let scene = [
            model(),
            transform(0, 1, "_t", "0 0 0"),
            group.clone(),
            transform(2, 3, "_t", "0 0 0"),
            shape(3, 0),
            chunk("nTRN", &[&numbers(&[4]), &second[..]].concat()),
            chunk("nGRP", &[&numbers(&[6]), hidden_group, &numbers(&[1, 5])].concat()),
            chunk("nSHP", &[&numbers(&[5]), hidden_shape, &numbers(&[1, 0, 0])].concat()),
            // Layers may come after what is in them.
            chunk("LAYR", &[&numbers(&[7]), hidden_layer, &numbers(&[u32::MAX])].concat()),
        ];
        read(&file(&scene)).unwrap()
    };
    let (no, yes, zero) = (numbers(&[0]), pair("_hidden", "1"), pair("_hidden", "0"));
    for shown in [scene([&no[..]; 4]), scene([&zero[..]; 4])] {
        assert_eq!(shown.terrain.extent().size(), [14, 4, 3]);
        assert!(shown.notes.iter().all(|note| note.name != "hidden"));
    }
    let one = |place: usize| [0, 1, 2, 3].map(|at| if at == place { &yes[..] } else { &no });
    for hidden in (0..4).map(one).chain([[&yes[..]; 4]]).map(scene) {
        assert_eq!(hidden.terrain, read(&file(&[model()])).unwrap().terrain);
        assert_eq!(hidden.notes[1].text, "1 left out, which a node or a layer hides");
    }
    let nothing = [model(), chunk("nTRN", &[numbers(&[0]), yes, numbers(&[1, 0, 0, 0])].concat()), shape(1, 0)];
    assert_eq!(refuse(&file(&nothing)), "the file has no model that is not hidden");
}

#[test]
fn rotations_are_right_angles() {
    assert_eq!(rotation("4"), Some(UNTURNED.rows));
    // The first row looks at y, the second at x, negated.
    assert_eq!(rotation("33"), Some([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]));
    for none in ["0", "5", "3", "12", "256", "", "x"] {
        assert_eq!(rotation(none), None, "{none}");
    }
    let turned = Transform { rows: rotation("33").unwrap(), shift: [1, 2, 3] };
    let twice = turned.after(&turned);
    assert_eq!(twice.rows, [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]);
    assert_eq!(twice.shift, [2 + 1, 2 - 1, 6]);
    // Four times a quarter of a turn is none.
    let quarter = Transform { shift: [0; 3], ..turned };
    assert_eq!(quarter.after(&quarter).after(&quarter.after(&quarter)), UNTURNED);
}

#[test]
fn what_is_no_model_is_refused() {
    let spec = |bytes: &[u8]| ImportSpec::new("a.vox", bytes.to_vec());
    assert_eq!(refuse(&spec(b"VO")), "byte 0: the file ends here, the mark VOX takes 4 bytes and 2 are left");
    assert_eq!(refuse(&spec(b"XOV \x96\0\0\0")), "byte 0: the file begins with \"XOV \", expected \"VOX \"");
    assert_eq!(refuse(&file(&[])), "the file has no model");
    assert_eq!(refuse(&file(&[chunk("XYZI", &numbers(&[0]))])), "byte 20: a model without a chunk SIZE before it");
    assert_eq!(
        refuse(&file(&[chunk("SIZE", &numbers(&[3, 257, 1]))])),
        "byte 32: a side of a model is 257, allowed is 1 to 256"
    );
    let size = chunk("SIZE", &numbers(&[1, 1, 1]));
    assert_eq!(
        refuse(&file(&[size.clone(), chunk("XYZI", &numbers(&[9, 0]))])),
        "byte 60: the chunk ends here, the voxels takes 36 bytes and 4 are left"
    );
    assert_eq!(
        refuse(&file(&[size, chunk("XYZI", &numbers(&[1, 1]))])),
        "byte 56: voxel 0 is outside its model of 1x1x1 cells"
    );
    assert_eq!(refuse(&file(&[shape(0, 3)])), "byte 0: the scene names model 3 of 0");
    assert_eq!(refuse(&file(&[transform(0, 8, "_t", "1 2 3")])), "byte 0: the scene names node 8, which is not there");
    assert!(refuse(&file(&[transform(0, 0, "_t", "1 2 3")])).contains("goes in circles"));
    assert!(refuse(&file(&[transform(0, 1, "_t", "1 2")])).contains("\"_t\" is \"1 2\", which is none"));
    let crowd = chunk("nGRP", &numbers(&[[0, 0, 20].as_slice(), &[0; 20]].concat()));
    assert!(refuse(&file(&[crowd])).contains("goes in circles"));
}
