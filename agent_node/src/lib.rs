//! One agent: what it believes and what it decides.
//!
//! In reading order: [`observation`] and [`command`] are what it learns and what it answers, and [`body`] is what it can do;
//! [`exploration_map`] is what it believes of the world, [`path`] finds ways through that, [`regions`] does so in coarse, and [`travel`] makes motions of them, and [`sharing`] tells other agents of it; [`controllers`] decide;
//! [`agent`] puts these together; [`run`] does it for the agents of a process over a [`link`]; [`wire`] translates from and to
//! messages; [`belief_view`] shows people what an agent believes; `ros` is the link over ROS 2.
//!
//! This crate knows nothing of the true world: an agent has only what it sensed and what it was told.

#![warn(missing_docs)]

pub mod agent;
pub mod belief_view;
pub mod body;
pub mod cli;
pub mod command;
pub mod controllers;
pub mod exploration_map;
pub mod link;
pub mod observation;
pub mod parameters;
pub mod path;
pub mod regions;
#[cfg(feature = "ros")]
pub mod ros;
pub mod run;
pub mod sharing;
pub mod stopwatch;
pub mod travel;
pub mod wire;
