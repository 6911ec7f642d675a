//! What contacts lack of the journal, as updates.
//!
//! Invariants: the result depends on the journal, where its sections came from, and the state of
//! the exchanges alone; the updates of a batch fit into their budget.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use msgs::ids::AgentId;
use msgs::limits::PARCEL_BYTES_BARE;
use msgs::shared_bytes::SharedBytes;

use super::agent_set::AgentSet;
use super::hubs::Division;
use super::outbox::{copies, is_crowd};
use super::peer::{Peer, Provenance};
use super::{map_message, position};
use crate::exploration_map::{ExplorationMap, with_delta};
use crate::observation::Contact;

/// First estimate of the bits per cell on the wire: about what LiDAR scans in open space need.
const CELL_BITS_USUAL: usize = 2;

/// Sections of the journal by the agents to send them to.
pub(super) type News = BTreeMap<Vec<AgentId>, Vec<Range<usize>>>;

/// The data of messages with their receivers.
pub(super) type Updates = Vec<(Vec<AgentId>, SharedBytes)>;

/// What decides on updates, beside the journal.
pub(super) struct State<'a> {
    /// The exchanges by agent.
    pub(super) peers: &'a [Peer],
    /// Where the sections of the journal came from.
    pub(super) provenances: &'a [Provenance],
    /// The contacts that send what they know to their own contacts, those to choose first first.
    pub(super) deputies: &'a [AgentId],
    /// Whether what is new to a crowd may be left to hubs among them.
    pub(super) uses_hubs: bool,
}

/// What contacts lack of the journal, as [`News`] or [`Updates`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Found<T> {
    pub(super) news: T,
    pub(super) by_others: ByOthers,
    /// The position of the journal at which they end.
    pub(super) end: usize,
}

/// Who sends what this agent does not send itself.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct ByOthers {
    /// Receivers, each with a deputy that sends something to it.
    pub(super) deputies: BTreeSet<(AgentId, AgentId)>,
    /// The hubs, and those that they pass something on to.
    pub(super) hubs: AgentSet,
    pub(super) left_to_hubs: AgentSet,
}

/// The next updates for the contacts. They fit into the budget, and mostly use a good part of it.
pub(super) fn batch(
    state: &State<'_>,
    map: &ExplorationMap,
    contacts: &[Contact],
    budget: usize,
) -> Option<Found<Updates>> {
    // The encoded size of cells is only known afterwards.
    let mut cell_bits = CELL_BITS_USUAL;
    loop {
        let Found { news, by_others, end } = news(state, contacts, budget, cell_bits)?;
        let mut bytes = 0;
        let mut updates = Vec::new();
        for (receivers, positions) in news {
            let until = positions.last().map_or(0, |range| range.end);
            let reports = positions.into_iter().flat_map(|range| map.reports(range));
            let encode = |delta: &_| map_message::encode_update(&receivers, position(until), delta);
            let data = SharedBytes::from(with_delta(map.extent(), reports, encode));
            bytes += copies(receivers.len(), contacts) * (data.len() + PARCEL_BYTES_BARE);
            updates.push((receivers, data));
        }
        if bytes <= budget {
            return Some(Found { news: updates, by_others, end });
        }
        let needed = (cell_bits * bytes).div_ceil(budget);
        // With `CELL_BYTES_MAX` it surely fits.
        cell_bits = needed.min(8 * map_message::CELL_BYTES_MAX).max(cell_bits + 1);
    }
}

/// For each of some receivers the first deputy, if any, that knows a section and is in contact with
/// it. A section without provenance is what this agent has seen itself, which no deputy sends.
fn deputies_for<'s>(
    state: &'s State<'_>,
    section: Option<&'s Provenance>,
    receivers: impl Iterator<Item = AgentId> + 's,
) -> impl Iterator<Item = (AgentId, Option<AgentId>)> + 's {
    let knows = move |deputy: &AgentId| section.is_some_and(|section| state.peers[deputy.index()].knows(section));
    // In a crowd the first that knows it is mostly in contact with all.
    let mut others = state.deputies.iter().copied().filter(knows);
    let mut knowing: Vec<AgentId> = Vec::new();
    receivers.map(move |receiver| {
        let reaches = |deputy: &AgentId| state.peers[deputy.index()].heard.receivers.contains(receiver);
        let deputy = knowing
            .iter()
            .copied()
            .find(reaches)
            .or_else(|| others.by_ref().inspect(|&deputy| knowing.push(deputy)).find(reaches));
        (receiver, deputy)
    })
}

/// Whom to send a section that some of those in an exchange lack. What a crowd lacks is sent to all
/// that its division names, or not at all.
fn share_out(
    state: &State<'_>,
    section: Option<&Provenance>,
    exchanging: &[(AgentId, &Peer)],
    crowd: Option<&Division>,
    by_deputies: &mut BTreeSet<(AgentId, AgentId)>,
) -> AgentSet {
    let lacks = |(_, peer): &&(AgentId, &Peer)| !section.is_some_and(|section| peer.knows(section));
    let agents = exchanging.iter().filter(lacks).map(|&(agent, _)| agent);
    let (mut receivers, mut deputies) = (AgentSet::default(), Vec::new());
    for (receiver, deputy) in deputies_for(state, section, agents) {
        match (deputy, crowd) {
            (Some(deputy), _) => deputies.push((receiver, deputy)),
            (None, Some(crowd)) => return crowd.receivers.clone(),
            (None, None) => receivers.insert(receiver),
        }
    }
    let is_left = |receiver: AgentId| crowd.is_some_and(|crowd| crowd.left.contains(receiver));
    by_deputies.extend(deputies.into_iter().filter(|&(receiver, _)| !is_left(receiver)));
    receivers
}

/// How what they lack is divided among those in an exchange, if this agent is in a crowd.
fn crowd(state: &State<'_>, contacts: &[Contact], exchanging: &[(AgentId, &Peer)]) -> Option<Division> {
    is_crowd(contacts).then(|| {
        let exchanging = AgentSet::of(exchanging.iter().map(|&(agent, _)| agent));
        let contacts = AgentSet::of(contacts.iter().map(|contact| contact.agent));
        let in_order = if state.uses_hubs { state.deputies } else { &[] };
        Division::of(exchanging, contacts, in_order, state.peers)
    })
}

/// The section of the journal before the present one.
struct SectionBefore<'a> {
    /// Where it came from, if it came from others.
    provenance: Option<&'a Provenance>,
    /// Who lacked it.
    receivers: AgentSet,
    /// Its place in the news.
    place: Option<usize>,
}

/// As many journal entries, from the first one that a contact has not been sent, as fit into
/// the budget at this estimate of bits per cell; and where they end.
pub(super) fn news(
    state: &State<'_>,
    contacts: &[Contact],
    mut budget: usize,
    cell_bits: usize,
) -> Option<Found<News>> {
    let State { peers, provenances, .. } = state;
    let mut by_others = ByOthers::default();
    let waiting: Vec<(AgentId, &Peer)> = contacts
        .iter()
        .filter_map(|contact| Some((contact.agent, peers.get(contact.agent.index())?)))
        .filter(|(_, peer)| peer.cursor < peer.until)
        .collect();
    let start = waiting.iter().map(|(_, peer)| peer.cursor).min()?;
    let mut at = start;
    let mut news: Vec<(AgentSet, Vec<Range<usize>>)> = Vec::new();
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
        let crowd = crowd(state, contacts, &exchanging);
        if let Some(crowd) = &crowd {
            by_others.hubs.extend(&crowd.hubs);
            by_others.left_to_hubs.extend(&crowd.left);
        }
        let mut before: Option<SectionBefore> = None;
        // Section by section of the journal; a section is new to the same peers throughout.
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
            let is_alike = |before: &SectionBefore<'_>| {
                before.provenance.map(|it| (it.from, it.until)) == heard.map(|it| (it.from, it.until))
            };
            if !before.as_ref().is_some_and(is_alike) {
                let receivers = share_out(state, heard, &exchanging, crowd.as_ref(), &mut by_others.deputies);
                let place = news.iter().position(|(same, _)| *same == receivers);
                before = Some(SectionBefore { provenance: heard, receivers, place });
            }
            let Some(SectionBefore { receivers, place, .. }) = &mut before else {
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
                None => copies * (map_message::bare_bytes_max(count) + PARCEL_BYTES_BARE),
            };
            let fitting = 8 * budget.saturating_sub(bare) / (copies * cell_bits);
            let taken = (end - at).min(fitting);
            if taken == 0 {
                return found(start, at, news, by_others);
            }
            budget -= bare + (taken * copies * cell_bits).div_ceil(8);
            let place = *place.get_or_insert_with(|| {
                news.push((receivers.clone(), Vec::new()));
                news.len() - 1
            });
            news[place].1.push(at..at + taken);
            at += taken;
        }
    }
    found(start, at, news, by_others)
}

/// What was found between two positions, news in the order in which they are sent.
fn found(
    start: usize,
    end: usize,
    news: Vec<(AgentSet, Vec<Range<usize>>)>,
    by_others: ByOthers,
) -> Option<Found<News>> {
    let news = news.into_iter().map(|(receivers, positions)| (receivers.iter().collect(), positions)).collect();
    (end > start).then_some(Found { news, by_others, end })
}
