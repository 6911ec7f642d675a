//! One client of the Foxglove WebSocket, from the handshake to its end.
//!
//! The handshake is answered on the connection that the HTTP gateway has accepted and checked:
//! there is no other way to the server. The messages are those of the protocol types of the
//! `foxglove` crate, whose own server listens at a TCP port without any check.

use std::sync::Arc;
use std::time::Duration;

use foxglove::websocket::ws_protocol::ParseError;
use foxglove::websocket::ws_protocol::client::ClientMessage;
use foxglove::websocket::ws_protocol::server::Status;
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::{Instant, MissedTickBehavior, interval_at, timeout};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};

use super::hub::Hub;
use super::outbox::Outbox;

/// The subprotocols, the preferred one first. All messages of this server and all requests that it
/// serves are the same in both; the first one has others beside them.
pub(super) const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// Maximum bytes of a message of a client; a scenario is the largest.
const MESSAGE_BYTES_MAX: usize = 1 << 20;

/// Bytes of the read buffer, and of messages that are collected before they are written.
const BUFFER_BYTES: usize = 16 << 10;

/// Wall time between two pings.
const PING_PERIOD: Duration = Duration::from_secs(20);

/// Maximum wall time without anything from a client; a ping makes each answer.
const SILENCE_MAX: Duration = Duration::from_secs(60);

/// Maximum wall time for sending one message.
const SEND_TIMEOUT: Duration = Duration::from_secs(30);

/// Serves a client on a stream whose handshake was answered.
pub(super) async fn serve<S: AsyncRead + AsyncWrite + Unpin>(stream: S, hub: Arc<Hub>) {
    let config = WebSocketConfig::default()
        .read_buffer_size(BUFFER_BYTES)
        .write_buffer_size(BUFFER_BYTES)
        .max_message_size(Some(MESSAGE_BYTES_MAX))
        .max_frame_size(Some(MESSAGE_BYTES_MAX));
    let socket = WebSocketStream::from_raw_socket(stream, Role::Server, Some(config)).await;
    let (sink, source) = socket.split();
    let (client, outbox) = hub.join();
    tokio::select! {
        () = receive(source, &hub, client, &outbox) => {}
        () = send(sink, &outbox) => {}
    }
    hub.leave(client);
}

/// Serves the requests of a client until it has gone or says nothing any more.
async fn receive<S>(mut source: SplitStream<WebSocketStream<S>>, hub: &Hub, client: u32, outbox: &Arc<Outbox>)
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    loop {
        outbox.wait_for_room().await;
        let Ok(Some(Ok(message))) = timeout(SILENCE_MAX, source.next()).await else { return };
        match ClientMessage::try_from(&message) {
            Ok(message) => hub.handle(client, outbox, message),
            // Pings and pongs, which need no answer from here.
            Err(ParseError::UnhandledMessageType | ParseError::EmptyBinaryMessage) => {}
            Err(error) => outbox.reply(&Status::error(format!("Invalid message: {error}"))),
        }
    }
}

/// Sends what the outbox has until the client is to be disconnected or takes nothing any more.
async fn send<S>(mut sink: SplitSink<WebSocketStream<S>, Message>, outbox: &Outbox)
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let mut pings = interval_at(Instant::now() + PING_PERIOD, PING_PERIOD);
    pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        let message = tokio::select! {
            message = outbox.next() => message,
            _ = pings.tick() => Some(Message::Ping(Vec::new().into())),
        };
        let Some(message) = message else { return };
        if !matches!(timeout(SEND_TIMEOUT, sink.send(message)).await, Ok(Ok(()))) {
            return;
        }
    }
}
