//! The switch: which frame goes to which port, and when.
//!
//! A function of the frames and the times that it is given; it does no input or output.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::time::Duration;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Frames that may be on their way at a time; more are dropped, as the queue of a device does.
const QUEUE_MAX: usize = 20_000;

/// How a link treats frames; each direction the same.
#[derive(Debug, Clone, Default)]
pub struct Link {
    /// From one port to another.
    pub delay: Duration,
    /// Share of the frames that are lost.
    pub loss: f64,
    /// Share of the frames that take up to four times as long, so that others overtake them.
    pub reordered: f64,
    pub outage: Option<Outage>,
    /// Of the draws.
    pub seed: u64,
}

/// A time without any frame.
#[derive(Debug, Clone, Copy)]
pub struct Outage {
    /// It begins after so many frames.
    pub after_frames: u64,
    pub lasts: Duration,
}

/// What has happened to the frames so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames that a host has sent.
    pub sent: u64,
    /// Sent frames that were lost at random.
    pub lost: u64,
    /// Sent frames that were lost in the outage.
    pub cut: u64,
    /// Sent frames that others could overtake.
    pub held_back: u64,
    /// Sent frames that a full queue dropped.
    pub dropped: u64,
}

/// A frame on its way; ordered by time, and frames of one time as they were sent.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct InFlight {
    due: Duration,
    number: u64,
    ports: Vec<usize>,
    frame: Vec<u8>,
}

/// A switch with some ports and the same link at each.
#[derive(Debug)]
pub(crate) struct Switch {
    link: Link,
    ports: usize,
    random: ChaCha8Rng,
    in_flight: BinaryHeap<Reverse<InFlight>>,
    /// The port behind which an Ethernet address was last seen.
    seen: BTreeMap<[u8; 6], usize>,
    cut_until: Option<Duration>,
    counts: Counts,
}

impl Switch {
    pub(crate) fn new(link: Link, ports: usize) -> Self {
        let random = ChaCha8Rng::seed_from_u64(link.seed);
        Self {
            link,
            ports,
            random,
            in_flight: BinaryHeap::new(),
            seen: BTreeMap::new(),
            cut_until: None,
            counts: Counts::default(),
        }
    }

    pub(crate) fn counts(&self) -> Counts {
        self.counts
    }

    /// Takes a frame that a host has sent; `now` is the time since the beginning.
    pub(crate) fn take(&mut self, now: Duration, from: usize, frame: &[u8]) {
        let (Some(target), Some(source)) = (address(frame, 0), address(frame, 6)) else { return };
        self.seen.insert(source, from);
        let ports = match self.seen.get(&target).filter(|_| !is_group(&target)) {
            Some(&port) => vec![port],
            None => (0..self.ports).collect(),
        };
        let ports: Vec<usize> = ports.into_iter().filter(|&port| port != from).collect();
        self.counts.sent += 1;
        let (is_lost, is_held_back) = (self.draw() < self.link.loss, self.draw() < self.link.reordered);
        let extra = if is_held_back { 3.0 * self.draw() } else { 0.0 };
        if self.is_cut(now) {
            self.counts.cut += 1;
        } else if is_lost {
            self.counts.lost += 1;
        } else if self.in_flight.len() >= QUEUE_MAX {
            self.counts.dropped += 1;
        } else {
            self.counts.held_back += u64::from(is_held_back);
            let due = now + self.link.delay.mul_f64(1.0 + extra);
            let frame = frame.to_vec();
            self.in_flight.push(Reverse(InFlight { due, number: self.counts.sent, ports, frame }));
        }
    }

    /// The next frame that has arrived, with the ports that it goes to.
    pub(crate) fn arrived(&mut self, now: Duration) -> Option<(Vec<usize>, Vec<u8>)> {
        let Reverse(next) = self.in_flight.peek()?;
        if next.due > now {
            return None;
        }
        self.in_flight.pop().map(|Reverse(next)| (next.ports, next.frame))
    }

    /// When the next frame arrives, if one is on its way.
    pub(crate) fn next_arrival(&self) -> Option<Duration> {
        self.in_flight.peek().map(|Reverse(next)| next.due)
    }

    fn is_cut(&mut self, now: Duration) -> bool {
        if let Some(outage) = self.link.outage
            && self.cut_until.is_none()
            && self.counts.sent > outage.after_frames
        {
            self.cut_until = Some(now + outage.lasts);
        }
        self.cut_until.is_some_and(|until| now < until)
    }

    /// From 0 to less than 1.
    fn draw(&mut self) -> f64 {
        f64::from(self.random.next_u32()) / (f64::from(u32::MAX) + 1.0)
    }
}

fn address(frame: &[u8], start: usize) -> Option<[u8; 6]> {
    frame.get(start..start + 6)?.try_into().ok()
}

/// Whether it is a multicast or broadcast address.
fn is_group(address: &[u8; 6]) -> bool {
    address[0] & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    const BROADCAST: u8 = 0xff;

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// A frame from one host to another, numbered.
    fn frame(to: u8, from: u8, number: u8) -> Vec<u8> {
        [[to, 0, 0, 0, 0, to], [0, 0, 0, 0, 0, from], [number; 6]].concat()
    }

    fn numbers(switch: &mut Switch, now: Duration) -> Vec<u8> {
        std::iter::from_fn(|| switch.arrived(now)).map(|(_, frame)| frame[12]).collect()
    }

    #[test]
    fn frames_arrive_after_the_delay_at_the_ports_of_their_address() {
        let mut switch = Switch::new(Link { delay: ms(5), ..Link::default() }, 3);
        switch.take(ms(0), 0, &frame(BROADCAST, 1, 0));
        assert_eq!(switch.arrived(ms(4)), None);
        assert_eq!(switch.next_arrival(), Some(ms(5)));
        assert_eq!(switch.arrived(ms(5)), Some((vec![1, 2], frame(BROADCAST, 1, 0))));
        // An unknown address goes everywhere, a known one to its port.
        switch.take(ms(6), 2, &[&[0, 0, 0, 0, 0, 9][..], &[0, 0, 0, 0, 0, 3], &[0; 6]].concat());
        assert_eq!(switch.arrived(ms(11)).map(|(ports, _)| ports), Some(vec![0, 1]));
        switch.take(ms(11), 1, &[&[0, 0, 0, 0, 0, 3][..], &[0, 0, 0, 0, 0, 2], &[0; 6]].concat());
        assert_eq!(switch.arrived(ms(16)).map(|(ports, _)| ports), Some(vec![2]));
        assert_eq!(switch.counts(), Counts { sent: 3, ..Counts::default() });
    }

    #[test]
    fn losses_and_reordering_have_their_shares() {
        let link = Link { delay: ms(1), loss: 0.1, reordered: 0.2, seed: 7, ..Link::default() };
        let run = || {
            let mut switch = Switch::new(link.clone(), 2);
            for number in 0..10_000_u32 {
                switch.take(Duration::from_micros(100) * number, 0, &frame(BROADCAST, 1, (number % 256) as u8));
            }
            (switch.counts(), numbers(&mut switch, ms(10_000)))
        };
        let (counts, numbers) = run();
        assert_eq!(run(), (counts, numbers.clone()), "the same seed draws the same");
        assert!((900..1100).contains(&counts.lost), "{counts:?}");
        assert!((1700..1900).contains(&counts.held_back), "a fifth of those that are not lost: {counts:?}");
        assert_eq!(numbers.len() as u64, counts.sent - counts.lost);
        assert!(numbers.windows(2).any(|pair| pair[0].wrapping_sub(pair[1]) < 128), "some overtake others");
    }

    #[test]
    fn outage_begins_after_its_frames_and_ends_after_its_time() {
        let outage = Some(Outage { after_frames: 2, lasts: ms(100) });
        let mut switch = Switch::new(Link { outage, ..Link::default() }, 2);
        for (number, at) in [(0, 0), (1, 10), (2, 20), (3, 119), (4, 120)] {
            switch.take(ms(at), 0, &frame(BROADCAST, 1, number));
        }
        assert_eq!(numbers(&mut switch, ms(200)), [0, 1, 4]);
        assert_eq!(switch.counts().cut, 2);
    }

    #[test]
    fn frames_on_their_way_are_bounded_and_short_ones_ignored() {
        let mut switch = Switch::new(Link { delay: ms(1), ..Link::default() }, 2);
        for _ in 0..=QUEUE_MAX {
            switch.take(ms(0), 0, &frame(BROADCAST, 1, 0));
        }
        assert_eq!(switch.counts().dropped, 1);
        switch.take(ms(0), 0, &[0; 11]);
        assert_eq!(switch.counts().sent, QUEUE_MAX as u64 + 1);
    }
}
