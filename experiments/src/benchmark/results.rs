//! The result file of an entry: its runs, the scores that follow from them, and the table of both.

use std::fmt::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};
use system::input_file::{self, TEXT_BYTES_MAX};

use super::{BenchmarkError, EXPLORATION_1, Entry, RADIOS, Scope, TEAMS, WORLDS, worlds};
use crate::plan::BUILD;

/// The results of an entry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResultFile {
    pub benchmark: String,
    /// See [`BUILD`].
    pub build: String,
    pub entry: Entry,
    pub seeds: Vec<u64>,
    /// See [`Scope::phrase`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phrase: Option<String>,
    /// Whether all tracks with all seeds are in it. Scores of other files cannot be compared with
    /// those of whole ones.
    pub is_whole: bool,
    /// Mean over the tracks.
    pub score: f64,
    pub tracks: Vec<Track>,
    pub runs: Vec<Run>,
}

/// A world, a team and a radio.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Track {
    pub world: String,
    pub agents: u32,
    pub radio: String,
    /// Mean over the seeds of the area under the explored share, in per cent.
    pub score: f64,
    /// Number of runs.
    pub runs: usize,
    /// Runs that reach 99 %.
    pub reach_99: usize,
    /// Mean time to 99 %, s; a run that does not reach it counts with the duration.
    pub mean_99_s: f64,
}

/// A run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    pub world: String,
    pub agents: u32,
    pub radio: String,
    pub seed: u64,
    pub id: String,
    /// Area under the explored share over the duration, 0 to 1.
    pub area: f64,
    pub t99_s: Option<f64>,
    pub digest: String,
}

/// Reads a result file.
///
/// # Errors
/// If it is none.
pub fn read(file: &Path) -> Result<ResultFile, BenchmarkError> {
    let name = file.display().to_string();
    let text = input_file::read_text(file, TEXT_BYTES_MAX)
        .map_err(|source| BenchmarkError::Read { file: name.clone(), source })?;
    let results: ResultFile =
        serde_json::from_str(&text).map_err(|source| BenchmarkError::NoResult { file: name.clone(), source })?;
    let unfit = |reason: String| Err(BenchmarkError::Unfit { file: name.clone(), reason });
    if results.benchmark != EXPLORATION_1 {
        return unfit(format!("benchmark {:?}: expected {EXPLORATION_1:?}", results.benchmark));
    }
    if results.build != BUILD {
        return unfit(format!(
            "made by build {}; this is build {BUILD}, whose runs have other digests: verify it with that build",
            results.build
        ));
    }
    Ok(results)
}

/// Nine decimals: such a number is the same after it was written and read.
pub(super) fn rounded(number: f64) -> f64 {
    libm::round(number * 1e9) / 1e9
}

/// The results of runs, which get their order here.
pub(super) fn results(entry: &Entry, scope: &Scope, mut runs: Vec<Run>) -> ResultFile {
    let place = |name: &str| worlds().position(|world| world == name);
    let radio = |name: &str| RADIOS.iter().position(|(radio, _)| *radio == name);
    runs.sort_by_key(|run| (place(&run.world), run.agents, radio(&run.radio), run.seed));
    let mut tracks: Vec<Track> = Vec::new();
    for of_track in
        runs.chunk_by(|one, other| (&one.world, one.agents, &one.radio) == (&other.world, other.agents, &other.radio))
    {
        let first = &of_track[0];
        let duration_s = WORLDS.iter().find(|world| world.name == first.world).map_or(0, |world| world.duration_s);
        let count = of_track.len() as f64;
        tracks.push(Track {
            world: first.world.clone(),
            agents: first.agents,
            radio: first.radio.clone(),
            score: rounded(100.0 * of_track.iter().map(|run| run.area).sum::<f64>() / count),
            runs: of_track.len(),
            reach_99: of_track.iter().filter(|run| run.t99_s.is_some()).count(),
            mean_99_s: rounded(
                of_track.iter().map(|run| run.t99_s.unwrap_or(f64::from(duration_s))).sum::<f64>() / count,
            ),
        });
    }
    ResultFile {
        benchmark: EXPLORATION_1.to_owned(),
        build: BUILD.to_owned(),
        entry: entry.clone(),
        seeds: scope.seeds.clone(),
        phrase: scope.phrase.clone(),
        is_whole: scope.is_whole(),
        score: rounded(tracks.iter().map(|track| track.score).sum::<f64>() / tracks.len().max(1) as f64),
        tracks,
        runs,
    }
}

/// The table of the tracks, for people: one row for each world and radio, one column for each team.
#[must_use]
pub fn table(results: &ResultFile) -> String {
    let mut text = String::from("| world | radio |");
    TEAMS.iter().for_each(|team| write!(text, " {team} |").expect("a text grows"));
    text += " mean |\n|---|---|";
    text += &"---|".repeat(TEAMS.len() + 1);
    text.push('\n');
    for of_row in results.tracks.chunk_by(|one, other| one.world == other.world) {
        for (radio, _) in RADIOS {
            let tracks: Vec<&Track> = of_row.iter().filter(|track| track.radio == radio).collect();
            let score = |team: u32| tracks.iter().find(|track| track.agents == team).map(|track| track.score);
            write!(text, "| {} | {radio} |", of_row[0].world).expect("a text grows");
            for team in TEAMS {
                let shown = score(team).map_or_else(|| "-".to_owned(), |score| format!("{score:.1}"));
                write!(text, " {shown} |").expect("a text grows");
            }
            let mean = tracks.iter().map(|track| track.score).sum::<f64>() / tracks.len().max(1) as f64;
            writeln!(text, " {mean:.1} |").expect("a text grows");
        }
    }
    text
}
