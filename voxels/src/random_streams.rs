//! Random number streams: named generators derived from the seed of a run.
//!
//! A run has one seed, and every consumer of randomness has its own stream, named by (seed, id,
//! purpose). The three are hashed into a ChaCha8 key, so streams are independent: draws from one
//! never change another, and a new agent or purpose leaves all existing streams as they are.
//!
//! Nothing is drawn from the operating system; the seed is always an argument.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Domain separation of the BLAKE3 keys. Changing it changes every map and every run.
const DOMAIN: &str = "maes_msgs 2026 random stream v1";

/// The generator for (`seed`, `id`, `purpose`): always the same numbers, independent of every other
/// stream.
///
/// `id` is that of the agent the numbers are for, or 0 where there is no agent (map generation).
/// `purpose` is a short fixed word such as `"map.noise"`; independent consumers need different
/// words.
///
/// ```
/// use rand_chacha::rand_core::Rng;
///
/// let mut heading = voxels::random_streams::stream(7, 3, "rbw.heading");
/// let mut again = voxels::random_streams::stream(7, 3, "rbw.heading");
/// let mut other = voxels::random_streams::stream(7, 4, "rbw.heading");
/// let first = heading.next_u64();
/// assert_eq!(first, again.next_u64());
/// assert_ne!(first, other.next_u64());
/// ```
pub fn stream(seed: u64, id: u64, purpose: &str) -> ChaCha8Rng {
    let mut hasher = blake3::Hasher::new_derive_key(DOMAIN);
    // The numbers have a fixed length and come first, so no two triples are the same bytes.
    hasher.update(&seed.to_le_bytes());
    hasher.update(&id.to_le_bytes());
    hasher.update(purpose.as_bytes());
    ChaCha8Rng::from_seed(*hasher.finalize().as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::Rng;

    fn first(seed: u64, id: u64, purpose: &str) -> u64 {
        stream(seed, id, purpose).next_u64()
    }

    #[test]
    fn streams_differ_in_every_part_of_the_name() {
        let all = [
            first(0, 0, ""),
            first(1, 0, ""),
            first(0, 1, ""),
            first(0, 0, "a"),
            first(0, 0, "b"),
            first(1, 1, "a"),
            first(u64::MAX, 0, ""),
            first(0, 0x61, ""),
        ];
        for (i, a) in all.iter().enumerate() {
            for b in &all[i + 1..] {
                assert_ne!(a, b);
            }
        }
    }

    /// A change here changes every map and every run of every seed.
    #[test]
    fn streams_are_fixed() {
        let mut rng = stream(7, 3, "golden");
        assert_eq!([rng.next_u64(), rng.next_u64()], [9_120_509_127_682_535_042, 15_394_021_909_843_919_511]);
    }
}
