//! Commands about recordings: `info`, `verify`, `diff`, `replay`, `snapshot`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use experiments::diff;
use msgs::ids::Tick;
use msgs::printable;
use ros_node::ros_env::RosEnv;
use sim_server::foxglove::capture::{self, CaptureArgs, CaptureTime};
use sim_server::recording::{End, Recording};
use sim_server::replay::{PlaybackOptions, PlaybackSchedule, PlaybackTiming};
use sim_server::terminal::Terminal;
use sim_server::{bag, exit, info, ros, verify};
use simulation::parameters::{self, RATE};
use simulation::scenario::Rtf;

use crate::controllers::BuiltInControllers;
use crate::output::{print, say};
use crate::signals;

/// Arguments of `info`.
#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// The recording (.mcap)
    file: PathBuf,
    /// Print the metadata.yaml of a rosbag2 folder with this recording instead
    #[arg(long)]
    metadata: bool,
}

/// Arguments of `verify`.
#[derive(Debug, Args)]
pub(crate) struct VerifyArgs {
    /// The recording (.mcap)
    file: PathBuf,
    /// Fail unless the commands of every agent can be compared with what its controller decides
    #[arg(long)]
    controllers: bool,
    /// Take the commands as recorded, and re-execute only the world: a quick check that does not
    /// find a forged command
    #[arg(long, conflicts_with = "controllers")]
    no_controllers: bool,
}

/// Arguments of `diff`.
#[derive(Debug, Args)]
pub(crate) struct DiffArgs {
    /// A recording (.mcap)
    first: PathBuf,
    /// Another one (.mcap)
    second: PathBuf,
}

/// Arguments of `replay`.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// The recording (.mcap)
    file: PathBuf,
    /// Most sim seconds for each second of wall time; max: as fast as possible
    #[arg(long, value_name = "X|max", value_parser = rate, default_value = "1")]
    rate: Rtf,
    /// Sim time at which playback begins
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, allow_negative_numbers = true)]
    start: f64,
    /// Sim time at which playback ends, if not at the end of the recording
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    end: Option<f64>,
    /// Begin again at the end
    #[arg(long = "loop")]
    is_loop: bool,
    /// Begin paused, until a service call resumes playback
    #[arg(long)]
    paused: bool,
    /// Play only these topics; a * at the end stands for any rest
    #[arg(long, value_name = "NAME[,NAME...]", value_delimiter = ',')]
    topics: Vec<String>,
    /// Leave these topics out; a * at the end stands for any rest
    #[arg(long, value_name = "NAME[,NAME...]", value_delimiter = ',')]
    exclude: Vec<String>,
}

/// Arguments of `snapshot`.
#[derive(Debug, Args)]
pub(crate) struct SnapshotArgs {
    #[command(flatten)]
    subject: CaptureArgs,
    /// Sim time of the moment
    #[arg(long, value_name = "SECONDS")]
    at: f64,
    /// The picture (.png)
    #[arg(long, value_name = "PNG", value_parser = png)]
    out: PathBuf,
}

/// The name of a picture.
pub(crate) fn png(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path.extension().is_some_and(|extension| extension == "png") {
        Ok(path)
    } else {
        Err("expected a name that ends in .png".to_owned())
    }
}

fn rate(text: &str) -> Result<Rtf, String> {
    if text == "max" {
        return Ok(Rtf::MAX);
    }
    let limit = text.parse().map_err(|_| "expected a number or max".to_owned())?;
    parameters::pace(RATE, limit)
}

/// Describes a recording.
pub(crate) fn info(args: &InfoArgs) -> anyhow::Result<ExitCode> {
    if args.metadata {
        let name = args.file.file_name().unwrap_or_default().to_string_lossy();
        print(&bag::metadata(&Recording::open(&args.file)?, &name));
    } else {
        print(&info::text(&info::read(&args.file)?));
    }
    Ok(ExitCode::SUCCESS)
}

/// Checks a recording.
pub(crate) fn verify(args: &VerifyArgs) -> anyhow::Result<ExitCode> {
    let recording = Recording::open(&args.file)?;
    let failed = |error: &dyn std::fmt::Display, code| {
        say(&printable::line(&format!("error: {error}")));
        Ok(code)
    };
    let controllers = BuiltInControllers::of(&recording);
    let verified = match verify::verify(&recording) {
        Ok(verified) => verified,
        Err(error) => {
            // A changed command shows only later in what comes of it.
            if !args.no_controllers
                && let Some(tick) = error.tick()
                && let Err(earlier) = verify::controllers::check(&recording, tick, &controllers)
            {
                return failed(&earlier, ExitCode::from(exit::DIFFERENT));
            }
            return failed(&error, exit::of_verify_error(&error));
        }
    };
    let commands = if args.no_controllers {
        "the commands were taken as recorded, and not compared with what controllers decide".to_owned()
    } else {
        let checked = match verify::controllers::check(&recording, verified.ticks, &controllers) {
            Ok(checked) => checked,
            Err(error) => return failed(&error, ExitCode::from(exit::DIFFERENT)),
        };
        if let Some((agent, reason)) = checked.unchecked.first_key_value().filter(|_| args.controllers) {
            let unchecked = format!("{}: --controllers: agent {agent} cannot be checked: {reason}", recording.file());
            return failed(&unchecked, ExitCode::from(exit::DIFFERENT));
        }
        verify::controllers::text(&checked)
    };
    print(&format!("{}\n{commands}", verify::text(&verified)));
    print(&format!("digest: {}", verified.digest));
    if let End::Damage { .. } = verified.end {
        let damaged = format!("{}: {}", recording.file(), verified.end);
        return failed(&damaged, ExitCode::from(exit::DIFFERENT));
    }
    Ok(ExitCode::SUCCESS)
}

/// Compares two recordings.
pub(crate) fn diff(args: &DiffArgs) -> anyhow::Result<ExitCode> {
    let (first, second) = (Recording::open(&args.first)?, Recording::open(&args.second)?);
    let verdict = diff::diff(&first, &second);
    print(&diff::text(&verdict, &first, &second));
    Ok(if verdict.is_same_run() { ExitCode::SUCCESS } else { ExitCode::from(exit::DIFFERENT) })
}

/// Plays a recording over ROS 2.
pub(crate) fn replay(args: &ReplayArgs) -> anyhow::Result<ExitCode> {
    let env = RosEnv::from_vars(|name| std::env::var(name).ok())?;
    let recording = Recording::open(&args.file)?;
    let options = PlaybackOptions {
        only: args.topics.clone(),
        exclude: args.exclude.clone(),
        start_s: args.start,
        end_s: args.end,
    };
    let schedule = PlaybackSchedule::new(&recording, &options)?;
    let timing = PlaybackTiming { rate: args.rate, is_loop: args.is_loop, is_paused: args.paused };
    let stop = signals::stop_flag()?;
    let mut terminal = Terminal::new(schedule.ticks().1, 0);
    schedule.notes().iter().for_each(|note| terminal.say(&printable::line(&format!("warning: {note}"))));
    let played = ros::replay::play(&recording, &schedule, timing, &env, &mut terminal, &stop);
    terminal.clear();
    let played = match played {
        Ok(played) => played,
        Err(error) => {
            say(&format!("error: {error}"));
            return Ok(ExitCode::from(exit::FAILED));
        }
    };
    let sim_s = Tick(played.sim_ticks).time_ns() as f64 * 1e-9;
    print(&format!("replayed {} messages, {sim_s:.2} s", played.messages));
    Ok(ExitCode::from(if played.is_interrupted { exit::BY_SIGNAL } else { 0 }))
}

/// Takes a picture of a recording.
pub(crate) fn snapshot(args: &SnapshotArgs) -> anyhow::Result<ExitCode> {
    Recording::open(&args.subject.file)?;
    if let Err(error) = capture::take(&args.subject, CaptureTime::Snapshot { at: args.at }, &args.out) {
        say(&format!("error: {error}"));
        return Ok(ExitCode::from(capture::exit_code(&error)));
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates() {
        assert_eq!(rate("max"), Ok(Rtf::MAX));
        assert_eq!(rate("0.5"), Ok(Rtf::Limit(0.5)));
        assert!(rate("fast").is_err() && rate("-1").is_err() && rate("inf").is_err());
    }
}
