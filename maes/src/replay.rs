//! `maes replay`: a recording on its ROS 2 topics.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use msgs::ids::Tick;
use msgs::printable;
use msgs::rcl_interfaces::Level;
use recording::Recording;
use recording::replay::{PlaybackOptions, PlaybackSchedule, PlaybackTiming};
use ros_node::ros_env::RosEnv;
use sim_server::cli::{recording_path, time_s};
use sim_server::terminal::Terminal;
use sim_server::{exit, ros};
use simulation::parameters::{self, RATE};
use simulation::scenario::Rtf;

use crate::output::print;
use crate::signals;

/// Arguments of `replay`.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// The recording (.mcap), or the rosbag2 folder of one
    #[arg(value_parser = recording_path())]
    file: PathBuf,
    /// Most sim seconds for each second of wall time; max: as fast as possible
    #[arg(long, value_name = "X|max", value_parser = rate, default_value = "1")]
    rate: Rtf,
    /// Sim time at which playback begins
    #[arg(long, value_name = "TIME", value_parser = time_s, default_value_t = 0.0)]
    start: f64,
    /// Sim time at which playback ends, if not at the end of the recording
    #[arg(long, value_name = "TIME", value_parser = time_s)]
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

fn rate(text: &str) -> Result<Rtf, String> {
    if text == "max" {
        return Ok(Rtf::MAX);
    }
    let expected = || "expected max (as fast as possible), or a number from 0.001 to 1000000".to_owned();
    // A rate of 0 is that of the service, which has no word `max`.
    let limit = text.parse().ok().filter(|limit| *limit != 0.0).ok_or_else(expected)?;
    parameters::pace(RATE, limit).map_err(|_| expected())
}

/// Plays a recording over ROS 2.
pub(crate) fn replay(args: &ReplayArgs) -> anyhow::Result<ExitCode> {
    let env = RosEnv::from_vars(|name| std::env::var(name).ok())?;
    let recording = Recording::open_messages(&args.file)?;
    let options = PlaybackOptions {
        only: args.topics.clone(),
        exclude: args.exclude.clone(),
        start_s: args.start,
        end_s: args.end,
    };
    let schedule = PlaybackSchedule::new(&recording, &options)?;
    let timing = PlaybackTiming { rate: args.rate, is_loop: args.is_loop, is_paused: args.paused };
    let stop = signals::stop_flag()?;
    let mut terminal = Terminal::new(schedule.ticks().1);
    schedule.notes().iter().for_each(|note| terminal.say(Level::Warn, &printable::line(note)));
    let played = ros::replay::play(&recording, &schedule, timing, &env, &mut terminal, &stop);
    terminal.clear();
    let played = match played {
        Ok(played) => played,
        Err(error) => {
            tracing::error!("{error}");
            return Ok(ExitCode::from(exit::FAILED));
        }
    };
    let sim_s = Tick(played.sim_ticks).time_ns() as f64 * 1e-9;
    print(&format!("replayed {} messages, {sim_s:.2} s", played.messages));
    Ok(ExitCode::from(if played.is_interrupted { exit::BY_SIGNAL } else { 0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates() {
        assert_eq!(rate("max"), Ok(Rtf::MAX));
        assert_eq!(rate("0.5"), Ok(Rtf::Limit(0.5)));
        for wrong in ["fast", "-1", "inf", "nan", "0"] {
            assert!(rate(wrong).unwrap_err().starts_with("expected max"), "{wrong}");
        }
    }
}
