//! RTPS packets with random changes at a server and an agent: they take no memory, stop nothing,
//! and leave the run as it is.
//!
//! The packets that are changed are those that the processes send themselves, and those of
//! `network_attacks`. The test sends a few thousand; `launch_scripts/fuzz.sh SECONDS rtps`
//! continues until the attacked processes have spent so many seconds of processor time.

use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::network_attacks::{LOOPBACK, Waiting, has_fixes};
use crate::support::rtps::{
    FakeParticipant, PUBLICATIONS_READER, PUBLICATIONS_WRITER, SUBSCRIPTIONS_READER, SUBSCRIPTIONS_WRITER,
};

/// Environment variable: processor time that the attacked processes spend at least, s.
const PROCESSOR_TIME_S: &str = "MAES_FUZZ_RTPS_S";

/// Environment variable: seed of the changes.
const SEED: &str = "MAES_FUZZ_RTPS_SEED";

/// Packets between two checks that a process has processed them. They fit the buffer of a socket.
const BATCH: usize = 50;

/// Packets that each process gets at least.
const PACKETS_MIN: usize = 3_000;

/// Length of the header of a packet: protocol, version, vendor, prefix.
const HEADER: usize = 20;

/// Number of the first participant that checks. It has no byte in common with those of the
/// strangers, which no few changes turn into it.
const WITNESS: u32 = 0xa5c3_965a;

/// What is known to break parsers of lengths and counts.
const NUMBERS: [u32; 9] = [0, 1, 0x7f, 0xff, 0x7fff, 0xffff, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff];

fn setting(name: &str) -> u64 {
    std::env::var(name).map_or(0, |value| value.parse().unwrap_or_else(|_| panic!("{name}={value}: no number")))
}

/// Packets of all kinds, in the name of a stranger.
fn corpus(stranger: &FakeParticipant, port: u16) -> Vec<Vec<u8>> {
    let mut packets = stranger.packets_of((LOOPBACK, port));
    for packet in &mut packets {
        // A stranger cannot be stopped from sending in the name of another process, but then it is
        // the process that is forged, and not the reader of packets that is attacked.
        packet.splice(..HEADER.min(packet.len()), stranger.header());
    }
    for ids in [[PUBLICATIONS_READER, PUBLICATIONS_WRITER], [SUBSCRIPTIONS_READER, SUBSCRIPTIONS_WRITER]] {
        packets.push(stranger.heartbeat_packet(ids, [1, 40], 1));
        packets.push(stranger.gap_packet(ids, 3, 30));
        packets.push(stranger.fragment_packet(ids, 2, 1, 1_600));
        packets.push(stranger.request_packet([ids[0], ids[1]], 3));
    }
    packets.push(stranger.announcement());
    packets
}

/// A packet of the corpus with one to four changes.
fn mutated(corpus: &[Vec<u8>], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut packet = corpus.choose(rng).expect("there are packets").clone();
    for _ in 0..rng.random_range(1..=4) {
        change(&mut packet, corpus, rng);
    }
    // As much as one datagram holds.
    packet.truncate(65_000);
    packet
}

fn change(packet: &mut Vec<u8>, corpus: &[Vec<u8>], rng: &mut ChaCha8Rng) {
    // A wrong header ends the reading, so most changes are behind it.
    let first = if rng.random_bool(0.95) { HEADER } else { 0 };
    if packet.len() <= first + 4 {
        packet.extend(&corpus.choose(rng).expect("there are packets")[HEADER..]);
        return;
    }
    let place = rng.random_range(first..packet.len() - 3);
    let number = *NUMBERS.choose(rng).expect("there are numbers");
    match rng.random_range(0..8) {
        0 => packet[place] ^= 1 << rng.random_range(0..8),
        1 => packet[place] = rng.random(),
        2 => packet[place..place + 2].copy_from_slice(&number.to_le_bytes()[..2]),
        3 => packet[place..place + 4].copy_from_slice(&number.to_le_bytes()),
        4 => packet.truncate(place),
        5 => {
            let end = rng.random_range(place..packet.len());
            let part = packet[place..end].to_vec();
            packet.splice(place..place, part);
        }
        6 => drop(packet.drain(place..place + rng.random_range(1..=3))),
        // The submessages of another packet.
        _ => packet.extend(&corpus.choose(rng).expect("there are packets")[HEADER..]),
    }
}

#[test]
fn mutated_packets_take_no_memory_and_change_nothing() {
    if !has_fixes() {
        return;
    }
    let (enough_s, seed) = (setting(PROCESSOR_TIME_S) as f64, setting(SEED));
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut waiting = Waiting::start();
    let ids = [PUBLICATIONS_READER, PUBLICATIONS_WRITER];
    let attacked: Vec<_> = (0..)
        .zip(waiting.ports())
        .map(|(number, port)| {
            let (stranger, witness) = (FakeParticipant::new(number), FakeParticipant::new(WITNESS + number));
            let corpus = corpus(&stranger, port);
            witness.introduce((LOOPBACK, port));
            (port, stranger, witness, corpus)
        })
        .collect();
    let mut sent = 0;
    let mut acknowledged = 0;
    while sent < PACKETS_MIN || waiting.processor_time_s() < enough_s {
        acknowledged += 1;
        for (port, stranger, witness, corpus) in &attacked {
            for _ in 0..BATCH {
                // The port of the discovery, or that of the topics.
                let port = port + u16::from(rng.random_bool(0.25));
                stranger.send((LOOPBACK, port), &mutated(corpus, &mut rng));
            }
            witness.announce((LOOPBACK, *port));
            witness.is_acknowledged((LOOPBACK, *port), ids, acknowledged);
        }
        sent += BATCH;
    }
    waiting.assert_small();
    eprintln!(
        "{sent} packets at each of {} processes, {:.1} s of processor time, seed {seed}",
        attacked.len(),
        waiting.processor_time_s()
    );
    waiting.assert_undisturbed();
}
