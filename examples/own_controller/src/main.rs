//! A controller in a program of its own: straight on until a collision, then a turn to a random
//! side. The program is an `agent_node` that knows one controller more.
//!
//! ```sh
//! cargo build --release
//! maes run --controller zigzag --set 'agents.command=["target/release/zigzag"]' --transport memory
//! ```
//!
//! With `--features ros` it is a ROS 2 node as well, and `--transport memory` may be left out.

use std::process::ExitCode;

use agent_node::command::{Command, Motion, WakeCondition};
use agent_node::controllers::{Controller, Ctx, Registration};
use agent_node::observation::Observation;
use agent_node::rand::RngExt;
use agent_node::rand_chacha::ChaCha8Rng;

struct Zigzag {
    rng: ChaCha8Rng,
    turn_rad: f64,
}

impl Controller for Zigzag {
    fn decide(&mut self, observation: &Observation, _ctx: &mut Ctx<'_>) -> Command {
        if observation.is_active {
            return Command::keep(WakeCondition::TASK_DONE);
        }
        if observation.collision.is_some() {
            let side = if self.rng.random::<bool>() { 1.0 } else { -1.0 };
            return Command::new(Motion::turn(side * self.turn_rad), WakeCondition::TASK_DONE);
        }
        Command::new(Motion::straight(0.0, f64::INFINITY), WakeCondition::TASK_DONE)
    }
}

static CONTROLLERS: &[Registration] = &[Registration {
    name: "zigzag",
    description: "zigzag: straight on, and a turn to a random side at each obstacle",
    stream: "zigzag",
    construct: &|settings, setup| {
        let turn_rad = settings.number("turn_rad", 2.0, 0.1, 3.0)?;
        Ok(Box::new(Zigzag { rng: setup.rng, turn_rad }))
    },
}];

fn main() -> ExitCode {
    agent_node::program::main(CONTROLLERS)
}
