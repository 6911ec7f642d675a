//! `maes movie`: a movie of a recording.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use foxglove_server::capture::{self, CaptureArgs, CaptureTime};
use recording::Recording;
use sim_server::cli::{time_s, whole};

use crate::recordings::capture_failed;

/// Arguments of `movie`.
#[derive(Debug, Args)]
pub(crate) struct MovieArgs {
    #[command(flatten)]
    subject: CaptureArgs,
    /// The movie (.mp4 or .gif)
    #[arg(long, value_name = "FILE", value_parser = movie)]
    out: PathBuf,
    /// Sim time of the first picture [default: that of the recording]
    #[arg(long, value_name = "TIME", value_parser = time_s)]
    from: Option<f64>,
    /// Sim time of the last picture [default: that of the recording]
    #[arg(long, value_name = "TIME", value_parser = time_s)]
    to: Option<f64>,
    /// How long the movie lasts
    #[arg(long, value_name = "TIME", value_parser = time_s, default_value_t = 30.0)]
    seconds: f64,
    /// Pictures per second
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = whole::<u32>(1..=120))]
    fps: u32,
}

fn movie(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let is_movie = path.extension().is_some_and(|extension| extension == "mp4" || extension == "gif");
    if is_movie { Ok(path) } else { Err("expected a name that ends in .mp4 or .gif".to_owned()) }
}

/// Makes a movie.
pub(crate) fn make(args: &MovieArgs) -> anyhow::Result<ExitCode> {
    Recording::open_messages(&args.subject.file)?;
    let &MovieArgs { from, to, seconds, fps, .. } = args;
    if let Err(error) = capture::take(&args.subject, CaptureTime::Movie { from, to, seconds, fps }, &args.out) {
        return Ok(capture_failed(&error));
    }
    Ok(ExitCode::SUCCESS)
}
