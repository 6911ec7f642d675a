//! The energy of a body: what it holds, what it draws, and where it charges.
//!
//! The server drains bodies by [`EnergyModel`], agents predict with it. Away from rest in a base a
//! body draws [`EnergyModel::power_w`] and, for each metre, [`EnergyModel::move_j_per_m`]; at rest
//! in a base it draws nothing and charges. Without energy it cannot move.
//!
//! The message is `maes_msgs/Energy`, the data of a message of the server to an agent.

use std::sync::Arc;

use msgs::ids::Tick;
use msgs::shared_bytes::SharedBytes;
use msgs::{cdr, maes_msgs};
use nalgebra::Point3;

use crate::geometry::{point, point_of};
use crate::limits::BASES_MAX;
use crate::server_message::{check, decode, wrong};
use crate::wire_error::WireError;

/// A place where bodies charge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Base {
    /// Its centre, metres, frame `map`.
    pub position: Point3<f64>,
    /// Distance of the centre of a body up to which it is in the base, metres.
    pub radius_m: f64,
}

/// What changes the energy of one body.
#[derive(Debug, Clone, PartialEq)]
pub struct EnergyModel {
    /// Most energy that it holds, J.
    pub capacity_j: f64,
    /// Power that it draws, except at rest in a base, W.
    pub power_w: f64,
    /// Energy that it draws in addition for each metre, J/m.
    pub move_j_per_m: f64,
    /// Power that it gains at rest in a base, W.
    pub charge_w: f64,
    /// What it should have left when it is back in a base, J.
    pub reserve_j: f64,
    /// Whether its controller is to go back to a base in time.
    pub returns_home: bool,
    /// Where it charges.
    pub bases: Arc<[Base]>,
}

/// The energy of a body at the start of a tick.
#[derive(Debug, Clone, PartialEq)]
pub struct Energy {
    /// What it holds, J.
    pub left_j: f64,
    /// What changes it.
    pub model: EnergyModel,
}

impl Base {
    /// Whether a body with its centre here (metres, frame `map`) is in the base.
    #[must_use]
    pub fn holds(&self, position: &Point3<f64>) -> bool {
        (position - self.position).norm() <= self.radius_m
    }
}

impl EnergyModel {
    /// Whether a body with its centre here (metres, frame `map`) is in a base.
    #[must_use]
    pub fn is_in_base(&self, position: &Point3<f64>) -> bool {
        self.bases.iter().any(|base| base.holds(position))
    }

    /// Energy that a body draws in `time_s` seconds away from rest in a base, while it moves by
    /// `distance_m` metres, J.
    #[must_use]
    pub fn drawn_j(&self, time_s: f64, distance_m: f64) -> f64 {
        self.power_w * time_s + self.move_j_per_m * distance_m
    }
}

impl Energy {
    /// The data of the message of the server.
    #[must_use]
    pub fn to_data(&self) -> SharedBytes {
        let EnergyModel { capacity_j, power_w, move_j_per_m, charge_w, reserve_j, returns_home, bases } = &self.model;
        let message = maes_msgs::Energy {
            left_j: self.left_j,
            capacity_j: *capacity_j,
            power_w: *power_w,
            move_j_per_m: *move_j_per_m,
            charge_w: *charge_w,
            reserve_j: *reserve_j,
            return_home: *returns_home,
            bases: bases
                .iter()
                .map(|base| maes_msgs::Base { position: point(&base.position), radius_m: base.radius_m })
                .collect(),
        };
        SharedBytes::from(cdr::encode(&message))
    }

    /// The energy that the data of a message of the server in the observation of a tick holds.
    ///
    /// # Errors
    /// If it is no `maes_msgs/Energy`, or a number in it is none that a run can have.
    pub fn from_data(data: &[u8], tick: Tick) -> Result<Self, WireError> {
        let message = decode(data, tick, "a maes_msgs/Energy of kind ENERGY")?;
        let maes_msgs::Energy { left_j, capacity_j, power_w, move_j_per_m, charge_w, reserve_j, return_home, bases } =
            message;
        let numbers = [
            ("energy.capacity_j", capacity_j, 0.0, f64::MAX),
            ("energy.left_j", left_j, 0.0, capacity_j),
            ("energy.reserve_j", reserve_j, 0.0, capacity_j),
            ("energy.power_w", power_w, 0.0, f64::MAX),
            ("energy.move_j_per_m", move_j_per_m, 0.0, f64::MAX),
            ("energy.charge_w", charge_w, 0.0, f64::MAX),
        ];
        check(tick, numbers)?;
        if !(1..=BASES_MAX).contains(&bases.len()) {
            return Err(wrong(tick, "energy.bases", bases.len(), format_args!("1 to {BASES_MAX} bases")));
        }
        let bases: Vec<Base> =
            bases.iter().map(|base| Base { position: point_of(&base.position), radius_m: base.radius_m }).collect();
        let is_finite = |base: &Base| base.radius_m.is_finite() && base.position.iter().all(|along| along.is_finite());
        if let Some(base) = bases.iter().find(|base| !is_finite(base)) {
            return Err(wrong(tick, "energy.bases", format_args!("{base:?}"), "finite numbers"));
        }
        let model = EnergyModel {
            capacity_j,
            power_w,
            move_j_per_m,
            charge_w,
            reserve_j,
            returns_home: return_home,
            bases: bases.into(),
        };
        Ok(Self { left_j, model })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn energy() -> Energy {
        let base = |x| Base { position: Point3::new(x, 2.0, 3.0), radius_m: 1.5 };
        let model = EnergyModel {
            capacity_j: 600.0,
            power_w: 2.0,
            move_j_per_m: 3.0,
            charge_w: 10.0,
            reserve_j: 60.0,
            returns_home: true,
            bases: vec![base(1.0), base(9.0)].into(),
        };
        Energy { left_j: 450.5, model }
    }

    #[test]
    fn message_round_trips() {
        let energy = energy();
        assert_eq!(Energy::from_data(&energy.to_data(), Tick(3)), Ok(energy));
    }

    #[test]
    fn impossible_numbers_are_refused() {
        let refused = |change: fn(&mut Energy)| {
            let mut energy = energy();
            change(&mut energy);
            Energy::from_data(&energy.to_data(), Tick(3)).unwrap_err().to_string()
        };
        let more = refused(|energy| energy.left_j = 600.5);
        assert_eq!(more, "observation of tick 3: energy.left_j = 600.5: expected 0 to 600");
        assert!(refused(|energy| energy.model.power_w = f64::NAN).contains("energy.power_w = NaN"));
        assert!(refused(|energy| energy.model.bases = Arc::new([])).contains("energy.bases = 0: expected 1 to 64"));
        let lost = refused(|energy| {
            energy.model.bases = vec![Base { position: Point3::origin(), radius_m: f64::INFINITY }].into();
        });
        assert!(lost.ends_with("expected finite numbers"), "{lost}");
        let short = Energy::from_data(&energy().to_data()[..40], Tick(3)).unwrap_err().to_string();
        assert!(short.starts_with("observation of tick 3: messages = "), "{short}");
    }

    #[test]
    fn base_holds_what_is_near() {
        let model = energy().model;
        assert!(model.is_in_base(&Point3::new(9.0, 2.0, 4.5)) && !model.is_in_base(&Point3::new(5.0, 2.0, 3.0)));
        assert_eq!(model.drawn_j(2.0, 5.0), 19.0);
    }
}
