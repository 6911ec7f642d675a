//! Which ROS type each service is, and what a caller gets.
//!
//! A request or a response without fields has a hidden one in ROS 2: a byte that means nothing.
//! Types here that have no fields take a request with that byte and one without; there is no
//! response without fields.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A ROS service type.
pub trait Service {
    /// The package it belongs to.
    const PACKAGE: &'static str;
    /// Its name in the package.
    const NAME: &'static str;
    /// What is asked.
    type Request: Serialize + DeserializeOwned + Clone + 'static;
    /// What is answered.
    type Response: Serialize + DeserializeOwned + Clone + 'static;
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

/// Says of types that they are services: `Name { Request => Response }` of a package.
macro_rules! services {
    ($package:literal { $($(#[$doc:meta])* $name:ident: $request:ty => $response:ty;)* }) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug)]
            pub struct $name;

            impl $crate::service::Service for $name {
                const PACKAGE: &'static str = $package;
                const NAME: &'static str = stringify!($name);
                type Request = $request;
                type Response = $response;
            }
        )*
    };
}
pub(crate) use services;
