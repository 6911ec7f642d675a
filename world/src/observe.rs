//! The observations of the agents: what each senses and receives, as it believes it to be.

use msgs::ids::AgentId;
use nalgebra::Point3;
use protocol::observation::{Cells, Contact, Observation, Relay, RequestKind};

use super::body::Pose;
use super::lidar::{NoisyScan, ScanView};
use super::{AgentState, World};

impl World {
    /// The position that an agent measures for itself, and reports to agents in contact: metres,
    /// frame `map`. It is the true one unless the sensor noise has a pose drift.
    #[must_use]
    pub fn measured_position(&self, agent: AgentId) -> Point3<f64> {
        let state = &self.agents[agent.index()];
        state.drift.measured(&state.body.pose().position, self.terrain.extent())
    }

    /// The measured position of an agent in the map of another one or of itself, metres.
    fn measured_in_map_of(&self, reader: AgentId, agent: AgentId) -> Point3<f64> {
        let AgentState { body, drift, .. } = &self.agents[agent.index()];
        drift.measured(&self.in_map_of(reader, &body.pose().position), self.terrain.extent())
    }

    /// The variance of [`Self::measured_position`] along each axis, m^2: of the drift, spread
    /// evenly within its bound, which it is in the long run.
    #[must_use]
    pub fn measured_variance_m2(&self) -> f64 {
        self.params.noise.pose_bound_m.powi(2) / 3.0
    }

    /// The observation of an agent in this tick. [`RequestKind::Scheduled`] marks its content as
    /// delivered.
    pub fn observe(&mut self, agent: AgentId, kind: RequestKind) -> Observation {
        let change_of_contacts = self.change_of_contacts(agent);
        let (contacts, relays) = (self.contacts_of(agent), self.relays_of(agent));
        self.collect_scans(agent.index());
        let pending_observation = &mut self.agents[agent.index()].pending_observation;
        let delta = match kind {
            RequestKind::Scheduled => pending_observation.commit(),
            RequestKind::Polled => pending_observation.speculate(),
        };
        let map_frames = self.map_frames(agent, &contacts, &delta.messages);
        let reported = |other| Contact { agent: other, position: self.measured_in_map_of(agent, other) };
        let contacts = contacts.into_iter().map(reported).collect();
        let position = self.measured_in_map_of(agent, agent);
        let reported = |&(id, position)| Relay { id, position: self.in_map_of(agent, &position) };
        let reported_relays = relays.iter().map(reported).collect();
        let noise = &self.params.noise;
        let state = &self.agents[agent.index()];
        let events = delta.events | change_of_contacts;
        let mut observation = Observation {
            tick: self.tick,
            agent,
            pose: Pose { position, ..*state.body.pose() },
            velocity_in_map_m_s: state.body.velocity_in_map_m_s(),
            yaw_rate_rad_s: state.body.yaw_rate_rad_s(),
            is_active: state.body.is_active(),
            collision: state.body.collision(),
            events,
            contacts,
            relays: reported_relays,
            messages: delta.messages,
            map_frames,
            scan_tick: state.last_scan.map(|(_, tick)| tick),
            seen: Cells { free: delta.free, wall: delta.wall },
            view: None,
            energy: None,
            field_of_view: state.sensor.lidar().sensors.field_of_view(),
            change: None,
        };
        if state.want_view
            && let Some((pose, tick)) = &state.last_scan
            && self.map_changed_at.is_none_or(|changed| *tick >= changed)
            && *tick >= self.block_since(agent.index())
        {
            let sensor = state.sensor.state();
            let memory = &sensor.memory;
            let views = state.sensor.lidar().sensors.scanners().enumerate().map(|(lidar, scanner)| {
                let bodies = &state.last_bodies.met_by(scanner);
                match noise.affects_scans() {
                    true => scanner.view_noisy(memory, pose, NoisyScan { noise, agent, lidar, tick: *tick, bodies }),
                    false => scanner.view_past(memory, pose, bodies),
                }
            });
            let view = together(views);
            drop(sensor);
            observation.view = Some(self.cells_in_map_of(agent, view));
        }
        observation.energy = self.energy_in_map_of(agent).map(Box::new);
        if kind == RequestKind::Scheduled {
            let state = &mut self.agents[agent.index()];
            state.reported_relays = relays;
            self.note_reported_contacts(agent);
        }
        observation
    }
}

/// What several LiDARs see at once. A cell that noise makes free to one and wall to another is what
/// the first of them says.
fn together(mut views: impl Iterator<Item = ScanView>) -> Cells {
    let ScanView { mut free, mut wall, .. } = views.next().unwrap_or_default();
    for view in views {
        let is_new = |cell: &u32| free.binary_search(cell).is_err() && wall.binary_search(cell).is_err();
        let [new_free, new_wall] =
            [view.free, view.wall].map(|cells| cells.into_iter().filter(is_new).collect::<Vec<u32>>());
        free.extend(new_free);
        wall.extend(new_wall);
        free.sort_unstable();
        wall.sort_unstable();
    }
    Cells { free, wall }
}
