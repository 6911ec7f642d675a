//! The contacts between the radios of a team, decided for each pair on demand.
//!
//! Between two ticks a radio moves by a few hundredths of a cell, so a pair is not decided anew in
//! each tick. A decision comes with a *slack*: while neither radio has moved by more than that
//! since, it holds ([`voxels::sight`]). Each radio has an odometer, and each pair the readings up
//! to which its decision holds, so a tick costs two comparisons for most pairs, of numbers that lie
//! side by side for all pairs of an agent. Of a pair that walls
//! separate, the table keeps a box of them: while the segment between the two crosses it deep
//! enough, nothing else is looked at.
//!
//! The contacts of each agent are a row of bits, which is brought up to date at most once in a
//! tick.
//!
//! Invariant: the answers are those of [`ContactModel::joins`] for the present positions.

use std::ops::Range;

use msgs::ids::AgentId;
use nalgebra::Point3;
use voxels::{Grid, OpenSpace, Sight, Terrain, WallBox, bits, bits_of, sight};

use super::ContactModel;

/// Greatest slack of a line of sight, cells. A greater one holds for longer, and takes longer to
/// find.
const SLACK_CELLS_MAX: f64 = 1.5;

/// Distance after which a slack is searched for again where there was none, cells: the bodies, half
/// a cell wide, pass walls at a distance of about as much.
const TIGHT_CELLS: f64 = 0.4;

/// Pairs of an agent that are looked at together; with a decision that no longer holds, one by one.
const AT_ONCE: usize = 64;

/// Share of a difference of distances that is left to rounding.
const ROUNDING: f64 = 1e-6;

/// An odometer above this reading is set back, so that small movements are not lost in rounding.
const ODOMETER_M_MAX: f64 = 1e6;

/// The contacts between radios.
#[derive(Debug, Clone)]
pub struct ContactTable {
    radios: Vec<Radio>,
    /// Length of the path of each radio or a little more, metres.
    odometers_m: Vec<f64>,
    /// By the lower agent and the higher one: see [`ContactTable::slot`].
    pairs: Vec<Pair>,
    /// By agent and other agent the reading of the odometer of the first one up to which the
    /// decision on the pair holds, metres; infinity for an agent and itself.
    own_until_m: Vec<f64>,
    /// The transposed matrix: the readings of the odometer of the other agent.
    other_until_m: Vec<f64>,
    /// For each agent a bit for each agent that was in contact when the pair was last decided.
    rows: Vec<u64>,
    /// By agent the update for which its row was last brought up to date.
    up_to_date: Vec<u64>,
    /// Number of updates.
    updates: u64,
    /// By agent the relay networks in contact, ascending; empty without relays.
    networks: Vec<Vec<usize>>,
}

/// What contacts depend on, apart from the terrain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Radio {
    /// Metres, frame `map`.
    pub position: Point3<f64>,
    /// Whether it works; one that does not has no contacts.
    pub is_on_air: bool,
}

/// What contacts are decided by, apart from the radios.
#[derive(Debug, Clone, Copy)]
pub struct ContactRules<'w> {
    /// The model.
    pub model: &'w ContactModel,
    /// The world.
    pub terrain: &'w Grid<Terrain>,
    /// That of the terrain.
    pub open_space: &'w OpenSpace,
}

/// What has been measured between two radios.
#[derive(Debug, Clone, Copy)]
struct Pair {
    /// Sum of the two odometers up to which a line of sight has been found to have no slack,
    /// metres: another search would find none.
    tight_until_m: f64,
    /// Walls that were found between the two.
    walls: Option<WallBox>,
}

impl Pair {
    /// Nothing is known.
    const UNKNOWN: Self = Self { tight_until_m: f64::NEG_INFINITY, walls: None };
}

impl ContactTable {
    /// A table for these radios, by agent. `networks` are the relay networks in contact with each
    /// agent, ascending; empty without relays.
    #[must_use]
    pub fn new(radios: Vec<Radio>, networks: Vec<Vec<usize>>) -> Self {
        let agents = radios.len();
        let mut table = Self {
            radios,
            odometers_m: vec![0.0; agents],
            pairs: vec![Pair::UNKNOWN; agents * agents.saturating_sub(1) / 2],
            own_until_m: vec![0.0; agents * agents],
            other_until_m: vec![0.0; agents * agents],
            rows: vec![0; agents * agents.div_ceil(64)],
            up_to_date: vec![0; agents],
            updates: 1,
            networks,
        };
        table.decide_none();
        table
    }

    /// No decision holds any longer.
    fn decide_none(&mut self) {
        let agents = self.radios.len();
        for until_m in [&mut self.own_until_m, &mut self.other_until_m] {
            until_m.fill(f64::NEG_INFINITY);
            until_m.iter_mut().step_by(agents + 1).for_each(|itself| *itself = f64::INFINITY);
        }
    }

    /// Continues with radios that may have moved, in the same terrain with the same contact model.
    pub fn update(&mut self, radios: impl Iterator<Item = Radio>, networks: Vec<Vec<usize>>) {
        self.updates += 1;
        if networks != self.networks {
            self.decide_none();
            self.networks = networks;
        }
        for (agent, radio) in radios.enumerate() {
            let before = std::mem::replace(&mut self.radios[agent], radio);
            if before.position != radio.position {
                // Rounded up, so that no movement is too small to be counted: a line of sight that
                // runs along an edge has no slack at all.
                let moved_m = (radio.position - before.position).norm();
                self.odometers_m[agent] = (self.odometers_m[agent] + moved_m).next_up();
            }
            // Also if it is not a number.
            let is_readable = self.odometers_m[agent] <= ODOMETER_M_MAX;
            if before.is_on_air != radio.is_on_air || !is_readable {
                self.forget(agent);
            }
        }
    }

    /// Forgets what is known of an agent's pairs, and sets its odometer back.
    fn forget(&mut self, agent: usize) {
        self.odometers_m[agent] = 0.0;
        for other in (0..self.radios.len()).filter(|&other| other != agent) {
            let slot = self.slot(agent.min(other), agent.max(other));
            self.pairs[slot] = Pair::UNKNOWN;
            self.hold([agent, other], [f64::NEG_INFINITY; 2]);
        }
    }

    /// Where the pair of two agents is, the lower one first.
    fn slot(&self, low: usize, high: usize) -> usize {
        low * (2 * self.radios.len() - low - 1) / 2 + high - low - 1
    }

    /// The decision on a pair holds up to these readings of the odometers, metres.
    fn hold(&mut self, [one, other]: [usize; 2], until_m: [f64; 2]) {
        let agents = self.radios.len();
        let [there, back] = [one * agents + other, other * agents + one];
        (self.own_until_m[there], self.other_until_m[there]) = (until_m[0], until_m[1]);
        (self.own_until_m[back], self.other_until_m[back]) = (until_m[1], until_m[0]);
    }

    /// Words of a row.
    fn words(&self) -> usize {
        self.radios.len().div_ceil(64)
    }

    /// The agents in contact with `agent`, ascending.
    pub fn of(&mut self, agent: AgentId, rules: ContactRules<'_>) -> impl Iterator<Item = AgentId> + '_ {
        bits_of(self.row(agent, rules)).map(AgentId::from_index)
    }

    /// The agents in contact with `agent`, one bit each.
    pub fn row(&mut self, agent: AgentId, rules: ContactRules<'_>) -> &[u64] {
        let one = agent.index();
        if self.up_to_date[one] != self.updates {
            let agents = self.radios.len();
            for first in (0..agents).step_by(AT_ONCE) {
                let others = first..agents.min(first + AT_ONCE);
                if !self.hold_all(one, others.clone()) {
                    others.for_each(|other| self.decide(one, other, rules));
                }
            }
            self.up_to_date[one] = self.updates;
        }
        let words = self.words();
        &self.rows[one * words..][..words]
    }

    /// Whether `agent` is in contact with one that is not `among` these, one bit each. Pairs with
    /// those are not decided.
    pub fn has_contact_not_among(&mut self, agent: AgentId, among: &[u64], rules: ContactRules<'_>) -> bool {
        let agents = self.radios.len();
        let one = agent.index();
        // As after most ticks.
        if self.up_to_date[one] == self.updates || self.hold_all(one, 0..agents) {
            self.up_to_date[one] = self.updates;
            return self.row(agent, rules).iter().zip(among).any(|(row, listed)| row & !listed != 0);
        }
        among.iter().enumerate().any(|(word, &listed)| {
            // The last word has bits of no agent.
            let mut others = bits(!listed).map(|bit| 64 * word + bit as usize).take_while(|&other| other < agents);
            others.any(|other| {
                let other = AgentId::from_index(other);
                other != agent && self.in_contact(agent, other, rules)
            })
        })
    }

    /// Whether two different agents are in contact, directly or over a relay network in contact
    /// with both.
    pub fn in_contact(&mut self, one: AgentId, other: AgentId, rules: ContactRules<'_>) -> bool {
        let [one, other] = [one, other].map(AgentId::index);
        if self.up_to_date[one] != self.updates && self.up_to_date[other] != self.updates {
            self.decide(one, other, rules);
        }
        self.rows[one * self.words() + other / 64] >> (other % 64) & 1 != 0
    }

    /// Whether the decisions on some pairs of an agent hold.
    fn hold_all(&self, one: usize, others: Range<usize>) -> bool {
        let own_m = self.odometers_m[one];
        let row = one * self.radios.len();
        let pairs = row + others.start..row + others.end;
        let until_m = self.own_until_m[pairs.clone()].iter().zip(&self.other_until_m[pairs]);
        // Without a branch for each pair.
        let holds = |(&odometer_m, (&own_until_m, &other_until_m)): (&f64, (&f64, &f64))| {
            (own_m <= own_until_m) & (odometer_m <= other_until_m)
        };
        self.odometers_m[others].iter().zip(until_m).map(holds).fold(true, |all, holds| all & holds)
    }

    /// Brings the bits of two agents up to date.
    fn decide(&mut self, one: usize, other: usize, rules: ContactRules<'_>) {
        if !self.hold_all(one, other..other + 1) {
            self.decide_anew([one.min(other), one.max(other)], rules);
        }
    }

    /// Decides on a pair, the lower agent first.
    fn decide_anew(&mut self, [low, high]: [usize; 2], rules: ContactRules<'_>) {
        let odometers_m = [low, high].map(|agent| self.odometers_m[agent]);
        let [one, other] = [low, high].map(|agent| self.radios[agent]);
        let (is_in_contact, slack_m) = if !(one.is_on_air && other.is_on_air) {
            (false, f64::INFINITY)
        } else if self.share_a_network(low, high) {
            (true, f64::INFINITY)
        } else {
            let slot = self.slot(low, high);
            let pair = &mut self.pairs[slot];
            pair.contact(odometers_m[0] + odometers_m[1], rules, [&one.position, &other.position])
        };
        self.hold([low, high], odometers_m.map(|odometer_m| odometer_m + slack_m));
        let words = self.words();
        for (one, other) in [(low, high), (high, low)] {
            let word = &mut self.rows[one * words + other / 64];
            *word = *word & !(1 << (other % 64)) | u64::from(is_in_contact) << (other % 64);
        }
    }

    fn share_a_network(&self, one: usize, other: usize) -> bool {
        match (self.networks.get(one), self.networks.get(other)) {
            (Some(one), Some(other)) => one.iter().any(|network| other.binary_search(network).is_ok()),
            _ => false,
        }
    }
}

impl Pair {
    /// Whether radios at two positions are in contact, and how far both can move so that this
    /// surely holds, metres. `odometers_m` is the sum of both.
    fn contact(&mut self, odometers_m: f64, rules: ContactRules<'_>, [one, other]: [&Point3<f64>; 2]) -> (bool, f64) {
        let distance_m = (other - one).norm();
        // Each of the two can change the distance by as much as it moves.
        let to_range_m = |range_m: f64| {
            let apart_m = (range_m - distance_m).abs() - ROUNDING * distance_m;
            (apart_m * (0.5 - ROUNDING)).max(0.0)
        };
        match rules.model {
            ContactModel::LineOfSightAndRange { range_m } if distance_m <= *range_m => {
                let (is_seen, slack_m) = self.line_of_sight(odometers_m, rules, [one, other]);
                // Walls hide at any distance.
                (is_seen, if is_seen { slack_m.min(to_range_m(*range_m)) } else { slack_m })
            }
            ContactModel::LineOfSightAndRange { range_m } => (false, to_range_m(*range_m)),
            ContactModel::Range { range_m } => (distance_m <= *range_m, to_range_m(*range_m)),
            ContactModel::Global => (true, f64::INFINITY),
            ContactModel::Attenuated(_) => (rules.model.joins(rules.terrain, one, other), 0.0),
        }
    }

    fn line_of_sight(
        &mut self,
        odometers_m: f64,
        rules: ContactRules<'_>,
        [one, other]: [&Point3<f64>; 2],
    ) -> (bool, f64) {
        let ContactRules { terrain, open_space, .. } = rules;
        let extent = terrain.extent();
        if let Some(walls) = &self.walls {
            let slack_m = walls.slack_m(extent, one, other);
            if slack_m > 0.0 {
                return (false, slack_m);
            }
        }
        let is_tight = odometers_m <= self.tight_until_m;
        match sight(terrain, open_space, one, other, if is_tight { 0.0 } else { SLACK_CELLS_MAX }) {
            Sight::Clear { slack_m } => {
                if slack_m == 0.0 && !is_tight {
                    self.tight_until_m = odometers_m + TIGHT_CELLS * extent.cell_m();
                }
                (true, slack_m)
            }
            Sight::Wall(wall) => {
                let walls = WallBox::around(terrain, wall);
                self.walls = Some(walls);
                (false, walls.slack_m(extent, one, other).max(0.0))
            }
            Sight::Undefined => (false, 0.0),
        }
    }
}
