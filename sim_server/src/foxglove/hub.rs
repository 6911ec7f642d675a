//! State shared by the clients of the WebSocket and the run: subscriptions, latched messages, live
//! stream and parameters.
//!
//! Client callbacks run on their own threads; one lock, always held briefly, guards the state.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::time::Duration;

use foxglove::websocket::{
    AnyClient, AssetHandler, AssetResponder, ChannelView, Client, GetParametersResponder, Parameter, ParameterHandler,
    ParameterType, ParameterValue, ServerListener, SetParametersResponder,
};
use foxglove::{PartialMetadata, RawChannel, WebSocketServerHandle};
use msgs::ids::Tick;
use msgs::parameters::Value;

use super::services::{ClientRequest, enqueue};
use crate::live_stream::{LiveStreamReader, StreamChunk};
use simulation::parameters;
use simulation::scenario::{Rtf, Scenario};

/// Prefix of asset names; session and offset follow.
const SCHEME: &str = "maes://run/";

/// Maximum bytes of an answer.
const CHUNK_BYTES_MAX: usize = 1 << 20;

/// The shared state and its callbacks.
pub(super) struct Hub {
    state: Mutex<State>,
    /// Signalled when a client has read the live stream to its end, or has gone.
    stream_read: Condvar,
    requests: SyncSender<ClientRequest>,
    server: OnceLock<Weak<WebSocketServerHandle>>,
}

#[derive(Default)]
struct State {
    session: String,
    stream: Option<LiveStreamReader>,
    /// The stream of a run that is not announced yet.
    next_stream: Option<LiveStreamReader>,
    /// Clients that read the live stream, and whether to its end.
    readers: BTreeMap<u32, bool>,
    parameters: Vec<Parameter>,
    topics: BTreeMap<String, TopicState>,
    /// Grows with every change of subscriptions.
    revision: u64,
}

/// A topic with its subscribers.
struct TopicState {
    channel: Arc<RawChannel>,
    subscribers: BTreeSet<u32>,
    arrivals: u64,
    /// The latched message with its time in ns, for late subscribers.
    last: Option<(Vec<u8>, u64)>,
}

impl Hub {
    pub(super) fn new(requests: SyncSender<ClientRequest>) -> Self {
        let session = format!("idle-{:016x}", getrandom::u64().unwrap_or_default());
        let state = Mutex::new(State { session, ..State::default() });
        Self { state, stream_read: Condvar::new(), requests, server: OnceLock::new() }
    }

    pub(super) fn set_server(&self, server: &Arc<WebSocketServerHandle>) {
        // Set once, before any client connects.
        let _ = self.server.set(Arc::downgrade(server));
    }

    pub(super) fn session(&self) -> String {
        self.state().session.clone()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn server(&self) -> Option<Arc<WebSocketServerHandle>> {
        self.server.get()?.upgrade()
    }

    /// Sets the stream of the run that starts next.
    pub(super) fn set_next_stream(&self, stream: LiveStreamReader) {
        self.state().next_stream = Some(stream);
    }

    /// Starts the session of a run: clients drop their state of an earlier one.
    pub(super) fn start_session(
        &self,
        run: u64,
        scenario: &Scenario,
        channels: impl IntoIterator<Item = Arc<RawChannel>>,
    ) {
        let session = format!("{run:016x}");
        let former = std::mem::take(&mut self.state().topics);
        // Closing a channel calls back into this state, so it happens without the lock.
        former.into_values().for_each(|topic| topic.channel.close());
        {
            let mut state = self.state();
            state.session.clone_from(&session);
            state.stream = state.next_stream.take();
            state.readers.clear();
            state.parameters = parameters::of(scenario)
                .into_iter()
                .filter_map(|known| parameter(known.descriptor.name, &known.value))
                .collect();
            state.topics = channels
                .into_iter()
                .map(|channel| {
                    let topic = TopicState { channel, subscribers: BTreeSet::new(), arrivals: 0, last: None };
                    (topic.channel.topic().to_owned(), topic)
                })
                .collect();
            state.revision += 1;
        }
        if let Some(server) = self.server() {
            server.clear_session(Some(session));
        }
    }

    /// Subscriptions ever made to each topic that has subscribers now, if subscriptions may have
    /// changed since `revision`.
    pub(super) fn arrivals(&self, revision: &mut u64) -> Option<Vec<(String, u64)>> {
        let state = self.state();
        if state.revision == *revision {
            return None;
        }
        *revision = state.revision;
        let observed = state.topics.iter().filter(|(_, topic)| !topic.subscribers.is_empty());
        Some(observed.map(|(name, topic)| (name.clone(), topic.arrivals)).collect())
    }

    /// Publishes a message that late subscribers receive as well.
    pub(super) fn publish_latched(&self, topic: &str, bytes: Vec<u8>, tick: Tick) {
        let mut state = self.state();
        if let Some(topic) = state.topics.get_mut(topic) {
            topic.channel.log_with_meta(&bytes, PartialMetadata::with_log_time(tick.time_ns()));
            topic.last = Some((bytes, tick.time_ns()));
        }
    }

    /// Sets the parameter of the real-time factor, and publishes it if it has changed.
    pub(super) fn set_rtf(&self, rtf: Rtf) {
        let set = rtf_parameter(rtf);
        match self.state().parameters.iter_mut().find(|known| known.name == set.name) {
            Some(known) if *known != set => *known = set.clone(),
            _ => return,
        }
        if let Some(server) = self.server() {
            server.publish_parameter_values(vec![set]);
        }
    }

    /// Waits until every reader of the live stream has read its end or has gone.
    pub(super) fn wait_for_readers(&self, timeout: Duration, are_all_gone: impl Fn() -> bool) {
        let is_read = |state: &State| are_all_gone() || state.readers.values().all(|has_end| *has_end);
        let (_state, _) = self
            .stream_read
            .wait_timeout_while(self.state(), timeout, |state| !is_read(state))
            .unwrap_or_else(PoisonError::into_inner);
    }

    /// Reads a chunk of the live stream by the name of an asset.
    fn read_stream(&self, client: u32, uri: &str) -> Result<Vec<u8>, String> {
        let part = uri.strip_prefix(SCHEME).and_then(|rest| rest.split_once('/'));
        let named = part.and_then(|(session, offset)| Some((session, offset.parse().ok()?)));
        let (session, offset) = named.ok_or_else(|| format!("{uri}: expected {SCHEME}<session>/<offset>"))?;
        let stream = {
            let mut state = self.state();
            if state.session != session {
                return Err("gone".to_owned());
            }
            let stream = state.stream.clone();
            state.readers.entry(client).or_insert(false);
            stream
        };
        // The lock is released while the file is read.
        match stream.ok_or("gone")?.read(offset, CHUNK_BYTES_MAX)? {
            StreamChunk::Bytes(bytes) => Ok(bytes),
            StreamChunk::End => {
                self.state().readers.insert(client, true);
                self.stream_read.notify_all();
                Err("ended".to_owned())
            }
        }
    }
}

impl ServerListener for Hub {
    fn on_client_disconnect(&self) {
        self.stream_read.notify_all();
    }

    fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
        let mut state = self.state();
        state.revision += 1;
        if let Some(topic) = state.topics.get_mut(channel.topic()) {
            topic.subscribers.insert(client.id().into());
            topic.arrivals += 1;
            if let Some((bytes, time_ns)) = &topic.last {
                topic.channel.log_with_meta_to_sink(bytes, PartialMetadata::with_log_time(*time_ns), client.sink_id());
            }
        }
    }

    fn on_unsubscribe(&self, client: Client, channel: ChannelView<'_>) {
        let mut state = self.state();
        state.revision += 1;
        if let Some(topic) = state.topics.get_mut(channel.topic()) {
            topic.subscribers.remove(&client.id().into());
        }
    }
}

impl AssetHandler for Hub {
    fn fetch(&self, uri: String, responder: AssetResponder) {
        let chunk = self.read_stream(responder.client().id().into(), &uri);
        responder.respond(chunk);
    }
}

impl ParameterHandler for Hub {
    fn get(&self, _: AnyClient, names: Vec<String>, _: Option<String>, responder: GetParametersResponder) {
        let all = self.state().parameters.clone();
        let is_asked = |parameter: &Parameter| names.is_empty() || names.contains(&parameter.name);
        responder.respond(all.into_iter().filter(is_asked).collect());
    }

    fn set(&self, client: AnyClient, wanted: Vec<Parameter>, _: Option<String>, responder: SetParametersResponder) {
        let mut set = Vec::new();
        for parameter in wanted {
            let value = match parameter.value {
                Some(ParameterValue::Float64(value)) => value,
                Some(ParameterValue::Integer(value)) => value as f64,
                _ => f64::NAN,
            };
            let rtf = match parameter.name.as_str() {
                parameters::RTF => parameters::pace(parameters::RTF, value),
                name => Err(format!("{name}: cannot be set during a run")),
            };
            match rtf {
                Ok(rtf) => {
                    enqueue(&self.requests, ClientRequest::Rtf(rtf));
                    set.push(rtf_parameter(rtf));
                }
                Err(reason) => client.send_error(reason),
            }
        }
        responder.respond(set);
    }
}

fn rtf_parameter(rtf: Rtf) -> Parameter {
    Parameter {
        name: parameters::RTF.to_owned(),
        r#type: Some(ParameterType::Float64),
        value: Some(ParameterValue::Float64(parameters::value_of(rtf))),
    }
}

/// A scenario key as a parameter of the WebSocket.
fn parameter(name: String, value: &Value) -> Option<Parameter> {
    let (kind, value) = match value.kind {
        Value::BOOL => (None, ParameterValue::Bool(value.bool_value)),
        Value::INTEGER => (None, ParameterValue::Integer(value.integer_value)),
        // JSON has no infinity.
        Value::DOUBLE if !value.double_value.is_finite() => {
            (None, ParameterValue::String(value.double_value.to_string()))
        }
        Value::DOUBLE => (Some(ParameterType::Float64), ParameterValue::Float64(value.double_value)),
        Value::STRING => (None, ParameterValue::String(value.string_value.clone())),
        Value::INTEGER_ARRAY => {
            let numbers = value.integer_array_value.iter().map(|number| ParameterValue::Integer(*number));
            (None, ParameterValue::Array(numbers.collect()))
        }
        _ => return None,
    };
    Some(Parameter { name, r#type: kind, value: Some(value) })
}
