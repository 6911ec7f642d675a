//! A static file server for the page and one or two recordings, without a run.

use std::net::SocketAddr;
use std::path::Path;

use tokio::runtime::Runtime;

use super::FoxgloveServerError;
use super::access::{Access, PageOrigin, Token};
use super::http_gateway::{self, GatewayContent};

/// Serves recordings until it is dropped.
pub struct StaticFileServer {
    address: SocketAddr,
    /// The query with the paths of the recordings.
    recordings: String,
    /// The query with the token.
    query: String,
    /// Its tasks end when it is dropped.
    _runtime: Runtime,
}

impl StaticFileServer {
    /// Serves a recording at an address such as `127.0.0.1:8765`; port 0 selects a free one. The
    /// page shows the one of `beside` next to it. Pages of the `allowed` origins may read both.
    ///
    /// # Errors
    /// If the address cannot be bound.
    pub fn open(
        address: &str,
        page: &Path,
        recording: &Path,
        beside: Option<&Path>,
        token: Token,
        allowed: &[PageOrigin],
    ) -> Result<Self, FoxgloveServerError> {
        let (runtime, listener) = http_gateway::open(address)?;
        let local = listener.local_addr()?;
        let mut recordings = format!("recording={}", http_gateway::recording_path(recording));
        if let Some(beside) = beside {
            recordings += &format!("&beside={}", http_gateway::beside_path(beside));
        }
        let content = GatewayContent {
            page: Some(page.to_owned()),
            hub: None,
            recording: Some(recording.to_owned()),
            beside: beside.map(Path::to_owned),
        };
        let access = Access::new(token, allowed, local);
        let query = access.query();
        http_gateway::serve(&runtime, listener, access, content);
        Ok(Self { address: local, recordings, query, _runtime: runtime })
    }

    /// URL of the page with the recordings, and with the token.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/?{}&{}", self.address, self.query, self.recordings)
    }
}
