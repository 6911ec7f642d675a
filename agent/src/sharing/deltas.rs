//! What contacts lack of the journal, as updates.
//!
//! Invariants: the result depends on the journal, where its segments came from, and the state of
//! the exchanges alone; the updates of a batch fit into their budget.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use msgs::ids::AgentId;
use msgs::shared_bytes::SharedBytes;
use protocol::limits::AGENT_MESSAGE_BYTES_BARE;

use super::agent_set::AgentSet;
use super::outbox::{copies, is_dense};
use super::peer::{Peer, Provenance};
use super::relay_peers::Division;
use super::{map_message, position};
use crate::exploration_map::{Delta, ExplorationMap, with_delta};
use crate::observation::Contact;

/// First estimate of the bits per cell on the wire: about what LiDAR scans in open space need.
const CELL_BITS_USUAL: usize = 2;

/// Segments of the log by the agents to send them to.
pub(super) type Deltas = BTreeMap<Vec<AgentId>, Vec<Range<usize>>>;

/// The data of messages with their receivers.
pub(super) type Updates = Vec<(Vec<AgentId>, SharedBytes)>;

/// What decides on updates, beside the journal.
pub(super) struct State<'a> {
    /// The exchanges by agent.
    pub(super) peers: &'a [Peer],
    /// Where the segments of the log came from.
    pub(super) provenances: &'a [Provenance],
    /// The contacts that send what they know to their own contacts, those to choose first first.
    pub(super) delegates: &'a [AgentId],
    /// Whether what is new to a dense neighbourhood may be left to relay peers among them.
    pub(super) uses_relay_peers: bool,
}

/// What contacts lack of the journal, as [`Deltas`] or [`Updates`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct DeltaBatch<T> {
    pub(super) deltas: T,
    pub(super) by_others: ByOthers,
    /// The position of the journal at which they end.
    pub(super) end: usize,
}

/// Who sends what this agent does not send itself.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct ByOthers {
    /// Receivers, each with a delegate that sends something to it.
    pub(super) delegates: BTreeSet<(AgentId, AgentId)>,
    /// The relay peers, and those that they pass something on to.
    pub(super) relay_peers: AgentSet,
    pub(super) left_to_relay_peers: AgentSet,
}

/// The next updates for the contacts. They fit into the budget, and mostly use a good part of it.
pub(super) fn batch(
    state: &State<'_>,
    map: &ExplorationMap,
    contacts: &[Contact],
    budget: usize,
) -> Option<DeltaBatch<Updates>> {
    // The encoded size of cells is only known afterwards.
    let mut cell_bits = CELL_BITS_USUAL;
    loop {
        let DeltaBatch { deltas, by_others, end } = deltas(state, contacts, budget, cell_bits)?;
        let mut bytes = 0;
        let mut updates = Vec::new();
        for (receivers, positions) in deltas {
            let until = positions.last().map_or(0, |range| range.end);
            let reports = positions.into_iter().flat_map(|range| map.reports_to_share(range));
            let encode = |delta: &Delta| {
                let is_empty = delta.blocks.is_empty();
                (!is_empty).then(|| map_message::encode_update(&receivers, position(until), delta))
            };
            // Nothing but assumptions is no update.
            let Some(data) = with_delta(map.extent(), reports, encode).map(SharedBytes::from) else { continue };
            bytes += copies(receivers.len(), contacts) * (data.len() + AGENT_MESSAGE_BYTES_BARE);
            updates.push((receivers, data));
        }
        if bytes <= budget {
            return Some(DeltaBatch { deltas: updates, by_others, end });
        }
        let needed = (cell_bits * bytes).div_ceil(budget);
        // With `CELL_BYTES_MAX` it surely fits.
        cell_bits = needed.min(8 * map_message::CELL_BYTES_MAX).max(cell_bits + 1);
    }
}

/// For each of some receivers the first delegate, if any, that knows a segment and is in contact
/// with it. A segment without provenance is what this agent has seen itself, which no delegate
/// sends.
fn delegates_for<'s>(
    state: &'s State<'_>,
    segment: Option<&'s Provenance>,
    receivers: impl Iterator<Item = AgentId> + 's,
) -> impl Iterator<Item = (AgentId, Option<AgentId>)> + 's {
    let knows = move |delegate: &AgentId| segment.is_some_and(|segment| state.peers[delegate.index()].knows(segment));
    // In a dense neighbourhood the first that knows it is mostly in contact with all.
    let mut others = state.delegates.iter().copied().filter(knows);
    let mut knowing: Vec<AgentId> = Vec::new();
    receivers.map(move |receiver| {
        let reaches = |delegate: &AgentId| state.peers[delegate.index()].heard.receivers.contains(receiver);
        let delegate = knowing
            .iter()
            .copied()
            .find(reaches)
            .or_else(|| others.by_ref().inspect(|&delegate| knowing.push(delegate)).find(reaches));
        (receiver, delegate)
    })
}

/// Whom to send a segment that some of those in an exchange lack. What a dense neighbourhood lacks
/// is sent to all that its division names, or not at all.
fn share_out(
    state: &State<'_>,
    segment: Option<&Provenance>,
    exchanging: &[(AgentId, &Peer)],
    neighbourhood: Option<&Division>,
    by_delegates: &mut BTreeSet<(AgentId, AgentId)>,
) -> AgentSet {
    let lacks = |(_, peer): &&(AgentId, &Peer)| !segment.is_some_and(|segment| peer.knows(segment));
    let agents = exchanging.iter().filter(lacks).map(|&(agent, _)| agent);
    let (mut receivers, mut delegates) = (AgentSet::default(), Vec::new());
    for (receiver, delegate) in delegates_for(state, segment, agents) {
        match (delegate, neighbourhood) {
            (Some(delegate), _) => delegates.push((receiver, delegate)),
            (None, Some(neighbourhood)) => return neighbourhood.receivers.clone(),
            (None, None) => receivers.insert(receiver),
        }
    }
    let is_left = |receiver: AgentId| neighbourhood.is_some_and(|neighbourhood| neighbourhood.left.contains(receiver));
    by_delegates.extend(delegates.into_iter().filter(|&(receiver, _)| !is_left(receiver)));
    receivers
}

/// How what they lack is divided among those in an exchange, if this agent is in a dense
/// neighbourhood.
fn neighbourhood(state: &State<'_>, contacts: &[Contact], exchanging: &[(AgentId, &Peer)]) -> Option<Division> {
    is_dense(contacts).then(|| {
        let exchanging = AgentSet::of(exchanging.iter().map(|&(agent, _)| agent));
        let contacts = AgentSet::of(contacts.iter().map(|contact| contact.agent));
        let in_order = if state.uses_relay_peers { state.delegates } else { &[] };
        Division::of(exchanging, contacts, in_order, state.peers)
    })
}

/// The segment of the log before the present one.
struct SegmentBefore<'a> {
    /// Where it came from, if it came from others.
    provenance: Option<&'a Provenance>,
    /// Who lacked it.
    receivers: AgentSet,
    /// Its place in the delta.
    place: Option<usize>,
}

/// As many journal entries, from the first one that a contact has not been sent, as fit into
/// the budget at this estimate of bits per cell; and where they end.
pub(super) fn deltas(
    state: &State<'_>,
    contacts: &[Contact],
    mut budget: usize,
    cell_bits: usize,
) -> Option<DeltaBatch<Deltas>> {
    let State { peers, provenances, .. } = state;
    let mut by_others = ByOthers::default();
    let waiting: Vec<(AgentId, &Peer)> = contacts
        .iter()
        .filter_map(|contact| Some((contact.agent, peers.get(contact.agent.index())?)))
        .filter(|(_, peer)| peer.cursor < peer.until)
        .collect();
    let start = waiting.iter().map(|(_, peer)| peer.cursor).min()?;
    let mut at = start;
    let mut deltas: Vec<(AgentSet, Vec<Range<usize>>)> = Vec::new();
    let mut provenances =
        provenances[provenances.partition_point(|provenance| provenance.positions.end <= at)..].iter();
    let mut provenance = provenances.next();
    // Between two edges, the same peers are within their exchanges.
    let mut edges: Vec<usize> = waiting.iter().flat_map(|(_, peer)| [peer.cursor, peer.until]).collect();
    edges.sort_unstable();
    edges.dedup();
    for between in edges.windows(2) {
        let is_exchanging = |(_, peer): &(AgentId, &Peer)| (peer.cursor..peer.until).contains(&between[0]);
        let exchanging: Vec<(AgentId, &Peer)> = waiting.iter().copied().filter(is_exchanging).collect();
        let neighbourhood = neighbourhood(state, contacts, &exchanging);
        if let Some(neighbourhood) = &neighbourhood {
            by_others.relay_peers.extend(&neighbourhood.relay_peers);
            by_others.left_to_relay_peers.extend(&neighbourhood.left);
        }
        let mut before: Option<SegmentBefore> = None;
        // Segment by segment of the log; a segment is new to the same peers throughout.
        while at < between[1] {
            if provenance.is_some_and(|provenance| provenance.positions.end <= at) {
                provenance = provenances.next();
            }
            let heard = provenance.filter(|provenance| provenance.positions.start <= at);
            let hearing_edge = match (heard, provenance) {
                (Some(heard), _) => heard.positions.end,
                (None, Some(next)) => next.positions.start,
                (None, None) => usize::MAX,
            };
            let end = hearing_edge.min(between[1]);
            let is_alike = |before: &SegmentBefore<'_>| {
                before.provenance.map(|it| (it.from, it.until)) == heard.map(|it| (it.from, it.until))
            };
            if !before.as_ref().is_some_and(is_alike) {
                let receivers = share_out(state, heard, &exchanging, neighbourhood.as_ref(), &mut by_others.delegates);
                let place = deltas.iter().position(|(same, _)| *same == receivers);
                before = Some(SegmentBefore { provenance: heard, receivers, place });
            }
            let Some(SegmentBefore { receivers, place, .. }) = &mut before else {
                unreachable!("it has just been set")
            };
            let count = receivers.len();
            if count == 0 {
                at = end;
                continue;
            }
            let copies = copies(count, contacts);
            let bare = match place {
                Some(_) => 0,
                None => copies * (map_message::bare_bytes_max(count) + AGENT_MESSAGE_BYTES_BARE),
            };
            let fitting = 8 * budget.saturating_sub(bare) / (copies * cell_bits);
            let taken = (end - at).min(fitting);
            if taken == 0 {
                return found(start, at, deltas, by_others);
            }
            budget -= bare + (taken * copies * cell_bits).div_ceil(8);
            let place = *place.get_or_insert_with(|| {
                deltas.push((receivers.clone(), Vec::new()));
                deltas.len() - 1
            });
            deltas[place].1.push(at..at + taken);
            at += taken;
        }
    }
    found(start, at, deltas, by_others)
}

/// What was found between two positions, deltas in the order in which they are sent.
fn found(
    start: usize,
    end: usize,
    deltas: Vec<(AgentSet, Vec<Range<usize>>)>,
    by_others: ByOthers,
) -> Option<DeltaBatch<Deltas>> {
    let deltas = deltas.into_iter().map(|(receivers, positions)| (receivers.iter().collect(), positions)).collect();
    (end > start).then_some(DeltaBatch { deltas, by_others, end })
}
