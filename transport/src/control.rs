//! Simulation control as `simulation_interfaces` defines it: requests, states and steps.
//!
//! [`StateMachine`] holds the states, their transitions and pending steps, and decides before each
//! tick whether it may run. [`SimulationControl`] answers the requests about time alone, for runs
//! and replays.
//!
//! Invariants: time passes only in `PLAYING`; after the last requested step the state is `PAUSED`;
//! a refused request changes nothing.
//!
//! | from, to | `STOPPED` | `PLAYING` | `PAUSED` | `QUITTING` |
//! |---|---|---|---|---|
//! | `STOPPED` | 101 | yes | yes | yes |
//! | `PLAYING` | reset | 101 | yes; ends pending steps | yes |
//! | `PAUSED` | reset | yes | 101 | yes |
//! | `QUITTING` | 103 | 103 | 103 | 101 |
//!
//! A simulation without reset, such as a replay, answers that it is unsupported.
//!
//! This module knows no transport and no clock, and changes no world: the run loop does.

mod pacer;
mod simulation_control;

use std::fmt;

use msgs::maes_msgs::ChangeMap;
use msgs::service::Ask;
use msgs::simulation_interfaces::{
    DeleteEntity, GetEntities, GetEntitiesStates, GetEntityBounds, GetEntityInfo, GetEntityState, GetSimulationState,
    GetSimulatorFeatures, ResetSimulation, ResetSimulationRequest, Result as Outcome, SetEntityState,
    SetSimulationState, SetSimulationStateResponse, SimulationState, SimulatorFeatures, SpawnEntity, StepSimulation,
};

use simulation::scenario::Rtf;

pub use simulation_control::SimulationControl;

/// A request with its reply channel.
pub enum Request {
    Features(Ask<GetSimulatorFeatures>),
    State(Ask<GetSimulationState>),
    SetState(Ask<SetSimulationState>),
    /// Simulate steps; the reply follows the last one.
    Step(Ask<StepSimulation>),
    /// Simulate steps with feedback after each (the action).
    Steps(Box<dyn Steps>),
    /// Cancel the steps of the action.
    CancelSteps,
    Reset(Ask<ResetSimulation>),
    Entities(Ask<GetEntities>),
    EntityState(Ask<GetEntityState>),
    EntitiesStates(Ask<GetEntitiesStates>),
    EntityInfo(Ask<GetEntityInfo>),
    EntityBounds(Ask<GetEntityBounds>),
    SetEntityState(Ask<SetEntityState>),
    Delete(Ask<DeleteEntity>),
    Spawn(Ask<SpawnEntity>),
    /// Make cells of the map free or wall.
    ChangeMap(Ask<ChangeMap>),
    /// Set the real-time factor.
    Rtf(Rtf),
}

/// A goal of the action `SimulateSteps`.
pub trait Steps {
    /// Number of ticks to simulate.
    fn steps(&self) -> u64;
    fn feedback(&self, done: u64, left: u64);
    /// Ends the goal with its result.
    fn finish(self: Box<Self>, outcome: Outcome);
}

/// The features of `GetSimulatorFeatures` that a run supports, with or without agents in reserve.
#[must_use]
pub fn features(has_reserve: bool) -> SimulatorFeatures {
    let spawning = has_reserve.then_some(SimulatorFeatures::SPAWNING);
    SimulatorFeatures {
        features: spawning
            .into_iter()
            .chain([
                SimulatorFeatures::DELETING,
                SimulatorFeatures::ENTITY_TAGS,
                SimulatorFeatures::ENTITY_BOUNDS,
                SimulatorFeatures::ENTITY_BOUNDS_BOX,
                SimulatorFeatures::ENTITY_CATEGORIES,
                SimulatorFeatures::ENTITY_STATE_GETTING,
                SimulatorFeatures::ENTITY_STATE_SETTING,
                SimulatorFeatures::ENTITY_INFO_GETTING,
                SimulatorFeatures::SIMULATION_RESET,
                SimulatorFeatures::SIMULATION_STATE_GETTING,
                SimulatorFeatures::SIMULATION_STATE_SETTING,
                SimulatorFeatures::SIMULATION_STATE_PAUSE,
                SimulatorFeatures::STEP_SIMULATION_SINGLE,
                SimulatorFeatures::STEP_SIMULATION_MULTIPLE,
                SimulatorFeatures::STEP_SIMULATION_ACTION,
            ])
            .map(u16::from)
            .collect(),
        spawn_formats: Vec::new(),
        custom_info:
            "lock-step: a step is a fixed update of 20 ms; entities are the agents; states can be set in a paused \
                      simulation"
                .to_owned(),
    }
}

/// The state of a simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// At tick 0, not started.
    Stopped,
    Playing,
    Paused,
    /// The run is ending.
    Quitting,
}

impl State {
    /// The number of the state in `simulation_interfaces`.
    #[must_use]
    pub fn number(self) -> u8 {
        match self {
            Self::Stopped => SimulationState::STATE_STOPPED,
            Self::Playing => SimulationState::STATE_PLAYING,
            Self::Paused => SimulationState::STATE_PAUSED,
            Self::Quitting => SimulationState::STATE_QUITTING,
        }
    }
}

/// The name of the state in `simulation_interfaces`.
impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stopped => "STOPPED",
            Self::Playing => "PLAYING",
            Self::Paused => "PAUSED",
            Self::Quitting => "QUITTING",
        })
    }
}

/// What a reset concerns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResetScope {
    /// The whole run, which begins again.
    Run,
    /// What was spawned, where nothing can be: the reset succeeds and changes nothing.
    Nothing,
}

/// The scope of a reset, a sum of the constants of `ResetSimulation`; `can_spawn` says whether
/// agents may have joined.
///
/// # Errors
/// The result that explains the refusal.
pub fn reset_scope(scope: u8, can_spawn: bool) -> Result<ResetScope, Outcome> {
    let refused = |reason: String| Err(Outcome::failure(Outcome::RESULT_FEATURE_UNSUPPORTED, reason));
    let time_and_state = ResetSimulationRequest::SCOPE_TIME | ResetSimulationRequest::SCOPE_STATE;
    match scope {
        ResetSimulationRequest::SCOPE_DEFAULT => Ok(ResetScope::Run),
        scope if scope & time_and_state == time_and_state => Ok(ResetScope::Run),
        ResetSimulationRequest::SCOPE_SPAWNED if can_spawn => {
            refused("scope = 4: agents that have joined stay; take them out by delete_entity".to_owned())
        }
        ResetSimulationRequest::SCOPE_SPAWNED => Ok(ResetScope::Nothing),
        scope => refused(format!("scope = {scope}: expected 0 or 255 (all) or 3 (time and state), which go together")),
    }
}

/// Pending steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stepping {
    done: u64,
    left: u64,
}

/// The state machine of a simulation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StateMachine {
    state: State,
    stepping: Option<Stepping>,
    can_reset: bool,
    can_spawn: bool,
    /// The requested reset.
    pending_reset: Option<Reset>,
}

/// A requested reset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reset {
    /// Whether the simulation stays at tick 0 after it.
    pub is_paused: bool,
}

impl StateMachine {
    /// At tick 0, playing unless paused.
    #[must_use]
    pub fn new(is_paused: bool, can_reset: bool, can_spawn: bool) -> Self {
        let state = if is_paused { State::Stopped } else { State::Playing };
        Self { state, stepping: None, can_reset, can_spawn, pending_reset: None }
    }

    /// The requested reset: the executor ends the run then and starts it again.
    #[must_use]
    pub fn pending_reset(&self) -> Option<Reset> {
        self.pending_reset
    }

    /// Requests a reset, which keeps playing if time passes now; `scope` is a sum of the constants
    /// of `ResetSimulation`.
    ///
    /// # Errors
    /// The result that explains the refusal.
    pub fn reset(&mut self, scope: u8) -> Result<(), Outcome> {
        if !self.can_reset {
            return Err(reset_unsupported());
        }
        if self.state == State::Quitting {
            return Err(Outcome::failure(Outcome::RESULT_INCORRECT_STATE, "the simulation is about to end"));
        }
        if reset_scope(scope, self.can_spawn)? == ResetScope::Run {
            self.pending_reset = Some(Reset { is_paused: !self.may_tick() });
        }
        Ok(())
    }

    /// The state; `PLAYING` while steps are pending.
    #[must_use]
    pub fn state(&self) -> State {
        if self.stepping.is_some() { State::Playing } else { self.state }
    }

    /// Whether a tick may run now.
    #[must_use]
    pub fn may_tick(&self) -> bool {
        self.state() == State::Playing
    }

    /// Whether ticks run because steps are pending; the real-time factor does not limit them.
    #[must_use]
    pub fn is_stepping(&self) -> bool {
        self.stepping.is_some()
    }

    /// Whether the world may be edited: time stands still, and the run is not ending.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        matches!(self.state(), State::Stopped | State::Paused)
    }

    /// Changes to a state by its number.
    ///
    /// # Errors
    /// The result that explains the refusal.
    pub fn set_state(&mut self, number: u8) -> Result<(), Outcome> {
        let state = self.state();
        // Steps end in a pause: to play is another state than to step.
        if number == state.number() && !self.is_stepping() {
            return Err(Outcome::failure(
                SetSimulationStateResponse::ALREADY_IN_TARGET_STATE,
                format!("the simulation is {state} already"),
            ));
        }
        if state == State::Quitting {
            return Err(Outcome::failure(
                SetSimulationStateResponse::INCORRECT_TRANSITION,
                "the simulation is about to end",
            ));
        }
        self.state = match number {
            SimulationState::STATE_PLAYING => State::Playing,
            SimulationState::STATE_PAUSED => State::Paused,
            SimulationState::STATE_QUITTING => State::Quitting,
            SimulationState::STATE_STOPPED if self.can_reset => {
                self.pending_reset = Some(Reset { is_paused: true });
                return Ok(());
            }
            SimulationState::STATE_STOPPED => return Err(reset_unsupported()),
            other => {
                return Err(Outcome::failure(
                    SetSimulationStateResponse::INCORRECT_TRANSITION,
                    format!("state = {other}: expected 0 (STOPPED), 1 (PLAYING), 2 (PAUSED) or 3 (QUITTING)"),
                ));
            }
        };
        self.stepping = None;
        Ok(())
    }

    /// Starts steps.
    ///
    /// # Errors
    /// The result that explains the refusal.
    pub fn step(&mut self, steps: u64) -> Result<(), Outcome> {
        if !self.is_at_rest() {
            let reason = format!("the simulation is {}: pause it before steps", self.state());
            return Err(Outcome::failure(Outcome::RESULT_INCORRECT_STATE, reason));
        }
        if steps == 0 {
            return Err(Outcome::failure(Outcome::RESULT_OPERATION_FAILED, "steps = 0: expected at least 1"));
        }
        self.state = State::Paused;
        self.stepping = Some(Stepping { done: 0, left: steps });
        Ok(())
    }

    /// Counts a tick; returns how many steps are done and left if it was one of them.
    pub fn ticked(&mut self) -> Option<(u64, u64)> {
        let stepping = self.stepping.as_mut()?;
        stepping.done += 1;
        stepping.left -= 1;
        let Stepping { done, left } = *stepping;
        if left == 0 {
            self.stepping = None;
        }
        Some((done, left))
    }

    /// Drops pending steps.
    pub fn end_steps(&mut self) {
        self.stepping = None;
    }
}

fn reset_unsupported() -> Outcome {
    Outcome::failure(
        Outcome::RESULT_FEATURE_UNSUPPORTED,
        "a reset is not supported: set state 3 (QUITTING) and start it again",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_state(state: State) -> StateMachine {
        StateMachine { state, ..StateMachine::new(false, true, false) }
    }

    fn code(done: Result<(), Outcome>) -> u8 {
        done.map_or_else(|outcome| outcome.result, |()| Outcome::RESULT_OK)
    }

    #[test]
    fn transitions_between_all_states() {
        let to = [
            SimulationState::STATE_STOPPED,
            SimulationState::STATE_PLAYING,
            SimulationState::STATE_PAUSED,
            SimulationState::STATE_QUITTING,
        ];
        for (from, codes) in [
            (State::Stopped, [101, 1, 1, 1]),
            (State::Playing, [1, 101, 1, 1]),
            (State::Paused, [1, 1, 101, 1]),
            (State::Quitting, [103, 103, 103, 101]),
        ] {
            for (target, expected) in to.into_iter().zip(codes) {
                let mut control = in_state(from);
                assert_eq!(code(control.set_state(target)), expected, "{from:?} to {target}");
                let is_reset = expected == 1 && target == SimulationState::STATE_STOPPED;
                assert_eq!(control.pending_reset(), is_reset.then_some(Reset { is_paused: true }));
                let reached = if expected == 1 && !is_reset { target } else { from.number() };
                assert_eq!(control.state().number(), reached, "{from:?} to {target}");
            }
            for nonsense in [4, 5, 200] {
                assert_eq!(code(in_state(from).set_state(nonsense)), 103);
            }
        }
    }

    #[test]
    fn steps_end_in_paused() {
        for from in [State::Stopped, State::Paused] {
            let mut control = in_state(from);
            assert!(!control.may_tick());
            control.step(2).unwrap();
            assert!(control.may_tick() && control.is_stepping() && !control.is_at_rest());
            assert_eq!(code(control.step(1)), Outcome::RESULT_INCORRECT_STATE);
            assert_eq!(control.ticked(), Some((1, 1)));
            assert_eq!(control.ticked(), Some((2, 0)));
            assert_eq!((control.state(), control.may_tick()), (State::Paused, false));
        }
        assert_eq!(code(in_state(State::Playing).step(1)), Outcome::RESULT_INCORRECT_STATE);
        assert_eq!(code(in_state(State::Paused).step(0)), Outcome::RESULT_OPERATION_FAILED);
        assert_eq!(in_state(State::Playing).ticked(), None);
        let refused = in_state(State::Playing).step(1).unwrap_err();
        assert_eq!(refused.error_message, "the simulation is PLAYING: pause it before steps");
    }

    #[test]
    fn stepping_can_be_cancelled() {
        for (target, reached) in [
            (SimulationState::STATE_PLAYING, State::Playing),
            (SimulationState::STATE_PAUSED, State::Paused),
            (SimulationState::STATE_QUITTING, State::Quitting),
        ] {
            let mut control = in_state(State::Paused);
            control.step(u64::MAX).unwrap();
            assert_eq!(control.ticked(), Some((1, u64::MAX - 1)));
            control.set_state(target).unwrap();
            assert_eq!((control.state(), control.is_stepping()), (reached, false));
        }
    }

    #[test]
    fn initial_state_is_playing_or_stopped() {
        assert_eq!(StateMachine::new(false, true, false).state(), State::Playing);
        assert_eq!(StateMachine::new(true, true, false).state(), State::Stopped);
    }

    #[test]
    fn only_a_full_reset_is_supported() {
        for (from, is_paused) in [(State::Stopped, true), (State::Playing, false), (State::Paused, true)] {
            for scope in [0, 3, 7, 255] {
                let mut control = in_state(from);
                assert_eq!(control.reset(scope), Ok(()), "{from:?} {scope}");
                assert_eq!(control.pending_reset(), Some(Reset { is_paused }), "{from:?} {scope}");
            }
            for scope in [1, 2, 5, 6, 8] {
                let mut control = in_state(from);
                assert_eq!(
                    (code(control.reset(scope)), control.pending_reset()),
                    (Outcome::RESULT_FEATURE_UNSUPPORTED, None)
                );
            }
            let mut control = in_state(from);
            assert_eq!((control.reset(4), control.pending_reset()), (Ok(()), None), "nothing was spawned");
        }
        assert_eq!(code(in_state(State::Quitting).reset(0)), Outcome::RESULT_INCORRECT_STATE);
        let mut once = StateMachine::new(true, false, false);
        once.step(1).unwrap();
        assert_eq!(code(once.reset(0)), Outcome::RESULT_FEATURE_UNSUPPORTED);
        assert_eq!(code(once.set_state(SimulationState::STATE_STOPPED)), Outcome::RESULT_FEATURE_UNSUPPORTED);
        assert_eq!(once.pending_reset(), None);
    }
}
