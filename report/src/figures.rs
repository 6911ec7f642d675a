//! The figures of a study, as SVG: whole for papers, and panel by panel for the page.
//!
//! A variant has the same colour and dash pattern in all figures. A figure without data is
//! omitted.

mod boxes;
mod curves;
mod pareto;
pub(super) mod routes;
mod teams;
mod traffic;

use std::collections::BTreeSet;

use super::marks::Mark;
use super::plot::Drawn;
use super::study::{Condition, Environment, Study};
use statistics::StatisticsError;

#[derive(Debug, Clone)]
pub(super) struct Figure {
    /// Stem of its file names.
    pub(super) name: String,
    pub(super) title: String,
    pub(super) caption: String,
    pub(super) legend: Vec<(Mark, String)>,
    /// Whether the entries of the legend are the variants.
    pub(super) is_by_variant: bool,
    pub(super) drawn: Drawn,
}

/// The figures without wall time, which are functions of scenario, seed and build.
pub(super) fn deterministic(study: &Study) -> Result<Vec<Figure>, StatisticsError> {
    let mut figures = vec![exploration(study)?];
    figures.extend(curves::times(study)?);
    figures.extend(boxes::outcome(study)?);
    figures.extend(teams::scaling(study)?);
    figures.extend(traffic::by_kind(study)?);
    figures.extend(pareto::data_against_time(study)?);
    Ok(figures)
}

/// The explored share over time.
pub(super) fn exploration(study: &Study) -> Result<Figure, StatisticsError> {
    curves::exploration(study)
}

/// The figures of wall time.
pub(super) fn of_wall_time(study: &Study) -> Result<Vec<Figure>, StatisticsError> {
    let mut figures: Vec<Figure> = boxes::real_time_factor(study)?.into_iter().collect();
    figures.extend(teams::decisions(study)?);
    Ok(figures)
}

/// The arrangement of panels: one per condition, with two to four team sizes side by side.
struct Panels {
    /// The condition of each panel; `None` if it has no runs.
    conditions: Vec<(Environment, Option<u32>, Option<Condition>)>,
    columns: usize,
}

impl Panels {
    fn of(study: &Study) -> Self {
        let team_sizes = study.team_sizes();
        if (2..=4).contains(&team_sizes.len()) {
            let mut conditions = Vec::new();
            for environment in study.environments() {
                for &agents in &team_sizes {
                    let condition = study
                        .conditions
                        .iter()
                        .find(|condition| condition.agents == Some(agents) && condition.environment() == environment);
                    conditions.push((environment.clone(), Some(agents), condition.cloned()));
                }
            }
            Self { conditions, columns: team_sizes.len() }
        } else {
            let conditions = study
                .conditions
                .iter()
                .map(|condition| (condition.environment(), condition.agents, Some(condition.clone())));
            Self { conditions: conditions.collect(), columns: columns(study.conditions.len()) }
        }
    }

    fn title(study: &Study, environment: &Environment, agents: Option<u32>) -> String {
        let condition = Condition { others: environment.others.clone(), size: environment.size, agents };
        study.condition_name(&condition)
    }
}

/// The number of columns of panels without a natural order.
fn columns(panels: usize) -> usize {
    match panels {
        0..=3 => panels.max(1),
        4 => 2,
        _ => 3,
    }
}

/// The number of independent runs of the cells of a study, as a note.
fn runs_note(study: &Study) -> String {
    let counts: BTreeSet<usize> = study.cells().map(|(_, _, runs)| runs.len()).collect();
    let all: usize = study
        .conditions
        .iter()
        .map(|condition| {
            (0..study.variants.len()).map(|variant| study.all_of_cell(condition, variant).len()).sum::<usize>()
        })
        .sum();
    let independent: usize = study.cells().map(|(_, _, runs)| runs.len()).sum();
    let kind = if independent < all { "independent " } else { "" };
    match (counts.first(), counts.last()) {
        (Some(1), Some(1)) => format!("1 {kind}run each"),
        (Some(least), Some(most)) if least == most => format!("{most} {kind}runs each"),
        (Some(least), Some(most)) => format!("{least} to {most} {kind}runs each"),
        _ => String::new(),
    }
}

/// An entry for each variant.
fn legend(study: &Study, mark: fn(usize) -> Mark) -> Vec<(Mark, String)> {
    study.variants.iter().enumerate().map(|(i, name)| (mark(i), name.clone())).collect()
}
