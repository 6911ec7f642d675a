//! The nodes of a COLLADA scene, and where they place geometries.

use std::collections::BTreeMap;

use nalgebra::{Matrix4, Vector3};
use roxmltree::Node;

use super::super::placing::turn;
use super::super::{FormatError, xml};

/// Most nodes within nodes, and most nodes of a scene, with those that it repeats.
const DEPTH_MAX: usize = 256;
const NODES_MAX: usize = 1 << 17;

/// The libraries of a document, by the ids of their elements.
pub(super) struct Scene<'a, 'i> {
    root: Node<'a, 'i>,
    ids: BTreeMap<&'a str, Node<'a, 'i>>,
}

/// A geometry with the matrix that places it and the name of its node.
type Instance<'a, 'i> = (Node<'a, 'i>, Matrix4<f64>, &'a str);

impl<'a, 'i> Scene<'a, 'i> {
    pub(super) fn of(root: Node<'a, 'i>) -> Self {
        let named = root
            .descendants()
            .filter(|node| matches!(node.tag_name().name(), "geometry" | "node" | "visual_scene" | "controller"));
        let ids = named.filter_map(|node| Some((node.attribute("id")?, node))).collect();
        Self { root, ids }
    }

    /// The element that a reference names.
    fn get(&self, element: Node<'a, 'i>, attribute: &str) -> Result<Node<'a, 'i>, FormatError> {
        let name = element.attribute(attribute).unwrap_or_default();
        let found = name.strip_prefix('#').and_then(|id| self.ids.get(id).copied());
        found.ok_or_else(|| xml::fault(element, format_args!("{attribute} = {name:?} names nothing in the file")))
    }

    /// The geometries of the scene with the matrices that place them, and the names of their nodes,
    /// or else of the nodes above; all of them once, where they are, if there is no scene.
    ///
    /// # Errors
    /// If a reference leads nowhere, a transform is malformed, or there are too many nodes.
    pub(super) fn instances(&self) -> Result<Vec<Instance<'a, 'i>>, FormatError> {
        let chosen = xml::child(self.root, "scene").and_then(|scene| xml::child(scene, "instance_visual_scene"));
        let chosen = chosen.map(|instance| self.get(instance, "url")).transpose()?;
        let first = || self.root.descendants().find(|node| node.tag_name().name() == "visual_scene");
        let Some(scene) = chosen.or_else(first) else {
            let geometries = self.root.descendants().filter(|node| node.tag_name().name() == "geometry");
            return Ok(geometries.map(|geometry| (geometry, Matrix4::identity(), "")).collect());
        };
        let mut found = Vec::new();
        let mut open: Vec<(Node<'a, 'i>, Matrix4<f64>, usize, &'a str)> =
            nodes_in(scene).map(|node| (node, Matrix4::identity(), 0, "")).collect();
        let mut count = 0;
        while let Some((node, above, depth, name_above)) = open.pop() {
            count += 1;
            if depth > DEPTH_MAX || count > NODES_MAX {
                let reason = format!("its scene has more than {NODES_MAX} nodes, or nodes deeper than {DEPTH_MAX}");
                return Err(xml::fault(node, reason));
            }
            let here = above * transform(node)?;
            let name = node.attribute("name").unwrap_or(name_above);
            for child in node.children().filter(Node::is_element) {
                match child.tag_name().name() {
                    "node" => open.push((child, here, depth + 1, name)),
                    "instance_node" => open.push((self.get(child, "url")?, here, depth + 1, name)),
                    "instance_geometry" => found.push((self.get(child, "url")?, here, name)),
                    "instance_controller" => {
                        let controller = self.get(child, "url")?;
                        if let Some(skin) = xml::child(controller, "skin") {
                            let shape = xml::child(skin, "bind_shape_matrix").map(matrix).transpose()?;
                            let shape = shape.unwrap_or_else(Matrix4::identity);
                            found.push((self.get(skin, "source")?, here * shape, name));
                        }
                    }
                    _ => {}
                }
            }
        }
        Ok(found)
    }
}

fn nodes_in<'a, 'i>(scene: Node<'a, 'i>) -> impl Iterator<Item = Node<'a, 'i>> {
    xml::children(scene, "node")
}

/// From the coordinates of a node to those of its parent: its transforms, the last one first.
fn transform(node: Node<'_, '_>) -> Result<Matrix4<f64>, FormatError> {
    let mut whole = Matrix4::identity();
    for child in node.children().filter(Node::is_element) {
        let few = |count: usize| {
            let numbers = xml::numbers::<f64>(child, 16)?;
            let is_right = numbers.len() == count && numbers.iter().all(|number| number.is_finite());
            if is_right { Ok(numbers) } else { Err(xml::fault(child, format_args!("expected {count} finite numbers"))) }
        };
        whole *= match child.tag_name().name() {
            "matrix" => matrix(child)?,
            "translate" => Matrix4::new_translation(&Vector3::from_vec(few(3)?)),
            "scale" => Matrix4::new_nonuniform_scaling(&Vector3::from_vec(few(3)?)),
            "rotate" => {
                let numbers = few(4)?;
                turn([numbers[0], numbers[1], numbers[2]], numbers[3].to_radians()).to_homogeneous()
            }
            name @ ("skew" | "lookat") => {
                return Err(xml::fault(child, format_args!("{name} is not read; save the scene with matrices")));
            }
            _ => continue,
        };
    }
    Ok(whole)
}

/// A matrix of rows.
fn matrix(element: Node<'_, '_>) -> Result<Matrix4<f64>, FormatError> {
    let numbers = xml::numbers::<f64>(element, 16)?;
    if numbers.len() != 16 || !numbers.iter().all(|number| number.is_finite()) {
        return Err(xml::fault(element, "expected 16 finite numbers"));
    }
    Ok(Matrix4::from_row_slice(&numbers))
}
