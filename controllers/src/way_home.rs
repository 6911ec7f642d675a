//! The way back to a base: its motion and what it costs, for controllers whose bodies need energy.
//!
//! The cost is that of the body at rest here: a body under way has to brake first
//! ([`turning_back_j`]). Other bodies are not on the map; those in contact can be avoided.

use std::f64::consts::PI;

use nalgebra::Point3;
use protocol::energy::{Base, Energy, EnergyModel};
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

/// The place in a base nearest to its centre that is known to be free and has no agent in contact.
enum Aim {
    Place(Cell),
    /// Not among the first [`PLACES_MAX`] cells.
    NotFound,
    /// There is none.
    None,
}

impl Aim {
    fn place(&self) -> Option<Cell> {
        if let Self::Place(cell) = self { Some(*cell) } else { None }
    }
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
    /// centre that has no agent in contact, or to its nearest place if that cannot be reached.
    /// `None` if there is none, or bodies need no energy.
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
        let path = self.path_home(model, is_open)?;
        if let Some(motion) = self.recentring() {
            let waypoints: Vec<Point3<f64>> = path.cells.iter().map(|&cell| self.place(cell)).collect();
            return Some(WayHome { motion, cost_j: self.cost_j(model, &waypoints) });
        }
        let NavigationStatus::Go(Motion::Path(mut waypoints)) = motion_along(&path) else { return None };
        let cost_j = self.cost_j(model, &waypoints);
        waypoints.truncate(PATH_POINTS_MAX);
        Some(WayHome { motion: Motion::Path(waypoints), cost_j })
    }

    /// The cheapest path to the [aim](Aim) of a base; to any place of a base whose aim cannot be
    /// reached or was not found.
    fn path_home(&self, model: &EnergyModel, is_open: &dyn Fn(Cell) -> bool) -> Option<Path> {
        let graph = self.graph(Neighbours::TwentySix);
        let to = |goal: Goal<'_>| Search::new(graph, self.cell(), goal).within(is_open).run();
        let aims: Vec<(&Base, Aim)> = model.bases.iter().map(|base| (base, self.aim(base))).collect();
        let goals: Vec<Cell> = aims.iter().filter_map(|(_, aim)| aim.place()).collect();
        let path = to(Goal::AnyOf(&goals));
        let aimed_at = path.as_ref().and_then(|path| path.cells.last());
        // Whether a path to a place of the base may be cheaper than the one that is known.
        let may_be_nearer = |base: &Base| {
            let least_m = (self.position() - base.position).norm() - base.radius_m;
            path.as_ref().is_none_or(|path| least_m < path.length_m(self.map().extent()))
        };
        let is_missed = |base: &Base, aim: &Aim| match aim {
            Aim::None => false,
            Aim::NotFound => may_be_nearer(base),
            // Without a path to any of them there is none to this one.
            Aim::Place(place) => {
                Some(place) != aimed_at && may_be_nearer(base) && (path.is_none() || to(Goal::Cell(*place)).is_none())
            }
        };
        let missed: Vec<&Base> =
            aims.iter().filter(|(base, aim)| is_missed(base, aim)).map(|&(base, _)| base).collect();
        if missed.is_empty() {
            return path;
        }
        let is_in_missed = |cell| missed.iter().any(|base| self.is_place_in(base, cell));
        path.into_iter().chain(to(Goal::Where(&is_in_missed))).min_by_key(|path| path.cost)
    }

    /// Whether the place of a cell is in a base and has no agent in contact.
    fn is_place_in(&self, base: &Base, cell: Cell) -> bool {
        let place = self.place(cell);
        base.holds(&place) && self.is_clear_of_contacts(&place, &place)
    }

    /// Where to go in a base.
    fn aim(&self, base: &Base) -> Aim {
        let graph = self.graph(Neighbours::TwentySix);
        let centre = self.cell_near(&base.position);
        let reach = libm::ceil(base.radius_m / self.map().extent().cell_m()).min(f64::from(i16::MAX)) as i32;
        let mut left = PLACES_MAX;
        // Shell after shell, so that nothing is searched beyond the first place.
        for radius in 0..=reach {
            let cells = shell(centre, radius).inspect(|_| left = left.saturating_sub(1));
            let places = cells.filter(|&cell| graph.is_usable(cell) && self.is_place_in(base, cell));
            let nearest = places.min_by(|&a, &b| {
                let distance = |cell: Cell| (self.place(cell) - base.position).norm_squared();
                distance(a).total_cmp(&distance(b)).then((a.z, a.y, a.x).cmp(&(b.z, b.y, b.x)))
            });
            if let Some(place) = nearest {
                return Aim::Place(place);
            }
            if left == 0 {
                return Aim::NotFound;
            }
        }
        Aim::None
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

#[cfg(test)]
mod tests {
    use super::super::testing::World;
    use super::*;

    /// Where a body goes that is at the start of a known corridor and has one base on its axis.
    fn end_of_way_home(corridor: &str, base_x_m: f64, radius_m: f64) -> Option<f64> {
        let solid = format!("{}\n", "#".repeat(corridor.len()));
        let rock = solid.repeat(3);
        let layers = [rock.clone(), format!("{solid}{corridor}\n{solid}"), rock];
        let mut world = World::known(&layers.join("\n"), Cell::new(1, 1, 1));
        let bases = [Base { position: Point3::new(base_x_m, 1.5, 1.5), radius_m }].into();
        let model = EnergyModel {
            capacity_j: 1e6,
            power_w: 1.0,
            move_j_per_m: 1.0,
            charge_w: 1.0,
            reserve_j: 0.0,
            returns_home: true,
            bases,
        };
        world.observation.energy = Some(Box::new(Energy { left_j: 1e6, model }));
        match world.ctx().way_home()?.motion {
            Motion::Path(waypoints) => waypoints.last().map(|end| end.x),
            motion => panic!("{motion:?}"),
        }
    }

    #[test]
    fn way_home_leads_to_what_can_be_reached_of_a_base() {
        assert_eq!(end_of_way_home("#.......#", 5.5, 2.5), Some(5.5));
        // Its centre is behind a grille.
        assert_eq!(end_of_way_home("#...#...#", 5.5, 2.5), Some(3.5));
        assert_eq!(end_of_way_home("#...#...#", 6.5, 2.5), None);
    }

    #[test]
    fn way_home_leads_to_places_of_a_base_far_from_its_centre() {
        let corridor = format!("#{}{}", ".".repeat(10), "#".repeat(20));
        assert_eq!(end_of_way_home(&corridor, 25.5, 17.0), Some(8.5));
        assert_eq!(end_of_way_home(&corridor, 25.5, 14.0), None);
    }
}
