//! Reports to a base station: a wrapper of a controller, for bases that are far away.
//!
//! A base says how many free cells it knows ([`AtBase::Knows`]). An agent whose own number differs
//! has cells to report, or lacks some: in contact the exchange of maps makes the two equal. It goes
//! back towards the base once it has had them for `report_s`, and for at least four times as long
//! as the way takes, or as soon as its controller rests. In contact it waits until the base has the
//! map; then its controller decides again.
//!
//! **Couriers.** On its way it broadcasts [`AtBase::Courier`] to all that it meets. They share
//! their maps with it, and put off their own reports by `report_s`: one of those who meet reports
//! for all. Only the base says what it knows, so what a courier that never arrives has is reported
//! later.
//!
//! **Relay chain.** With `relay-chain` an agent leaves a relay where it is about to lose sight of
//! the base and of all relays, so that contact follows it; once it carries none, it reports as
//! without.
//!
//! Invariants: without base stations in the run, or with `to_base = off`, the wrapper is not there;
//! those of [`Wrapped`].

use std::ops::RangeInclusive;

use msgs::ids::{AgentId, Tick};
use nalgebra::Point3;
use protocol::event_mask::EventMask;
use protocol::message_type::MessageType;
use protocol::observation::{Contact, Peer};
use rand_chacha::ChaCha8Rng;
use voxels::Cell;

use super::relays::{RELAY_MARK, Relays};
use super::settings::{SettingError, Settings};
use super::wrapped::{Wrapped, rests};
use super::{Controller, Ctx, Failure, collision_recovery};
use agent::command::{Command, Motion, Stage, WakeCondition};
use agent::navigation::{NavigationStatus, SearchTime};
use agent::observation::{Observation, RunInfo};
use agent::path::{Goal, Neighbours, Search};

const VERSION: u8 = 1;

/// The purpose of its random stream.
const STREAM: &str = "report-to-base";

/// Ticks at rest after which its controller has nothing to do: 2 s.
const REST_TICKS: u64 = 100;

/// Ticks in contact with a base within which maps are not compared: an exchange takes four.
const EXCHANGE_TICKS: u64 = 10;

/// Longest wait in contact with a base, ticks: 30 s. Maps may never be equal if sensors err.
const HAND_OVER_TICKS: u64 = 1500;

/// Ticks between two decisions about a report that is due in contact with a base: 5 s.
const RETRY_TICKS: u64 = 250;

/// Ticks between two looks at where the next relay has to be.
const RELAY_TICKS: u64 = 10;

/// Least time with cells to report, as a multiple of the time of the way back.
const WAYS_MIN: u64 = 4;

/// Ticks to hold after a collision on the way.
const HOLD_TICKS: RangeInclusive<u64> = 5..=40;

/// The content of a message [`MessageType::AtBase`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum AtBase {
    /// The sender, a base station, knows so many free cells.
    Knows(u32),
    /// The sender is about to report to a base, and will bring what it is sent.
    Courier,
}

impl AtBase {
    /// Adds it to a command, for all agents in contact.
    pub(super) fn broadcast(self, command: Command) -> Command {
        let mut bytes = vec![VERSION];
        if let Self::Knows(cells) = self {
            bytes.extend(cells.to_le_bytes());
        }
        command.with_message(None, MessageType::AtBase.number(), bytes)
    }

    /// The content of a message of this type; `None` if it is of another one.
    pub(super) fn decode(kind: u8, bytes: &[u8]) -> Option<Self> {
        match (kind == MessageType::AtBase.number(), bytes) {
            (true, [VERSION]) => Some(Self::Courier),
            (true, [VERSION, cells @ ..]) => Some(Self::Knows(u32::from_le_bytes(cells.try_into().ok()?))),
            _ => None,
        }
    }
}

/// How an agent reports.
#[derive(Debug)]
pub(super) struct Reporting {
    /// Whether it leaves relays; `None`: it does not report.
    leaves_relays: Option<bool>,
    report_ticks: u64,
    bases: Vec<AgentId>,
    rng: ChaCha8Rng,
}

impl Reporting {
    /// Settings: `to_base`, `off` (the default), `rendezvous` or `relay-chain`, and `report_s`.
    ///
    /// # Errors
    /// If a setting is out of range.
    pub(super) fn from_settings(
        settings: &mut Settings,
        agent: AgentId,
        run_info: &RunInfo,
    ) -> Result<Self, SettingError> {
        let leaves_relays = [None, Some(false), Some(true)];
        let leaves_relays = leaves_relays[settings.word("to_base", &["off", "rendezvous", "relay-chain"])?];
        let report_s = settings.number("report_s", 120.0, 1.0, 36_000.0)?;
        let rng = voxels::random_streams::stream(run_info.agents_seed, agent.0.into(), STREAM);
        let report_ticks = libm::round(report_s / Tick::TICK_S) as u64;
        Ok(Self { leaves_relays, report_ticks, bases: run_info.base_stations.clone(), rng })
    }

    /// A controller whose agent reports.
    pub(super) fn around(self, inner: Box<dyn Controller>) -> Box<dyn Controller> {
        match self.leaves_relays.filter(|_| !self.bases.is_empty()) {
            None => inner,
            Some(leaves_relays) => Box::new(ReportToBase::new(inner, Relays::switched(leaves_relays), self)),
        }
    }
}

/// A wrapped controller.
struct ReportToBase {
    inner: Wrapped,
    bases: Vec<AgentId>,
    report_ticks: u64,
    relays: Relays,
    rng: ChaCha8Rng,
    mode: Mode,
    /// Free cells that a base knows, as it has said last.
    known_at_base: Option<u32>,
    /// Where the base is that was last in contact, metres.
    base_at: Option<Point3<f64>>,
    /// Where the agent was then.
    contact_cell: Option<Cell>,
    /// When it last had as many free cells as the base.
    in_sync_at: Tick,
    /// When it last met a courier, or has given up.
    put_off: Tick,
    /// Before, the way back is not worth it.
    not_before: Tick,
}

/// What it is doing.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    /// Its controller decides; it has had nothing to do since `resting_since`.
    Exploring { resting_since: Option<Tick> },
    /// On the way to a base.
    Reporting,
    /// In contact with it.
    HandingOver { since: Tick },
}

impl ReportToBase {
    fn new(inner: Box<dyn Controller>, relays: Relays, reporting: Reporting) -> Self {
        let Reporting { report_ticks, bases, rng, .. } = reporting;
        Self {
            inner: Wrapped::new(inner),
            bases,
            report_ticks,
            relays,
            rng,
            mode: Mode::Exploring { resting_since: None },
            known_at_base: None,
            base_at: None,
            contact_cell: None,
            in_sync_at: Tick::ZERO,
            put_off: Tick::ZERO,
            not_before: Tick::ZERO,
        }
    }

    /// Takes in what the contacts and messages of an observation say of bases and couriers.
    fn note(&mut self, observation: &Observation, ctx: &Ctx<'_>) {
        for message in &observation.messages {
            let Peer::One(sender) = message.peer else { continue };
            match (AtBase::decode(message.kind, &message.data), self.bases.contains(&sender)) {
                (Some(AtBase::Knows(cells)), true) => self.known_at_base = Some(cells),
                (Some(AtBase::Courier), _) => self.put_off = observation.tick,
                _ => {}
            }
        }
        if let Some(base) = self.base_in_contact(observation) {
            (self.base_at, self.contact_cell) = (Some(base.position), Some(ctx.cell()));
        }
        if !self.has_unreported(ctx) {
            self.in_sync_at = observation.tick;
        }
    }

    fn base_in_contact<'o>(&self, observation: &'o Observation) -> Option<&'o Contact> {
        observation.contacts.iter().find(|contact| self.bases.contains(&contact.agent))
    }

    fn has_unreported(&self, ctx: &Ctx<'_>) -> bool {
        self.known_at_base != Some(ctx.map().free() as u32)
    }

    /// When it has to report what it knows now; `None`: not at all.
    fn report_at(&self, resting_since: Option<Tick>, ctx: &Ctx<'_>) -> Option<Tick> {
        if self.base_at.is_none() || !self.has_unreported(ctx) {
            return None;
        }
        let due = self.in_sync_at.after(self.report_ticks);
        let due = resting_since.map_or(due, |since| due.min(since.after(REST_TICKS)));
        let due = if resting_since.is_some() { due } else { due.max(self.not_before) };
        let is_put_off = self.put_off > Tick::ZERO;
        Some(if is_put_off { due.max(self.put_off.after(self.report_ticks)) } else { due })
    }

    /// Ticks that the way back takes at full speed; 0 if it knows none.
    fn way_ticks(&self, ctx: &Ctx<'_>) -> u64 {
        let goals: Vec<Cell> =
            self.base_at.map(|position| ctx.cell_near(&position)).into_iter().chain(self.contact_cell).collect();
        let graph = ctx.graph(Neighbours::TwentySix);
        let Some(path) = Search::new(graph, ctx.cell(), Goal::AnyOf(&goals)).run() else { return 0 };
        let legs = path.cells.windows(2).map(|leg| (ctx.place(leg[1]) - ctx.place(leg[0])).norm());
        (legs.sum::<f64>() / ctx.body().speed_max_m_s / Tick::TICK_S) as u64
    }

    fn exploring(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, also: EventMask) -> Command {
        let Mode::Exploring { mut resting_since } = self.mode else { unreachable!("it explores") };
        let tick = observation.tick;
        let is_at_base = self.base_in_contact(observation).is_some();
        if !is_at_base && self.report_at(resting_since, ctx).is_some_and(|due| tick >= due) {
            let worth_it = self.in_sync_at.after(WAYS_MIN * self.way_ticks(ctx));
            if resting_since.is_some() || tick >= worth_it {
                return self.report(observation, ctx);
            }
            self.not_before = worth_it;
        }
        let mut command = if also.is_empty() && !self.inner.is_due(observation) {
            self.inner.keep()
        } else {
            let command = self.inner.ask(observation, ctx, also);
            resting_since = rests(&command, observation).then(|| resting_since.unwrap_or(tick));
            command
        };
        self.mode = Mode::Exploring { resting_since };
        let step = observation.velocity_in_map_m_s;
        let ahead =
            step.try_normalize(1e-3).map(|direction| ctx.position() + direction * ctx.map().extent().cell_m() * 2.0);
        let bases = &self.bases;
        let counts = |contact: &Contact| bases.contains(&contact.agent);
        if self.relays.has_more(ctx) {
            if ahead.is_some_and(|ahead| self.relays.should_drop_within(observation, ctx, &[ahead], counts)) {
                command = command.with_relay(RELAY_MARK, Vec::new());
            }
            command.wake.at = command.wake.at.min(tick.after(RELAY_TICKS));
        }
        if let Some(due) = self.report_at(resting_since, ctx) {
            // In contact with a base, maps are exchanged anyway.
            let least = if is_at_base { RETRY_TICKS } else { 1 };
            command.wake.at = command.wake.at.min(due.max(tick.after(least)));
        }
        command
    }

    /// Begins the way to a base, and says so to all in contact, if it knows one.
    fn report(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        self.mode = Mode::Reporting;
        let command = self.go(observation, ctx);
        let is_courier = self.mode == Mode::Reporting && !observation.contacts.is_empty();
        if is_courier { AtBase::Courier.broadcast(command) } else { command }
    }

    fn reporting(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        if self.base_in_contact(observation).is_some() {
            self.mode = Mode::HandingOver { since: observation.tick };
            return self.handing_over(observation, ctx, observation.tick);
        }
        let has_collided = observation.events.intersects(EventMask::COLLISION);
        let must_plan = !observation.is_active || observation.events.intersects(EventMask::REVISED);
        let command = if has_collided {
            collision_recovery::step_aside_for(HOLD_TICKS, &mut self.rng, ctx)
        } else if must_plan {
            self.go(observation, ctx)
        } else {
            Command::keep(WAKE_ON_THE_WAY)
        };
        let has_met = observation.events.intersects(EventMask::CONTACTS) && !observation.contacts.is_empty();
        if has_met && self.mode == Mode::Reporting { AtBase::Courier.broadcast(command) } else { command }
    }

    /// Goes to the base, or to where it was last in contact with it; if it knows no way, its
    /// controller decides again.
    fn go(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let base = self.base_at.map(|position| ctx.cell_near(&position));
        for goal in base.into_iter().chain(self.contact_cell) {
            if goal != ctx.cell()
                && let NavigationStatus::Go(motion) = ctx.go_to_cell(goal, SearchTime::Instant)
            {
                return Command::new(motion, WAKE_ON_THE_WAY)
                    .with_stage(Stage::Carrying)
                    .with_info("reports to the base");
            }
        }
        self.put_off = observation.tick;
        self.mode = Mode::Exploring { resting_since: None };
        self.exploring(observation, ctx, EventMask::TASK_DONE)
    }

    fn handing_over(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, since: Tick) -> Command {
        let tick = observation.tick;
        if self.base_in_contact(observation).is_none() {
            self.mode = Mode::Reporting;
            return self.go(observation, ctx);
        }
        let until = since.after(HAND_OVER_TICKS);
        if tick >= until || tick >= since.after(EXCHANGE_TICKS) && !self.has_unreported(ctx) {
            self.in_sync_at = tick;
            self.mode = Mode::Exploring { resting_since: None };
            return self.exploring(observation, ctx, EventMask::TASK_DONE);
        }
        let at = if tick < since.after(EXCHANGE_TICKS) { since.after(EXCHANGE_TICKS) } else { until };
        Command::new(Motion::Stop, WakeCondition { at, events: EventMask::MESSAGE | EventMask::CONTACTS })
            .with_stage(Stage::Carrying)
            .with_info("hands over to the base")
    }
}

/// On the way to a base.
const WAKE_ON_THE_WAY: WakeCondition = WakeCondition {
    at: WakeCondition::TASK_DONE.at,
    events: WakeCondition::TASK_DONE.events.union(EventMask::CONTACTS),
};

impl Controller for ReportToBase {
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        self.note(observation, ctx);
        self.inner.note(observation);
        match self.mode {
            Mode::Exploring { .. } => self.exploring(observation, ctx, EventMask::empty()),
            Mode::Reporting => self.reporting(observation, ctx),
            Mode::HandingOver { since } => self.handing_over(observation, ctx, since),
        }
    }

    fn covers(&self) -> bool {
        self.inner.covers()
    }

    fn is_blocked(&self) -> bool {
        self.inner.is_blocked()
    }

    fn failure(&mut self) -> Option<Failure> {
        self.inner.failure()
    }
}

#[cfg(test)]
mod tests;
