//! The old name of some commands of `maes`; it works for one more version.

use std::ffi::OsString;
use std::process::ExitCode;

use sim_server::renamed;

fn main() -> ExitCode {
    let mut arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let old = arguments.first().and_then(|first| first.to_str()).unwrap_or_default().to_owned();
    let new: &[&str] = match old.as_str() {
        "single" => &["run", "--transport", "memory"],
        "run" => &["batch"],
        "garbage" => &["faults", "inject-garbage"],
        "merge" | "report" | "faults" | "diff" | "movie" => &[old.as_str()],
        _ => return renamed::exec("experiments", "maes", arguments),
    };
    arguments.splice(..1, new.iter().map(OsString::from));
    renamed::exec(&format!("experiments {old}"), &format!("maes {}", new.join(" ")), arguments)
}
