//! The parts of a document of glTF 2.0 that place meshes, under the names of the specification.

use std::borrow::Cow;

use serde::{Deserialize, Deserializer};

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Asset {
    pub(super) generator: String,
    #[serde(deserialize_with = "extras")]
    pub(super) extras: Extras,
}

/// The part of a document that says its version, whatever the rest is.
#[derive(Deserialize)]
pub(super) struct Versioned {
    pub(super) asset: Version,
}

#[derive(Deserialize)]
pub(super) struct Version {
    version: serde_json::Value,
}

impl Version {
    /// Whether it is one before 2.0.
    pub(super) fn is_old(&self) -> bool {
        let number = self.version.as_f64().or_else(|| self.version.as_str()?.trim().parse().ok());
        number.is_some_and(|number| number < 2.0)
    }
}

/// What this project adds to an asset.
#[derive(Default)]
pub(super) struct Extras {
    pub(super) cell_m: Option<f64>,
}

/// Those of other programs may be anything.
fn extras<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Extras, D::Error> {
    let value = serde_json::Value::deserialize(deserializer)?;
    Ok(Extras { cell_m: value.get("cell_m").and_then(serde_json::Value::as_f64) })
}

#[derive(Deserialize)]
pub(super) struct Document<'a> {
    #[serde(default)]
    pub(super) asset: Asset,
    pub(super) scene: Option<usize>,
    #[serde(default)]
    pub(super) scenes: Vec<Scene>,
    #[serde(default)]
    pub(super) nodes: Vec<Node>,
    #[serde(default)]
    pub(super) meshes: Vec<MeshOfScene>,
    #[serde(default)]
    pub(super) accessors: Vec<Accessor>,
    #[serde(default, rename = "bufferViews")]
    pub(super) views: Vec<View>,
    #[serde(default, borrow)]
    pub(super) buffers: Vec<Buffer<'a>>,
    #[serde(default, rename = "extensionsRequired")]
    pub(super) required: Vec<String>,
}

impl Document<'_> {
    /// The nodes that are nobody's child, which stand for a scene where there is none.
    pub(super) fn nodes_without_parent(&self) -> Vec<usize> {
        let mut is_child = vec![false; self.nodes.len()];
        for &child in self.nodes.iter().flat_map(|node| &node.children) {
            if let Some(is_child) = is_child.get_mut(child) {
                *is_child = true;
            }
        }
        (0..self.nodes.len()).filter(|&node| !is_child[node]).collect()
    }
}

#[derive(Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub(super) nodes: Vec<usize>,
}

#[derive(Deserialize)]
pub(super) struct Node {
    #[serde(default)]
    pub(super) name: String,
    #[serde(default)]
    pub(super) children: Vec<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) matrix: Option<Box<[f64; 16]>>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    #[serde(default)]
    pub(super) extensions: ExtensionsOfNode,
}

#[derive(Default, Deserialize)]
pub(super) struct ExtensionsOfNode {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<Instancing>,
    #[serde(rename = "KHR_node_visibility")]
    pub(super) visibility: Option<Visibility>,
}

/// Whether a node and those below it are shown.
#[derive(Deserialize)]
pub(super) struct Visibility {
    #[serde(default = "shown")]
    pub(super) visible: bool,
}

fn shown() -> bool {
    true
}

/// Copies of the mesh of a node.
#[derive(Deserialize)]
pub(super) struct Instancing {
    pub(super) attributes: Places,
}

/// The accessors of the places of copies.
#[derive(Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) struct Places {
    pub(super) translation: Option<usize>,
    pub(super) rotation: Option<usize>,
    pub(super) scale: Option<usize>,
}

#[derive(Deserialize)]
pub(super) struct MeshOfScene {
    #[serde(default)]
    pub(super) primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
pub(super) struct Primitive {
    pub(super) attributes: Attributes,
    pub(super) indices: Option<usize>,
    pub(super) mode: Option<u32>,
    #[serde(default)]
    pub(super) extensions: Extensions,
}

#[derive(Default, Deserialize)]
pub(super) struct Extensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    pub(super) draco: Option<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
pub(super) struct Attributes {
    #[serde(rename = "POSITION")]
    pub(super) position: Option<usize>,
}

#[derive(Deserialize)]
pub(super) struct Accessor {
    #[serde(rename = "bufferView")]
    pub(super) view: Option<usize>,
    #[serde(default, rename = "byteOffset")]
    pub(super) offset: usize,
    #[serde(rename = "componentType")]
    pub(super) component: u32,
    pub(super) count: usize,
    #[serde(default)]
    pub(super) normalized: bool,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) sparse: Option<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
pub(super) struct View {
    pub(super) buffer: usize,
    #[serde(default, rename = "byteOffset")]
    pub(super) offset: usize,
    #[serde(rename = "byteLength")]
    pub(super) length: usize,
    #[serde(rename = "byteStride")]
    pub(super) stride: Option<usize>,
    #[serde(default)]
    pub(super) extensions: ExtensionsOfView,
}

#[derive(Default, Deserialize)]
pub(super) struct ExtensionsOfView {
    #[serde(rename = "EXT_meshopt_compression", alias = "KHR_meshopt_compression")]
    pub(super) meshopt: Option<Box<Packed>>,
}

/// Where the compressed bytes of a view are, and how they are compressed.
#[derive(Deserialize)]
pub(super) struct Packed {
    pub(super) buffer: usize,
    #[serde(default, rename = "byteOffset")]
    pub(super) offset: usize,
    #[serde(rename = "byteLength")]
    pub(super) length: usize,
    #[serde(rename = "byteStride")]
    pub(super) stride: usize,
    pub(super) count: usize,
    pub(super) mode: String,
    #[serde(default)]
    pub(super) filter: Option<String>,
}

#[derive(Deserialize)]
pub(super) struct Buffer<'a> {
    #[serde(default, borrow)]
    pub(super) uri: Option<Cow<'a, str>>,
    #[serde(default)]
    pub(super) extensions: ExtensionsOfBuffer,
}

#[derive(Default, Deserialize)]
pub(super) struct ExtensionsOfBuffer {
    /// Of a buffer without data, which is for readers that do not unpack views.
    #[serde(rename = "EXT_meshopt_compression", alias = "KHR_meshopt_compression")]
    pub(super) meshopt: Option<serde::de::IgnoredAny>,
}
