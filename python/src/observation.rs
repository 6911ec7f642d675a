//! What an agent observes, with the names of `agent_node::observation`.

use agent_node::command::{AgentMessage, Peer};
use agent_node::observation::{Cells, Observation, Surface};
use agent_node::protocol::energy::Energy;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

/// Cells of an observation as arrays of indices, uint32: free ones, and walls.
type CellArrays<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<u32>>);

/// An observation. Lengths in metres, angles in radians, frame `map`.
#[pyclass(name = "Observation", module = "maes", frozen)]
pub(crate) struct PyObservation(pub(crate) Observation);

fn arrays<'py>(py: Python<'py>, cells: &Cells) -> CellArrays<'py> {
    (PyArray1::from_slice(py, &cells.free), PyArray1::from_slice(py, &cells.wall))
}

/// What a body holds, and what changes it, as a dictionary.
pub(crate) fn energy_dict<'py>(py: Python<'py>, energy: &Energy) -> PyResult<Bound<'py, PyDict>> {
    let Energy { left_j, model } = energy;
    let dict = PyDict::new(py);
    dict.set_item("left_j", left_j)?;
    dict.set_item("capacity_j", model.capacity_j)?;
    dict.set_item("power_w", model.power_w)?;
    dict.set_item("move_j_per_m", model.move_j_per_m)?;
    dict.set_item("charge_w", model.charge_w)?;
    dict.set_item("reserve_j", model.reserve_j)?;
    dict.set_item("return_home", model.returns_home)?;
    let bases = model.bases.iter().map(|base| (<[f64; 3]>::from(base.position.coords), base.radius_m));
    dict.set_item("bases", bases.collect::<Vec<_>>())?;
    Ok(dict)
}

#[pymethods]
impl PyObservation {
    /// Ticks of 20 ms since the start.
    #[getter]
    fn tick(&self) -> u64 {
        self.0.tick.0
    }

    /// Sim time since the start, seconds.
    #[getter]
    fn time_s(&self) -> f64 {
        self.0.tick.time_ns() as f64 / 1e9
    }

    /// Centre of the body: float64, shape (3,), metres.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.pose.position.coords.as_slice())
    }

    /// Heading: 0 along x, positive to the left, in (-pi, pi].
    #[getter]
    fn yaw_rad(&self) -> f64 {
        self.0.pose.yaw_rad
    }

    /// Velocity in the last tick: float64, shape (3,), m/s, frame `map`.
    #[getter]
    fn velocity_m_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.velocity_in_map_m_s.as_slice())
    }

    /// Turn rate, rad/s, positive to the left.
    #[getter]
    fn yaw_rate_rad_s(&self) -> f64 {
        self.0.yaw_rate_rad_s
    }

    /// Whether a task is under way.
    #[getter]
    fn is_active(&self) -> bool {
        self.0.is_active
    }

    /// The side on which the body collided, "wall", "floor" or "ceiling", and whether the obstacle
    /// was another agent; `None` without a collision.
    #[getter]
    fn collision(&self) -> Option<(&'static str, bool)> {
        self.0.collision.map(|collision| {
            let surface = match collision.surface {
                Surface::Wall => "wall",
                Surface::Floor => "floor",
                Surface::Ceiling => "ceiling",
            };
            (surface, collision.with_agent)
        })
    }

    /// Events since the last observation: a sum of `EventMask`.
    #[getter]
    fn events(&self) -> u8 {
        self.0.events.bits()
    }

    /// Agents in contact, ascending: id and position in metres.
    #[getter]
    fn contacts(&self) -> Vec<(u32, [f64; 3])> {
        self.0.contacts.iter().map(|contact| (contact.agent.0, contact.position.coords.into())).collect()
    }

    /// Relays in reach: (owner, number) and position in metres.
    #[getter]
    fn relays(&self) -> Vec<((u32, u32), [f64; 3])> {
        let relays = self.0.relays.iter();
        relays.map(|relay| ((relay.id.owner.0, relay.id.number), relay.position.coords.into())).collect()
    }

    /// Messages since the last observation: sender, kind, bytes. Map messages are merged already.
    #[getter]
    fn messages<'py>(&self, py: Python<'py>) -> Vec<(u32, u8, Bound<'py, PyBytes>)> {
        let messages = self.0.messages.iter();
        let of_agent = |message: &AgentMessage| match message.peer {
            Peer::One(agent) => Some((agent.0, message.kind, PyBytes::new(py, &message.data))),
            _ => None,
        };
        messages.filter_map(of_agent).collect()
    }

    /// Contents of relays in reach that were not read yet: (owner, number), kind, bytes.
    #[getter]
    fn readings<'py>(&self, py: Python<'py>) -> Vec<((u32, u32), u8, Bound<'py, PyBytes>)> {
        let messages = self.0.messages.iter();
        let of_relay = |message: &AgentMessage| match message.peer {
            Peer::Relay(relay) => Some(((relay.owner.0, relay.number), message.kind, PyBytes::new(py, &message.data))),
            _ => None,
        };
        messages.filter_map(of_relay).collect()
    }

    /// Tick of the last scan; `None` before the first.
    #[getter]
    fn scan_tick(&self) -> Option<u64> {
        self.0.scan_tick.map(|tick| tick.0)
    }

    /// Cells first seen since the last observation, free and wall: indices, uint32, ascending.
    /// They are merged into the map already.
    #[getter]
    fn seen<'py>(&self, py: Python<'py>) -> CellArrays<'py> {
        arrays(py, &self.0.seen)
    }

    /// All cells of the last scan, free and wall, if the last command asked for them.
    #[getter]
    fn view<'py>(&self, py: Python<'py>) -> Option<CellArrays<'py>> {
        self.0.view.as_ref().map(|cells| arrays(py, cells))
    }

    /// The energy of the body, what changes it, and the bases where it charges (position, radius):
    /// J, W and metres; `None` if bodies need no energy.
    #[getter]
    fn energy<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.0.energy.as_deref().map(|energy| energy_dict(py, energy)).transpose()
    }

    /// What a ring LiDAR or a depth camera sees about the heading, radians, and up to which
    /// distance in metres it sees nothing; `None` for the other patterns.
    #[getter]
    fn field_of_view<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(view) = &self.0.field_of_view else { return Ok(None) };
        let dict = PyDict::new(py);
        dict.set_item("horizontal_rad", view.horizontal_rad)?;
        dict.set_item("lowest_rad", view.lowest_rad)?;
        dict.set_item("highest_rad", view.highest_rad)?;
        dict.set_item("spacing_rad", view.spacing_rad)?;
        dict.set_item("min_range_m", view.min_range_m)?;
        Ok(Some(dict))
    }

    fn __repr__(&self) -> String {
        let position = self.0.pose.position;
        format!("Observation(tick={}, position=({}, {}, {}))", self.0.tick.0, position.x, position.y, position.z)
    }
}
