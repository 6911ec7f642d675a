//! The table `[energy]`: batteries and bases. Without it bodies need no energy.

use nalgebra::Point3;
use protocol::limits::BASES_MAX;
use serde::{Deserialize, Serialize};

use super::{Checker, Scenario, ScenarioError};
use world::energy::{Capacity, EnergyParams};

/// `[energy]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EnergySection {
    /// What a full battery holds, J.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub capacity_j: Option<f64>,
    /// Instead of that: how long a full battery lasts at rest away from bases, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub endurance_s: Option<f64>,
    /// Power that a body draws, except at rest in a base, W.
    pub idle_w: f64,
    /// Power that an aerial body draws in addition, W.
    pub hover_w: f64,
    /// Energy that a body draws in addition for each metre, J/m.
    pub move_j_per_m: f64,
    /// Power that a body gains at rest in a base, W.
    pub charge_w: f64,
    /// Centres of the bases, metres; `None`: the start of each agent, for it alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bases: Option<Vec<[f64; 3]>>,
    /// Radius of each base, metres.
    pub base_radius_m: f64,
    /// Whether controllers go back to a base in time.
    pub return_home: bool,
    /// Share of the capacity that they keep for that.
    pub reserve: f64,
}

impl Default for EnergySection {
    fn default() -> Self {
        Self {
            capacity_j: None,
            endurance_s: None,
            idle_w: 1.0,
            hover_w: 0.0,
            move_j_per_m: 0.0,
            charge_w: 10.0,
            bases: None,
            base_radius_m: 2.0,
            return_home: true,
            reserve: 0.2,
        }
    }
}

impl EnergySection {
    /// The parameters of the world.
    #[must_use]
    pub fn params(&self) -> EnergyParams {
        EnergyParams {
            capacity: match (self.capacity_j, self.endurance_s) {
                (Some(energy_j), _) => Capacity::Energy(energy_j),
                (None, time_s) => Capacity::Endurance(time_s.unwrap_or_default()),
            },
            idle_w: self.idle_w,
            hover_w: self.hover_w,
            move_j_per_m: self.move_j_per_m,
            charge_w: self.charge_w,
            bases: self.bases.as_ref().map(|bases| bases.iter().copied().map(Point3::from).collect()),
            base_radius_m: self.base_radius_m,
            reserve: self.reserve,
            returns_home: self.return_home,
        }
    }
}

impl Scenario {
    pub(super) fn check_energy(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        let Some(energy) = &self.energy else {
            let allowed = "expected only with [energy], whose bases the team comes back to";
            return checker.require("stop_when_back", true, !self.stop_when_back, allowed);
        };
        let EnergySection { capacity_j, endurance_s, idle_w, hover_w, bases, base_radius_m, .. } = energy;
        let given = match (capacity_j, endurance_s) {
            (Some(_), Some(endurance_s)) => Some(endurance_s.to_string()),
            (None, None) => Some("nothing".to_owned()),
            _ => None,
        };
        if let Some(given) = given {
            let allowed = "expected either energy.capacity_j or energy.endurance_s";
            return Err(checker.error_from("energy", "energy.endurance_s", given, allowed));
        }
        if let Some(endurance_s) = endurance_s {
            let others = self.other_bodies();
            let params = energy.params();
            let all_draw = std::iter::once(&self.body).chain(others.values()).all(|body| params.power_w(body) > 0.0);
            let allowed = format!(
                "expected energy.capacity_j, or bodies that draw power at rest: energy.idle_w is {idle_w}, and \
                 energy.hover_w, of aerial bodies, {hover_w}"
            );
            checker.require("energy.endurance_s", endurance_s, all_draw, &allowed)?;
        }
        if let Some(cell_m) = self.map.cell_m {
            // The place of a body on its paths that is nearest to the centre.
            let least_m = 3_f64.sqrt() / 2.0 * cell_m;
            let allowed = format!("expected at least half of the diagonal of a cell, here {least_m:.3} m");
            checker.require("energy.base_radius_m", base_radius_m, *base_radius_m >= least_m, &allowed)?;
        }
        let Some(bases) = bases else { return Ok(()) };
        let allowed = format!("expected 1 to {BASES_MAX} bases");
        let count = format!("{} bases", bases.len());
        checker.require("energy.bases", count, (1..=BASES_MAX).contains(&bases.len()), &allowed)?;
        let is_finite = |base: &&[f64; 3]| base.iter().all(|along| along.is_finite());
        match bases.iter().find(|base| !is_finite(base)) {
            Some(base) => checker.require("energy.bases", format!("{base:?}"), false, "expected finite numbers"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "seed = 1\nduration_s = 1.0\nmap = { kind = \"spheres\", size = 20 }\nagents = { count = 2 }\n";

    fn parse(keys: &str) -> Result<Scenario, String> {
        Scenario::parse("s.toml", &format!("{TEXT}{keys}"), &[]).map_err(|error| error.to_string())
    }

    #[test]
    fn identity_names_energy_only_if_bodies_need_it() {
        let without = parse("").unwrap().identity();
        assert!(!without.contains("energy") && !without.contains("stop_when_back"));
        let with = parse("stop_when_back = true\n[energy]\nendurance_s = 60.0\nbases = [[1.0, 2.0, 3.0]]").unwrap();
        assert_eq!(Scenario::parse("identity", &with.identity(), &[]).unwrap(), with);
        assert_eq!(with.energy.unwrap().params().capacity, Capacity::Endurance(60.0));
    }

    #[test]
    fn impossible_values_are_named() {
        let refused = |keys: &str| parse(keys).unwrap_err();
        let either = "expected either energy.capacity_j or energy.endurance_s";
        assert!(refused("[energy]\nidle_w = 1.0").ends_with(&format!("energy.endurance_s = nothing: {either}")));
        assert!(refused("[energy]\ncapacity_j = 1.0\nendurance_s = 1.0").ends_with(either));
        let no_power = refused("[energy]\nendurance_s = 60.0\nidle_w = 0.0\nhover_w = 5.0");
        assert!(no_power.contains("energy.endurance_s = 60: expected energy.capacity_j, or bodies that"), "{no_power}");
        assert!(
            parse("body = { kind = \"aerial\" }\n[energy]\nendurance_s = 60.0\nidle_w = 0.0\nhover_w = 5.0").is_ok()
        );
        let of_others = "bodies = [{ agents = [0], kind = \"submarine\" }]\nbody = { kind = \"aerial\" }\n";
        assert!(parse(&format!("{of_others}[energy]\nendurance_s = 6.0\nidle_w = 0.0\nhover_w = 5.0")).is_err());
        assert!(refused("[energy]\ncapacity_j = 0.0").contains("energy.capacity_j = 0: expected a number above 0"));
        assert!(refused("[energy]\ncapacity_j = 9.0\nbases = []").contains("energy.bases = 0 bases: expected 1 to 64"));
        assert!(refused("[energy]\ncapacity_j = 9.0\nbases = [[1.0, nan, 1.0]]").contains("expected finite numbers"));
        let small = refused("[energy]\ncapacity_j = 9.0\nbase_radius_m = 0.5");
        assert!(small.contains("energy.base_radius_m = 0.5: expected at least half of the diagonal"), "{small}");
        assert!(refused("stop_when_back = true").contains("stop_when_back = true: expected only with [energy]"));
    }
}
