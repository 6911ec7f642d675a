//! The process of one or more agents with the built-in controllers. Start reading at
//! [`agent_node::program`].

use std::process::ExitCode;

fn main() -> ExitCode {
    agent_node::program::main(&[])
}
