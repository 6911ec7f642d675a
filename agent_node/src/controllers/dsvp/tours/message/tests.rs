use proptest::prelude::*;

use super::*;

const AGENTS: u32 = 12;

fn extent() -> Extent {
    Extent::new([100; 3], 1.0).unwrap()
}

fn decode(bytes: &[u8]) -> Option<Message> {
    Message::decode(bytes, extent(), &TaskGrid::new(extent()), AGENTS)
}

fn record(tasks: u32) -> Record {
    let tasks = (0..tasks).map(|number| TaskId { block: 3 * number, octants: 1 + number as u8 }).collect();
    Record { stamp: Tick(4711), ends: Tick(4711 + 30 * TICKS_PER_S), at: Cell::new(5, 6, 7), tasks }
}

#[test]
fn messages_decode_to_themselves() {
    let few = vec![(AgentId(3), record(2)), (AgentId(11), record(0))];
    for message in [
        Message::Records(few),
        Message::Proposal { replaces: Tick(9), sender: record(3), receiver: record(TASKS_MAX as u32) },
        Message::Answer { proposal: Tick(4711), is_accepted: true },
        Message::Answer { proposal: Tick(4712), is_accepted: false },
    ] {
        assert_eq!(decode(&message.encode(extent())), Some(message));
    }
}

#[test]
fn record_fits_into_its_bytes() {
    let full = |agents: u32| Message::Records((0..agents).map(|agent| (AgentId(agent), record(25))).collect());
    assert_eq!(full(10).encode(extent()).len() - full(9).encode(extent()).len(), 89);
    const { assert!(BARE_BYTES + TASKS_MAX * TASK_BYTES <= RECORD_BYTES_MAX) };
}

#[test]
fn malformed_messages_are_ignored() {
    let good = Message::Records(vec![(AgentId(3), record(1))]).encode(extent());
    assert!(decode(&good).is_some());
    for cut in 0..good.len() {
        assert!(cut == 2 || decode(&good[..cut]).is_none(), "{cut} bytes");
    }
    let changed = |at: usize, byte: u8| {
        let mut bytes = good.clone();
        bytes[at] = byte;
        decode(&bytes)
    };
    assert_eq!(changed(0, 9), None, "another version");
    assert_eq!(changed(1, 9), None, "no such message");
    assert_eq!(changed(2, AGENTS as u8), None, "no such agent");
    assert_eq!(changed(13, 255), None, "no such cell");
    assert_eq!(changed(14, TASKS_MAX as u8 + 1), None, "too many tasks");
    assert_eq!(changed(17, 255), None, "no such block");
    assert_eq!(changed(18, 0), None, "a task without octants");
    let many = Message::Records((0..=AGENTS).map(|_| (AgentId(0), record(0))).collect()).encode(extent());
    assert_eq!(decode(&many), None, "more records than agents");
}

proptest! {
    #[test]
    fn any_bytes_decode_to_nothing_or_to_something_legal(bytes in proptest::collection::vec(any::<u8>(), 0..120)) {
        for kind in 0..3 {
            let bytes = [&[VERSION, kind], &bytes[..]].concat();
            if let Some(Message::Records(records)) = decode(&bytes) {
                for (agent, record) in records {
                    prop_assert!(agent.0 < AGENTS && extent().contains(record.at) && record.tasks.len() <= TASKS_MAX);
                }
            }
        }
    }
}
