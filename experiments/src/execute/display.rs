//! What people see of a plan under way: a bar on a terminal, plain lines otherwise. All of it on stderr.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::plan::{self, PlannedRun};
use crate::rows::RunRow;

/// Shows how far a plan has come.
pub(super) struct Display {
    bar: Option<ProgressBar>,
    started: Instant,
    /// Runs of the plan, with those that were there already.
    runs: usize,
    ended: usize,
    /// Work that was to be done when it began, and that is done since.
    todo_cost: u64,
    done_cost: u64,
    sim_s: f64,
}

impl Display {
    /// For a plan of `runs` of which `todo` are to be done.
    pub(super) fn new(runs: &[&PlannedRun], todo: &[&PlannedRun]) -> Self {
        let mut display = Self {
            bar: std::io::stderr().is_terminal().then(|| {
                let bar = ProgressBar::with_draw_target(Some(runs.len() as u64), ProgressDrawTarget::stderr());
                let style = ProgressStyle::with_template("{bar:30} {msg}").expect("the template is right");
                bar.set_style(style);
                bar
            }),
            started: now(),
            runs: runs.len(),
            ended: runs.len() - todo.len(),
            todo_cost: todo.iter().map(|run| plan::cost(&run.scenario)).sum(),
            done_cost: 0,
            sim_s: 0.0,
        };
        if display.ended > 0 {
            display.say(&format!("{} of {} runs are done already", display.ended, display.runs));
        }
        display.show(None);
        display
    }

    /// A run has come to its end.
    pub(super) fn done(&mut self, run: &PlannedRun, row: &RunRow) {
        self.sim_s += row.end_s;
        self.count(run);
        let name = name(run);
        let text = format!("{name}: {} after {:.0} s, explored {:.1} %", row.reason, row.end_s, row.explored * 100.0);
        self.show(Some(&text));
    }

    /// A run has failed.
    pub(super) fn failed(&mut self, run: &PlannedRun, reason: &str) {
        self.count(run);
        self.say(&format!("error: {}: {reason}", name(run)));
        self.show(None);
    }

    /// Takes the bar away.
    pub(super) fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    fn count(&mut self, run: &PlannedRun) {
        self.ended += 1;
        self.done_cost += plan::cost(&run.scenario);
    }

    fn show(&mut self, event: Option<&str>) {
        let state = self.state();
        match (&self.bar, event) {
            (Some(bar), _) => {
                bar.set_position(self.ended as u64);
                bar.set_message(state);
            }
            (None, Some(event)) => self.say(&format!("{state} | {event}")),
            (None, None) => {}
        }
    }

    fn state(&self) -> String {
        let wall = now().duration_since(self.started);
        let mut text = format!("{}/{} runs", self.ended, self.runs);
        if self.done_cost > 0 {
            let rate = self.sim_s / wall.as_secs_f64().max(1e-3);
            let left = (self.todo_cost - self.done_cost) as f64 / self.done_cost as f64;
            text += &format!(" | {rate:.0} x real time | {} left", clock(wall.mul_f64(left)));
        }
        text
    }

    fn say(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.println(text),
            // A plan does not end because nobody listens any more.
            None => drop(writeln!(std::io::stderr(), "{text}")),
        }
    }
}

/// What tells a run from the others of its plan.
fn name(run: &PlannedRun) -> String {
    let axes = run.axes.iter().map(|(key, value)| format!("{key} = {value}, "));
    format!("{}seed {}", axes.collect::<String>(), run.scenario.seed)
}

/// Hours, minutes and seconds.
fn clock(time: Duration) -> String {
    let seconds = time.as_secs();
    match (seconds / 3600, seconds / 60 % 60) {
        (0, minutes) => format!("{minutes}:{:02}", seconds % 60),
        (hours, minutes) => format!("{hours}:{minutes:02}:{:02}", seconds % 60),
    }
}

#[expect(clippy::disallowed_methods, reason = "people are told how long it takes; no result hangs on it")]
fn now() -> Instant {
    Instant::now()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_written_as_on_a_clock() {
        assert_eq!(clock(Duration::from_secs(59)), "0:59");
        assert_eq!(clock(Duration::from_secs(3_725)), "1:02:05");
    }
}
