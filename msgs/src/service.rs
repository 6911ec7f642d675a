//! Which ROS type each service and action is, and what a caller gets.
//!
//! The build script makes the types of the `.srv` and `.action` files under `src/standard`.
//!
//! A request or a response without fields has a hidden one in ROS 2: a byte that means nothing.
//! Types here that have no fields take a request with that byte and one without; there is no
//! response without fields.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Longest answer of a service, bytes. A longer one is sent in parts, and RustDDS 0.15.1 writes the
/// parameters of such a part, which say whose answer it is, with the tag of an `Option` before
/// them: others drop it, and the caller would wait for ever.
pub const ANSWER_BYTES_MAX: usize = 1_200;

/// A ROS service type.
pub trait Service {
    /// The package it belongs to.
    const PACKAGE: &'static str;
    /// Its name in the package.
    const NAME: &'static str;
    /// Its definition: the text of its `.srv` file.
    const DEFINITION: &'static str;
    /// What is asked.
    type Request: Serialize + DeserializeOwned + Clone + 'static;
    /// What is answered.
    type Response: Serialize + DeserializeOwned + Clone + 'static;
}

/// A ROS action type.
pub trait Action {
    /// The package it belongs to.
    const PACKAGE: &'static str;
    /// Its name in the package.
    const NAME: &'static str;
    /// Its definition: the text of its `.action` file.
    const DEFINITION: &'static str;
    /// What is to be done.
    type Goal: Serialize + DeserializeOwned + Clone + 'static;
    /// What has become of it.
    type Result: Serialize + DeserializeOwned + Clone + 'static;
    /// How far it has come.
    type Feedback: Serialize + DeserializeOwned + Clone + 'static;
}

/// The way back to the caller. It never waits; an answer to a caller that has gone is lost.
pub struct Reply<R>(Box<dyn FnOnce(R)>);

impl<R> Reply<R> {
    /// A way back.
    pub fn new(send: impl FnOnce(R) + 'static) -> Self {
        Reply(Box::new(send))
    }

    /// Answers.
    pub fn send(self, response: R) {
        (self.0)(response);
    }
}

impl<R> std::fmt::Debug for Reply<R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Reply")
    }
}

/// A request with the way back.
pub struct Ask<S: Service> {
    /// What is asked.
    pub request: S::Request,
    /// Where the answer goes.
    pub reply: Reply<S::Response>,
}

impl<S: Service> Ask<S> {
    /// Answers what `answer` makes of the request.
    pub fn answer(self, answer: impl FnOnce(S::Request) -> S::Response) {
        self.reply.send(answer(self.request));
    }
}
