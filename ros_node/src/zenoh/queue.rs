//! A bounded queue from the threads of Zenoh to the inbox.
//!
//! Invariant: it holds at most `depth` items; one more replaces the oldest, as in a history that
//! keeps the last.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};

pub(super) struct Queue<T> {
    depth: usize,
    state: Mutex<State<T>>,
}

struct State<T> {
    items: VecDeque<T>,
    /// Of who waits for an item.
    waker: Option<Waker>,
}

impl<T> Queue<T> {
    pub(super) fn new(depth: u32) -> Self {
        let state = State { items: VecDeque::new(), waker: None };
        Queue { depth: depth.max(1) as usize, state: Mutex::new(state) }
    }

    pub(super) fn push(&self, item: T) {
        let mut state = self.lock();
        // Dropping a request may send, so it happens without the lock.
        let oldest = if state.items.len() >= self.depth { state.items.pop_front() } else { None };
        state.items.push_back(item);
        let waker = state.waker.take();
        drop(state);
        drop(oldest);
        if let Some(waker) = waker {
            waker.wake();
        }
    }

    /// The oldest item, or registers the waker.
    pub(super) fn take(&self, context: &Context<'_>) -> Poll<T> {
        let mut state = self.lock();
        match state.items.pop_front() {
            Some(item) => Poll::Ready(item),
            None => {
                state.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::task::Wake;

    use super::*;

    #[derive(Default)]
    struct Count(AtomicU32);

    impl Wake for Count {
        fn wake(self: Arc<Self>) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn the_last_items_are_kept() {
        let queue = Queue::new(2);
        (0..4).for_each(|item| queue.push(item));
        let context = Context::from_waker(Waker::noop());
        assert_eq!([queue.take(&context), queue.take(&context)], [Poll::Ready(2), Poll::Ready(3)]);
        assert_eq!(queue.take(&context), Poll::Pending);
    }

    #[test]
    fn who_waits_is_woken_once() {
        let (queue, count) = (Queue::new(2), Arc::new(Count::default()));
        let waker = Waker::from(Arc::clone(&count));
        assert_eq!(queue.take(&Context::from_waker(&waker)), Poll::Pending);
        queue.push(1);
        queue.push(2);
        assert_eq!(count.0.load(Ordering::Relaxed), 1);
    }
}
