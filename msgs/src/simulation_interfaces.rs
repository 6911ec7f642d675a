//! The part of the package `simulation_interfaces` that the server speaks: how simulators are
//! controlled by the standard.
//!
//! What is here is the same in the lines 1 and 2 of the package, with two exceptions: version 2
//! says in `SetEntityState` what is to be set, and a request of version 1, which does not, is
//! understood as well; of `SpawnEntity` only layout and codes are the same.

use std::fmt;

use serde::de::{SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer};

include!(concat!(env!("OUT_DIR"), "/simulation_interfaces.rs"));

impl Result {
    /// All is well.
    #[must_use]
    pub fn ok() -> Self {
        Result { result: Self::RESULT_OK, error_message: String::new() }
    }

    /// It is not.
    #[must_use]
    pub fn failure(code: u8, message: impl Into<String>) -> Self {
        Result { result: code, error_message: message.into() }
    }

    /// Whether all is well.
    #[must_use]
    pub fn is_ok(&self) -> bool {
        self.result == Self::RESULT_OK
    }
}

impl<'de> Deserialize<'de> for SetEntityStateRequest {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        const FIELDS: &[&str] = &["entity", "state", "set_pose", "set_twist", "set_acceleration"];
        deserializer.deserialize_struct("SetEntityStateRequest", FIELDS, OfEitherVersion)
    }
}

/// Reads a request of version 2, or one of version 1, which ends with the state: then the pose is
/// to be set.
struct OfEitherVersion;

impl<'de> Visitor<'de> for OfEitherVersion {
    type Value = SetEntityStateRequest;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a request to set the state of an entity")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut fields: A) -> std::result::Result<Self::Value, A::Error> {
        let missing = |field| serde::de::Error::missing_field(field);
        let entity = fields.next_element()?.ok_or_else(|| missing("entity"))?;
        let state = fields.next_element()?.ok_or_else(|| missing("state"))?;
        let (mut set_pose, mut set_twist, mut set_acceleration) = (true, false, false);
        // Any byte is a number, so what fails is that there is none.
        if let Ok(Some(flag)) = fields.next_element::<u8>() {
            let no_flag = || serde::de::Error::invalid_value(Unexpected::Unsigned(flag.into()), &"0 or 1");
            set_pose = [false, true].get(usize::from(flag)).copied().ok_or_else(no_flag)?;
            set_twist = fields.next_element()?.ok_or_else(|| missing("set_twist"))?;
            set_acceleration = fields.next_element()?.ok_or_else(|| missing("set_acceleration"))?;
        }
        Ok(SetEntityStateRequest { entity, state, set_pose, set_twist, set_acceleration })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cdr;

    #[test]
    fn a_request_of_either_version_to_set_a_state_is_understood() {
        let request = SetEntityStateRequest {
            entity: "agent_1".to_owned(),
            state: EntityState::default(),
            set_pose: false,
            set_twist: true,
            set_acceleration: false,
        };
        let bytes = cdr::encode(&request);
        assert_eq!(cdr::decode::<SetEntityStateRequest>(&bytes).unwrap(), request);
        let old: SetEntityStateRequest = cdr::decode(&bytes[..bytes.len() - 3]).unwrap();
        assert_eq!((old.set_pose, old.set_twist, &old.state), (true, false, &request.state));
        assert!(cdr::decode::<SetEntityStateRequest>(&bytes[..bytes.len() - 20]).is_err());
        for flags in [[7, 0, 0], [0, 7, 0], [0, 0, 7]] {
            let broken = [&bytes[..bytes.len() - 3], &flags].concat();
            assert!(cdr::decode::<SetEntityStateRequest>(&broken).is_err());
        }
    }

    #[test]
    fn a_request_without_fields_may_have_the_hidden_one() {
        for bytes in [&[0, 1, 0, 0][..], &[0, 1, 0, 0, 0], &[0, 1, 0, 0, 9]] {
            assert!(cdr::decode::<GetSimulationStateRequest>(bytes).is_ok());
        }
    }
}
