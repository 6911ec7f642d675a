//! The envelope of signed messages: [`Signed`] is what comes and goes, [`Verified`] what may be
//! used.
//!
//! A message with its signature can be routed by what it claims, and is of no other use before
//! [`Signed::verify`] has compared the signature. So the type of an argument says whether it is
//! authentic. The bytes on the wire are those of the messages `SignedJoin`, `SignedCommand`,
//! `SignedObservation` and `JoinReply`, from and to which the envelopes convert.
//!
//! ```
//! use msgs::maes_msgs::Command;
//! use protocol::signed::Signed;
//! use protocol::signing::SessionKey;
//!
//! let key = SessionKey::new([7; 32]);
//! let signed = Signed::sign(Command { tick: 3, ..Command::default() }, &key);
//! assert_eq!(signed.clone().verify(&key).unwrap().tick, 3);
//! assert!(signed.verify(&SessionKey::new([8; 32])).is_err());
//! ```

use std::ops::Deref;

use msgs::maes_msgs::{Command, Join, JoinReply, Observation, SignedCommand, SignedJoin, SignedObservation};
use thiserror::Error;

use crate::signing::{Bytes, NONE, Signs, is_equal};

/// A message whose signature is not that of the sender which it claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("a message is not signed by the sender that it claims")]
pub struct ForgedError;

/// A message with its signature, which may be forged or absent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Signed<T> {
    payload: T,
    signature: Bytes,
}

impl<T> Signed<T> {
    /// A message without a signature.
    #[must_use]
    pub fn unsigned(payload: impl Into<T>) -> Self {
        Self { payload: payload.into(), signature: NONE }
    }

    /// A message with the signature of a key.
    #[must_use]
    pub fn sign(payload: T, key: &impl Signs<T>) -> Self {
        let signature = key.signature(&payload);
        Self { payload, signature }
    }

    /// A message with the signature of a key, if there is one.
    #[must_use]
    pub fn sign_with(payload: T, key: Option<&impl Signs<T>>) -> Self {
        match key {
            Some(key) => Self::sign(payload, key),
            None => Self::unsigned(payload),
        }
    }

    /// The message, if it has the signature of a key.
    ///
    /// # Errors
    /// If it has another one, or none.
    pub fn verify(self, key: &impl Signs<T>) -> Result<Verified<T>, ForgedError> {
        match is_equal(&key.signature(&self.payload), &self.signature) {
            true => Ok(Verified(self.payload)),
            false => Err(ForgedError),
        }
    }

    /// The message, if it has the signature of a key; without a key, it is [trusted](Self::trusted).
    ///
    /// # Errors
    /// See [`Signed::verify`].
    pub fn verify_with(self, key: Option<&impl Signs<T>>) -> Result<Verified<T>, ForgedError> {
        match key {
            Some(key) => self.verify(key),
            None => Ok(self.trusted()),
        }
    }

    /// The message, whatever its signature: for messages of a private transport, of a recording,
    /// and of third-party nodes, which do not sign.
    #[must_use]
    pub fn trusted(self) -> Verified<T> {
        Verified(self.payload)
    }

    /// What the message claims to be: to route it, and to say why it is refused.
    #[must_use]
    pub fn claimed(&self) -> &T {
        &self.payload
    }
}

/// A message of the sender that it names.
#[derive(Clone, Debug, PartialEq)]
pub struct Verified<T>(T);

impl<T> Verified<T> {
    /// The message made of this one.
    #[must_use]
    pub fn map<U>(self, change: impl FnOnce(T) -> U) -> Verified<U> {
        Verified(change(self.0))
    }

    /// The message alone.
    #[must_use]
    pub fn into_inner(self) -> T {
        self.0
    }
}

impl<T> Deref for Verified<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

/// What a process states when it joins.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JoinRequest {
    /// The agent, and the process.
    pub join: Join,
    /// Random, drawn by the process; [`NONE`]: it does not sign its commands.
    pub nonce: Bytes,
    /// Starts of the process: more than 1 if its start stalled and it restarted itself; 0: unknown.
    pub starts: u32,
}

/// The join of a process that signs nothing.
impl From<Join> for JoinRequest {
    fn from(join: Join) -> Self {
        Self { join, ..Self::default() }
    }
}

impl From<SignedJoin> for Signed<JoinRequest> {
    fn from(SignedJoin { join, nonce, proof, starts }: SignedJoin) -> Self {
        Self { payload: JoinRequest { join, nonce, starts }, signature: proof }
    }
}

impl From<Signed<JoinRequest>> for SignedJoin {
    fn from(Signed { payload: JoinRequest { join, nonce, starts }, signature }: Signed<JoinRequest>) -> Self {
        Self { join, nonce, proof: signature, starts }
    }
}

impl From<SignedCommand> for Signed<Command> {
    fn from(SignedCommand { command, mac }: SignedCommand) -> Self {
        Self { payload: command, signature: mac }
    }
}

impl From<Signed<Command>> for SignedCommand {
    fn from(Signed { payload, signature }: Signed<Command>) -> Self {
        Self { command: payload, mac: signature }
    }
}

impl From<SignedObservation> for Signed<Observation> {
    fn from(SignedObservation { observation, mac }: SignedObservation) -> Self {
        Self { payload: observation, signature: mac }
    }
}

impl From<Signed<Observation>> for SignedObservation {
    fn from(Signed { payload, signature }: Signed<Observation>) -> Self {
        Self { observation: payload, mac: signature }
    }
}

/// A reply to a join has its signature among its fields.
impl From<JoinReply> for Signed<JoinReply> {
    fn from(mut reply: JoinReply) -> Self {
        let signature = std::mem::replace(&mut reply.proof, NONE);
        Self { payload: reply, signature }
    }
}

impl From<Signed<JoinReply>> for JoinReply {
    fn from(Signed { payload, signature }: Signed<JoinReply>) -> Self {
        Self { proof: signature, ..payload }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signing::SessionKey;

    #[test]
    fn only_the_key_that_signed_verifies() {
        let (key, other) = (SessionKey::new([1; 32]), SessionKey::new([2; 32]));
        let command = Command { run: 7, tick: 3, agent: 1, ..Command::default() };
        let signed = Signed::sign(command.clone(), &key);
        assert_eq!(signed.clone().verify(&key).map(Verified::into_inner), Ok(command.clone()));
        assert_eq!(signed.verify(&other), Err(ForgedError));
        let unsigned = Signed::<Command>::unsigned(command);
        assert_eq!(unsigned.clone().verify(&key), Err(ForgedError));
        assert_eq!(unsigned.trusted().tick, 3);
    }

    #[test]
    fn changed_messages_are_forged() {
        let key = SessionKey::new([1; 32]);
        let wire = SignedObservation::from(Signed::sign(Observation { tick: 3, ..Observation::default() }, &key));
        assert!(Signed::from(wire.clone()).verify(&key).is_ok());
        let mut later = wire.clone();
        later.observation.tick = 4;
        assert_eq!(Signed::from(later).verify(&key), Err(ForgedError));
        let mut guessed = wire;
        guessed.mac[31] ^= 1;
        assert_eq!(Signed::from(guessed).verify(&key), Err(ForgedError));
    }

    #[test]
    fn envelopes_are_what_is_on_the_wire() {
        let join = SignedJoin { join: Join::default(), nonce: [1; 32], proof: [2; 32], starts: 3 };
        assert_eq!(SignedJoin::from(Signed::from(join.clone())), join);
        let command = SignedCommand { command: Command { tick: 3, ..Command::default() }, mac: [4; 32] };
        assert_eq!(SignedCommand::from(Signed::from(command.clone())), command);
        let reply = JoinReply { accepted: true, nonce: [5; 32], proof: [6; 32], ..JoinReply::default() };
        let signed = Signed::from(reply.clone());
        assert_eq!(signed.claimed().proof, NONE, "it does not sign itself");
        assert_eq!(JoinReply::from(signed), reply);
    }
}
