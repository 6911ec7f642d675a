//! The bytes of a real ROS 2 against ours. `make_fixtures.py` has written them, with rclpy and Fast
//! DDS.

use std::collections::BTreeSet;
use std::fmt::Debug;

use msgs::cdr;
use msgs::message::Message;

use crate::cases;
use crate::sample::sample;

/// How the message of a fixture was filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Way {
    /// As it is created.
    Default,
    /// Another value in every field.
    Sample,
}

/// Decodes the bytes, compares the message with the same one made here, and encodes it again.
pub(crate) fn compare<M: Message + Default + PartialEq + Debug>(way: Way, bytes: &[u8]) {
    let expected = match way {
        Way::Default => M::default(),
        Way::Sample => sample::<M>(),
    };
    let decoded: M = cdr::decode(bytes).unwrap();
    assert_eq!(decoded, expected, "{} {way:?}", M::TYPE);
    assert_eq!(cdr::encode(&decoded), bytes, "{} {way:?}", M::TYPE);
}

fn fixtures() -> impl Iterator<Item = (&'static str, Way, Vec<u8>)> {
    include_str!("fixtures/cdr.txt").lines().map(|line| {
        let [name, way, digits] = line.split(' ').collect::<Vec<_>>()[..] else { panic!("not three words: {line}") };
        let way = match way {
            "default" => Way::Default,
            "sample" => Way::Sample,
            _ => panic!("neither default nor sample: {line}"),
        };
        let byte = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).unwrap();
        (name, way, (0..digits.len()).step_by(2).map(byte).collect())
    })
}

#[test]
fn bytes_are_those_of_ros() {
    let mut seen = BTreeSet::new();
    for (name, way, bytes) in fixtures() {
        let cases = cases();
        let case = cases.iter().find(|case| case.name() == name).unwrap_or_else(|| panic!("unknown type {name}"));
        (case.compare)(way, &bytes);
        seen.insert((case.name(), way));
    }
    for case in cases() {
        for way in [Way::Default, Way::Sample] {
            assert!(seen.contains(&(case.name(), way)), "no fixture: {} {way:?}; run make_fixtures.py", case.name());
        }
    }
}

#[test]
fn what_breaks_off_is_an_error() {
    for (name, way, bytes) in fixtures().filter(|(_, way, _)| *way == Way::Sample) {
        assert!(cdr::decode::<msgs::maes_msgs::Observation>(&bytes[..bytes.len().min(40)]).is_err(), "{name} {way:?}");
    }
    let (_, _, observation) =
        fixtures().find(|(name, way, _)| (*name, *way) == ("maes_msgs/Observation", Way::Sample)).unwrap();
    for length in 0..observation.len() {
        assert!(cdr::decode::<msgs::maes_msgs::Observation>(&observation[..length]).is_err(), "{length}");
    }
}
