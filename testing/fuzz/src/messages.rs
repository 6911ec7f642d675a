//! Target `messages`: decoding and validation of all messages and requests, on both sides.

use msgs::cdr;
use msgs::geometry_msgs::TwistStamped;
use msgs::ids::AgentId;
use msgs::maes_msgs::{
    Body, Command, Join, JoinReply, Observation, Scenario, SignedCommand, SignedJoin, SignedObservation,
};
use msgs::parameters::Parameters;
use msgs::rcl_interfaces::{
    DescribeParameters, DescribeParametersRequest, GetParameterTypes, GetParameterTypesRequest, GetParameters,
    GetParametersRequest, ListParameters, ListParametersRequest, Parameter, SetParameters, SetParametersAtomically,
    SetParametersAtomicallyRequest, SetParametersRequest,
};
use msgs::service::Service;
use msgs::simulation_interfaces::{
    DeleteEntity, GetEntities, GetEntitiesStates, GetEntityBounds, GetEntityInfo, GetEntityState, GetSimulationState,
    GetSimulatorFeatures, ResetSimulation, SetEntityState, SetSimulationState, SimulateStepsGoal, SpawnEntity,
    StepSimulation,
};
use protocol::command;
use protocol::observation::fragments::FragmentReassembler;
use protocol::run_info::RunInfo;
use serde::Serialize;
use serde::de::DeserializeOwned;
use simulation::{parameters, scenario, twist};

/// Number of agents of the run.
const AGENTS: u32 = 4;

/// Decodes the bytes as every type of incoming message.
pub(crate) fn all(bytes: &[u8]) {
    to_the_server(bytes);
    to_an_agent(bytes);
    requests(bytes);
}

/// The message, if the bytes are one. Its own encoding decodes to the same bytes.
fn decoded<M: Serialize + DeserializeOwned>(bytes: &[u8]) -> Option<M> {
    let message: M = cdr::decode(bytes).ok()?;
    let once = cdr::encode(&message);
    // Bytes are compared, because NaN is not equal to itself.
    let again: M = cdr::decode(&once).unwrap_or_else(|error| panic!("own bytes: {error}"));
    assert_eq!(cdr::encode(&again), once);
    Some(message)
}

fn to_the_server(bytes: &[u8]) {
    decoded::<Join>(bytes);
    decoded::<SignedJoin>(bytes);
    decoded::<SignedCommand>(bytes);
    let command = decoded::<Command>(bytes);
    let twist = decoded::<TwistStamped>(bytes);
    let of_twist = twist.and_then(|twist| twist::command(1, AgentId(0), &twist).ok());
    for command in command.into_iter().chain(of_twist) {
        if let Ok(legal) = command::Command::from_message(&command, AGENTS) {
            assert!(legal.wake.at.0 > command.tick || command.tick == u64::MAX, "an agent is due in a later tick");
        }
    }
}

fn to_an_agent(bytes: &[u8]) {
    decoded::<JoinReply>(bytes);
    decoded::<SignedObservation>(bytes);
    if let Some(scenario) = decoded::<Scenario>(bytes) {
        let _briefing = RunInfo::from_message(&scenario, AgentId(0));
    }
    if let Some(part) = decoded::<Observation>(bytes) {
        let (bodies, body_of) = (vec![Body::default()], vec![0; AGENTS as usize]);
        let scenario = Scenario { size: [40; 3], cell_m: 1.0, agents: AGENTS, bodies, body_of, ..Scenario::default() };
        let run_info = RunInfo::from_message(&Scenario { duration_ticks: u64::MAX, ..scenario }, AgentId(0));
        let run_info = run_info.expect("a legal one");
        let _collected = FragmentReassembler::default().take(part, &run_info);
    }
}

fn requests(bytes: &[u8]) {
    request::<GetSimulatorFeatures>(bytes);
    request::<GetSimulationState>(bytes);
    request::<SetSimulationState>(bytes);
    request::<StepSimulation>(bytes);
    request::<ResetSimulation>(bytes);
    request::<GetEntities>(bytes);
    request::<GetEntityState>(bytes);
    request::<GetEntitiesStates>(bytes);
    request::<GetEntityInfo>(bytes);
    request::<GetEntityBounds>(bytes);
    request::<SetEntityState>(bytes);
    request::<DeleteEntity>(bytes);
    request::<SpawnEntity>(bytes);
    // The goal of the action `SimulateSteps`.
    decoded::<SimulateStepsGoal>(bytes);
    let mut known = Parameters::default();
    known.declare(parameters::of(&run()));
    for names in [
        request::<GetParameters>(bytes).map(|GetParametersRequest { names }| names),
        request::<GetParameterTypes>(bytes).map(|GetParameterTypesRequest { names }| names),
        request::<DescribeParameters>(bytes).map(|DescribeParametersRequest { names }| names),
    ]
    .into_iter()
    .flatten()
    {
        let _values = (known.values(&names), known.descriptors(&names));
    }
    if let Some(ListParametersRequest { prefixes, depth }) = request::<ListParameters>(bytes) {
        let _listed = known.list(&prefixes, depth);
    }
    for parameters in [
        request::<SetParameters>(bytes).map(|SetParametersRequest { parameters }| parameters),
        request::<SetParametersAtomically>(bytes).map(|SetParametersAtomicallyRequest { parameters }| parameters),
    ]
    .into_iter()
    .flatten()
    {
        let before = known.clone();
        if known.set_all(&parameters).is_err() {
            assert_eq!(known, before, "what is refused changes nothing");
        }
        for named in &parameters {
            let Parameter { name, .. } = named;
            let _set = known.set(named);
            let _values = known.values(std::slice::from_ref(name));
        }
    }
}

fn request<S: Service>(bytes: &[u8]) -> Option<S::Request> {
    decoded(bytes)
}

/// Any run, for the names of its parameters.
fn run() -> scenario::Scenario {
    let text = "seed = 1\nduration_s = 1.0\nmap = { kind = \"spheres\", size = 20 }\nagents = { count = 4 }\n";
    scenario::Scenario::parse("run", text, &[]).expect("a legal scenario")
}
