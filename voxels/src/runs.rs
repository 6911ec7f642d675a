//! Run-length coding of lists of cell indices, the form in which they are sent.
//!
//! A run is a first index and a length of 1 to 65535; it may continue in the next row of the map.

use thiserror::Error;

/// Packs cell indices into the first indices and the lengths of runs.
///
/// The result is as short as possible if the indices ascend strictly; any other sequence is packed
/// as well and [`indices`] gives it back as it was.
///
/// ```
/// let (starts, lengths) = voxels::runs([3, 4, 5, 9].into_iter());
/// assert_eq!((starts, lengths), (vec![3, 9], vec![3, 1]));
/// ```
pub fn runs(sorted: impl Iterator<Item = u32>) -> (Vec<u32>, Vec<u16>) {
    let mut starts: Vec<u32> = Vec::new();
    let mut lengths: Vec<u16> = Vec::new();
    let mut next = None;
    for index in sorted {
        match lengths.last_mut() {
            Some(length) if next == Some(index) && *length < u16::MAX => *length += 1,
            _ => {
                starts.push(index);
                lengths.push(1);
            }
        }
        next = index.checked_add(1);
    }
    (starts, lengths)
}

/// The cell indices that runs stand for, run by run.
///
/// Untrusted runs must pass [`check_runs`] first: here a surplus of starts or lengths is ignored,
/// and a run ends at the largest index.
///
/// ```
/// assert!(voxels::indices(&[3, 9], &[3, 1]).eq([3, 4, 5, 9]));
/// ```
pub fn indices<'a>(starts: &'a [u32], lengths: &'a [u16]) -> impl Iterator<Item = u32> + use<'a> {
    starts
        .iter()
        .zip(lengths)
        .flat_map(|(&start, &length)| (0..u32::from(length)).map_while(move |offset| start.checked_add(offset)))
}

/// The reason why runs are not an ascending list of cells of a map; runs count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum RunsError {
    /// The two arrays differ in length.
    #[error("{starts} run starts came with {lengths} run lengths")]
    Arrays {
        /// Number of starts.
        starts: usize,
        /// Number of lengths.
        lengths: usize,
    },
    /// A run without cells.
    #[error("run {run} is empty, allowed are 1 to 65535 cells")]
    Empty {
        /// Index of the run.
        run: usize,
    },
    /// A run starts before the end of the one before it.
    #[error("run {run} starts at cell {start}, allowed after the run before it are {lowest} and above")]
    Order {
        /// Index of the run.
        run: usize,
        /// Its first cell.
        start: u32,
        /// The first cell after the run before it.
        lowest: u64,
    },
    /// A run leaves the map.
    #[error("run {run} ends with cell {last}, the map has {volume} cells")]
    Outside {
        /// Index of the run.
        run: usize,
        /// Its last cell.
        last: u64,
        /// Cells in the map.
        volume: usize,
    },
}

/// Checks untrusted runs: disjoint, ascending, within a map of `volume` cells. Returns the number
/// of cells.
///
/// # Errors
/// If one of these does not hold; the error names the run.
pub fn check_runs(starts: &[u32], lengths: &[u16], volume: usize) -> Result<usize, RunsError> {
    if starts.len() != lengths.len() {
        return Err(RunsError::Arrays { starts: starts.len(), lengths: lengths.len() });
    }
    let mut lowest = 0;
    let mut cells = 0;
    for (run, (&start, &length)) in starts.iter().zip(lengths).enumerate() {
        if length == 0 {
            return Err(RunsError::Empty { run });
        }
        if u64::from(start) < lowest {
            return Err(RunsError::Order { run, start, lowest });
        }
        lowest = u64::from(start) + u64::from(length);
        if lowest > volume as u64 {
            return Err(RunsError::Outside { run, last: lowest - 1, volume });
        }
        cells += usize::from(length);
    }
    Ok(cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn long_runs_are_split() {
        let (starts, lengths) = runs(10..131_082);
        assert_eq!(starts, [10, 65_545, 131_080]);
        assert_eq!(lengths, [65_535, 65_535, 2]);
        assert!(indices(&starts, &lengths).eq(10..131_082));
        assert_eq!(check_runs(&starts, &lengths, 131_082), Ok(131_072));
    }

    #[test]
    fn empty_list_has_no_runs() {
        assert_eq!(runs(std::iter::empty()), (vec![], vec![]));
        assert_eq!(check_runs(&[], &[], 0), Ok(0));
    }

    #[test]
    fn bad_runs_are_named() {
        assert_eq!(check_runs(&[1], &[], 9), Err(RunsError::Arrays { starts: 1, lengths: 0 }));
        assert_eq!(check_runs(&[1, 5], &[1, 0], 9), Err(RunsError::Empty { run: 1 }));
        let order = RunsError::Order { run: 1, start: 3, lowest: 4 };
        assert_eq!(check_runs(&[1, 3], &[3, 1], 9), Err(order));
        let outside = check_runs(&[u32::MAX], &[u16::MAX], 9).unwrap_err();
        assert_eq!(outside.to_string(), "run 0 ends with cell 4295032829, the map has 9 cells");
        assert_eq!(indices(&[u32::MAX], &[7]).collect::<Vec<_>>(), [u32::MAX]);
    }

    proptest! {
        #[test]
        fn any_sequence_comes_back(list in prop::collection::vec(0u32..40, 0..60)) {
            let (starts, lengths) = runs(list.iter().copied());
            prop_assert!(indices(&starts, &lengths).eq(list));
        }

        #[test]
        fn sorted_lists_become_legal_and_minimal(set in prop::collection::btree_set(0u32..90, 0..60)) {
            let (starts, lengths) = runs(set.iter().copied());
            prop_assert_eq!(check_runs(&starts, &lengths, 90), Ok(set.len()));
            let breaks = set.iter().filter(|&&i| i == 0 || !set.contains(&(i - 1))).count();
            prop_assert_eq!(starts.len(), breaks);
        }
    }
}
