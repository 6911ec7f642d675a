//! The HTTP gateway: one address that proxies WebSocket upgrades to the Foxglove server and serves
//! all other requests from files.
//!
//! On a loopback address, it accepts requests from pages of this machine or of Foxglove only:
//! otherwise any web page that a user opens could control a run (DNS rebinding, cross-site
//! WebSockets).

use std::convert::Infallible;
use std::io::{self, Cursor};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use http_body_util::Either;
use hyper::Response;
use hyper::body::Incoming;
use hyper::header::{CACHE_CONTROL, CONTENT_TYPE, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::TokioIo;
use tokio::io::{AsyncReadExt, AsyncWriteExt, copy_bidirectional, join};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::{Builder, Runtime};
use tower::ServiceExt;
use tower_http::compression::Compression;
use tower_http::services::{ServeDir, ServeFile};
use tower_http::set_header::SetResponseHeader;

use super::FoxgloveServerError;

/// Threads that serve clients.
const THREADS: usize = 2;

/// Maximum bytes of the head of a request.
const HEAD_BYTES_MAX: usize = 16 * 1024;

/// Maximum wall time for the head of a request to arrive.
const HEAD_TIMEOUT: Duration = Duration::from_secs(5);

/// Foreign origins that may connect to a loopback address.
const KNOWN_ORIGINS: [&str; 3] =
    ["https://app.foxglove.dev", "https://studio.foxglove.dev", "https://lichtblick-suite.github.io"];

/// Served instead of a page that was not built.
const NO_PAGE: &str = "<!doctype html><title>MAES</title><p>The simulator is here, but its page was not built. \
    Build it with <code>npm --prefix viewer ci &amp;&amp; npm --prefix viewer run build</code>, \
    or connect Foxglove or Lichtblick to this address (Foxglove WebSocket).";

/// Path of the recording beside the page; its file name may follow, for display.
const RECORDING: &str = "recording";

/// What the gateway serves.
#[derive(Debug, Clone)]
pub(super) struct GatewayContent {
    pub(super) page: Option<PathBuf>,
    /// Target of WebSocket upgrades.
    pub(super) foxglove: Option<SocketAddr>,
    /// A recording to serve.
    pub(super) recording: Option<PathBuf>,
}

/// Path of a recording beside the page. A name that would need escaping is left out.
pub(super) fn recording_path(file: &Path) -> String {
    let is_plain = |name: &&str| name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte));
    let name = file.file_name().and_then(|name| name.to_str()).filter(is_plain).unwrap_or("recording.mcap");
    format!("{RECORDING}/{name}")
}

/// The folder of the page: the named one, else beside the binary, else where the workspace builds
/// it.
///
/// # Errors
/// If the named folder has no page.
pub fn page(named: Option<&Path>) -> Result<Option<PathBuf>, FoxgloveServerError> {
    match named {
        Some(folder) if !is_page(folder) => Err(FoxgloveServerError::Page { folder: folder.display().to_string() }),
        Some(folder) => Ok(Some(folder.to_owned())),
        None => Ok(built_page()),
    }
}

fn is_page(folder: &Path) -> bool {
    folder.join("index.html").is_file()
}

fn built_page() -> Option<PathBuf> {
    let binary = std::env::current_exe().ok()?;
    let folder = binary.parent()?;
    let candidates = [folder.join("viewer"), folder.join("../../viewer/dist")];
    candidates.into_iter().find(|candidate| is_page(candidate))
}

/// Binds an address, with a runtime for its clients.
pub(super) fn open(address: &str) -> Result<(Runtime, TcpListener), FoxgloveServerError> {
    let runtime = Builder::new_multi_thread().worker_threads(THREADS).thread_name("foxglove").enable_all().build()?;
    let refused = |source| FoxgloveServerError::Address { address: address.to_owned(), source };
    let listener = runtime.block_on(TcpListener::bind(address)).map_err(refused)?;
    Ok((runtime, listener))
}

/// Serves clients until the runtime ends.
pub(super) fn serve(runtime: &Runtime, listener: TcpListener, content: GatewayContent) {
    let content = Arc::new(content);
    let is_private = listener.local_addr().is_ok_and(|address| address.ip().is_loopback());
    runtime.spawn(async move {
        loop {
            // An error of one connection does not concern the others.
            if let Ok((stream, _)) = listener.accept().await {
                tokio::spawn(serve_connection(stream, Arc::clone(&content), is_private));
            }
        }
    });
}

/// Serves one connection; its errors are ignored.
async fn serve_connection(mut stream: TcpStream, content: Arc<GatewayContent>, is_private: bool) {
    let Ok(Ok(head)) = tokio::time::timeout(HEAD_TIMEOUT, read_head(&mut stream)).await else { return };
    let request = Request::parse(&head);
    let _ = match (request.wants_websocket, content.foxglove) {
        _ if is_private && !request.is_same_machine() => {
            refuse(
                stream,
                "403 Forbidden",
                "this simulator serves pages of its own machine only; --view ADDR:PORT opens it to others",
            )
            .await
        }
        (true, Some(foxglove)) => proxy(stream, &head, foxglove).await,
        (true, None) => refuse(stream, "404 Not Found", "there is no run here").await,
        (false, _) => serve_files(stream, head, &content).await.map_err(io::Error::other),
    };
}

/// Serves files on a connection whose first head was read already.
async fn serve_files(stream: TcpStream, head: Vec<u8>, content: &GatewayContent) -> hyper::Result<()> {
    let (reading, writing) = stream.into_split();
    let stream = TokioIo::new(join(Cursor::new(head).chain(reading), writing));
    let Some(folder) = &content.page else {
        let answer = service_fn(|_| async {
            let mut answer = Response::new(NO_PAGE.to_owned());
            answer.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("text/html; charset=utf-8"));
            Ok::<_, Infallible>(answer)
        });
        return http1::Builder::new().serve_connection(stream, answer).await;
    };
    // A rebuilt page must not come from the cache.
    let uncached = |files| SetResponseHeader::overriding(files, CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    let page = Compression::new(uncached(ServeDir::new(folder)));
    let recording = content.recording.as_ref().map(ServeFile::new);
    let files = service_fn(move |request: hyper::Request<Incoming>| {
        let (page, recording) = (page.clone(), recording.clone());
        async move {
            match recording {
                // Uncompressed, so that range requests work.
                Some(recording) if request.uri().path().split('/').nth(1) == Some(RECORDING) => {
                    recording.oneshot(request).await.map(|answer| answer.map(Either::Left))
                }
                _ => page.oneshot(request).await.map(|answer| answer.map(Either::Right)),
            }
        }
    });
    http1::Builder::new().serve_connection(stream, files).await
}

async fn refuse(mut stream: TcpStream, status: &str, reason: &str) -> io::Result<()> {
    let length = reason.len();
    let answer = format!("HTTP/1.1 {status}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{reason}");
    stream.write_all(answer.as_bytes()).await
}

async fn proxy(mut stream: TcpStream, head: &[u8], foxglove: SocketAddr) -> io::Result<()> {
    let mut server = TcpStream::connect(foxglove).await?;
    server.set_nodelay(true)?;
    stream.set_nodelay(true)?;
    server.write_all(head).await?;
    copy_bidirectional(&mut stream, &mut server).await.map(drop)
}

/// Reads up to the empty line behind the head of a request, and what came with it.
async fn read_head(stream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    while !head.windows(4).any(|bytes| bytes == b"\r\n\r\n") {
        if head.len() > HEAD_BYTES_MAX || stream.read_buf(&mut head).await? == 0 {
            return Err(io::ErrorKind::InvalidData.into());
        }
    }
    Ok(head)
}

/// The headers that decide about a request.
#[derive(Debug, Default, PartialEq, Eq)]
struct Request {
    wants_websocket: bool,
    /// Origin of the requesting page, if it is one.
    origin: Option<String>,
    /// The host it addresses.
    host: Option<String>,
}

impl Request {
    fn parse(head: &[u8]) -> Self {
        let text = String::from_utf8_lossy(head);
        let mut request = Self::default();
        for line in text.lines().skip(1).take_while(|line| !line.is_empty()) {
            let Some((name, value)) = line.split_once(':') else { continue };
            let value = value.trim();
            match name.to_ascii_lowercase().as_str() {
                "upgrade" => request.wants_websocket = value.eq_ignore_ascii_case("websocket"),
                "origin" => request.origin = Some(value.to_ascii_lowercase()),
                "host" => request.host = Some(value.to_ascii_lowercase()),
                _ => {}
            }
        }
        request
    }

    /// Whether a loopback address may answer it. Clients other than browsers send no origin.
    /// Browsers send the host of the URL, which exposes foreign names that resolve to this machine.
    fn is_same_machine(&self) -> bool {
        let is_known = |origin: &str| {
            KNOWN_ORIGINS.contains(&origin) || origin.split_once("://").is_some_and(|(_, host)| is_loopback_host(host))
        };
        self.host.as_deref().is_none_or(is_loopback_host) && self.origin.as_deref().is_none_or(is_known)
    }
}

/// Whether a host, with or without a port, is a name of this machine.
fn is_loopback_host(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.split(':').next().unwrap_or_default(),
    };
    name == "localhost" || name.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(lines: &str) -> Request {
        Request::parse(format!("GET / HTTP/1.1\r\n{lines}\r\n\r\nUpgrade: websocket").as_bytes())
    }

    #[test]
    fn websocket_upgrade_is_read_from_the_head() {
        assert!(request("host: localhost:8765\r\nUPGRADE: WebSocket").wants_websocket);
        assert!(!request("host: localhost:8765").wants_websocket, "what comes after the head does not count");
    }

    #[test]
    fn foreign_origins_are_refused() {
        let may = |lines: &str| request(lines).is_same_machine();
        for lines in [
            "Host: localhost:8765",
            "Host: 127.0.0.1:8765\r\nOrigin: http://localhost:5173",
            "Host: [::1]:8765\r\nOrigin: http://[::1]:8765",
            "Host: 127.0.0.1\r\nOrigin: https://app.foxglove.dev",
        ] {
            assert!(may(lines), "{lines}");
        }
        for lines in [
            "Host: 127.0.0.1:8765\r\nOrigin: https://example.org",
            "Host: 127.0.0.1:8765\r\nOrigin: https://localhost.example.org",
            "Host: rebound.example.org:8765",
            "Host: 127.0.0.1:8765\r\nOrigin: null",
        ] {
            assert!(!may(lines), "{lines}");
        }
    }
}
