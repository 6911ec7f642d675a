//! `maes bench`: benchmarks that can be cited, the verification of their results, and how long they
//! take on many cores.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::thread;

use agent_node::controllers::Registry;
use anyhow::{Context, anyhow, bail};
use clap::{Args, Subcommand};
use experiments::benchmark::schedule::Schedule;
use experiments::benchmark::{self, Benchmark, EXPLORATION_1, EXPLORATION_2, Entry, SEEDS, Scope};
use experiments::execute::{Options, Part, Stop, Transport};
use experiments::store::Store;
use sim_server::cli::{positive, whole};
use sim_server::exit;

use crate::output::print;
use crate::plans::{interruptible, over_ros, record_runs};
use crate::progress::ProgressDisplay;
use crate::view;

/// The benchmarks.
#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// Explore caves of three sizes, passages, a building and an imported station with 1 to 20
    /// agents, over perfect and lossy radios, on 30 seeds
    #[command(name = EXPLORATION_1.name)]
    Exploration1(ExplorationArgs),
    /// Explore scenes at true scale with 1 to 10 small aerial bodies, over three radios, with exact
    /// and drifting localisation, on 30 seeds
    #[command(name = EXPLORATION_2.name)]
    Exploration2(ExplorationArgs),
    /// Check a result file: execute a random tenth of its runs again, and compare the digests
    Verify(VerifyArgs),
    /// Say how long the whole benchmark takes on many cores: simulates the schedule of a cluster
    /// with the measured times of the runs that are there
    Schedule(ScheduleArgs),
}

/// Arguments of `bench schedule`.
#[derive(Debug, Args)]
pub(crate) struct ScheduleArgs {
    /// The folder of the runs, with one of every track at least, as after `bench exploration-1
    /// --seeds 1`
    folder: PathBuf,
    /// Cores, each of which executes one run at a time
    #[arg(long, value_name = "N", default_value = "100", value_parser = positive)]
    cores: NonZero<usize>,
    /// What a run takes beside its measured wall time: the start of a process, and the making of
    /// the map
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = seconds)]
    extra: f64,
}

/// Arguments of `bench exploration-1` and `exploration-2`.
#[derive(Debug, Args)]
pub(crate) struct ExplorationArgs {
    /// The folder for the runs and the result file; runs that are there already are skipped
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The controller
    #[arg(long, value_name = "NAME")]
    controller: String,
    /// A setting of the controller, and others in the same way
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    set: Vec<(String, toml::Value)>,
    /// The program with the controller, and its arguments, one flag for each word; runs over ROS 2
    #[arg(long, value_name = "WORD", allow_hyphen_values = true)]
    command: Vec<String>,
    /// Make the seeds from this phrase instead of the public ones
    #[arg(long, value_name = "TEXT", conflicts_with = "seeds")]
    phrase: Option<String>,
    /// Only the first N public seeds; no whole result
    #[arg(long, value_name = "N", value_parser = whole::<u64>(1..=SEEDS as u64))]
    seeds: Option<u64>,
    /// Only this world, and others in the same way; no whole result
    #[arg(long, value_name = "NAME")]
    world: Vec<String>,
    /// Record no runs for the page of the entry; else one of each track and the worst of each cause
    /// are executed again
    #[arg(long)]
    no_recordings: bool,
    /// Runs in parallel [default: one for each core; over ROS 2: 1]
    #[arg(long, value_name = "N", value_parser = positive)]
    jobs: Option<NonZero<usize>>,
}

/// Arguments of `bench verify`.
#[derive(Debug, Args)]
pub(crate) struct VerifyArgs {
    /// The result file (.json)
    file: PathBuf,
    /// The draw of the tenth [default: at random]
    #[arg(long, value_name = "N", value_parser = whole::<u64>(0..=u64::MAX))]
    draw: Option<u64>,
    /// The command of the results, if you trust it, one flag for each word: without it no program
    /// is started
    #[arg(long, value_name = "WORD", allow_hyphen_values = true)]
    command: Vec<String>,
    /// A file that the command of the results names, and others in the same way
    #[arg(long, value_name = "FILE")]
    program: Vec<PathBuf>,
    /// Runs in parallel [default: one for each core; over ROS 2: 1]
    #[arg(long, value_name = "N", value_parser = positive)]
    jobs: Option<NonZero<usize>>,
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.0..=1e6).contains(&seconds) => Ok(seconds),
        _ => Err("expected a number of seconds from 0 to 1e6".to_owned()),
    }
}

fn setting(text: &str) -> Result<(String, toml::Value), String> {
    let (key, value) = text.split_once('=').ok_or("expected KEY=VALUE, such as horizon_m=20")?;
    let table: Result<toml::Table, _> = toml::from_str(&format!("value = {value}"));
    // A word needs no quotes.
    let value = table.ok().and_then(|mut table| table.remove("value")).unwrap_or_else(|| value.into());
    Ok((key.to_owned(), value))
}

/// Executes a benchmark, or verifies results.
pub(crate) fn run(command: &BenchCommand) -> anyhow::Result<ExitCode> {
    match command {
        BenchCommand::Exploration1(args) => explore(&EXPLORATION_1, args),
        BenchCommand::Exploration2(args) => explore(&EXPLORATION_2, args),
        BenchCommand::Verify(args) => verify(args),
        BenchCommand::Schedule(args) => schedule(args),
    }
}

fn schedule(args: &ScheduleArgs) -> anyhow::Result<ExitCode> {
    let schedule = benchmark::schedule::schedule(&args.folder, args.cores, args.extra)?;
    let Schedule { cores, measured, runs, total_s, longest_s, makespan_s } = schedule;
    print(&format!(
        "{runs} runs on {cores} cores: {makespan_s:.1} s by simulated schedule; no schedule is shorter than {:.1} s",
        schedule.bound_s()
    ));
    print(&format!(
        "{measured} runs measured, the others taken to last as long as those of their track; {total_s:.1} s of \
         processor time, longest run {longest_s:.1} s, {} s of each beside its measured time",
        args.extra
    ));
    Ok(ExitCode::SUCCESS)
}

fn explore(benchmark: &'static Benchmark, args: &ExplorationArgs) -> anyhow::Result<ExitCode> {
    let paths = args.command.iter().filter(|word| word.contains('/')).map(PathBuf::from);
    let entry = Entry {
        controller: args.controller.clone(),
        set: args.set.iter().cloned().collect::<BTreeMap<_, _>>(),
        command: args.command.iter().map(|word| local(word)).collect(),
        files: files(paths)?,
    };
    let mut scope = match &args.phrase {
        Some(phrase) => Scope::held_out(benchmark, phrase),
        None => Scope::public(benchmark),
    };
    if let Some(seeds) = args.seeds {
        scope.seeds = (1..=seeds).collect();
    }
    if let Some(unknown) = args.world.iter().find(|name| benchmark.worlds().all(|world| world != **name)) {
        bail!("--world {unknown}: expected one of {}", benchmark.worlds().collect::<Vec<_>>().join(", "));
    }
    if !args.world.is_empty() {
        scope.worlds = args.world.iter().cloned().collect::<BTreeSet<_>>();
    }
    let options = options(args.jobs, &entry)?;
    let executed = interruptible(|stop| {
        let mut display = ProgressDisplay::default();
        let executed = benchmark::execute(benchmark, &entry, &scope, &args.out, &options, &mut display, stop)?;
        if executed.summary.left == 0 && !args.no_recordings && entry.command.is_empty() {
            for world in &scope.worlds {
                record_world(&args.out.join(world), options.jobs, stop);
            }
        }
        Ok(executed)
    })?;
    if executed.summary.left == 0 {
        match report::entry::write(benchmark, &args.out, &entry, executed.results.as_ref(), beside(&args.out)) {
            Ok(page) => print(&format!("{}", page.display())),
            Err(error) => tracing::info!("note: no page of the entry: {error}"),
        }
    }
    let Some(results) = executed.results else {
        tracing::info!(
            "{} runs failed, {} left; the same command continues",
            executed.summary.failed,
            executed.summary.left
        );
        return Ok(ExitCode::from(if executed.summary.left > 0 { exit::BY_SIGNAL } else { exit::FAILED }));
    };
    print(benchmark::table(&results).trim_end());
    let part = if results.is_whole { "" } else { " of a part of the benchmark" };
    print(&format!("score{part}: {:.2}; build {}", results.score, results.build));
    print(&format!("{}", args.out.join(benchmark.result_file()).display()));
    Ok(ExitCode::SUCCESS)
}

/// Records the runs of a world that its page shows; a note says why there are none.
fn record_world(world: &Path, jobs: NonZero<usize>, stop: &Stop) {
    let record = || -> anyhow::Result<()> {
        let mut runs = report::entry::examples(world)?;
        let store = Store::open(world)?;
        runs.retain(|id| !store.recording_file(id).exists());
        runs.extend(report::routes::without_recording(world)?);
        record_runs(world, runs, jobs, stop)
    };
    if let Err(error) = record() {
        tracing::info!("note: no recordings of {}: {error}", world.display());
    }
}

/// Copies the page that shows recordings into the folder of the runs, if one was built; its
/// address from there.
fn beside(folder: &Path) -> Option<&'static str> {
    match view::copy_page(&folder.join("page")) {
        Ok(is_copied) => is_copied.then_some("page/index.html"),
        Err(error) => {
            tracing::info!("note: no page for recordings: {error}");
            None
        }
    }
}

fn verify(args: &VerifyArgs) -> anyhow::Result<ExitCode> {
    let mut results = benchmark::read(&args.file)?;
    check_command(&args.file, &results.entry, &args.command)?;
    results.entry.files = files(args.program.iter().cloned())?;
    let draw = match args.draw {
        Some(draw) => draw,
        None => u64::from(getrandom::u32().map_err(|error| anyhow!("drawing runs: {error}"))?),
    };
    let options = options(args.jobs, &results.entry)?;
    let folder = tempfile::tempdir().context("a folder for the runs")?;
    let verified = interruptible(|stop| {
        let mut display = ProgressDisplay::default();
        Ok(benchmark::verify(&results, draw, folder.path(), &options, &mut display, stop)?)
    })?;
    verified.differences.iter().for_each(|difference| print(&format!("differs: {difference}")));
    let count = verified.runs;
    let verdict = if verified.differences.is_empty() { "all as in the file" } else { "not as in the file" };
    print(&format!(
        "{count} of {} runs executed again, {verdict}; --draw {draw} draws the same ones",
        results.runs.len()
    ));
    Ok(ExitCode::from(if verified.differences.is_empty() { 0 } else { exit::FAILED }))
}

/// Refuses to start a program because a result file, which may come from anywhere, names it:
/// `typed` has to be the same command.
fn check_command(file: &Path, entry: &Entry, typed: &[String]) -> anyhow::Result<()> {
    let Entry { command, .. } = entry;
    let is_same = |(word, typed): (&String, &String)| word == typed || *word == local(typed);
    if command.len() == typed.len() && command.iter().zip(typed).all(is_same) {
        return Ok(());
    }
    let file = file.display();
    if command.is_empty() {
        bail!("{file}: entry.command is empty, and --command is {typed:?}: the runs need no program; leave it out");
    }
    let flag = |word: &String| match shlex::try_quote(word) {
        Ok(quoted) => Ok(format!("--command {quoted}")),
        Err(_) => Err(anyhow!("{file}: entry.command = {command:?}: expected words without NUL")),
    };
    let flags: Vec<String> = command.iter().map(flag).collect::<Result<_, _>>()?;
    let flags = flags.join(" ");
    if typed.is_empty() {
        bail!(
            "{file}: entry.command = {command:?}: a program that a result file names is not started by itself; if you \
             trust it, repeat it: {flags}"
        );
    }
    bail!("{file}: entry.command = {command:?}, and --command is {typed:?}: expected the same words: {flags}")
}

/// A word of a command as the results have it: a file lies in the folder of the runs.
fn local(word: &str) -> String {
    word.rsplit_once('/').map_or_else(|| word.to_owned(), |(_, name)| format!("./{name}"))
}

/// Files by name.
fn files(paths: impl Iterator<Item = PathBuf>) -> anyhow::Result<BTreeMap<String, PathBuf>> {
    let named = |path: PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str()).map(str::to_owned);
        name.map(|name| (name, path.clone())).ok_or_else(|| anyhow!("{}: expected the path of a file", path.display()))
    };
    paths.map(named).collect()
}

fn options(jobs: Option<NonZero<usize>>, entry: &Entry) -> anyhow::Result<Options> {
    let cores = thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
    let (transport, usual) =
        if entry.command.is_empty() { (Transport::Memory, cores) } else { (over_ros(1)?, NonZero::<usize>::MIN) };
    Ok(Options {
        jobs: jobs.unwrap_or(usual),
        transport,
        part: Part::WHOLE,
        registry: Registry::BUILT_IN,
        prune: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_of_a_result_file_has_to_be_typed() {
        let check = |command: &[&str], typed: &[&str]| {
            let [command, typed] = [command, typed].map(|words| words.iter().map(ToString::to_string).collect());
            let entry = Entry { controller: "own".to_owned(), set: BTreeMap::new(), command, files: BTreeMap::new() };
            let typed: Vec<String> = typed;
            check_command(Path::new("r.json"), &entry, &typed).map_err(|error| error.to_string())
        };
        let own = ["python3", "./own.py", "{id}"];
        for (command, typed) in [
            (&[][..], &[][..]),
            (&own, &own),
            (&own, &["python3", "mine/own.py", "{id}"]),
            (&["sh", "-c", "a b"], &["sh", "-c", "a b"]),
        ] {
            check(command, typed).unwrap();
        }
        let untyped = check(&["sh", "-c", "touch it's"], &[]).unwrap_err();
        assert_eq!(
            untyped,
            "r.json: entry.command = [\"sh\", \"-c\", \"touch it's\"]: a program that a result file names is not \
             started by itself; if you trust it, repeat it: --command sh --command -c --command \"touch it's\""
        );
        for typed in [&["sh"][..], &["sh", "-c"], &["sh", "-c", "b"], &["sh", "-c", "a", "b"], &["./sh", "-c", "a"]] {
            let other = check(&["sh", "-c", "a"], typed).unwrap_err();
            assert!(other.ends_with("expected the same words: --command sh --command -c --command a"), "{other}");
        }
        // A path elsewhere is not the file beside the runs.
        assert!(check(&["/tmp/own"], &["./own"]).is_err());
        assert!(check(&[], &["sh"]).unwrap_err().ends_with("the runs need no program; leave it out"));
    }
}
