//! Nobody: takes part in a run that is checked, and is told of a run that nobody looks at.

use std::time::Duration;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{JoinReply, Observation, Progress, Scenario};

use super::Watcher;
use crate::link::{Incoming, Link};
use simulation::world::World;

/// Says nothing and hears nothing.
#[derive(Debug, Clone, Copy)]
pub struct Nobody;

impl Link for Nobody {
    fn announce(&mut self, _scenario: &Scenario) {}
    fn reply_join(&mut self, _reply: &JoinReply) {}
    fn send(&mut self, _agent: AgentId, _part: &Observation) {}
    fn clock(&mut self, _tick: Tick) {}
    fn progress(&mut self, _progress: &Progress) {}
    fn receive(&mut self, _timeout: Duration) -> Option<Incoming> {
        None
    }
}

impl Watcher for Nobody {
    fn waiting(&mut self, _missing: &[AgentId]) {}
    fn started(&mut self) {}
    fn progress(&mut self, _world: &World) {}
    fn note(&mut self, _text: &str) {}
}
