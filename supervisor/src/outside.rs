//! Programs of the user that run agents: `agents.command` of a scenario.
//!
//! A program that is based on the crate `agent_node` takes its arguments: it is given the ids of
//! its agents, checks controller and settings before a run, and signs what it sends. Any other
//! program names the id in its own arguments (`{id}`), and nothing can be checked but that it is
//! there. One that does not sign does not get the join secret either.

use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;
use protocol::signing;
use simulation::scenario::team::ID_MARK;
use simulation::scenario::{AgentsSection, Scenario};
use simulation::wire;
use system::diagnostics;
use system::program;

use crate::SupervisorError;
use crate::team::Group;

/// Wall time that a program has to check its controller.
const CHECK: Duration = Duration::from_secs(30);

/// Checks that the program of a scenario can run its agents: that it is there, and, if it is based
/// on `agent_node`, that it knows the controller and its settings. A program with a `/` in its name
/// is looked for from `folder`, the present folder if that is empty; another one in `PATH`.
///
/// # Errors
/// Names the key, what is wrong, and the remedy.
pub fn check(scenario: &Scenario, folder: &Path) -> Result<(), SupervisorError> {
    let agents = &scenario.agents;
    let Some(program) = agents.command.first() else { return Ok(()) };
    let refused = |reason: String| SupervisorError::Command { command: format!("{:?}", agents.command), reason };
    if program.contains('/') {
        let path = program::within(folder, Path::new(program));
        let is_program = fs::metadata(&path).map(|file| file.is_file() && file.permissions().mode() & 0o111 != 0);
        let expected = |what: &str| refused(format!("{}: {what}; expected an executable file", path.display()));
        match is_program {
            Ok(true) => {}
            Ok(false) => return Err(expected("not executable")),
            Err(error) if error.kind() == ErrorKind::NotFound => return Err(expected("no such file")),
            Err(error) => return Err(expected(&error.to_string())),
        }
    }
    if agents.names_id() || !agents.command_signs {
        return if agents.names_id() {
            Ok(())
        } else {
            Err(refused(format!("expected {ID_MARK} in the arguments of a program that does not sign")))
        };
    }
    agents.controllers_of(|agent| agents.is_commanded(agent)).into_iter().try_for_each(|choice| {
        let mut command = bare(agents, folder, None);
        command.args(["--check", "--announced", choice.controller]);
        for setting in wire::settings(choice.set) {
            command.arg("--announced-set").arg(setting);
        }
        check_controller(command, program, &refused)
    })
}

/// Lets a program check a controller.
fn check_controller(
    mut command: Command,
    program: &str,
    refused: &dyn Fn(String) -> SupervisorError,
) -> Result<(), SupervisorError> {
    diagnostics::as_read(&mut command);
    // In a group of its own, so that what it starts ends with it.
    let child = command.process_group(0).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let child = child.map_err(|error| refused(format!("{program}: {error}")))?;
    let pid = Pid::from_raw(child.id().cast_signed());
    let (ended, output) = channel();
    std::thread::spawn(move || ended.send(child.wait_with_output()));
    let no_node = format!(
        "expected a program based on the crate agent_node; one that is not names the id of its agent ({ID_MARK}), and \
         needs agents.command_signs = false"
    );
    let Ok(output) = output.recv_timeout(CHECK) else {
        // It may have ended just now.
        let _ = killpg(pid, Signal::SIGKILL);
        return Err(refused(format!("{program} --check does not end; {no_node}")));
    };
    let output = output.map_err(|error| refused(format!("{program}: {error}")))?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let said = said.lines().find(|line| line.starts_with("error")).map(|line| line.trim_start_matches("error: "));
    let is_controller = said.is_some_and(|said| said.starts_with("controller "));
    let said = said.unwrap_or("it prints no error");
    Err(refused(if is_controller { said.to_owned() } else { format!("--check fails: {said}; {no_node}") }))
}

/// The program that runs a group of agents, with its arguments, in `folder`, the present one if
/// that is empty.
pub(crate) fn command(agents: &AgentsSection, folder: &Path, group: Group) -> Command {
    let mut command = bare(agents, folder, Some(group.first));
    if !agents.command_signs {
        command.env_remove(signing::JOIN_SECRET);
    }
    command
}

fn bare(agents: &AgentsSection, folder: &Path, agent: Option<u32>) -> Command {
    let with_id = |word: &String| match agent {
        Some(agent) => word.replace(ID_MARK, &agent.to_string()),
        None => word.clone(),
    };
    let words: Vec<String> = agents.command.iter().map(with_id).collect();
    program::command(&words, folder)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::OpenOptionsExt;

    use super::*;

    fn scenario(agents: &str) -> Scenario {
        let text = format!(
            "seed = 1\nduration_s = 1.0\n[map]\nkind = \"spheres\"\nsize = 20\n[agents]\ncount = 2\ncontroller = \"own\"\n\
             set = {{ a = 1, b = \"c\" }}\n{agents}\n"
        );
        Scenario::parse("s.toml", &text, &[]).unwrap()
    }

    /// A script in a folder.
    fn script(folder: &Path, body: &str) {
        use std::io::Write;
        let path = folder.join("own");
        drop(fs::remove_file(&path));
        let mut file = fs::OpenOptions::new().write(true).create(true).truncate(true).mode(0o755).open(path).unwrap();
        write!(file, "#!/bin/sh\n{body}\n").unwrap();
    }

    fn refused(agents: &str, folder: &Path) -> String {
        check(&scenario(agents), folder).unwrap_err().to_string()
    }

    #[test]
    fn program_is_asked_about_controller_and_settings() {
        let folder = tempfile::tempdir().unwrap();
        let own = "command = [\"./own\", \"-x\"]";
        assert!(refused(own, folder.path()).ends_with("/own: no such file; expected an executable file"));
        let asked = "test \"$*\" = '-x --check --announced own --announced-set a=1 --announced-set b=c'";
        script(folder.path(), asked);
        check(&scenario(own), folder.path()).unwrap();
        script(folder.path(), "echo 'error: controller own: setting a = 1: expected a number from 2 to 3' >&2; exit 2");
        assert_eq!(
            refused(own, folder.path()),
            "agents.command = [\"./own\", \"-x\"]: controller own: setting a = 1: expected a number from 2 to 3"
        );
        script(folder.path(), "exit 1");
        assert!(refused(own, folder.path()).contains("expected a program based on the crate agent_node"));
        fs::set_permissions(folder.path().join("own"), fs::Permissions::from_mode(0o644)).unwrap();
        assert!(refused(own, folder.path()).contains("not executable; expected an executable file"));
    }

    #[test]
    fn other_programs_name_the_id() {
        let none = Path::new("");
        check(&scenario("command = [\"python3\", \"a.py\", \"{id}\"]\ncommand_signs = false"), none).unwrap();
        let error = refused("command = [\"python3\", \"a.py\"]\ncommand_signs = false", none);
        assert!(error.ends_with("expected {id} in the arguments of a program that does not sign"), "{error}");
    }

    #[test]
    fn arguments_hold_the_id_and_paths_are_of_the_folder() {
        let agents = scenario("command = [\"../own\", \"--agent={id}\"]\ncommand_signs = false").agents;
        let command = command(&agents, Path::new("/plans/mine"), Group { first: 3, last: 3 });
        assert_eq!(command.get_program(), "/plans/mine/../own");
        assert_eq!(command.get_args().collect::<Vec<_>>(), ["--agent=3"]);
        assert_eq!(command.get_current_dir(), Some(Path::new("/plans/mine")));
        let mut secrets = command.get_envs().filter(|(name, _)| *name == signing::JOIN_SECRET);
        assert_eq!(secrets.next().map(|(_, value)| value), Some(None), "a program that does not sign gets no secret");
    }
}
