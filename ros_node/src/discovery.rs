//! Waiting for discovery of the participants that are already in the domain, before this process
//! creates endpoints.
//!
//! Endpoint announcements that reach a participant still in the middle of discovery arrive out of
//! order, because the early ones are lost and repaired later. Readers of Fast DDS (3.2) accept the
//! later announcements, acknowledge all of them and never see the earlier ones, so tools started
//! before a run would miss some of its topics and nodes for good.
//!
//! Invariant: the wait is bounded. Participants that join later receive all announcements in order
//! and need no wait; no particular participant is waited for.

use std::collections::BTreeSet;
use std::thread::sleep;
use std::time::Duration;

use rustdds::{DomainParticipant, DomainParticipantStatusEvent as Event, StatusEvented};

use super::now;

/// Wall time without a new participant after which discovery counts as complete. Participants
/// answer a new one at once.
const QUIET_PERIOD: Duration = Duration::from_millis(100);

/// Maximum wall time to wait for a participant that has announced no endpoint.
const DISCOVERY_TIMEOUT: Duration = Duration::from_secs(1);

/// RTPS vendor id of this process's own middleware.
const OWN_VENDOR: [u8; 2] = [0x01, 0x12];

/// Wall time between two polls of the discovery events.
const POLL_PERIOD: Duration = Duration::from_millis(5);

/// Returns when every known participant has announced an endpoint, from when on it also receives
/// the announcements of this process. Participants with the same middleware lose nothing and may be
/// waiting here as well, so they are not waited for.
#[expect(clippy::disallowed_methods, reason = "no event marks the end of discovery")]
pub(super) fn wait_for_discovery(participant: &DomainParticipant) {
    let events = participant.status_listener();
    let (mut discovered, mut with_endpoints) = (BTreeSet::new(), BTreeSet::new());
    let begun = now();
    let mut last = begun;
    while last.elapsed() < QUIET_PERIOD
        || (discovered.difference(&with_endpoints).next().is_some() && begun.elapsed() < DISCOVERY_TIMEOUT)
    {
        while let Some(event) = events.try_recv_status() {
            let is_new = match event {
                Event::ParticipantDiscovered { dpd } => {
                    dpd.vendor_id.as_bytes() != OWN_VENDOR && discovered.insert(dpd.guid.prefix)
                }
                Event::ParticipantLost { id, .. } => discovered.remove(&id),
                Event::ReaderDetected { reader: endpoint } | Event::WriterDetected { writer: endpoint } => {
                    with_endpoints.insert(endpoint.guid.prefix);
                    false
                }
                _ => false,
            };
            if is_new {
                last = now();
            }
        }
        if begun.elapsed() >= DISCOVERY_TIMEOUT {
            break;
        }
        sleep(POLL_PERIOD);
    }
}
