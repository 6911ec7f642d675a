//! Which runs show the routes of a report, and what their recordings say of them.
//!
//! Of each variant under each condition it is the run with the median of the primary measure. A run
//! is a function of its scenario, so what was not recorded can be recorded when the report is made:
//! [`record`] executes these runs again. Runs without a recording have no picture.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use experiments::execute::{self, ExecuteError, Options, PlanObserver, Selection, Stop};
use experiments::plan::{MAP_FILE, Plan, PlannedRun};
use experiments::retained_recordings::Keep;
use experiments::rows::RunRecord;
use experiments::store::Store;
use msgs::cdr::CdrError;
use msgs::ids::AgentId;
use recording::map::RecordedMapError;
use recording::routes::Route;
use recording::{Recording, RecordingError, SCENARIO_ATTACHMENT};
use simulation::scenario::{Scenario, ScenarioError};
use thiserror::Error;

use super::figures::Figure;
use super::figures::routes::{RoutesOfRun, picture};
use super::floor_plan::FloorPlan;
use super::measure::Compared;
use super::metrics::TimeUnit;
use super::study::{Condition, Study, StudyError};

/// Why the routes of a report are not recorded.
#[derive(Debug, Error)]
pub enum RecordError {
    #[error(transparent)]
    Execute(#[from] ExecuteError),
    #[error("run {id}: not of the plan in the folder and this build, which alone can execute it again")]
    OtherBuild { id: String },
    #[error("run {id}: {key} = {value}: a report starts no program; `maes batch --keep all --run {id}` does")]
    Program { id: String, key: &'static str, value: String },
    #[error("{count} runs failed when they were executed again")]
    Failed { count: usize },
    #[error("{count} runs were not executed again, because the program was stopped")]
    Stopped { count: usize },
}

/// Why a recording shows no routes.
#[derive(Debug, Error)]
enum RouteError {
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    #[error(transparent)]
    Map(#[from] RecordedMapError),
    #[error("a message on /tf cannot be decoded: {0}")]
    Transforms(#[from] CdrError),
    #[error("it has no map")]
    NoMap,
    #[error("it has no poses (recording.poses_period_ticks = 0)")]
    NoPoses,
}

/// The runs whose routes a report on a folder shows, and whose recordings it lacks.
///
/// # Errors
/// If the folder has no runs, or one cannot be read.
pub fn without_recording(dir: &Path) -> Result<BTreeSet<String>, StudyError> {
    let (study, store) = (Study::read(dir)?, Store::open(dir)?);
    let shown = study.conditions.iter().flat_map(|condition| shown_runs(&study, condition));
    let ids = shown.map(|(_, run)| run.row.id.clone());
    Ok(ids.filter(|id| !store.recording_file(id).exists()).collect())
}

/// Executes runs of a folder again, and keeps their recordings. No program is started that the plan
/// names: a folder may be a stranger's.
///
/// # Errors
/// If a run is not of `plan` and this build, needs a program, or cannot be executed.
pub fn record(
    dir: &Path,
    plan: &Plan,
    only: BTreeSet<String>,
    options: &Options,
    observer: &mut dyn PlanObserver,
    stop: &Stop,
) -> Result<(), RecordError> {
    if only.is_empty() {
        return Ok(());
    }
    for id in &only {
        let planned = plan.runs.iter().find(|run| run.id == *id);
        let PlannedRun { scenario, .. } = planned.ok_or_else(|| RecordError::OtherBuild { id: id.clone() })?;
        let needed = scenario.phases().iter().find_map(|phase| phase.agents.of_ros_only(false));
        if let Some((key, value)) = needed {
            return Err(RecordError::Program { id: id.clone(), key, value });
        }
    }
    let selection = Selection { only, keep: Keep::All };
    let summary = execute::execute_selected(plan, dir.to_owned(), options, &selection, observer, stop)?;
    match (summary.failed, summary.left) {
        (0, 0) => Ok(()),
        (0, count) => Err(RecordError::Stopped { count }),
        (count, _) => Err(RecordError::Failed { count }),
    }
}

/// The run of each variant whose routes are shown: that with the median of the primary measure, the
/// lower one of an even number, among those that have not failed.
fn shown_runs<'a>(study: &'a Study, condition: &Condition) -> Vec<(&'a str, &'a RunRecord)> {
    let measure = Compared::of(study.design.primary());
    let horizon_s = study.horizon_s(condition);
    let median = |(variant, name): (usize, &'a String)| {
        let mut runs = study.measured(condition, variant);
        let value = |run: &&RunRecord| measure.values(&[*run], horizon_s)[0];
        runs.sort_by(|one, other| {
            let by_name = || (one.row.seed, &one.row.id).cmp(&(other.row.seed, &other.row.id));
            value(one).total_cmp(&value(other)).then_with(by_name)
        });
        Some((name.as_str(), *runs.get(runs.len().checked_sub(1)? / 2)?))
    };
    study.variants.iter().enumerate().filter_map(median).collect()
}

/// The pictures of the routes that the folder has recordings of, one for each panel, and what to
/// say of recordings that show none.
pub(super) fn pictures(dir: &Path, study: &Study) -> Result<(Vec<Figure>, Vec<String>), StudyError> {
    let store = Store::open(dir)?;
    let measure = Compared::of(study.design.primary());
    let unit = TimeUnit::of(&study.runs);
    let (mut pictures, mut notes) = (Vec::new(), BTreeSet::new());
    for (number, condition) in (1..).zip(&study.conditions) {
        let mut shown = Vec::new();
        for (variant, run) in shown_runs(study, condition) {
            let file = store.recording_file(&run.row.id);
            if !file.exists() {
                continue;
            }
            match read(&file) {
                Ok((plan, routes)) => {
                    let map = run.row.axes.get(MAP_FILE).map_or_else(String::new, |map| format!("{map}, "));
                    let value = measure.value_text(run, study.horizon_s(condition), unit);
                    let about = format!("{map}seed {}: {value}; run {}", run.row.seed, run.row.id);
                    shown.push(RoutesOfRun { variant: variant.to_owned(), about, plan, routes });
                }
                Err(why) => drop(notes.insert(format!("The routes of run {} are not shown: {why}.", run.row.id))),
            }
        }
        if !shown.is_empty() {
            let name = if study.conditions.len() == 1 { "routes".to_owned() } else { format!("routes-{number}") };
            pictures.push(picture(&name, &study.condition_name(condition), &shown));
        }
    }
    Ok((pictures, notes.into_iter().collect()))
}

/// The map of a recorded run, in the layers in which there were bodies, and their routes.
fn read(file: &Path) -> Result<(FloorPlan, BTreeMap<AgentId, Route>), RouteError> {
    let recording = Recording::open(file)?;
    let scenario = Scenario::parse(SCENARIO_ATTACHMENT, &recording.scenario(), &[])?;
    let terrain = recording::map::read(&recording, &scenario)?.ok_or(RouteError::NoMap)?;
    let mut routes = recording::routes::read(&recording, scenario.recording.poses_period_ticks)?;
    routes.retain(|agent, _| agent.0 < scenario.agents.count);
    let layers = || {
        let heights_m = routes.values().flatten().flatten().map(|[_, _, z]| z);
        heights_m.map(|z_m| (z_m / terrain.extent().cell_m()).max(0.0) as usize)
    };
    let (lowest, highest) = layers().min().zip(layers().max()).ok_or(RouteError::NoPoses)?;
    Ok((FloorPlan::of(&terrain, lowest..=highest), routes))
}
