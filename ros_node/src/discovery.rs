//! Waiting for discovery of the participants that are already in the domain, before this process
//! creates endpoints.
//!
//! Endpoint announcements that reach a participant still in the middle of discovery arrive out of
//! order, because the early ones are lost and repaired later. Readers of Fast DDS (3.2) accept the
//! later announcements, acknowledge all of them and never see the earlier ones, so tools started
//! before a run would miss some of its topics and nodes for good.
//!
//! A participant of this machine is known to exist before it answers: its discovery port is taken.
//! On a busy machine the answer takes hundreds of milliseconds, so no fixed time without news ends
//! the wait as long as a port is taken whose participant has not answered.
//!
//! The same happens if the socket of such a participant overflows in the burst of a whole team, so
//! where there is one, endpoints are announced in batches with a pause for repairs (`join`).
//!
//! Invariant: the wait is bounded. Participants that join later receive all announcements in order
//! and need no wait. Participants of other machines are waited for as long as news of them arrives,
//! and no longer.

use std::collections::BTreeSet;
use std::ops::Range;
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustdds::{DomainParticipant, DomainParticipantStatusEvent as Event, StatusEvented};

use super::dds::{DISCOVERABLE_IDS, discovery_port};
use system::wall_clock::now;

/// Wall time without a new participant after which discovery counts as complete. Participants
/// answer a new one at once.
const QUIET_PERIOD: Duration = Duration::from_millis(100);

/// Maximum wall time to wait for a participant of this machine that does not answer, or that has
/// announced no endpoint: it may be suspended, or no participant at all. Shorter than the limit of
/// a start (`process_guard`), which is 10 s.
const DISCOVERY_TIMEOUT: Duration = Duration::from_secs(5);

/// RTPS vendor id of this process's own middleware.
const OWN_VENDOR: [u8; 2] = [0x01, 0x12];

/// Wall time between two polls of the discovery events.
const POLL_PERIOD: Duration = Duration::from_millis(5);

/// Wall time between two looks at the list of sockets, which costs as much as there are sockets.
const SOCKETS_PERIOD: Duration = Duration::from_millis(50);

/// Where Linux lists the UDP sockets of this network namespace.
const SOCKETS: &str = "/proc/net/udp";

/// The part of a GUID that names a participant.
type Prefix = Vec<u8>;

/// The other participants of the domain, as far as they have been discovered.
#[derive(Default)]
struct Discovery {
    /// Participants that have answered.
    discovered: BTreeSet<Prefix>,
    /// Participants of another middleware, which lose announcements.
    foreign: BTreeSet<Prefix>,
    /// Participants that have announced an endpoint, from when on they also receive the
    /// announcements of this process.
    with_endpoints: BTreeSet<Prefix>,
}

impl Discovery {
    /// Takes a discovery event into account; returns whether it is a new participant.
    fn note(&mut self, event: Event) -> bool {
        match event {
            Event::ParticipantDiscovered { dpd } => {
                if dpd.vendor_id.as_bytes() != OWN_VENDOR {
                    self.foreign.insert(prefix(dpd.guid.prefix));
                }
                return self.discovered.insert(prefix(dpd.guid.prefix));
            }
            Event::ParticipantLost { id, .. } => {
                self.discovered.remove(&prefix(id));
                self.foreign.remove(&prefix(id));
            }
            Event::ReaderDetected { reader: endpoint } | Event::WriterDetected { writer: endpoint } => {
                self.with_endpoints.insert(prefix(endpoint.guid.prefix));
            }
            _ => {}
        }
        false
    }

    /// Whether all participants of this machine that hold a discovery port have answered, and all
    /// foreign ones have announced an endpoint. Participants with the same middleware lose nothing
    /// and may be waiting here as well, so their endpoints are not waited for.
    fn is_complete(&self, others_here: usize) -> bool {
        self.discovered.len() >= others_here && self.foreign.is_subset(&self.with_endpoints)
    }
}

fn prefix(prefix: impl AsRef<[u8]>) -> Prefix {
    prefix.as_ref().to_vec()
}

/// Waits until every known participant has answered and, if it is of another middleware, has
/// announced an endpoint. Returns whether there is one of another middleware.
#[expect(clippy::disallowed_methods, reason = "no event marks the end of discovery")]
pub(super) fn wait_for_discovery(participant: &DomainParticipant) -> bool {
    let events = participant.status_listener();
    let own_port = discovery_port(participant.domain_id(), participant.participant_id());
    let ports = discovery_port(participant.domain_id(), 0)..discovery_port(participant.domain_id(), DISCOVERABLE_IDS);
    let mut discovery = Discovery::default();
    let begun = now();
    let (mut last, mut looked) = (begun, None);
    while begun.elapsed() < DISCOVERY_TIMEOUT {
        while let Some(event) = events.try_recv_status() {
            if discovery.note(event) {
                last = now();
            }
        }
        // The ports are looked at again and again: a process that ends, or that only tries a port,
        // frees it.
        if last.elapsed() >= QUIET_PERIOD && looked.is_none_or(|looked: Instant| looked.elapsed() >= SOCKETS_PERIOD) {
            looked = Some(now());
            if discovery.is_complete(other_participants_here(&ports, own_port)) {
                break;
            }
        }
        sleep(POLL_PERIOD);
    }
    !discovery.foreign.is_empty()
}

/// Participants of this network namespace, other than this one, that this one has announced itself
/// to; 0 where the system does not list its sockets.
fn other_participants_here(ports: &Range<u16>, own_port: u16) -> usize {
    std::fs::read_to_string(SOCKETS).map_or(0, |sockets| count_participants(&sockets, ports, own_port))
}

/// Discovery ports among the sockets of `/proc/net/udp`. The second column is the local address,
/// `0100007F:6825`, in hexadecimal; ports of user traffic lie between the discovery ports.
fn count_participants(sockets: &str, ports: &Range<u16>, own_port: u16) -> usize {
    let port = |line: &str| u16::from_str_radix(line.split_whitespace().nth(1)?.rsplit_once(':')?.1, 16).ok();
    let is_other = |port: &u16| ports.contains(port) && (port - ports.start).is_multiple_of(2) && *port != own_port;
    sockets.lines().filter_map(port).filter(is_other).collect::<BTreeSet<u16>>().len()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Domain 77: ids 0 to 2 hold ports 26660, 26662 and 26664, user traffic those between.
    const LISTED: &str = "   sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid
  101: 00000000:6824 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 11 2 0000 0
  102: 00000000:6825 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 12 2 0000 0
  103: 0100007F:6826 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 13 2 0000 0
  103: 00000000:6826 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 14 2 0000 0
  104: 00000000:6828 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 15 2 0000 0
  105: 00000000:0044 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 16 2 0000 0
";

    #[test]
    fn participants_of_the_machine_are_counted_by_their_ports() {
        let ports = discovery_port(77, 0)..discovery_port(77, DISCOVERABLE_IDS);
        assert_eq!(count_participants(LISTED, &ports, 26_664), 2, "ids 0 and 1, each once");
        assert_eq!(count_participants(LISTED, &ports, 26_700), 3);
        assert_eq!(count_participants("", &ports, 26_664), 0);
        assert_eq!(count_participants("no table\nof sockets", &ports, 26_664), 0);
    }

    /// A foreign participant that answers after 160 ms, as one did beside a busy machine's eight
    /// other processes, was not waited for, and missed the nodes of this process for good.
    #[test]
    fn discovery_is_incomplete_until_each_participant_has_answered() {
        let (own, foreign) = (prefix([1; 12]), prefix([2; 12]));
        let mut discovery = Discovery::default();
        assert!(discovery.is_complete(0));
        assert!(!discovery.is_complete(1), "a port is taken, and its participant has not answered");
        discovery.discovered.insert(own);
        assert!(discovery.is_complete(1));
        assert!(!discovery.is_complete(2));
        discovery.discovered.insert(foreign.clone());
        discovery.foreign.insert(foreign.clone());
        assert!(!discovery.is_complete(2), "the foreign one does not receive announcements yet");
        discovery.with_endpoints.insert(foreign);
        assert!(discovery.is_complete(2));
    }

    #[test]
    fn sockets_of_this_machine_are_listed() {
        let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
        let port = socket.local_addr().unwrap().port();
        let ports = port..port.saturating_add(1);
        if cfg!(target_os = "linux") {
            assert_eq!(other_participants_here(&ports, 0), 1);
            assert_eq!(other_participants_here(&ports, port), 0);
        }
    }
}
