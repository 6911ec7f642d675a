//! Subscriptions, services and sockets that are waited for together.
//!
//! Invariants: they are served in turn, so that one busy topic does not starve the others;
//! undecodable bytes are an error that stops nothing; every sample carries the participant that
//! sent it.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::pin::pin;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::task::{Context as TaskContext, Poll, Wake, Waker};
use std::time::Duration;

use nix::poll::PollTimeout;
use rustdds::RTPSEntity;
use serde::{Deserialize, Deserializer};

use super::network::{Context, Network};
use super::unix_sockets::{SocketSample, Sockets};
use msgs::message::Message;
use system::wall_clock::now;

/// A sample of a topic.
pub struct Sample<M> {
    /// The message, or why its bytes cannot be decoded.
    pub message: Result<M, String>,
    /// The participant that sent it: its GUID prefix and four zeros, or its Zenoh session; all
    /// zeros if unknown.
    pub source: [u8; 16],
}

/// Subscriptions, services and sockets that are waited for together.
pub struct Inbox<T> {
    ready: Arc<Ready>,
    subscriptions: Vec<Subscription<T>>,
    sockets: Option<SocketInbox<T>>,
}

struct Subscription<T> {
    waker: Waker,
    take: Take<T>,
}

/// Takes the next sample of a subscription, or registers the waker with it.
pub(super) type Take<T> = Box<dyn Fn(&mut TaskContext<'_>) -> Poll<T>>;

struct SocketInbox<T> {
    sockets: Sockets,
    convert: Box<dyn Fn(SocketSample<'_>) -> T>,
    /// Subscriptions that were asked since the sockets were looked at.
    asked: u32,
}

/// Subscriptions that are asked before the sockets are looked at again, so that a flood on topics
/// does not keep away what comes over them.
const ASKED_MAX: u32 = 16;

impl<T> Default for Inbox<T> {
    fn default() -> Self {
        Inbox { ready: Arc::default(), subscriptions: Vec::new(), sockets: None }
    }
}

/// A subscription in an inbox.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SubscriptionId(usize);

impl<T> Inbox<T> {
    pub(super) fn add(&mut self, take: Take<T>) -> SubscriptionId {
        let number = self.subscriptions.len();
        let waker = Waker::from(Arc::new(SubscriptionWaker { subscription: number, ready: Arc::clone(&self.ready) }));
        self.subscriptions.push(Subscription { waker, take });
        self.ready.push(number);
        SubscriptionId(number)
    }

    /// Ends a subscription, so that its publishers need not publish for it any more.
    pub fn unsubscribe(&mut self, SubscriptionId(number): SubscriptionId) {
        self.subscriptions[number].take = Box::new(|_| Poll::Pending);
    }

    /// Adds sockets to what is waited for, which yield `convert(sample)`.
    ///
    /// # Errors
    /// If the system has no more file descriptors.
    pub fn set_sockets(
        &mut self,
        sockets: Sockets,
        convert: impl Fn(SocketSample<'_>) -> T + 'static,
    ) -> io::Result<()> {
        self.ready.wake_by_pipe()?;
        self.sockets = Some(SocketInbox { sockets, convert: Box::new(convert), asked: 0 });
        Ok(())
    }

    /// The sockets, if there are any.
    pub fn sockets(&mut self) -> Option<&mut Sockets> {
        self.sockets.as_mut().map(|inbox| &mut inbox.sockets)
    }

    /// The next item, or `None` after the timeout.
    pub fn receive(&mut self, timeout: Duration) -> Option<T> {
        let begun = now();
        loop {
            let left = || timeout.saturating_sub(begun.elapsed());
            let number = match &mut self.sockets {
                None => self.ready.next(left())?,
                Some(inbox) => match inbox.next(&self.ready, left)? {
                    Next::Item(item) => return Some(item),
                    Next::Subscription(number) => number,
                },
            };
            let subscription = &self.subscriptions[number];
            if let Poll::Ready(taken) = (subscription.take)(&mut TaskContext::from_waker(&subscription.waker)) {
                self.ready.push(number);
                return Some(taken);
            }
        }
    }
}

/// What there is next.
enum Next<T> {
    Item(T),
    /// A subscription that may have something.
    Subscription(usize),
}

impl<T> SocketInbox<T> {
    /// What the sockets or else the subscriptions have next; `None` when no time is left. Sockets
    /// are read when they are looked at, and only then, so that they do not keep away what comes
    /// over topics either.
    fn next(&mut self, ready: &Ready, left: impl Fn() -> Duration) -> Option<Next<T>> {
        if self.asked >= ASKED_MAX {
            self.look(ready, Duration::ZERO);
        }
        let mut is_over = false;
        loop {
            if let Some(item) = self.sockets.next(&self.convert) {
                return Some(Next::Item(item));
            }
            if let Some(number) = ready.next_now() {
                self.asked += 1;
                return Some(Next::Subscription(number));
            }
            if is_over {
                return None;
            }
            let left = left();
            is_over = left.is_zero();
            self.look(ready, left);
        }
    }

    /// Looks at the sockets, and waits for them unless a subscription is ready.
    fn look(&mut self, ready: &Ready, left: Duration) {
        self.asked = 0;
        // Milliseconds, and more rather than less.
        let left = PollTimeout::try_from(left.as_micros().div_ceil(1000)).unwrap_or(PollTimeout::MAX);
        ready.wait_with(|pipe, is_ready| self.sockets.wait(pipe, if is_ready { PollTimeout::ZERO } else { left }));
    }
}

/// The subscriptions that may have a sample, in the order in which they are polled.
#[derive(Default)]
struct Ready {
    state: Mutex<ReadyState>,
    changed: Condvar,
    /// Wakes who waits for sockets as well: where it waits, and where the others write.
    pipe: OnceLock<(UnixStream, UnixStream)>,
}

#[derive(Default)]
struct ReadyState {
    numbers: VecDeque<usize>,
    /// Whether the inbox waits for the pipe.
    waits_for_pipe: bool,
}

impl Ready {
    fn push(&self, number: usize) {
        let mut state = self.lock();
        state.numbers.push_back(number);
        let waits_for_pipe = std::mem::take(&mut state.waits_for_pipe);
        drop(state);
        self.changed.notify_one();
        if waits_for_pipe && let Some((_, write)) = self.pipe.get() {
            // One byte at a time is in the pipe, so there is room for it.
            drop((&*write).write(&[0]));
        }
    }

    fn next(&self, timeout: Duration) -> Option<usize> {
        let waited = self.changed.wait_timeout_while(self.lock(), timeout, |state| state.numbers.is_empty());
        waited.unwrap_or_else(PoisonError::into_inner).0.numbers.pop_front()
    }

    fn next_now(&self) -> Option<usize> {
        self.lock().numbers.pop_front()
    }

    /// Opens the pipe.
    fn wake_by_pipe(&self) -> io::Result<()> {
        let (read, write) = UnixStream::pair()?;
        read.set_nonblocking(true)?;
        write.set_nonblocking(true)?;
        drop(self.pipe.set((read, write)));
        Ok(())
    }

    /// Calls `wait` with the pipe and whether a subscription is ready. It waits until the pipe can
    /// be read, unless one is ready, and returns whether it can.
    fn wait_with(&self, wait: impl FnOnce(BorrowedFd<'_>, bool) -> bool) {
        let Some((read, _)) = self.pipe.get() else { return };
        let mut state = self.lock();
        let is_ready = !state.numbers.is_empty();
        state.waits_for_pipe = !is_ready;
        drop(state);
        let is_woken = wait(read.as_fd(), is_ready);
        self.lock().waits_for_pipe = false;
        if is_woken {
            drop((&*read).read(&mut [0; 8]));
        }
    }

    fn lock(&self) -> MutexGuard<'_, ReadyState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Wakes the inbox for one subscription.
struct SubscriptionWaker {
    subscription: usize,
    ready: Arc<Ready>,
}

impl Wake for SubscriptionWaker {
    fn wake(self: Arc<Self>) {
        self.ready.push(self.subscription);
    }
}

/// See [`Take`].
pub(super) fn take<M: Message + 'static>(
    subscription: &ros2_client::Subscription<Decoded<M>>,
    context: &mut TaskContext<'_>,
) -> Poll<Sample<M>> {
    pin!(subscription.async_take()).poll(context).map(|taken| match taken {
        Ok((Decoded(message), info)) => Sample { message, source: participant_of(info.publisher_gid().to_bytes16()) },
        Err(error) => Sample { message: Err(error.to_string()), source: [0; 16] },
    })
}

/// The participant of this process, as in [`Sample::source`].
pub fn own_source(context: &Context) -> [u8; 16] {
    match &context.network {
        Network::Dds(context) => participant_of(context.domain_participant().guid().to_bytes()),
        #[cfg(feature = "zenoh")]
        Network::Zenoh(session) => session.source(),
    }
}

/// The participant of an endpoint.
pub(super) fn participant_of(mut guid: [u8; 16]) -> [u8; 16] {
    guid[GUID_PREFIX_LENGTH..].fill(0);
    guid
}

/// Bytes of a GUID that all endpoints of a participant share.
const GUID_PREFIX_LENGTH: usize = 12;

/// A message, or why its bytes cannot be decoded. A deserialisation error returned by the ROS
/// client itself would lose the sender.
pub(super) struct Decoded<M>(Result<M, String>);

impl<'de, M: Deserialize<'de>> Deserialize<'de> for Decoded<M> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Decoded(M::deserialize(deserializer).map_err(|error| error.to_string())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::rosgraph_msgs::Clock;

    fn inbox_of(numbers: impl IntoIterator<Item = usize>) -> Inbox<usize> {
        let mut inbox = Inbox::default();
        for number in numbers {
            inbox.add(Box::new(move |_: &mut TaskContext<'_>| Poll::Ready(number)));
        }
        inbox
    }

    #[test]
    fn subscriptions_are_served_in_turn() {
        let mut inbox = inbox_of(0..3);
        let received: Vec<_> = (0..7).map(|_| inbox.receive(Duration::ZERO).unwrap()).collect();
        assert_eq!(received, [0, 1, 2, 0, 1, 2, 0]);
    }

    #[test]
    fn a_pending_subscription_is_polled_after_wake() {
        let mut inbox = Inbox::default();
        let wakers = Arc::new(Mutex::new(Vec::new()));
        let left = Arc::clone(&wakers);
        inbox.add(Box::new(move |context: &mut TaskContext<'_>| {
            let mut left = left.lock().unwrap();
            left.push(context.waker().clone());
            if left.len().is_multiple_of(2) { Poll::Ready(left.len()) } else { Poll::Pending }
        }));
        assert_eq!(inbox.receive(Duration::from_millis(1)), None);
        assert_eq!(inbox.receive(Duration::from_millis(1)), None);
        let waker = wakers.lock().unwrap()[0].clone();
        std::thread::scope(|scope| {
            scope.spawn(move || waker.wake());
            assert_eq!(inbox.receive(Duration::from_secs(60)), Some(2));
        });
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn sockets_and_subscriptions_keep_each_other_from_nothing() {
        use crate::unix_sockets::{Connected, MessageKind};
        use msgs::ids::AgentId;

        let (server, connected) = ([0xee; 16], Connected::default());
        // A subscription that always has something.
        let mut inbox = inbox_of(0..1);
        inbox.set_sockets(Sockets::listen(server, &connected).unwrap(), |_| 1).unwrap();
        let mut agent = Sockets::connect(server, [1; 16], [AgentId(0)], &connected).unwrap();
        let sent = 100;
        for _ in 0..sent {
            assert!(agent.send(MessageKind::Command, AgentId(0), &Clock::default()));
        }
        drop(agent);
        let received: Vec<_> = (0..10 * sent).map(|_| inbox.receive(Duration::ZERO).unwrap()).collect();
        assert_eq!(received.iter().filter(|&&item| item == 1).count(), sent);
        assert!(received[..sent].contains(&1) && received[..sent].contains(&0));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_wake_ends_a_wait_for_sockets() {
        let mut inbox = Inbox::default();
        let left = Arc::new(Mutex::new(None));
        let waker = Arc::clone(&left);
        inbox.add(Box::new(move |context: &mut TaskContext<'_>| {
            match waker.lock().unwrap().replace(context.waker().clone()) {
                None => Poll::Pending,
                Some(_) => Poll::Ready(7),
            }
        }));
        let connected = crate::unix_sockets::Connected::default();
        inbox.set_sockets(Sockets::listen([0xef; 16], &connected).unwrap(), |_| 0).unwrap();
        assert_eq!(inbox.receive(Duration::from_millis(1)), None);
        let waker = left.lock().unwrap().clone().unwrap();
        std::thread::scope(|scope| {
            scope.spawn(move || waker.wake());
            assert_eq!(inbox.receive(Duration::from_secs(60)), Some(7));
        });
    }

    #[test]
    fn undecodable_bytes_are_an_error() {
        let bytes = msgs::cdr::encode(&Clock::default());
        assert!(msgs::cdr::decode::<Decoded<Clock>>(&bytes).unwrap().0.is_ok());
        let broken = msgs::cdr::decode::<Decoded<Clock>>(&bytes[..9]).unwrap();
        assert_eq!(broken.0.unwrap_err(), "unexpected end of input");
    }
}
