//! Scenes of COLLADA, small ones and those of real writers.

use super::*;
use crate::{ImportOptions, options::Kind};
use mapgen::free_cells;

/// A box of 5 x 4 x 3 units as quads, around which `list` stands for the element of its faces.
fn document(asset: &str, faces: &str, scene: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">\
         <asset><contributor/>{asset}</asset><library_geometries><geometry id=\"box\"><mesh>\
         <source id=\"places\"><float_array id=\"f\" count=\"24\">0 0 0 5 0 0 5 4 0 0 4 0\n0 0 3 5 0 3 5 4 3 0 4 3\
         </float_array><technique_common><accessor source=\"#f\" count=\"8\" stride=\"3\"/></technique_common></source>\
         <vertices id=\"corners\"><input semantic=\"POSITION\" source=\"#places\"/></vertices>{faces}</mesh></geometry>\
         </library_geometries>{scene}</COLLADA>"
    )
}

const INPUT: &str =
    "<input semantic=\"VERTEX\" source=\"#corners\" offset=\"1\"/><input semantic=\"NORMAL\" offset=\"0\"/>";
const QUADS: [[u32; 4]; 6] = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];

fn indices(corners: &[u32]) -> String {
    corners.iter().map(|corner| format!("9 {corner} ")).collect()
}

fn polylist() -> String {
    let all: String = QUADS.iter().map(|quad| indices(quad)).collect();
    format!("<polylist count=\"6\">{INPUT}<vcount>4 4 4 4 4 4</vcount><p>{all}</p></polylist>")
}

fn scene(nodes: &str) -> String {
    format!(
        "<library_visual_scenes><visual_scene id=\"s\">{nodes}</visual_scene></library_visual_scenes>\
         <scene><instance_visual_scene url=\"#s\"/></scene>"
    )
}

fn with(text: &str, options: ImportOptions) -> Result<Imported, FormatError> {
    read(&ImportSpec { options, ..ImportSpec::new("a.dae", text.as_bytes().to_vec()) })
}

fn cave(text: &str) -> Imported {
    with(text, ImportOptions { inside: Some(Kind::Free), ..ImportOptions::default() })
        .unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn faces_are_read_in_all_lists() {
    let plain = scene("<node><instance_geometry url=\"#box\"/></node>");
    let whole = cave(&document("<up_axis>Z_UP</up_axis>", &polylist(), &plain));
    assert_eq!(whole.terrain.extent().size(), [7, 6, 5]);
    assert_eq!(free_cells(&whole.terrain), 60);
    let each = |kind: &str, split: fn([u32; 4]) -> Vec<Vec<u32>>| {
        let lists = QUADS.map(split).concat();
        let lists: String = lists.iter().map(|corners| format!("<p>{}</p>", indices(corners))).collect();
        format!("<{kind} count=\"6\">{INPUT}{lists}</{kind}>")
    };
    let as_polygons = each("polygons", |quad| vec![quad.to_vec()]);
    let as_fans = each("trifans", |quad| vec![quad.to_vec()]);
    let as_strips = each("tristrips", |[a, b, c, d]| vec![vec![a, b, d, c]]);
    let as_triangles = each("triangles", |[a, b, c, d]| vec![vec![a, b, c, a, c, d]]);
    let with_lines = format!("<lines>{INPUT}<p>9 0 9 1</p></lines>{}", polylist());
    for faces in [as_polygons, as_fans, as_strips, as_triangles, with_lines] {
        let read = cave(&document("<up_axis>Z_UP</up_axis>", &faces, &plain));
        assert_eq!(read.terrain, whole.terrain, "{faces}");
    }
    assert_eq!(cave(&document("<up_axis>Z_UP</up_axis>", &polylist(), "")).terrain, whole.terrain, "without a scene");
}

#[test]
fn nodes_place_geometries() {
    let size = |asset: &str, nodes: &str| {
        let text = document(&format!("<up_axis>Z_UP</up_axis>{asset}"), &polylist(), &scene(nodes));
        let imported = cave(&text);
        (imported.terrain.extent().size(), free_cells(&imported.terrain), imported.origin_m.unwrap())
    };
    let instance = "<instance_geometry url=\"#box\"/>";
    let moved = format!("<node><translate>10 0 -2</translate><rotate>0 0 1 90</rotate>{instance}</node>");
    assert_eq!(size("", &moved), ([6, 7, 5], 60, [5.0, -1.0, -3.0]));
    // The first transform is the outermost one.
    let turned = format!("<node><rotate>0 0 1 90</rotate><translate>10 0 -2</translate>{instance}</node>");
    assert_eq!(size("", &turned), ([6, 7, 5], 60, [-5.0, 9.0, -3.0]));
    let mirrored = format!("<node><scale>-2 1 1</scale>{instance}</node>");
    assert_eq!(size("", &mirrored), ([12, 6, 5], 120, [-11.0, -1.0, -1.0]));
    let matrix = format!("<node><matrix>0 -1 0 3 1 0 0 0 0 0 1 0 0 0 0 1</matrix>{instance}</node>");
    assert_eq!(size("", &matrix), ([6, 7, 5], 60, [-2.0, -1.0, -1.0]));
    assert_eq!(size("<unit meter=\"2\" name=\"two\"/>", &format!("<node>{instance}</node>")).0, [12, 10, 8]);
    let nested = format!(
        "<node id=\"part\"><translate>0 0 3</translate>{instance}</node><node><translate>0 0 3</translate>\
         <instance_node url=\"#part\"/></node>"
    );
    assert_eq!(size("", &nested), ([7, 6, 8], 120, [-1.0, -1.0, 2.0]));
}

#[test]
fn axis_upwards_is_that_of_the_writer() {
    let size = |asset: &str| {
        let text = document(asset, &polylist(), &scene("<node><instance_geometry url=\"#box\"/></node>"));
        let text = text.replace("<contributor/>", "");
        let imported = cave(&text);
        let note = imported.notes.iter().find(|note| note.name == "up").unwrap().text.clone();
        (imported.terrain.extent().size(), note)
    };
    let unit = "<unit meter=\"1\"/>";
    let tool = |name: &str| format!("<contributor><authoring_tool>{name}</authoring_tool></contributor>{unit}");
    assert_eq!(size(&format!("{unit}<up_axis>Y_UP</up_axis>")).0, [7, 5, 6]);
    assert_eq!(size(&format!("{unit}<up_axis>Z_UP</up_axis>")).0, [7, 6, 5]);
    assert_eq!(size(&format!("{unit}<up_axis>X_UP</up_axis>")).0, [6, 5, 7]);
    assert_eq!(size(unit).0, [7, 5, 6]);
    assert_eq!(size(&format!("{}<up_axis>Y_UP</up_axis>", tool("Blender 3.4.1"))).0, [7, 5, 6]);
    let assimp = size(&format!("{}<up_axis>Y_UP</up_axis>", tool("Assimp Exporter")));
    assert_eq!(assimp.0, [7, 6, 5]);
    assert!(assimp.1.starts_with("z, as Assimp writes it, whatever it says in up_axis"), "{}", assimp.1);
    for name in ["VCGLib | MeshLab", "VCGLib"] {
        assert_eq!(size(&format!("{}<up_axis>Y_UP</up_axis>", tool(name))).0, [7, 6, 5], "{name}");
    }
    let pycollada = size("<created>2026</created><up_axis>Y_UP</up_axis>");
    assert_eq!(pycollada.0, [7, 6, 5]);
}

#[test]
fn errors_name_the_line() {
    let refuse = |text: &str| with(text, ImportOptions::default()).unwrap_err().to_string();
    assert_eq!(refuse("<a/>"), "line 1: <a>: the file begins with another element, expected COLLADA");
    assert!(
        refuse("<COLLADA>\n<a></b></COLLADA>").starts_with("line 2: no XML: "),
        "{}",
        refuse("<COLLADA>\n<a></b></COLLADA>")
    );
    assert!(refuse("<!DOCTYPE a [<!ENTITY b \"c\">]><COLLADA/>").contains("no XML: "));
    let refused = refuse("<?xml version=\"1.0\"?>\n<!DOCTYPE COLLADA>\n<COLLADA/>");
    assert_eq!(refused, "line 2: no XML: a document type is not read; remove <!DOCTYPE ...>");
    assert_eq!(refuse("<COLLADA/>"), "the file has no triangle");
    let plain = scene("<node><instance_geometry url=\"#box\"/></node>");
    let bad = |from: &str, to: &str| refuse(&document("", &polylist(), &plain).replace(from, to));
    assert!(bad("9 7 ", "9 8 ").ends_with("<p>: a corner is none of the 8 positions"), "{}", bad("9 7 ", "9 8 "));
    assert!(bad("4 4 4 4 4 4", "4 4 4 4 4 9").ends_with("<p>: it has less corners than vcount says"));
    assert!(
        bad("url=\"#box\"", "url=\"#none\"")
            .ends_with("<instance_geometry>: url = \"#none\" names nothing in the file")
    );
    assert!(bad("5 0 0", "5 x 0").ends_with("<float_array>: \"x\" is not a number that may stand there"));
    let circle = scene("<node id=\"a\"><instance_node url=\"#a\"/><instance_node url=\"#a\"/></node>");
    assert!(refuse(&document("", &polylist(), &circle)).contains("or nodes deeper than 256"));
}

/// A room of 12 x 9 x 6 m with a wall, a pillar and a beam in it, of nine boxes, which has z
/// upwards; written by assimp 5.2.5 and by trimesh 5.2.0 with pycollada 0.9.3.
#[test]
fn rooms_of_real_writers_stand_upright() {
    for bytes in
        [&include_bytes!("../../tests/files/room_assimp.dae")[..], include_bytes!("../../tests/files/room_trimesh.dae")]
    {
        let imported = ImportSpec::new("room.dae", bytes.to_vec()).read().unwrap();
        assert_eq!(imported.terrain.extent().size(), [16, 13, 10]);
        assert_eq!(free_cells(&imported.terrain), 608);
    }
}
