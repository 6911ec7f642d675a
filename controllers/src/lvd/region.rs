//! The Voronoi region of an agent.
//!
//! A point belongs to the nearest agent in a straight line among those in contact and oneself; of
//! several at equal distance, to the one with the lowest id.

use msgs::ids::AgentId;
use nalgebra::Point3;

use crate::Ctx;
use agent::observation::Observation;

/// The Voronoi region of an agent among those in contact.
#[derive(Debug, Clone)]
pub(crate) struct Region {
    agent: AgentId,
    position: Point3<f64>,
    others: Vec<(AgentId, Point3<f64>)>,
}

impl Region {
    /// The region at an observation.
    pub(crate) fn new(observation: &Observation, ctx: &Ctx<'_>) -> Self {
        let others = observation.contacts.iter().map(|contact| (contact.agent, contact.position)).collect();
        Self { agent: ctx.agent(), position: ctx.position(), others }
    }

    /// Whether a point (metres, frame `map`) is in the region.
    pub(crate) fn holds(&self, point: &Point3<f64>) -> bool {
        let own = (point - self.position).norm_squared();
        self.others.iter().all(|(agent, position)| {
            let other = (point - position).norm_squared();
            own < other || own == other && self.agent < *agent
        })
    }

    /// Whether no agent is in contact, so that the region is unbounded.
    pub(crate) fn is_everything(&self) -> bool {
        self.others.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_belong_to_the_nearest_agent_then_to_the_lowest_id() {
        let region = |agent| Region {
            agent: AgentId(agent),
            position: Point3::new(0.5, 0.5, 0.5),
            others: vec![(AgentId(3), Point3::new(4.5, 0.5, 0.5)), (AgentId(5), Point3::new(0.5, 9.5, 0.5))],
        };
        assert!(region(4).holds(&Point3::new(2.4, 0.5, 0.5)) && !region(4).holds(&Point3::new(2.6, 0.5, 0.5)));
        assert!(region(2).holds(&Point3::new(2.5, 0.5, 0.5)) && !region(4).holds(&Point3::new(2.5, 0.5, 0.5)));
        assert!(!region(2).holds(&Point3::new(0.5, 6.0, 0.5)));
        assert!(!region(2).is_everything());
    }
}
