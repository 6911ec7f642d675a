//! The result file of an entry: its runs, the scores that follow from them, and the table of both.

use std::fmt::Write as _;
use std::path::Path;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use system::input_file::{self, TEXT_BYTES_MAX};

use super::{Benchmark, BenchmarkError, Entry, Scope};
use crate::plan::BUILD;

/// The results of an entry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResultFile {
    /// The file has its name.
    #[serde(serialize_with = "name_of", deserialize_with = "named")]
    pub benchmark: &'static Benchmark,
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

/// A world, a team, a radio and a localisation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Track {
    pub world: String,
    pub agents: u32,
    pub radio: String,
    /// Name of the localisation, if the benchmark has several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub localisation: Option<String>,
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
    /// Name of the localisation, if the benchmark has several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub localisation: Option<String>,
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
pub(super) fn results(benchmark: &'static Benchmark, entry: &Entry, scope: &Scope, mut runs: Vec<Run>) -> ResultFile {
    let place = |name: &str| benchmark.worlds().position(|world| world == name);
    let radio = |name: &str| benchmark.radios().position(|radio| radio == name);
    let localisation = |name: Option<&str>| benchmark.localisations().position(|localisation| localisation == name);
    runs.sort_by_key(|run| {
        let localisation = localisation(run.localisation.as_deref());
        (place(&run.world), run.agents, radio(&run.radio), localisation, run.seed)
    });
    let mut tracks: Vec<Track> = Vec::new();
    for of_track in runs.chunk_by(|one, other| one.track() == other.track()) {
        let first = &of_track[0];
        let world = benchmark.worlds.iter().find(|world| world.name == first.world);
        let duration_s = world.map_or(0, |world| world.duration_s);
        let count = of_track.len() as f64;
        tracks.push(Track {
            world: first.world.clone(),
            agents: first.agents,
            radio: first.radio.clone(),
            localisation: first.localisation.clone(),
            score: rounded(100.0 * of_track.iter().map(|run| run.area).sum::<f64>() / count),
            runs: of_track.len(),
            reach_99: of_track.iter().filter(|run| run.t99_s.is_some()).count(),
            mean_99_s: rounded(
                of_track.iter().map(|run| run.t99_s.unwrap_or(f64::from(duration_s))).sum::<f64>() / count,
            ),
        });
    }
    ResultFile {
        benchmark,
        build: BUILD.to_owned(),
        entry: entry.clone(),
        seeds: scope.seeds.clone(),
        phrase: scope.phrase.clone(),
        is_whole: scope.is_whole(benchmark),
        score: rounded(tracks.iter().map(|track| track.score).sum::<f64>() / tracks.len().max(1) as f64),
        tracks,
        runs,
    }
}

/// The table of the tracks, for people: one row for each world, radio and localisation, one column
/// for each team.
#[must_use]
pub fn table(results: &ResultFile) -> String {
    let teams = results.benchmark.teams;
    let has_localisations = results.tracks.iter().any(|track| track.localisation.is_some());
    let mut heads = vec!["world".to_owned(), "radio".to_owned()];
    heads.extend(has_localisations.then(|| "localisation".to_owned()));
    heads.extend(teams.iter().map(u32::to_string));
    heads.push("mean".to_owned());
    let mut text = format!("| {} |\n|{}\n", heads.join(" | "), "---|".repeat(heads.len()));
    let mut rows: Vec<(&Track, Vec<&Track>)> = Vec::new();
    for track in &results.tracks {
        let is_same = |first: &Track| {
            (&first.world, &first.radio, &first.localisation) == (&track.world, &track.radio, &track.localisation)
        };
        match rows.iter_mut().find(|(first, _)| is_same(first)) {
            Some((_, tracks)) => tracks.push(track),
            None => rows.push((track, vec![track])),
        }
    }
    for (first, tracks) in rows {
        let mut cells = vec![first.world.clone(), first.radio.clone()];
        cells.extend(has_localisations.then(|| first.localisation.clone().unwrap_or_default()));
        let score = |team: &u32| tracks.iter().find(|track| track.agents == *team).map(|track| track.score);
        cells
            .extend(teams.iter().map(|team| score(team).map_or_else(|| "-".to_owned(), |score| format!("{score:.1}"))));
        let mean = tracks.iter().map(|track| track.score).sum::<f64>() / tracks.len() as f64;
        cells.push(format!("{mean:.1}"));
        writeln!(text, "| {} |", cells.join(" | ")).expect("a text grows");
    }
    text
}

impl Run {
    /// Its track, for people.
    #[must_use]
    pub fn track(&self) -> String {
        let Self { world, agents, radio, localisation, .. } = self;
        let localisation = localisation.as_ref().map_or_else(String::new, |name| format!(", {name}"));
        format!("{world}, {agents} agents, {radio} radio{localisation}")
    }
}

fn name_of<S: Serializer>(benchmark: &&'static Benchmark, serializer: S) -> Result<S::Ok, S::Error> {
    benchmark.name.serialize(serializer)
}

fn named<'de, D: Deserializer<'de>>(deserializer: D) -> Result<&'static Benchmark, D::Error> {
    let name = String::deserialize(deserializer)?;
    Benchmark::named(&name).ok_or_else(|| {
        let names = Benchmark::ALL.map(|benchmark| format!("{:?}", benchmark.name)).join(" or ");
        D::Error::custom(format!("benchmark {name:?}: expected {names}"))
    })
}
