//! The package `geometry_msgs`: points, poses, velocities and transforms. Metres; right-handed, z
//! up.

use std::fmt;

use serde::de::{self, SeqAccess, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

include!(concat!(env!("OUT_DIR"), "/geometry_msgs.rs"));

/// Elements of a 6 x 6 matrix.
const COVARIANCE_LENGTH: usize = 36;

/// A covariance by rows: x, y, z, and the rotations about them. All zeros: exact, or not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covariance(pub [f64; COVARIANCE_LENGTH]);

impl Default for Covariance {
    fn default() -> Self {
        Covariance([0.0; COVARIANCE_LENGTH])
    }
}

/// On the wire it is the bare array. Serde itself knows arrays of up to 32 elements only.
impl Serialize for Covariance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut elements = serializer.serialize_tuple(COVARIANCE_LENGTH)?;
        self.0.iter().try_for_each(|element| elements.serialize_element(element))?;
        elements.end()
    }
}

impl<'de> Deserialize<'de> for Covariance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Elements;

        impl<'de> Visitor<'de> for Elements {
            type Value = Covariance;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(formatter, "{COVARIANCE_LENGTH} numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Covariance, A::Error> {
                let mut covariance = Covariance::default();
                for (at, element) in covariance.0.iter_mut().enumerate() {
                    *element = elements.next_element()?.ok_or_else(|| de::Error::invalid_length(at, &self))?;
                }
                Ok(covariance)
            }
        }

        deserializer.deserialize_tuple(COVARIANCE_LENGTH, Elements)
    }
}
