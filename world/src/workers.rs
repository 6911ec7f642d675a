//! Threads that help the thread of a loop with independent tasks.
//!
//! The caller works as well, and waits only for tasks that a helper has begun: a helper that wakes
//! late costs nothing. So a few short tasks take no longer than on one thread, and a single one
//! wakes no helper.
//!
//! Invariants: each task is performed once, in any order; a panic of a task is one of the caller.

use std::any::Any;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

/// The helpers of one loop.
#[derive(Debug)]
pub struct Workers {
    /// `None` if the thread of the loop is alone.
    pool: Option<ThreadPool>,
    backlog: Backlog,
}

/// The tasks for helpers that none has begun.
#[derive(Debug, Clone, Default)]
pub struct Backlog(Arc<AtomicUsize>);

/// Tasks that the thread of a loop adds one by one, while helpers perform those before.
#[derive(Debug)]
pub struct TaskQueue<T, R> {
    workers: Workers,
    shared: Arc<JobQueue<T, R>>,
    /// What helpers have made.
    made: Receiver<Outcome<R>>,
    /// Tasks that were added, and whose outcome the caller has not got.
    unfinished: usize,
}

#[derive(Debug)]
struct JobQueue<T, R> {
    perform: fn(T) -> R,
    waiting: Mutex<Waiting<T>>,
    made: Sender<Outcome<R>>,
}

/// The tasks that no thread has begun.
#[derive(Debug)]
struct Waiting<T> {
    tasks: VecDeque<T>,
    /// Helpers that look for further tasks.
    helpers: usize,
}

/// What a task has made, or its panic.
type Outcome<R> = Result<R, Box<dyn Any + Send>>;

impl Workers {
    /// This many threads, that of the loop included.
    ///
    /// # Errors
    /// If the system has no threads left.
    pub fn new(threads: usize) -> Result<Self, ThreadPoolBuildError> {
        let pool = || ThreadPoolBuilder::new().num_threads(threads - 1).build();
        Ok(Self { pool: (threads > 1).then(pool).transpose()?, backlog: Backlog::default() })
    }

    /// Whether there are threads besides that of the loop.
    #[must_use]
    pub fn has_helpers(&self) -> bool {
        self.pool.is_some()
    }

    /// Number of threads besides that of the loop.
    fn helpers(&self) -> usize {
        self.pool.as_ref().map_or(0, ThreadPool::current_num_threads)
    }

    /// Has a helper perform a task some time, if there are helpers. The task may ask whether others
    /// wait.
    pub fn spawn(&self, task: impl FnOnce(&Backlog) + Send + 'static) {
        if let Some(pool) = &self.pool {
            let backlog = self.backlog.clone();
            backlog.0.fetch_add(1, Ordering::Relaxed);
            pool.spawn(move || {
                backlog.0.fetch_sub(1, Ordering::Relaxed);
                task(&backlog);
            });
        }
    }
}

impl Backlog {
    /// Whether no task waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.load(Ordering::Relaxed) == 0
    }
}

impl<T: Send + 'static, R: Send + 'static> TaskQueue<T, R> {
    /// A queue whose tasks these threads perform.
    #[must_use]
    pub fn new(workers: Workers, perform: fn(T) -> R) -> Self {
        let (sender, made) = channel();
        let waiting = Mutex::new(Waiting { tasks: VecDeque::new(), helpers: 0 });
        Self { workers, shared: Arc::new(JobQueue { perform, waiting, made: sender }), made, unfinished: 0 }
    }

    /// Adds a task. Helpers begin with the one before it: the last one is left to the caller, who
    /// would have to wait for it.
    pub fn push(&mut self, task: T) {
        self.unfinished += 1;
        let mut waiting = self.shared.waiting();
        waiting.tasks.push_back(task);
        if waiting.tasks.len() > 1 && waiting.helpers < self.workers.helpers() {
            waiting.helpers += 1;
            drop(waiting);
            let shared = Arc::clone(&self.shared);
            self.workers.spawn(move |_| shared.help());
        }
    }

    /// Whether all tasks are done.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.unfinished == 0
    }

    /// What one of the tasks has made: one that a helper has done, else one that this thread
    /// performs now, else one that a helper is performing. `None` once the queue is empty.
    ///
    /// # Panics
    /// If the task does.
    pub fn finish_one(&mut self) -> Option<R> {
        if self.is_empty() {
            return None;
        }
        self.unfinished -= 1;
        let made = match self.made.try_recv() {
            Ok(outcome) => outcome,
            Err(_) => match self.shared.begin() {
                Some(task) => return Some((self.shared.perform)(task)),
                None => self.made.recv().expect("the queue has a sender of its own"),
            },
        };
        Some(made.unwrap_or_else(|panic| resume_unwind(panic)))
    }
}

impl<T, R> JobQueue<T, R> {
    fn waiting(&self) -> MutexGuard<'_, Waiting<T>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn begin(&self) -> Option<T> {
        self.waiting().tasks.pop_front()
    }

    /// Performs tasks until none waits.
    fn help(&self) {
        loop {
            let mut waiting = self.waiting();
            let Some(task) = waiting.tasks.pop_front() else {
                waiting.helpers -= 1;
                return;
            };
            drop(waiting);
            let outcome = catch_unwind(AssertUnwindSafe(|| (self.perform)(task)));
            // The receiver is gone if the loop has ended.
            let _ = self.made.send(outcome);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all_of<R: Send + 'static>(queue: &mut TaskQueue<usize, R>) -> Vec<R> {
        std::iter::from_fn(|| queue.finish_one()).collect()
    }

    #[test]
    fn each_task_is_performed_once_by_any_number_of_threads() {
        for threads in [1, 2, 5] {
            let mut queue = TaskQueue::new(Workers::new(threads).unwrap(), |task: usize| task * task);
            for count in [0, 1, 2, 3, 50] {
                (0..count).for_each(|task| queue.push(task));
                assert_eq!(queue.is_empty(), count == 0);
                let mut made = all_of(&mut queue);
                made.sort_unstable();
                assert_eq!(made, (0..count).map(|task| task * task).collect::<Vec<usize>>());
                assert!(queue.is_empty());
            }
        }
    }

    #[test]
    fn helpers_begin_while_tasks_are_added() {
        // Two tasks that can only be done side by side.
        static MEETING: std::sync::Barrier = std::sync::Barrier::new(2);
        let mut queue = TaskQueue::new(Workers::new(2).unwrap(), |_| MEETING.wait().is_leader());
        queue.push(0);
        queue.push(1);
        MEETING.wait();
        queue.push(2);
        assert_eq!(all_of(&mut queue).len(), 3);
    }

    #[test]
    fn panic_of_a_task_is_one_of_the_caller() {
        for threads in [1, 2] {
            let perform = |task: usize| assert_ne!(task, 3, "the third task fails");
            let mut queue = TaskQueue::new(Workers::new(threads).unwrap(), perform);
            (0..5).for_each(|task| queue.push(task));
            let caught = catch_unwind(AssertUnwindSafe(|| all_of(&mut queue)));
            assert!(caught.is_err());
            queue.push(1);
            all_of(&mut queue);
            assert!(queue.is_empty(), "the queue stays usable");
        }
    }
}
