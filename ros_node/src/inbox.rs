//! Subscriptions and services that are waited for together.
//!
//! Invariants: they are served in turn, so that one busy topic does not starve the others;
//! undecodable bytes are an error that stops nothing; every sample carries the participant that
//! sent it.

use std::collections::VecDeque;
use std::pin::pin;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::{Context as TaskContext, Poll, Wake, Waker};
use std::time::Duration;

use rustdds::RTPSEntity;
use serde::{Deserialize, Deserializer};

use super::network::{Context, Network};
use super::now;
use msgs::message::Message;

/// A sample of a topic.
pub struct Sample<M> {
    /// The message, or why its bytes cannot be decoded.
    pub message: Result<M, String>,
    /// The participant that sent it: its GUID prefix and four zeros, or its Zenoh session; all
    /// zeros if unknown.
    pub source: [u8; 16],
}

/// Subscriptions and services that are waited for together.
pub struct Inbox<T> {
    ready: Arc<Ready>,
    subscriptions: Vec<Subscription<T>>,
}

struct Subscription<T> {
    waker: Waker,
    take: Take<T>,
}

/// Takes the next sample of a subscription, or registers the waker with it.
pub(super) type Take<T> = Box<dyn Fn(&mut TaskContext<'_>) -> Poll<T>>;

impl<T> Default for Inbox<T> {
    fn default() -> Self {
        Inbox { ready: Arc::default(), subscriptions: Vec::new() }
    }
}

impl<T> Inbox<T> {
    pub(super) fn add(&mut self, take: Take<T>) {
        let number = self.subscriptions.len();
        let waker = Waker::from(Arc::new(SubscriptionWaker { subscription: number, ready: Arc::clone(&self.ready) }));
        self.subscriptions.push(Subscription { waker, take });
        self.ready.push(number);
    }

    /// The next item, or `None` after the timeout.
    pub fn receive(&mut self, timeout: Duration) -> Option<T> {
        let begun = now();
        loop {
            let number = self.ready.next(timeout.saturating_sub(begun.elapsed()))?;
            let subscription = &self.subscriptions[number];
            if let Poll::Ready(taken) = (subscription.take)(&mut TaskContext::from_waker(&subscription.waker)) {
                self.ready.push(number);
                return Some(taken);
            }
        }
    }
}

/// The subscriptions that may have a sample, in the order in which they are polled.
#[derive(Default)]
struct Ready {
    numbers: Mutex<VecDeque<usize>>,
    changed: Condvar,
}

impl Ready {
    fn push(&self, number: usize) {
        self.lock().push_back(number);
        self.changed.notify_one();
    }

    fn next(&self, timeout: Duration) -> Option<usize> {
        let waited = self.changed.wait_timeout_while(self.lock(), timeout, |numbers| numbers.is_empty());
        waited.unwrap_or_else(PoisonError::into_inner).0.pop_front()
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<usize>> {
        self.numbers.lock().unwrap_or_else(PoisonError::into_inner)
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

    #[test]
    fn undecodable_bytes_are_an_error() {
        let bytes = msgs::cdr::encode(&Clock::default());
        assert!(msgs::cdr::decode::<Decoded<Clock>>(&bytes).unwrap().0.is_ok());
        let broken = msgs::cdr::decode::<Decoded<Clock>>(&bytes[..9]).unwrap();
        assert_eq!(broken.0.unwrap_err(), "unexpected end of input");
    }
}
