//! The counters of the result.

use msgs::counters::CounterName;
use msgs::maes_msgs::Counter;
use world::energy::EnergyTotals;
use world::localisation::DriftTotals;

use super::Engine;

impl Engine<'_> {
    /// The counters of the result, without those of refused messages.
    pub(in crate::session) fn counters(&self) -> Vec<Counter> {
        let totals = self.world.totals();
        let mut counters = vec![
            Counter::new(CounterName::FreeCells, self.world.coverage().free_cells() as u64),
            Counter::new(CounterName::Decisions, self.decisions),
            Counter::new(CounterName::FailedSearches, self.failed_searches.iter().copied().map(u64::from).sum()),
            Counter::new(CounterName::Scans, totals.scans.due()),
            Counter::new(CounterName::ScansCast, totals.scans.cast()),
            Counter::new(CounterName::Collisions, totals.collisions),
            Counter::new(CounterName::MessagesSent, totals.messages_sent),
            Counter::new(CounterName::MessagesDelivered, totals.messages_delivered),
            Counter::new(CounterName::MessagesOutOfContact, totals.messages_out_of_contact),
            Counter::new(CounterName::MessagesInboxFull, totals.messages_inbox_full),
            Counter::new(CounterName::MessageBytesDelivered, totals.message_bytes_delivered),
            Counter::new(CounterName::AgentsDropped, self.lost.difference(&self.retired).count() as u64),
        ];
        let map_changes = u64::from(self.world.map_revision());
        // Counters of features that the scenario does not use are left out.
        let radios = || std::iter::once(self.scenario).chain(&self.changed).map(|held| &held.communication);
        let communication = &self.scenario.communication;
        counters.extend(
            radios()
                .any(|radio| radio.loss > 0.0)
                .then(|| Counter::new(CounterName::MessagesLostRadio, totals.messages_lost_radio)),
        );
        if radios().any(|radio| radio.bytes_per_s.is_finite()) {
            counters.push(Counter::new(CounterName::MessagesQueueFull, totals.messages_queue_full));
        }
        if communication.relays.per_agent > 0 {
            counters.extend([
                Counter::new(CounterName::RelaysLeft, totals.relays_left),
                Counter::new(CounterName::RelaysRefused, totals.relays_refused),
                Counter::new(CounterName::RelayWritings, totals.relay_writings),
                Counter::new(CounterName::RelayWritingsLost, totals.relay_writings_lost),
                Counter::new(CounterName::RelayReadings, totals.relay_readings),
            ]);
        }
        let kinds = totals.message_bytes_by_kind.iter();
        counters.extend(kinds.map(|(kind, &bytes)| Counter::new(CounterName::MessageBytesOfType(*kind), bytes)));
        let milestones = self.world.coverage().milestones();
        counters
            .extend(milestones.map(|(permille, tick)| Counter::new(CounterName::TickExplored { permille }, tick.0)));
        let attainable = self.world.attainable_share();
        counters.extend(attainable.map(|share| Counter::new(CounterName::AttainablePpm, (share * 1e6).round() as u64)));
        if let Some(EnergyTotals { used_j, ran_empty, home_at }) = self.world.energy_totals() {
            let used = Counter::new(CounterName::EnergyUsed, (used_j * 1e3).round() as u64);
            counters.extend([used, Counter::new(CounterName::RanEmpty, ran_empty)]);
            counters.extend(home_at.map(|tick| Counter::new(CounterName::TickHome, tick.0)));
        }
        let known_at_base_since = self.world.coverage().known_at_base_since();
        counters.extend(known_at_base_since.map(|tick| Counter::new(CounterName::TickKnownAtBase, tick.0)));
        if let Some(DriftTotals { position_error_m, map_errors, blocks, closures }) = self.world.drift_totals() {
            counters.extend([
                Counter::new(CounterName::PositionError, (position_error_m * 1e6).round() as u64),
                Counter::new(CounterName::MapCells, map_errors.cells()),
                Counter::new(CounterName::MapCellsOffBy1, map_errors.off_by_1),
                Counter::new(CounterName::MapCellsOffBy2, map_errors.off_by_2),
                Counter::new(CounterName::MapCellsOffByMore, map_errors.off_by_more),
                Counter::new(CounterName::MapBlocks, blocks),
                Counter::new(CounterName::LoopClosures, closures),
            ]);
        }
        counters.extend((self.interventions > 0).then(|| Counter::new(CounterName::Interventions, self.interventions)));
        counters.extend((map_changes > 0).then(|| Counter::new(CounterName::MapChanges, map_changes)));
        counters
    }
}
