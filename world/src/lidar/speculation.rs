//! The engine that casts scans ahead: those that are due next if nothing changes.
//!
//! Invariants: the scans ahead are in the order in which they are expected, and each was cast as if
//! those before it had become due; if a scan from another pose becomes due, they are taken back, so
//! they change no result. Scans with noise are never cast ahead.

use std::collections::VecDeque;

use super::culling::{CullingEngine, UndoEntry};
use super::engine::{CastCount, Engine, NewCells, NotCast};
use super::memory::Parts;
use super::{Scanner, SensorMemory};
use crate::body::Pose;

/// Casts scans as [`CullingEngine`] does, some of them before they are due.
#[derive(Debug, Default)]
pub(crate) struct SpeculativeEngine {
    /// The scans that were cast ahead, by the time at which they are expected.
    ahead: VecDeque<ScanAhead>,
}

/// A scan that was cast ahead.
#[derive(Debug)]
struct ScanAhead {
    pose: Pose,
    /// Indices of the new cells.
    free: Vec<u32>,
    wall: Vec<u32>,
    undo: Option<UndoEntry>,
}

impl Engine for SpeculativeEngine {
    fn cast(&mut self, scanner: &Scanner, memory: &mut SensorMemory, pose: &Pose, new: NewCells<'_>) -> CastCount {
        if self.is_ahead(scanner, 0, pose)
            && let Some(scan) = self.ahead.pop_front()
        {
            new.free.extend(scan.free);
            new.wall.extend(scan.wall);
            return CastCount::without(scanner.rays().into(), NotCast::CastAhead);
        }
        self.take_back(memory, 0);
        CullingEngine.cast(scanner, memory, pose, new)
    }
}

impl SpeculativeEngine {
    /// Casts a scan ahead that is expected right after the one from `previous`; returns whether it
    /// sees anything else.
    pub(crate) fn cast_ahead(
        &mut self,
        scanner: &Scanner,
        memory: &mut SensorMemory,
        previous: Option<&Pose>,
        pose: &Pose,
    ) -> bool {
        if NotCast::of_scan(|a, b| scanner.sees_the_same(a, b), false, previous, pose).is_some() {
            return false;
        }
        let place_of = |pose| self.ahead.iter().position(|scan| scanner.sees_the_same(&scan.pose, pose));
        let place = previous.and_then(place_of).map_or(0, |previous| previous + 1);
        if !self.is_ahead(scanner, place, pose) {
            self.take_back(memory, place);
            let (mut free, mut wall) = (Vec::new(), Vec::new());
            let new = NewCells { free: &mut free, wall: &mut wall };
            let (_, undo) = CullingEngine.cast_undoable(scanner, memory, pose, new);
            self.ahead.push_back(ScanAhead { pose: *pose, free, wall, undo });
        }
        true
    }

    /// Takes all scans back that were cast ahead.
    pub(crate) fn take_all_back(&mut self, memory: &mut SensorMemory) {
        self.take_back(memory, 0);
    }

    /// Number of scans that were cast ahead and did not become due yet.
    #[cfg(test)]
    pub(crate) fn scans_ahead(&self) -> usize {
        self.ahead.len()
    }

    /// Whether the scan at this place was cast ahead, and sees what one from `pose` does.
    pub(super) fn is_ahead(&self, scanner: &Scanner, place: usize, pose: &Pose) -> bool {
        self.ahead.get(place).is_some_and(|scan| scanner.sees_the_same(&scan.pose, pose))
    }

    /// Takes back the scans that were cast ahead, from this place on, the latest first.
    fn take_back(&mut self, memory: &mut SensorMemory, place: usize) {
        for ScanAhead { free, wall, undo, .. } in self.ahead.drain(place..).rev() {
            let Parts { marks, culling } = memory.parts();
            // Marks of the outside may stay: no cell is there.
            marks.forget(free.iter().chain(&wall).copied());
            culling.restore(undo);
        }
    }
}
