//! The world server. Start reading at [`sim_server::program`].

use std::process::ExitCode;

fn main() -> ExitCode {
    sim_server::program::main(std::env::args_os().skip(1))
}
