//! A pacer that limits the real-time factor by delaying ticks. Wall time is an argument, in
//! nanoseconds since a fixed instant.

use msgs::ids::Tick;

use simulation::scenario::Rtf;

/// Delays ticks relative to a reference tick and its wall time.
#[derive(Debug)]
pub(super) struct Pacer {
    rtf: Rtf,
    from: Tick,
    begun_ns: u64,
}

impl Pacer {
    /// A pacer whose reference is tick 0 at wall time 0.
    #[must_use]
    pub(super) fn new(rtf: Rtf) -> Self {
        Self { rtf, from: Tick::ZERO, begun_ns: 0 }
    }

    /// The limit of the real-time factor.
    #[must_use]
    pub(super) fn rtf(&self) -> Rtf {
        self.rtf
    }

    /// Sets the limit, and makes `tick` at `wall_ns` the reference.
    pub(super) fn set_rtf(&mut self, rtf: Rtf, tick: Tick, wall_ns: u64) {
        self.rtf = rtf;
        self.restart(tick, wall_ns);
    }

    /// Makes `tick` at `wall_ns` the reference, so that a delay or a lead from before is dropped.
    pub(super) fn restart(&mut self, tick: Tick, wall_ns: u64) {
        self.from = tick;
        self.begun_ns = wall_ns;
    }

    /// Wall time until `tick` may begin, ns; `None` if it may begin now.
    #[must_use]
    pub(super) fn wait_ns(&self, tick: Tick, wall_ns: u64) -> Option<u64> {
        let Rtf::Limit(limit) = self.rtf else {
            return None;
        };
        let passes_ns = tick.time_ns().saturating_sub(self.from.time_ns()) as f64 / limit;
        // The cast saturates: a longer time is infinite.
        let due_ns = self.begun_ns.saturating_add(passes_ns as u64);
        due_ns.checked_sub(wall_ns).filter(|&wait_ns| wait_ns > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn restart_discards_the_past() {
        let mut pace = Pacer::new(Rtf::Limit(1e-3));
        let second = Tick(50);
        assert_eq!(pace.wait_ns(second, 0), Some(1_000_000_000_000));
        assert_eq!(pace.wait_ns(second, 400_000_000_000), Some(600_000_000_000));
        pace.restart(second, 7);
        assert_eq!(pace.wait_ns(second, 7), None);
        assert_eq!(pace.wait_ns(second.after(1), 8), Some(19_999_999_999));
        pace.set_rtf(Rtf::Limit(2.0), second, 100);
        assert_eq!(pace.wait_ns(second.after(1), 100), Some(10_000_000));
        assert_eq!(pace.wait_ns(second.after(1), 10_000_100), None);
        pace.set_rtf(Rtf::MAX, second, 100);
        assert_eq!(pace.wait_ns(second.after(1), 100), None);
    }
}
