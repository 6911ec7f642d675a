use super::*;

fn refuse(bytes: &[u8]) -> String {
    read(&ImportSpec::new("a.gltf", bytes.to_vec())).unwrap_err().to_string()
}

fn scene(rest: &str) -> Vec<u8> {
    format!(r#"{{"nodes":[{{"mesh":0}}],"scenes":[{{"nodes":[0]}}],{rest}}}"#).into_bytes()
}

#[test]
fn data_inside_the_document_are_read() {
    // Three corners of two cells, as base64 of nine floats.
    let data = "AAAAAAAAAAAAAAAAAAAAQAAAAAAAAAAAAAAAAAAAAEAAAAAA";
    let bytes = scene(&format!(
        r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"accessors":[{{"bufferView":0,"componentType":5126,
        "type":"VEC3","count":3}}],"bufferViews":[{{"buffer":0,"byteLength":36}}],
        "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{data}"}}]"#
    ));
    let options =
        crate::ImportOptions { fill: Some(crate::options::Fill::Shell), up: Some(Up::Z), ..Default::default() };
    let imported = read(&ImportSpec { options, ..ImportSpec::new("a.gltf", bytes) }).unwrap();
    assert_eq!(imported.terrain.extent().size(), [5, 5, 3]);
    assert_eq!(mapgen::free_cells(&imported.terrain), 9 - 3);
}

/// A cube of two units in a file of `generator`, with more keys of its node and of the file. The
/// buffer ends with three places of copies.
fn cube(generator: &str, node: &str, rest: &str) -> Imported {
    let corner = |at: u32| [at & 1, at >> 1 & 1, at >> 2].map(|along| (2 * along) as f32);
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).flatten();
    let copies = [[0.0f32, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 5.0, 0.0]];
    let numbers = triangles.map(corner).chain(copies).flatten();
    let data: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
    let document = format!(
        r#"{{"asset":{{"generator":"{generator}"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0{node}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"type":"VEC3","count":36}},
        {{"bufferView":0,"byteOffset":432,"componentType":5126,"type":"VEC3","count":3}}],
        "bufferViews":[{{"buffer":0,"byteLength":468}}],"buffers":[{{"byteLength":468}}]{rest}}}"#
    );
    let chunk = |kind: &[u8; 4], bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes(), &kind[..], bytes].concat();
    let chunks = [chunk(b"JSON", document.as_bytes()), chunk(b"BIN\0", &data)].concat();
    let glb = [b"glTF\x02\0\0\0".as_slice(), &(chunks.len() as u32 + 12).to_le_bytes(), &chunks].concat();
    read(&ImportSpec::new("a.glb", glb)).unwrap()
}

#[test]
fn copies_of_a_mesh_are_read() {
    let node = r#","extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":1}}}"#;
    let imported = cube("hand-made", node, r#","extensionsRequired":["EXT_mesh_gpu_instancing"]"#);
    // Along x, and along the file's y, which is our z.
    assert_eq!(imported.terrain.extent().size(), [9, 4, 9]);
    assert_eq!(voxels::free_components(&imported.terrain).sizes.len(), 1);
    let filled = imported.notes.iter().find(|note| note.name == "fill").unwrap();
    assert!(filled.text.starts_with("solid: 24 cells inside"), "{}", filled.text);
    assert_eq!(imported.notes.iter().find(|note| note.name == "scene").unwrap().text.split(' ').next(), Some("3"));
}

#[test]
fn hidden_nodes_are_left_out_with_their_children() {
    for (visible, copies, size) in
        [("\"visible\":false", 1, [4, 4, 4]), ("\"visible\":true", 3, [9, 4, 9]), ("", 3, [9, 4, 9])]
    {
        let nodes = format!(
            r#","children":[1]}},{{"mesh":0,"translation":[5,0,0],"children":[2],"extensions":
            {{"KHR_node_visibility":{{{visible}}}}}}},{{"mesh":0,"translation":[-5,5,0]"#
        );
        let imported = cube("hand-made", &nodes, r#","extensionsRequired":["KHR_node_visibility"]"#);
        assert_eq!(imported.terrain.extent().size(), size, "{visible}");
        let text = |name| imported.notes.iter().find(|note| note.name == name).map(|note| note.text.as_str());
        assert!(text("scene").unwrap().starts_with(&format!("{copies} ")), "{visible}");
        assert_eq!(text("hidden"), (copies == 1).then_some("2 mesh(es) of hidden nodes left out"));
    }
}

#[test]
fn required_extensions_are_read_or_refused_by_name() {
    cube("hand-made", "", r#","extensionsRequired":["KHR_materials_unlit"]"#);
    let refused = refuse(br#"{"extensionsRequired":["KHR_materials_unlit","KHR_other"]}"#);
    let expected = "extensionsRequired: \"KHR_other\" is not read; save the scene without it";
    assert_eq!(refused, expected);
}

#[test]
fn writers_that_leave_coordinates_as_they_are_have_z_upwards() {
    let turned = r#","matrix":[1,0,0,0,0,0,-1,0,0,1,0,0,0,0,0,1]"#;
    let optimised = |name: &str| {
        format!(
            "y, as glTF has it; {name} names no earlier writer, and files of trimesh, Open3D and assimp have z; the \
             option up changes that"
        )
    };
    let of_assimp = "z, as assimp writes what has z upwards; it keeps the axes of the file that it converts, so that it \
                     is y if that was glTF; the option up changes that";
    for (generator, node, up) in [
        ("gltfpack 1.3", "", optimised("gltfpack").as_str()),
        ("glTF-Transform v4.5.1", "", optimised("glTF-Transform").as_str()),
        ("Open Asset Import Library (assimp v5.2.0)", "", of_assimp),
        ("Open Asset Import Library (assimp v5.2.0)", r#","scale":[2,2,2]"#, of_assimp),
        // As assimp 5.2.5 writes a COLLADA file with z upwards.
        ("Open Asset Import Library (assimp v5.2.0)", turned, "y, as assimp has turned it; the option up changes that"),
        (
            "VTK",
            "",
            "y, as glTF has it, and PyVista writes it; scenes of ParaView and of VTK's own writer have z; the option up \
             changes that",
        ),
        (
            "Khronos glTF Blender I/O v3.4",
            r#","scale":[3,3,1]"#,
            "y, as glTF has it; z is by far the shortest side: z, if the file has it upwards; the option up changes that",
        ),
        ("Open3D", "", "z, as Open3D writes it; the option up changes that"),
        ("https://github.com/mikedh/trimesh", "", "z, as trimesh writes it; the option up changes that"),
        ("Khronos glTF Blender I/O v3.4", "", "y, as glTF has it; the option up changes that"),
    ] {
        let imported = cube(generator, node, "");
        assert_eq!(imported.notes.iter().find(|note| note.name == "up").unwrap().text, up, "{generator}");
    }
}

/// A file of a tool, see cases/README.md.
macro_rules! case {
    ($name:literal) => {
        include_bytes!(concat!("../../tests/cases/", $name)).to_vec()
    };
}

#[test]
fn optimised_scenes_are_those_that_they_were_made_of() {
    let walls = |bytes: Vec<u8>| {
        let imported = ImportSpec::new("a.glb", bytes).read().unwrap();
        assert_eq!(mapgen::free_cells(&imported.terrain), 608, "{:?}", imported.notes);
        imported.terrain
    };
    let plain = walls(case!("gltfpack_quantized.glb"));
    assert_eq!(walls(case!("gltfpack_meshopt.glb")), plain);
    assert_eq!(walls(case!("gltf_transform_quantized.glb")), plain);
    let meshopt = case!("gltf_transform_meshopt.glb");
    assert_eq!(walls(meshopt.clone()), plain);
    // Cut or changed data are refused, or another map.
    for at in meshopt.len() - 432..meshopt.len() {
        let mut broken = meshopt.clone();
        broken[at] ^= 0x55;
        if let Err(error) = ImportSpec::new("a.glb", broken).read() {
            assert!(!error.to_string().contains('\n'));
        }
    }
}

/// Version 1 of compressed attributes, and turned copies whose rotations are compressed.
#[test]
fn later_compression_keeps_the_scene() {
    let terrain = |bytes: Vec<u8>| {
        let options = crate::ImportOptions { up: Some(Up::Z), ..Default::default() };
        ImportSpec { options, ..ImportSpec::new("a.glb", bytes) }.read().unwrap().terrain
    };
    let plain = terrain(case!("trimesh_instances.glb"));
    assert_eq!(plain.extent().volume() as u64 - mapgen::free_cells(&plain) - shell_cells(&plain), 34);
    assert_eq!(terrain(case!("gltfpack_version_1.glb")), plain);
    assert_eq!(terrain(case!("gltfpack_instances.glb")), plain);
}

/// The cells of the layer of wall around a map.
fn shell_cells(terrain: &voxels::Grid<voxels::Terrain>) -> u64 {
    let extent = terrain.extent();
    extent.volume() as u64 - extent.size().map(|cells| u64::from(cells) - 2).iter().product::<u64>()
}

#[test]
fn without_scenes_the_nodes_without_parent_are_shown() {
    // A triangle, moved and made larger by the parent, which comes second.
    let data = "AAAAAAAAAAAAAAAAAAAAQAAAAAAAAAAAAAAAAAAAAEAAAAAA";
    let document = |scenes: &str| {
        let bytes = format!(
            r#"{{"nodes":[{{"mesh":0}},{{"children":[0],"scale":[3,2,2]}}],{scenes}
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"accessors":[{{"bufferView":0,
            "componentType":5126,"type":"VEC3","count":3}}],"bufferViews":[{{"buffer":0,"byteLength":36}}],
            "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
        );
        let options =
            crate::ImportOptions { fill: Some(crate::options::Fill::Shell), up: Some(Up::Z), ..Default::default() };
        ImportSpec { options, ..ImportSpec::new("a.gltf", bytes.into_bytes()) }.read()
    };
    let of_scene = document(r#""scenes":[{"nodes":[1]}],"#).unwrap();
    for scenes in ["", r#""scenes":[],"#] {
        assert_eq!(document(scenes).unwrap().terrain, of_scene.terrain, "{scenes}");
    }
    let error = document(r#""scene":1,"scenes":[{"nodes":[1]}],"#).unwrap_err().to_string();
    assert!(error.contains("scene: 1 is none of the 1 scenes"), "{error}");
}

#[test]
fn data_beside_the_document_are_read() {
    let names = |uri: &str| {
        let text = format!(r#"{{"buffers":[{{"byteLength":36,"uri":"{uri}"}}]}}"#);
        let spec = ImportSpec::new("a.gltf", text.clone().into_bytes());
        (spec.missing(), refuse(text.as_bytes()))
    };
    assert_eq!(names("a%20b.bin").0, [PathBuf::from("a b.bin")]);
    assert_eq!(names("./sub/a.bin").0, [PathBuf::from("./sub/a.bin")]);
    for uri in ["/etc/passwd", "../a.bin", "sub/../../a.bin", "%2e%2e/a.bin", "file:///a.bin", "http://a/b.bin", ""] {
        let (names, refused) = names(uri);
        assert_eq!(names, Vec::<PathBuf>::new(), "{uri}");
        assert!(
            refused.contains("is no file below the folder of the scene; put it there, or save as .glb"),
            "{refused}"
        );
    }
    let text = scene(
        r#""meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"accessors":[{"bufferView":0,"componentType":5126,
        "type":"VEC3","count":3}],"bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":"a.bin"}]"#,
    );
    let corners = [[0.0f32, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]];
    let data = corners.into_iter().flatten().flat_map(f32::to_le_bytes).collect();
    let options = crate::ImportOptions { fill: Some(crate::options::Fill::Shell), ..Default::default() };
    let spec = ImportSpec { options, ..ImportSpec::new("a.gltf", text) }.with_companions(vec![data]);
    assert_eq!(spec.read().unwrap().terrain.extent().size(), [12, 3, 12]);
}

#[test]
fn errors_name_the_entry() {
    assert_eq!(refuse(b"{"), "line 1: EOF while parsing an object");
    assert_eq!(refuse(b"{}"), "the file has no triangle");
    assert_eq!(refuse(b"glTF\x03\0\0\0"), "byte 4: the version is 3, allowed is 2");
    let old = "glTF 1.0 is not read, allowed is 2.0; convert the file, for instance by gltf-pipeline -i OLD -o NEW.glb";
    assert_eq!(refuse(b"glTF\x01\0\0\0"), format!("byte 4: {old}"));
    for version in ["\"1.0\"", "1.1", "\"0.8\""] {
        let text = format!(
            r#"{{"asset":{{"version":{version}}},"scene":"s","scenes":{{"s":{{"nodes":["a"]}}}},"nodes":{{"a":{{}}}}}}"#
        );
        assert_eq!(refuse(text.as_bytes()), format!("asset.version: {old}"));
    }
    assert_eq!(refuse(&scene("\"meshes\":[]")), "meshes[0]: there is no such mesh");
    let cycle = br#"{"nodes":[{"children":[1]},{"children":[0]}],"scenes":[{"nodes":[0]}]}"#;
    assert_eq!(refuse(cycle), "nodes[0]: a node has two parents");
    let external = br#"{"buffers":[{"uri":"a.bin","byteLength":9}]}"#;
    assert_eq!(
        refuse(external),
        "buffers[0].uri: the data are in another file, which is not at hand; save the scene as .glb"
    );
    let primitive = |accessor: &str| {
        refuse(&scene(&format!(
            r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"accessors":[{accessor}],
            "bufferViews":[{{"buffer":0,"byteLength":12}}],"buffers":[{{"uri":"data:;base64,AAAAAAAAAAAAAAAA"}}]"#
        )))
    };
    assert_eq!(
        primitive(r#"{"bufferView":0,"componentType":5126,"type":"VEC2","count":1}"#),
        "accessors[0]: it is of type VEC2 and componentType 5126, expected VEC3 of [5126, 5120, 5121, 5122, 5123]"
    );
    assert_eq!(
        primitive(r#"{"bufferView":0,"componentType":5126,"type":"VEC3","count":2}"#),
        "accessors[0]: 2 elements do not fit into its 12 bytes"
    );
    assert_eq!(
        primitive(r#"{"bufferView":0,"componentType":5126,"type":"VEC3","count":18446744073709551615}"#),
        "accessors[0]: 18446744073709551615 elements do not fit into its 12 bytes"
    );
    let compressed =
        scene(r#""meshes":[{"primitives":[{"attributes":{},"extensions":{"KHR_draco_mesh_compression":{}}}]}]"#);
    assert!(refuse(&compressed).contains("it is compressed with Draco"));
}
