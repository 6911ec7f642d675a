//! A static file server for the page and a recording, without a run.

use std::net::SocketAddr;
use std::path::Path;

use tokio::runtime::Runtime;

use super::FoxgloveServerError;
use super::access::{Access, PageOrigin, Token};
use super::http_gateway::{self, GatewayContent};

/// Serves a recording until it is dropped.
pub struct StaticFileServer {
    address: SocketAddr,
    path: String,
    /// The query with the token.
    query: String,
    /// Its tasks end when it is dropped.
    _runtime: Runtime,
}

impl StaticFileServer {
    /// Serves a recording at an address such as `127.0.0.1:8765`; port 0 selects a free one. Pages
    /// of the `allowed` origins may read it.
    ///
    /// # Errors
    /// If the address cannot be bound.
    pub fn open(
        address: &str,
        page: &Path,
        recording: &Path,
        token: Token,
        allowed: &[PageOrigin],
    ) -> Result<Self, FoxgloveServerError> {
        let (runtime, listener) = http_gateway::open(address)?;
        let local = listener.local_addr()?;
        let content = GatewayContent { page: Some(page.to_owned()), hub: None, recording: Some(recording.to_owned()) };
        let access = Access::new(token, allowed, local);
        let query = access.query();
        http_gateway::serve(&runtime, listener, access, content);
        Ok(Self { address: local, path: http_gateway::recording_path(recording), query, _runtime: runtime })
    }

    /// URL of the page with the recording, and with the token.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/?{}&recording={}", self.address, self.query, self.path)
    }
}
