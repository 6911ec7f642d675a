use proptest::prelude::*;

use super::*;
use crate::exploration_map::{Block, Change, Finding};
use crate::sharing::agent_set::AgentSet;

fn extent(size: [u32; 3]) -> Extent {
    Extent::new(size, 1.0).unwrap()
}

fn block(index: u32, known: u64, wall: u64, covered: u64) -> Block {
    Block { index, known, wall, covered }
}

#[test]
fn byte_for_byte_as_documented() {
    let blocks = vec![
        // Cells 3 and 5, one of them a wall.
        block(1, 0b10_1000, 0b10_0000, 0),
        // Octants: all free; all wall; five cells, of which one is wall; and none.
        block(2, 0x1f_ffff, 0x04_ff00, 0),
        // One covered cell, one that is not.
        block(5, 0b11, 0, 0b10),
    ];
    let delta = Delta { blocks };
    let receivers = [1, 4, 5, 6, 8].map(AgentId);
    let bytes = encode_update(&receivers, 300, &delta);
    let strings = [
        "100 0 100 110000 101000 0 1",
        "0 10 110 1110 10 11111000 11 00100 0 0 0 0 0",
        "101 110 100 000000 100000 0 0 0 1",
    ];
    let written = strings.concat().replace(' ', "");
    let mut expected = vec![4, 1, 5, 1, 0, 1, 2, 0, 0xac, 2, 3];
    for byte in written.as_bytes().chunks(8) {
        expected.push(byte.iter().rev().fold(0, |bits, digit| bits << 1 | (digit - b'0')));
    }
    assert_eq!(bytes, expected);
    // The viewer reads the same file.
    let documented = include_str!("update.hex").split_whitespace().map(|byte| u8::from_str_radix(byte, 16));
    assert_eq!(documented.collect::<Result<Vec<u8>, _>>(), Ok(expected));
    let map = extent([8, 8, 8]);
    assert_eq!(decode(&bytes, map, 9), Ok(Message::Update { receivers: receivers.to_vec(), until: 300, delta }));
    assert_eq!(decode(&bytes, extent([8, 8, 4]), 9), Err(MapMessageError::Outside { block: 5 }));
    assert_eq!(decode(&bytes, extent([8, 5, 8]), 9), Err(MapMessageError::Outside { block: 2 }));
    assert_eq!(decode(&bytes, map, 8), Err(MapMessageError::Agent { agent: 8, agents: 8 }));
}

#[test]
fn summaries_and_completions_are_read_as_written() {
    let state = SenderState { has_contradictions: false, only_receives: true };
    let (receivers, known) = ([AgentId(1)], [0, 0, 7, 300]);
    let encode = |bytes_max| encode_summary((6, state), &receivers, &known, AgentId(3), bytes_max);
    assert_eq!(encode(12), [4, 0, 2, 6, 1, 1, 2, 2, 7, 0, 0xac, 2]);
    let decode = |bytes: &[u8]| decode(bytes, extent([8; 3]), 4);
    let known = vec![(AgentId(2), 7), (AgentId(3), 300)];
    assert_eq!(decode(&encode(12)), Ok(Message::Summary { number: 6, state, receivers: receivers.to_vec(), known }));
    let own = Message::Summary { number: 6, state, receivers: vec![], known: vec![(AgentId(3), 300)] };
    assert_eq!(decode(&encode(11)), Ok(own));
    let completed = |receiver, updates| Acknowledged { receiver: AgentId(receiver), summary: 3, updates };
    let [some, none] = [AgentSet::of([AgentId(0)]), AgentSet::default()];
    let acknowledgement = |is_for_relay_peers| {
        Acknowledgement::new(&[(completed(1, 2), &some), (completed(3, 0), &none)], (9, is_for_relay_peers), |_| 5)
    };
    let for_hubs = encode_acknowledgement(&acknowledgement(true));
    assert_eq!(for_hubs[..2], [4, 3]);
    assert_eq!(decode(&for_hubs), Ok(Message::Acknowledgement(acknowledgement(true))));
    let acknowledgement = acknowledgement(false);
    let bytes = encode_acknowledgement(&acknowledgement);
    assert_eq!(bytes, [4, 2, 2, 1, 0, 0, 1, 0, 5, 3, 2, 1, 3, 0, 0, 9]);
    assert_eq!([1, 2, 3].map(|agent| acknowledgement.place_of(AgentId(agent))), [Some(0), None, Some(1)]);
    assert_eq!(
        [0, 1].map(|place| acknowledgement.rest_from(place).collect::<Vec<_>>()),
        [vec![(AgentId(0), 5)], vec![]]
    );
    assert_eq!(decode(&bytes), Ok(Message::Acknowledgement(acknowledgement)));
    assert_eq!(decode(&[4, 2, 2, 1, 0, 0, 1, 0, 5, 3, 2, 2, 3, 0, 0, 9]), Err(MapMessageError::Filling));
}

#[test]
fn malformed_bytes_are_refused_with_the_reason() {
    let refused = |bytes: &[u8]| decode(bytes, extent([8, 8, 8]), 2).unwrap_err().to_string();
    assert_eq!(refused(&[]), "truncated after 0 bytes");
    assert_eq!(refused(&[1, 0]), "version 1, expected 4");
    assert_eq!(refused(&[4, 4]), "form 4, allowed are 0 to 3");
    assert_eq!(refused(&[4, 0, 4, 0]), "flags 4, allowed are 0 to 3");
    assert_eq!(refused(&[4, 1, 0, 0, 1]), "truncated after 5 bytes");
    assert_eq!(refused(&[4, 1, 0, 0, 1, 0]), "truncated after 6 bytes");
    assert_eq!(refused(&[4, 1, 0, 0, 0, 7]), "1 bytes after its end");
    assert_eq!(refused(&[4, 0, 0, 0, 0, 0, 7]), "1 bytes after its end");
    assert_eq!(refused(&[4, 2, 1, 0, 0]), "truncated after 5 bytes");
    assert_eq!(refused(&[4, 1, 2, 0, 2, 0, 0]), "agent 2 is not part of the run, allowed are 0 to 1");
    assert_eq!(refused(&[4, 1, 1, 2, 0, 0]), "agent 2 is not part of the run, allowed are 0 to 1");
    assert_eq!(refused(&[4, 0, 0, 0, 0, 2, 1, 5, 0, 5]), "agent 2 is not part of the run, allowed are 0 to 1");
    assert_eq!(refused(&[4, 2, 2, 0, 2, 0, 1, 1, 0]), "agent 2 is not part of the run, allowed are 0 to 1");
    assert_eq!(refused(&[4, 0, 0, 0, 0, 1, 0, 0x81, 16]), "position 2049, but no journal has more than 2048 entries");
    let long = "the number at byte 2 is larger than 4294967295 or longer than 5 bytes";
    assert_eq!(refused(&[4, 1, 0xff, 0xff, 0xff, 0xff, 0x1f]), long);
    assert_eq!(refused(&[4, 1, 0x80, 0x80, 0x80, 0x80, 0x80]), long);
    let bits = |digits: &str| {
        let digits: Vec<u8> = digits.bytes().filter(|&digit| digit != b' ').collect();
        let byte = |digits: &[u8]| digits.iter().rev().fold(0, |bits, digit| bits << 1 | (digit - b'0'));
        [[4, 1, 0, 0, 1].as_slice(), &digits.chunks(8).map(byte).collect::<Vec<u8>>()].concat()
    };
    assert!(decode(&bits("0 0 0 010000 1 000000"), extent([8; 3]), 2).is_ok());
    assert_eq!(refused(&bits("0 0 0 010000 1 000010")), "a bit is set after its end");
    assert_eq!(refused(&bits("1110100 0 0 010000 1 000000")), "block 8 has cells outside the map");
    let endless = "block 4294967295 has cells outside the map";
    assert_eq!(refused(&bits(&"1".repeat(96))), endless);
    let wrong = "block 0 is empty or not encoded canonically";
    for digits in [
        "0 0 100 010000 010000 1 1",
        "0 0 100 010000 100000 1 1",
        "0 10 00000000",
        "0 10 10 00000000 0 0000000",
        "0 10 10 11111111 0 0000000",
        "0 10 10 11000000 11 11 0000000",
        "0 10 11 11 00000000 0000000",
        "0 110 0 010000 0 0",
        "0 110 0 010000 1",
    ] {
        assert_eq!(refused(&bits(&format!("{digits} {}", "0".repeat(64)))), wrong, "{digits}");
    }
}

fn findings(volume: u32) -> impl Strategy<Value = Vec<(u32, Finding)>> {
    let finding = prop::sample::select(vec![Finding::Free, Finding::Wall, Finding::Covered]);
    let scattered = prop::collection::vec((0..volume, finding), 0..60);
    let mixed = prop::sample::select(vec![Finding::Free, Finding::Wall]);
    let dense = (0..volume, prop::collection::vec(mixed, 0..300))
        .prop_map(move |(start, findings)| (start..volume).zip(findings).collect::<Vec<_>>());
    (scattered, dense).prop_map(|(scattered, dense)| [scattered, dense].concat())
}

proptest! {
    #[test]
    fn encoding_round_trips_within_its_size_bound(
        receivers in prop::collection::btree_set(0u32..9, 0..9),
        findings in findings(50_000),
        size in prop::sample::select(vec![[1024, 1024, 1024], [7, 90, 80], [50_000 / 50, 50, 1]]),
    ) {
        let receivers: Vec<AgentId> = receivers.into_iter().map(AgentId).collect();
        let count = findings.len();
        let changes = findings.into_iter().map(|(cell, finding)| Change { cell, finding, from: None });
        let delta = Delta::of(extent(size), changes);
        let bytes = encode_update(&receivers, 5000, &delta);
        prop_assert!(bytes.len() <= bare_bytes_max(receivers.len()) + CELL_BYTES_MAX * count);
        prop_assert_eq!(decode(&bytes, extent(size), 9), Ok(Message::Update { receivers, until: 5000, delta }));
    }

    #[test]
    fn one_cell_stays_within_the_size_bound(cell in 0u32..1 << 30) {
        let changes = [Change { cell, finding: Finding::Covered, from: None }];
        let bytes = encode_update(&[], 0, &Delta::of(extent([1024; 3]), changes));
        prop_assert!(bytes.len() <= 5 + CELL_BYTES_MAX);
    }

    #[test]
    fn decoded_cells_lie_inside_the_map(
        mut bytes in prop::collection::vec(any::<u8>(), 6..40),
        blocks in 0u8..3,
    ) {
        bytes[..5].copy_from_slice(&[VERSION, UPDATE, 0, 0, blocks]);
        let extent = extent([18, 10, 5]);
        for end in 5..=bytes.len() {
            let Ok(Message::Update { delta, .. }) = decode(&bytes[..end], extent, 4) else { continue };
            prop_assert_eq!(delta.findings(extent).count(), delta.len());
            prop_assert!(delta.blocks.is_sorted_by(|a, b| a.index < b.index));
            let again = decode(&encode_update(&[], 0, &delta), extent, 4);
            prop_assert_eq!(again, Ok(Message::Update { receivers: vec![], until: 0, delta }));
        }
    }
}
