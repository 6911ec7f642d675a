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

#[test]
fn errors_name_the_entry() {
    assert_eq!(refuse(b"{"), "line 1: EOF while parsing an object");
    assert_eq!(refuse(b"{}"), "the file has no triangle");
    assert_eq!(refuse(b"glTF\x01\0\0\0"), "byte 4: the version is 1, allowed is 2");
    assert_eq!(refuse(&scene("\"meshes\":[]")), "meshes[0]: there is no such mesh");
    let cycle = br#"{"nodes":[{"children":[1]},{"children":[0]}],"scenes":[{"nodes":[0]}]}"#;
    assert_eq!(refuse(cycle), "nodes[0]: a node has two parents");
    let external = br#"{"buffers":[{"uri":"a.bin","byteLength":9}]}"#;
    assert_eq!(refuse(external), "buffers[0].uri: the data are in another file; save the scene as .glb, in one piece");
    let primitive = |accessor: &str| {
        refuse(&scene(&format!(
            r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"accessors":[{accessor}],
            "bufferViews":[{{"buffer":0,"byteLength":12}}],"buffers":[{{"uri":"data:;base64,AAAAAAAAAAAAAAAA"}}]"#
        )))
    };
    assert_eq!(
        primitive(r#"{"bufferView":0,"componentType":5126,"type":"VEC2","count":1}"#),
        "accessors[0]: it is of type VEC2 and componentType 5126, expected VEC3 of [5126]"
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
