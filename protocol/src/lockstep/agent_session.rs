//! The session with one agent: which process holds its id, what that process still has to replay,
//! and what it may still send without fault.
//!
//! ```text
//!            join                      join of another process
//!  Absent ---------> Live | Replaying <------------------------+
//!                     |   ^                                    |
//!     another joins   |   | an answer to what was asked later  |
//!                     v   |                                    |
//!                  Contended                                   |
//!                     |                                        |
//!                     | no answer in time     an answer        |
//!                     +-----------------> Lost -------> Live   |
//!                                          |                   |
//!     its process was replaced elsewhere   +-------------------+
//!                  -----------------> GivenUp -----------------+
//! ```
//!
//! `Left` is the end: the agent has got the shutdown message, and is never asked again.
//!
//! **Replay.** A process that takes over gets all committed observations from the start, one at a
//! time, and must give the same commands: controllers are deterministic, so that afterwards it has
//! the state of its predecessor.
//!
//! Invariants: an id belongs to one process at a time, and its key goes with it; what is replayed
//! is what was committed, in that order; a command that differs from the logged one is never
//! accepted.

use core::time::Duration;
use std::sync::Arc;

use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Observation as Fragment, SignedJoin};

use crate::signed::{JoinRequest, Signed, Verified};

use super::authentication::Grant;
use super::{Lease, Refusal, SourceId};

/// The process that holds an id.
#[derive(Debug, Clone)]
pub(super) struct Holder {
    pub(super) lease: Lease,
    /// What it was sent, and its key.
    pub(super) grant: Grant,
    /// When it was last told that it is accepted, since the start of the session.
    pub(super) accepted_at: Option<Duration>,
}

impl Holder {
    pub(super) fn new(lease: Lease, grant: Grant) -> Self {
        Self { lease, grant, accepted_at: None }
    }

    /// The process, distinguished from an earlier one at the same place.
    pub(super) fn process(&self) -> (SourceId, u64) {
        (self.lease.source, self.lease.instance)
    }
}

/// A process that asks for an id which another one holds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rival {
    /// The tick in which the first such join came.
    pub(super) since: Tick,
    pub(super) source: SourceId,
    pub(super) join: Signed<JoinRequest>,
}

/// Who holds an id, and how it stands with that process.
#[derive(Debug, Clone, Default)]
pub(super) enum State {
    /// No process has joined.
    #[default]
    Absent,
    /// A process holds the id, and knows the log.
    Live { holder: Holder },
    /// As live, and another process has asked for the id: the next answer to an observation from
    /// after that refuses it.
    Contended { holder: Holder, rival: Rival },
    /// The log is replayed to the process, `next` being the entry that it has to answer.
    Replaying { holder: Holder, next: usize, rival: Option<Rival> },
    /// The process has not answered in time: the next one that asks takes over. `next` is the entry
    /// that it has to answer, or the length of the log.
    Lost { holder: Holder, next: usize, rival: Option<Rival> },
    /// The process was replaced as another agent, and has to end: the next one that asks takes
    /// over, and nothing of it is accepted.
    GivenUp { holder: Holder },
    /// The agent has left the run.
    Left { holder: Holder },
}

/// A committed observation and its command.
#[derive(Debug, Clone)]
struct Entry {
    fragments: Arc<Vec<Fragment>>,
    command: Command,
}

/// How a command relates to a replay.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Recall {
    /// No replay is under way: the command belongs to the present tick.
    Complete,
    /// The logged command; the replay advances.
    Same,
    /// A repeated command of an entry that was replayed before.
    Retransmit,
    /// A command for an entry that was not sent yet.
    OutOfOrder {
        /// The tick of the last entry that was sent.
        expected: Tick,
    },
    /// Not the logged command, which is this.
    Different(Box<Command>),
}

/// What may still come from a process without being wrong.
#[derive(Debug, Clone, Default)]
pub(super) struct Expected {
    /// The last command that was accepted or replayed.
    last_command: Option<Command>,
    /// How many retransmits of it are accepted, because its observation was resent so often.
    retransmits: u32,
    /// Whether a reply to the last observation may still arrive: it is no longer awaited, or the
    /// observation was resent. It may cross the shutdown message and be taken for its
    /// acknowledgement, which then is a second answer.
    is_abandoned: bool,
}

impl Expected {
    /// Notes that an observation is resent.
    pub(super) fn note_resent(&mut self) {
        self.retransmits += 1;
    }

    /// Notes whether the last observation is given up without a reply.
    pub(super) fn set_abandoned(&mut self, is_abandoned: bool) {
        self.is_abandoned = is_abandoned;
    }

    /// Notes that the shutdown message may cross a retransmit.
    pub(super) fn note_shutdown(&mut self) {
        self.is_abandoned |= self.retransmits > 0;
    }

    pub(super) fn note_command(&mut self, command: &Command) {
        self.last_command = Some(command.clone());
    }

    /// Whether a command that the barrier refuses is no fault. Each is excused once.
    pub(super) fn excuses(&mut self, command: &Command, refusal: &Refusal) -> bool {
        // Compared as bytes: a field may be NaN, which does not equal itself.
        let is_same = |last: &Command| cdr::encode(last) == cdr::encode(command);
        if self.retransmits > 0 && self.last_command.as_ref().is_some_and(is_same) {
            self.retransmits -= 1;
            return true;
        }
        matches!(refusal, Refusal::SecondAnswer { .. }) && std::mem::take(&mut self.is_abandoned)
    }
}

/// The session with one agent.
#[derive(Debug, Clone, Default)]
pub(super) struct AgentSession {
    pub(super) state: State,
    pub(super) expected: Expected,
    /// What the agent has observed and answered so far, if a replay may be needed.
    log: Vec<Entry>,
}

impl AgentSession {
    /// The process that holds the id, if one does.
    pub(super) fn holder(&self) -> Option<&Holder> {
        match &self.state {
            State::Absent => None,
            State::Live { holder }
            | State::Contended { holder, .. }
            | State::Replaying { holder, .. }
            | State::Lost { holder, .. }
            | State::GivenUp { holder }
            | State::Left { holder } => Some(holder),
        }
    }

    pub(super) fn holder_mut(&mut self) -> Option<&mut Holder> {
        match &mut self.state {
            State::Absent => None,
            State::Live { holder }
            | State::Contended { holder, .. }
            | State::Replaying { holder, .. }
            | State::Lost { holder, .. }
            | State::GivenUp { holder }
            | State::Left { holder } => Some(holder),
        }
    }

    /// The id gets a new process, which has to replay the log first.
    pub(super) fn begin(&mut self, holder: Holder) {
        self.set(holder, 0, None);
    }

    /// The state of a process that answers.
    fn set(&mut self, holder: Holder, next: usize, rival: Option<Rival>) {
        self.state = match rival {
            rival if next < self.log.len() => State::Replaying { holder, next, rival },
            Some(rival) => State::Contended { holder, rival },
            None => State::Live { holder },
        };
    }

    /// Splits the state of a process that may answer into its parts; others stay as they are.
    fn take_serving(&mut self) -> Option<(Holder, usize, Option<Rival>)> {
        let len = self.log.len();
        match std::mem::take(&mut self.state) {
            State::Live { holder } => Some((holder, len, None)),
            State::Contended { holder, rival } => Some((holder, len, Some(rival))),
            State::Replaying { holder, next, rival } | State::Lost { holder, next, rival } => {
                Some((holder, next, rival))
            }
            state @ (State::Absent | State::GivenUp { .. } | State::Left { .. }) => {
                self.state = state;
                None
            }
        }
    }

    /// Notes that the process does not answer. Returns whether that is new.
    pub(super) fn lose(&mut self) -> bool {
        if matches!(self.state, State::Lost { .. }) {
            return false;
        }
        match self.take_serving() {
            Some((holder, next, rival)) => {
                self.state = State::Lost { holder, next, rival };
                true
            }
            None => false,
        }
    }

    /// Notes that the process answers. Returns whether it was lost.
    pub(super) fn revive(&mut self) -> bool {
        if matches!(self.state, State::Lost { .. })
            && let Some((holder, next, rival)) = self.take_serving()
        {
            self.set(holder, next, rival);
            return true;
        }
        false
    }

    /// Notes that the process was replaced as another agent.
    pub(super) fn give_up(&mut self) {
        if let Some((holder, ..)) = self.take_serving() {
            self.state = State::GivenUp { holder };
        }
    }

    /// The agent leaves the run.
    pub(super) fn leave(&mut self) {
        self.state = match std::mem::take(&mut self.state) {
            State::Absent => State::Absent,
            State::Live { holder }
            | State::Contended { holder, .. }
            | State::Replaying { holder, .. }
            | State::Lost { holder, .. }
            | State::GivenUp { holder }
            | State::Left { holder } => State::Left { holder },
        };
    }

    /// Holds a process that asks for the id until the present one has shown whether it is alive.
    /// Returns `false` if that is known: then the new one takes over.
    pub(super) fn hold(&mut self, new: Rival) -> bool {
        match &mut self.state {
            State::Absent | State::Lost { .. } | State::GivenUp { .. } => return false,
            // It has nothing to wait for but the end of the run.
            State::Left { .. } => {}
            State::Contended { rival, .. } => *rival = Rival { since: rival.since, ..new },
            State::Replaying { rival, .. } => {
                let since = rival.as_ref().map_or(new.since, |rival| rival.since);
                *rival = Some(Rival { since, ..new });
            }
            State::Live { .. } => {
                if let Some((holder, next, _)) = self.take_serving() {
                    self.set(holder, next, Some(new));
                }
            }
        }
        true
    }

    /// The process has answered the observation of a tick. Returns the one that asked for its id
    /// before, which is refused. An answer to an observation from before that join may have been on
    /// its way when the process died.
    pub(super) fn refuse_rival(&mut self, tick: Tick) -> Option<Rival> {
        let (holder, next, rival) = self.take_serving()?;
        let (refused, kept) = match rival {
            Some(rival) if tick > rival.since => (Some(rival), None),
            rival => (None, rival),
        };
        self.set(holder, next, kept);
        refused
    }

    /// The entry that the process has to answer, if a replay is under way.
    fn replayed(&self) -> Option<&Entry> {
        match &self.state {
            State::Replaying { next, .. } | State::Lost { next, .. } => self.log.get(*next),
            _ => None,
        }
    }

    /// Whether a replay is under way.
    pub(super) fn is_replaying(&self) -> bool {
        self.replayed().is_some()
    }

    /// The observation to replay, if a replay is under way.
    pub(super) fn to_replay(&self) -> Option<&Arc<Vec<Fragment>>> {
        self.replayed().map(|entry| &entry.fragments)
    }

    /// The tick of that observation.
    pub(super) fn replayed_tick(&self) -> Option<Tick> {
        self.replayed().map(|entry| Tick(entry.command.tick))
    }

    /// Compares a command with the entry that is replayed.
    pub(super) fn recall(&mut self, command: &Verified<Command>) -> Recall {
        let Some(entry) = self.replayed() else {
            return Recall::Complete;
        };
        let expected = Tick(entry.command.tick);
        match Tick(command.tick).cmp(&expected) {
            std::cmp::Ordering::Less => Recall::Retransmit,
            std::cmp::Ordering::Greater => Recall::OutOfOrder { expected },
            // Compared as bytes: a field may be NaN, which does not equal itself.
            std::cmp::Ordering::Equal if digested(&entry.command) == digested(command) => {
                if let Some((holder, next, rival)) = self.take_serving() {
                    self.set(holder, next + 1, rival);
                }
                Recall::Same
            }
            std::cmp::Ordering::Equal => Recall::Different(Box::new(entry.command.clone())),
        }
    }

    /// Appends a committed exchange; `is_known` says that the present process gave the command.
    pub(super) fn append(&mut self, fragments: Arc<Vec<Fragment>>, command: &Command, is_known: bool) {
        let before = self.log.len();
        self.log.push(Entry { fragments, command: command.clone() });
        let after = self.log.len();
        match &mut self.state {
            State::Lost { next, .. } if is_known && *next == before => *next = after,
            State::Live { .. } | State::Contended { .. } if !is_known => {
                if let Some((holder, _, rival)) = self.take_serving() {
                    self.set(holder, before, rival);
                }
            }
            _ => {}
        }
    }

    /// Ends a replay, complete or not.
    pub(super) fn skip_replay(&mut self) {
        let len = self.log.len();
        match &mut self.state {
            State::Lost { next, .. } => *next = len,
            State::Replaying { .. } => {
                if let Some((holder, _, rival)) = self.take_serving() {
                    self.set(holder, len, rival);
                }
            }
            _ => {}
        }
    }

    /// See [`AgentSessions::fingerprint`](super::AgentSessions::fingerprint).
    pub(super) fn fingerprint(&self, bytes: &mut Vec<u8>) {
        let len = self.log.len();
        let (kind, next, rival) = match &self.state {
            State::Absent => (0, len, None),
            State::Live { .. } => (1, len, None),
            State::Contended { rival, .. } => (2, len, Some(rival)),
            State::Replaying { next, rival, .. } => (3, *next, rival.as_ref()),
            State::Lost { next, rival, .. } => (4, *next, rival.as_ref()),
            State::GivenUp { .. } => (5, len, None),
            State::Left { .. } => (6, len, None),
        };
        bytes.extend([kind, next as u8, len as u8]);
        if let Some(holder) = self.holder() {
            bytes.extend(holder.lease.source.0.iter().chain(&holder.lease.instance.to_le_bytes()));
        }
        if let Some(Rival { since, source, join }) = rival {
            bytes.extend(
                source.0.iter().chain(&since.0.to_le_bytes()).chain(&cdr::encode(&SignedJoin::from(join.clone()))),
            );
        }
        let Expected { last_command, retransmits, is_abandoned } = &self.expected;
        bytes.extend([*retransmits as u8, u8::from(*is_abandoned)]);
        if let Some(command) = last_command {
            bytes.extend(command.tick.to_le_bytes());
            bytes.extend(command.info.as_bytes());
        }
    }

    /// Whether the process of this agent can be asked at all.
    pub(super) fn has_process(&self) -> bool {
        self.holder().is_some()
    }
}

/// Names the agent of a session.
pub(super) fn numbered<S>(sessions: impl IntoIterator<Item = S>) -> impl Iterator<Item = (AgentId, S)> {
    (0..).map(AgentId).zip(sessions)
}

/// The bytes of a command on which the run depends: all but the stage, which recordings of earlier
/// builds do not have.
fn digested(command: &Command) -> Vec<u8> {
    cdr::encode(&Command { stage: Command::SAME, ..command.clone() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holder(source: u8) -> Holder {
        let lease = Lease { source: SourceId([source; 16]), instance: source.into(), controller: "rbw".into() };
        Holder::new(lease, Grant::default())
    }

    fn rival(since: u64) -> Rival {
        Rival { since: Tick(since), source: SourceId([9; 16]), join: Signed::default() }
    }

    fn command(tick: u64, info: &str) -> Command {
        Command { tick, agent: 1, info: info.to_owned(), ..Command::default() }
    }

    fn verified(tick: u64, info: &str) -> Verified<Command> {
        Signed::unsigned(command(tick, info)).trusted()
    }

    /// A session whose process has answered two ticks, or not.
    fn of_two_ticks(is_known: bool) -> AgentSession {
        let mut session = AgentSession::default();
        session.begin(holder(1));
        for tick in [0, 7] {
            let fragments = Arc::new(vec![Fragment { tick, ..Fragment::default() }]);
            session.append(fragments, &command(tick, "on my way"), is_known);
        }
        session
    }

    fn next_tick(session: &AgentSession) -> Option<u64> {
        session.to_replay().map(|fragments| fragments[0].tick)
    }

    #[test]
    fn answered_observations_are_not_replayed() {
        let mut session = of_two_ticks(true);
        assert!(matches!(session.state, State::Live { .. }));
        assert_eq!(next_tick(&session), None);
        assert_eq!(session.recall(&verified(9, "")), Recall::Complete);
    }

    #[test]
    fn a_replay_sends_one_entry_at_a_time() {
        let mut session = of_two_ticks(true);
        session.begin(holder(2));
        for mut session in [session, of_two_ticks(false)] {
            assert_eq!(next_tick(&session), Some(0));
            assert_eq!(session.recall(&verified(7, "on my way")), Recall::OutOfOrder { expected: Tick(0) });
            assert_eq!(session.recall(&verified(0, "on my way")), Recall::Same);
            assert_eq!(next_tick(&session), Some(7));
            assert_eq!(session.recall(&verified(0, "on my way")), Recall::Retransmit, "it was resent");
            assert_eq!(next_tick(&session), Some(7));
            assert_eq!(session.recall(&verified(7, "on my way")), Recall::Same);
            assert!(matches!(session.state, State::Live { .. }));
        }
    }

    #[test]
    fn a_stage_that_is_not_recorded_is_no_divergence() {
        let mut session = of_two_ticks(false);
        let now = verified(0, "on my way").map(|command| Command { stage: Command::EXPLORING, ..command });
        assert_eq!(session.recall(&now), Recall::Same);
    }

    #[test]
    fn a_divergent_command_is_not_accepted() {
        let mut session = of_two_ticks(false);
        let recorded = Box::new(command(0, "on my way"));
        assert_eq!(session.recall(&verified(0, "lost")), Recall::Different(recorded));
        assert_eq!(next_tick(&session), Some(0));
        session.skip_replay();
        assert_eq!(next_tick(&session), None);
    }

    #[test]
    fn a_later_answer_refuses_a_rival() {
        let mut session = of_two_ticks(true);
        assert!(session.hold(rival(8)) && session.hold(rival(9)));
        assert_eq!(session.refuse_rival(Tick(8)), None, "it may have been on its way");
        assert!(matches!(session.state, State::Contended { .. }));
        assert_eq!(session.refuse_rival(Tick(9)), Some(rival(8)), "the first join counts");
        assert!(matches!(session.state, State::Live { .. }));
    }

    #[test]
    fn a_lost_process_comes_back_where_it_was() {
        for (is_known, since) in [(true, None), (true, Some(3)), (false, None), (false, Some(3))] {
            let mut session = of_two_ticks(is_known);
            if let Some(since) = since {
                assert!(session.hold(rival(since)));
            }
            assert!(session.lose() && !session.lose());
            assert!(!session.hold(rival(5)), "the next one takes over");
            assert_eq!(session.is_replaying(), !is_known);
            assert!(session.revive() && !session.revive());
            let is_as_before = match &session.state {
                State::Live { .. } => is_known && since.is_none(),
                State::Contended { .. } => is_known && since.is_some(),
                State::Replaying { rival, .. } => !is_known && rival.is_some() == since.is_some(),
                _ => false,
            };
            assert!(is_as_before, "{:?}", session.state);
        }
    }

    #[test]
    fn a_reply_of_the_predecessor_is_replayed() {
        let mut session = of_two_ticks(true);
        session.begin(holder(2));
        session.skip_replay();
        session.append(Arc::new(vec![Fragment { tick: 9, ..Fragment::default() }]), &command(9, ""), false);
        assert_eq!(next_tick(&session), Some(9));
    }

    #[test]
    fn resent_observations_excuse_retransmits() {
        let second = Refusal::SecondAnswer { agent: AgentId(1), tick: Tick(7) };
        let mut expected = Expected::default();
        expected.note_command(&command(7, ""));
        assert!(!expected.excuses(&command(7, ""), &second));
        expected.note_resent();
        assert!(!expected.excuses(&command(7, "other"), &second));
        assert!(expected.excuses(&command(7, ""), &second) && !expected.excuses(&command(7, ""), &second));
        expected.set_abandoned(true);
        assert!(expected.excuses(&command(7, "other"), &second) && !expected.excuses(&command(7, "other"), &second));
    }
}
