//! The services that clients of the WebSocket may call: those over ROS that are about time, and one that starts a run.

use std::sync::mpsc::{SyncSender, TrySendError};

use foxglove::Schema;
use foxglove::websocket::service::{Handler, Request as Call, Responder, Service, ServiceSchema};
use msgs::schema;
use msgs::service::{Ask, Reply};
use serde::{Deserialize, Serialize};

use crate::control::Request;
use simulation::scenario::Rtf;

/// Something that a client wants.
pub(super) enum ClientRequest {
    /// A request for the run, by the number of its service, as CDR.
    Service { service: usize, payload: Vec<u8>, responder: Responder },
    /// Another pace.
    Rtf(Rtf),
    /// Another run.
    Start(StartRequest),
}

/// Somebody wants to start a run, and waits to hear whether it has begun.
pub struct StartRequest {
    /// The scenario, TOML.
    pub scenario: String,
    responder: Responder,
}

/// What `/sim_server/start_run` is asked, JSON.
#[derive(Deserialize)]
struct StartBody {
    scenario: String,
}

/// What it answers.
#[derive(Serialize)]
struct StartResponse<'a> {
    started: bool,
    message: &'a str,
}

impl StartRequest {
    /// Answers: the run has begun, or why not.
    pub fn answer(self, outcome: Result<(), &str>) {
        let answer = StartResponse { started: outcome.is_ok(), message: outcome.err().unwrap_or_default() };
        self.responder.respond(serde_json::to_vec(&answer));
    }
}

/// How a request is made of what came in.
type Parse = fn(Vec<u8>, Responder) -> Result<Request, (String, Responder)>;

/// The services: name, type, and the request that each of them makes.
const SERVICES: [(&str, &str, Parse); 5] = [
    ("get_simulator_features", "GetSimulatorFeatures", |bytes, to| ask(bytes, to).map(Request::Features)),
    ("get_simulation_state", "GetSimulationState", |bytes, to| ask(bytes, to).map(Request::State)),
    ("set_simulation_state", "SetSimulationState", |bytes, to| ask(bytes, to).map(Request::SetState)),
    ("step_simulation", "StepSimulation", |bytes, to| ask(bytes, to).map(Request::Step)),
    ("reset_simulation", "ResetSimulation", |bytes, to| ask(bytes, to).map(Request::Reset)),
];

/// Offers everything; what is called is put into `requests`.
pub(super) fn all(requests: &SyncSender<ClientRequest>, is_idle: bool) -> Vec<Service> {
    let mut services: Vec<Service> = SERVICES
        .iter()
        .enumerate()
        .map(|(number, (name, of_type, _))| {
            let (request, response) = schema::service(of_type);
            let of_type = format!("simulation_interfaces/srv/{of_type}");
            let part = |kind, text: String| Schema::new(format!("{of_type}_{kind}"), "ros2msg", text.into_bytes());
            let schema = ServiceSchema::new(of_type.as_str())
                .with_request("cdr", part("Request", request))
                .with_response("cdr", part("Response", response));
            let wrap = move |call: Call, responder| ClientRequest::Service {
                service: number,
                payload: call.payload().to_vec(),
                responder,
            };
            Service::builder(format!("/sim_server/{name}"), schema)
                .handler(CallQueue { requests: requests.clone(), wrap })
        })
        .collect();
    if is_idle {
        services.push(start_service(requests));
    }
    services
}

fn start_service(requests: &SyncSender<ClientRequest>) -> Service {
    let schema = |name: &str, text: &'static str| Schema::new(name, "jsonschema", text.as_bytes());
    let request = r#"{"type":"object","properties":{"scenario":{"type":"string"}},"required":["scenario"]}"#;
    let response = r#"{"type":"object","properties":{"started":{"type":"boolean"},"message":{"type":"string"}}}"#;
    let schema = ServiceSchema::new("maes_msgs/srv/StartRun")
        .with_request("json", schema("maes_msgs/srv/StartRun_Request", request))
        .with_response("json", schema("maes_msgs/srv/StartRun_Response", response));
    Service::builder("/sim_server/start_run", schema).handler(StartQueue(requests.clone()))
}

/// Puts calls into the queue for the run.
struct CallQueue<F> {
    requests: SyncSender<ClientRequest>,
    wrap: F,
}

impl<F: Fn(Call, Responder) -> ClientRequest + Send + Sync> Handler for CallQueue<F> {
    fn call(&self, request: Call, responder: Responder) {
        enqueue(&self.requests, (self.wrap)(request, responder));
    }
}

struct StartQueue(SyncSender<ClientRequest>);

impl Handler for StartQueue {
    fn call(&self, request: Call, responder: Responder) {
        match serde_json::from_slice::<StartBody>(request.payload()) {
            Ok(StartBody { scenario }) => enqueue(&self.0, ClientRequest::Start(StartRequest { scenario, responder })),
            Err(error) => responder.respond_err(format!("expected {{\"scenario\": \"<TOML>\"}}: {error}")),
        }
    }
}

/// Waits for nobody: who comes too often is refused.
pub(super) fn enqueue(requests: &SyncSender<ClientRequest>, request: ClientRequest) {
    let (refused, reason) = match requests.try_send(request) {
        Ok(()) => return,
        Err(TrySendError::Full(request)) => (request, "too many requests are waiting"),
        Err(TrySendError::Disconnected(request)) => (request, "the simulator is about to end"),
    };
    refuse(refused, reason);
}

/// Says no.
pub(super) fn refuse(request: ClientRequest, reason: &str) {
    match request {
        ClientRequest::Service { responder, .. } => responder.respond_err(reason.to_owned()),
        ClientRequest::Start(request) => request.answer(Err(reason)),
        ClientRequest::Rtf(_) => {}
    }
}

/// What the run is asked; nothing, if it was answered already because it makes no sense.
pub(super) fn request(request: ClientRequest) -> Option<Request> {
    match request {
        ClientRequest::Rtf(rtf) => Some(Request::Rtf(rtf)),
        ClientRequest::Start(request) => {
            request.answer(Err("a run is under way; end it first"));
            None
        }
        ClientRequest::Service { service, payload, responder } => {
            let (_, _, parse) = SERVICES[service];
            parse(payload, responder).map_err(|(reason, responder)| responder.respond_err(reason)).ok()
        }
    }
}

fn ask<S: msgs::service::Service>(payload: Vec<u8>, responder: Responder) -> Result<Ask<S>, (String, Responder)> {
    match msgs::cdr::decode::<S::Request>(&payload) {
        Ok(request) => {
            Ok(Ask { request, reply: Reply::new(move |answer| responder.respond_ok(msgs::cdr::encode(&answer))) })
        }
        Err(error) => Err((format!("{}/srv/{}_Request: {error}", S::PACKAGE, S::NAME), responder)),
    }
}
