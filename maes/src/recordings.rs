//! Commands about recordings: `info`, `verify`, `recover`, `diff`, `snapshot`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use experiments::diff;
use foxglove_server::capture::{self, CaptureArgs, CaptureError, CaptureTime};
use msgs::ids::Tick;
use msgs::printable;
use recording::Recording;
use recording::bag;
use recording::playback::{Playback, PlaybackError};
use recording::recovery::{self, RecoverError};
use sim_server::cli::{recording_path, time_s};
use sim_server::{cmu_metrics, exit, info, verify};

use crate::controllers::BuiltInControllers;
use crate::output::print;

/// Arguments of `info`.
#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// The recording (.mcap), or the rosbag2 folder of one
    #[arg(value_parser = recording_path())]
    file: PathBuf,
    /// Print the metadata.yaml of a rosbag2 folder with this recording instead
    #[arg(long)]
    metadata: bool,
    /// Print the explored volume (m^3), distance (m), run time (s) and time (s) of each sample
    /// instead, as the CMU exploration environment logs them
    #[arg(long, conflicts_with = "metadata")]
    cmu_metrics: bool,
}

/// Arguments of `verify`.
#[derive(Debug, Args)]
pub(crate) struct VerifyArgs {
    /// The recording (.mcap), or the rosbag2 folder of one
    #[arg(value_parser = recording_path())]
    file: PathBuf,
    /// Fail unless the commands of every agent can be compared with what its controller decides
    #[arg(long)]
    controllers: bool,
    /// Take the commands as recorded, and re-execute only the world: a quick check that does not
    /// find a forged command
    #[arg(long, conflicts_with = "controllers")]
    no_controllers: bool,
    /// Accept a recording that is cut off or has no end: what it holds must verify, and have a tick
    #[arg(long)]
    up_to_cut: bool,
}

/// Arguments of `recover`.
#[derive(Debug, Args)]
pub(crate) struct RecoverArgs {
    /// The cut recording, or any other MCAP file (.mcap)
    #[arg(value_parser = recording_path())]
    file: PathBuf,
    /// The finished recording, a new file (.mcap)
    #[arg(short, long = "output", value_name = "MCAP")]
    output: PathBuf,
}

/// Arguments of `diff`.
#[derive(Debug, Args)]
pub(crate) struct DiffArgs {
    /// A recording (.mcap), or the rosbag2 folder of one
    #[arg(value_parser = recording_path())]
    first: PathBuf,
    /// Another one
    #[arg(value_parser = recording_path())]
    second: PathBuf,
}

/// Arguments of `snapshot`.
#[derive(Debug, Args)]
pub(crate) struct SnapshotArgs {
    #[command(flatten)]
    subject: CaptureArgs,
    /// Sim time of the moment
    #[arg(long, value_name = "TIME", value_parser = time_s)]
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

/// Describes a recording.
pub(crate) fn info(args: &InfoArgs) -> anyhow::Result<ExitCode> {
    if args.metadata {
        let name = args.file.file_name().unwrap_or_default().to_string_lossy();
        print(&bag::metadata(&Recording::open_messages(&args.file)?, &name));
    } else if args.cmu_metrics {
        let metrics = cmu_metrics::text(&info::read(&args.file)?);
        print(metrics.with_context(|| args.file.display().to_string())?.trim_end());
    } else {
        print(&info::text(&info::overview(&args.file)?));
    }
    Ok(ExitCode::SUCCESS)
}

/// Checks a recording.
pub(crate) fn verify(args: &VerifyArgs) -> anyhow::Result<ExitCode> {
    let recording = Recording::open(&args.file)?;
    let failed = |error: &dyn std::fmt::Display, code| {
        tracing::error!("{}", printable::line(&error.to_string()));
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
    if verified.ticks > Tick::ZERO {
        print(&format!("{}\n{commands}", verify::text(&verified)));
        print(&format!("digest: {}", verified.digest));
    }
    match verified.lack(args.up_to_cut) {
        Some(lack) => failed(&format!("{}: {lack}", recording.file()), ExitCode::from(exit::DIFFERENT)),
        None => Ok(ExitCode::SUCCESS),
    }
}

/// Finishes a cut recording.
pub(crate) fn recover(args: &RecoverArgs) -> anyhow::Result<ExitCode> {
    match recovery::recover(&args.file, &args.output) {
        Ok(recovered) => {
            print(&printable::text(&recovery::text(&recovered)));
            Ok(ExitCode::SUCCESS)
        }
        Err(error @ RecoverError::Write { .. }) => {
            tracing::error!("{}", printable::line(&error.to_string()));
            Ok(ExitCode::from(exit::FAILED))
        }
        Err(error) => Err(error.into()),
    }
}

/// Compares two recordings.
pub(crate) fn diff(args: &DiffArgs) -> anyhow::Result<ExitCode> {
    let (first, second) = (Recording::open(&args.first)?, Recording::open(&args.second)?);
    let verdict = diff::diff(&first, &second);
    if !verdict.is_same_run() {
        for recording in [&first, &second] {
            // Of messages in another order, the first difference says nothing about the runs.
            if let Err(error @ PlaybackError::Disorder { .. }) = Playback::new(recording) {
                return Err(error.into());
            }
        }
    }
    print(&diff::text(&verdict, &first, &second));
    Ok(if verdict.is_same_run() { ExitCode::SUCCESS } else { ExitCode::from(exit::DIFFERENT) })
}

/// Reports why nothing was rendered, unless the driver of the browser has done so.
pub(crate) fn capture_failed(error: &CaptureError) -> ExitCode {
    if !matches!(error, CaptureError::Driver { .. }) {
        tracing::error!("{error}");
    }
    ExitCode::from(capture::exit_code(error))
}

/// Takes a picture of a recording.
pub(crate) fn snapshot(args: &SnapshotArgs) -> anyhow::Result<ExitCode> {
    Recording::open_messages(&args.subject.file)?;
    if let Err(error) = capture::take(&args.subject, CaptureTime::Snapshot { at: args.at }, &args.out) {
        return Ok(capture_failed(&error));
    }
    Ok(ExitCode::SUCCESS)
}
