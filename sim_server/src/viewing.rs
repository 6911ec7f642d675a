//! What a browser sees of a run: a page, and a Foxglove WebSocket with the views, the services, the parameters and the journal of the
//! run, all at one address.
//!
//! Foxglove and Lichtblick connect to it as they are. The project's own page (`viewer/`) pulls the [journal](crate::journal) piece by
//! piece as an *asset* of the same connection, so that it misses nothing and nobody waits for it.
//!
//! ```text
//!   browser --- front ---+--- files of the page
//!                        +--- Foxglove server --- [Hall] --- [Watched] --- the run and its link
//! ```
//!
//! Invariants: nobody who looks on makes the run wait; what is asked for gets to the run through the same requests as over ROS
//! ([`crate::control`]), and is answered between two ticks; one that is too slow loses messages, or its connection.
//!
//! This module does not know what a page draws.

mod front;
mod hall;
mod link;
pub mod pictures;
mod services;
mod shelf;

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

use crate::journal::Journal;
use crate::recorder::Document;

use front::Site;
pub use front::page;
use hall::Hall;
pub use link::Watched;
pub use services::StartRequest;
use services::Wish;
pub use shelf::Shelf;

/// Where runs are shown unless somebody says otherwise: the port that Foxglove looks for.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";

/// What is said where a page is needed that was not built.
pub const NO_PAGE_HERE: &str = "the page was not built: npm --prefix viewer ci && npm --prefix viewer run build, or launch_scripts/view.sh, which does both";

/// Requests that wait for the run at the most; one more is refused.
const WISHES_MAX: usize = 256;

/// Messages that wait for one client at the most; then it loses the oldest ones.
const BACKLOG_MESSAGES: usize = 1024;

/// How long the journal's end waits for those who read it, wall time.
const FAREWELL: Duration = Duration::from_secs(2);

/// Why nothing can be shown.
#[derive(Debug, Error)]
pub enum ViewingError {
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
    #[error("viewing: {0}")]
    System(#[from] io::Error),
    /// The library refuses.
    #[error("viewing: {0}")]
    Foxglove(#[from] FoxgloveError),
}

/// Where people look on, from before a run until after it.
pub struct Viewing {
    hall: Arc<Hall>,
    server: Arc<WebSocketServerHandle>,
    context: Arc<Context>,
    wishes: Receiver<Wish>,
    address: SocketAddr,
    /// Ends with everything that runs on it.
    _runtime: Runtime,
}

impl Viewing {
    /// Opens at an address such as `127.0.0.1:8765`; port 0 is a free one. `page` is the folder of the page, if there is one.
    /// `is_idle` says that runs can be started from there.
    ///
    /// # Errors
    /// If the address cannot be had.
    pub fn open(address: &str, page: Option<&Path>, is_idle: bool) -> Result<Self, ViewingError> {
        let (runtime, listener) = front::open(address)?;
        let local = listener.local_addr()?;
        let context = Context::new();
        let (wish, wishes) = sync_channel(WISHES_MAX);
        let hall = Arc::new(Hall::new(wish.clone()));
        let info = [("maes".to_owned(), "1".to_owned()), ("idle".to_owned(), is_idle.to_string())];
        let server = WebSocketServer::new()
            .name("MAES")
            .context(&context)
            // Nobody but the front connects to it.
            .bind("127.0.0.1", 0)
            .server_info(info.into_iter().collect())
            .session_id(hall.session())
            .capabilities([Capability::Time, Capability::Parameters])
            .supported_encodings(["cdr", "json"])
            .services(services::all(&wish, is_idle))
            .listener(Arc::clone(&hall) as _)
            .parameter_handler(Arc::clone(&hall) as _)
            .fetch_asset_handler(Arc::clone(&hall) as _)
            .message_backlog_size(BACKLOG_MESSAGES);
        let server = Arc::new(runtime.block_on(server.start())?);
        hall.set_server(&server);
        let foxglove = Some(SocketAddr::from(([127, 0, 0, 1], server.port())));
        front::serve(&runtime, listener, Site { page: page.map(Path::to_owned), foxglove, recording: None });
        Ok(Self { hall, server, context, wishes, address: local, _runtime: runtime })
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
    pub fn journal(&self, documents: &[Document<'_>]) -> io::Result<Journal> {
        let journal = Journal::begin(documents)?;
        self.hall.expect(journal.reader());
        Ok(journal)
    }

    /// The next run that somebody wants to start, if one is asked for in time. Other requests are refused: there is no run.
    #[must_use]
    pub fn next_start(&self, timeout: Duration) -> Option<StartRequest> {
        match self.wishes.recv_timeout(timeout).ok()? {
            Wish::Start(request) => Some(request),
            Wish::Service { responder, .. } => {
                responder.respond_err("there is no run; /sim_server/start_run starts one".to_owned());
                None
            }
            Wish::Rtf(_) => None,
        }
    }

    /// Gives those who read the journal time to read its end.
    pub fn farewell(&self) {
        self.hall.wait_until_read(FAREWELL, || self.server.client_count() == 0);
    }
}
