//! State shared by the clients of the WebSocket and the run: subscriptions, latched messages, live
//! stream and parameters.
//!
//! Clients are served on their own threads; one lock, always held briefly, guards the state.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use foxglove::websocket::ws_protocol::client::{ClientMessage, ServiceCallRequest, Subscription};
use foxglove::websocket::ws_protocol::schema::Schema;
use foxglove::websocket::ws_protocol::server::server_info::Capability;
use foxglove::websocket::ws_protocol::server::{
    Advertise, Channel, FetchAssetResponse, MessageData, ParameterValues, ServerInfo, Status, Time, Unadvertise,
};
use foxglove::websocket::{Parameter, ParameterType, ParameterValue};
use msgs::cdr;
use msgs::ids::Tick;
use msgs::rcl_interfaces::{ParameterType as DeclaredType, ParameterValue as DeclaredValue};
use msgs::schema;
use msgs::topics::Topic;
use msgs::visualization_msgs::Marker;
use tokio_tungstenite::tungstenite::Message;

use super::outbox::{DATA_BYTES_MAX, DATA_MAX, Outbox};
use super::services::{ClientRequest, Services, enqueue};
use recording::live_stream::{LiveStreamReader, StreamChunk};
use simulation::parameters;
use simulation::scenario::{Rtf, Scenario};

/// Prefix of asset names; session and offset follow.
const SCHEME: &str = "maes://run/";

/// Maximum bytes of an answer.
const CHUNK_BYTES_MAX: usize = 1 << 20;

/// Topics in one message of the list of topics.
const ADVERTISED_TOPICS_MAX: usize = 100;

/// Maximum subscriptions of one client, and parameters that it follows.
const SUBSCRIPTIONS_MAX: usize = 16_384;

/// The state that clients and the run share.
pub(super) struct Hub {
    state: Mutex<State>,
    /// Signalled when a client has read the live stream to its end, or has gone.
    stream_read: Condvar,
    requests: SyncSender<ClientRequest>,
    services: Services,
    is_idle: bool,
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
    /// By channel, which no other topic ever has again.
    topics: BTreeMap<u64, TopicState>,
    channel_of_topic: BTreeMap<String, u64>,
    channels_ever: u64,
    clients: BTreeMap<u32, ClientState>,
    clients_ever: u32,
    /// Grows with every change of subscriptions.
    revision: u64,
}

/// A topic with its subscribers.
struct TopicState {
    topic: Topic,
    /// Subscriptions by client.
    subscribers: BTreeMap<u32, u32>,
    arrivals: u64,
    /// The last messages, for late subscribers: as many as the depth says, or of markers the last
    /// one of each piece, as far as an outbox holds them.
    latched: VecDeque<LatchedMessage>,
}

/// A message for late subscribers.
struct LatchedMessage {
    bytes: Vec<u8>,
    time_ns: u64,
    /// `ns` and `id` of a marker, which a later marker with them replaces.
    marker: Option<(String, i32)>,
}

/// A connected client.
struct ClientState {
    outbox: Arc<Outbox>,
    /// Channels by subscription.
    subscriptions: BTreeMap<u32, u64>,
    /// Names of the parameters that it follows.
    parameters: BTreeSet<String>,
}

impl Hub {
    pub(super) fn new(requests: SyncSender<ClientRequest>, is_idle: bool) -> Self {
        let session = format!("idle-{:016x}", getrandom::u64().unwrap_or_default());
        let state = Mutex::new(State { session, ..State::default() });
        let services = Services::new(requests.clone(), is_idle);
        Self { state, stream_read: Condvar::new(), requests, services, is_idle }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Connects a client: it learns what the server has.
    pub(super) fn join(&self) -> (u32, Arc<Outbox>) {
        let outbox = Arc::new(Outbox::default());
        let mut state = self.state();
        outbox.reply(&self.info(&state));
        state.topic_lists().into_iter().for_each(|list| outbox.reply(list));
        outbox.reply(&self.services.list());
        state.clients_ever += 1;
        let id = state.clients_ever;
        let client =
            ClientState { outbox: Arc::clone(&outbox), subscriptions: BTreeMap::new(), parameters: BTreeSet::new() };
        state.clients.insert(id, client);
        (id, outbox)
    }

    /// Disconnects a client.
    pub(super) fn leave(&self, id: u32) {
        let mut state = self.state();
        if let Some(client) = state.clients.remove(&id) {
            client.subscriptions.into_values().for_each(|channel| state.remove_subscriber(id, channel));
        }
        state.readers.remove(&id);
        self.stream_read.notify_all();
    }

    fn info(&self, state: &State) -> ServerInfo {
        let metadata = [("maes".to_owned(), "1".to_owned()), ("idle".to_owned(), self.is_idle.to_string())];
        let capabilities = [
            Capability::Time,
            Capability::Parameters,
            Capability::ParametersSubscribe,
            Capability::Services,
            Capability::Assets,
        ];
        ServerInfo::new("MAES")
            .with_capabilities(capabilities)
            .with_supported_encodings(["cdr", "json"])
            .with_metadata(metadata.into_iter().collect())
            .with_session_id(&state.session)
    }

    /// Sets the stream of the run that starts next.
    pub(super) fn set_next_stream(&self, stream: LiveStreamReader) {
        self.state().next_stream = Some(stream);
    }

    /// Starts the session of a run: clients drop their state of an earlier one.
    pub(super) fn start_session(&self, run: u64, scenario: &Scenario, topics: impl IntoIterator<Item = Topic>) {
        let mut state = self.state();
        let former = std::mem::take(&mut state.topics);
        state.channel_of_topic.clear();
        state.session = format!("{run:016x}");
        state.stream = state.next_stream.take();
        state.readers.clear();
        state.parameters = parameters::of(scenario)
            .into_iter()
            .filter_map(|known| parameter(known.descriptor.name, &known.value))
            .collect();
        for topic in topics {
            state.channels_ever += 1;
            let channel = state.channels_ever;
            state.channel_of_topic.insert(topic.name.clone(), channel);
            state.topics.insert(channel, TopicState::new(topic));
        }
        state.revision += 1;
        let info = self.info(&state);
        let mut messages = Vec::new();
        if !former.is_empty() {
            messages.push(Message::from(&Unadvertise::new(former.into_keys())));
        }
        messages.push(Message::from(&info));
        messages.extend(state.topic_lists());
        for client in state.clients.values_mut() {
            client.subscriptions.clear();
            messages.iter().for_each(|message| client.outbox.reply(message.clone()));
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
        let observed = state.topics.values().filter(|topic| !topic.subscribers.is_empty());
        Some(observed.map(|topic| (topic.topic.name.clone(), topic.arrivals)).collect())
    }

    /// Publishes a message to the present subscribers.
    pub(super) fn publish(&self, topic: &str, bytes: &[u8], time_ns: u64) {
        let state = self.state();
        if let Some(topic) = state.channel_of_topic.get(topic).and_then(|channel| state.topics.get(channel)) {
            topic.publish(&state.clients, bytes, time_ns);
        }
    }

    /// Publishes a message that late subscribers receive as well.
    pub(super) fn publish_latched(&self, topic: &str, bytes: Vec<u8>, tick: Tick) {
        self.latch(topic, LatchedMessage { bytes, time_ns: tick.time_ns(), marker: None });
    }

    /// Publishes a piece of what is shown in markers, at a time in ns. Late subscribers receive the
    /// last one of each piece, as far as an outbox holds them: pieces change as long as a run
    /// lasts.
    pub(super) fn publish_latched_marker(&self, topic: &str, marker: &Marker, time_ns: u64) {
        let subject = (marker.ns.clone(), marker.id);
        self.latch(topic, LatchedMessage { bytes: cdr::encode(marker), time_ns, marker: Some(subject) });
    }

    fn latch(&self, topic: &str, message: LatchedMessage) {
        let mut state = self.state();
        let State { topics, channel_of_topic, clients, .. } = &mut *state;
        if let Some(topic) = channel_of_topic.get(topic).and_then(|channel| topics.get_mut(channel)) {
            topic.publish(clients, &message.bytes, message.time_ns);
            if message.marker.is_some() {
                topic.latched.retain(|kept| kept.marker != message.marker);
                let mut bytes = message.bytes.len() + topic.latched.iter().map(|kept| kept.bytes.len()).sum::<usize>();
                while topic.latched.len() >= DATA_MAX || bytes > DATA_BYTES_MAX {
                    let Some(oldest) = topic.latched.pop_front() else { break };
                    bytes -= oldest.bytes.len();
                }
            } else if topic.latched.len() >= topic.topic.qos.depth as usize {
                topic.latched.pop_front();
            }
            topic.latched.push_back(message);
        }
    }

    /// Forgets what late subscribers of a topic would receive.
    pub(super) fn forget_latched(&self, topic: &str) {
        let mut state = self.state();
        let State { topics, channel_of_topic, .. } = &mut *state;
        if let Some(topic) = channel_of_topic.get(topic).and_then(|channel| topics.get_mut(channel)) {
            topic.latched.clear();
        }
    }

    /// Sends the time to all clients.
    pub(super) fn broadcast_time(&self, tick: Tick) {
        let time = Message::from(&Time::new(tick.time_ns()));
        self.state().clients.values().for_each(|client| client.outbox.publish(time.clone()));
    }

    /// Sets the parameter of the real-time factor, and publishes it if it has changed.
    pub(super) fn set_rtf(&self, rtf: Rtf) {
        let set = rtf_parameter(rtf);
        let mut state = self.state();
        match state.parameters.iter_mut().find(|known| known.name == set.name) {
            Some(known) if *known != set => *known = set.clone(),
            _ => return,
        }
        let values = Message::from(&ParameterValues::new([set]));
        let followers = state.clients.values().filter(|client| client.parameters.contains(parameters::RTF));
        followers.for_each(|client| client.outbox.reply(values.clone()));
    }

    /// Waits until every reader of the live stream has read its end or has gone.
    pub(super) fn wait_for_readers(&self, timeout: Duration) {
        let is_unread = |state: &mut State| state.readers.values().any(|has_end| !has_end);
        let waited = self.stream_read.wait_timeout_while(self.state(), timeout, is_unread);
        drop(waited.unwrap_or_else(PoisonError::into_inner));
    }

    /// Serves a message of a client.
    pub(super) fn handle(&self, id: u32, outbox: &Arc<Outbox>, message: ClientMessage<'_>) {
        match message {
            ClientMessage::Subscribe(request) => {
                let mut state = self.state();
                let refused = request.subscriptions.into_iter().find_map(|wanted| state.subscribe(id, wanted).err());
                refused.into_iter().for_each(|reason| outbox.reply(&Status::error(reason)));
            }
            ClientMessage::Unsubscribe(request) => {
                let mut state = self.state();
                request.subscription_ids.into_iter().for_each(|subscription| state.unsubscribe(id, subscription));
            }
            ClientMessage::ServiceCallRequest(call) => self.call(outbox, call),
            ClientMessage::FetchAsset(request) => {
                let response = match self.read_stream(id, &request.uri) {
                    Ok(bytes) => Message::from(&FetchAssetResponse::asset_data(request.request_id, &bytes)),
                    Err(reason) => Message::from(&FetchAssetResponse::error_message(request.request_id, &reason)),
                };
                outbox.reply(response);
            }
            ClientMessage::GetParameters(request) => {
                outbox.reply(&values(self.parameters(&request.parameter_names), request.id));
            }
            ClientMessage::SetParameters(request) => {
                let set = self.set_parameters(outbox, request.parameters);
                outbox.reply(&values(set, request.id));
            }
            ClientMessage::SubscribeParameterUpdates(request) => {
                if let Some(client) = self.state().clients.get_mut(&id) {
                    let room = SUBSCRIPTIONS_MAX.saturating_sub(client.parameters.len());
                    client.parameters.extend(request.parameter_names.into_iter().take(room));
                }
            }
            ClientMessage::UnsubscribeParameterUpdates(request) => {
                if let Some(client) = self.state().clients.get_mut(&id) {
                    client.parameters.retain(|name| !request.parameter_names.contains(name));
                }
            }
            _ => outbox.reply(&Status::error("this server does not have that capability")),
        }
    }

    fn call(&self, outbox: &Arc<Outbox>, call: ServiceCallRequest<'_>) {
        self.services.call(outbox, call.service_id, call.call_id, &call.encoding, call.payload.into_owned());
    }

    fn parameters(&self, names: &[String]) -> Vec<Parameter> {
        let all = self.state().parameters.clone();
        all.into_iter().filter(|parameter| names.is_empty() || names.contains(&parameter.name)).collect()
    }

    /// The parameters that were set, of those that a client wants to set.
    fn set_parameters(&self, outbox: &Outbox, wanted: Vec<Parameter>) -> Vec<Parameter> {
        let mut set = Vec::new();
        for parameter in wanted {
            let value = match parameter.value {
                Some(ParameterValue::Float64(value)) => value,
                Some(ParameterValue::Integer(value)) => value as f64,
                _ => f64::NAN,
            };
            let name = &parameter.name;
            let rtf = match name.as_str() {
                parameters::RTF => parameters::pace(name, value),
                _ => Err(format!("{name}: cannot be set during a run")),
            };
            let queued = rtf.and_then(|rtf| {
                let queued = enqueue(&self.requests, ClientRequest::Rtf(rtf));
                queued.map(|()| rtf).map_err(|reason| format!("{name}: not set: {reason}"))
            });
            match queued {
                Ok(rtf) => set.push(rtf_parameter(rtf)),
                Err(reason) => outbox.reply(&Status::error(reason)),
            }
        }
        set
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
            // One that has left is waited for no more.
            if state.clients.contains_key(&client) {
                state.readers.entry(client).or_insert(false);
            }
            state.stream.clone()
        };
        // The lock is released while the file is read.
        match stream.ok_or("gone")?.read(offset, CHUNK_BYTES_MAX)? {
            StreamChunk::Bytes(bytes) => Ok(bytes),
            StreamChunk::End => {
                self.reader_has_end(client, session);
                Err("ended".to_owned())
            }
        }
    }

    /// Notes that a client has read the end of the stream of a session. Meanwhile it may have left,
    /// or another run have begun, whose stream it has not read.
    fn reader_has_end(&self, client: u32, session: &str) {
        let mut state = self.state();
        if state.session == session
            && let Some(has_end) = state.readers.get_mut(&client)
        {
            *has_end = true;
        }
        self.stream_read.notify_all();
    }
}

impl State {
    /// The messages that list the topics.
    fn topic_lists(&self) -> Vec<Message> {
        let channels: Vec<Channel<'_>> =
            self.topics.iter().filter_map(|(id, topic)| channel(*id, &topic.topic)).collect();
        let lists = channels.chunks(ADVERTISED_TOPICS_MAX);
        lists.map(|list| Message::from(&Advertise::new(list.iter().cloned()))).collect()
    }

    fn subscribe(&mut self, id: u32, wanted: Subscription) -> Result<(), String> {
        let Some(client) = self.clients.get_mut(&id) else { return Ok(()) };
        let topic = self.topics.get_mut(&wanted.channel_id);
        let topic = topic.ok_or_else(|| format!("Unknown channel ID: {}", wanted.channel_id))?;
        if client.subscriptions.len() >= SUBSCRIPTIONS_MAX {
            return Err(format!("more than {SUBSCRIPTIONS_MAX} subscriptions"));
        }
        if client.subscriptions.contains_key(&wanted.id) || topic.subscribers.contains_key(&id) {
            return Err(format!("Client is already subscribed to channel: {}", wanted.channel_id));
        }
        client.subscriptions.insert(wanted.id, wanted.channel_id);
        topic.subscribers.insert(id, wanted.id);
        topic.arrivals += 1;
        for LatchedMessage { bytes, time_ns, .. } in &topic.latched {
            client.outbox.publish(&MessageData::new(wanted.id, *time_ns, bytes.as_slice()));
        }
        self.revision += 1;
        Ok(())
    }

    fn unsubscribe(&mut self, id: u32, subscription: u32) {
        let client = self.clients.get_mut(&id);
        if let Some(channel) = client.and_then(|client| client.subscriptions.remove(&subscription)) {
            self.remove_subscriber(id, channel);
        }
    }

    fn remove_subscriber(&mut self, id: u32, channel: u64) {
        if let Some(topic) = self.topics.get_mut(&channel) {
            topic.subscribers.remove(&id);
        }
        self.revision += 1;
    }
}

impl TopicState {
    fn new(topic: Topic) -> Self {
        Self { topic, subscribers: BTreeMap::new(), arrivals: 0, latched: VecDeque::new() }
    }

    fn publish(&self, clients: &BTreeMap<u32, ClientState>, bytes: &[u8], time_ns: u64) {
        for (client, subscription) in &self.subscribers {
            if let Some(client) = clients.get(client) {
                client.outbox.publish(&MessageData::new(*subscription, time_ns, bytes));
            }
        }
    }
}

fn channel(id: u64, topic: &Topic) -> Option<Channel<'_>> {
    let schema = Schema::new(topic.message.to_string(), "ros2msg", schema::text(topic.message).into_bytes());
    Channel::builder(id, topic.name.as_str(), "cdr").with_schema(schema).build().ok()
}

fn values(parameters: Vec<Parameter>, id: Option<String>) -> ParameterValues {
    let values = ParameterValues::new(parameters);
    match id {
        Some(id) => values.with_id(id),
        None => values,
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
fn parameter(name: String, value: &DeclaredValue) -> Option<Parameter> {
    let (kind, value) = match value.r#type {
        DeclaredType::PARAMETER_BOOL => (None, ParameterValue::Bool(value.bool_value)),
        DeclaredType::PARAMETER_INTEGER => (None, ParameterValue::Integer(value.integer_value)),
        // JSON has no infinity.
        DeclaredType::PARAMETER_DOUBLE if !value.double_value.is_finite() => {
            (None, ParameterValue::String(value.double_value.to_string()))
        }
        DeclaredType::PARAMETER_DOUBLE => (Some(ParameterType::Float64), ParameterValue::Float64(value.double_value)),
        DeclaredType::PARAMETER_STRING => (None, ParameterValue::String(value.string_value.clone())),
        DeclaredType::PARAMETER_INTEGER_ARRAY => {
            let numbers = value.integer_array_value.iter().map(|number| ParameterValue::Integer(*number));
            (None, ParameterValue::Array(numbers.collect()))
        }
        _ => return None,
    };
    Some(Parameter { name, r#type: kind, value: Some(value) })
}

#[cfg(test)]
mod tests;
