//! Meeting those who are in the network already, before anything is offered to them.
//!
//! Endpoints that are announced while somebody is still getting to know this process arrive there out of order: what came too
//! early is sent again later. Readers of Fast DDS (3.2) then take the later announcements, acknowledge all of them and never see
//! the earlier ones, so that tools which were started before a run would miss topics and nodes of it for good.
//!
//! Invariant: bounded, whatever others do. Not done here: waiting for somebody in particular; who comes later is told everything
//! in order.

use std::collections::BTreeSet;
use std::thread::sleep;
use std::time::Duration;

use rustdds::{DomainParticipant, DomainParticipantStatusEvent as Event, StatusEvented};

use super::now;

/// Wall time without anybody new after which everybody is taken to have been met. Participants answer a new one at once.
const SILENCE: Duration = Duration::from_millis(100);

/// Wall time that somebody who has shown nothing of himself is waited for.
const MEETING: Duration = Duration::from_secs(1);

/// The vendor of the middleware of this process, as RTPS counts them.
const OWN_KIND: [u8; 2] = [0x01, 0x12];

/// Wall time between two looks.
const LOOK: Duration = Duration::from_millis(5);

/// Returns when everybody who is there has shown an endpoint, which is when he listens to announcements of this process.
/// Processes with the middleware of this one lose nothing, and may be waiting here as well: they are not waited for.
#[expect(clippy::disallowed_methods, reason = "nothing tells that there is nobody else")]
pub(super) fn meet(participant: &DomainParticipant) {
    let events = participant.status_listener();
    let (mut met, mut shown) = (BTreeSet::new(), BTreeSet::new());
    let begun = now();
    let mut last = begun;
    while last.elapsed() < SILENCE || (met.difference(&shown).next().is_some() && begun.elapsed() < MEETING) {
        while let Some(event) = events.try_recv_status() {
            let is_news = match event {
                Event::ParticipantDiscovered { dpd } => {
                    dpd.vendor_id.as_bytes() != OWN_KIND && met.insert(dpd.guid.prefix)
                }
                Event::ParticipantLost { id, .. } => met.remove(&id),
                Event::ReaderDetected { reader: endpoint } | Event::WriterDetected { writer: endpoint } => {
                    shown.insert(endpoint.guid.prefix);
                    false
                }
                _ => false,
            };
            if is_news {
                last = now();
            }
        }
        if begun.elapsed() >= MEETING {
            break;
        }
        sleep(LOOK);
    }
}
