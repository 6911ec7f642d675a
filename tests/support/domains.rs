//! ROS domains, one for each test that needs one.

use std::net::{Ipv4Addr, TcpListener, UdpSocket};
use std::sync::atomic::{AtomicU16, Ordering};

/// Below the ports that Linux gives out at random, and above the domains that people choose.
const DOMAINS: std::ops::Range<u16> = 30..100;

/// A claim is a port that is listened to: the system gives it to one process, and takes it back when that ends.
const CLAIM_PORT: u16 = 17_000;

/// A ROS domain that nobody else uses, on this machine only.
#[derive(Debug)]
pub(crate) struct Domain {
    id: u16,
    _claim: TcpListener,
}

impl Domain {
    /// Claims a free one.
    pub(crate) fn claim() -> Self {
        static NEXT: AtomicU16 = AtomicU16::new(0);
        for _ in DOMAINS {
            let id = DOMAINS.start + NEXT.fetch_add(1, Ordering::Relaxed) % DOMAINS.len() as u16;
            let claim = TcpListener::bind((Ipv4Addr::LOCALHOST, CLAIM_PORT + id));
            // Where the first participant of a domain would be found.
            let is_silent = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 7410 + 250 * id)).is_ok();
            if let Ok(claim) = claim
                && is_silent
            {
                return Self { id, _claim: claim };
            }
        }
        panic!("all ROS domains from {} to {} are in use", DOMAINS.start, DOMAINS.end - 1);
    }

    /// Its number.
    pub(crate) fn id(&self) -> u16 {
        self.id
    }
}
