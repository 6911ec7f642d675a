use super::*;

#[test]
fn a_mean_is_in_the_middle() {
    assert_eq!(mean(&[1.0, 2.0, 6.0]), Ok(3.0));
}
