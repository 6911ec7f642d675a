//! The parameters of a world.

use std::collections::{BTreeMap, BTreeSet};

use msgs::ids::AgentId;
use protocol::body_model::BodyModel;

use super::comms::Comms;
use super::energy::EnergyParams;
use super::lidar::SensorSuite;
use super::localisation::{LoopClosures, OdometryNoise};
use super::moving_obstacles::ObstacleModel;
use super::noise::SensorNoise;

/// The parameters of a world, apart from its terrain.
#[derive(Debug, Clone)]
pub struct WorldParams {
    /// The body model of the team.
    pub body: BodyModel,
    /// Body models of the agents that have another one.
    pub other_bodies: BTreeMap<AgentId, BodyModel>,
    /// The LiDARs of every agent without others.
    pub sensors: SensorSuite,
    /// The LiDARs of the agents that have others.
    pub other_sensors: BTreeMap<AgentId, SensorSuite>,
    /// The scan schedule of the LiDARs.
    pub schedule: ScanSchedule,
    /// The radios and their contact model.
    pub comms: Comms,
    /// Length of the share periods, which [`FIRST_CONTACT`](protocol::event_mask::EventMask::FIRST_CONTACT) refers to; 0: one
    /// period without end.
    pub share_period_ticks: u32,
    /// The sensor noise.
    pub noise: SensorNoise,
    /// The noise of the odometry by which agents localise.
    pub odometry: OdometryNoise,
    /// When agents whose localisation drifts close loops; `None`: never.
    pub closures: Option<LoopClosures>,
    /// The batteries of the bodies; `None`: they need no energy.
    pub energy: Option<EnergyParams>,
    /// The agents that are not in the world at the start, and join later.
    pub late: BTreeSet<AgentId>,
    /// The agents that are base stations.
    pub base_stations: BTreeSet<AgentId>,
    /// The moving obstacles.
    pub obstacles: Vec<ObstacleModel>,
}

impl WorldParams {
    /// Bodies of one kind with LiDARs that scan every ten ticks until they are asked for more, and
    /// radios; without noise, drift, energy, base stations and obstacles.
    #[must_use]
    pub fn new(body: BodyModel, sensors: impl Into<SensorSuite>, comms: Comms) -> Self {
        Self {
            body,
            other_bodies: BTreeMap::new(),
            sensors: sensors.into(),
            other_sensors: BTreeMap::new(),
            schedule: ScanSchedule::OnRequest { period_ticks: 10 },
            comms,
            share_period_ticks: 0,
            noise: SensorNoise::default(),
            odometry: OdometryNoise::default(),
            closures: None,
            energy: None,
            late: BTreeSet::new(),
            base_stations: BTreeSet::new(),
            obstacles: Vec::new(),
        }
    }
}

/// The scan schedule of the LiDARs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScanSchedule {
    /// Each LiDAR scans as its agent requests; until the first request, all scan every
    /// `period_ticks`, in the same tick.
    OnRequest {
        /// Ticks between scans, at least 1.
        period_ticks: u32,
    },
    /// One agent scans in each tick, in turn, whatever agents request (MAES3D).
    TakeTurns,
}
