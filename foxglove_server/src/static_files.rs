//! A static file server for the page and one or two recordings or a map, without a run.

use std::path::Path;

use tokio::runtime::Runtime;

use super::access::{Access, PageOrigin, Token};
use super::http_gateway::{self, GatewayContent, MapAnswers};
use super::{FoxgloveServerError, ServerAddress};

/// Path of the recording beside the page; its file name may follow, for display.
pub(super) const RECORDING: &str = "recording";

/// Path of a second recording, which the page shows beside the first one.
pub(super) const BESIDE: &str = "beside";

/// Path of the answers to questions about a map; the query of the page names it.
pub(super) const MAP_ROOM: &str = "map-room";

/// Where recordings are beside the page: paths relative to it. Instead of a name that would need
/// escaping they have another one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingPaths {
    pub recording: String,
    /// The second recording, shown beside the first one.
    pub beside: Option<String>,
}

impl RecordingPaths {
    /// The paths of one recording, or of two.
    #[must_use]
    pub fn of(recording: &Path, beside: Option<&Path>) -> Self {
        let path_of = |folder, file| path_below(folder, file, "recording.mcap");
        Self { recording: path_of(RECORDING, recording), beside: beside.map(|beside| path_of(BESIDE, beside)) }
    }

    /// The query of the page that shows them.
    #[must_use]
    pub fn query(&self) -> String {
        let beside = self.beside.as_ref().map(|beside| format!("&beside={beside}"));
        format!("recording={}{}", self.recording, beside.unwrap_or_default())
    }
}

/// A path of a file in a folder beside the page, by its name or else by that of `other`, whose
/// extension tells the page what it is.
fn path_below(folder: &str, file: &Path, other: &str) -> String {
    let is_plain = |name: &&str| name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte));
    let name = file.file_name().and_then(|name| name.to_str()).filter(is_plain).unwrap_or(other);
    format!("{folder}/{name}")
}

/// Serves recordings until it is dropped.
pub struct StaticFileServer {
    address: ServerAddress,
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
        let content = GatewayContent {
            page: Some(page.to_owned()),
            hub: None,
            recording: Some(recording.to_owned()),
            beside: beside.map(Path::to_owned),
            map: None,
        };
        Self::serve(address, content, RecordingPaths::of(recording, beside).query(), token, allowed)
    }

    /// Serves a map in a M3DM format, and the answers to questions about it, as
    /// [`open`](Self::open) serves a recording.
    ///
    /// # Errors
    /// If the address cannot be bound.
    pub fn open_map(
        address: &str,
        page: &Path,
        map: &Path,
        answers: MapAnswers,
        token: Token,
        allowed: &[PageOrigin],
    ) -> Result<Self, FoxgloveServerError> {
        let content = GatewayContent {
            page: Some(page.to_owned()),
            hub: None,
            recording: Some(map.to_owned()),
            beside: None,
            map: Some(answers),
        };
        let query = format!("recording={}&room={MAP_ROOM}", path_below(RECORDING, map, "map.m3dm"));
        Self::serve(address, content, query, token, allowed)
    }

    fn serve(
        address: &str,
        content: GatewayContent,
        recordings: String,
        token: Token,
        allowed: &[PageOrigin],
    ) -> Result<Self, FoxgloveServerError> {
        let (runtime, listener) = http_gateway::open(address)?;
        let local = listener.local_addr()?;
        let access = Access::new(token, allowed, local);
        let query = access.query();
        http_gateway::serve(&runtime, listener, access, content);
        Ok(Self { address: local.into(), recordings, query, _runtime: runtime })
    }

    /// The address it listens at, without the token.
    #[must_use]
    pub fn address(&self) -> ServerAddress {
        self.address
    }

    /// URL of the page with the recordings, and with the token.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/?{}&{}", self.address, self.query, self.recordings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_need_escaping_are_replaced() {
        let paths = RecordingPaths::of(Path::new("a/run-1.mcap"), Some(Path::new("b/Höhle 2.mcap")));
        assert_eq!(paths.query(), "recording=recording/run-1.mcap&beside=beside/recording.mcap");
        for name in ["my cave.m3dm", "Höhle.m3dm", "cave#1.m3dm", "cave+(2).obj.m3dm"] {
            assert_eq!(path_below(RECORDING, Path::new(name), "map.m3dm"), "recording/map.m3dm");
        }
        assert_eq!(path_below(RECORDING, Path::new("cave.obj.m3dm"), "map.m3dm"), "recording/cave.obj.m3dm");
    }
}
