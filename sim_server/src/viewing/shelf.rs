//! A page with a recording to look at, and no run.

use std::net::SocketAddr;
use std::path::Path;

use tokio::runtime::Runtime;

use super::ViewingError;
use super::front::{self, Site};

/// A recording that is offered to browsers, as long as this lives.
pub struct Shelf {
    address: SocketAddr,
    path: String,
    /// Ends with everything that runs on it.
    _runtime: Runtime,
}

impl Shelf {
    /// Offers a recording at an address such as `127.0.0.1:8765`; port 0 is a free one.
    ///
    /// # Errors
    /// If the address cannot be had.
    pub fn open(address: &str, page: &Path, recording: &Path) -> Result<Self, ViewingError> {
        let (runtime, listener) = front::open(address)?;
        let local = listener.local_addr()?;
        let site = Site { page: Some(page.to_owned()), foxglove: None, recording: Some(recording.to_owned()) };
        front::serve(&runtime, listener, site);
        Ok(Self { address: local, path: front::recording_path(recording), _runtime: runtime })
    }

    /// The address of the page with the recording.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/?recording={}", self.address, self.path)
    }
}
