//! Services: a request is a query with the request as its payload, and the answer its reply.
//!
//! Invariants: at most [`QUEUE_DEPTH`] requests of a service wait; a request without a whole
//! message and attachment is an error without an answer.

use std::marker::PhantomData;
use std::sync::Arc;
use std::task::{Context, Poll};

use ::zenoh::Wait;
use ::zenoh::liveliness::LivelinessToken;
use ::zenoh::query::{Query, Queryable};
use msgs::cdr;
use msgs::service::{Reply, Service};
use msgs::topics::Qos;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::attachment::Attachment;
use super::names::{Endpoint, EndpointKind};
use super::queue::Queue;
use super::topics::decoded;
use super::{Node, endpoint_error};
use crate::services::QUEUE_DEPTH;
use crate::{RosError, type_hash};

/// The server of a service with requests `Q` and answers `R`.
pub(crate) struct Server<Q, R> {
    queue: Arc<Queue<Query>>,
    name: String,
    key: String,
    _queryable: Queryable<()>,
    _token: LivelinessToken,
    of: PhantomData<fn(Q) -> R>,
}

impl Node {
    /// Offers a service.
    pub(crate) fn server<S: Service>(&self, name: &str) -> Result<Server<S::Request, S::Response>, RosError> {
        let type_name = format!("{}::srv::dds_::{}_", S::PACKAGE, S::NAME);
        self.server_of(name, type_name, type_hash::of_service(S::PACKAGE, S::NAME, S::DEFINITION))
    }

    /// Offers a service of a type, by its name in DDS.
    pub(crate) fn server_of<Q: DeserializeOwned, R: Serialize + 'static>(
        &self,
        name: &str,
        type_name: String,
        type_hash: String,
    ) -> Result<Server<Q, R>, RosError> {
        let endpoint = Endpoint { name: name.to_owned(), type_name, type_hash, qos: Qos::reliable(QUEUE_DEPTH) };
        let key = endpoint.key(self.names.domain_id);
        let queue = Arc::new(Queue::new(QUEUE_DEPTH));
        let received = Arc::clone(&queue);
        let declare = || {
            let queryable = self
                .session
                .0
                .session
                .declare_queryable(key.clone())
                .complete(true)
                .callback(move |query| received.push(query))
                .wait()?;
            let (_, token) = self.announce(EndpointKind::ServiceServer, &endpoint)?;
            Ok((queryable, token))
        };
        let (queryable, token) =
            declare().map_err(|error: ::zenoh::Error| endpoint_error(&endpoint.to_string(), &error))?;
        Ok(Server { queue, name: name.to_owned(), key, _queryable: queryable, _token: token, of: PhantomData })
    }
}

impl<Q: DeserializeOwned, R: Serialize + 'static> Server<Q, R> {
    /// The next request with the way back, or registers the waker.
    pub(crate) fn take(&self, context: &Context<'_>) -> Poll<Result<(Q, Reply<R>), String>> {
        self.queue.take(context).map(|query| self.request(query))
    }

    fn request(&self, query: Query) -> Result<(Q, Reply<R>), String> {
        let attachment = query.attachment().and_then(|bytes| Attachment::from_bytes(&bytes.to_bytes()));
        let Attachment { sequence, gid, .. } =
            attachment.ok_or_else(|| format!("{}: a request without the attachment of rmw_zenoh", self.name))?;
        let payload = query.payload().ok_or_else(|| format!("{}: a request without a message", self.name))?;
        let request = decoded(payload)?;
        let key = self.key.clone();
        let reply = Reply::new(move |response| {
            let attachment = Attachment::now(sequence, gid).to_bytes();
            let answer = query.reply(key, cdr::encode(&response)).attachment(&attachment[..]);
            // The caller has gone.
            let _ = answer.wait();
        });
        Ok((request, reply))
    }
}
