//! The files that a world names, and the models that are known without them.

use std::path::{Component, Path, PathBuf};

use roxmltree::Node;

use super::super::{FormatError, xml};

/// What to do about a file that is not found.
pub(super) const ELSEWHERE: &str = "is not found below the folder of the world; name the folder in which its model \
                                    lies by map.import.model_path (--model-path)";

/// Models that nearly all worlds include, by their names, as those of Gazebo's models: a light, and
/// a level plane.
const KNOWN: [(&str, &str); 2] = [
    ("sun", "<sdf version='1.5'><model name='sun'/></sdf>"),
    (
        "ground_plane",
        "<sdf version='1.5'><model name='ground_plane'><link name='link'><collision name='collision'><geometry><plane>\
         <normal>0 0 1</normal><size>100 100</size></plane></geometry></collision></link></model></sdf>",
    ),
];

/// A model that is known without its file, by its folder, and its text.
pub(super) fn known_model(place: &Path) -> Option<(&'static str, &'static str)> {
    let name = place.strip_prefix("model:").ok()?;
    KNOWN.into_iter().find(|(known, _)| name == Path::new(known))
}

/// The same, by its address on Fuel without the scheme; a version may follow the name.
fn known_of_fuel(address: &str) -> Option<(&'static str, &'static str)> {
    let address = address.to_ascii_lowercase().replace("%20", "_").replace(' ', "_");
    let (_, model) = address.split_once("/openrobotics/models/")?;
    let name = model.split('/').next()?;
    KNOWN.into_iter().find(|(known, _)| name == *known)
}

/// The file of a model that its `model.config` names: that of the newest version.
pub(super) fn file_of_config(bytes: &[u8]) -> Result<PathBuf, FormatError> {
    let text = xml::text(bytes)?;
    let document = xml::parse(text)?;
    let root = document.root_element();
    let version = |file: &Node<'_, '_>| {
        let parts = file.attribute("version").unwrap_or("1.0").split('.');
        parts.map(|part| part.trim().parse::<u32>().unwrap_or(0)).collect::<Vec<u32>>()
    };
    let file = xml::children(root, "sdf").max_by_key(version).and_then(|file| file.text()).map(str::trim);
    file.map(PathBuf::from).ok_or_else(|| xml::fault(root, "it names no sdf file"))
}

/// The file that a URI names, from a folder or from a model.
///
/// # Errors
/// If it names none below them.
pub(super) fn path_of(uri: &str, folder: &Path) -> Result<PathBuf, String> {
    // Two slashes, or one as some write.
    let parts = uri.split_once(":/").map(|(scheme, rest)| (scheme, rest.strip_prefix('/').unwrap_or(rest)));
    let joined = match parts {
        Some(("model" | "package", rest)) => Path::new("model:").join(rest.trim_start_matches('/')),
        Some(("file", rest)) if uri.starts_with("file://") && !rest.starts_with('/') => folder.join(rest),
        Some(("file", _)) => return Err(ELSEWHERE.to_owned()),
        Some(("http" | "https" | "fuel", rest)) => match known_of_fuel(rest) {
            Some((name, _)) => Path::new("model:").join(name),
            None => {
                return Err("is on the network, from which nothing is read; download the model (gz fuel download -u \
                            URI), write model://NAME for its uri and name the folder in which NAME lies by \
                            map.import.model_path (--model-path)"
                    .to_owned());
            }
        },
        Some(_) => return Err("is of a kind that is not known, expected model:// or the name of a file".to_owned()),
        None if uri.is_empty() => return Err("is missing".to_owned()),
        None => folder.join(uri),
    };
    let mut path = PathBuf::new();
    for part in joined.components() {
        match part {
            Component::Normal(part) => path.push(part),
            Component::CurDir => {}
            Component::ParentDir if path.pop() => {}
            _ => return Err(ELSEWHERE.to_owned()),
        }
    }
    Ok(path)
}
