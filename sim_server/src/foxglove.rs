//! What a browser sees of a run: a page, and a Foxglove WebSocket with the views, the services, the parameters and the journal of the
//! run, all at one address.
//!
//! Foxglove and Lichtblick connect to it as they are. The project's own page (`viewer/`) pulls the [journal](crate::live_stream) piece by
//! piece as an *asset* of the same connection, so that it misses nothing and nobody waits for it.
//!
//! ```text
//!   browser --- front ---+--- files of the page
//!                        +--- Foxglove server --- [Hub] --- [ObservedLink] --- the run and its link
//! ```
//!
//! Invariants: nobody who looks on makes the run wait; what is asked for gets to the run through the same requests as over ROS
//! ([`crate::control`]), and is answered between two ticks; one that is too slow loses messages, or its connection.
//!
//! This module does not know what a page draws.

pub mod capture;
mod http_gateway;
mod hub;
mod observed_link;
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
pub use observed_link::ObservedLink;
use services::ClientRequest;
pub use services::StartRequest;
pub use static_files::StaticFileServer;

/// Where runs are shown unless somebody says otherwise: the port that Foxglove looks for.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";

/// What is said where a page is needed that was not built.
pub const NO_PAGE_HERE: &str = "the page was not built: npm --prefix viewer ci && npm --prefix viewer run build, or launch_scripts/view.sh, which does both";

/// Requests that wait for the run at the most; one more is refused.
const REQUESTS_MAX: usize = 256;

/// Messages that wait for one client at the most; then it loses the oldest ones.
const BACKLOG_MESSAGES_MAX: usize = 1024;

/// How long the journal's end waits for those who read it, wall time.
const READERS_TIMEOUT: Duration = Duration::from_secs(2);

/// Why nothing can be shown.
#[derive(Debug, Error)]
pub enum FoxgloveServerError {
    /// The address is not free, or is none of this machine.
    #[error("--view {address}: {source}")]
    Address {
        /// As it was asked for.
        address: String,
        /// What the system says.
        source: io::Error,
    },
    /// There is no page where somebody has said.
    #[error("--page {folder}: expected a folder with index.html")]
    Page {
        /// The folder.
        folder: String,
    },
    /// The system has not enough of something.
    #[error("serving observers: {0}")]
    System(#[from] io::Error),
    /// The library refuses.
    #[error("Foxglove server: {0}")]
    Foxglove(#[from] FoxgloveError),
}

/// Where people look on, from before a run until after it.
pub struct FoxgloveServer {
    hub: Arc<Hub>,
    server: Arc<WebSocketServerHandle>,
    context: Arc<Context>,
    requests: Receiver<ClientRequest>,
    address: SocketAddr,
    /// Ends with everything that runs on it.
    _runtime: Runtime,
}

impl FoxgloveServer {
    /// Opens at an address such as `127.0.0.1:8765`; port 0 is a free one. `page` is the folder of the page, if there is one.
    /// `is_idle` says that runs can be started from there.
    ///
    /// # Errors
    /// If the address cannot be had.
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
            // Nobody but the front connects to it.
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

    /// Where it is.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Begins the journal of the next run, which is shown once the run is announced.
    ///
    /// # Errors
    /// If no file can be made for it.
    pub fn live_stream(&self, documents: &[Document<'_>]) -> io::Result<LiveStream> {
        let stream = LiveStream::create(documents)?;
        self.hub.set_next_stream(stream.reader());
        Ok(stream)
    }

    /// The next run that somebody wants to start, if one is asked for in time. Other requests are refused: there is no run.
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

    /// Gives those who read the journal time to read its end.
    pub fn wait_for_readers(&self) {
        self.hub.wait_for_readers(READERS_TIMEOUT, || self.server.client_count() == 0);
    }
}
