//! The figures of a study, as SVG.
//!
//! Colours and dashes belong to controllers and are the same in all figures. A figure that the study has nothing for is left out.

mod boxes;
mod curves;
mod teams;
mod traffic;

use std::collections::BTreeSet;

use super::plot::Mark;
use super::study::{Field, Place, Study};
use crate::statistics::StatisticsError;

/// A picture and what it shows.
#[derive(Debug, Clone)]
pub(super) struct Figure {
    /// Stem of its file names.
    pub(super) name: String,
    /// What it shows and how to read it.
    pub(super) caption: String,
    /// The picture.
    pub(super) svg: String,
}

/// The figures that are functions of the runs alone.
///
/// # Errors
/// If a figure of a run is not finite.
pub(super) fn deterministic(study: &Study) -> Result<Vec<Figure>, StatisticsError> {
    let mut figures = vec![curves::exploration(study)?];
    figures.extend(curves::times(study)?);
    figures.extend(boxes::outcome(study)?);
    figures.extend(teams::scaling(study)?);
    figures.extend(traffic::by_kind(study)?);
    Ok(figures)
}

/// The figures of wall time.
///
/// # Errors
/// If a figure of a run is not finite.
pub(super) fn of_wall_time(study: &Study) -> Result<Vec<Figure>, StatisticsError> {
    let mut figures: Vec<Figure> = boxes::real_time_factor(study)?.into_iter().collect();
    figures.extend(teams::decisions(study)?);
    Ok(figures)
}

/// How panels for places stand: one for each place, team sizes side by side if there are two to four of them.
struct Panels {
    /// The place of each panel; `None`: there is no such run.
    places: Vec<(Field, u32, Option<Place>)>,
    columns: usize,
}

impl Panels {
    fn of(study: &Study) -> Self {
        let team_sizes = study.team_sizes();
        if (2..=4).contains(&team_sizes.len()) {
            let mut places = Vec::new();
            for field in study.fields() {
                for &agents in &team_sizes {
                    let place = study.places.iter().find(|place| place.agents == agents && place.field() == field);
                    places.push((field.clone(), agents, place.cloned()));
                }
            }
            Self { places, columns: team_sizes.len() }
        } else {
            let places = study.places.iter().map(|place| (place.field(), place.agents, Some(place.clone())));
            Self { places: places.collect(), columns: columns(study.places.len()) }
        }
    }

    fn title(study: &Study, field: &Field, agents: u32) -> String {
        let place = Place { others: field.others.clone(), size: field.size, agents };
        study.place_name(&place)
    }
}

/// How many panels to put side by side where their order has no meaning.
fn columns(panels: usize) -> usize {
    match panels {
        0..=3 => panels.max(1),
        4 => 2,
        _ => 3,
    }
}

/// How many runs the cells of a study have.
fn runs_told(study: &Study) -> String {
    let counts: BTreeSet<usize> = study.cells().map(|(_, _, runs)| runs.len()).collect();
    match (counts.first(), counts.last()) {
        (Some(1), Some(1)) => "1 run per cell".to_owned(),
        (Some(least), Some(most)) if least == most => format!("{most} runs per cell"),
        (Some(least), Some(most)) => format!("{least} to {most} runs per cell"),
        _ => String::new(),
    }
}

/// All controllers by name.
fn legend(study: &Study, mark: fn(usize) -> Mark) -> Vec<(Mark, String)> {
    study.controllers.iter().enumerate().map(|(i, name)| (mark(i), name.clone())).collect()
}
