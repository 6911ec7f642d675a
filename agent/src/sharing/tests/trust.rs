//! Messages of senders that are faulty or malicious.

use protocol::message_type::MessageType;
use voxels::{Cell, Extent};

use super::super::*;
use super::team::extent;
use crate::command::Peer;
use crate::exploration_map::{CellState, Change, Delta, Finding};

#[test]
fn malformed_messages_are_rejected_and_other_kinds_ignored() {
    let mut map = ExplorationMap::new(extent(4));
    let mut sharing = Sharing::new(AgentId(0), 5, 3);
    let message = |kind, data: &[u8]| AgentMessage { peer: Peer::One(AgentId(2)), kind, data: data.into() };
    let received = [
        message(MessageType::Map.number(), &[9]),
        message(0, &[1, 2, 3]),
        message(MessageType::Map.number(), &[VERSION, 1, 1, 0, 1, 1, 0b100_1000, 0]),
        message(MessageType::Map.number(), &[VERSION, 1, 1, 0, 1, 1, 1, 0]),
    ];
    let report = sharing.incoming(&mut map, &received);
    let refused = [(AgentId(2), MapMessageError::Version(9)), (AgentId(2), MapMessageError::Outside { block: 1 })];
    assert_eq!(report, Report { messages: 1, for_others: 0, deltas: 1, refused: refused.to_vec() });
    let totals = *sharing.totals();
    assert_eq!((totals.messages_refused, totals.messages_taken), (2, 1));
    // Every byte of map messages is counted as merged or rejected; messages of other kinds are not
    // counted.
    let bytes: usize = received
        .iter()
        .filter(|message| message.kind == MessageType::Map.number())
        .map(|message| message.data.len())
        .sum();
    assert_eq!(totals.bytes_refused + totals.bytes_taken, bytes as u64);
    assert_eq!((map.free(), map.state(Cell::new(3, 0, 0))), (1, CellState::Free));
}

/// The most that one false message can report: the whole map is free, or all of it wall.
fn whole_map(extent: Extent, finding: Finding) -> AgentMessage {
    let all = (0..extent.volume() as u32).map(|cell| Change { cell, finding, from: None });
    AgentMessage {
        peer: Peer::One(AgentId(2)),
        kind: MessageType::Map.number(),
        data: map_message::encode_update(&[AgentId(0), AgentId(3)], 1, &Delta::of(extent, all)).into(),
    }
}

#[test]
fn message_for_others_is_ignored() {
    let extent = extent(4);
    let mut map = ExplorationMap::new(extent);
    let mut sharing = Sharing::new(AgentId(1), 5, 4);
    let report = sharing.incoming(&mut map, &[whole_map(extent, Finding::Free)]);
    assert_eq!(report, Report { for_others: 1, ..Report::default() });
    assert_eq!((map.free(), *sharing.totals()), (0, Totals::default()));
}

#[test]
fn flooding_sender_is_barred() {
    let extent = extent(12);
    let volume = extent.volume() as u64;
    let mut map = ExplorationMap::new(extent);
    let mut sharing = Sharing::new(AgentId(0), 5, 4);
    let lies = [whole_map(extent, Finding::Wall), whole_map(extent, Finding::Free)];
    let mut taken = Vec::new();
    for _ in 0..50 {
        let flood: Vec<AgentMessage> = lies.iter().cycle().take(64).cloned().collect();
        taken.push(sharing.incoming(&mut map, &flood).messages);
    }
    assert_eq!((taken[0], taken.iter().sum()), (CHANGES_MAX, CHANGES_MAX));
    let totals = *sharing.totals();
    assert_eq!((totals.cells_taken, totals.messages_refused), (CHANGES_MAX as u64 * volume, 50 * 64 - 4));
    assert!(map.journal_len() as u64 <= CHANGES_MAX as u64 * volume);
    // Malformed messages get the same answer, since messages of barred senders are not decoded.
    let refused = |sharing: &mut Sharing, map: &mut ExplorationMap, from: u32, data: &[u8]| {
        let message =
            AgentMessage { peer: Peer::One(AgentId(from)), kind: MessageType::Map.number(), data: data.into() };
        sharing.incoming(map, &[message]).refused
    };
    let barred = MapMessageError::Barred { allowance: 4 * volume };
    assert_eq!(refused(&mut sharing, &mut map, 2, &[9]), [(AgentId(2), barred)]);
    // Other senders are not affected, and the own sensor still overrides.
    assert_eq!(refused(&mut sharing, &mut map, 1, &lies[0].data), []);
    map.note_wall(&[5]);
    assert_eq!(map.state(Cell::new(5, 0, 0)), CellState::Wall);
}

#[test]
fn summaries_that_know_more_than_there_is_are_rejected() {
    let mut map = ExplorationMap::new(extent(4));
    map.note_free(&[1, 2]);
    let mut sharing = Sharing::new(AgentId(0), 5, 3);
    let summary = |known: &[u32]| {
        let data = map_message::encode_summary((0, SenderState::default()), &[AgentId(0)], known, AgentId(1), 100);
        AgentMessage { peer: Peer::One(AgentId(1)), kind: MessageType::Map.number(), data: data.into() }
    };
    let report = sharing.incoming(&mut map, &[summary(&[3, 7])]);
    assert_eq!(report.refused, [(AgentId(1), MapMessageError::Ahead { position: 3, entries: 2 })]);
    assert_eq!(sharing.incoming(&mut map, &[summary(&[2, 7])]).refused, []);
}
