//! The way back to a base: its motion and what it costs, for controllers whose bodies need energy.
//!
//! The cost is that of the body at rest here: a body under way has to brake first
//! ([`turning_back_j`]). Other bodies are not on the map; those in contact can be avoided.

use std::f64::consts::PI;

use nalgebra::Point3;
use protocol::energy::{Energy, EnergyModel};
use protocol::limits::PATH_POINTS_MAX;
use voxels::Cell;

use super::Ctx;
use agent::bodies::{BodyModel, leg_s, legs_m, legs_s, nearest_share};
use agent::command::Motion;
use agent::navigation::NavigationStatus;
use agent::observation::Contact;
use agent::path::{Goal, Neighbours, Path, Search, direct, straighten_from};

/// Share by which the predicted energy is increased: bodies move in whole ticks, and make way.
const SPARE: f64 = 0.05;

/// Time that a leg may take longer than predicted, seconds ([`agent::bodies`]).
const SPARE_OF_LEG_S: f64 = 0.3;

/// Longest leg on a way around another body, metres.
const DETOUR_M: f64 = 6.0;

/// Cells that a search for a free place in a base looks at.
const PLACES_MAX: usize = 4096;

/// A way to a base.
#[derive(Debug, Clone, PartialEq)]
pub struct WayHome {
    /// The motion; [`Motion::Stop`] in a base.
    pub motion: Motion,
    /// Energy that the body draws on it, from rest, J; rather too much than too little.
    pub cost_j: f64,
}

/// Most energy that a body under way draws until it is at rest and turned round, J.
#[must_use]
pub fn turning_back_j(body: &BodyModel, model: &EnergyModel) -> f64 {
    let braking_s = body.speed_max_m_s / body.deceleration_m_s2.min(body.acceleration_m_s2);
    model.drawn_j(braking_s + leg_s(body, 0.0, PI), body.speed_max_m_s * braking_s)
}

impl Ctx<'_> {
    /// The energy of the body; `None` if bodies need none.
    #[must_use]
    pub fn energy(&self) -> Option<&Energy> {
        self.energy.as_ref()
    }

    /// Whether the centre of the body is in one of its bases.
    #[must_use]
    pub fn is_in_base(&self) -> bool {
        self.energy().is_some_and(|energy| energy.model.is_in_base(&self.position()))
    }

    /// The cheapest way to a base through cells known to be free: to the place nearest to its
    /// centre that has no agent in contact. `None` if there is none, or bodies need no energy.
    #[must_use]
    pub fn way_home(&self) -> Option<WayHome> {
        self.way_home_by(&|_| true, |path| self.follow(path))
    }

    /// [`Ctx::way_home`] around the agents in contact.
    #[must_use]
    pub fn way_home_around_contacts(&self) -> Option<WayHome> {
        let is_open = |cell| self.is_clear_of_contacts(&self.place(cell), &self.place(cell));
        self.way_home_by(&is_open, |path| match self.follow(path) {
            NavigationStatus::Go(Motion::Path(waypoints)) if self.do_legs_touch(self.position(), &waypoints) => {
                NavigationStatus::Go(Motion::Path(self.straightened_around_contacts(path)))
            }
            other => other,
        })
    }

    /// Few legs along a path around the agents in contact, which touch none of them.
    fn straightened_around_contacts(&self, path: &Path) -> Vec<Point3<f64>> {
        let (map, moves) = (self.map(), self.moves());
        let cells_ahead = libm::ceil(DETOUR_M / map.extent().cell_m()) as usize;
        let (mut at, mut rest) = (self.position(), &path.cells[..]);
        let mut waypoints = Vec::new();
        while rest.len() > 1 {
            let last = cells_ahead.clamp(1, rest.len() - 1);
            let is_clear = |&next: &usize| {
                direct(map, &at, rest[next], moves) && self.is_clear_of_contacts(&at, &self.place(rest[next]))
            };
            let next = (1..=last).rev().find(is_clear).unwrap_or(1);
            (at, rest) = (self.place(rest[next]), &rest[next..]);
            waypoints.push(at);
            let straight = straighten_from(&at, &Path { cells: rest.to_vec(), cost: 0 }, map, moves);
            if !self.do_legs_touch(at, &straight) {
                waypoints.extend(straight);
                break;
            }
        }
        waypoints
    }

    fn do_legs_touch(&self, from: Point3<f64>, waypoints: &[Point3<f64>]) -> bool {
        let mut legs = std::iter::once(&from).chain(waypoints).zip(waypoints);
        legs.any(|(from, to)| !self.is_clear_of_contacts(from, to))
    }

    fn way_home_by(
        &self,
        is_open: &dyn Fn(Cell) -> bool,
        motion_along: impl Fn(&Path) -> NavigationStatus,
    ) -> Option<WayHome> {
        let model = &self.energy()?.model;
        if self.is_in_base() {
            return Some(WayHome { motion: Motion::Stop, cost_j: 0.0 });
        }
        let goals: Vec<Cell> = (0..model.bases.len()).filter_map(|base| self.place_in_base(model, base)).collect();
        let graph = self.graph(Neighbours::TwentySix);
        let path = Search::new(graph, self.cell(), Goal::AnyOf(&goals)).within(is_open).run()?;
        if let Some(motion) = self.recentring() {
            let waypoints: Vec<Point3<f64>> = path.cells.iter().map(|&cell| self.place(cell)).collect();
            return Some(WayHome { motion, cost_j: self.cost_j(model, &waypoints) });
        }
        let NavigationStatus::Go(Motion::Path(mut waypoints)) = motion_along(&path) else { return None };
        let cost_j = self.cost_j(model, &waypoints);
        waypoints.truncate(PATH_POINTS_MAX);
        Some(WayHome { motion: Motion::Path(waypoints), cost_j })
    }

    /// The place in a base nearest to its centre that is known to be free and has no agent in
    /// contact.
    fn place_in_base(&self, model: &EnergyModel, base: usize) -> Option<Cell> {
        let base = &model.bases[base];
        let graph = self.graph(Neighbours::TwentySix);
        let centre = self.cell_near(&base.position);
        let is_place = |cell: Cell| {
            base.holds(&self.place(cell))
                && graph.is_usable(cell)
                && self.is_clear_of_contacts(&self.place(cell), &self.place(cell))
        };
        let reach = libm::ceil(base.radius_m / self.map().extent().cell_m()).min(f64::from(i16::MAX)) as i32;
        // Shell after shell, so that nothing is searched beyond the first place.
        let shells = (0..=reach).map(|radius| shell(centre, radius));
        let mut left = PLACES_MAX;
        for cells in shells {
            let found =
                cells.inspect(|_| left = left.saturating_sub(1)).filter(|&cell| is_place(cell)).min_by(|&a, &b| {
                    let distance = |cell: Cell| (self.place(cell) - base.position).norm_squared();
                    distance(a).total_cmp(&distance(b)).then((a.z, a.y, a.x).cmp(&(b.z, b.y, b.x)))
                });
            if found.is_some() || left == 0 {
                return found;
            }
        }
        None
    }

    /// Whether the body would touch no agent in contact on a straight leg.
    fn is_clear_of_contacts(&self, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        let own_m = self.body().radius_m;
        let along = to - from;
        let is_clear = |contact: &Contact| {
            let share = nearest_share(from, &along, &contact.position);
            (contact.position - from - along * share).norm() > own_m + self.run_info().bodies.of(contact.agent).radius_m
        };
        self.contacts.iter().all(is_clear)
    }

    /// Energy along waypoints, with a stop at each.
    fn cost_j(&self, model: &EnergyModel, waypoints: &[Point3<f64>]) -> f64 {
        let time_s = legs_s(self.body(), (self.position(), self.yaw_rad()), waypoints.iter().copied(), 1.0)
            + SPARE_OF_LEG_S * waypoints.len() as f64;
        model.drawn_j(time_s, legs_m(&self.position(), waypoints)) * (1.0 + SPARE)
    }
}

/// The cells whose largest distance from a cell along an axis is `radius`.
fn shell(centre: Cell, radius: i32) -> impl Iterator<Item = Cell> {
    let along = move || -radius..=radius;
    let all = along().flat_map(move |z| along().flat_map(move |y| along().map(move |x| Cell::new(x, y, z))));
    all.filter(move |by| by.x.abs().max(by.y.abs()).max(by.z.abs()) == radius).map(move |by| centre + by)
}
