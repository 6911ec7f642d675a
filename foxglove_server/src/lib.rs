//! The Foxglove server of a run: a web page and a Foxglove WebSocket at one address, with
//! visualisation topics, services, parameters and the live stream.
//!
//! Foxglove and Lichtblick connect to it unchanged. The project's own page (`viewer/`) reads the
//! [live stream](recording::live_stream) in chunks as an *asset* of the same connection, so that it
//! misses nothing and delays nothing.
//!
//! ```text
//!   browser --- HTTP gateway --+-- files of the page
//!                              +-- Foxglove WebSocket -- [Hub] -- [ObservedTransport] -- run loop, link
//! ```
//!
//! Invariants: the gateway is the only way in, and it serves nothing without the token of this
//! start ([`Token`]); an observer never delays the run; its requests reach the run like those over
//! ROS ([`transport::control`]) and are answered between two ticks; a client that is too slow loses
//! messages, or its connection.
//!
//! This crate does not know what the page draws.

mod access;
pub mod capture;
mod http_gateway;
mod hub;
mod observed_transport;
mod outbox;
mod server_address;
mod services;
mod static_files;
mod timed_stream;
mod websocket;

use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

use thiserror::Error;
use tokio::runtime::Runtime;

use recording::live_stream::LiveStream;
use recording::recorder::Document;

use access::Access;
pub use access::{PageOrigin, TOKEN_VARIABLE, Token};
use http_gateway::GatewayContent;
pub use http_gateway::{MapAnswers, page};
use hub::Hub;
pub use observed_transport::ObservedTransport;
pub use server_address::ServerAddress;
use services::ClientRequest;
pub use services::{IdleRequest, StartRequest};
pub use static_files::{RecordingPaths, StaticFileServer};

/// The default address, with the port that Foxglove expects.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";

/// Error text for a page that was not built.
pub const NO_PAGE_HERE: &str = "there is no page beside this program; in a checkout, `maes view --build-only` builds it; --page names the folder of another one";

/// Maximum queued requests; a further one is refused.
const REQUESTS_MAX: usize = 256;

/// Maximum wall time that the end of a run waits for readers of the live stream.
const READERS_TIMEOUT: Duration = Duration::from_secs(2);

/// Why the server cannot start.
#[derive(Debug, Error)]
pub enum FoxgloveServerError {
    /// The address cannot be bound.
    #[error("--view {address}: {source}")]
    Address {
        /// As requested.
        address: String,
        source: io::Error,
    },
    /// The token that the user sets is none.
    #[error(
        "{TOKEN_VARIABLE}: expected 16 to 256 of the characters A-Z, a-z, 0-9, - and _; \
         without the variable a token is drawn"
    )]
    Token,
    /// The folder has no page.
    #[error("--page {folder}: expected a folder with index.html")]
    Page { folder: String },
    /// The system refuses.
    #[error("serving observers: {0}")]
    System(#[from] io::Error),
}

/// The server, from before a run until after it.
pub struct FoxgloveServer {
    hub: Arc<Hub>,
    requests: Receiver<ClientRequest>,
    address: ServerAddress,
    /// The query with the token.
    query: String,
    /// Its tasks end when it is dropped.
    _runtime: Runtime,
}

impl FoxgloveServer {
    /// Listens at an address such as `127.0.0.1:8765`; port 0 selects a free one. `page` is the
    /// folder of the page; `is_idle` offers the service that starts runs. Clients have to show the
    /// token, and those that are pages must be of this server or of an `allowed` origin.
    ///
    /// # Errors
    /// If the address cannot be bound.
    pub fn open(
        address: &str,
        page: Option<&Path>,
        is_idle: bool,
        token: Token,
        allowed: &[PageOrigin],
    ) -> Result<Self, FoxgloveServerError> {
        let (runtime, listener) = http_gateway::open(address)?;
        let local = listener.local_addr()?;
        let (sender, requests) = sync_channel(REQUESTS_MAX);
        let hub = Arc::new(Hub::new(sender, is_idle));
        let access = Access::new(token, allowed, local);
        let query = access.query();
        let hub_of_run = Some(Arc::clone(&hub));
        let content = GatewayContent {
            page: page.map(Path::to_owned),
            hub: hub_of_run,
            recording: None,
            beside: None,
            map: None,
        };
        http_gateway::serve(&runtime, listener, access, content);
        Ok(Self { hub, requests, address: local.into(), query, _runtime: runtime })
    }

    /// The address of the page, with the token.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/?{}", self.address, self.query)
    }

    /// The address of the WebSocket, with the token.
    #[must_use]
    pub fn websocket_url(&self) -> String {
        format!("ws://{}/?{}", self.address, self.query)
    }

    /// The address it listens at, without the token.
    #[must_use]
    pub fn address(&self) -> ServerAddress {
        self.address
    }

    /// Creates the live stream of the next run, which is served once the run is announced.
    ///
    /// # Errors
    /// If its file cannot be created.
    pub fn live_stream(&self, documents: &[Document<'_>]) -> io::Result<LiveStream> {
        let stream = LiveStream::create(documents)?;
        self.hub.set_next_stream(stream.reader());
        Ok(stream)
    }

    /// The next request for a run, if one arrives in time. Other requests are refused, because
    /// there is no run.
    #[must_use]
    pub fn next_request(&self, timeout: Duration) -> Option<IdleRequest> {
        services::idle_request(self.requests.recv_timeout(timeout).ok()?)
    }

    /// Waits until readers of the live stream have read its end.
    pub fn wait_for_readers(&self) {
        self.hub.wait_for_readers(READERS_TIMEOUT);
    }
}
