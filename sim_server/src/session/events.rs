//! The events of a scenario, executed at their ticks: live, and in the same way when a run is
//! re-executed.
//!
//! An event takes effect at the start of its tick, after the state of that tick was recorded and
//! before interventions and scans. It enters the digest there, so that a run and its fork are the
//! same up to that tick.
//!
//! Invariants: an event is executed once; an agent receives a change in the first observation
//! that it commits to afterwards; an agent that is out is never asked again.

use msgs::cdr;
use msgs::ids::AgentId;
use msgs::maes_msgs::Observation as Fragment;
use msgs::shared_bytes::SharedBytes;
use msgs::trigger::Trigger;

use super::{RunError, SHUTDOWN_TIMEOUT, Session};
use simulation::scenario::{EventAction, Scenario, ScheduledEvent};
use simulation::wire;
use simulation::world::{Commit, Presence};

impl Session<'_, '_> {
    /// Executes the events of the present tick.
    pub(super) fn apply_events(&mut self) -> Result<(), RunError> {
        let tick = self.engine.tick();
        while self.engine.schedule.front().is_some_and(|event| event.tick <= tick)
            && let Some(ScheduledEvent { digested, action, .. }) = self.engine.schedule.pop_front()
        {
            self.engine.chain.message(digested.as_bytes());
            match action {
                EventAction::Join(agent) => drop(self.engine.joining.insert(agent)),
                EventAction::Leave(agent) => {
                    self.retire(agent)?;
                    self.engine.world.leave(agent);
                }
                EventAction::BreakDown(agent) => {
                    self.retire(agent)?;
                    self.engine.world.break_down(agent);
                }
                EventAction::SwitchRadio(agent, is_on) => self.engine.world.switch_radio(agent, is_on),
                EventAction::Set(scenario) => self.change(*scenario),
            }
        }
        let world = &mut self.engine.world;
        self.engine.joining.retain(|&agent| !world.join(agent));
        Ok(())
    }

    /// Takes an agent out of the run.
    fn retire(&mut self, agent: AgentId) -> Result<(), RunError> {
        self.engine.joining.remove(&agent);
        self.engine.retired.insert(agent);
        if self.engine.lost.contains(&agent) {
            return Ok(());
        }
        if self.playback.is_none() {
            self.dismiss(agent)?;
        } else {
            self.engine.request(agent, Commit::Speculative, Fragment::ENDED);
        }
        self.engine.lost.insert(agent);
        Ok(())
    }

    /// Sends an agent the shutdown message during the run. The observation stays pending, so that
    /// the end of the recording holds what was never committed.
    pub(super) fn dismiss(&mut self, agent: AgentId) -> Result<(), RunError> {
        let last = [self.engine.request(agent, Commit::Speculative, Fragment::ENDED)];
        let tick = self.engine.tick();
        let (sessions, mut context) = self.waiting();
        sessions.shut_down(tick, &last, SHUTDOWN_TIMEOUT, &mut context)
    }

    /// Lets another scenario hold from now on. The agents receive it; those whose controller or its
    /// settings change hand over their bodies and LiDARs, and are due.
    fn change(&mut self, scenario: Scenario) {
        let engine = &mut self.engine;
        let before = engine.scenario();
        let choices = before.agents.controllers().into_iter().zip(scenario.agents.controllers());
        let takes_over: Vec<bool> = choices.map(|(old, new)| old != new).collect();
        let has_other_radio = before.communication != scenario.communication;
        let extent = engine.world.terrain().extent();
        let announcement = wire::scenario(&scenario, &extent, engine.world.rays());
        let is_news = announcement != wire::scenario(before, &extent, engine.world.rays());
        if has_other_radio {
            engine.world.set_radios(scenario.communication.comms(scenario.seed));
        }
        let data = SharedBytes::from(cdr::encode(&announcement));
        for agent in
            engine.world.agents().filter(|agent| !engine.lost.contains(agent) && !self.external.contains(agent))
        {
            if is_news {
                engine.world.tell(agent, data.clone());
            }
            if takes_over[agent.index()] && engine.world.presence(agent) == Presence::Active {
                engine.world.hand_over(agent);
                engine.triggers[agent.index()] = Trigger::NEXT_TICK;
            }
        }
        engine.changed.push(scenario);
    }
}
