//! The world server. Start reading at `serve.rs`; every exit code is made here and there.

mod serve;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;
use sim_server::cli::{Cli, Command};
use sim_server::{exit, renamed};

fn main() -> ExitCode {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let first = arguments.first();
    if let Some(command) = MOVED.into_iter().find(|command| first.is_some_and(|first| first == command)) {
        return exec_maes(command, arguments);
    }
    let Command::Run(args) = Cli::parse().command;
    match serve::run(&args) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {}", msgs::printable::line(&error.to_string()));
            ExitCode::from(exit::BAD_INPUT)
        }
    }
}

/// Commands that `maes` has now.
const MOVED: [&str; 7] = ["map", "info", "verify", "replay", "view", "snapshot", "scenario"];

fn exec_maes(command: &str, mut arguments: Vec<OsString>) -> ExitCode {
    if command == "view" {
        // It has never opened a browser by itself.
        arguments.extend(["--browser", "false"].map(OsString::from));
    }
    renamed::exec(&format!("sim_server {command}"), &format!("maes {command}"), arguments)
}
