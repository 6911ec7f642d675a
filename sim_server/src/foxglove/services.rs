//! The services of the WebSocket: those over ROS that control time, and one that starts a run.

use std::sync::mpsc::{SyncSender, TrySendError};

use foxglove::Schema;
use foxglove::websocket::service::{Handler, Request as Call, Responder, Service, ServiceSchema};
use msgs::schema;
use msgs::service::{Ask, Reply};
use serde::{Deserialize, Serialize};

use crate::control::Request;
use simulation::scenario::Rtf;

/// A request of a client.
pub(super) enum ClientRequest {
    /// A request for the run: index of its service, and CDR payload.
    Service { service: usize, payload: Vec<u8>, responder: Responder },
    /// Set the real-time factor.
    Rtf(Rtf),
    /// Start a run.
    Start(StartRequest),
}

/// A pending request to start a run.
pub struct StartRequest {
    /// Scenario as TOML.
    pub scenario: String,
    responder: Responder,
}

/// Request of `/sim_server/start_run`, JSON.
#[derive(Deserialize)]
struct StartBody {
    scenario: String,
}

/// Its response, JSON.
#[derive(Serialize)]
struct StartResponse<'a> {
    started: bool,
    message: &'a str,
}

impl StartRequest {
    /// Answers whether the run has started, or why not.
    pub fn answer(self, outcome: Result<(), &str>) {
        let answer = StartResponse { started: outcome.is_ok(), message: outcome.err().unwrap_or_default() };
        self.responder.respond(serde_json::to_vec(&answer));
    }
}

/// Decodes the payload of a call.
type Parse = fn(Vec<u8>, Responder) -> Result<Request, (String, Responder)>;

/// Services: name, type and decoder.
const SERVICES: [(&str, &str, Parse); 5] = [
    ("get_simulator_features", "GetSimulatorFeatures", |bytes, to| ask(bytes, to).map(Request::Features)),
    ("get_simulation_state", "GetSimulationState", |bytes, to| ask(bytes, to).map(Request::State)),
    ("set_simulation_state", "SetSimulationState", |bytes, to| ask(bytes, to).map(Request::SetState)),
    ("step_simulation", "StepSimulation", |bytes, to| ask(bytes, to).map(Request::Step)),
    ("reset_simulation", "ResetSimulation", |bytes, to| ask(bytes, to).map(Request::Reset)),
];

/// All services; their calls go into `requests`.
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

/// Queues calls for the run.
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

/// Queues a request without blocking, or refuses it.
pub(super) fn enqueue(requests: &SyncSender<ClientRequest>, request: ClientRequest) {
    let (refused, reason) = match requests.try_send(request) {
        Ok(()) => return,
        Err(TrySendError::Full(request)) => (request, "too many requests are waiting"),
        Err(TrySendError::Disconnected(request)) => (request, "the simulator is about to end"),
    };
    refuse(refused, reason);
}

/// Refuses a request.
pub(super) fn refuse(request: ClientRequest, reason: &str) {
    match request {
        ClientRequest::Service { responder, .. } => responder.respond_err(reason.to_owned()),
        ClientRequest::Start(request) => request.answer(Err(reason)),
        ClientRequest::Rtf(_) => {}
    }
}

/// The request for the run, or `None` if it was answered already.
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
