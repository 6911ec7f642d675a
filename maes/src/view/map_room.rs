//! `maes view` of a map: what the page asks about it while it shows it.
//!
//! The page sends a radius and the places that the user has clicked. The answer says where a body
//! of this radius fits and what it reaches, by the rule of `maes map check`, where the bodies start
//! that were asked for, and the scenario that `maes run` takes. The page computes none of it.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use foxglove_server::MapAnswers;
use map_files::ImportSpec;
use mapgen::ImportOptions;
use nalgebra::Point3;
use protocol::body_model::BodyModel;
use serde::Serialize;
use sim_server::setup;
use voxels::clearance::REACH_CELLS;
use voxels::{BodyLattice, Cell, Clearance, Grid, Terrain, line_of_sight};
use world::spawn::{Site, SpawnSpec};

use crate::map::reach::{Reach, radius_max_m};

/// Maximum number of starts: the request has them all, in a head of bounded length.
const STARTS_MAX: usize = 100;

/// How far beyond its radius a start is looked for around a clicked place, cells.
const NEAR_CELLS: i32 = 4;

/// A map that the page shows.
pub(super) struct MapRoom {
    /// As the user names it.
    file: PathBuf,
    cell_m: Option<f64>,
    options: ImportOptions,
    /// As a run has it: imported and repaired.
    terrain: Grid<Terrain>,
    free: u64,
}

/// What is asked.
#[derive(Debug, Default, PartialEq)]
struct Question {
    /// Radius of the bodies, metres.
    radius_m: f64,
    /// Where bodies should start, metres, frame `map`: in free cells.
    near: Vec<[f64; 3]>,
}

/// What is answered.
#[derive(Debug, Serialize)]
struct Answer {
    /// Share of the free cells at whose places a body fits, 0 ..= 1.
    fits: f64,
    /// Share of the free cells that the bodies reach: from their starts, or else in the largest
    /// connected part.
    reached: f64,
    /// How far the place of a cell is from its lowest corner along each axis, cells.
    offset_cells: f64,
    /// First indices and lengths of the runs of reached cells.
    runs: (Vec<u32>, Vec<u16>),
    /// Starts with room, metres, frame `map`.
    starts: Vec<[f64; 3]>,
    /// Why there are fewer starts than places.
    problem: Option<String>,
    /// The scenario with these starts, TOML; `None` without any.
    scenario: Option<String>,
}

/// Seed and time limit of the scenario, seconds: those of the default one.
const SEED: u64 = 1;
const DURATION_S: f64 = 1800.0;

/// The scenario of the answer: the keys that have no defaults, and those that differ from them.
#[derive(Serialize)]
struct ScenarioText<'a> {
    seed: u64,
    duration_s: f64,
    map: MapTable<'a>,
    agents: Count,
    body: Radius,
    spawn: Starts<'a>,
}

#[derive(Serialize)]
struct MapTable<'a> {
    kind: &'static str,
    file: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    cell_m: Option<f64>,
    #[serde(skip_serializing_if = "ImportOptions::is_default")]
    import: ImportOptions,
}

#[derive(Serialize)]
struct Count {
    count: usize,
}

#[derive(Serialize)]
struct Radius {
    radius_m: f64,
}

#[derive(Serialize)]
struct Starts<'a> {
    kind: &'static str,
    poses: &'a [[f64; 3]],
}

impl MapRoom {
    /// The room of a map that was read from `spec` and repaired.
    pub(super) fn new(file: PathBuf, spec: &ImportSpec, terrain: Grid<Terrain>) -> Self {
        let free = mapgen::free_cells(&terrain);
        Self { file, cell_m: spec.cell_m, options: spec.options.clone(), terrain, free }
    }

    /// The map as a packed M3DM file.
    pub(super) fn packed(&self) -> Vec<u8> {
        voxels::packed::write(&self.terrain)
    }

    /// What answers the page: one question at a time, and the reach of the last radius is kept.
    pub(super) fn answers(self) -> MapAnswers {
        let kept: Mutex<Option<(f64, Reach)>> = Mutex::new(None);
        Arc::new(move |query| {
            let question = question_of(query)?;
            let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
            let reach = match kept.take() {
                Some((radius_m, reach)) if radius_m == question.radius_m => reach,
                _ => self.reach(question.radius_m)?,
            };
            let answer = self.answer(&question, &reach);
            *kept = Some((question.radius_m, reach));
            serde_json::to_string(&answer).map_err(|error| error.to_string())
        })
    }

    fn reach(&self, radius_m: f64) -> Result<Reach, String> {
        let cell_m = self.terrain.extent().cell_m();
        let most_m = radius_max_m(cell_m);
        if !(radius_m > 0.0 && radius_m <= most_m) {
            return Err(format!("a radius of {radius_m} m: allowed is above 0 to {most_m} m, {REACH_CELLS} cells"));
        }
        Ok(Reach::new(&Clearance::for_body(radius_m, &self.terrain), radius_m / cell_m, self.free))
    }

    fn answer(&self, question: &Question, reach: &Reach) -> Answer {
        let extent = self.terrain.extent();
        let lattice = BodyLattice::of(question.radius_m, extent.cell_m());
        let mut starts: Vec<Point3<f64>> = Vec::new();
        let mut problem = None;
        for &near in &question.near {
            match self.start_near(&Point3::from(near), question.radius_m, reach, &starts) {
                Some(start) => starts.push(start),
                None => {
                    let [x, y, z] = near;
                    problem = Some(format!(
                        "no body of radius {} m finds room near ({x:.2}, {y:.2}, {z:.2}) m; choose another place, or a \
                         smaller radius",
                        question.radius_m
                    ));
                }
            }
        }
        let cells = starts.iter().filter_map(|start| extent.index(lattice.cell_near(extent, start)));
        let from: Vec<usize> = if starts.is_empty() { reach.start().into_iter().collect() } else { cells.collect() };
        let (cells, reached) = reach.from(from);
        let runs = voxels::runs((0..extent.volume()).filter(|&index| cells.contains(index)).map(|index| index as u32));
        let starts: Vec<[f64; 3]> = starts.into_iter().map(|start| [start.x, start.y, start.z]).collect();
        let scenario = match self.scenario(question.radius_m, &starts) {
            Ok(text) => text,
            Err(reason) => {
                problem = Some(reason);
                None
            }
        };
        Answer { fits: reach.fits(), reached, offset_cells: lattice.offset_cells(), runs, starts, problem, scenario }
    }

    /// The place with room that is nearest to a point and in sight of it, clear of other bodies.
    fn start_near(
        &self,
        near: &Point3<f64>,
        radius_m: f64,
        reach: &Reach,
        others: &[Point3<f64>],
    ) -> Option<Point3<f64>> {
        let extent = self.terrain.extent();
        let lattice = BodyLattice::of(radius_m, extent.cell_m());
        let middle = lattice.cell_near(extent, near);
        let edge = (radius_m / extent.cell_m()).ceil() as i32 + NEAR_CELLS;
        let along = || -edge..=edge;
        let around = along().flat_map(|z| along().flat_map(move |y| along().map(move |x| Cell::new(x, y, z))));
        let mut places: Vec<(f64, Point3<f64>)> = around
            .map(|offset| middle + offset)
            .filter(|&cell| reach.room().get(cell) == Some(&Terrain::Free))
            .map(|cell| lattice.place(extent, cell))
            .filter(|place| others.iter().all(|other| (other - place).norm() >= 2.0 * radius_m))
            .map(|place| ((place - near).norm(), place))
            .collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        places.into_iter().map(|(_, place)| place).find(|place| line_of_sight(&self.terrain, near, place))
    }

    /// The scenario with these starts, checked as `maes run` checks it; `None` without any.
    fn scenario(&self, radius_m: f64, starts: &[[f64; 3]]) -> Result<Option<String>, String> {
        if starts.is_empty() {
            return Ok(None);
        }
        // The scenario is saved wherever its reader likes.
        let file = std::path::absolute(&self.file).map_err(|error| error.to_string())?;
        let file = file.to_str().ok_or("the path of the map is no text, as a scenario needs it")?;
        let text = toml::to_string(&ScenarioText {
            seed: SEED,
            duration_s: DURATION_S,
            map: MapTable { kind: "file", file, cell_m: self.cell_m, import: self.options.clone() },
            agents: Count { count: starts.len() },
            body: Radius { radius_m },
            spawn: Starts { kind: "list", poses: starts },
        });
        let text = text.map_err(|error| error.to_string())?;
        setup::parse("the scenario", &text, &[]).map_err(|error| error.to_string())?;
        let spawn = SpawnSpec::List { poses: starts.iter().map(|start| start.to_vec()).collect() };
        let site = Site { terrain: &self.terrain, entrances: &[], seed: SEED };
        spawn
            .poses(&site, &vec![BodyModel { radius_m, ..BodyModel::SUBMARINE }; starts.len()])
            .map_err(|error| error.to_string())?;
        Ok(Some(text))
    }
}

/// Reads `radius_m=R&near=X,Y,Z&near=...`.
fn question_of(query: &str) -> Result<Question, String> {
    let mut question = Question::default();
    for part in query.split('&') {
        let number = |text: &str| text.parse::<f64>().ok().filter(|number| number.is_finite());
        match part.split_once('=') {
            Some(("radius_m", text)) => {
                question.radius_m = number(text).ok_or_else(|| format!("radius_m={text}: expected metres"))?;
            }
            Some(("near", text)) => {
                let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
                let place = numbers.and_then(|numbers| numbers.try_into().ok());
                question.near.push(place.ok_or_else(|| format!("near={text}: expected x,y,z in metres"))?);
            }
            // The token, for clients without a cookie.
            _ => {}
        }
    }
    if question.near.len() > STARTS_MAX {
        return Err(format!("{} starts: allowed are up to {STARTS_MAX}", question.near.len()));
    }
    Ok(question)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rooms of 5 x 5 x 5 cells of half a metre, with a passage of one cell between them.
    fn room() -> MapRoom {
        let row = |door: bool| {
            let middle = if door { "#...........#\n" } else { "#.....#.....#\n" };
            let side = "#.....#.....#\n".repeat(2);
            format!("{0}{side}{middle}{side}{0}", "#############\n")
        };
        let wall = "#############\n".repeat(7);
        let layers = [&wall, &row(false), &row(false), &row(true), &row(false), &row(false), &wall];
        let text = format!("cell_m = 0.5\n{}", layers.map(String::as_str).join("\n"));
        let spec = ImportSpec::new("rooms.txt".to_owned(), text.into_bytes());
        let terrain = spec.read().unwrap().terrain;
        MapRoom::new(PathBuf::from("rooms.txt"), &spec, terrain)
    }

    fn asked(query: &str) -> serde_json::Value {
        serde_json::from_str(&room().answers()(query).unwrap()).unwrap()
    }

    #[test]
    fn starts_are_in_the_clicked_room() {
        let answer = asked("radius_m=0.4&near=5.75,1.75,0.75");
        // Of 0.8 m, two cells: at corners of cells, as near to the point as there is room.
        assert_eq!(answer["offset_cells"], 0.0);
        assert_eq!(answer["starts"], serde_json::json!([[5.5, 1.5, 1.0]]));
        assert_eq!(answer["problem"], serde_json::Value::Null);
        assert_eq!(answer["runs"][0].as_array().unwrap().len(), 16, "four places along each axis of one room");
        let text = answer["scenario"].as_str().unwrap();
        let scenario = setup::parse("a.toml", text, &[]).unwrap();
        assert_eq!((scenario.agents.count, scenario.body.radius_m), (1, 0.4));
        assert!(text.contains("/rooms.txt\"\n") && text.contains("poses = [[5.5, 1.5, 1.0]]"), "{text}");
    }

    #[test]
    fn narrow_bodies_reach_both_rooms() {
        let answer = asked("radius_m=0.25&near=0.75,0.75,0.75");
        assert_eq!((&answer["fits"], &answer["reached"]), (&1.0.into(), &1.0.into()));
        let answer = asked("radius_m=0.25");
        assert_eq!((&answer["scenario"], &answer["starts"]), (&serde_json::Value::Null, &serde_json::json!([])));
    }

    #[test]
    fn a_place_without_room_is_named() {
        let near = "&near=0.75,0.75,0.75".repeat(70);
        let answer = asked(&format!("radius_m=0.4{near}"));
        let starts = answer["starts"].as_array().unwrap().len();
        assert!((8..70).contains(&starts), "{starts}");
        let problem = answer["problem"].as_str().unwrap();
        assert!(problem.starts_with("no body of radius 0.4 m finds room near (0.75, 0.75, 0.75) m"), "{problem}");
    }

    #[test]
    fn malformed_questions_are_refused() {
        for (query, words) in [
            ("radius_m=no", "radius_m=no: expected metres"),
            ("near=1,2", "near=1,2: expected x,y,z in metres"),
            ("radius_m=9", "a radius of 9 m: allowed is above 0 to 8 m, 16 cells"),
            ("", "a radius of 0 m"),
        ] {
            let refused = room().answers()(query).unwrap_err();
            assert!(refused.contains(words), "{refused}");
        }
        assert!(question_of(&"near=1,1,1&".repeat(101)).unwrap_err().contains("up to 100"));
    }
}
