//! Recordings as NumPy arrays and dictionaries.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use msgs::ids::AgentId;
use msgs::maes_msgs::{self, Observation};
use msgs::sensor_msgs::PointCloud2;
use msgs::sensor_name::SensorName;
use msgs::topics::{self, Topic};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use recording::location::recording_at;
use recording::{Follower, Message, Recording};
use sim_server::setup;
use simulation::scenario::Scenario;

use crate::convert::from_json;
use crate::error::bad_input;
use crate::map::PyMap;
use crate::scenario::PyScenario;

/// A recording of a file, or a part of one in memory.
#[pyclass(name = "NativeRecording", module = "maes._maes", frozen)]
pub(crate) struct PyRecording {
    file: Arc<RecordingFile>,
    messages: Messages,
}

struct RecordingFile {
    recording: Recording,
    scenario: Scenario,
}

enum Messages {
    /// All of the file.
    OfFile,
    Part(Vec<Message>),
}

/// A recording that may still be written.
#[pyclass(name = "NativeFollower", module = "maes._maes", frozen)]
pub(crate) struct PyFollower {
    file: Arc<RecordingFile>,
    follower: Mutex<Follower>,
}

/// Times in s, positions in m of shape (N, 3), headings in rad.
type Poses<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

/// Times in s, and indices of the cells that were first seen then, free and wall.
type Scans<'py> = Vec<(f64, Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<u32>>)>;

/// Times of scans in s, and their hits in m, frame of the body, of shape (N, 3).
type Hits<'py> = Vec<(f64, Bound<'py, PyArray2<f32>>)>;

fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 / 1e9
}

/// The fields of a message; `None` for types that other tools decode.
fn fields(message: &Message) -> Option<serde_json::Value> {
    fn of<M: msgs::message::Message>(message: &Message) -> Option<serde_json::Value> {
        serde_json::to_value(message.decode::<M>().ok()?).ok()
    }
    match message.channel.type_name.as_str() {
        "maes_msgs/msg/Command" => of::<maes_msgs::Command>(message),
        "maes_msgs/msg/Digest" => of::<maes_msgs::Digest>(message),
        "maes_msgs/msg/Intervention" => of::<maes_msgs::Intervention>(message),
        "maes_msgs/msg/Join" => of::<maes_msgs::Join>(message),
        "maes_msgs/msg/MapChange" => of::<maes_msgs::MapChange>(message),
        "maes_msgs/msg/Observation" => of::<maes_msgs::Observation>(message),
        "maes_msgs/msg/Progress" => of::<maes_msgs::Progress>(message),
        "maes_msgs/msg/Result" => of::<maes_msgs::Result>(message),
        "maes_msgs/msg/Scenario" => of::<maes_msgs::Scenario>(message),
        "nav_msgs/msg/Odometry" => of::<msgs::nav_msgs::Odometry>(message),
        "nav_msgs/msg/Path" => of::<msgs::nav_msgs::Path>(message),
        "rosgraph_msgs/msg/Clock" => of::<msgs::rosgraph_msgs::Clock>(message),
        "tf2_msgs/msg/TFMessage" => of::<msgs::tf2_msgs::TFMessage>(message),
        "visualization_msgs/msg/Marker" => of::<msgs::visualization_msgs::Marker>(message),
        _ => None,
    }
}

impl RecordingFile {
    fn open(file: &Path) -> PyResult<Arc<Self>> {
        let recording = Recording::open(file).map_err(bad_input)?;
        let scenario = setup::load_recorded(&recording, None, &[]).map_err(bad_input)?;
        Ok(Arc::new(Self { recording, scenario }))
    }
}

impl PyRecording {
    fn all(&self) -> Box<dyn Iterator<Item = Cow<'_, Message>> + '_> {
        match &self.messages {
            Messages::OfFile => Box::new(self.file.recording.messages().map(Cow::Owned)),
            Messages::Part(messages) => Box::new(messages.iter().map(Cow::Borrowed)),
        }
    }

    /// The messages of topics of an agent, decoded.
    fn of_agent<M: msgs::message::Message>(
        &self,
        agent: u32,
        topics: impl Fn(AgentId) -> PyResult<Vec<Topic>>,
    ) -> PyResult<Vec<M>> {
        let topics = topics(self.agent(agent)?)?;
        let messages = self.all().filter(|message| topics.iter().any(|topic| message.channel.topic == topic.name));
        messages.map(|message| message.decode().map_err(bad_input)).collect()
    }

    /// An agent of the run.
    fn agent(&self, agent: u32) -> PyResult<AgentId> {
        if agent >= self.file.scenario.agents.count {
            let last = self.file.scenario.agents.count.saturating_sub(1);
            return Err(bad_input(format!("agent = {agent}: expected an agent of the run, 0 to {last}")));
        }
        Ok(AgentId(agent))
    }

    /// The names of the LiDARs of an agent; that of the only one is `None`.
    fn lidar_names(&self, agent: AgentId) -> Vec<Option<SensorName>> {
        self.file.scenario.lidars_of(agent).map(|(name, _)| name).collect()
    }

    fn observations(&self, agent: u32) -> PyResult<Vec<Observation>> {
        self.of_agent(agent, |agent| Ok(vec![topics::observation(agent)]))
    }
}

/// Bytes of x, y and z of a point.
const COORDINATES_BYTES: u32 = 12;

#[pymethods]
impl PyRecording {
    /// Reads a file.
    #[staticmethod]
    fn open(py: Python<'_>, file: PathBuf) -> PyResult<Self> {
        let file = recording_at(file).map_err(bad_input)?;
        let file = py.detach(|| RecordingFile::open(&file))?;
        Ok(Self { file, messages: Messages::OfFile })
    }

    /// The scenario of the run.
    #[getter]
    fn scenario(&self) -> PyResult<PyScenario> {
        PyScenario::of_recording(&self.file.scenario)
    }

    /// The true map, if the recording has it.
    fn map(&self, py: Python<'_>) -> PyResult<Option<PyMap>> {
        let map = py.detach(|| recording::map::read(&self.file.recording, &self.file.scenario)).map_err(bad_input)?;
        Ok(map.map(|terrain| PyMap { terrain }))
    }

    /// Number of messages by topic.
    fn topics(&self, py: Python<'_>) -> BTreeMap<String, usize> {
        py.detach(|| {
            let mut counts = BTreeMap::new();
            for message in self.all() {
                *counts.entry(message.channel.topic.clone()).or_default() += 1;
            }
            counts
        })
    }

    /// The messages of a topic: sim time in s and fields as a dictionary; the CDR bytes for types
    /// that are not decoded here.
    fn messages<'py>(&self, py: Python<'py>, topic: &str) -> PyResult<Vec<(f64, Bound<'py, PyAny>)>> {
        let of_topic = py.detach(|| {
            let messages = self.all().filter(|message| message.channel.topic == topic);
            messages.map(|message| (fields(&message), message.into_owned())).collect::<Vec<_>>()
        });
        of_topic
            .into_iter()
            .map(|(fields, message)| {
                let content = match fields {
                    Some(fields) => from_json(py, &fields)?,
                    None => PyBytes::new(py, &message.data).into_any(),
                };
                Ok((seconds(message.time_ns), content))
            })
            .collect()
    }

    /// The poses of an agent in its committed observations.
    fn poses<'py>(&self, py: Python<'py>, agent: u32) -> PyResult<Poses<'py>> {
        let mut observations = py.detach(|| self.observations(agent))?;
        observations.retain(|observation| observation.part == 0);
        let of = |read: fn(&Observation) -> f64| PyArray1::from_iter(py, observations.iter().map(read));
        let positions = observations.iter().map(|observation| &observation.position);
        let positions: Vec<f64> = positions.flat_map(|point| [point.x, point.y, point.z]).collect();
        let positions = PyArray1::from_vec(py, positions).reshape([observations.len(), 3])?;
        let times = of(|observation| seconds(msgs::ids::Tick(observation.tick).time_ns()));
        Ok((times, positions, of(|observation| observation.yaw_rad)))
    }

    /// What an agent has seen for the first time, by observation.
    fn scans<'py>(&self, py: Python<'py>, agent: u32) -> PyResult<Scans<'py>> {
        let observations = py.detach(|| self.observations(agent))?;
        let cells = |runs: &maes_msgs::CellRuns| {
            let cells: Vec<u32> = voxels::runs::indices(&runs.start, &runs.length).collect();
            PyArray1::from_vec(py, cells)
        };
        let row = |observation: &Observation| {
            let time_s = seconds(msgs::ids::Tick(observation.tick).time_ns());
            (time_s, cells(&observation.seen_free), cells(&observation.seen_wall))
        };
        Ok(observations.iter().map(row).collect())
    }

    /// The names of the LiDARs of an agent; none if it has only one of `[lidar]`.
    fn lidars(&self, agent: u32) -> PyResult<Vec<String>> {
        let names = self.lidar_names(self.agent(agent)?);
        Ok(names.into_iter().flatten().map(|name| name.to_string()).collect())
    }

    /// Where the rays of an agent, or of one of its LiDARs, have hit walls, by scan; none if the
    /// recording has no points.
    #[pyo3(signature = (agent, lidar=None))]
    fn hits<'py>(&self, py: Python<'py>, agent: u32, lidar: Option<&str>) -> PyResult<Hits<'py>> {
        let topics = |agent| {
            let names = self.lidar_names(agent);
            let is_asked =
                |name: &Option<SensorName>| lidar.is_none() || name.as_ref().map(SensorName::as_str) == lidar;
            let asked: Vec<Topic> =
                names.iter().copied().filter(is_asked).map(|name| topics::points(agent, name)).collect();
            if asked.is_empty() {
                let known: Vec<String> = names.iter().flatten().map(|name| format!("\"{name}\"")).collect();
                let known = if known.is_empty() { "None".to_owned() } else { known.join(", ") };
                let lidar = lidar.unwrap_or_default();
                return Err(bad_input(format!(
                    "lidar = \"{lidar}\": agent {agent} has no such LiDAR; expected {known}"
                )));
            }
            Ok(asked)
        };
        let clouds: Vec<PointCloud2> = py.detach(|| self.of_agent(agent, topics))?;
        let rows = clouds.iter().map(|cloud| {
            let stamp = &cloud.header.stamp;
            let time_s = f64::from(stamp.sec) + f64::from(stamp.nanosec) / 1e9;
            // The coordinates come first, see `protocol::map_views::cloud_with`.
            let points = cloud.data.chunks_exact(cloud.point_step.max(COORDINATES_BYTES) as usize);
            let numbers = points.flat_map(|point| point[..COORDINATES_BYTES as usize].as_chunks().0);
            let coordinates = numbers.map(|&bytes| f32::from_le_bytes(bytes));
            let points = PyArray1::from_iter(py, coordinates).reshape([cloud.width as usize, 3])?;
            Ok((time_s, points))
        });
        rows.collect()
    }

    /// The metrics at the end, or `None` if the recording has no result.
    fn result<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let topic = topics::result().name;
        let Some(message) = self.all().find(|message| message.channel.topic == topic) else {
            return Ok(None);
        };
        let result: maes_msgs::Result = message.decode().map_err(bad_input)?;
        let dict = PyDict::new(py);
        dict.set_item("digest", simulation::digest::Digest(result.digest).to_string())?;
        dict.set_item("reason", result.reason)?;
        dict.set_item("tick", result.tick)?;
        dict.set_item("explored", result.explored)?;
        dict.set_item("covered", result.covered)?;
        dict.set_item("distance_m", result.distance_m)?;
        let counters = result.counters.iter().map(|counter| (counter.present_name(), counter.value));
        let counters: BTreeMap<String, u64> = counters.collect();
        dict.set_item("counters", counters)?;
        Ok(Some(dict))
    }
}

#[pymethods]
impl PyFollower {
    /// Opens a file before its first message.
    #[new]
    fn open(py: Python<'_>, file: PathBuf) -> PyResult<Self> {
        let file = recording_at(file).map_err(bad_input)?;
        py.detach(|| {
            let follower = Mutex::new(Follower::open(&file).map_err(bad_input)?);
            Ok(Self { file: RecordingFile::open(&file)?, follower })
        })
    }

    /// The messages since the last call.
    fn read(&self, py: Python<'_>) -> PyResult<PyRecording> {
        let read = || self.follower.lock().unwrap_or_else(PoisonError::into_inner).read();
        let messages = py.detach(read).map_err(bad_input)?;
        Ok(PyRecording { file: Arc::clone(&self.file), messages: Messages::Part(messages) })
    }

    /// Whether the end of the recording has been read.
    #[getter]
    fn has_ended(&self, py: Python<'_>) -> bool {
        py.detach(|| self.follower.lock().unwrap_or_else(PoisonError::into_inner).has_ended())
    }
}
