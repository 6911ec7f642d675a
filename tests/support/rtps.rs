//! RTPS packets by hand (RTPS 2.5, chapter 9), for tests that attack the DDS library below the ROS
//! client: a participant that is announced but is no more than a socket.

use std::cell::Cell;
use std::fs;
use std::net::{IpAddr, Ipv4Addr, UdpSocket};
use std::time::Duration;

use system::wall_clock::now;

use super::HANG;

/// An entity of a participant (table 9.2).
pub(crate) type EntityId = [u8; 4];
pub(crate) const PUBLICATIONS_WRITER: EntityId = [0, 0, 3, 0xc2];
pub(crate) const PUBLICATIONS_READER: EntityId = [0, 0, 3, 0xc7];
pub(crate) const SUBSCRIPTIONS_WRITER: EntityId = [0, 0, 4, 0xc2];
pub(crate) const SUBSCRIPTIONS_READER: EntityId = [0, 0, 4, 0xc7];
const PARTICIPANT: EntityId = [0, 0, 1, 0xc1];
const PARTICIPANT_WRITER: EntityId = [0, 1, 0, 0xc2];
const PARTICIPANT_READER: EntityId = [0, 1, 0, 0xc7];

/// Kinds of submessages (section 9.4.5).
const ACKNACK: u8 = 0x06;
const HEARTBEAT: u8 = 0x07;
const GAP: u8 = 0x08;
const INFO_DST: u8 = 0x0e;
const DATA: u8 = 0x15;
const DATA_FRAG: u8 = 0x16;

/// Flag of every submessage here: little-endian.
const LITTLE_ENDIAN: u8 = 1;
/// Flag of DATA: a payload that is no key.
const WITH_DATA: u8 = 4;

/// The announcer, detector and reader or writer of participants, publications, subscriptions and
/// participant messages (section 9.3.2, `BuiltinEndpointSet_t`).
const BUILTIN_ENDPOINTS: u32 = 0x0c3f;

/// Wall time between two announcements of a participant that has no reply yet.
const ANNOUNCEMENT_PERIOD: Duration = Duration::from_millis(200);

/// A participant that consists of a socket on 127.0.0.1.
pub(crate) struct FakeParticipant {
    prefix: [u8; 12],
    socket: UdpSocket,
    /// Without an address of its own, for any destination on this machine.
    sender: UdpSocket,
    /// Count of the last heartbeat that asks for a reply: a reader ignores one that is not higher.
    heartbeats: Cell<i32>,
}

/// UDP ports of the unicast discovery traffic of a domain that are open (section 9.6.2.3).
pub(crate) fn discovery_ports(domain: u16) -> Vec<u16> {
    let first = first_port(domain);
    let table = fs::read_to_string("/proc/net/udp").expect("Linux lists the sockets");
    let port = |line: &str| {
        let address = line.split_whitespace().nth(1)?;
        u16::from_str_radix(address.split(':').nth(1)?, 16).ok()
    };
    let mut open: Vec<u16> = table.lines().filter_map(port).collect();
    open.retain(|port| (first..first + 240).contains(port) && (port - first).is_multiple_of(2));
    open.sort_unstable();
    open.dedup();
    open
}

/// The socket for the discovery traffic of the first participant id of a domain, which must be
/// free.
pub(crate) fn first_discovery_socket(domain: u16) -> UdpSocket {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, first_port(domain))).expect("the first id is free");
    socket.set_read_timeout(Some(HANG)).expect("a time-out can be set");
    socket
}

fn first_port(domain: u16) -> u16 {
    7400 + 250 * domain + 10
}

impl FakeParticipant {
    /// `number` distinguishes the participants of a test.
    pub(crate) fn new(number: u32) -> Self {
        let mut prefix = *b"\x01\x0fattacker..";
        prefix[8..].copy_from_slice(&number.to_be_bytes());
        let socket = UdpSocket::bind("127.0.0.1:0").expect("loopback has a free port");
        socket.set_read_timeout(Some(ANNOUNCEMENT_PERIOD)).expect("a time-out can be set");
        let sender = UdpSocket::bind("0.0.0.0:0").expect("there is a free port");
        Self { prefix, socket, sender, heartbeats: Cell::new(1000) }
    }

    /// Announces itself until `of` at this address and port replies.
    #[track_caller]
    pub(crate) fn introduce(&self, to: (IpAddr, u16)) {
        let begin = now();
        while begin.elapsed() < HANG {
            self.announce(to);
            if self.receive().is_some_and(|packet| submessages(&packet).any(|(kind, _)| kind == ACKNACK)) {
                return;
            }
        }
        panic!("no reply from {to:?}");
    }

    /// Announces itself once (SPDP).
    pub(crate) fn announce(&self, to: (IpAddr, u16)) {
        self.send(to, &self.announcement());
    }

    /// Claims to have the samples `first..=last`.
    pub(crate) fn heartbeat(&self, to: (IpAddr, u16), ids: [EntityId; 2], span: [i64; 2], count: i32) {
        self.send(to, &self.heartbeat_packet(ids, span, count));
    }

    /// Claims that the samples `start..end` are irrelevant.
    pub(crate) fn gap(&self, to: (IpAddr, u16), ids: [EntityId; 2], start: i64, end: i64) {
        self.send(to, &self.gap_packet(ids, start, end));
    }

    /// One fragment, with 16 bytes of payload, of a sample that claims `size` bytes.
    pub(crate) fn fragment(&self, to: (IpAddr, u16), ids: [EntityId; 2], number: i64, fragment: u32, size: u32) {
        self.send(to, &self.fragment_packet(ids, number, fragment, size));
    }

    pub(crate) fn announcement(&self) -> Vec<u8> {
        let port = self.socket.local_addr().expect("it is bound").port();
        let mut locator = Vec::from(1_i32.to_le_bytes());
        locator.extend(u32::from(port).to_le_bytes());
        locator.extend([0; 12]);
        locator.extend(Ipv4Addr::LOCALHOST.octets());
        let mut payload = vec![0, 3, 0, 0];
        for (id, value) in [
            (0x0015_u16, &[2, 3, 0, 0][..]),
            (0x0016, &[1, 0x0f, 0, 0]),
            (0x0050, &[&self.prefix[..], &PARTICIPANT].concat()),
            (0x0032, &locator),
            (0x0031, &locator),
            (0x0002, &[100, 0, 0, 0, 0, 0, 0, 0]),
            (0x0058, &BUILTIN_ENDPOINTS.to_le_bytes()),
            (0x0001, &[]),
        ] {
            payload.extend(id.to_le_bytes());
            payload.extend(u16::try_from(value.len()).expect("values are short").to_le_bytes());
            payload.extend(value);
        }
        let mut body = vec![0, 0, 16, 0];
        body.extend(PARTICIPANT_READER);
        body.extend(PARTICIPANT_WRITER);
        body.extend(sequence_number(1));
        body.extend(payload);
        self.packet(DATA, LITTLE_ENDIAN | WITH_DATA, &body)
    }

    pub(crate) fn heartbeat_packet(&self, ids: [EntityId; 2], span: [i64; 2], count: i32) -> Vec<u8> {
        let mut body = ids.concat();
        body.extend(sequence_number(span[0]));
        body.extend(sequence_number(span[1]));
        body.extend(count.to_le_bytes());
        self.packet(HEARTBEAT, LITTLE_ENDIAN, &body)
    }

    pub(crate) fn gap_packet(&self, ids: [EntityId; 2], start: i64, end: i64) -> Vec<u8> {
        let mut body = ids.concat();
        body.extend(sequence_number(start));
        body.extend(sequence_number(end));
        body.extend(0_u32.to_le_bytes());
        self.packet(GAP, LITTLE_ENDIAN, &body)
    }

    pub(crate) fn fragment_packet(&self, ids: [EntityId; 2], number: i64, fragment: u32, size: u32) -> Vec<u8> {
        let mut body = vec![0, 0, 28, 0];
        body.extend(ids.concat());
        body.extend(sequence_number(number));
        body.extend(fragment.to_le_bytes());
        body.extend(1_u16.to_le_bytes());
        body.extend(16_u16.to_le_bytes());
        body.extend(size.to_le_bytes());
        body.extend([7; 16]);
        self.packet(DATA_FRAG, LITTLE_ENDIAN, &body)
    }

    /// Asks for the first 32 samples of a writer.
    pub(crate) fn request_packet(&self, ids: [EntityId; 2], count: i32) -> Vec<u8> {
        let mut body = ids.concat();
        body.extend(sequence_number(1));
        body.extend(32_u32.to_le_bytes());
        body.extend(u32::MAX.to_le_bytes());
        body.extend(count.to_le_bytes());
        self.packet(ACKNACK, LITTLE_ENDIAN, &body)
    }

    /// Introduces itself, asks for the announcements of all endpoints, and returns the packets that
    /// come up to the first of each kind: what a real participant of this library sends.
    #[track_caller]
    pub(crate) fn packets_of(&self, to: (IpAddr, u16)) -> Vec<Vec<u8>> {
        self.introduce(to);
        let mut packets = Vec::new();
        for (count, writer, reader) in
            [(1, PUBLICATIONS_WRITER, PUBLICATIONS_READER), (2, SUBSCRIPTIONS_WRITER, SUBSCRIPTIONS_READER)]
        {
            let begin = now();
            let announces = |packet: &[u8]| {
                submessages(packet).any(|(kind, body)| kind == DATA && body.get(8..12) == Some(&writer[..]))
            };
            while !packets.iter().any(|packet: &Vec<u8>| announces(packet)) {
                assert!(begin.elapsed() < HANG, "{to:?} does not announce its endpoints");
                self.send(to, &self.request_packet([reader, writer], count));
                packets.extend(std::iter::from_fn(|| self.receive()).take(64));
            }
        }
        packets
    }

    /// Waits until the reader has processed what was sent before: it acknowledges `before`, which
    /// must be higher than anything claimed so far.
    #[track_caller]
    pub(crate) fn is_acknowledged(&self, to: (IpAddr, u16), ids: [EntityId; 2], before: i64) {
        let begin = now();
        while begin.elapsed() < HANG {
            self.heartbeats.set(self.heartbeats.get() + 1);
            self.heartbeat(to, ids, [before, before - 1], self.heartbeats.get());
            let acknowledges = |(kind, body): (u8, &[u8])| {
                kind == ACKNACK && body.get(4..16) == Some(&[&ids[1][..], &sequence_number(before)].concat()[..])
            };
            // Whatever has come since the last look.
            while let Some(packet) = self.receive() {
                if submessages(&packet).any(acknowledges) {
                    return;
                }
            }
        }
        panic!("{to:?} does not process what it receives any more");
    }

    /// Whether a packet has come for this participant.
    pub(crate) fn has_received(&self) -> bool {
        self.socket.set_nonblocking(true).expect("a socket can be set so");
        let received = self.receive().is_some();
        self.socket.set_nonblocking(false).expect("a socket can be set so");
        received
    }

    fn receive(&self) -> Option<Vec<u8>> {
        let mut packet = vec![0; 65_536];
        let length = self.socket.recv(&mut packet).ok()?;
        packet.truncate(length);
        Some(packet)
    }

    /// The header of every packet of this participant.
    pub(crate) fn header(&self) -> Vec<u8> {
        [&b"RTPS\x02\x03\x01\x0f"[..], &self.prefix].concat()
    }

    fn packet(&self, kind: u8, flags: u8, body: &[u8]) -> Vec<u8> {
        let mut packet = self.header();
        packet.extend([kind, flags]);
        packet.extend(u16::try_from(body.len()).expect("packets are short").to_le_bytes());
        packet.extend(body);
        packet
    }

    pub(crate) fn send(&self, to: (IpAddr, u16), packet: &[u8]) {
        self.sender.send_to(packet, to).expect("the machine reaches itself");
    }
}

fn sequence_number(number: i64) -> Vec<u8> {
    let high = i32::try_from(number >> 32).expect("a shifted number is short");
    let low = u32::try_from(number & 0xffff_ffff).expect("a masked number is short");
    [high.to_le_bytes(), low.to_le_bytes()].concat()
}

/// Kind and body of each little-endian submessage of a packet.
fn submessages(packet: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let mut rest = packet.get(20..).unwrap_or_default();
    std::iter::from_fn(move || {
        let (header, after) = rest.split_at_checked(4)?;
        let length = usize::from(u16::from_le_bytes([header[2], header[3]]));
        let (body, after) = after.split_at_checked(if length == 0 { after.len() } else { length })?;
        rest = after;
        Some((header[0], body))
    })
    .filter(|(kind, _)| *kind != INFO_DST)
}
