//! Which ROS type each service is, and what a caller gets.
//!
//! The definitions are the interface files under `src/standard`, taken in at build time. [`TYPES`]
//! has the types that they refer to and no topic carries.
//!
//! A request or a response without fields has a hidden one in ROS 2: a byte that means nothing.
//! Types here that have no fields take a request with that byte and one without; there is no
//! response without fields.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::message::MessageType;

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
                const DEFINITION: &'static str =
                    include_str!(concat!("standard/", $package, "/srv/", stringify!($name), ".srv"));
                type Request = $request;
                type Response = $response;
            }
        )*
    };
}
pub(crate) use services;

/// The definition of the service that cancels goals of actions, `action_msgs/srv/CancelGoal`.
pub const CANCEL_GOAL: &str = include_str!("standard/action_msgs/srv/CancelGoal.srv");

/// The definition of the action that makes steps: its goal, its result, and its feedback.
pub const SIMULATE_STEPS: &str = include_str!("standard/simulation_interfaces/action/SimulateSteps.action");

/// The type of the status of the goals of an action.
pub const GOAL_STATUS_ARRAY: MessageType = MessageType {
    package: "action_msgs",
    name: "GoalStatusArray",
    definition: include_str!("standard/action_msgs/GoalStatusArray.msg"),
};

macro_rules! types {
    ($($folder:literal: $package:ident { $($name:ident)* })*) => {
        /// The types that the definitions of services and actions refer to and that are not in
        /// [`ALL`](crate::message::ALL), by package and name.
        pub const TYPES: &[MessageType] = &[$($(MessageType {
            package: stringify!($package),
            name: stringify!($name),
            definition: include_str!(concat!("standard/", $folder, stringify!($name), ".msg")),
        },)*)*];
    };
}

types! {
    "action_msgs/": action_msgs { GoalInfo GoalStatus }
    "geometry_msgs/": geometry_msgs { Accel }
    "rcl_interfaces/": rcl_interfaces {
        FloatingPointRange IntegerRange ListParametersResult Parameter ParameterDescriptor ParameterValue
        SetParametersResult
    }
    "service_msgs/": service_msgs { ServiceEventInfo }
    "simulation_interfaces/msg/": simulation_interfaces {
        Bounds EntityCategory EntityFilters EntityInfo EntityState Resource Result SimulationState SimulatorFeatures
        TagsFilter
    }
    "unique_identifier_msgs/": unique_identifier_msgs { UUID }
}
