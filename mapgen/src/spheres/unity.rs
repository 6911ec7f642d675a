//! The random numbers of Unity, the engine of MAES3D: Marsaglia's xorshift128 ("Xorshift RNGs",
//! Journal of Statistical Software 8, 2003), with integers by remainder.
//!
//! Only integers are here. That they are the engine's is proved by the maps that MAES3D ships: the
//! first draw from the seed of one is the number in its name, and the rest of it is the file. There
//! is no such proof for its real numbers, so noise maps cannot be made from its seeds.

use std::ops::RangeInclusive;

use super::super::MapError;

/// The multiplier by which the words of the state follow from the seed, that of MT19937.
const SEED_MULTIPLIER: u32 = 1_812_433_253;

/// The numbers by which MAES3D names maps of random seeds.
const NAMES: RangeInclusive<i32> = 100_000..=999_999;

/// The state of the generator.
#[derive(Debug, Clone)]
pub(super) struct Unity {
    words: [u32; 4],
}

impl Unity {
    /// The state after `Random.InitState(seed)`.
    ///
    /// # Errors
    /// If the seed has more than 32 bits.
    pub(super) fn of_seed(seed: u64) -> Result<Self, MapError> {
        let seed = u32::try_from(seed).map_err(|_| MapError::SeedTooLong { seed })?;
        let next = |word: u32| word.wrapping_mul(SEED_MULTIPLIER).wrapping_add(1);
        let (second, third) = (next(seed), next(next(seed)));
        Ok(Self { words: [seed, second, third, next(third)] })
    }

    /// The state after MAES3D has drawn the name of a map from it.
    ///
    /// # Errors
    /// If the seed has more than 32 bits.
    pub(super) fn of_named_map(seed: u64) -> Result<Self, MapError> {
        let mut unity = Self::of_seed(seed)?;
        unity.integer(NAMES);
        Ok(unity)
    }

    /// `Random.Range` of a range that is not empty.
    pub(super) fn integer(&mut self, range: RangeInclusive<i32>) -> i32 {
        let count = range.end().abs_diff(*range.start()) + 1;
        range.start() + (self.next() % count).cast_signed()
    }

    fn next(&mut self) -> u32 {
        let [first, second, third, last] = self.words;
        let mixed = first ^ (first << 11);
        let new = last ^ (last >> 19) ^ mixed ^ (mixed >> 8);
        self.words = [second, third, last, new];
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_draws_are_the_names_of_the_shipped_maps() {
        for (seed, name) in [(383_214_729, 546_842), (2_679_605_203, 832_129)] {
            assert_eq!(Unity::of_seed(seed).unwrap().integer(NAMES), name);
        }
    }

    #[test]
    fn integers_cover_their_range() {
        let mut unity = Unity::of_seed(1).unwrap();
        let mut counts = [0_u32; 5];
        for _ in 0..10_000 {
            counts[usize::try_from(unity.integer(-2..=2) + 2).unwrap()] += 1;
        }
        assert!(counts.iter().all(|count| (1_800..2_200).contains(count)), "{counts:?}");
    }

    #[test]
    fn longer_seeds_are_refused() {
        let error = Unity::of_seed(1 << 32).unwrap_err().to_string();
        assert_eq!(error, "seed is 4294967296, allowed is 0 to 4294967295 where `random` is that of Unity");
    }
}
