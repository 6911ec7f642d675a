//! Terminal output of a run: a progress bar on a terminal, plain lines otherwise, and a table at
//! the end.
//!
//! Progress and notes go to stderr; the result goes to stdout, with the digest as its last line.
//! Invariant: control characters in names and messages are escaped ([`msgs::printable`]), on the
//! terminal and in the log.

use std::fs::File;
use std::io::Write;
use std::time::{Duration, Instant};

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{Cell, CellAlignment, Table};
use indicatif::ProgressBar;
use msgs::counters::CounterName;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{self, Counter};
use msgs::printable;

use crate::session::{Outcome, RunObserver};
use protocol::lockstep::listed;
use simulation::scenario::{Scenario, StopRule};
use system::diagnostics;
use system::progress_bar::{self, TimeLeft};
use system::wall_clock::now;
use transport::Level;
use world::World;

/// Minimum wall time between two plain progress lines.
const LINE_PERIOD: Duration = Duration::from_secs(5);

/// The largest team whose members are reported one by one as they join; larger ones every second.
const SMALL_TEAM: u32 = 20;
const WAITING_PERIOD: Duration = Duration::from_secs(1);

/// Steps of the bar.
const BAR_LENGTH: u64 = 10_000;

/// Progress display on stderr.
pub struct Terminal {
    bar: Option<ProgressBar>,
    /// By which progress is measured.
    rule: StopRule,
    time_left: TimeLeft,
    duration: Tick,
    agents: u32,
    started: Option<Instant>,
    line_written: Option<Instant>,
    waiting_for: Vec<AgentId>,
    waiting_written: Option<Instant>,
    log: Option<File>,
    /// Whether it has been said what wide bodies can reach and see.
    has_told_attainable: bool,
}

impl Terminal {
    /// For a run of a scenario.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self { rule: scenario.stop_rule(), agents: scenario.agents.count, ..Self::new(scenario.last_duration_ticks()) }
    }

    /// For what ends after a duration.
    #[must_use]
    pub fn new(duration: Tick) -> Self {
        Self {
            bar: progress_bar::on_stderr(BAR_LENGTH),
            rule: StopRule::Duration,
            time_left: TimeLeft::default(),
            duration,
            agents: 0,
            started: None,
            line_written: None,
            waiting_for: Vec::new(),
            waiting_written: None,
            log: None,
            has_told_attainable: false,
        }
    }

    /// Also writes messages to a file.
    #[must_use]
    pub fn with_log(self, log: Option<File>) -> Self {
        Self { log, ..self }
    }

    /// Removes the bar.
    pub fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// Says a message. Who reads it finds it in the log.
    pub fn say(&mut self, level: Level, text: &str) {
        self.keep(&diagnostics::line(level, text));
        match level {
            Level::Error => tracing::error!("{text}"),
            Level::Warn => tracing::warn!("{text}"),
            Level::Info => tracing::info!("{text}"),
        }
    }

    /// Shows progress, of which this share is done: on the bar, or as a line every few seconds.
    pub fn status(&mut self, done: f64, text: &str) {
        match &self.bar {
            Some(bar) => {
                bar.set_position((done * BAR_LENGTH as f64) as u64);
                bar.set_message(printable::line(text).into_owned());
            }
            None if self.line_written.is_none_or(|line| line.elapsed() >= LINE_PERIOD) => {
                self.line_written = Some(now());
                self.say(Level::Info, text);
            }
            _ => {}
        }
    }

    /// Writes a message to the log only.
    pub fn keep(&mut self, text: &str) {
        let text = printable::text(text);
        // A log that cannot be written must not end the run.
        if let Some(log) = &mut self.log
            && writeln!(log, "{text}").is_err()
        {
            self.log = None;
        }
    }
}

impl RunObserver for Terminal {
    fn waiting(&mut self, missing: &[AgentId]) {
        let is_due = self.waiting_written.is_none_or(|written| written.elapsed() >= WAITING_PERIOD);
        if self.waiting_for != missing && (is_due || self.agents <= SMALL_TEAM) {
            self.waiting_for = missing.to_vec();
            self.waiting_written = Some(now());
            let text = format!("waiting for agents: {}", listed(missing.iter().copied()));
            self.say(Level::Info, &text);
        }
    }

    fn progress(&mut self, world: &World) {
        if let Some(attainable) = world.attainable().filter(|_| !std::mem::replace(&mut self.has_told_attainable, true))
        {
            let (reached, seen) = (attainable.reached_share() * 100.0, attainable.seen_share() * 100.0);
            self.say(
                Level::Info,
                &format!("the bodies of the team reach {reached:.1} % of the free cells and see {seen:.1} %"),
            );
        }
        let attainable = world.attainable_share();
        let now = now();
        let started = *self.started.get_or_insert(now);
        let sim_s = world.tick().time_ns() as f64 * 1e-9;
        let wall_s = now.duration_since(started).as_secs_f64();
        let (explored, covered) = (world.coverage().explored(), world.coverage().covered());
        let known_at_base = world.coverage().known_at_base();
        let elapsed = world.tick().0 as f64 / self.duration.0.max(1) as f64;
        let done = match self.rule {
            StopRule::Explored => explored / attainable.unwrap_or(1.0),
            StopRule::Covered => covered,
            StopRule::KnownAtBase => known_at_base.unwrap_or_default() / attainable.unwrap_or(1.0),
            StopRule::Back | StopRule::Duration => 0.0,
        };
        let until_limit = Duration::try_from_secs_f64(wall_s / elapsed * (1.0 - elapsed).max(0.0)).ok();
        let left = [self.time_left.estimate(now, done), until_limit].into_iter().flatten().min();
        let text = format!(
            "{:5.1} % explored{}{}{} | {} left | {:.0} x real time | {} of at most {}",
            explored * 100.0,
            attainable.map_or_else(String::new, |share| format!(" of {:.1} %", share * 100.0)),
            if self.rule == StopRule::Covered { format!(", {:.1} % covered", covered * 100.0) } else { String::new() },
            known_at_base.map_or_else(String::new, |share| format!(", {:.1} % known at the base", share * 100.0)),
            left.map_or_else(|| "?".to_owned(), progress_bar::clock),
            if wall_s > 0.0 { sim_s / wall_s } else { 0.0 },
            clock(world.tick()),
            clock(self.duration),
        );
        self.status(done.max(elapsed), &text);
    }

    fn started(&mut self) {
        self.started = Some(now());
        let text = format!("all {} agents are there", self.agents);
        self.say(Level::Info, &text);
    }

    fn note(&mut self, level: Level, text: &str) {
        self.say(level, &printable::line(text));
    }
}

/// The result of a run as text: a table, and the digest as the last line.
#[must_use]
pub fn result_text(outcome: &Outcome) -> String {
    let result = &outcome.result;
    let sim_s = Tick(result.tick).time_ns() as f64 * 1e-9;
    let wall_s = outcome.wall.as_secs_f64();
    let speed = if wall_s > 0.0 { sim_s / wall_s } else { 0.0 };
    format!("{}\nwall time {wall_s:.2} s, {speed:.1} x real time\ndigest: {}", result_table(result), outcome.digest)
}

/// The result of a run as a table.
#[must_use]
pub fn result_table(result: &maes_msgs::Result) -> String {
    let percent = |share: f64| Cell::new(format!("{:.2} %", share * 100.0)).set_alignment(CellAlignment::Right);
    let metres = |way: f64| Cell::new(format!("{way:.1} m")).set_alignment(CellAlignment::Right);
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED);
    table.set_header(["", "explored", "covered", "distance"]);
    let agents = result.explored_by.iter().zip(&result.covered_by).zip(&result.distance_m);
    for (agent, ((&explored, &covered), &distance)) in agents.enumerate() {
        table.add_row([Cell::new(format!("agent {agent}")), percent(explored), percent(covered), metres(distance)]);
    }
    let team_m = result.distance_m.iter().sum();
    table.add_row([Cell::new("team"), percent(result.explored), percent(result.covered), metres(team_m)]);
    let mut times = Vec::new();
    let mut attainable = String::new();
    let mut counted = Vec::new();
    for Counter { name, value } in &result.counters {
        match CounterName::parse(name) {
            Some(CounterName::AttainablePpm) => {
                let percent = *value as f64 / 1e4;
                attainable = format!("bodies of the team can see {percent:.2} % of the free cells\n");
            }
            Some(CounterName::TickExplored { permille }) => {
                times.push(format!("{} % {}", permille as f64 / 10.0, clock(Tick(*value))))
            }
            _ if *value > 0 => counted.push(format!("{} {value}", printable::line(name))),
            _ => {}
        }
    }
    let times = if times.is_empty() { String::new() } else { format!("time to see {}\n", times.join(", ")) };
    format!(
        "{table}\nended after {} of sim time (tick {}): {}\n{attainable}{times}{}",
        clock(Tick(result.tick)),
        result.tick,
        printable::line(&result.reason),
        counted.join(", ")
    )
}

/// Sim time as minutes and seconds.
pub(crate) fn clock(tick: Tick) -> String {
    let seconds = tick.time_ns() as f64 * 1e-9;
    format!("{:02}:{:05.2}", (seconds / 60.0) as u64, seconds % 60.0)
}
