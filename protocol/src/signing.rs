//! Message authentication: who has sent a join, a command or an observation.
//!
//! A run may have a join secret. A process proves that it knows the secret when it joins, the
//! server proves it in its reply, and both derive a session key from it that is never sent. Without
//! a secret the reply carries a random session key: that protects only against a sender who does
//! not read the topics. All values are keyed BLAKE3 hashes of the CDR encoding
//! of a message, which names run, agent and tick; `docs/topics.md` has the formulas. A key
//! [signs](Signs) messages of some types, and [`Signed`] carries the signature.
//!
//! Invariants: comparisons take the same time whatever the values; neither secret nor key is
//! printed. This module draws no random numbers and does no input or output.

use std::fmt;

use thiserror::Error;

use msgs::cdr;
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Scenario, SignedJoin};

use crate::signed::{JoinRequest, Signed};

/// A nonce, a proof or a message authentication code.
pub type Bytes = [u8; 32];

/// No nonce, no proof, no code.
pub const NONE: Bytes = [0; 32];

/// The name of the environment variable with the join secret.
pub const JOIN_SECRET: &str = "MAES_JOIN_SECRET";

/// Shortest join secret, bytes.
const SECRET_BYTES_MIN: usize = 16;

/// Longest join secret, bytes.
pub const SECRET_BYTES_MAX: usize = 4_096;

/// A join secret that is too short or too long.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("a join secret has {SECRET_BYTES_MIN} to {SECRET_BYTES_MAX} bytes without white space at its ends, not {0}")]
pub struct SecretLengthError(usize);

/// What all legitimate processes of a run know.
#[derive(Clone, PartialEq, Eq)]
pub struct JoinSecret(blake3::Hash);

impl fmt::Debug for JoinSecret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JoinSecret(..)")
    }
}

/// A key for messages of a type.
pub trait Signs<T> {
    /// The signature of a message under this key.
    fn signature(&self, message: &T) -> Bytes;
}

/// One side's view of a join: what the reply and the session key are bound to.
#[derive(Clone, Copy, Debug)]
pub struct JoinContext<'a> {
    /// The announcement of the run, [`announcement`].
    pub announcement: &'a Bytes,
    /// The process that joins, as the transport names it.
    pub source: &'a [u8; 16],
    /// The join as sent; its `last_tick` does not count.
    pub join: &'a Signed<JoinRequest>,
}

/// The key for the joins of a process.
#[derive(Clone, Copy, Debug)]
pub struct JoinKey<'a> {
    secret: &'a JoinSecret,
    announcement: &'a Bytes,
    source: &'a [u8; 16],
}

/// The key for the replies to a join.
#[derive(Clone, Copy, Debug)]
pub struct ReplyKey<'a> {
    secret: &'a JoinSecret,
    context: JoinContext<'a>,
}

/// The hash of the scenario as it was announced, with the number of the run.
#[must_use]
pub fn announcement(scenario: &Scenario) -> Bytes {
    *blake3::hash(&cdr::encode(scenario)).as_bytes()
}

impl JoinSecret {
    /// The secret of a text; white space at its ends does not count.
    ///
    /// # Errors
    /// If it is too short or too long.
    pub fn new(text: &[u8]) -> Result<Self, SecretLengthError> {
        let text = text.trim_ascii();
        if !(SECRET_BYTES_MIN..=SECRET_BYTES_MAX).contains(&text.len()) {
            return Err(SecretLengthError(text.len()));
        }
        Ok(Self(blake3::Hash::from_bytes(blake3::derive_key("maes 2026-11 join secret", text))))
    }

    /// The key for the joins of a process, as the transport names it, to an announced run.
    #[must_use]
    pub fn join_key<'a>(&'a self, announcement: &'a Bytes, source: &'a [u8; 16]) -> JoinKey<'a> {
        JoinKey { secret: self, announcement, source }
    }

    /// The key for the replies to a join.
    #[must_use]
    pub fn reply_key<'a>(&'a self, context: JoinContext<'a>) -> ReplyKey<'a> {
        ReplyKey { secret: self, context }
    }

    /// The key of a session, with the server's nonce.
    #[must_use]
    pub fn session_key(&self, context: JoinContext<'_>, nonce: &Bytes) -> SessionKey {
        let JoinContext { announcement, source, join } = context;
        SessionKey::new(self.hash(b"session", announcement, source, join.clone().into(), nonce))
    }

    fn hash(
        &self,
        purpose: &[u8],
        announcement: &Bytes,
        source: &[u8; 16],
        mut join: SignedJoin,
        rest: &[u8],
    ) -> Bytes {
        // A repeated join may name a later tick, and belongs to the same session.
        join.join.last_tick = Join::NONE;
        let join = cdr::encode(&join);
        keyed(self.0.as_bytes(), purpose, &[announcement, source, &(join.len() as u64).to_le_bytes(), &join, rest])
    }
}

/// The proof of a join; its `last_tick` does not count.
impl Signs<JoinRequest> for JoinKey<'_> {
    fn signature(&self, request: &JoinRequest) -> Bytes {
        let Self { secret, announcement, source } = self;
        let unproven = SignedJoin::from(Signed::<JoinRequest>::unsigned(request.clone()));
        secret.hash(b"join", announcement, source, unproven, &[])
    }
}

/// The proof of the reply to a join.
impl Signs<JoinReply> for ReplyKey<'_> {
    fn signature(&self, reply: &JoinReply) -> Bytes {
        let JoinContext { announcement, source, join } = self.context;
        let unproven = JoinReply::from(Signed::<JoinReply>::unsigned(reply.clone()));
        self.secret.hash(b"reply", announcement, source, join.clone().into(), &cdr::encode(&unproven))
    }
}

/// The key of one process for one agent in one run.
#[derive(Clone, PartialEq, Eq)]
pub struct SessionKey(blake3::Hash);

impl fmt::Debug for SessionKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SessionKey(..)")
    }
}

impl SessionKey {
    /// A key of these bytes.
    #[must_use]
    pub fn new(bytes: Bytes) -> Self {
        Self(blake3::Hash::from_bytes(bytes))
    }

    /// Another value from this key.
    #[must_use]
    pub fn derive(&self, purpose: &[u8], parts: &[&[u8]]) -> Bytes {
        keyed(self.0.as_bytes(), purpose, parts)
    }
}

/// The message authentication code of a command.
impl Signs<Command> for SessionKey {
    fn signature(&self, command: &Command) -> Bytes {
        self.derive(b"command", &[&cdr::encode(command)])
    }
}

/// The message authentication code of a fragment of an observation.
impl Signs<Observation> for SessionKey {
    fn signature(&self, fragment: &Observation) -> Bytes {
        self.derive(b"observation", &[&cdr::encode(fragment)])
    }
}

/// Whether two values are equal, in constant time.
#[must_use]
pub fn is_equal(one: &Bytes, other: &Bytes) -> bool {
    blake3::Hash::from_bytes(*one) == blake3::Hash::from_bytes(*other)
}

/// The keyed hash of a purpose and parts; all parts but the last have a fixed length, or their
/// length before them.
fn keyed(key: &Bytes, purpose: &[u8], parts: &[&[u8]]) -> Bytes {
    let mut hasher = blake3::Hasher::new_keyed(key);
    hasher.update(&(purpose.len() as u64).to_le_bytes()).update(purpose);
    for part in parts {
        hasher.update(part);
    }
    *hasher.finalize().as_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn secret() -> JoinSecret {
        JoinSecret::new(b" a secret of the test\n").unwrap()
    }

    #[test]
    fn secrets_have_a_length() {
        assert_eq!(secret(), JoinSecret::new(b"a secret of the test").unwrap());
        assert_eq!(JoinSecret::new(b"short           "), Err(SecretLengthError(5)));
        assert!(JoinSecret::new(&[b'x'; SECRET_BYTES_MAX + 1]).is_err());
        assert_eq!(format!("{:?} {:?}", secret(), SessionKey::new([7; 32])), "JoinSecret(..) SessionKey(..)");
    }

    #[test]
    fn proofs_and_keys_are_bound_to_everything_that_was_said() {
        let join =
            SignedJoin { join: Join { run: 7, agent: 1, ..Join::default() }, nonce: [1; 32], proof: NONE, starts: 1 };
        let (ours, source) = (announcement(&Scenario { run: 7, ..Scenario::default() }), [3; 16]);
        let values = |secret: &JoinSecret, announcement: &Bytes, source: &[u8; 16], join: &SignedJoin| {
            let join = Signed::from(join.clone());
            let context = JoinContext { announcement, source, join: &join };
            let proof = secret.join_key(announcement, source).signature(join.claimed());
            let reply = secret.reply_key(context).signature(&JoinReply::default());
            [proof, reply, secret.session_key(context, &[2; 32]).derive(b"", &[])]
        };
        let first = values(&secret(), &ours, &source, &join);
        let later = SignedJoin { join: Join { last_tick: 9, ..join.join.clone() }, ..join.clone() };
        assert_eq!(values(&secret(), &ours, &source, &later), first);
        // So that the refusal of a join with a false proof is no refusal of the true one.
        let [proof, reply, key] = values(&secret(), &ours, &source, &SignedJoin { proof: [9; 32], ..join.clone() });
        assert_eq!(proof, first[0]);
        assert!(reply != first[1] && key != first[2]);
        let other_join = SignedJoin { nonce: [8; 32], ..join.clone() };
        let other_start = SignedJoin { starts: 2, ..join.clone() };
        let other_run = SignedJoin { join: Join { run: 8, ..join.join.clone() }, ..join.clone() };
        let others = [
            values(&JoinSecret::new(b"another secret of the test").unwrap(), &ours, &source, &join),
            values(&secret(), &[0; 32], &source, &join),
            values(&secret(), &ours, &[4; 16], &join),
            values(&secret(), &ours, &source, &other_join),
            values(&secret(), &ours, &source, &other_start),
            values(&secret(), &ours, &source, &other_run),
        ];
        for other in others {
            for value in other {
                assert!(!first.iter().any(|first| is_equal(first, &value)));
            }
        }
        let join = Signed::from(join);
        let context = JoinContext { announcement: &ours, source: &source, join: &join };
        let accepted = JoinReply { accepted: true, ..JoinReply::default() };
        assert_ne!(secret().reply_key(context).signature(&accepted), first[1]);
        assert_ne!(secret().session_key(context, &[5; 32]).derive(b"", &[]), first[2]);
    }

    #[test]
    fn codes_are_bound_to_key_message_and_direction() {
        let (key, other) = (SessionKey::new([1; 32]), SessionKey::new([2; 32]));
        let command = Command { run: 7, tick: 3, agent: 1, ..Command::default() };
        let code = key.signature(&command);
        assert_eq!(code, key.signature(&command.clone()));
        assert_ne!(code, other.signature(&command));
        for changed in [
            Command { run: 8, ..command.clone() },
            Command { tick: 4, ..command.clone() },
            Command { agent: 2, ..command.clone() },
            Command { want_view: true, ..command.clone() },
        ] {
            assert_ne!(code, key.signature(&changed), "{changed:?}");
        }
        let fragment = Observation { run: 7, tick: 3, agent: 1, ..Observation::default() };
        assert_ne!(key.signature(&fragment), key.signature(&Observation { part: 1, ..fragment.clone() }));
        let bytes = cdr::encode(&fragment);
        assert_ne!(key.derive(b"command", &[&bytes]), key.derive(b"observation", &[&bytes]));
    }
}
