//! Authentication of a process towards the server, and of the server towards it.

use msgs::maes_msgs::{Join, JoinReply, Scenario};
use protocol::signed::{ForgedError, JoinRequest, Signed, Verified};
use protocol::signing::{self, Bytes, JoinContext, JoinSecret, NONE, SessionKey};

/// How a process authenticates itself.
#[derive(Debug, Clone)]
pub struct Credentials {
    /// The join secret; `None`: the server must have none.
    pub secret: Option<JoinSecret>,
    /// Random, and drawn anew by each process.
    pub nonce: Bytes,
    /// Starts of this process: more than 1 if it has begun again by itself.
    pub starts: u32,
}

/// The authentication of a process in one run.
pub(super) struct Authentication {
    credentials: Option<Credentials>,
    announcement: Bytes,
}

impl Authentication {
    pub(super) fn new(credentials: Option<Credentials>, scenario: &Scenario) -> Self {
        Self { credentials, announcement: signing::announcement(scenario) }
    }

    fn nonce(&self) -> Bytes {
        self.credentials.as_ref().map_or(NONE, |credentials| credentials.nonce)
    }

    fn secret(&self) -> Option<&JoinSecret> {
        self.credentials.as_ref().and_then(|credentials| credentials.secret.as_ref())
    }

    /// A join with its proof.
    pub(super) fn join(&self, join: Join, source: [u8; 16]) -> Signed<JoinRequest> {
        let starts = self.credentials.as_ref().map_or(0, |credentials| credentials.starts);
        let request = JoinRequest { join, nonce: self.nonce(), starts };
        let key = self.secret().map(|secret| secret.join_key(&self.announcement, &source));
        Signed::sign_with(request, key.as_ref())
    }

    /// The reply to a join, and the key that follows from it if messages are signed.
    ///
    /// # Errors
    /// If the reply lacks the proof of the server.
    pub(super) fn verify_reply(
        &self,
        reply: JoinReply,
        join: Join,
        source: [u8; 16],
    ) -> Result<(Verified<JoinReply>, Option<SessionKey>), ForgedError> {
        let reply = Signed::from(reply);
        let Some(secret) = self.secret() else {
            let reply = reply.trusted();
            let key = (reply.key != NONE).then(|| SessionKey::new(reply.key));
            return Ok((reply, key));
        };
        let join = self.join(join, source);
        let context = JoinContext { announcement: &self.announcement, source: &source, join: &join };
        let reply = reply.verify(&secret.reply_key(context))?;
        let key = (reply.nonce != NONE).then(|| secret.session_key(context, &reply.nonce));
        Ok((reply, key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::maes_msgs::SignedJoin;

    const SOURCE: [u8; 16] = [4; 16];

    fn authentication(secret: Option<&[u8]>) -> Authentication {
        let secret = secret.map(|text| JoinSecret::new(text).unwrap());
        Authentication::new(Some(Credentials { secret, nonce: [1; 32], starts: 1 }), &Scenario::default())
    }

    #[test]
    fn a_server_must_prove_the_secret() {
        let agent = authentication(Some(b"the secret of the run"));
        let secret = JoinSecret::new(b"the secret of the run").unwrap();
        let signed = agent.join(Join::default(), SOURCE);
        let context = JoinContext { announcement: &agent.announcement, source: &SOURCE, join: &signed };
        assert!(signed.clone().verify(&secret.join_key(&agent.announcement, &SOURCE)).is_ok());

        let reply = JoinReply { accepted: true, nonce: [7; 32], ..JoinReply::default() };
        let reply = JoinReply::from(Signed::sign(reply, &secret.reply_key(context)));
        let key = |reply: JoinReply| agent.verify_reply(reply, Join::default(), SOURCE).map(|(_, key)| key);
        assert_eq!(key(reply.clone()), Ok(Some(secret.session_key(context, &[7; 32]))));
        assert_eq!(key(JoinReply { accepted: false, ..reply.clone() }), Err(ForgedError));
        assert_eq!(key(JoinReply { nonce: NONE, ..reply.clone() }), Err(ForgedError));
        // A server without the secret cannot make the agent use a key that it sends.
        assert_eq!(key(JoinReply { key: [9; 32], proof: NONE, ..reply }), Err(ForgedError));
    }

    #[test]
    fn without_a_secret_the_key_is_in_the_reply() {
        let agent = authentication(None);
        let key = |key: Bytes| {
            let reply = JoinReply { key, accepted: true, ..JoinReply::default() };
            agent.verify_reply(reply, Join::default(), SOURCE).map(|(_, key)| key)
        };
        assert_eq!(key([3; 32]), Ok(Some(SessionKey::new([3; 32]))));
        assert_eq!(key(NONE), Ok(None));
        assert_eq!(SignedJoin::from(agent.join(Join::default(), SOURCE)).proof, NONE);
    }
}
