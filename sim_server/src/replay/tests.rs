use std::path::Path;

use msgs::cdr;
use msgs::geometry_msgs::Point;
use msgs::ids::AgentId;
use msgs::message::Message;
use msgs::service::{Ask, Reply};
use msgs::simulation_interfaces::{
    Result as Outcome, ResultResponse, SetSimulationState, SetStateRequest, SimulationState, StepRequest,
};
use msgs::std_msgs::{ColorRGBA, Header};
use msgs::tf2_msgs::TFMessage;
use msgs::topics::{self, Topic};
use msgs::visualization_msgs::Marker;

use super::*;
use crate::recorder::{Document, Recorder};
use crate::recording::Recording;
use crate::setup::SCENARIO_ATTACHMENT;

const SCENARIO: &str = "seed = 1\nduration_s = 10.0\nmap = { kind = \"spheres\", size = 5 }\nagents = { count = 2 }\n";
const MAP: &str = "###\n###\n###\n\n###\n#.#\n###\n\n###\n###\n###\n";

/// A piece of the map, or its end if it is empty.
fn piece(id: i32, cubes: usize) -> Marker {
    let points = vec![Point::default(); cubes];
    Marker::cubes(Header::default(), "walls", id, 1.0, ColorRGBA::default(), points)
}

/// A recording of these messages, with these documents beside the scenario.
fn recording_with(documents: &[(&str, &str)], messages: &[(Topic, u64, Vec<u8>)]) -> Recording {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let document = |&(name, text): &(&'static str, &'static str)| Document {
        name,
        media_type: "text/plain",
        data: text.as_bytes(),
    };
    let documents: Vec<Document<'static>> =
        [&[(SCENARIO_ATTACHMENT, SCENARIO)], leaked(documents)].concat().iter().map(document).collect();
    let mut recorder = Recorder::create(&file, &documents).unwrap();
    for (topic, tick, bytes) in messages {
        recorder.write(topic, Tick(*tick), bytes).unwrap();
    }
    recorder.finish().unwrap();
    Recording::from_bytes("run.mcap".to_owned(), std::fs::read(file).unwrap()).unwrap()
}
