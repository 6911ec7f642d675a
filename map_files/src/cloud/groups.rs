//! Points to drop by the cells that they lie in: cells with few points, and groups of few cells.
//!
//! Cells are a sorted list instead of a grid, because this decides what the map has to hold.

use super::super::options::ImportOptions;
use super::super::work_budget::WorkBudget;
use super::super::{FormatError, Note};

/// Cells that keep their points.
pub(super) struct Groups {
    /// In ascending order.
    kept: Vec<[i64; 3]>,
    min_points: u32,
    sparse: u64,
    outliers: u32,
    lone: u64,
    groups: u64,
}

impl Groups {
    /// The cells of points, in lengths of cells; `None` if no option drops any.
    ///
    /// # Errors
    /// If too little work is left.
    pub(super) fn of(
        options: &ImportOptions,
        points: impl Iterator<Item = [f64; 3]>,
        work: &mut WorkBudget,
    ) -> Result<Option<Self>, FormatError> {
        let (min_points, outliers) = (options.voxel_min_points.unwrap_or(1), options.outliers.unwrap_or(0));
        if min_points == 1 && outliers == 0 {
            return Ok(None);
        }
        let mut all: Vec<[i64; 3]> = points.map(cell).collect();
        work.spend(all.len())?;
        all.sort_unstable();
        let mut cells: Vec<([i64; 3], u64)> = Vec::new();
        for cell in all {
            match cells.last_mut() {
                Some((last, count)) if *last == cell => *count += 1,
                _ => cells.push((cell, 1)),
            }
        }
        let (mut sparse, mut lone, mut groups) = (0, 0, 0);
        cells.retain(|&(_, count)| {
            let is_kept = count >= u64::from(min_points);
            sparse += if is_kept { 0 } else { count };
            is_kept
        });
        let mut is_kept = vec![true; cells.len()];
        if outliers > 0 {
            let mut is_visited = vec![false; cells.len()];
            for first in 0..cells.len() {
                if std::mem::replace(&mut is_visited[first], true) {
                    continue;
                }
                let mut group = vec![first];
                let mut next = 0;
                while let Some(&member) = group.get(next) {
                    next += 1;
                    work.spend(NEIGHBOURS)?;
                    let around = neighbours(cells[member].0);
                    let found = around.filter_map(|cell| cells.binary_search_by_key(&cell, |&(cell, _)| cell).ok());
                    group.extend(found.filter(|&found| !std::mem::replace(&mut is_visited[found], true)));
                }
                if group.len() <= outliers as usize {
                    groups += 1;
                    for member in group {
                        lone += cells[member].1;
                        is_kept[member] = false;
                    }
                }
            }
        }
        let kept = cells.iter().zip(is_kept).filter_map(|(&(cell, _), is_kept)| is_kept.then_some(cell)).collect();
        Ok(Some(Self { kept, min_points, sparse, outliers, lone, groups }))
    }

    /// Whether a point in lengths of cells keeps its place.
    pub(super) fn holds(&self, place: [f64; 3]) -> bool {
        self.kept.binary_search(&cell(place)).is_ok()
    }

    /// What was dropped.
    pub(super) fn notes(&self) -> impl Iterator<Item = Note> {
        let Self { min_points, sparse, outliers, lone, groups, .. } = self;
        let sparse = (*min_points > 1)
            .then(|| Note::new("few points", format!("{sparse} points in cells with less than {min_points} dropped")));
        let lone = (*outliers > 0).then(|| {
            Note::new("outliers", format!("{lone} points in {groups} group(s) of at most {outliers} cells dropped"))
        });
        sparse.into_iter().chain(lone)
    }
}

/// Cells around one, itself included.
const NEIGHBOURS: usize = 27;

fn cell(place: [f64; 3]) -> [i64; 3] {
    place.map(|along| libm::floor(along) as i64)
}

/// The cells that touch one, if only at a corner, and itself.
fn neighbours([x, y, z]: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (0..NEIGHBOURS as i64).map(move |number| {
        let along = |at: i64, step: i64| at.saturating_add(number / step % 3 - 1);
        [along(x, 1), along(y, 3), along(z, 9)]
    })
}
