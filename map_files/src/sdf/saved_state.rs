//! The state of a world that Gazebo Classic has saved beside its models: where they were then.
//!
//! Classic loads its first `state` over the models: the poses of models, of models in them and of
//! links are those in the world. A scale is not applied: Classic writes shapes that it has scaled
//! with their new sizes, and the scale once more.

use nalgebra::Isometry3;
use roxmltree::Node;

use super::super::{FormatError, Note, xml};
use super::poses::Model;

/// Moves the models of a world to where its state has them, and says what it does not follow.
///
/// # Errors
/// If a pose is malformed.
pub(super) fn apply(state: Node<'_, '_>, world: &mut Model) -> Result<Vec<Note>, FormatError> {
    let mut counts = Counts::default();
    models(state, world, &Isometry3::identity(), &mut counts)?;
    let Counts { moved, scaled, unknown } = counts;
    let changed = xml::children(state, "insertions").chain(xml::children(state, "deletions")).count();
    let mut notes = Vec::new();
    if moved > 0 {
        notes.push(Note::new("state", format!("{moved} model(s) are where the saved state of the world has them")));
    }
    for (count, text) in [
        (scaled, "model(s) have a scale in the saved state, which is not applied; check their sizes"),
        (unknown, "model(s) of the saved state are not in the world, and left out"),
        (changed, "list(s) of models that the saved state adds or removes are not followed"),
    ] {
        if count > 0 {
            notes.push(Note::warning("state", format!("{count} {text}")));
        }
    }
    Ok(notes)
}

#[derive(Default)]
struct Counts {
    moved: usize,
    scaled: usize,
    unknown: usize,
}

/// Moves the models in one whose frame is `parent` in the world.
fn models(
    state: Node<'_, '_>,
    within: &mut Model,
    parent: &Isometry3<f64>,
    counts: &mut Counts,
) -> Result<(), FormatError> {
    for element in xml::children(state, "model") {
        let Some(model) = within.model_mut(element.attribute("name").unwrap_or_default()) else {
            counts.unknown += 1;
            continue;
        };
        if let Some(scale) = xml::child(element, "scale")
            && xml::numbers::<f64>(scale, 3)?.iter().any(|&along| along != 1.0)
        {
            counts.scaled += 1;
        }
        let Some(place) = model.move_to(element, parent)? else { continue };
        counts.moved += 1;
        for link in xml::children(element, "link") {
            model.move_link_to(link, &place)?;
        }
        models(element, model, &place, counts)?;
    }
    Ok(())
}
