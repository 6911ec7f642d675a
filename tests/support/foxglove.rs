//! A minimal client of the Foxglove WebSocket protocol.
//!
//! It sorts everything that it receives into tables, and reads on until the awaited entry is there.

use std::collections::BTreeMap;
use std::net::TcpStream;
use std::time::Duration;

use msgs::cdr;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::StatusCode;
use tungstenite::{Error, HandshakeError, Message, WebSocket};

use super::HANG;

/// The socket after a handshake with these headers at `host:port/...`, or the status of a refusal.
pub(crate) fn handshake(address: &str, headers: &[(&'static str, &str)]) -> Result<WebSocket<TcpStream>, StatusCode> {
    let host = address.split('/').next().unwrap_or(address);
    let stream = TcpStream::connect(host).unwrap_or_else(|error| panic!("{address}: {error}"));
    stream.set_read_timeout(Some(HANG)).expect("a stream has time-outs");
    let mut request = format!("ws://{address}").into_client_request().expect("an address is a request");
    for (name, value) in headers {
        request.headers_mut().insert(*name, value.parse().expect("a legal header"));
    }
    match tungstenite::client(request, stream) {
        Ok((socket, _)) => Ok(socket),
        Err(HandshakeError::Failure(Error::Http(response))) => Err(response.status()),
        Err(error) => panic!("{address}: {error}"),
    }
}

/// A connected client.
pub(crate) struct Client {
    socket: WebSocket<TcpStream>,
    /// The last JSON message of each operation, such as `serverInfo`.
    pub(crate) said: BTreeMap<String, Value>,
    /// Ids of the channels by topic, and of the services by name.
    channels: BTreeMap<String, u64>,
    services: BTreeMap<String, u64>,
    /// Messages by topic.
    pub(crate) messages: BTreeMap<String, Vec<Vec<u8>>>,
    /// Their log times, ns.
    pub(crate) log_times: BTreeMap<String, Vec<u64>>,
    topics: Vec<String>,
    assets: BTreeMap<u32, Result<Vec<u8>, String>>,
    answers: BTreeMap<u32, Result<Vec<u8>, String>>,
    asked: u32,
}

impl Client {
    /// Connects to `host:port/?token=TOKEN`.
    #[track_caller]
    pub(crate) fn connect(address: &str) -> Self {
        Self::connect_as("foxglove.sdk.v1", address)
    }

    /// The same with a subprotocol.
    #[track_caller]
    pub(crate) fn connect_as(subprotocol: &str, address: &str) -> Self {
        let socket = handshake(address, &[("sec-websocket-protocol", subprotocol)]);
        let mut client = Self {
            socket: socket.unwrap_or_else(|error| panic!("{address}: {error}")),
            said: BTreeMap::new(),
            channels: BTreeMap::new(),
            services: BTreeMap::new(),
            messages: BTreeMap::new(),
            log_times: BTreeMap::new(),
            topics: Vec::new(),
            assets: BTreeMap::new(),
            answers: BTreeMap::new(),
            asked: 0,
        };
        client.read_until(|client| client.said.contains_key("advertiseServices"));
        client
    }

    /// The current session id.
    pub(crate) fn session(&self) -> String {
        self.said["serverInfo"]["sessionId"].as_str().expect("a session is a text").to_owned()
    }

    /// Waits for another session.
    #[track_caller]
    pub(crate) fn next_session(&mut self) -> String {
        let old = self.session();
        self.read_until(|client| client.session() != old);
        self.session()
    }

    /// The advertised topics.
    pub(crate) fn offered(&self) -> Vec<&str> {
        self.channels.keys().map(String::as_str).collect()
    }

    /// Subscribes to a topic as soon as it is advertised.
    pub(crate) fn subscribe(&mut self, topic: &str) {
        self.read_until(|client| client.channels.contains_key(topic));
        let subscription = json!({ "id": self.topics.len(), "channelId": self.channels[topic] });
        self.topics.push(topic.to_owned());
        self.say(&json!({ "op": "subscribe", "subscriptions": [subscription] }));
    }

    /// Calls a service with an encoded request.
    #[track_caller]
    pub(crate) fn call_raw(&mut self, service: &str, encoding: &str, request: &[u8]) -> Result<Vec<u8>, String> {
        self.asked += 1;
        let call = self.asked;
        let id = u32::try_from(self.services[service]).expect("identifiers are small");
        let length = u32::try_from(encoding.len()).expect("it is short");
        let head = [&[2][..], &id.to_le_bytes(), &call.to_le_bytes(), &length.to_le_bytes(), encoding.as_bytes()];
        self.socket.send(Message::binary([&head.concat(), request].concat())).expect("the server is there");
        self.read_until(|client| client.answers.contains_key(&call));
        self.answers.remove(&call).expect("it is there")
    }

    /// Calls a ROS service.
    #[track_caller]
    pub(crate) fn call<R: DeserializeOwned>(&mut self, service: &str, request: &impl Serialize) -> R {
        let answer = self.call_raw(service, "cdr", &cdr::encode(request)).expect("the service answers");
        cdr::decode(&answer).expect("an answer can be decoded")
    }

    /// Fetches an asset.
    #[track_caller]
    pub(crate) fn fetch(&mut self, uri: &str) -> Result<Vec<u8>, String> {
        self.asked += 1;
        let request = self.asked;
        self.say(&json!({ "op": "fetchAsset", "uri": uri, "requestId": request }));
        self.read_until(|client| client.assets.contains_key(&request));
        self.assets.remove(&request).expect("it is there")
    }

    /// The live stream of a session up to its end.
    #[track_caller]
    pub(crate) fn live_stream(&mut self, session: &str) -> Vec<u8> {
        let mut bytes = Vec::new();
        loop {
            match self.fetch(&format!("maes://run/{session}/{}", bytes.len())) {
                Ok(more) if more.is_empty() => self.pause(),
                Ok(more) => bytes.extend(more),
                Err(reason) => {
                    assert_eq!(reason, "ended");
                    return bytes;
                }
            }
        }
    }

    /// Sets a parameter and returns what the server has set.
    #[track_caller]
    pub(crate) fn set(&mut self, name: &str, value: impl Into<Value>) -> Value {
        self.said.remove("parameterValues");
        let parameter = json!({ "name": name, "value": value.into() });
        self.say(&json!({ "op": "setParameters", "parameters": [parameter], "id": "set" }));
        self.read_until(|client| client.said.contains_key("parameterValues"));
        self.said["parameterValues"]["parameters"].clone()
    }

    /// The value of a parameter.
    #[track_caller]
    pub(crate) fn parameter(&mut self, name: &str) -> Value {
        self.said.remove("parameterValues");
        self.say(&json!({ "op": "getParameters", "parameterNames": [name], "id": "get" }));
        self.read_until(|client| client.said.contains_key("parameterValues"));
        self.said["parameterValues"]["parameters"][0]["value"].clone()
    }

    fn say(&mut self, text: &Value) {
        self.socket.send(Message::text(text.to_string())).expect("the server is there");
    }

    /// Reads for 20 ms.
    fn pause(&mut self) {
        self.read_timeout(Duration::from_millis(20));
        while let Ok(message) = self.socket.read() {
            self.take(message);
        }
        self.read_timeout(HANG);
    }

    fn read_timeout(&mut self, time: Duration) {
        self.socket.get_mut().set_read_timeout(Some(time)).expect("a stream has time-outs");
    }

    /// Reads until `holds`.
    #[track_caller]
    pub(crate) fn read_until(&mut self, holds: impl Fn(&Self) -> bool) {
        while !holds(self) {
            let message = self.socket.read().unwrap_or_else(|error| panic!("{error}, after {:?}", self.said.keys()));
            self.take(message);
        }
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::Text(text) => self.take_text(serde_json::from_str(&text).expect("texts are JSON")),
            Message::Binary(bytes) => self.take_bytes(&bytes),
            _ => {}
        }
    }

    fn take_text(&mut self, text: Value) {
        let operation = text["op"].as_str().expect("an operation").to_owned();
        let named = |list: &Value, key: &str| -> Vec<(String, u64)> {
            let entries = list.as_array().expect("a list").iter();
            entries
                .map(|entry| (entry[key].as_str().expect("a name").to_owned(), entry["id"].as_u64().expect("a number")))
                .collect()
        };
        match operation.as_str() {
            "advertise" => self.channels.extend(named(&text["channels"], "topic")),
            "unadvertise" => {
                let gone: Vec<u64> =
                    text["channelIds"].as_array().expect("a list").iter().filter_map(Value::as_u64).collect();
                self.channels.retain(|_, id| !gone.contains(id));
            }
            "advertiseServices" => self.services.extend(named(&text["services"], "name")),
            "serviceCallFailure" => {
                let call = u32::try_from(text["callId"].as_u64().expect("a number")).expect("calls are few");
                self.answers.insert(call, Err(text["message"].as_str().unwrap_or_default().to_owned()));
            }
            _ => {}
        }
        self.said.insert(operation, text);
    }

    fn take_bytes(&mut self, bytes: &[u8]) {
        let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
        let length = |at: usize| usize::try_from(number(at)).expect("a length");
        match bytes[0] {
            1 => {
                let topic = self.topics[number(1) as usize].clone();
                let time = u64::from_le_bytes(bytes[5..13].try_into().expect("eight bytes"));
                self.log_times.entry(topic.clone()).or_default().push(time);
                self.messages.entry(topic).or_default().push(bytes[13..].to_vec());
            }
            3 => {
                self.answers.insert(number(5), Ok(bytes[13 + length(9)..].to_vec()));
            }
            4 => {
                let data = 10 + length(6);
                let reason = || String::from_utf8_lossy(&bytes[10..data]).into_owned();
                let asset = if bytes[5] == 0 { Ok(bytes[data..].to_vec()) } else { Err(reason()) };
                self.assets.insert(number(1), asset);
            }
            _ => {}
        }
    }
}
