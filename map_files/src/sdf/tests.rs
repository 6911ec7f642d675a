//! Worlds of SDF: shapes, poses, included models and meshes.

use super::*;
use crate::{Companion, ImportOptions};
use mapgen::free_cells;
use voxels::Terrain;

fn of(text: &str, files: &[(&str, &str)]) -> ImportSpec {
    let mut spec = ImportSpec::new("a.world", text.as_bytes().to_vec());
    for _ in 0..9 {
        for name in spec.missing() {
            let found = files.iter().find(|(file, _)| Path::new(file) == name);
            let companion = found.map(|(_, bytes)| Companion { path: name.clone(), bytes: bytes.as_bytes().to_vec() });
            spec = spec.with_companion(name, companion);
        }
    }
    assert_eq!(spec.missing(), Vec::<PathBuf>::new());
    spec
}

fn world(body: &str) -> String {
    format!("<?xml version=\"1.0\"?>\n<sdf version=\"1.7\"><world name=\"w\">{body}</world></sdf>")
}

fn model(name: &str, pose: &str, shape: &str) -> String {
    format!(
        "<model name=\"{name}\"><pose>{pose}</pose><link name=\"l\"><collision name=\"c\"><geometry>{shape}</geometry>\
         </collision></link></model>"
    )
}

const BOX: &str = "<box><size>4 2 2</size></box>";

/// Size, walls and lowest corner of a world.
fn read_world(body: &str) -> ([u32; 3], u64, [f64; 3]) {
    let options = ImportOptions { margin_cells: Some(1), ..ImportOptions::default() };
    let spec = ImportSpec { options, ..of(&world(body), &[]) };
    let imported = spec.read().unwrap_or_else(|error| panic!("{error}"));
    measured(&imported)
}

fn measured(imported: &Imported) -> ([u32; 3], u64, [f64; 3]) {
    let extent = imported.terrain.extent();
    let inner = extent.size().map(|cells| u64::from(cells) - 2).iter().product::<u64>();
    (extent.size(), inner - free_cells(&imported.terrain), imported.origin_m.unwrap())
}

#[test]
fn boxes_are_placed_by_their_poses() {
    assert_eq!(read_world(&model("a", "2 1 1 0 0 0", BOX)), ([8, 6, 6], 16, [-2.0; 3]));
    // A quarter turn about z.
    assert_eq!(read_world(&model("a", "1 2 1 0 0 1.5707963267948966", BOX)), ([6, 8, 6], 16, [-2.0; 3]));
    let degrees = model("a", "", BOX).replace("<pose>", "<pose degrees=\"true\">1 1 2 0 90 0");
    assert_eq!(read_world(&degrees), ([6, 6, 8], 16, [-2.0; 3]));
    let quaternion = model("a", "", BOX)
        .replace("<pose>", "<pose rotation_format=\"quat_xyzw\">1 2 1 0 0 0.7071067811865476 0.7071067811865476");
    assert_eq!(read_world(&quaternion), ([6, 8, 6], 16, [-2.0; 3]));
    let two = model("a", "2 1 1 0 0 0", BOX) + &model("b", "2 1 6 0 0 0", BOX);
    assert_eq!(read_world(&two), ([8, 6, 11], 32, [-2.0; 3]));
}

#[test]
fn poses_are_relative_to_frames() {
    let at = |pose: &str, frames: &str| {
        let body = format!("{frames}{}", model("a", "", BOX).replace("<pose>", pose));
        read_world(&body)
    };
    let whole = ([8, 6, 6], 16, [-2.0; 3]);
    let frame = "<frame name=\"f\"><pose>2 0 0 0 0 0</pose></frame>";
    assert_eq!(at("<pose relative_to=\"f\">0 1 1 0 0 0", frame), whole);
    let chain = format!("{frame}<frame name=\"g\" attached_to=\"f\"><pose>0 1 0 0 0 0</pose></frame>");
    assert_eq!(at("<pose relative_to=\"g\">0 0 1 0 0 0", &chain), whole);
    let other = model("b", "2 1 1 0 0 0", "<empty/>");
    assert_eq!(at("<pose relative_to=\"b\">0 0 0 0 0 0", &other), whole);
    assert_eq!(at("<pose relative_to=\"b::l\">0 0 0 0 0 0", &other), whole);
    let nested = format!(
        "<model name=\"out\"><pose>2 0 0 0 0 0</pose><link name=\"base\"><pose>0 1 0 0 0 0</pose></link>{}</model>",
        model("in", "", BOX).replace("<pose>", "<pose relative_to=\"base\">0 0 1 0 0 0")
    );
    assert_eq!(read_world(&nested), whole);
    // The pose is that of the link, whose own pose is taken back.
    let placed = format!(
        "<model name=\"a\" placement_frame=\"l\"><pose>2 1 1 0 0 0</pose><link name=\"l\"><pose>7 7 7 0 0 0</pose>\
         <visual name=\"v\"><geometry>{BOX}</geometry></visual></link></model>"
    );
    assert_eq!(read_world(&placed), whole);
    let refuse = |body: &str| of(&world(body), &[]).read().unwrap_err().to_string();
    let circle =
        "<frame name=\"f\"><pose relative_to=\"g\"/></frame><frame name=\"g\"><pose relative_to=\"f\"/></frame>";
    let error = refuse(&format!("{circle}{}", model("a", "", BOX).replace("<pose>", "<pose relative_to=\"f\">")));
    assert!(error.contains("frames are given relative to each other in a circle"), "{error}");
    let error = refuse(&model("a", "", BOX).replace("<pose>", "<pose relative_to=\"none\">"));
    assert!(error.contains("there is no frame \"none\""), "{error}");
}

#[test]
fn primitives_have_their_volumes() {
    use std::f64::consts::PI;
    for (shape, volume) in [
        ("<sphere><radius>8</radius></sphere>", 4.0 / 3.0 * PI * 512.0),
        ("<ellipsoid><radii>8 6 4</radii></ellipsoid>", 4.0 / 3.0 * PI * 192.0),
        ("<cylinder><radius>6</radius><length>10</length></cylinder>", PI * 360.0),
        ("<cone><radius>8</radius><length>12</length></cone>", PI * 256.0),
        ("<capsule><radius>5</radius><length>8</length></capsule>", PI * (4.0 / 3.0 * 125.0 + 200.0)),
        (
            "<polyline><point>0 0</point><point>9 0</point><point>9 4</point><point>4 4</point><point>4 9</point><point>0 9</point><height>5</height></polyline>",
            280.0,
        ),
    ] {
        let (_, walls, _) = read_world(&model("a", "0 0 0 0 0 0", shape));
        assert!((walls as f64 - volume).abs() < 0.04 * volume, "{shape}: {walls} for {volume}");
    }
    // The ground is as wide as what stands on it, and a cell thick.
    let ground = model("g", "0 0 0 0 0 0", "<plane><normal>0 0 1</normal><size>100 100</size></plane>");
    let on_ground = model("a", "2 1 1 0 0 0", BOX) + &model("b", "8 5 1 0 0 0", BOX);
    assert_eq!(read_world(&(on_ground + &ground)), ([14, 10, 7], 32 + 60, [-2.0, -2.0, -3.0]));
}

/// Walls of each layer of a map of polylines, from below.
fn layers_of(shape: &str) -> Vec<usize> {
    let options = ImportOptions { margin_cells: Some(1), ..ImportOptions::default() };
    let spec = ImportSpec { options, ..of(&world(&model("a", "0 0 0 0 0 0", shape)), &[]) };
    let terrain = spec.read().unwrap_or_else(|error| panic!("{error}")).terrain;
    let [x, y, z] = terrain.extent().size().map(|cells| cells as i32);
    let is_wall = |x, y, z| terrain.get(voxels::Cell::new(x, y, z)) == Some(&Terrain::Wall);
    let layer = |z| (1..x - 1).flat_map(|x| (1..y - 1).map(move |y| (x, y))).filter(|&(x, y)| is_wall(x, y, z)).count();
    (2..z - 2).map(layer).collect()
}

/// As libsdformat 12.3 reads the elements (a height that is missing is 1) and gz-common extrudes
/// them: the height of the first loop, and what lies within an odd number of loops.
#[test]
fn polylines_within_each_other_are_holes_and_islands() {
    let polyline = |corners: &[[i32; 2]], height: &str| {
        let points: String = corners.iter().map(|[x, y]| format!("<point>{x} {y}</point>")).collect();
        format!("<polyline>{points}{height}</polyline>")
    };
    let outer = polyline(&[[0, 0], [10, 0], [10, 8], [0, 8]], "<height>3</height>");
    let hole = polyline(&[[2, 2], [8, 2], [8, 6], [2, 6]], "<height>9</height>");
    let island = polyline(&[[4, 3], [4, 5], [6, 5], [6, 3], [4, 3]], "");
    assert_eq!(layers_of(&format!("{outer}{hole}")), [56; 3]);
    assert_eq!(layers_of(&format!("{outer}{hole}{island}")), [60; 3]);
    let clockwise = polyline(&[[2, 6], [8, 6], [8, 2], [2, 2]], "");
    assert_eq!(layers_of(&format!("{outer}{clockwise}{island}")), [60; 3]);
    // Two holes side by side, and a plan of two pieces.
    let holes = polyline(&[[1, 1], [3, 1], [3, 7], [1, 7]], "") + &polyline(&[[7, 1], [7, 7], [9, 7], [9, 1]], "");
    assert_eq!(layers_of(&format!("{outer}{holes}")), [56; 3]);
    let apart = polyline(&[[20, 0], [24, 0], [24, 8], [20, 8]], "");
    assert_eq!(layers_of(&format!("{outer}{hole}{apart}")), [88; 3]);
    assert_eq!(layers_of(&island), [4]);
}

#[test]
fn parts_of_meshes_are_chosen_by_name() {
    let cube = |at: usize, [x, y, z]: [i32; 3]| {
        let corners: String =
            (0..8).map(|c| format!("v {} {} {}\n", x + (c & 1) * 2, y + (c >> 1 & 1) * 2, z + (c >> 2) * 2)).collect();
        let faces = [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]];
        let faces = faces.map(|face| format!("f {}\n", face.map(|corner| (8 * at + corner).to_string()).join(" ")));
        (corners, faces.concat())
    };
    let cubes = [cube(0, [0, 0, 0]), cube(1, [6, 0, 0]), cube(2, [6, 6, 0])];
    let corners: String = cubes.iter().map(|(corners, _)| corners.as_str()).collect();
    let obj = format!("{corners}o one\n{}g two big\n{}o one\n{}", cubes[0].1, cubes[1].1, cubes[2].1);
    let positions: String =
        cubes[0].0.lines().flat_map(|line| line.split(' ').skip(1)).map(|number| format!("{number} ")).collect();
    let indices: String = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        .iter()
        .flatten()
        .map(|corner| format!("{corner} "))
        .collect();
    let dae = format!(
        "<COLLADA version=\"1.4.1\"><asset><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id=\"g\"><mesh>\
         <source id=\"p\"><float_array>{positions}</float_array></source><vertices id=\"v\"><input semantic=\"POSITION\" \
         source=\"#p\"/></vertices><polylist><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><vcount>4 4 4 4 4 4\
         </vcount><p>{indices}</p></polylist></mesh></geometry></library_geometries><library_visual_scenes>\
         <visual_scene id=\"s\"><node name=\"one\"><instance_geometry url=\"#g\"/></node><node name=\"far\"><node>\
         <translate>6 6 0</translate><instance_geometry url=\"#g\"/></node></node></visual_scene></library_visual_scenes>\
         <scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>"
    );
    let files = [("a.obj", obj.as_str()), ("a.dae", dae.as_str())];
    let read = |mesh: &str| {
        let options = ImportOptions { margin_cells: Some(1), ..ImportOptions::default() };
        let text = world(&model("a", "0 0 0 0 0 0", &format!("<mesh>{mesh}</mesh>")));
        ImportSpec { options, ..of(&text, &files) }.read().map(|imported| measured(&imported))
    };
    let sub = |file: &str, name: &str, rest: &str| {
        read(&format!("<uri>{file}</uri><submesh><name> {name} </name>{rest}</submesh>")).unwrap()
    };
    assert_eq!(sub("a.obj", "two big", ""), ([6, 6, 6], 8, [4.0, -2.0, -2.0]));
    assert_eq!(sub("a.obj", "two big", "<center>1</center>"), ([6, 6, 6], 8, [-3.0; 3]));
    assert_eq!(sub("a.obj", "one", "<center>false</center>"), ([12, 12, 6], 16, [-2.0; 3]), "all of the name");
    // Gazebo's loader of COLLADA heeds no axis.
    for axis in ["X_UP", "Y_UP"] {
        let turned = dae.replace("Z_UP", axis);
        let files = [("a.dae", turned.as_str())];
        let far = "<mesh><uri>a.dae</uri><submesh><name>far</name></submesh></mesh>";
        let options = ImportOptions { margin_cells: Some(1), ..ImportOptions::default() };
        let imported = ImportSpec { options, ..of(&world(&model("a", "0 0 0 0 0 0", far)), &files) }.read().unwrap();
        assert_eq!(measured(&imported), ([6, 6, 6], 8, [4.0, 4.0, -2.0]), "{axis}");
    }
    assert_eq!(sub("a.dae", "far", ""), ([6, 6, 6], 8, [4.0, 4.0, -2.0]), "the name of the node above");
    assert_eq!(sub("a.dae", "one", "<center>true</center>"), ([6, 6, 6], 8, [-3.0; 3]));
    let scaled =
        read("<uri>a.obj</uri><submesh><name>two big</name><center>true</center></submesh><scale>2 1 1</scale>");
    assert_eq!(scaled.unwrap(), ([8, 6, 6], 16, [-4.0, -3.0, -3.0]), "scaled about its middle");
    let refused = read("<uri>a.obj</uri><submesh><name>three</name></submesh>").unwrap_err().to_string();
    assert!(refused.contains("a.obj: submesh \"three\" is no part of it; it has \"one\", \"two big\""), "{refused}");
}

#[test]
fn models_are_included_with_their_meshes() {
    let config = "<model><sdf version=\"1.4\">old.sdf</sdf><sdf version=\"1.10\">model.sdf</sdf></model>";
    let tile = "<sdf version=\"1.6\"><model name=\"tile\"><pose>9 9 9 0 0 0</pose><link name=\"l\"><collision name=\"c\">\
                <pose>2 1 1 0 0 0</pose><geometry><mesh><uri>meshes/box.obj</uri><scale>2 1 1</scale></mesh></geometry></collision>\
                <visual name=\"v\"><geometry><mesh><uri>model://tile/meshes/none.dae</uri></mesh></geometry></visual></link>\
                </model></sdf>";
    let corners: String =
        (0..8).map(|at| format!("v {} {} {}\n", (at & 1) * 2 - 1, (at >> 1 & 1) * 2 - 1, (at >> 2) * 2 - 1)).collect();
    let cube = corners + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    let files = [
        ("model:/tile/model.config", config),
        ("model:/tile/model.sdf", tile),
        ("model:/tile/meshes/box.obj", cube.as_str()),
        ("local/model.sdf", &tile.replace("model://tile", "local")),
        ("local/meshes/box.obj", cube.as_str()),
    ];
    let include = |uri: &str, rest: &str| world(&format!("<include><uri>{uri}</uri>{rest}</include>"));
    let read = |text: &str| {
        let options = ImportOptions { margin_cells: Some(1), ..ImportOptions::default() };
        ImportSpec { options, ..of(text, &files) }.read().map(|imported| measured(&imported))
    };
    assert_eq!(read(&include("model://tile", "<pose>0 0 0 0 0 0</pose>")).unwrap(), ([8, 6, 6], 16, [-2.0; 3]));
    assert_eq!(read(&include("model://tile/", "")).unwrap(), ([8, 6, 6], 16, [7.0; 3]), "the pose of the model");
    assert_eq!(read(&include("local", "")).unwrap(), ([8, 6, 6], 16, [7.0; 3]));
    assert_eq!(read(&include("local/model.sdf", "")).unwrap(), ([8, 6, 6], 16, [7.0; 3]));
    let hundred: String = (0..100)
        .map(|at| {
            format!("<include><uri>model://tile</uri><name>t{at}</name><pose>{} 0 0 0 0 0</pose></include>", 4 * at)
        })
        .collect();
    assert_eq!(read(&world(&hundred)).unwrap(), ([404, 6, 6], 1600, [-2.0; 3]));
    let frames = "<include><uri>model://tile</uri><name>t</name><pose>0 0 0 0 0 0</pose></include>".to_owned()
        + &model("b", "", BOX).replace("<pose>", "<pose relative_to=\"t\">2 1 1 0 0 0");
    assert_eq!(read(&world(&frames)).unwrap(), ([8, 6, 6], 16, [-2.0; 3]));
    for (uri, said) in [
        (
            "model://none",
            "is not found below the folder of the world; name the folder in which its model lies by map.import.model_path",
        ),
        ("https://fuel.gazebosim.org/1.0/a/models/b", "download the model (gz fuel download -u URI), write"),
        ("../other", "is not found below the folder"),
        ("model://../../etc", "is not found below the folder"),
        ("file:///etc/passwd", "is not found below the folder"),
        ("", "is missing"),
    ] {
        let refused = read(&include(uri, "")).unwrap_err().to_string();
        assert!(refused.contains(said), "{uri}: {refused}");
    }
}

/// The texts of the notes of a kind.
fn notes<'i>(imported: &'i Imported, name: &str) -> Vec<&'i str> {
    imported.notes.iter().filter(|note| note.name == name).map(|note| note.text.as_str()).collect()
}

/// As Gazebo Classic loads what it has saved: its `World::SetState` sets poses in the world.
#[test]
fn saved_state_of_classic_moves_models_and_links() {
    let read = |body: &str| {
        let options = ImportOptions { margin_cells: Some(1), ..ImportOptions::default() };
        ImportSpec { options, ..of(&world(body), &[]) }.read().unwrap_or_else(|error| panic!("{error}"))
    };
    let whole = ([8, 6, 6], 16, [-2.0; 3]);
    let state = |models: &str| format!("<state world_name=\"w\"><sim_time>10 0</sim_time>{models}</state>");
    let pose = "<pose frame=''>2 1 1 0 -0 0</pose>";
    let far = model("a", "100 100 1 0 0 0", BOX);
    let moved = format!(
        "<model name=\"a\">{pose}<scale>1 1 1</scale><link name=\"l\">{pose}<velocity>0 0 0 0 0 0</velocity></link></model>"
    );
    let imported = read(&format!("{far}{}", state(&moved)));
    assert_eq!(measured(&imported), whole);
    assert_eq!(notes(&imported, "state"), ["1 model(s) are where the saved state of the world has them"]);
    // Only the first state counts, wherever it stands.
    let second = state(&moved.replace("2 1 1", "50 1 1"));
    assert_eq!(measured(&read(&format!("{}{far}{second}", state(&moved)))), whole);
    // A link that has left its model, and the pose of the model without links.
    let link = format!("<model name=\"a\"><pose>7 7 7 0 0 1</pose><link name=\"l\">{pose}</link></model>");
    assert_eq!(measured(&read(&format!("{far}{}", state(&link)))), whole);
    let alone = format!("<model name=\"a\">{pose}</model>");
    assert_eq!(measured(&read(&format!("{far}{}", state(&alone)))), whole);
    // A model in a model: both poses are in the world.
    let nested = format!("<model name=\"out\"><pose>9 9 9 0 0 0</pose>{far}</model>");
    let inner = format!("<model name=\"out\"><pose>50 0 0 0 0 1</pose>{alone}</model>");
    assert_eq!(measured(&read(&format!("{nested}{}", state(&inner)))), whole);
    let placed = far.replace("name=\"a\"", "name=\"a\" placement_frame=\"l\"");
    assert_eq!(measured(&read(&format!("{placed}{}", state(&alone)))), whole);
    // What is not followed is a warning.
    let scaled = moved.replace("1 1 1</scale>", "2 2 1</scale>") + "<model name=\"none\"/><deletions/>";
    let imported = read(&format!("{far}{}", state(&scaled)));
    assert_eq!(measured(&imported), whole);
    let warned = imported.notes.iter().filter(|note| note.is_warning && note.name == "state").count();
    assert_eq!(warned, 3, "{:?}", imported.notes);
    assert_eq!(measured(&read(&format!("{}{}", model("a", "2 1 1 0 0 0", BOX), state("")))), whole);
}

#[test]
fn models_without_a_world_are_read_all() {
    let read = |text: &str, files: &[(&str, &str)]| {
        let options = ImportOptions { margin_cells: Some(1), ..ImportOptions::default() };
        ImportSpec { options, ..of(text, files) }.read().unwrap_or_else(|error| panic!("{error}"))
    };
    let [a, b] = [model("a", "2 1 1 0 0 0", BOX), model("b", "2 1 6 0 0 0", BOX)];
    let both = read(&format!("<sdf version=\"1.6\">{a}{b}</sdf>"), &[]);
    assert_eq!(measured(&both), ([8, 6, 11], 32, [-2.0; 3]));
    let said = notes(&both, "world");
    assert!(said[0].starts_with("2 model(s), 2 shapes of their links"), "{said:?}");
    assert_eq!(said[1], "2 models without a world, all of which are read; Gazebo takes the first only");
    let one = read(&format!("<sdf version=\"1.6\">{a}</sdf>"), &[]);
    assert_eq!(measured(&one), ([8, 6, 6], 16, [-2.0; 3]));
    assert!(notes(&one, "world")[0].starts_with("1 model(s), 1 shapes of their links"), "{:?}", one.notes);
    let worlds = format!("<sdf version=\"1.6\"><world name=\"v\">{a}</world><world name=\"w\">{b}</world>{b}</sdf>");
    let first = read(&worlds, &[]);
    assert_eq!(measured(&first), ([8, 6, 6], 16, [-2.0; 3]));
    assert_eq!(
        notes(&first, "world")[1..],
        [
            "1 other worlds of the file are left out, only the first world is read",
            "1 models beside the world are left out; put them into it"
        ]
    );
    // An included file stands for one model, as in Gazebo.
    let pair = format!("<sdf version=\"1.6\">{a}{b}</sdf>");
    let included = read(&world("<include><uri>pair.sdf</uri></include>"), &[("pair.sdf", &pair)]);
    assert_eq!(measured(&included), ([8, 6, 6], 16, [-2.0; 3]));
    assert!(included.notes.iter().any(|note| note.is_warning && note.text.contains("1 other models of the file")));
}

#[test]
fn sun_and_ground_are_known_without_files() {
    let read = |body: &str, files: &[(&str, &str)]| {
        let options = ImportOptions { margin_cells: Some(1), ..ImportOptions::default() };
        ImportSpec { options, ..of(&world(body), files) }.read()
    };
    let include = |uri: &str| format!("<include><uri>{uri}</uri></include>");
    let on_ground = model("a", "2 1 1 0 0 0", BOX) + &model("b", "8 5 1 0 0 0", BOX);
    let alone = measured(&read(&on_ground, &[]).unwrap());
    let grounded = ([14, 10, 7], 32 + 60, [-2.0, -2.0, -3.0]);
    for (uri, expected) in [
        ("model://sun", alone),
        ("model:/sun", alone),
        ("https://fuel.gazebosim.org/1.0/OpenRobotics/models/Sun", alone),
        ("https://fuel.ignitionrobotics.org/1.0/openrobotics/models/sun/2", alone),
        ("model://ground_plane", grounded),
        ("model://ground_plane/", grounded),
        ("https://fuel.gazebosim.org/1.0/OpenRobotics/models/Ground Plane", grounded),
        ("https://fuel.gazebosim.org/1.0/OpenRobotics/models/Ground%20Plane/tip", grounded),
    ] {
        let imported = read(&format!("{}{on_ground}", include(uri)), &[]).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(measured(&imported), expected, "{uri}");
        let name = if expected == alone { "sun" } else { "ground_plane" };
        let said = format!("{name}, taken as Gazebo has them, without their files");
        assert_eq!(notes(&imported, "models"), [said], "{uri}");
    }
    // A file of this name comes first.
    let own = format!("<sdf version=\"1.6\">{}</sdf>", model("sun", "2 1 6 0 0 0", BOX));
    let files = [("model:/sun/model.sdf", own.as_str())];
    let a = model("a", "2 1 1 0 0 0", BOX);
    for uri in ["model://sun", "https://fuel.gazebosim.org/1.0/OpenRobotics/models/Sun"] {
        let imported = read(&format!("{}{a}", include(uri)), &files).unwrap();
        assert_eq!(measured(&imported), ([8, 6, 11], 32, [-2.0; 3]), "{uri}");
    }
    for (uri, said) in [
        ("https://fuel.gazebosim.org/1.0/OpenRobotics/models/Cone", "write model://NAME for its uri"),
        ("https://fuel.gazebosim.org/1.0/someone/models/Sun", "write model://NAME for its uri"),
        ("sun", "is not found below the folder"),
        ("model:/cone", "is not found below the folder"),
        ("other:/cone", "is of a kind that is not known"),
    ] {
        let refused = read(&include(uri), &[]).unwrap_err().to_string();
        assert!(refused.contains(said), "{uri}: {refused}");
    }
}

/// In 1.2 and 1.3, shapes and poses are written as in 1.4; before, as attributes.
#[test]
fn old_versions_are_read_or_refused_by_name() {
    let a = model("a", "2 1 1 0 0 0", BOX);
    let read = |version: &str, element: &str| {
        let text = format!("<{element} version=\"{version}\"><world name=\"w\">{a}</world></{element}>");
        of(&text, &[]).read().map(|imported| imported.terrain).map_err(|error| error.to_string())
    };
    let now = read("1.6", "sdf").unwrap();
    for (version, element) in [("1.2", "gazebo"), ("1.2", "sdf"), ("1.3", "sdf"), ("1.4", "sdf"), ("1.12", "sdf")] {
        assert_eq!(read(version, element).as_ref(), Ok(&now), "{version}");
    }
    for (version, element) in [("1.0", "gazebo"), ("1.0", "sdf"), ("1.1", "sdf"), ("1", "sdf"), ("0.9", "sdf")] {
        let refused = read(version, element).unwrap_err();
        let expected =
            format!("a.world: line 1: <{element}>: SDF {version} is not read, allowed are 1.2 to 1.12; convert it");
        assert!(refused.starts_with(&expected), "{refused}");
    }
    let old = "<sdf version=\"1.0\"><model name=\"m\"/></sdf>";
    let refused =
        of(&world("<include><uri>old.sdf</uri></include>"), &[("old.sdf", old)]).read().unwrap_err().to_string();
    assert!(refused.contains("old.sdf: line 1: <sdf>: SDF 1.0 is not read"), "{refused}");
}

#[test]
fn what_is_not_read_is_named() {
    let refuse = |shape: &str| of(&world(&model("a", "0 0 0 0 0 0", shape)), &[]).read().unwrap_err().to_string();
    assert!(
        refuse("<heightmap><uri>a.png</uri></heightmap>")
            .contains("line 2: <heightmap>: height maps are not read; export")
    );
    assert!(refuse("<mesh><uri>a.dae</uri></mesh>").starts_with("a.world: a.dae: is not found below the folder"));
    let centred = "<mesh><uri>a.dae</uri><submesh><center>true</center></submesh></mesh>";
    assert!(refuse(centred).contains("<submesh>: it has no name"));
    assert!(
        refuse("<polyline><point>0 0</point><point>1 0</point><point>0 0</point></polyline>").contains("at least 3")
    );
    assert!(refuse("<image/>").contains("geometries of kind image are not read"));
    assert!(refuse("<box><size>0 1 1</size></box>").contains("size is not above 0"));
    let text = world(&format!("<actor name=\"a\"/>{}", model("a", "0 0 0 0 0 0", BOX)));
    let imported = of(&text, &[]).read().unwrap();
    assert!(imported.notes.iter().any(|note| note.text == "1 actors, which are not read"));
    assert!(imported.terrain.as_slice().contains(&Terrain::Wall));
    // Each file includes the next one sixteen times: a few bytes for sixteen million models.
    let file = |number: usize| {
        let include = format!("<include><uri>f{}.sdf</uri></include>", number + 1);
        let body = if number < 6 { include.repeat(16) } else { String::new() };
        (format!("f{number}.sdf"), format!("<sdf version=\"1.6\"><model name=\"m\">{body}</model></sdf>"))
    };
    let chain: Vec<(String, String)> = (0..=6).map(file).collect();
    let mut spec = ImportSpec::new("a.world", world("<include><uri>f0.sdf</uri></include>").into_bytes());
    while let Some(name) = spec.missing().pop() {
        let bytes = chain.iter().find(|(file, _)| Path::new(file) == name).unwrap().1.clone().into_bytes();
        spec = spec.with_companion(name.clone(), Some(Companion { path: name, bytes }));
    }
    let refused = spec.read().unwrap_err().to_string();
    assert!(refused.contains("a world has at most 131072 models and shapes"), "{refused}");
    let both = "<sdf version=\"1.6\"><model name=\"m\"><include><uri>m.sdf</uri></include></model></sdf>";
    let refused = of(both, &[("m.sdf", both)]).read().unwrap_err().to_string();
    assert!(refused.contains("within each other") || refused.contains("include each other"), "{refused}");
}

/// The collisions of poses.world as libsdformat 12.3 places them: positions, and turns as
/// roll, pitch and yaw.
const RESOLVED: [[f64; 6]; 8] = [
    [6.181179, -0.013999, 1.410623, 0.096914, 0.169574, 0.817822],
    [5.803113, 1.038115, 1.421617, 0.183104, 0.067686, 1.515796],
    [6.185009, 1.350143, 3.370153, 0.183104, 0.067686, 1.515796],
    [6.7414, 1.519323, 6.313248, 0.194902, -0.008449, 1.908753],
    [7.035095, 0.453303, 5.299669, 0.142736, 0.133435, 1.119132],
    [11.143078, 0.355979, 0.0, 0.0, 0.0, 2.07],
    [1.0, 2.0, 3.0, 0.0, 0.0, std::f64::consts::FRAC_PI_2],
    [5.312553, 1.07129, 1.51245, 0.183104, 0.067686, 1.515796],
];

#[test]
fn poses_are_those_of_sdformat() {
    let tile = "<?xml version=\"1.0\"?><sdf version=\"1.7\"><model name=\"tile\"><pose>9 9 9 0 0 0</pose><link name=\"base\"><pose>0.5 0 0 0 0 0.2</pose><collision name=\"c\"><geometry><box><size>2 2 1</size></box></geometry></collision></link></model></sdf>";
    let files = [("model:/tile/model.sdf", tile)];
    let spec = of(include_str!("../../tests/files/poses.world"), &files);
    let files = Files::new(&spec);
    let world = Reader::new(&files).root(&spec.bytes, Path::new(""), Role::Map).unwrap();
    let mut places = Vec::new();
    let found = world.place(&mut |_, place| {
        places.push(*place);
        Ok(())
    });
    found.unwrap();
    assert_eq!(places.len(), RESOLVED.len());
    for (place, [x, y, z, roll, pitch, yaw]) in places.into_iter().zip(RESOLVED) {
        let turn = super::super::placing::turn_rpy([roll, pitch, yaw]);
        let expected = nalgebra::Isometry3::from_parts(nalgebra::Translation3::new(x, y, z), turn).to_homogeneous();
        assert!((place - expected).abs().max() < 3e-6, "{place} for {expected}");
    }
}

/// What is merged belongs to the model that includes it, under the names of its own.
#[test]
fn merged_models_give_their_frames_away() {
    let part = "<sdf version=\"1.9\"><model name=\"p\"><pose>0 0 9 0 0 0</pose>\
                <link name=\"l\"><pose>1 0 0 0 0 0</pose></link>\
                <frame name=\"f\" attached_to=\"l\"><pose>0 1 0 0 0 0</pose></frame></model></sdf>";
    let include = |more: &str| format!("<include merge=\"true\"><uri>part.sdf</uri>{more}</include>");
    let place = |include: &str, frame: &str| {
        let shape = format!("<collision name=\"c\"><geometry>{BOX}</geometry></collision>");
        let link = format!("<link name=\"own\"><pose relative_to=\"{frame}\">1 0 1 0 0 0</pose>{shape}</link>");
        let body = format!("<model name=\"m\"><pose>10 0 0 0 0 0</pose>{include}{link}</model>");
        let options = ImportOptions { margin_cells: Some(1), ..ImportOptions::default() };
        let spec = ImportSpec { options, ..of(&world(&body), &[("part.sdf", part)]) };
        spec.read().map(|imported| measured(&imported).2).map_err(|error| error.to_string())
    };
    // The middle of the box, less half of it and the margin with its shell.
    let corner = |[x, y, z]: [f64; 3]| [x - 4.0, y - 3.0, z - 3.0];
    assert_eq!(place(&include(""), "l"), Ok(corner([12.0, 0.0, 10.0])));
    assert_eq!(place(&include(""), "f"), Ok(corner([12.0, 1.0, 10.0])));
    assert_eq!(place(&include("<pose>0 0 2 0 0 0</pose>"), "f"), Ok(corner([12.0, 1.0, 3.0])));
    let placed = include("<placement_frame>f</placement_frame><pose>0 0 2 0 0 0</pose>");
    assert_eq!(place(&placed, "f"), Ok(corner([11.0, 0.0, 3.0])));
    assert_eq!(place(&placed, "l"), Ok(corner([11.0, -1.0, 3.0])));
    // What is not merged keeps its names to itself.
    let apart = include("").replace(" merge=\"true\"", "");
    assert!(place(&apart, "l").is_err());
    assert_eq!(place(&apart, "p::l"), Ok(corner([12.0, 0.0, 10.0])));
}

/// A plan with a yard, whose floor and ceiling end at its edges.
#[test]
fn surfaces_of_ground_plans_end_at_their_edges() {
    let points = |corners: &[[i32; 2]]| {
        let points: String = corners.iter().map(|[x, y]| format!("<point>{x} {y}</point>")).collect();
        format!("<polyline>{points}<height>3</height></polyline>")
    };
    let outline = points(&[[0, 0], [8, 0], [8, 8], [0, 8]]);
    let yard = points(&[[2, 2], [2, 6], [6, 6], [6, 2]]);
    let body = model("a", "0.5 0.5 0.5 0 0 0", &format!("{outline}{yard}"));
    let options =
        ImportOptions { margin_cells: Some(1), fill: Some(crate::options::Fill::Shell), ..ImportOptions::default() };
    let imported = ImportSpec { options, ..of(&world(&body), &[]) }.read().unwrap();
    // Four layers of nine by nine cells less the yard of three by three, of which the two in the
    // middle are hollow.
    let hollow = 2 * (7 * 7 - 5 * 5);
    assert_eq!(measured(&imported).1, 4 * (9 * 9 - 3 * 3) - hollow);
}
