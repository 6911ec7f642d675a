//! Threads that help the thread of a loop with independent tasks.
//!
//! The caller works as well, and waits only for tasks that a helper has begun: a helper that wakes
//! late costs nothing. So a batch of short tasks takes no longer than on one thread.
//!
//! Invariants: each task is performed once; results are in the order of the tasks, whatever thread
//! performs them; a panic of a task is one of the caller.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

/// The helpers of one loop.
#[derive(Debug)]
pub struct Workers {
    /// `None` if the thread of the loop is alone.
    pool: Option<ThreadPool>,
}

/// What a task has made, or its panic.
type Outcome<R> = Result<R, Box<dyn Any + Send>>;

/// Tasks that are performed side by side.
struct Batch<T, R, F> {
    perform: F,
    tasks: Vec<Mutex<Option<T>>>,
    /// The first task that no thread has begun.
    next: AtomicUsize,
    outcomes: Mutex<Outcomes<R>>,
    is_done: Condvar,
}

struct Outcomes<R> {
    done: usize,
    by_task: Vec<Option<Outcome<R>>>,
}

impl Workers {
    /// This many threads, that of the loop included.
    ///
    /// # Errors
    /// If the system has no threads left.
    pub fn new(threads: usize) -> Result<Self, ThreadPoolBuildError> {
        let pool = || ThreadPoolBuilder::new().num_threads(threads - 1).build();
        Ok(Self { pool: (threads > 1).then(pool).transpose()? })
    }

    /// Whether there are threads besides that of the loop.
    #[must_use]
    pub fn has_helpers(&self) -> bool {
        self.pool.is_some()
    }

    /// Has a helper perform a task some time, if there are helpers.
    pub fn spawn(&self, task: impl FnOnce() + Send + 'static) {
        if let Some(pool) = &self.pool {
            pool.spawn(task);
        }
    }

    /// Performs tasks, on this thread and on those of the helpers that are free; returns what they
    /// make, in order.
    pub fn map<T, R>(&self, tasks: Vec<T>, perform: impl Fn(T) -> R + Send + Sync + 'static) -> Vec<R>
    where
        T: Send + 'static,
        R: Send + 'static,
    {
        let pool = match &self.pool {
            Some(pool) if tasks.len() > 1 => pool,
            _ => return tasks.into_iter().map(perform).collect(),
        };
        let outcomes = Outcomes { done: 0, by_task: tasks.iter().map(|_| None).collect() };
        let batch = Arc::new(Batch {
            perform,
            tasks: tasks.into_iter().map(|task| Mutex::new(Some(task))).collect(),
            next: AtomicUsize::new(0),
            outcomes: Mutex::new(outcomes),
            is_done: Condvar::new(),
        });
        for _ in 1..batch.tasks.len().min(pool.current_num_threads() + 1) {
            let batch = Arc::clone(&batch);
            pool.spawn(move || batch.work());
        }
        batch.work();
        batch.results()
    }
}

impl<T, R, F: Fn(T) -> R> Batch<T, R, F> {
    /// Performs tasks until all have been begun.
    fn work(&self) {
        loop {
            let number = self.next.fetch_add(1, Ordering::Relaxed);
            let Some(task) = self.tasks.get(number) else { return };
            let task = task.lock().unwrap_or_else(PoisonError::into_inner).take();
            let task = task.expect("each task is begun once");
            let outcome = catch_unwind(AssertUnwindSafe(|| (self.perform)(task)));
            let mut outcomes = self.outcomes.lock().unwrap_or_else(PoisonError::into_inner);
            outcomes.by_task[number] = Some(outcome);
            outcomes.done += 1;
            if outcomes.done == self.tasks.len() {
                self.is_done.notify_one();
            }
        }
    }

    /// What the tasks have made, once all are done.
    fn results(&self) -> Vec<R> {
        let mut outcomes = self.outcomes.lock().unwrap_or_else(PoisonError::into_inner);
        while outcomes.done < self.tasks.len() {
            outcomes = self.is_done.wait(outcomes).unwrap_or_else(PoisonError::into_inner);
        }
        let by_task = std::mem::take(&mut outcomes.by_task);
        drop(outcomes);
        let result = |outcome: Option<Outcome<R>>| {
            outcome.expect("all tasks are done").unwrap_or_else(|panic| resume_unwind(panic))
        };
        by_task.into_iter().map(result).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_order_for_any_number_of_threads() {
        for threads in [1, 2, 5] {
            let workers = Workers::new(threads).unwrap();
            for count in [0, 1, 2, 3, 50] {
                let expected: Vec<usize> = (0..count).map(|task| task * task).collect();
                assert_eq!(workers.map((0..count).collect(), |task| task * task), expected);
            }
        }
    }

    #[test]
    fn panic_of_a_task_is_one_of_the_caller() {
        for threads in [1, 2] {
            let workers = Workers::new(threads).unwrap();
            let perform = |task: usize| assert_ne!(task, 3, "the third task fails");
            let caught = catch_unwind(AssertUnwindSafe(|| workers.map((0..5).collect(), perform)));
            assert!(caught.is_err());
            assert_eq!(workers.map(vec![1, 2], |task| task), [1, 2], "the workers stay usable");
        }
    }
}
