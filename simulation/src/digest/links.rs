//! The hashing of a digest: the bytes of a run become links, piece by piece.
//!
//! Invariants: pieces are hashed in the order in which they were added, whichever thread does it;
//! only a reader of the last link waits for another thread.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::Digest;
use world::workers::Workers;

/// With so many pieces that no helper has hashed, a caller hashes them.
const WAITING_MAX: usize = 64;

/// Bytes of a run, with the places at which a tick ends.
#[derive(Debug, Default)]
pub(super) struct Piece {
    pub(super) bytes: Vec<u8>,
    /// Ascending.
    pub(super) ends: Vec<usize>,
}

/// The links so far, and what is on its way to them.
#[derive(Debug)]
pub(super) struct Links {
    shared: Arc<LinkState>,
    workers: Arc<Workers>,
}

#[derive(Debug)]
struct LinkState {
    waiting: Mutex<VecDeque<Piece>>,
    /// Held by the thread that hashes. Pieces are taken while it is held.
    last: Mutex<Link>,
}

/// The last link, and the hash of what came after it.
#[derive(Debug)]
struct Link {
    digest: Digest,
    next: blake3::Hasher,
}

impl Links {
    /// No link yet.
    pub(super) fn new(workers: Arc<Workers>) -> Self {
        let none = Link { digest: Digest([0; 32]), next: blake3::Hasher::new() };
        Self { shared: Arc::new(LinkState { waiting: Mutex::default(), last: Mutex::new(none) }), workers }
    }

    /// Adds a piece, which a helper hashes if there is one.
    pub(super) fn add(&self, piece: Piece) {
        let mut waiting = self.shared.waiting();
        waiting.push_back(piece);
        let is_full = waiting.len() >= WAITING_MAX;
        drop(waiting);
        if is_full || !self.workers.has_helpers() {
            self.last();
        } else {
            let shared = Arc::clone(&self.shared);
            self.workers.spawn(move |_| {
                // A thread that hashes already takes the new piece as well, or the next one does.
                if let Ok(mut link) = shared.last.try_lock() {
                    shared.hash_waiting(&mut link);
                }
            });
        }
    }

    /// The link of the last tick that was added.
    pub(super) fn last(&self) -> Digest {
        let mut link = self.shared.last.lock().unwrap_or_else(PoisonError::into_inner);
        self.shared.hash_waiting(&mut link);
        link.digest
    }
}

impl LinkState {
    fn waiting(&self) -> MutexGuard<'_, VecDeque<Piece>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn hash_waiting(&self, link: &mut Link) {
        let next = || self.waiting().pop_front();
        while let Some(piece) = next() {
            link.hash(&piece);
        }
    }
}

impl Link {
    fn hash(&mut self, piece: &Piece) {
        let mut start = 0;
        for &end in &piece.ends {
            self.next.update(&piece.bytes[start..end]);
            self.digest = Digest(*self.next.finalize().as_bytes());
            self.next.reset();
            self.next.update(&self.digest.0);
            start = end;
        }
        self.next.update(&piece.bytes[start..]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The last link of ticks with these bytes, by definition.
    fn by_definition(ticks: &[Vec<u8>]) -> Digest {
        let mut link = None;
        for tick in ticks {
            let mut hasher = blake3::Hasher::new();
            link.into_iter().for_each(|link: blake3::Hash| {
                hasher.update(link.as_bytes());
            });
            link = Some(hasher.update(tick).finalize());
        }
        Digest(*link.expect("a tick").as_bytes())
    }

    fn ticks() -> Vec<Vec<u8>> {
        (0..500).map(|tick: usize| vec![tick as u8; tick * 7919 % 3000]).collect()
    }

    fn links(threads: usize) -> Links {
        Links::new(Arc::new(Workers::new(threads).unwrap()))
    }

    #[test]
    fn links_do_not_depend_on_pieces_or_threads() {
        let ticks = ticks();
        for (threads, piece_bytes) in [(1, 1), (1, 5000), (2, 1), (2, 700), (3, 5000), (4, usize::MAX)] {
            let links = links(threads);
            let mut piece = Piece::default();
            for tick in &ticks {
                // Some pieces end within a tick.
                for part in tick.chunks(1000) {
                    piece.bytes.extend_from_slice(part);
                    if piece.bytes.len() >= piece_bytes {
                        links.add(std::mem::take(&mut piece));
                    }
                }
                piece.ends.push(piece.bytes.len());
            }
            links.add(piece);
            assert_eq!(links.last(), by_definition(&ticks), "{threads} threads, pieces of {piece_bytes} bytes");
        }
    }

    #[test]
    fn every_link_can_be_read() {
        let ticks = ticks();
        for threads in [1, 2] {
            let links = links(threads);
            for (last, tick) in ticks.iter().enumerate() {
                links.add(Piece { bytes: tick.clone(), ends: vec![tick.len()] });
                if last % 50 == 17 {
                    assert_eq!(links.last(), by_definition(&ticks[..=last]));
                }
            }
        }
    }

    #[test]
    fn a_busy_helper_does_not_let_pieces_pile_up() {
        let links = links(2);
        let (release, released) = std::sync::mpsc::channel::<()>();
        links.workers.spawn(move |_| {
            released.recv().unwrap_err();
        });
        (1..WAITING_MAX).for_each(|_| links.add(Piece::default()));
        assert_eq!(links.shared.waiting().len(), WAITING_MAX - 1);
        links.add(Piece::default());
        assert!(links.shared.waiting().is_empty());
        drop(release);
    }
}
