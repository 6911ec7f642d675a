//! The metrics of a recording in the format of the CMU Autonomous Exploration Development
//! Environment, whose `visualizationTools` node writes them to `metrics_<date>.txt`, for the
//! scripts that plot such files.
//!
//! A line for each progress message: explored volume (m^3), distance travelled (m), run time of the
//! algorithm (s), time (s), each with six decimals. The volume is that of the free cells that the
//! team has seen, where that node counts occupied and free voxels of registered scans; the distance
//! is summed over the team. A recording has no wall times, so the third column is 0.

use std::fmt::Write;

use msgs::counters::CounterName;
use msgs::ids::Tick;
use thiserror::Error;

use crate::info::Info;

/// Why a recording has no metrics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum MetricsError {
    /// The number of free cells is in the result.
    #[error(
        "no result: the run did not come to its end, and the explored volume is not known without; \
         `maes run FILE.mcap` executes it again"
    )]
    NoResult,
    /// The edge of a cell is in the scenario.
    #[error("no scenario: the edge of a cell is not known")]
    NoScenario,
}

/// The lines of a summary.
///
/// # Errors
/// If the scenario or the result is missing.
pub fn text(info: &Info) -> Result<String, MetricsError> {
    let scenario = info.announced.as_ref().ok_or(MetricsError::NoScenario)?;
    let result = info.result.as_ref().ok_or(MetricsError::NoResult)?;
    let free_cells = result.counter(CounterName::FreeCells).ok_or(MetricsError::NoResult)? as f64;
    let cell_m3 = scenario.cell_m.powi(3);
    let mut text = String::new();
    let mut line = |tick: u64, explored: f64, distance_m: &[f64]| {
        let (volume_m3, travelled_m) = (explored * free_cells * cell_m3, distance_m.iter().sum::<f64>());
        let time_s = Tick(tick).time_s();
        writeln!(text, "{volume_m3:.6} {travelled_m:.6} {:.6} {time_s:.6}", 0.0).expect("memory");
    };
    for progress in info.progress.iter().filter(|progress| progress.tick < result.tick) {
        line(progress.tick, progress.explored, &progress.distance_m);
    }
    line(result.tick, result.explored, &result.distance_m);
    Ok(text)
}

#[cfg(test)]
mod tests {
    use msgs::maes_msgs::{Counter, Progress, Result as RunResult, Scenario};

    use super::*;

    #[test]
    fn lines_are_volume_distance_run_time_and_time() {
        let progress = |tick, explored, distance_m: &[f64]| Progress {
            tick,
            explored,
            distance_m: distance_m.to_vec(),
            ..Progress::default()
        };
        let result = RunResult {
            tick: 75,
            explored: 0.75,
            distance_m: vec![3.0, 4.5],
            counters: vec![Counter { name: "free_cells".to_owned(), value: 400 }],
            ..RunResult::default()
        };
        let info = Info {
            announced: Some(Scenario { cell_m: 0.5, ..Scenario::default() }),
            progress: vec![progress(0, 0.0, &[0.0, 0.0]), progress(50, 0.25, &[1.0, 0.25]), progress(75, 0.75, &[])],
            result: Some(result),
            ..Info::default()
        };
        let lines = "0.000000 0.000000 0.000000 0.000000\n\
                     12.500000 1.250000 0.000000 1.000000\n\
                     37.500000 7.500000 0.000000 1.500000\n";
        assert_eq!(text(&info).unwrap(), lines);
        assert_eq!(text(&Info { result: None, ..info.clone() }), Err(MetricsError::NoResult));
        assert_eq!(text(&Info { announced: None, ..info }), Err(MetricsError::NoScenario));
    }
}
