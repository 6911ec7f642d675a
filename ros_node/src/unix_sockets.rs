//! Unix sockets between the server and the agents of its machine, for the messages that a tick
//! waits for.
//!
//! They carry the same messages as the topics of joins, their replies, observations and commands,
//! in the same encoding, signed in the same way. A process of agents connects to the server when it
//! has heard of it over ROS 2, and says first who it is and which agents it has: a *greeting*. From
//! then on each side sends over the socket what the other one reads on a topic, and over the topic
//! only if others subscribe to it. A connection that ends leaves both with the topics.
//!
//! Invariants: both processes are of the same user; sending never blocks for long (see
//! [`connection`]); what a peer sends for an agent that is not in its greeting ends its connection.
//! Nothing here decides who may join, or whether a message is authentic.

mod address;
mod connection;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixListener;
use std::rc::Rc;

use msgs::cdr;
use msgs::ids::AgentId;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::ThrottledWarning;
use crate::inbox::Sample;
use connection::{Address, Connection, Frame, READ_BYTES};

/// The address of a greeting.
const GREETING: Address = Address { kind: 0, agent: u32::MAX };

/// What a message is; the topics are those of [`msgs::topics`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MessageKind {
    Join = 1,
    JoinReply,
    Observation,
    Command,
}

impl MessageKind {
    const ALL: [Self; 4] = [Self::Join, Self::JoinReply, Self::Observation, Self::Command];

    fn of(kind: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|known| *known as u32 == kind)
    }
}

/// The version of frames and greeting.
const VERSION: u32 = 1;

/// Most connections to a server.
const PEERS_MAX: usize = 1024;

/// Who a process is, and which agents it has.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Greeting {
    version: u32,
    /// As in [`Sample::source`](crate::Sample::source).
    source: [u8; 16],
    agents: Vec<u32>,
}

/// The participants that are connected by a socket. What they send on topics is for others.
#[derive(Debug, Clone, Default)]
pub struct Connected(Rc<RefCell<BTreeSet<[u8; 16]>>>);

impl Connected {
    /// Whether this participant is connected.
    #[must_use]
    pub fn contains(&self, source: &[u8; 16]) -> bool {
        self.0.borrow().contains(source)
    }
}

/// A message of an agent, or to it.
pub struct SocketSample<'a> {
    pub kind: MessageKind,
    /// The agent.
    pub agent: AgentId,
    /// The participant that sent it.
    pub source: [u8; 16],
    /// The message, with the CDR header.
    pub bytes: &'a [u8],
}

impl SocketSample<'_> {
    /// The message as a sample of its topic.
    #[must_use]
    pub fn decode<M: DeserializeOwned>(&self) -> Sample<M> {
        Sample { message: cdr::decode(self.bytes).map_err(|error| error.to_string()), source: self.source }
    }
}

/// The sockets of a process: those of a server to processes of agents, or that of such a process to
/// its server.
pub struct Sockets {
    /// Of a server.
    listener: Option<UnixListener>,
    /// By order of arrival.
    peers: BTreeMap<u64, Peer>,
    arrivals: u64,
    peers_of: BTreeMap<AgentId, Vec<u64>>,
    connected: Connected,
    /// Peers that may have sent more than was taken so far.
    arrived: VecDeque<u64>,
    /// The peer to which something may be queued; no other has anything that it would take.
    sending: Option<u64>,
    space: Box<[u8]>,
    refused: ThrottledWarning,
}

struct Peer {
    connection: Connection,
    /// Unless it has not greeted yet.
    source: Option<[u8; 16]>,
    agents: BTreeSet<AgentId>,
}

impl Sockets {
    /// The socket of a server, to which agents connect.
    ///
    /// # Errors
    /// If the system does not allow it.
    pub fn listen(own_source: [u8; 16], connected: &Connected) -> io::Result<Self> {
        Ok(Self::new(Some(address::listen(own_source)?), connected))
    }

    /// The socket of a process of agents, connected to its server.
    ///
    /// # Errors
    /// If the server has no socket on this machine, or is of another user.
    pub fn connect(
        server: [u8; 16],
        own_source: [u8; 16],
        agents: impl IntoIterator<Item = AgentId>,
        connected: &Connected,
    ) -> io::Result<Self> {
        let mut sockets = Self::new(None, connected);
        let agents: BTreeSet<AgentId> = agents.into_iter().collect();
        let ids = agents.iter().map(|agent| agent.0).collect();
        let mut connection = Connection::new(address::connect(server)?)?;
        connection.queue(GREETING, &Greeting { version: VERSION, source: own_source, agents: ids });
        connection.flush();
        let number = sockets.add(connection);
        sockets.admit(number, server, agents);
        Ok(sockets)
    }

    fn new(listener: Option<UnixListener>, connected: &Connected) -> Self {
        Self {
            listener,
            peers: BTreeMap::new(),
            arrivals: 0,
            peers_of: BTreeMap::new(),
            connected: connected.clone(),
            arrived: VecDeque::new(),
            sending: None,
            space: vec![0; READ_BYTES].into(),
            refused: ThrottledWarning::new("a connection to the Unix socket was ended".to_owned()),
        }
    }

    /// Sends a message of an agent to its server, or to the process that has the agent; returns
    /// whether there is one. Messages to one process are written together, at the latest before the
    /// next wait. What a process does not read is dropped.
    pub fn send<M: Serialize>(&mut self, kind: MessageKind, agent: AgentId, message: &M) -> bool {
        let address = Address { kind: kind as u32, agent: agent.0 };
        let Self { peers, peers_of, sending, .. } = self;
        let numbers = peers_of.get(&agent).map_or(&[][..], Vec::as_slice);
        for number in numbers {
            if *sending != Some(*number) {
                flush(peers, sending);
                *sending = Some(*number);
            }
            if let Some(peer) = peers.get_mut(number) {
                peer.connection.queue(address, message);
            }
        }
        !numbers.is_empty()
    }

    /// The next message that has arrived, converted; `None` if there is none without
    /// [waiting](Self::wait).
    pub(crate) fn next<T>(&mut self, convert: impl Fn(SocketSample<'_>) -> T) -> Option<T> {
        while let Some(number) = self.arrived.pop_front() {
            let Some(peer) = self.peers.get_mut(&number) else { continue };
            let Some(frame) = peer.connection.next() else {
                if peer.connection.is_broken() {
                    self.refuse(number, "what it has sent is no frame");
                } else if !peer.connection.is_open() {
                    self.remove(number);
                }
                continue;
            };
            let taken = match peer.take(frame, &convert) {
                Ok(Taken::Message(message)) => Some(message),
                Ok(Taken::Greeting(Greeting { source, agents, .. })) => {
                    self.admit(number, source, agents.into_iter().map(AgentId).collect());
                    None
                }
                Err(reason) => {
                    self.refuse(number, &reason);
                    continue;
                }
            };
            self.arrived.push_back(number);
            if taken.is_some() {
                return taken;
            }
        }
        None
    }

    /// Writes all that is queued, and waits until something has arrived, `other` can be read, or
    /// the time is over; returns whether `other` can be read.
    pub(crate) fn wait(&mut self, other: BorrowedFd<'_>, timeout: PollTimeout) -> bool {
        flush(&mut self.peers, &mut self.sending);
        let events = |peer: &Peer| match peer.connection.has_queued() {
            true => PollFlags::POLLIN | PollFlags::POLLOUT,
            false => PollFlags::POLLIN,
        };
        let own = self.listener.iter().map(|listener| PollFd::new(listener.as_fd(), PollFlags::POLLIN));
        let peers = self.peers.values().map(|peer| PollFd::new(peer.connection.fd(), events(peer)));
        let mut fds: Vec<_> = std::iter::once(PollFd::new(other, PollFlags::POLLIN)).chain(own).chain(peers).collect();
        // An interruption is a wait that was shorter.
        if poll(&mut fds, timeout).unwrap_or(0) == 0 {
            return false;
        }
        let has_event = |fd: &PollFd<'_>| fd.any().unwrap_or(true);
        let is_other_ready = has_event(&fds[0]);
        let is_asked = self.listener.is_some() && has_event(&fds[1]);
        let first = fds.len() - self.peers.len();
        let ready: Vec<bool> = fds[first..].iter().map(has_event).collect();
        for ((number, peer), _) in self.peers.iter_mut().zip(ready).filter(|(_, is_ready)| *is_ready) {
            peer.connection.flush();
            peer.connection.read(&mut self.space);
            self.arrived.push_back(*number);
        }
        if is_asked {
            self.accept();
        }
        is_other_ready
    }

    fn accept(&mut self) {
        let Some(listener) = &self.listener else { return };
        match address::accept(listener).and_then(|stream| stream.map(Connection::new).transpose()) {
            Ok(Some(connection)) if self.peers.len() < PEERS_MAX => drop(self.add(connection)),
            Ok(Some(_)) => self.refused.add(&format_args!("there are {PEERS_MAX} already")),
            Ok(None) => {}
            Err(error) => self.refused.add(&error),
        }
    }

    fn add(&mut self, connection: Connection) -> u64 {
        let number = self.arrivals;
        self.arrivals += 1;
        self.peers.insert(number, Peer { connection, source: None, agents: BTreeSet::new() });
        number
    }

    fn admit(&mut self, number: u64, source: [u8; 16], agents: BTreeSet<AgentId>) {
        let Some(peer) = self.peers.get_mut(&number) else { return };
        for agent in &agents {
            self.peers_of.entry(*agent).or_default().push(number);
        }
        (peer.source, peer.agents) = (Some(source), agents);
        self.connected.0.borrow_mut().insert(source);
    }

    fn refuse(&mut self, number: u64, reason: &str) {
        self.refused.add(&reason);
        self.remove(number);
    }

    fn remove(&mut self, number: u64) {
        let Some(peer) = self.peers.remove(&number) else { return };
        self.peers_of.retain(|_, numbers| {
            numbers.retain(|other| *other != number);
            !numbers.is_empty()
        });
        if let Some(source) = peer.source
            && !self.peers.values().any(|other| other.source == Some(source))
        {
            self.connected.0.borrow_mut().remove(&source);
        }
    }
}

/// Writes what is queued for the peer to which something may be.
fn flush(peers: &mut BTreeMap<u64, Peer>, sending: &mut Option<u64>) {
    if let Some(peer) = sending.take().and_then(|number| peers.get_mut(&number)) {
        peer.connection.flush();
    }
}

/// What a frame was.
enum Taken<T> {
    Message(T),
    Greeting(Greeting),
}

impl Peer {
    /// Takes the frame that has arrived, or says which rule it breaks.
    fn take<T>(&mut self, frame: Frame, convert: impl Fn(SocketSample<'_>) -> T) -> Result<Taken<T>, String> {
        let (agent, kind) = (AgentId(frame.address.agent), MessageKind::of(frame.address.kind));
        let bytes = self.connection.content(frame);
        let taken = match (self.source, kind) {
            (Some(source), Some(kind)) if self.agents.contains(&agent) => {
                Taken::Message(convert(SocketSample { kind, agent, source, bytes }))
            }
            (Some(source), _) => {
                return Err(format!("participant {source:02x?} has no agent {agent} or message {kind:?}"));
            }
            (None, _) => match cdr::decode::<Greeting>(bytes) {
                Ok(greeting) if frame.address == GREETING && greeting.version == VERSION => Taken::Greeting(greeting),
                _ => return Err("no greeting of this version".to_owned()),
            },
        };
        self.connection.remove(frame);
        Ok(taken)
    }
}

impl Drop for Sockets {
    fn drop(&mut self) {
        for peer in self.peers.values_mut() {
            peer.connection.finish();
        }
    }
}

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests {
    use std::io::Write;

    use super::*;
    use msgs::ids::Tick;
    use msgs::rosgraph_msgs::Clock;

    const SERVER: [u8; 16] = [0xab; 16];

    /// A server of a test, and who is connected with it.
    fn server(number: u8) -> ([u8; 16], Sockets, Connected) {
        let (mut source, connected) = (SERVER, Connected::default());
        source[..4].copy_from_slice(&std::process::id().to_le_bytes());
        source[4] = number;
        (source, Sockets::listen(source, &connected).unwrap(), connected)
    }

    fn clock(tick: u32) -> Clock {
        Clock { clock: Tick(tick.into()).into() }
    }

    type Received = (MessageKind, AgentId, [u8; 16], Clock);

    /// All that has been sent. What one end writes the other one can read at once; a few rounds
    /// accept connections, read greetings and notice ends.
    fn received(sockets: &mut Sockets) -> Vec<Received> {
        let (pipe, _write) = std::os::unix::net::UnixStream::pair().unwrap();
        let mut all = Vec::new();
        for _ in 0..6 {
            sockets.wait(pipe.as_fd(), PollTimeout::ZERO);
            let convert = |sample: SocketSample<'_>| {
                let clock = sample.decode().message.unwrap();
                (sample.kind, sample.agent, sample.source, clock)
            };
            all.extend(std::iter::from_fn(|| sockets.next(convert)));
        }
        all
    }

    #[test]
    fn messages_reach_the_process_of_their_agent() {
        let (source, mut server, connected) = server(1);
        let ends = [Connected::default(), Connected::default()];
        let mut one = Sockets::connect(source, [1; 16], [AgentId(0), AgentId(1)], &ends[0]).unwrap();
        let mut other = Sockets::connect(source, [2; 16], [AgentId(2)], &ends[1]).unwrap();
        assert!(ends.iter().all(|end| end.contains(&source)));
        assert!(one.send(MessageKind::Join, AgentId(1), &clock(1)));
        assert!(other.send(MessageKind::Command, AgentId(2), &clock(2)));
        assert!(!other.send(MessageKind::Command, AgentId(0), &clock(3)), "it has no agent 0");
        flush(&mut one.peers, &mut one.sending);
        flush(&mut other.peers, &mut other.sending);
        let mut arrived = received(&mut server);
        arrived.sort_by_key(|(_, agent, ..)| *agent);
        let (join, command) = (MessageKind::Join, MessageKind::Command);
        assert_eq!(arrived, [(join, AgentId(1), [1; 16], clock(1)), (command, AgentId(2), [2; 16], clock(2))]);
        assert!(connected.contains(&[1; 16]) && connected.contains(&[2; 16]));

        let observation = MessageKind::Observation;
        for agent in [0, 2, 1] {
            assert!(server.send(observation, AgentId(agent), &clock(agent)));
        }
        assert!(!server.send(observation, AgentId(3), &clock(3)));
        flush(&mut server.peers, &mut server.sending);
        let expected = |agent| (observation, AgentId(agent), source, clock(agent));
        assert_eq!(received(&mut one), [expected(0), expected(1)]);
        assert_eq!(received(&mut other), [expected(2)]);

        drop(one);
        assert_eq!(received(&mut server), []);
        assert!(!connected.contains(&[1; 16]) && connected.contains(&[2; 16]));
        assert!(!server.send(observation, AgentId(0), &clock(4)), "its process has gone");
        drop(server);
        assert_eq!(received(&mut other), []);
        assert!(!ends[1].contains(&source));
    }

    #[test]
    fn a_process_with_the_agents_of_another_gets_the_same() {
        let (source, mut server, _) = server(2);
        let end = Connected::default();
        let mut both = [1, 2].map(|own| Sockets::connect(source, [own; 16], [AgentId(7)], &end).unwrap());
        assert_eq!(received(&mut server), []);
        server.send(MessageKind::Observation, AgentId(7), &clock(5));
        flush(&mut server.peers, &mut server.sending);
        for sockets in &mut both {
            assert_eq!(received(sockets), [(MessageKind::Observation, AgentId(7), source, clock(5))]);
        }
    }

    #[test]
    fn who_breaks_the_rules_is_disconnected() {
        let greeting = |version| Greeting { version, source: [9; 16], agents: vec![0] };
        let join = |agent| Address { kind: MessageKind::Join as u32, agent };
        let breaches: [&dyn Fn(&mut Connection); 4] = [
            // No greeting; one of another version; an agent that is not in it; no kind of message.
            &|raw| assert!(raw.queue(join(0), &clock(1))),
            &|raw| assert!(raw.queue(GREETING, &greeting(VERSION + 1))),
            &|raw| {
                raw.queue(GREETING, &greeting(VERSION));
                raw.queue(join(1), &clock(1));
            },
            &|raw| {
                raw.queue(GREETING, &greeting(VERSION));
                raw.queue(Address { kind: 5, agent: 0 }, &clock(1));
            },
        ];
        let (source, mut server, connected) = server(3);
        for (number, breach) in breaches.iter().enumerate() {
            let mut raw = Connection::new(address::connect(source).unwrap()).unwrap();
            breach(&mut raw);
            raw.flush();
            assert_eq!(received(&mut server), [], "{number}");
            assert!(server.peers.is_empty() && !connected.contains(&[9; 16]), "{number}");
        }
        let mut garbage = address::connect(source).unwrap();
        garbage.write_all(&[0xff; 100]).unwrap();
        assert_eq!(received(&mut server), []);
        assert!(server.peers.is_empty());
    }

    #[test]
    fn a_server_that_is_not_there_is_an_error() {
        let absent = Sockets::connect([0xcd; 16], [1; 16], [AgentId(0)], &Connected::default());
        assert_eq!(absent.err().map(|error| error.kind()), Some(io::ErrorKind::ConnectionRefused));
        let (source, _server, _) = server(4);
        let second = Sockets::listen(source, &Connected::default());
        assert_eq!(second.err().map(|error| error.kind()), Some(io::ErrorKind::AddrInUse));
    }
}
