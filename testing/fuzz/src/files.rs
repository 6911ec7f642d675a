//! Targets of files: maps, scenarios, plans and recordings.

use std::path::Path;

use experiments::plan::Plan;
use recording::{End, Recording};
use sim_server::info;
use simulation::scenario::Scenario;
use voxels::{Grid, m3dm};

/// The name of the files in errors.
const NAME: &str = "fuzz.file";

/// Most runs of a plan, because each takes time.
const RUNS_MAX: usize = 64;

/// A map in either format: writing what was read gives the same bytes.
pub(crate) fn map(bytes: &[u8]) {
    if let Ok(terrain) = m3dm::read(bytes) {
        assert_eq!(m3dm::write(&terrain).as_deref(), Ok(bytes));
        assert_eq!(Grid::from_text(&terrain.to_text()), Ok(terrain));
    }
    let Ok(text) = str::from_utf8(bytes) else { return };
    if let Ok(terrain) = Grid::from_text(text) {
        assert!(terrain.extent().volume() <= text.len(), "a map has no more cells than its text");
        assert_eq!(Grid::from_text(&terrain.to_text()), Ok(terrain));
    }
}

/// A scenario: writing what was read gives an equal scenario.
pub(crate) fn scenario(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    match Scenario::parse(NAME, text, &[]) {
        Ok(scenario) => {
            let identity = scenario.identity();
            for written in [scenario.to_toml(), identity.clone()] {
                let again = Scenario::parse(NAME, &written, &[]).unwrap_or_else(|error| panic!("{error}:\n{written}"));
                assert_eq!(again.identity(), identity);
            }
        }
        Err(error) => assert_well_formed(&error.to_string()),
    }
}

/// A plan that names no file and is not too large: its saved text is the same plan.
pub(crate) fn plan(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    if !is_small_plan(text) {
        return;
    }
    match Plan::parse(NAME, text, Path::new("")) {
        Ok(plan) => {
            let again = Plan::parse(NAME, &plan.text, Path::new("")).unwrap_or_else(|error| panic!("{error}"));
            let ids = |plan: &Plan| plan.runs.iter().map(|run| run.id.clone()).collect::<Vec<_>>();
            assert_eq!(ids(&again), ids(&plan));
        }
        Err(error) => assert_well_formed(&error.to_string()),
    }
}

/// Whether a plan is small enough. Text that is no TOML is.
fn is_small_plan(text: &str) -> bool {
    let Ok(plan) = text.parse::<toml::Table>() else { return true };
    // The content of files would make the target depend on the machine.
    if plan.get("scenario").is_some_and(toml::Value::is_str) || text.contains("file") {
        return false;
    }
    let seeds = match plan.get("seeds") {
        Some(toml::Value::String(range)) => {
            let ends = range.split_once("..").map(|(first, last)| (first.trim().parse(), last.trim().parse()));
            if let Some((Ok(first), Ok(last))) = ends { u64::abs_diff(first, last).saturating_add(1) } else { 1 }
        }
        Some(toml::Value::Array(list)) => list.len() as u64,
        _ => 1,
    };
    let axes = plan.get("axes").and_then(toml::Value::as_table).into_iter().flat_map(toml::Table::values);
    let values = axes.map(|values| values.as_array().map_or(1, Vec::len));
    let runs = values.fold(usize::try_from(seeds).unwrap_or(usize::MAX), |runs, values| runs.saturating_mul(values));
    runs <= RUNS_MAX
}

/// A recording: refused, or read up to its end or its damage and described.
pub(crate) fn recording(bytes: &[u8]) {
    let recording = match Recording::from_bytes(NAME.to_owned(), bytes.to_vec()) {
        Ok(recording) => recording,
        Err(error) => return assert_well_formed(&error.to_string()),
    };
    let mut messages = recording.messages();
    let read = messages.by_ref().count() as u64;
    let end = messages.end().expect("messages end somewhere");
    let info = info::of(&recording);
    assert_eq!(info.messages.values().map(|traffic| traffic.count).sum::<u64>(), read);
    assert_eq!(info.damage.is_some(), matches!(end, End::CutOff { .. } | End::Damage { .. }));
    let text = info::text(&info.into());
    assert!(text.lines().last().is_some_and(|last| last.starts_with("digest: ")), "{text}");
}

/// Fails unless an error is one line and names the file.
fn assert_well_formed(error: &str) {
    assert!(error.starts_with(NAME), "an error that does not name the file: {error}");
    assert!(!error.contains('\n'), "an error of several lines: {error}");
}
