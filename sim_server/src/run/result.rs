//! The end of a run: the agents are told, and the result is recorded.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use msgs::maes_msgs::{self, Counter, Observation as Part};

use super::exchange::{Asked, Meanwhile};
use super::log::Kind;
use super::{FAREWELL, MILESTONE_COUNTER, Outcome, Run, RunError};
use simulation::wire;
use simulation::world::Commit;

impl Run<'_> {
    /// Tells the agents, and ends the recording.
    pub(super) fn finish(mut self, reason: String, ended_well: bool, wall: Duration) -> Result<Outcome, RunError> {
        let tick = self.world.tick();
        let mut ends = Vec::new();
        for agent in self.world.agents() {
            let observation = self.world.observe(agent, Commit::Committed);
            let parts = wire::observation_parts(&observation, Part::ENDED);
            ends.push(Asked { agent, since: Commit::Committed, parts });
        }
        self.desk.end_steps("the run has ended");
        let told: Vec<Asked> = ends.iter().filter(|end| !self.lost.contains(&end.agent)).cloned().collect();
        // The agents come first: what becomes of the recording is not their affair.
        let mut meanwhile = Meanwhile { watcher: self.watcher, log: &mut self.log, stop: &AtomicBool::new(false) };
        self.exchange.farewell(tick, &told, FAREWELL, &mut meanwhile)?;
        for Asked { agent, parts, .. } in &ends {
            for part in parts {
                self.log.write(Kind::Observation(*agent), tick, part)?;
            }
        }
        let digest = self.chain.digest();
        let progress = wire::progress(&mut self.world);
        let result = maes_msgs::Result {
            header: progress.header,
            tick: tick.0,
            reason,
            explored: progress.explored,
            covered: progress.covered,
            explored_by: progress.explored_by,
            covered_by: progress.covered_by,
            distance_m: progress.distance_m,
            believed_by: progress.believed_by,
            counters: self.counters(),
            digest: digest.0,
        };
        self.record_digest()?;
        self.record_progress()?;
        self.log.write(Kind::Result, tick, &result)?;
        self.show_end(&result, ended_well);
        self.log.finish()?;
        Ok(Outcome { result, digest, wall })
    }

    fn counters(&self) -> Vec<Counter> {
        let totals = self.world.totals();
        let counter = |name: &str, value| Counter { name: name.to_owned(), value };
        let mut counters = vec![
            counter("free_cells", self.world.coverage().free_cells() as u64),
            counter("decisions", self.decisions),
            counter("failed_searches", self.failed_searches.iter().copied().map(u64::from).sum()),
            counter("scans", totals.scans),
            counter("scans_cast", totals.scans_cast),
            counter("collisions", totals.collisions),
            counter("parcels_sent", totals.parcels_sent),
            counter("parcels_delivered", totals.parcels_delivered),
            counter("parcels_out_of_contact", totals.parcels_out_of_contact),
            counter("parcels_inbox_full", totals.parcels_inbox_full),
            counter("parcel_bytes_delivered", totals.parcel_bytes_delivered),
            counter("agents_dropped", self.lost.len() as u64),
        ];
        // What a scenario has no use for is not spoken of.
        let communication = &self.scenario.communication;
        counters.extend((communication.loss > 0.0).then(|| counter("parcels_lost_radio", totals.parcels_lost_radio)));
        if communication.bytes_per_s.is_finite() {
            counters.push(counter("parcels_queue_full", totals.parcels_queue_full));
        }
        if communication.relays.per_agent > 0 {
            counters.extend([
                counter("relays_left", totals.relays_left),
                counter("relays_refused", totals.relays_refused),
                counter("relay_writings", totals.relay_writings),
                counter("relay_writings_lost", totals.relay_writings_lost),
                counter("relay_readings", totals.relay_readings),
            ]);
        }
        let kinds = totals.parcel_bytes_by_kind.iter();
        counters.extend(kinds.map(|(kind, &bytes)| counter(&format!("parcel_bytes_delivered_kind_{kind}"), bytes)));
        let milestones = self.world.coverage().milestones();
        counters.extend(milestones.map(|(permille, tick)| counter(&format!("{MILESTONE_COUNTER}{permille}"), tick.0)));
        // Of a run that nobody has intervened in nothing says that somebody might have.
        let interventions = self.interventions;
        counters.extend((interventions > 0).then(|| counter("interventions", interventions)));
        counters.extend(self.exchange.refusals().map(|(name, value)| counter(name, value)));
        counters
    }
}
