//! The progress of a plan on stderr: a bar on a terminal, plain lines otherwise.

use std::time::Instant;

use experiments::execute::PlanObserver;
use experiments::plan::PlannedRun;
use experiments::rows::RunRow;
use indicatif::ProgressBar;
use system::progress_bar::{self, clock};
use system::wall_clock::now;

/// Shows how far a plan has come.
pub(crate) struct ProgressDisplay {
    bar: Option<ProgressBar>,
    started: Instant,
    /// Runs of the plan, including those that had a record before.
    runs: usize,
    ended: usize,
    /// [`PlannedRun::cost`] of the runs that were pending at the start, and of those completed
    /// since.
    pending_cost: u64,
    done_cost: u64,
    sim_s: f64,
}

impl Default for ProgressDisplay {
    fn default() -> Self {
        Self { bar: None, started: now(), runs: 0, ended: 0, pending_cost: 0, done_cost: 0, sim_s: 0.0 }
    }
}

impl PlanObserver for ProgressDisplay {
    fn started(&mut self, runs: &[&PlannedRun], pending: &[&PlannedRun]) {
        self.bar = progress_bar::on_stderr(runs.len() as u64);
        self.started = now();
        self.runs = runs.len();
        self.ended = runs.len() - pending.len();
        self.pending_cost = pending.iter().map(|run| run.cost).sum();
        // A benchmark executes several plans in turn.
        (self.done_cost, self.sim_s) = (0, 0.0);
        if self.ended > 0 {
            tracing::info!("{} of {} runs are done already", self.ended, self.runs);
        }
        self.show(None);
    }

    fn completed(&mut self, run: &PlannedRun, row: &RunRow) {
        self.sim_s += row.end_s;
        self.count(run);
        let name = name(run);
        let text = format!("{name}: {} after {:.0} s, explored {:.1} %", row.reason, row.end_s, row.explored * 100.0);
        self.show(Some(&text));
    }

    fn failed(&mut self, run: &PlannedRun, reason: &str) {
        self.count(run);
        tracing::error!("{}: {reason}", name(run));
        self.show(None);
    }

    fn ended(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl ProgressDisplay {
    fn count(&mut self, run: &PlannedRun) {
        self.ended += 1;
        self.done_cost += run.cost;
    }

    fn show(&mut self, event: Option<&str>) {
        let state = self.state();
        match (&self.bar, event) {
            (Some(bar), _) => {
                bar.set_position(self.ended as u64);
                bar.set_message(state);
            }
            (None, Some(event)) => tracing::info!("{state} | {event}"),
            (None, None) => {}
        }
    }

    fn state(&self) -> String {
        let wall = now().duration_since(self.started);
        let mut text = format!("{}/{} runs", self.ended, self.runs);
        if self.done_cost > 0 {
            let rate = self.sim_s / wall.as_secs_f64().max(1e-3);
            let left = (self.pending_cost - self.done_cost) as f64 / self.done_cost as f64;
            text += &format!(" | {rate:.0} x real time | {} left", clock(wall.mul_f64(left)));
        }
        text
    }
}

/// The axes and the seed of a run, which tell it from the others of its plan.
fn name(run: &PlannedRun) -> String {
    let axes = run.axes.iter().map(|(key, value)| format!("{key} = {value}, "));
    format!("{}seed {}", axes.collect::<String>(), run.scenario.seed)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use experiments::plan::Plan;

    use super::*;

    #[test]
    fn every_plan_counts_from_the_start() {
        let text = "seeds = \"1..4\"\nscenario = { duration_s = 9.0, map = { kind = \"spheres\", size = 20 }, agents = { count = 1 } }";
        let plan = Plan::parse("p.toml", text, Path::new("")).unwrap();
        let runs: Vec<&PlannedRun> = plan.runs.iter().collect();
        let mut display = ProgressDisplay::default();
        display.started(&runs, &runs);
        runs.iter().for_each(|run| display.failed(run, "of a plan before"));
        display.ended();
        // Three runs are there, so the cost of one is left.
        display.started(&runs, &runs[..1]);
        assert_eq!((display.ended, display.pending_cost, display.done_cost), (3, runs[0].cost, 0));
        display.failed(runs[0], "in this plan");
        assert!(display.state().ends_with("0:00 left"), "{}", display.state());
    }
}
