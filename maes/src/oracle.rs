//! `maes oracle`: how fast a team could be that knows the map in advance.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use experiments::oracle;
use experiments::rows::Marks;
use sim_server::cli::{KeyArgs, recording_path};
use sim_server::setup;

use crate::output;

/// Arguments of `oracle`.
#[derive(Debug, Args)]
pub(crate) struct OracleArgs {
    /// The scenario (.toml), or a recording of it (.mcap)
    #[arg(value_parser = recording_path())]
    scenario: PathBuf,
    #[command(flatten, next_help_heading = "Keys of the scenario")]
    keys: KeyArgs,
}

/// Prints the oracle of a scenario.
pub(crate) fn print(args: &OracleArgs) -> anyhow::Result<ExitCode> {
    let scenario = setup::load(&args.scenario, &args.keys.overrides())?;
    let row = oracle::of(&scenario)?;
    output::print("seen    no team before    flown with the map in hand");
    let times = |marks: &Marks| [marks.t90_s, marks.t99_s, marks.t100_s];
    let shown = |time_s: Option<f64>| time_s.map_or_else(|| "-".to_owned(), |time_s| format!("{time_s:.2} s"));
    for ((percent, bound), flown) in [90, 99, 100].into_iter().zip(times(&row.bound)).zip(times(&row.flown)) {
        output::print(&format!("{percent:>3} %   {:>14}    {:>26}", shown(bound), shown(flown)));
    }
    Ok(ExitCode::SUCCESS)
}
