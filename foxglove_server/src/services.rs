//! The services of the WebSocket: those over ROS that control time or change the map, and one that
//! starts a run.

use std::sync::Arc;
use std::sync::mpsc::{SyncSender, TrySendError};

use foxglove::websocket::ws_protocol::schema::Schema;
use foxglove::websocket::ws_protocol::server::advertise_services::Service;
use foxglove::websocket::ws_protocol::server::{AdvertiseServices, ServiceCallFailure, ServiceCallResponse};
use msgs::maes_msgs::ChangeMap;
use msgs::schema::{self, ServiceSchema};
use msgs::service::{Ask, Reply};
use msgs::simulation_interfaces::{
    GetSimulationState, GetSimulatorFeatures, ResetSimulation, ResetSimulationResponse, Result as Outcome,
    SetSimulationState, StepSimulation,
};
use serde::{Deserialize, Serialize};

use super::outbox::{CALLS_MAX, Outbox};
use simulation::scenario::Rtf;
use transport::control::{Request, ResetScope, reset_scope};

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
    /// Whether the run is recorded, under a name of the server's own making.
    pub is_recorded: bool,
    responder: Responder,
}

/// What a client can ask a server without a run for.
pub enum IdleRequest {
    /// A run of a scenario.
    Start(StartRequest),
    /// The last run again, from its beginning.
    Restart(Ask<ResetSimulation>),
}

impl IdleRequest {
    /// Answers that the run has started, with the file name of its recording if there is one, or
    /// why not.
    pub fn answer(self, outcome: Result<Option<&str>, &str>) {
        match self {
            Self::Start(request) => request.answer(outcome),
            Self::Restart(ask) => ask.answer(|_| ResetSimulationResponse {
                result: match outcome {
                    Ok(_) => Outcome::ok(),
                    Err(reason) => Outcome::failure(Outcome::RESULT_OPERATION_FAILED, reason),
                },
            }),
        }
    }
}

/// Request of `/sim_server/start_run`, JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StartBody {
    scenario: String,
    #[serde(default)]
    record: bool,
}

/// Its response, JSON.
#[derive(Serialize)]
struct StartResponse<'a> {
    started: bool,
    message: &'a str,
    /// File name of the recording, in the folder of recordings.
    #[serde(skip_serializing_if = "Option::is_none")]
    recording: Option<&'a str>,
}

impl StartRequest {
    /// Answers that the run has started, with the file name of its recording if there is one, or
    /// why not.
    pub fn answer(self, outcome: Result<Option<&str>, &str>) {
        let answer = StartResponse {
            started: outcome.is_ok(),
            message: outcome.err().unwrap_or_default(),
            recording: outcome.unwrap_or_default(),
        };
        match serde_json::to_vec(&answer) {
            Ok(answer) => self.responder.respond_ok(answer),
            Err(error) => self.responder.respond_err(error.to_string()),
        }
    }
}

/// Decodes the payload of a call.
type Parse = fn(Vec<u8>, Responder) -> Result<Request, (String, Responder)>;

/// Makes the definitions of a service.
type Describe = fn() -> ServiceSchema;

/// Services: name, definitions and decoder.
const SERVICES: [(&str, Describe, Parse); 6] = [
    ("get_simulator_features", schema::service::<GetSimulatorFeatures>, |bytes, to| {
        ask(bytes, to).map(Request::Features)
    }),
    ("get_simulation_state", schema::service::<GetSimulationState>, |bytes, to| ask(bytes, to).map(Request::State)),
    ("set_simulation_state", schema::service::<SetSimulationState>, |bytes, to| ask(bytes, to).map(Request::SetState)),
    ("step_simulation", schema::service::<StepSimulation>, |bytes, to| ask(bytes, to).map(Request::Step)),
    (RESET, schema::service::<ResetSimulation>, |bytes, to| ask(bytes, to).map(Request::Reset)),
    ("change_map", schema::service::<ChangeMap>, |bytes, to| ask(bytes, to).map(Request::ChangeMap)),
];

/// The name of the service that restarts a run.
const RESET: &str = "reset_simulation";

/// The name of the service that starts runs.
const START: &str = "/sim_server/start_run";

/// The type of the service that starts runs.
const START_TYPE: &str = "maes_msgs/srv/StartRun";

/// The services of a server; their calls go into the queue of requests. The id of a service is its
/// place in the list, from 1.
pub(super) struct Services {
    requests: SyncSender<ClientRequest>,
    is_idle: bool,
}

impl Services {
    pub(super) fn new(requests: SyncSender<ClientRequest>, is_idle: bool) -> Self {
        Self { requests, is_idle }
    }

    /// The message that lists the services.
    pub(super) fn list(&self) -> AdvertiseServices<'static> {
        let ros = SERVICES.iter().filter_map(|(name, schema, _)| {
            let ServiceSchema { of_type, request, response } = schema();
            let part = |kind, text: String| Schema::new(format!("{of_type}_{kind}"), "ros2msg", text.into_bytes());
            service(
                format!("/sim_server/{name}"),
                &of_type,
                "cdr",
                part("Request", request),
                part("Response", response),
            )
        });
        let start = self.is_idle.then(|| {
            let request = r#"{"type":"object","properties":{"scenario":{"type":"string"},"record":{"type":"boolean"}},"required":["scenario"]}"#;
            let response = r#"{"type":"object","properties":{"started":{"type":"boolean"},"message":{"type":"string"},"recording":{"type":"string"}}}"#;
            let part = |kind, text: &'static str| Schema::new(format!("{START_TYPE}_{kind}"), "jsonschema", text.as_bytes());
            service(START.to_owned(), START_TYPE, "json", part("Request", request), part("Response", response))
        });
        AdvertiseServices::new(ros.chain(start.flatten()).zip(1..).map(|(service, id)| Service { id, ..service }))
    }

    /// Queues a call of a client, or refuses it.
    pub(super) fn call(&self, outbox: &Arc<Outbox>, service_id: u32, call_id: u32, encoding: &str, payload: Vec<u8>) {
        let refuse = |reason: &str| outbox.reply(&ServiceCallFailure::new(service_id, call_id, reason));
        let Some(service) = usize::try_from(service_id).ok().and_then(|id| id.checked_sub(1)) else {
            return refuse("Unknown service");
        };
        let expected = match service.cmp(&SERVICES.len()) {
            std::cmp::Ordering::Less => "cdr",
            std::cmp::Ordering::Equal if self.is_idle => "json",
            _ => return refuse("Unknown service"),
        };
        if encoding != expected {
            return refuse("Unsupported encoding");
        }
        if !outbox.begin_call() {
            return refuse(&format!("more than {CALLS_MAX} calls wait for their reply"));
        }
        let responder = Responder { outbox: Some(Arc::clone(outbox)), service_id, call_id, encoding: expected };
        let request = if service < SERVICES.len() {
            ClientRequest::Service { service, payload, responder }
        } else {
            match serde_json::from_slice::<StartBody>(&payload) {
                Ok(StartBody { scenario, record }) => {
                    ClientRequest::Start(StartRequest { scenario, is_recorded: record, responder })
                }
                Err(error) => {
                    let expected = "expected {\"scenario\": \"<TOML>\", \"record\": true or false}";
                    return responder.respond_err(format!("{expected}: {error}"));
                }
            }
        };
        // Its responder has told the client why, if it was refused.
        let _ = enqueue(&self.requests, request);
    }
}

/// A service without its id.
fn service(
    name: String,
    of_type: &str,
    encoding: &'static str,
    request: Schema<'static>,
    response: Schema<'static>,
) -> Option<Service<'static>> {
    let service = Service::new(0, name, of_type.to_owned());
    service.with_request(encoding, request).and_then(|service| service.with_response(encoding, response)).ok()
}

/// The reply to a call that is still due. A call whose responder is dropped is answered with an
/// error.
pub(super) struct Responder {
    /// `None` once the call was answered.
    outbox: Option<Arc<Outbox>>,
    service_id: u32,
    call_id: u32,
    encoding: &'static str,
}

impl Responder {
    pub(super) fn respond_ok(mut self, payload: Vec<u8>) {
        if let Some(outbox) = self.outbox.take() {
            outbox.end_call(&ServiceCallResponse {
                service_id: self.service_id,
                call_id: self.call_id,
                encoding: self.encoding.into(),
                payload: payload.into(),
            });
        }
    }

    pub(super) fn respond_err(mut self, reason: String) {
        self.fail(reason);
    }

    fn fail(&mut self, reason: String) {
        if let Some(outbox) = self.outbox.take() {
            outbox.end_call(&ServiceCallFailure::new(self.service_id, self.call_id, reason));
        }
    }
}

impl Drop for Responder {
    fn drop(&mut self) {
        self.fail("the simulator has not answered".to_owned());
    }
}

/// Queues a request without blocking, or refuses it.
///
/// # Errors
/// Why it was refused. A call has been answered with the reason; a real-time factor has no reply,
/// and its client is still to be told.
pub(super) fn enqueue(requests: &SyncSender<ClientRequest>, request: ClientRequest) -> Result<(), &'static str> {
    let (refused, reason) = match requests.try_send(request) {
        Ok(()) => return Ok(()),
        Err(TrySendError::Full(request)) => (request, "too many requests are waiting"),
        Err(TrySendError::Disconnected(request)) => (request, "the simulator is about to end"),
    };
    refuse(refused, reason);
    Err(reason)
}

/// Refuses a request.
pub(super) fn refuse(request: ClientRequest, reason: &str) {
    match request {
        ClientRequest::Service { responder, .. } => responder.respond_err(reason.to_owned()),
        ClientRequest::Start(request) => request.answer(Err(reason)),
        ClientRequest::Rtf(_) => {}
    }
}

/// The request for a run of a server that has none, or `None` if it was answered already.
pub(super) fn idle_request(asked: ClientRequest) -> Option<IdleRequest> {
    match asked {
        ClientRequest::Start(request) => Some(IdleRequest::Start(request)),
        ClientRequest::Service { service, .. } if SERVICES[service].0 == RESET => match request(asked)? {
            Request::Reset(ask) => restart(ask),
            _ => None,
        },
        ClientRequest::Service { .. } | ClientRequest::Rtf(_) => {
            refuse(asked, "there is no run; /sim_server/start_run starts one");
            None
        }
    }
}

/// The request to repeat the last run, or `None` if it is answered because of its scope.
fn restart(ask: Ask<ResetSimulation>) -> Option<IdleRequest> {
    let result = match reset_scope(ask.request.scope, false) {
        Ok(ResetScope::Run) => return Some(IdleRequest::Restart(ask)),
        Ok(ResetScope::Nothing) => Outcome::ok(),
        Err(refused) => refused,
    };
    ask.answer(|_| ResetSimulationResponse { result });
    None
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
