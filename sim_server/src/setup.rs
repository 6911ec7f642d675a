//! Builds the world that a scenario describes, and opens its recording.
//!
//! This module reads and creates the files; parsing and map generation live in `simulation` and
//! `mapgen`.

use std::num::NonZero;
use std::path::Path;

use msgs::ids::{AgentId, Tick};
use msgs::{maes_msgs, topics};
use thiserror::Error;
use voxels::{Extent, ExtentError, Grid, Terrain, m3dm, packed};

use crate::map_file;
use map_files::{ImportError, ImportSpec};
use mapgen::{self, GeneratedMap, MapError, MapReport, MapSpec};
use recording::recorder::{self, Document, RecordError, RecorderQueue, RunRecorder};
use recording::{MAP_ATTACHMENT, Recording, RecordingError, SCENARIO_ATTACHMENT, map};
use simulation::digest::Digest;
use simulation::scenario::{EnergySection, MapKind, Override, Scenario, ScenarioError};
use world::collision::Sphere;
use world::moving_obstacles::Misplaced;
use world::spawn::{Site, SpawnError};
use world::{World, WorldParams};

mod scenario_file;

pub use scenario_file::{folder_of, load, load_with_paths_from, parse, parse_with_paths_from, resolve, text};

/// Memory of a world per cell of the map, and of each agent in it per cell; bytes, rounded up.
const WORLD_CELL_BYTES: usize = 2;
const AGENT_CELL_BYTES: usize = 2;

/// Why a scenario cannot be set up.
#[derive(Debug, Error)]
pub enum SetupError {
    /// A file cannot be read.
    #[error("{file}: {source}")]
    Read {
        /// The file.
        file: String,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The scenario is not legal.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The file is not UTF-8.
    #[error("{file}:{line}:{column}: a byte that is no UTF-8; a scenario is a TOML text in UTF-8")]
    NoText {
        /// The file.
        file: String,
        /// From 1.
        line: usize,
        /// From 1, in characters.
        column: usize,
    },
    /// The map has an impossible size.
    #[error("map.size: {0}")]
    Extent(#[from] ExtentError),
    /// The scenario is not that of the recording.
    #[error("{file}: the scenario of a recorded run stays as it is, only [execution] and [views] may be set: {what}")]
    OtherScenario {
        /// The recording.
        file: String,
        /// The first difference.
        what: String,
    },
    /// A fork is to begin after the end of the recording.
    #[error("{file}: --at {at_s}: expected a time of the recorded run, which {ended} {end_s} s")]
    NoSuchTick {
        /// The recording.
        file: String,
        /// When the fork was to begin, seconds of sim time.
        at_s: f64,
        /// How the recording ends.
        ended: &'static str,
        /// The last recorded tick, seconds of sim time.
        end_s: f64,
    },
    /// A fork is to be recorded over its parent.
    #[error("execution.record = {file}: expected another file than the recording that is forked")]
    OverParent {
        /// The recording.
        file: String,
    },
    /// The recording has no map.
    #[error(
        "{file}: its attachment map.m3dm is missing: the file was cut, or another program has written it again; take \
         the one that `maes run` has written"
    )]
    NoMap {
        /// The recording.
        file: String,
    },
    /// The map cannot be generated or repaired.
    #[error("{table}: {source}")]
    Map {
        /// Table or key of the scenario at fault.
        table: &'static str,
        /// The error of the generator.
        source: MapError,
    },
    /// The map cannot be imported.
    #[error("{table}: {source}")]
    Import {
        /// Key of the scenario at fault.
        table: &'static str,
        /// The error of the importer.
        source: ImportError,
    },
    /// There is no room for the team.
    #[error(transparent)]
    Spawn(#[from] SpawnError),
    /// A base is where no body can be.
    #[error("energy.bases[{number}]: {position:?} m is {found}; expected a position in a free cell")]
    Base {
        /// Number of the base.
        number: usize,
        /// Its centre, metres.
        position: [f64; 3],
        /// What is there.
        found: &'static str,
    },
    /// A moving obstacle meets a wall on its path.
    #[error(
        "obstacle[{number}].path: from {from:?} m to the next point it meets a wall or the end of the map; expected a path \
         on which the whole obstacle is in free cells"
    )]
    ObstacleInWall {
        /// Number of the obstacle.
        number: usize,
        /// The point before the wall, metres.
        from: [f64; 3],
    },
    /// A moving obstacle begins on an agent.
    #[error(
        "obstacle[{number}].path: it begins at {at:?} m, where agent {agent} starts; expected another first point, or \
         other start poses ([spawn])"
    )]
    ObstacleOnAgent {
        /// Number of the obstacle.
        number: usize,
        /// Its first point, metres.
        at: [f64; 3],
        /// The agent.
        agent: AgentId,
    },
    /// An event that changes the map has no cells.
    #[error(
        "event[{number}]: the box from {low:?} to {high:?} m holds the centre of no cell that can change; expected a box \
         within {cell_m} to {inner_m:?} m, as the outermost layer of cells stays wall, and cells are {cell_m} m wide"
    )]
    NoCells {
        /// Number of the event.
        number: usize,
        /// Lowest corner of its box, metres.
        low: [f64; 3],
        /// Highest corner of its box, metres.
        high: [f64; 3],
        /// Edge length of a cell, metres.
        cell_m: f64,
        /// Highest corner of the cells that can change, metres.
        inner_m: [f64; 3],
    },
}

/// The scenario of a recorded run. `[execution]` and `[views]` come from a scenario file, if there
/// is one, and from the overridden keys.
///
/// # Errors
/// If the file cannot be read, or another key would differ.
pub fn load_recorded(
    recording: &Recording,
    file: Option<&Path>,
    overrides: &[Override],
) -> Result<Scenario, SetupError> {
    let text = recording.scenario();
    let mut scenario = match file {
        Some(file) => load(file, overrides)?,
        None => Scenario::parse(recording.file(), &text, overrides)?,
    };
    let recorded = Scenario::parse(recording.file(), &text, &[])?;
    if is_same_map_elsewhere(recording, &recorded, &scenario)? {
        // The recording keeps the name that it has.
        (scenario.map.file, scenario.map.import) = (recorded.map.file.clone(), recorded.map.import.clone());
    }
    let identity = scenario.identity();
    if identity != *text {
        let lines = text.lines().zip(identity.lines()).find(|(before, now)| before != now);
        let what = lines.map_or_else(|| "other keys".to_owned(), |(before, now)| format!("{before} would be {now}"));
        return Err(SetupError::OtherScenario { file: recording.file().to_owned(), what });
    }
    Ok(scenario)
}

/// Whether a scenario names the map of a recording by another file, or reads it with other options.
fn is_same_map_elsewhere(recording: &Recording, recorded: &Scenario, scenario: &Scenario) -> Result<bool, SetupError> {
    let source = |scenario: &Scenario| (scenario.map.file.clone(), scenario.map.import.clone());
    let are_files = [recorded, scenario].iter().all(|scenario| scenario.map.kind == MapKind::File);
    if !are_files || source(recorded) == source(scenario) {
        return Ok(false);
    }
    let here = generate_map(scenario)?.terrain;
    let there = match map::attached(recording, recorded) {
        Some(import) => imported(import, recorded)?.terrain,
        None => return Err(SetupError::NoMap { file: recording.file().to_owned() }),
    };
    Ok(here == there)
}

/// The scenario of a fork of a recorded run at a tick: `[execution]` and `[views]` as overridden,
/// and the other overrides from that tick on ([`Scenario::fork`]).
///
/// # Errors
/// If the recording does not reach that tick, a key may not change, or a value is not legal.
pub fn fork(recording: &Recording, at: Tick, overrides: &[Override]) -> Result<Scenario, SetupError> {
    let file = recording.file().to_owned();
    let (mut reach, mut digest) = (Tick::ZERO, String::new());
    let (mut is_ended, mut is_damaged) = (false, false);
    let mut messages = recording.messages();
    for message in messages.by_ref() {
        reach = reach.max(message.tick());
        is_ended |= message.channel.topic == topics::result().name;
        if message.channel.topic == topics::digest().name {
            match message.decode::<maes_msgs::Digest>() {
                Ok(message) => digest = Digest(message.digest).to_string(),
                Err(_) => is_damaged = true,
            }
        }
    }
    if at > reach || is_damaged {
        let ended = if is_ended { "has ended at" } else { "is recorded up to" };
        return Err(SetupError::NoSuchTick { file, at_s: seconds(at), ended, end_s: seconds(reach) });
    }
    let is_of_execution = |change: &&Override| {
        let (table, _) = change.key.split_once('.').unwrap_or((&change.key, ""));
        ["execution", "views"].contains(&table)
    };
    let (of_execution, changes): (Vec<_>, Vec<_>) = overrides.iter().partition(is_of_execution);
    let [of_execution, changes] = [of_execution, changes].map(|list| list.into_iter().cloned().collect::<Vec<_>>());
    let parent = Scenario::parse(recording.file(), &recording.scenario(), &of_execution)?;
    if let Some(record) = &parent.execution.record
        && is_same_file(record, Path::new(recording.file()))
    {
        return Err(SetupError::OverParent { file });
    }
    Ok(parent.fork(at, &digest, &changes)?)
}

fn is_same_file(one: &Path, other: &Path) -> bool {
    one.canonicalize().ok().zip(other.canonicalize().ok()).is_some_and(|(one, other)| one == other)
}

/// The sim time of a tick, seconds.
fn seconds(tick: Tick) -> f64 {
    tick.time_ns() as f64 / 1e9
}

/// The tick at a sim time in seconds.
///
/// # Errors
/// What is expected, if no tick begins then.
pub fn tick_at(seconds: f64) -> Result<Tick, String> {
    let ticks = seconds / Tick::TICK_S;
    let is_tick = (0.0..=1e10).contains(&ticks) && (ticks - libm::round(ticks)).abs() < 1e-6;
    if is_tick {
        Ok(Tick(libm::round(ticks) as u64))
    } else {
        Err("expected a multiple of 0.02 s, at least 0".to_owned())
    }
}

/// Builds the world of a recorded run, with the map of the recording.
///
/// # Errors
/// If the recording has no map, or memory or room for the team is missing.
pub fn rebuild(recording: &Recording, scenario: &Scenario) -> Result<(World, MapReport), SetupError> {
    let import =
        map::attached(recording, scenario).ok_or_else(|| SetupError::NoMap { file: recording.file().to_owned() })?;
    let mut map = imported(import, scenario)?;
    if let Some(spec) = generator(scenario) {
        let entrances = mapgen::entrances(&spec, map.terrain.extent(), scenario.map_seed());
        map.entrances = entrances.map_err(map_error(scenario))?;
    }
    inhabit(map, scenario)
}

/// Builds the world of a scenario.
///
/// # Errors
/// If the map cannot be made, or memory or room for the team is missing. The error names the key,
/// but not the file.
pub fn build(scenario: &Scenario) -> Result<(World, MapReport), SetupError> {
    inhabit(generate_map(scenario)?, scenario)
}

/// Puts the team on a map.
fn inhabit(map: GeneratedMap, scenario: &Scenario) -> Result<(World, MapReport), SetupError> {
    let GeneratedMap { terrain, entrances, report } = map;
    let agents = scenario.agents.count as usize;
    let errors = scenario.sensor.errors(scenario.seed);
    let vote_bytes = if errors.affects_scans() { 1 } else { 0 };
    mapgen::check_memory(terrain.extent(), WORLD_CELL_BYTES + agents * (AGENT_CELL_BYTES + vote_bytes))
        .map_err(map_error(scenario))?;
    check_map_changes(scenario, terrain.extent())?;
    check_bases(scenario, &terrain)?;
    let site = Site { terrain: &terrain, entrances: &entrances, seed: scenario.seed };
    let bodies = scenario.bodies_by_agent();
    let starts = scenario.spawn.poses(&site, &bodies)?;
    let centres = starts.iter().map(|start| start.position);
    let spheres = centres.zip(&bodies).map(|(centre, body)| Sphere { centre, radius_m: body.radius_m });
    check_obstacles(scenario, &terrain, &spheres.collect::<Vec<_>>())?;
    Ok((World::new(terrain, params(scenario), &starts), report))
}

/// Whether each event that changes the map has cells inside it.
fn check_map_changes(scenario: &Scenario, extent: Extent) -> Result<(), SetupError> {
    for (number, event) in scenario.event.iter().enumerate() {
        if event.map_change().is_some_and(|change| change.cells(extent).is_none()) {
            let inner_m = extent.size().map(|cells| f64::from(cells - 1) * extent.cell_m());
            let (low, high) = (event.low.unwrap_or_default(), event.high.unwrap_or_default());
            return Err(SetupError::NoCells { number, low, high, cell_m: extent.cell_m(), inner_m });
        }
    }
    Ok(())
}

/// Whether each base is in a free cell.
fn check_bases(scenario: &Scenario, terrain: &Grid<Terrain>) -> Result<(), SetupError> {
    let bases = scenario.energy.as_ref().and_then(|energy| energy.bases.as_deref()).unwrap_or_default();
    for (number, &position) in bases.iter().enumerate() {
        let found = match terrain.get(terrain.extent().cell_of(&position.into())) {
            Some(Terrain::Free) => continue,
            Some(Terrain::Wall) => "in a wall",
            None => "outside the map",
        };
        return Err(SetupError::Base { number, position, found });
    }
    Ok(())
}

/// Whether each moving obstacle has room on its path, and at its start.
fn check_obstacles(scenario: &Scenario, terrain: &Grid<Terrain>, bodies: &[Sphere]) -> Result<(), SetupError> {
    for (number, obstacle) in scenario.obstacle_models().iter().enumerate() {
        let point = |point: usize| scenario.obstacle[number].path[point];
        obstacle.check_place(terrain, bodies).map_err(|misplaced| match misplaced {
            Misplaced::InWall { point: from } => SetupError::ObstacleInWall { number, from: point(from) },
            Misplaced::OnAgent(agent) => SetupError::ObstacleOnAgent { number, at: point(0), agent },
        })?;
    }
    Ok(())
}

/// Whether the recording that a scenario names may be written. Call it before the run is prepared.
///
/// # Errors
/// See [`recorder::check_destination`].
pub fn check_destination(scenario: &Scenario) -> Result<(), RecordError> {
    scenario.execution.record.as_deref().map_or(Ok(()), recorder::check_destination)
}

/// The threads that a run may use besides that of its recorder: those of the scenario, or one for
/// each core.
#[must_use]
pub fn threads(scenario: &Scenario) -> usize {
    match scenario.execution.threads {
        0 => std::thread::available_parallelism().map_or(1, NonZero::get),
        threads => threads as usize,
    }
}

/// Opens the recording of a run of `scenario` in `world`.
///
/// # Errors
/// If the file cannot be created.
pub fn record(file: &Path, scenario: &Scenario, world: &World) -> Result<RunRecorder, RecordError> {
    with_documents(scenario, world, |documents| RecorderQueue::create(file, documents)).map(RunRecorder::Queued)
}

/// Calls `make` with the attachments of a run of `scenario` in `world`.
pub fn with_documents<T>(scenario: &Scenario, world: &World, make: impl FnOnce(&[Document<'_>]) -> T) -> T {
    let identity = scenario.identity();
    let map = m3dm::write(world.terrain()).unwrap_or_else(|_too_large| packed::write(world.terrain()));
    make(&[
        Document { name: SCENARIO_ATTACHMENT, media_type: "application/toml", data: identity.as_bytes() },
        Document { name: MAP_ATTACHMENT, media_type: "application/octet-stream", data: &map },
    ])
}

/// The map of a scenario, generated or read from its file.
///
/// # Errors
/// If it cannot be made. The error names the key, but not the file.
///
/// # Panics
/// Never: a checked scenario has the keys that its kind of map needs.
pub fn generate_map(scenario: &Scenario) -> Result<GeneratedMap, SetupError> {
    let section = &scenario.map;
    let Some(spec) = generator(scenario) else {
        let file = section.path().expect("a checked scenario has a file for a map from a file");
        let name = file.display().to_string();
        let options = section.import.clone().from_folder(&section.folder);
        let import = map_file::load(&file, &options).map_err(|source| SetupError::Read { file: name, source })?;
        return imported(import, scenario);
    };
    let size = section.size.expect("a checked scenario has a size for a generated map").cells();
    let extent = Extent::new(size, section.cell_m.unwrap_or(1.0))?;
    mapgen::generate(&spec, extent, scenario.map_seed()).map_err(map_error(scenario))
}

/// An error of the making of a world, with what it is about: the flag `--map` with its value, if
/// that has named the map file at fault, else `scenario`, the name of the scenario.
#[must_use]
pub fn described(error: &SetupError, map: Option<&str>, scenario: &str) -> String {
    let fault = match error {
        SetupError::Read { source, .. } => Some(source.to_string()),
        SetupError::Import { source, .. } => Some(source.to_string()),
        _ => None,
    };
    match map.zip(fault) {
        // The importer names the file as well.
        Some((map, fault)) => format!("--map {map}: {}", fault.strip_prefix(&format!("{map}: ")).unwrap_or(&fault)),
        None => format!("{scenario}: {error}"),
    }
}

/// Whether a map can be made of a scenario, as far as that is known before it is: its file is one,
/// and the parameters of a generator fit its size.
///
/// # Errors
/// If not; the error names the key, but not the file of the scenario.
pub fn check_map(scenario: &Scenario) -> Result<(), SetupError> {
    if let Some(file) = scenario.map.path() {
        // What lies there is read later, once.
        return std::fs::metadata(&file)
            .map(drop)
            .map_err(|source| SetupError::Read { file: file.display().to_string(), source });
    }
    let (Some(spec), Some(size)) = (generator(scenario), scenario.map.size) else { return Ok(()) };
    let extent = Extent::new(size.cells(), scenario.map.cell_m.unwrap_or(1.0))?;
    spec.check(extent).map_err(map_error(scenario))
}

/// The generator of the map with its parameters; `None` for a map file.
fn generator(scenario: &Scenario) -> Option<MapSpec> {
    let section = &scenario.map;
    match section.kind {
        MapKind::Spheres => Some(MapSpec::Spheres(section.spheres.clone())),
        MapKind::Noise => Some(MapSpec::Noise(section.noise.clone())),
        MapKind::Building => Some(MapSpec::Building(section.building.clone().unwrap_or_default())),
        MapKind::Mine => Some(MapSpec::Mine(section.mine.clone().unwrap_or_default())),
        MapKind::Scene => Some(MapSpec::Scene(section.scene.unwrap_or_default())),
        MapKind::File => None,
    }
}

fn imported(import: ImportSpec, scenario: &Scenario) -> Result<GeneratedMap, SetupError> {
    let import = ImportSpec { cell_m: scenario.map.cell_m, ..import };
    let table = table(scenario);
    let imported = import.read().map_err(|source| SetupError::Import { table, source })?;
    let warnings = imported.notes.into_iter().filter(|note| note.is_warning).map(|note| note.text).collect();
    let repaired = mapgen::repair(&import.file, imported.terrain, scenario.map_seed());
    let mut map = repaired.map_err(map_error(scenario))?;
    map.report.warnings = warnings;
    Ok(map)
}

/// Adds the table or key of the scenario to an error.
fn map_error(scenario: &Scenario) -> impl Fn(MapError) -> SetupError {
    let table = table(scenario);
    move |source| {
        let table = match source {
            MapError::SideTooShort { .. } | MapError::SceneTooSmall { .. } | MapError::Memory { .. } => "map.size",
            MapError::SeedTooLong { .. } => "map.seed",
            _ => table,
        };
        SetupError::Map { table, source }
    }
}

/// The table or key of the scenario that its map comes from.
fn table(scenario: &Scenario) -> &'static str {
    match scenario.map.kind {
        MapKind::Spheres => "map.spheres",
        MapKind::Noise => "map.noise",
        MapKind::Building => "map.building",
        MapKind::Mine => "map.mine",
        MapKind::Scene => "map.scene",
        MapKind::File => "map.file",
    }
}

fn params(scenario: &Scenario) -> WorldParams {
    let (sensors, other_sensors) = scenario.sensors();
    WorldParams {
        body: scenario.body,
        other_bodies: scenario.other_bodies(),
        sensors,
        other_sensors,
        schedule: scenario.scan_timing().schedule(),
        comms: scenario.communication.comms(scenario.seed),
        share_period_ticks: scenario.agents.share_period_ticks,
        noise: scenario.sensor.errors(scenario.seed),
        odometry: scenario.localisation.noise(scenario.seed),
        closures: scenario.localisation.closures(),
        energy: scenario.energy.as_ref().map(EnergySection::params),
        late: scenario.late_agents(),
        base_stations: scenario.base_stations(),
        obstacles: scenario.obstacle_models(),
    }
}

#[cfg(test)]
mod tests;
