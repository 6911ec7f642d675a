//! The bits that are set in words, the lowest first.

/// The places of the bits that are set in a word, ascending.
#[inline]
pub fn bits(mut left: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let bit = (left != 0).then(|| left.trailing_zeros());
        left &= left.wrapping_sub(1);
        bit
    })
}

/// The places of the bits that are set in words, 64 in each, ascending.
#[inline]
pub fn bits_of(words: &[u64]) -> impl Iterator<Item = usize> + '_ {
    words.iter().enumerate().flat_map(|(word, &left)| bits(left).map(move |bit| 64 * word + bit as usize))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn places_are_those_of_the_ones(words in prop::collection::vec(any::<u64>(), 0..4)) {
            let is_set = |&place: &usize| words[place / 64] >> (place % 64) & 1 != 0;
            prop_assert!(bits_of(&words).eq((0..64 * words.len()).filter(is_set)));
        }
    }
}
