//! The Foxglove server of a run: a web page and a Foxglove WebSocket at one address, with
//! visualisation topics, services, parameters and the live stream.
//!
//! Foxglove and Lichtblick connect to it unchanged. The project's own page (`viewer/`) reads the
//! [live stream](crate::live_stream) in chunks as an *asset* of the same connection, so that it
//! misses nothing and delays nothing.
//!
//! ```text
//!   browser --- HTTP gateway --+-- files of the page
//!                              +-- Foxglove WebSocket -- [Hub] -- [ObservedTransport] -- run loop, link
//! ```
//!
//! Invariants: an observer never delays the run; its requests reach the run like those over ROS
//! ([`crate::control`]) and are answered between two ticks; a client that is too slow loses
//! messages, or its connection.
//!
//! This module does not know what the page draws.

pub mod capture;
mod http_gateway;
mod hub;
mod observed_transport;
mod services;
mod static_files;

use std::io;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

use foxglove::websocket::Capability;
use foxglove::{Context, FoxgloveError, WebSocketServer, WebSocketServerHandle};
use thiserror::Error;
use tokio::runtime::Runtime;

use crate::live_stream::LiveStream;
use crate::recorder::Document;

use http_gateway::GatewayContent;
pub use http_gateway::page;
use hub::Hub;
pub use observed_transport::ObservedTransport;
use services::ClientRequest;
pub use services::StartRequest;
pub use static_files::StaticFileServer;

/// The default address, with the port that Foxglove expects.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";

/// Error text for a page that was not built.
pub const NO_PAGE_HERE: &str = "the page was not built: npm --prefix viewer ci && npm --prefix viewer run build, or launch_scripts/view.sh, which does both";

/// Maximum queued requests; a further one is refused.
const REQUESTS_MAX: usize = 256;

/// Maximum messages queued per client; beyond it the oldest are dropped.
const BACKLOG_MESSAGES_MAX: usize = 1024;

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
    /// The folder has no page.
    #[error("--page {folder}: expected a folder with index.html")]
    Page { folder: String },
    /// The system refuses.
    #[error("serving observers: {0}")]
    System(#[from] io::Error),
    /// The Foxglove library refuses.
    #[error("Foxglove server: {0}")]
    Foxglove(#[from] FoxgloveError),
}

/// The server, from before a run until after it.
pub struct FoxgloveServer {
    hub: Arc<Hub>,
    server: Arc<WebSocketServerHandle>,
    context: Arc<Context>,
    requests: Receiver<ClientRequest>,
    address: SocketAddr,
    /// Its tasks end when it is dropped.
    _runtime: Runtime,
}

impl FoxgloveServer {
    /// Listens at an address such as `127.0.0.1:8765`; port 0 selects a free one. `page` is the
    /// folder of the page; `is_idle` offers the service that starts runs.
    ///
    /// # Errors
    /// If the address cannot be bound.
    pub fn open(address: &str, page: Option<&Path>, is_idle: bool) -> Result<Self, FoxgloveServerError> {
        let (runtime, listener) = http_gateway::open(address)?;
        let local = listener.local_addr()?;
        let context = Context::new();
        let (sender, requests) = sync_channel(REQUESTS_MAX);
        let hub = Arc::new(Hub::new(sender.clone()));
        let info = [("maes".to_owned(), "1".to_owned()), ("idle".to_owned(), is_idle.to_string())];
        let server = WebSocketServer::new()
            .name("MAES")
            .context(&context)
            // Only the HTTP gateway connects to it.
            .bind("127.0.0.1", 0)
            .server_info(info.into_iter().collect())
            .session_id(hub.session())
            .capabilities([Capability::Time, Capability::Parameters])
            .supported_encodings(["cdr", "json"])
            .services(services::all(&sender, is_idle))
            .listener(Arc::clone(&hub) as _)
            .parameter_handler(Arc::clone(&hub) as _)
            .fetch_asset_handler(Arc::clone(&hub) as _)
            .message_backlog_size(BACKLOG_MESSAGES_MAX);
        let server = Arc::new(runtime.block_on(server.start())?);
        hub.set_server(&server);
        let foxglove = Some(SocketAddr::from(([127, 0, 0, 1], server.port())));
        http_gateway::serve(
            &runtime,
            listener,
            GatewayContent { page: page.map(Path::to_owned), foxglove, recording: None },
        );
        Ok(Self { hub, server, context, requests, address: local, _runtime: runtime })
    }

    /// The address it listens at.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
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

    /// The next request to start a run, if one arrives in time. Other requests are refused, because
    /// there is no run.
    #[must_use]
    pub fn next_start(&self, timeout: Duration) -> Option<StartRequest> {
        match self.requests.recv_timeout(timeout).ok()? {
            ClientRequest::Start(request) => Some(request),
            ClientRequest::Service { responder, .. } => {
                responder.respond_err("there is no run; /sim_server/start_run starts one".to_owned());
                None
            }
            ClientRequest::Rtf(_) => None,
        }
    }

    /// Waits until readers of the live stream have read its end.
    pub fn wait_for_readers(&self) {
        self.hub.wait_for_readers(READERS_TIMEOUT, || self.server.client_count() == 0);
    }
}
