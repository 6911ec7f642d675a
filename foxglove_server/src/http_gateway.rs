//! The HTTP gateway: the one address of a server, with the files of the page and the WebSocket.
//!
//! Every request is checked ([`super::access`]) before anything else is done with it. Connections
//! are bounded by number, by the time for a head, and by the time in which the peer has to read.

use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use http_body_util::combinators::UnsyncBoxBody;
use http_body_util::{BodyExt, Full};
use hyper::body::{Bytes, Incoming};
use hyper::header::{
    CACHE_CONTROL, CONNECTION, CONTENT_TYPE, HeaderName, HeaderValue, LOCATION, REFRESH, SEC_WEBSOCKET_PROTOCOL,
    SET_COOKIE, UPGRADE,
};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{HeaderMap, Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::{Builder, Runtime};
use tokio::sync::Semaphore;
use tokio_tungstenite::tungstenite::handshake::server::create_response_with_body;
use tower::ServiceExt;
use tower_http::compression::Compression;
use tower_http::services::{ServeDir, ServeFile};

use super::FoxgloveServerError;
use super::access::{Access, Admission, Refusal, TOKEN_SUBPROTOCOL, subprotocols, without_token};
use super::hub::Hub;
use super::static_files::{BESIDE, MAP_ROOM, RECORDING};
use super::timed_stream::TimedStream;
use super::websocket;

/// Threads that serve clients.
const THREADS: usize = 2;

/// Maximum connections; a further one is closed.
pub(super) const CONNECTIONS_MAX: usize = 128;

/// Maximum clients of the WebSocket; a further one is refused.
pub(super) const CLIENTS_MAX: usize = 32;

/// Maximum bytes of the head of a request.
const HEAD_BYTES_MAX: usize = 16 * 1024;

/// Maximum wall time for the head of a request to arrive, and of a connection without a request.
const HEAD_TIMEOUT: Duration = Duration::from_secs(5);

/// Maximum wall time in which a client reads nothing of what it was sent.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);

/// Wall time after an error of `accept`, such as too many open files.
const ACCEPT_RETRY: Duration = Duration::from_millis(100);

/// Served instead of a page that was not built.
const NO_PAGE: &str = "<!doctype html><title>MAES</title><p>The simulator is here, but its page was not built. \
    Build it with <code>npm --prefix viewer ci &amp;&amp; npm --prefix viewer run build</code>, \
    or connect Foxglove or Lichtblick to this address (Foxglove WebSocket).";

/// Headers of every response. The page runs scripts of its own files only (styles may be inline,
/// because browsers that make images add some), and frames only itself, for two recordings; it
/// reads recordings from, and connects to, any address that the user names, and decompresses with
/// WebAssembly from a data URL.
const HEADERS: [(HeaderName, HeaderValue); 6] = [
    (
        HeaderName::from_static("content-security-policy"),
        HeaderValue::from_static(
            "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; style-src 'self' 'unsafe-inline'; \
             img-src 'self' data: blob:; connect-src 'self' data: blob: http: https: ws: wss:; \
             frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'",
        ),
    ),
    (HeaderName::from_static("x-frame-options"), HeaderValue::from_static("SAMEORIGIN")),
    (HeaderName::from_static("x-content-type-options"), HeaderValue::from_static("nosniff")),
    (HeaderName::from_static("referrer-policy"), HeaderValue::from_static("no-referrer")),
    (HeaderName::from_static("cross-origin-resource-policy"), HeaderValue::from_static("same-origin")),
    (HeaderName::from_static("cross-origin-opener-policy"), HeaderValue::from_static("same-origin")),
];

/// What the gateway serves.
pub(super) struct GatewayContent {
    pub(super) page: Option<PathBuf>,
    /// The run that clients of the WebSocket observe.
    pub(super) hub: Option<Arc<Hub>>,
    /// A recording to serve.
    pub(super) recording: Option<PathBuf>,
    /// A recording to be shown beside it.
    pub(super) beside: Option<PathBuf>,
    /// What answers questions about a map, which is served as the recording.
    pub(super) map: Option<MapAnswers>,
}

/// Answers questions about a map, each the query of a request, with JSON; an error is a text for
/// the user.
pub type MapAnswers = Arc<dyn Fn(&str) -> Result<String, String> + Send + Sync>;

/// The body of a response.
type Body = UnsyncBoxBody<Bytes, Box<dyn std::error::Error + Send + Sync>>;

/// A gateway with its rules and its counts.
struct Gateway {
    content: GatewayContent,
    access: Access,
    clients: Arc<Semaphore>,
}

/// The folder of the page: the named one, else the first that has a page of those beside the
/// binary, in an installed release, and in a checkout.
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
    let binary = std::env::current_exe().and_then(|binary| binary.canonicalize()).ok()?;
    let folder = binary.parent()?;
    let places = ["viewer", "../share/maes/viewer/dist", "../../viewer/dist"];
    let candidates = places.map(|place| folder.join(place));
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
pub(super) fn serve(runtime: &Runtime, listener: TcpListener, access: Access, content: GatewayContent) {
    let gateway = Arc::new(Gateway { content, access, clients: Arc::new(Semaphore::new(CLIENTS_MAX)) });
    let connections = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    runtime.spawn(async move {
        loop {
            let Ok((stream, _)) = listener.accept().await else {
                // No more open files, perhaps: that passes when connections end.
                tokio::time::sleep(ACCEPT_RETRY).await;
                continue;
            };
            let Ok(permit) = Arc::clone(&connections).try_acquire_owned() else { continue };
            let gateway = Arc::clone(&gateway);
            tokio::spawn(async move {
                // Errors of a connection concern no other one.
                drop(serve_connection(stream, gateway, Arc::new(permit)).await);
            });
        }
    });
}

/// Serves one connection. The permit lasts as long as the connection, also as a WebSocket.
async fn serve_connection<P: Send + Sync + 'static>(
    stream: TcpStream,
    gateway: Arc<Gateway>,
    permit: Arc<P>,
) -> hyper::Result<()> {
    drop(stream.set_nodelay(true));
    let stream = TokioIo::new(TimedStream::new(stream, WRITE_TIMEOUT));
    let service = service_fn(move |request| {
        let (gateway, permit) = (Arc::clone(&gateway), Arc::clone(&permit));
        async move { Ok::<_, Infallible>(gateway.respond(request, permit).await) }
    });
    http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIMEOUT)
        .max_buf_size(HEAD_BYTES_MAX)
        .serve_connection(stream, service)
        .with_upgrades()
        .await
}

impl Gateway {
    /// Answers a request, which keeps the permit of its connection if it becomes a WebSocket.
    async fn respond<P: Send + Sync + 'static>(&self, request: Request<Incoming>, permit: Arc<P>) -> Response<Body> {
        let mut response = match self.access.check(request.headers(), request.uri().query()) {
            Err(refusal) => refused(refusal),
            Ok(_) if wants_websocket(&request) => self.upgrade(request, permit),
            Ok(_) if !matches!(*request.method(), Method::GET | Method::HEAD) => {
                text(StatusCode::METHOD_NOT_ALLOWED, "the page is only read")
            }
            Ok(Admission::Token) if is_page_itself(&request) => self.admit(&request),
            Ok(_) => self.file(request).await,
        };
        let headers = response.headers_mut();
        headers.extend(HEADERS);
        response
    }

    /// Exchanges the token in the address of the page for a cookie, and leads to the address
    /// without it.
    fn admit(&self, request: &Request<Incoming>) -> Response<Body> {
        let clean = format!("{}{}", request.uri().path(), without_token(request.uri().query()));
        let mut response = text(StatusCode::SEE_OTHER, "");
        let headers = response.headers_mut();
        let site = HeaderName::from_static("sec-fetch-site");
        let [cookie, clean] = [self.access.cookie(), clean].map(HeaderValue::try_from);
        let (Ok(cookie), Ok(clean)) = (cookie, clean) else { return text(StatusCode::BAD_REQUEST, "") };
        headers.insert(SET_COOKIE, cookie);
        if request.headers().get(site).is_some_and(|site| site == "cross-site" || site == "same-site") {
            // After a link of another page, a browser sends no strict cookie with a redirect, but
            // with what a page of this origin opens.
            let Ok(refresh) = HeaderValue::try_from(format!("0;url={}", clean.to_str().unwrap_or("/"))) else {
                return text(StatusCode::BAD_REQUEST, "");
            };
            headers.insert(REFRESH, refresh);
            *response.status_mut() = StatusCode::OK;
        } else {
            headers.insert(LOCATION, clean);
        }
        response
    }

    /// Answers the handshake of a WebSocket, and serves the client.
    fn upgrade<P: Send + Sync + 'static>(&self, mut request: Request<Incoming>, permit: Arc<P>) -> Response<Body> {
        let Some(hub) = self.content.hub.clone() else { return text(StatusCode::NOT_FOUND, "there is no run here") };
        let is_offered = |known: &&str| subprotocols(request.headers()).any(|offered| offered == *known);
        let Some(subprotocol) = websocket::SUBPROTOCOLS.into_iter().find(is_offered) else {
            return text(StatusCode::BAD_REQUEST, &other_subprotocol(request.headers()));
        };
        let Ok(mut response) = create_response_with_body(&request, empty) else {
            return text(StatusCode::BAD_REQUEST, "expected the handshake of a WebSocket (RFC 6455)");
        };
        let Ok(client) = Arc::clone(&self.clients).try_acquire_owned() else {
            return text(StatusCode::SERVICE_UNAVAILABLE, &format!("{CLIENTS_MAX} clients are connected already"));
        };
        response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(subprotocol));
        let upgraded = hyper::upgrade::on(&mut request);
        tokio::spawn(async move {
            if let Ok(stream) = upgraded.await {
                websocket::serve(TokioIo::new(stream), hub).await;
            }
            drop((client, permit));
        });
        response
    }

    /// Serves a file of the page, or a recording.
    async fn file(&self, request: Request<Incoming>) -> Response<Body> {
        let recording = match request.uri().path().split('/').nth(1) {
            Some(RECORDING) => self.content.recording.as_ref(),
            Some(BESIDE) => self.content.beside.as_ref(),
            _ => None,
        };
        if let Some(recording) = recording {
            // Uncompressed, so that range requests work.
            let Ok(response) = ServeFile::new(recording).oneshot(request).await;
            return response.map(|body| body.map_err(Into::into).boxed_unsync());
        }
        if let (Some(answers), MAP_ROOM) = (&self.content.map, request.uri().path().trim_start_matches('/')) {
            return answered(Arc::clone(answers), request.uri().query().unwrap_or_default().to_owned()).await;
        }
        let Some(folder) = &self.content.page else {
            let mut response = text(StatusCode::OK, NO_PAGE);
            response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("text/html; charset=utf-8"));
            return response;
        };
        let Ok(mut response) = Compression::new(ServeDir::new(folder)).oneshot(request).await;
        // A rebuilt page must not come from the cache.
        response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
        response.map(|body| body.map_err(Into::into).boxed_unsync())
    }
}

/// Answers a question about the map, on a thread that may take its time.
async fn answered(answers: MapAnswers, query: String) -> Response<Body> {
    match tokio::task::spawn_blocking(move || answers(&query)).await {
        Ok(Ok(answer)) => {
            let mut response = text(StatusCode::OK, &answer);
            response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("application/json"));
            response
        }
        Ok(Err(reason)) => text(StatusCode::BAD_REQUEST, &reason),
        Err(_) => text(StatusCode::INTERNAL_SERVER_ERROR, "the question has no answer"),
    }
}

fn wants_websocket(request: &Request<Incoming>) -> bool {
    request.headers().get(UPGRADE).is_some_and(|value| value.as_bytes().eq_ignore_ascii_case(b"websocket"))
}

/// Why a client is refused that offers no subprotocol of this server.
fn other_subprotocol(headers: &HeaderMap) -> String {
    let offered: Vec<&str> = subprotocols(headers).filter(|name| !name.starts_with(TOKEN_SUBPROTOCOL)).collect();
    let offered = if offered.is_empty() { "none".to_owned() } else { offered.join(", ") };
    format!("expected one of the subprotocols {}, offered: {offered}", websocket::SUBPROTOCOLS.join(", "))
}

fn is_page_itself(request: &Request<Incoming>) -> bool {
    matches!(request.uri().path(), "/" | "/index.html")
}

fn refused(refusal: Refusal) -> Response<Body> {
    let mut response = match refusal {
        Refusal::Foreign => text(
            StatusCode::FORBIDDEN,
            "this simulator serves its own page only; --view-allow-origin ORIGIN allows those of another origin",
        ),
        Refusal::NoToken => text(
            StatusCode::UNAUTHORIZED,
            "the token is missing or old: open the address that the simulator has printed, with ?token=...",
        ),
    };
    // Without a token nothing is kept open.
    response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
    response
}

fn text(status: StatusCode, text: &str) -> Response<Body> {
    let body = Full::new(Bytes::copy_from_slice(text.as_bytes())).map_err(|never| match never {}).boxed_unsync();
    let mut response = Response::new(body);
    *response.status_mut() = status;
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("text/plain; charset=utf-8"));
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

fn empty() -> Body {
    Full::default().map_err(|never| match never {}).boxed_unsync()
}
