//! The axis upwards, which glTF fixes and some writers do not heed.

use super::super::options::Up;
use super::document::Node;

/// Writers, by a part of `asset.generator`, that leave coordinates as they are in memory, whatever
/// their axes: trimesh (5.2), Open3D (0.20) and assimp (5.2), as files of theirs show.
const AS_GIVEN: [(&str, &str); 3] =
    [("trimesh", "trimesh"), ("Open3D", "Open3D"), ("Open Asset Import Library", "assimp")];

/// Programs that make a file smaller and put their name in place of that of its writer.
const OPTIMISERS: [&str; 2] = ["gltfpack", "glTF-Transform"];

/// VTK (9.5) writes coordinates as they are, and so does ParaView with it; PyVista (0.49), which
/// writes with VTK, turns the scene before. Both give this generator.
const VTK: &str = "VTK";

/// The name of a writer that leaves coordinates as they are, of which this is a part.
pub(in super::super) fn writer_as_given(generator: &str) -> Option<&'static str> {
    AS_GIVEN.iter().find(|(part, _)| generator.contains(part)).map(|&(_, name)| name)
}

/// The axis upwards in a file of a writer, whose scene has this first node, and why.
pub(super) fn upwards(generator: &str, root: Option<&Node>) -> (Up, String) {
    if let Some(optimiser) = OPTIMISERS.into_iter().find(|&name| generator.contains(name)) {
        let reason = format!(
            "as glTF has it; {optimiser} names no earlier writer, and files of trimesh, Open3D and assimp have z"
        );
        return (Up::Y, reason);
    }
    if generator == VTK {
        let reason = "as glTF has it, and PyVista writes it; scenes of ParaView and of VTK's own writer have z";
        return (Up::Y, reason.to_owned());
    }
    let is_turned = root.is_some_and(|root| {
        let y = root.matrix().column(1).into_owned();
        y[1].abs() < 0.5 * y.norm()
    });
    match writer_as_given(generator) {
        // What names another axis than y, as COLLADA may, assimp turns by the first node.
        Some("assimp") if is_turned => (Up::Y, "as assimp has turned it".to_owned()),
        Some("assimp") => {
            let reason = "as assimp writes what has z upwards; it keeps the axes of the file that it converts, so that \
                          it is y if that was glTF";
            (Up::Z, reason.to_owned())
        }
        Some(writer) => (Up::Z, format!("as {writer} writes it")),
        None => (Up::Y, "as glTF has it".to_owned()),
    }
}
