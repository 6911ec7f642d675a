//! Joins of any version of the protocol.
//!
//! Before version 4 a join had neither a nonce nor a proof, and before version 5 no number of
//! starts. A process of an earlier version gets a
//! refusal that names both versions, and not silence.

use msgs::maes_msgs::{Join, SignedJoin};
use msgs::message::{Message, MessageType};
use protocol::signing::{Bytes, NONE};
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A join; what the bytes end before is zero.
pub(super) struct JoinOfAnyVersion(pub(super) SignedJoin);

impl Message for JoinOfAnyVersion {
    const TYPE: MessageType = SignedJoin::TYPE;
}

impl Serialize for JoinOfAnyVersion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for JoinOfAnyVersion {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Fields;

        impl<'de> Visitor<'de> for Fields {
            type Value = SignedJoin;

            fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.write_str("a join")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut fields: A) -> Result<SignedJoin, A::Error> {
                let join: Join = fields.next_element()?.ok_or_else(|| A::Error::invalid_length(0, &self))?;
                let mut bytes = || fields.next_element::<Bytes>().ok().flatten().unwrap_or(NONE);
                let (nonce, proof) = (bytes(), bytes());
                let starts = fields.next_element().ok().flatten().unwrap_or(0);
                Ok(SignedJoin { join, nonce, proof, starts })
            }
        }

        deserializer.deserialize_tuple(4, Fields).map(Self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::cdr;

    #[test]
    fn joins_of_earlier_versions_are_read() {
        let join = Join { run: 7, agent: 1, protocol: 3, controller: "rbw".to_owned(), ..Join::default() };
        let signed = SignedJoin { join: join.clone(), nonce: [1; 32], proof: [2; 32], starts: 2 };
        let decoded = |bytes: &[u8]| cdr::decode::<JoinOfAnyVersion>(bytes).map(|join| join.0);
        assert_eq!(decoded(&cdr::encode(&signed)).unwrap(), signed);
        let earlier = SignedJoin { join: join.clone(), ..SignedJoin::default() };
        assert_eq!(decoded(&cdr::encode(&join)).unwrap(), earlier);
        assert!(decoded(&cdr::encode(&join)[..20]).is_err());
    }
}
