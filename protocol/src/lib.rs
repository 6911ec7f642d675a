//! What the world server and the agents say to each other: domain types, their conversions to and
//! from messages, bounds, signatures and membership.
//!
//! In reading order: [`observation`] and [`command`] are what is exchanged in a tick, made of
//! [`motion`], [`scan_request`], [`agent_message`], [`wake_condition`] and [`stage`]; [`run_info`]
//! is what agents are told of a run, with the bodies of the team ([`body_model`], [`kinematics`]);
//! [`energy`] is what a body holds and draws; [`lockstep`] is the protocol of the server,
//! [`signed`] is the envelope of messages that the keys of [`signing`] authenticate, [`map_views`]
//! shows maps to others, and [`limits`] has all bounds.
//!
//! Invariants: what a conversion from a message returns is legal, whatever was received; both
//! directions of a conversion stand in one file. There is no transport, no ROS client and no clock
//! in here; the structs of the messages are in [`msgs`].
//!
//! ```
//! use msgs::ids::{AgentId, Tick};
//! use protocol::command::{Command, Motion, WakeCondition};
//!
//! let command = Command::new(Motion::straight(0.0, 2.0), WakeCondition::TASK_DONE);
//! let message = command.clone().into_message(AgentId(0), Tick(7));
//! assert_eq!(Command::from_message(&message, 1), Ok(command));
//! ```

#![warn(missing_docs)]

pub mod agent_message;
pub mod body_model;
pub mod command;
pub mod energy;
pub mod event_mask;
pub mod field_of_view;
pub mod geometry;
pub mod kinematics;
pub mod limits;
pub mod lockstep;
pub mod map_frame;
pub mod map_views;
pub mod message_type;
pub mod motion;
pub mod observation;
pub mod relay_id;
pub mod run_info;
pub mod scan_request;
mod server_message;
pub mod signed;
pub mod signing;
pub mod stage;
pub mod wake_condition;
pub mod wire_error;
