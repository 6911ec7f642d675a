//! Motions, wake-up conditions and commands, as `agent_node::command` has them.

use agent_node::command::{Command, Motion, ScanRequest, Stage, WakeCondition};
use msgs::ids::{AgentId, Tick};
use nalgebra::{Point3, Vector3};
use numpy::{PyArray2, PyArrayLike2};
use protocol::event_mask::EventMask;
use protocol::message_type::MessageType;
use protocol::relay_id::RelayId;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// A task for the body. A new task starts from rest.
#[pyclass(name = "Motion", module = "maes", frozen, eq, from_py_object)]
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PyMotion(pub(crate) Motion);

/// A finite number, or a `ValueError` that names it.
fn finite(name: &str, value: f64) -> PyResult<f64> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(PyValueError::new_err(format!("{name} = {value}: expected a finite number")))
    }
}

/// Points of an array of shape (N, 3), metres.
pub(crate) fn points(name: &str, array: &PyArrayLike2<'_, f64, numpy::AllowTypeChange>) -> PyResult<Vec<Point3<f64>>> {
    let array = array.as_array();
    if array.ncols() != 3 {
        let shape = array.shape();
        return Err(PyValueError::new_err(format!(
            "{name} has shape {shape:?}: expected (N, 3), metres in the map frame"
        )));
    }
    array
        .rows()
        .into_iter()
        .map(|row| Ok(Point3::new(finite(name, row[0])?, finite(name, row[1])?, finite(name, row[2])?)))
        .collect()
}

#[pymethods]
impl PyMotion {
    /// Continue the present task.
    #[staticmethod]
    fn keep() -> Self {
        Self(Motion::Keep)
    }

    /// End the present task, at rest at once.
    #[staticmethod]
    fn stop() -> Self {
        Self(Motion::Stop)
    }

    /// Straight along the heading, raised by `pitch_rad`; infinity: until a collision.
    #[staticmethod]
    #[pyo3(signature = (pitch_rad=0.0, distance_m=f64::INFINITY))]
    fn straight(pitch_rad: f64, distance_m: f64) -> PyResult<Self> {
        if distance_m.is_nan() || distance_m < 0.0 {
            return Err(PyValueError::new_err(format!("distance_m = {distance_m}: expected at least 0")));
        }
        let quarter = std::f64::consts::FRAC_PI_2;
        if !(-quarter..=quarter).contains(&pitch_rad) {
            return Err(PyValueError::new_err(format!("pitch_rad = {pitch_rad}: expected -pi/2 to pi/2")));
        }
        Ok(Self(Motion::straight(pitch_rad, distance_m)))
    }

    /// Turn by an angle, positive to the left, the shorter way round.
    #[staticmethod]
    fn turn(angle_rad: f64) -> PyResult<Self> {
        Ok(Self(Motion::turn(finite("angle_rad", angle_rad)?)))
    }

    /// Visit waypoints in sequence: an array of shape (N, 3), metres, map frame.
    #[staticmethod]
    #[pyo3(name = "path")]
    fn along(waypoints: PyArrayLike2<'_, f64, numpy::AllowTypeChange>) -> PyResult<Self> {
        let points = points("waypoints", &waypoints)?;
        let most = protocol::limits::PATH_POINTS_MAX;
        if !(1..=most).contains(&points.len()) {
            return Err(PyValueError::new_err(format!("{} waypoints: expected 1 to {most}", points.len())));
        }
        Ok(Self(Motion::Path(points)))
    }

    /// Hold a velocity in the frame of the body (x forward, y left, z up), m/s and rad/s.
    #[staticmethod]
    #[pyo3(signature = (linear_in_body_m_s, yaw_rate_rad_s=0.0))]
    fn velocity(linear_in_body_m_s: [f64; 3], yaw_rate_rad_s: f64) -> PyResult<Self> {
        let [x, y, z] = linear_in_body_m_s;
        let name = "linear_in_body_m_s";
        Ok(Self(Motion::Velocity {
            linear_in_body_m_s: Vector3::new(finite(name, x)?, finite(name, y)?, finite(name, z)?),
            yaw_rate_rad_s: finite("yaw_rate_rad_s", yaw_rate_rad_s)?,
            path: Vec::new(),
        }))
    }

    /// The waypoints of a path, shape (N, 3), metres, map frame; `None` for other motions.
    #[getter]
    fn waypoints<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let Motion::Path(points) = &self.0 else { return Ok(None) };
        Ok(Some(points_array(py, points)?))
    }

    fn __repr__(&self) -> String {
        format!("Motion({:?})", self.0)
    }
}

/// Points as an array of shape (N, 3).
pub(crate) fn points_array<'py>(py: Python<'py>, points: &[Point3<f64>]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    use numpy::{PyArray1, PyArrayMethods};
    let flat: Vec<f64> = points.iter().flat_map(|point| [point.x, point.y, point.z]).collect();
    PyArray1::from_vec(py, flat).reshape([points.len(), 3])
}

/// When the controller is called next: a tick at the latest, or one of a set of events.
#[pyclass(name = "WakeCondition", module = "maes", frozen, eq, from_py_object)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PyWakeCondition(pub(crate) WakeCondition);

#[pymethods]
impl PyWakeCondition {
    /// The next tick.
    #[classattr]
    const NEXT_TICK: Self = Self(WakeCondition::NEXT_TICK);

    /// The end of the task, by itself or by a collision.
    #[classattr]
    const TASK_DONE: Self = Self(WakeCondition::TASK_DONE);

    /// A tick and no event.
    #[staticmethod]
    fn at(tick: u64) -> Self {
        Self(WakeCondition::at(Tick(tick)))
    }

    /// Any of these events (a sum of `EventMask`), however late.
    #[staticmethod]
    fn on(events: u8) -> Self {
        Self(WakeCondition::on(EventMask::from_bits_retain(events)))
    }

    /// The earlier of two wake-up conditions.
    fn __or__(&self, other: &Self) -> Self {
        Self(self.0.or(other.0))
    }

    fn __repr__(&self) -> String {
        format!("WakeCondition(at={}, events={})", self.0.at.0, self.0.events.bits())
    }
}

/// The reply to an observation.
#[pyclass(name = "Command", module = "maes", frozen, eq, from_py_object)]
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PyCommand(pub(crate) Command);

impl PyCommand {
    fn changed(&self, change: impl FnOnce(Command) -> Command) -> Self {
        Self(change(self.0.clone()))
    }
}

#[pymethods]
impl PyCommand {
    /// Starts a task; everything else is unchanged.
    #[new]
    fn new(motion: PyMotion, wake: PyWakeCondition) -> Self {
        Self(Command::new(motion.0, wake.0))
    }

    /// Continues the present task until the wake-up condition is met.
    #[staticmethod]
    fn keep(wake: PyWakeCondition) -> Self {
        Self(Command::keep(wake.0))
    }

    /// Names what the agent is busy with from now on, for measures: "exploring", "relocating",
    /// "carrying" or "waiting".
    fn with_stage(&self, stage: &str) -> PyResult<Self> {
        let Some(known) = Stage::ALL.into_iter().find(|known| known.name() == stage) else {
            let text = format!("stage = {stage:?}: expected one of {}", Stage::ALL.map(Stage::name).join(", "));
            return Err(PyValueError::new_err(text));
        };
        Ok(self.changed(|command| command.with_stage(known)))
    }

    /// Adds a text for people, cut at 1024 bytes.
    fn with_info(&self, info: String) -> Self {
        self.changed(|command| command.with_info(info))
    }

    /// Adds a message to an agent, or to all in contact (`None`); kind 1 is for maps.
    #[pyo3(signature = (data, *, kind, to=None))]
    fn with_message(&self, data: Vec<u8>, kind: u8, to: Option<u32>) -> PyResult<Self> {
        if kind == MessageType::Map.number() {
            return Err(PyValueError::new_err(format!(
                "kind = {kind}: the agent sends maps itself; expected another kind"
            )));
        }
        Ok(self.changed(|command| command.with_message(to.map(AgentId), kind, data)))
    }

    /// Drops a relay at the body that stores these bytes, unless the agent has none left.
    #[pyo3(signature = (data=Vec::new(), *, kind=0))]
    fn with_relay(&self, data: Vec<u8>, kind: u8) -> Self {
        self.changed(|command| command.with_relay(kind, data))
    }

    /// Replaces the content of a relay in reach, which its owner and its number name.
    #[pyo3(signature = (relay, data, *, kind=0))]
    fn with_relay_update(&self, relay: (u32, u32), data: Vec<u8>, kind: u8) -> Self {
        let relay = RelayId { owner: AgentId(relay.0), number: relay.1 };
        self.changed(|command| command.with_relay_update(relay, kind, data))
    }

    /// Requests all cells of the last scan in the next observation.
    fn with_view_request(&self) -> Self {
        self.changed(Command::with_view_request)
    }

    /// When to scan from now on: "never", "once", or every so many ticks.
    fn with_lidar(&self, request: &Bound<'_, PyAny>) -> PyResult<Self> {
        let lidar = match (request.extract::<String>().as_deref(), request.extract::<u32>()) {
            (Ok("keep"), _) => ScanRequest::Keep,
            (Ok("never"), _) => ScanRequest::Never,
            (Ok("once"), _) => ScanRequest::Once,
            (_, Ok(ticks)) if ticks > 0 => ScanRequest::Every(ticks),
            _ => {
                let text =
                    format!("lidar = {request}: expected \"keep\", \"never\", \"once\", or a number of ticks from 1");
                return Err(PyValueError::new_err(text));
            }
        };
        Ok(self.changed(|command| Command { lidar, ..command }))
    }

    #[getter]
    fn motion(&self) -> PyMotion {
        PyMotion(self.0.motion.clone())
    }

    #[getter]
    fn wake(&self) -> PyWakeCondition {
        PyWakeCondition(self.0.wake)
    }

    #[getter]
    fn stage(&self) -> Option<&'static str> {
        self.0.stage.map(Stage::name)
    }

    #[getter]
    fn info(&self) -> &str {
        &self.0.info
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// The command that Python code has returned.
///
/// # Errors
/// `TypeError` if it is none; `ValueError` with the words of the server if it is not legal.
pub(crate) fn checked(returned: &Bound<'_, PyAny>, agent: AgentId, tick: Tick, agents: u32) -> PyResult<Command> {
    let Ok(command) = returned.cast::<PyCommand>() else {
        let kind = returned.get_type().name()?.to_string();
        return Err(PyTypeError::new_err(format!(
            "decide of agent {agent} has returned {kind}: expected maes.Command"
        )));
    };
    let command = command.get().0.clone();
    Command::from_message(&command.clone().into_message(agent, tick), agents)
        .map_err(|reason| PyValueError::new_err(format!("command of agent {agent} in tick {tick}: {reason}")))?;
    Ok(command)
}
