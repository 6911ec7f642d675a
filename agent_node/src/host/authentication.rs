//! Authentication of a process towards the server, and of the server towards it.

use msgs::maes_msgs::{Join, JoinReply, Scenario, SignedJoin};
use protocol::signing::{self, Bytes, JoinContext, JoinSecret, NONE, SessionKey, is_equal};

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
    pub(super) fn join(&self, join: Join, source: [u8; 16]) -> SignedJoin {
        let starts = self.credentials.as_ref().map_or(0, |credentials| credentials.starts);
        let mut signed = SignedJoin { join, nonce: self.nonce(), proof: NONE, starts };
        if let Some(secret) = self.secret() {
            let context = JoinContext { announcement: &self.announcement, source: &source, join: &signed };
            signed.proof = secret.prove_join(context);
        }
        signed
    }

    /// The key that follows from the reply to a join: `Some(None)` if messages are not signed.
    /// `None` if the reply lacks the proof of the server.
    pub(super) fn session_key(&self, reply: &JoinReply, join: Join, source: [u8; 16]) -> Option<Option<SessionKey>> {
        let Some(secret) = self.secret() else {
            return Some((reply.key != NONE).then(|| SessionKey::new(reply.key)));
        };
        let join = self.join(join, source);
        let context = JoinContext { announcement: &self.announcement, source: &source, join: &join };
        if !is_equal(&secret.prove_reply(context, reply), &reply.proof) {
            return None;
        }
        Some((reply.nonce != NONE).then(|| secret.session_key(context, &reply.nonce)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(signed.proof, secret.prove_join(context));

        let mut reply = JoinReply { accepted: true, nonce: [7; 32], ..JoinReply::default() };
        reply.proof = secret.prove_reply(context, &reply);
        let key = |reply: &JoinReply| agent.session_key(reply, Join::default(), SOURCE);
        assert_eq!(key(&reply), Some(Some(secret.session_key(context, &[7; 32]))));
        assert_eq!(key(&JoinReply { accepted: false, ..reply.clone() }), None);
        assert_eq!(key(&JoinReply { nonce: NONE, ..reply.clone() }), None);
        // A server without the secret cannot make the agent use a key that it sends.
        assert_eq!(key(&JoinReply { key: [9; 32], proof: NONE, ..reply }), None);
    }

    #[test]
    fn without_a_secret_the_key_is_in_the_reply() {
        let agent = authentication(None);
        let key = |key: Bytes| {
            agent.session_key(&JoinReply { key, accepted: true, ..JoinReply::default() }, Join::default(), SOURCE)
        };
        assert_eq!(key([3; 32]), Some(Some(SessionKey::new([3; 32]))));
        assert_eq!(key(NONE), Some(None));
        assert_eq!(agent.join(Join::default(), SOURCE).proof, NONE);
    }
}
