//! Who may use the page and the WebSocket: the token of this start, and the origins of pages.
//!
//! The token is in the address that is printed. A browser gets a cookie for it on its first load;
//! other programs show the token in the query of each address, or as a WebSocket subprotocol.
//! Requests of pages of another origin are refused, token or not, unless the origin was allowed.
//! On a loopback address the host must be a name of this machine (DNS rebinding).
//!
//! Invariants: without a token nothing is answered but the refusal, which says nothing about the
//! run. Tokens are compared in constant time, by their hashes.

use std::fmt;
use std::net::SocketAddr;

use hyper::HeaderMap;
use hyper::header::{COOKIE, HOST, HeaderName, ORIGIN, SEC_WEBSOCKET_PROTOCOL};

use super::FoxgloveServerError;

/// The environment variable that sets the token.
pub const TOKEN_VARIABLE: &str = "MAES_VIEW_TOKEN";

/// Characters of a token that the user sets.
const TOKEN_CHARACTERS: std::ops::RangeInclusive<usize> = 16..=256;

/// Bytes of a token that is drawn.
const TOKEN_BYTES: usize = 24;

/// The parameter of the query with the token.
const TOKEN_PARAMETER: &str = "token";

/// What precedes the token in a subprotocol.
pub(super) const TOKEN_SUBPROTOCOL: &str = "maes.token.";

/// The secret of one start of the server.
#[derive(Clone)]
pub struct Token(String);

impl Token {
    /// The token of `MAES_VIEW_TOKEN`, or else a new one.
    ///
    /// # Errors
    /// If the variable has no token, or the system has no random bytes.
    pub fn of_environment() -> Result<Self, FoxgloveServerError> {
        match std::env::var_os(TOKEN_VARIABLE) {
            Some(text) => Self::parse(&text.to_string_lossy()),
            None => Self::draw(),
        }
    }

    /// A new token of 192 random bits.
    ///
    /// # Errors
    /// If the system has no random bytes.
    pub fn draw() -> Result<Self, FoxgloveServerError> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes).map_err(std::io::Error::other)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    fn parse(text: &str) -> Result<Self, FoxgloveServerError> {
        let is_plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte));
        if is_plain && TOKEN_CHARACTERS.contains(&text.len()) {
            Ok(Self(text.to_owned()))
        } else {
            Err(FoxgloveServerError::Token)
        }
    }

    /// The token as text, for an address.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Whether a text is this token, in a time that does not depend on where they differ.
    fn is(&self, text: &str) -> bool {
        blake3::hash(self.0.as_bytes()) == blake3::hash(text.as_bytes())
    }

    /// The value of the cookie. Browsers send cookies to all ports of a host, so it is not the
    /// token, which may serve for several starts.
    fn cookie(&self) -> Self {
        let key = blake3::derive_key("maes 2026 cookie of the page", self.0.as_bytes());
        Self(blake3::Hash::from(key).to_hex().to_string())
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Token(..)")
    }
}

/// The origin of a page: `scheme://host[:port]`, in lower case.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PageOrigin(String);

impl std::str::FromStr for PageOrigin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let origin = text.to_ascii_lowercase();
        let host = origin.strip_prefix("https://").or_else(|| origin.strip_prefix("http://"));
        let is_host = |byte: u8| byte.is_ascii_alphanumeric() || b".:-_[]".contains(&byte);
        match host {
            Some(host) if !host.is_empty() && host.bytes().all(is_host) => Ok(Self(origin)),
            _ => Err("expected the origin of a page, such as https://app.foxglove.dev, without a path".to_owned()),
        }
    }
}

impl fmt::Display for PageOrigin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

/// Why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Refusal {
    /// It is for another host, or of a page of another origin.
    Foreign,
    /// It shows no token.
    NoToken,
}

/// How a request was admitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Admission {
    /// By the cookie.
    Cookie,
    /// By the token in the query or a subprotocol.
    Token,
}

/// The rules of a server.
#[derive(Debug)]
pub(super) struct Access {
    token: Token,
    cookie: Token,
    allowed: Vec<PageOrigin>,
    is_loopback: bool,
    cookie_name: String,
}

impl Access {
    pub(super) fn new(token: Token, allowed: &[PageOrigin], address: SocketAddr) -> Self {
        Self {
            cookie: token.cookie(),
            token,
            allowed: allowed.to_owned(),
            is_loopback: address.ip().is_loopback(),
            // Cookies do not tell ports apart: each server has a name of its own.
            cookie_name: format!("maes_view_{}", address.port()),
        }
    }

    /// Whether a request is served.
    pub(super) fn check(&self, headers: &HeaderMap, query: Option<&str>) -> Result<Admission, Refusal> {
        let host = text(headers, HOST).map(str::to_ascii_lowercase);
        if self.is_loopback && !host.as_deref().is_none_or(is_loopback_host) {
            return Err(Refusal::Foreign);
        }
        if headers.contains_key(ORIGIN) {
            let origin = text(headers, ORIGIN).ok_or(Refusal::Foreign)?.to_ascii_lowercase();
            let (_, authority) = origin.split_once("://").ok_or(Refusal::Foreign)?;
            let is_own = host.as_deref() == Some(authority);
            if !is_own && !self.allowed.iter().any(|PageOrigin(allowed)| *allowed == origin) {
                return Err(Refusal::Foreign);
            }
        }
        let tokens = parameters(query).filter_map(|(name, value)| (name == TOKEN_PARAMETER).then_some(value));
        let offered = subprotocols(headers).filter_map(|name| name.strip_prefix(TOKEN_SUBPROTOCOL));
        if tokens.chain(offered).any(|shown| self.token.is(shown)) {
            return Ok(Admission::Token);
        }
        let cookies = headers.get_all(COOKIE).iter().filter_map(|value| value.to_str().ok());
        let mut cookies = cookies.flat_map(|line| line.split(';')).filter_map(|cookie| cookie.trim().split_once('='));
        if cookies.any(|(name, value)| name == self.cookie_name && self.cookie.is(value)) {
            return Ok(Admission::Cookie);
        }
        Err(Refusal::NoToken)
    }

    /// The header `Set-Cookie` that admits a browser. No script sees the cookie, and no other site
    /// makes a browser send it.
    pub(super) fn cookie(&self) -> String {
        format!("{}={}; Path=/; HttpOnly; SameSite=Strict", self.cookie_name, self.cookie.as_str())
    }

    /// The query of the address of the page, with the token.
    pub(super) fn query(&self) -> String {
        format!("{TOKEN_PARAMETER}={}", self.token.as_str())
    }
}

/// The query without the token.
pub(super) fn without_token(query: Option<&str>) -> String {
    let others = query.unwrap_or_default().split('&').filter(|part| !part.is_empty());
    let others: Vec<&str> = others.filter(|part| part.split('=').next() != Some(TOKEN_PARAMETER)).collect();
    if others.is_empty() { String::new() } else { format!("?{}", others.join("&")) }
}

/// The subprotocols that a client offers.
pub(super) fn subprotocols(headers: &HeaderMap) -> impl Iterator<Item = &str> {
    let lines = headers.get_all(SEC_WEBSOCKET_PROTOCOL).iter().filter_map(|value| value.to_str().ok());
    lines.flat_map(|line| line.split(',')).map(str::trim)
}

fn parameters(query: Option<&str>) -> impl Iterator<Item = (&str, &str)> {
    query.unwrap_or_default().split('&').filter_map(|part| part.split_once('='))
}

fn text(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
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

    const TOKEN: &str = "a-token_of_tests-1";

    fn access(address: &str) -> Access {
        let allowed = ["https://App.Foxglove.dev".parse().unwrap()];
        Access::new(Token::parse(TOKEN).unwrap(), &allowed, address.parse().unwrap())
    }

    fn check(address: &str, query: &str, lines: &[(&str, &str)]) -> Result<Admission, Refusal> {
        let parse = |(name, value): &(&str, &str)| (name.parse::<HeaderName>().unwrap(), value.parse().unwrap());
        access(address).check(&lines.iter().map(parse).collect(), Some(query))
    }

    #[test]
    fn foreign_pages_are_refused() {
        let may = |host: &str, origin: &str, address: &str| {
            check(address, &format!("token={TOKEN}"), &[("Host", host), ("Origin", origin)])
        };
        const LOCAL: &str = "127.0.0.1:8765";
        for (host, origin, address) in [
            ("localhost:8765", "http://localhost:8765", LOCAL),
            ("[::1]:8765", "http://[::1]:8765", LOCAL),
            (LOCAL, "https://app.foxglove.dev", LOCAL),
            ("robot.lan:8765", "http://robot.lan:8765", "0.0.0.0:8765"),
        ] {
            assert_eq!(may(host, origin, address), Ok(Admission::Token), "{host} {origin} {address}");
        }
        for (host, origin, address) in [
            (LOCAL, "https://example.org", LOCAL),
            (LOCAL, "http://127.0.0.1:9999", LOCAL),
            (LOCAL, "https://app.foxglove.dev.example.org", LOCAL),
            (LOCAL, "null", LOCAL),
            ("rebound.example.org:8765", "http://rebound.example.org:8765", LOCAL),
            ("robot.lan:8765", "https://example.org", "0.0.0.0:8765"),
        ] {
            assert_eq!(may(host, origin, address), Err(Refusal::Foreign), "{host} {origin} {address}");
        }
    }

    #[test]
    fn token_is_required() {
        let cookie = access("127.0.0.1:8765").cookie();
        let cookie = cookie.split(';').next().unwrap();
        let check = |query: &str, name: &str, value: &str| check("127.0.0.1:8765", query, &[(name, value)]);
        assert_eq!(check(&format!("a=b&token={TOKEN}"), "x", ""), Ok(Admission::Token));
        let offered = format!("foxglove.sdk.v1, maes.token.{TOKEN}");
        assert_eq!(check("", "Sec-WebSocket-Protocol", &offered), Ok(Admission::Token));
        assert_eq!(check("token=old", "Cookie", &format!("a=b; {cookie}")), Ok(Admission::Cookie));
        let [other_port, not_the_cookie] = [cookie.replace("8765", "8766"), format!("maes_view_8765={TOKEN}")];
        for (query, name, value) in [
            ("", "x", ""),
            ("token=", "x", ""),
            ("token=a-token_of_tests-2", "x", ""),
            ("", "Cookie", other_port.as_str()),
            ("", "Cookie", &not_the_cookie),
            ("", "Sec-WebSocket-Protocol", "maes.token., foxglove.sdk.v1"),
        ] {
            assert_eq!(check(query, name, value), Err(Refusal::NoToken), "{query} {name} {value}");
        }
    }

    #[test]
    fn tokens_and_origins_are_checked() {
        assert_ne!(Token::draw().unwrap().as_str(), Token::draw().unwrap().as_str());
        assert_eq!(Token::draw().unwrap().as_str().len(), 2 * TOKEN_BYTES);
        for wrong in ["", "fifteen-letters", "sixteen letters!", "a/b/c/d/e/f/g/h/i"] {
            assert!(Token::parse(wrong).is_err(), "{wrong}");
        }
        for wrong in ["*", "null", "https://", "https://a/b", "ftp://a", "app.foxglove.dev"] {
            assert!(wrong.parse::<PageOrigin>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn token_leaves_the_address() {
        assert_eq!(without_token(Some("token=x")), "");
        assert_eq!(without_token(Some("token=x&recording=a/b.mcap&time=3")), "?recording=a/b.mcap&time=3");
        assert_eq!(without_token(None), "");
    }
}
