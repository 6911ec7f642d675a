//! The address of a server, as users see it.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

/// The address at which a server listens. Its text is one that this machine can open: a server on
/// all interfaces has the loopback address.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ServerAddress(SocketAddr);

impl ServerAddress {
    /// What users of other hosts have to know; `None` if the text is right for them.
    #[must_use]
    pub fn note(self) -> Option<String> {
        let host = self.host();
        let is_open = self.0.ip().is_unspecified();
        is_open.then(|| format!("from other hosts, use the name or address of this machine instead of {host}"))
    }

    fn host(self) -> IpAddr {
        match self.0.ip() {
            IpAddr::V4(Ipv4Addr::UNSPECIFIED) => Ipv4Addr::LOCALHOST.into(),
            IpAddr::V6(Ipv6Addr::UNSPECIFIED) => Ipv6Addr::LOCALHOST.into(),
            host => host,
        }
    }
}

impl From<SocketAddr> for ServerAddress {
    fn from(address: SocketAddr) -> Self {
        Self(address)
    }
}

impl fmt::Display for ServerAddress {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        SocketAddr::new(self.host(), self.0.port()).fmt(formatter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_on_all_interfaces_has_the_loopback_address() {
        for (bound, shown, is_open) in [
            ("0.0.0.0:8765", "127.0.0.1:8765", true),
            ("[::]:80", "[::1]:80", true),
            ("127.0.0.1:1", "127.0.0.1:1", false),
            ("192.168.1.7:8765", "192.168.1.7:8765", false),
        ] {
            let address = ServerAddress::from(bound.parse::<SocketAddr>().unwrap());
            assert_eq!(address.to_string(), shown);
            assert_eq!(address.note().is_some(), is_open, "{bound}");
        }
    }
}
