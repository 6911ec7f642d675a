//! End-to-end tests: the binaries as people start them, and the libraries as the binaries put them together.
//!
//! No test hangs on how fast something is: whoever has to wait, waits for a line, a message or the end of a process, and a wall
//! clock only turns a hang into a failure.

/// Processes, ROS domains, recordings and runs in memory, for all of the others.
mod support;

/// Every controller: the same bytes however it is run, and sound on every kind of map.
mod controllers;
/// The same scenario gives the same bytes: again, in another order, slower, faster, on more threads, over another transport.
mod determinism;
/// Asking agents at every tick changes nothing for those that act only when they are due, even if they talk and listen.
mod look_ahead;
/// What is not deterministic is found by the comparisons of these tests.
mod oracle;

/// Scenarios, maps, recordings and arguments that are wrong: one line that says where, exit code 2, and no file.
mod bad_input;
/// Plans of many runs, and their reports.
mod experiments;
/// Drawn faults: runs over ROS 2 whose processes are killed, stopped and lied to are the undisturbed ones.
mod faults;
/// Runs that are interrupted, servers that are killed, disks that are full.
mod interruptions;
/// Commands that lie, and bytes that are no commands: refused, counted, and without effect.
mod liars;
/// Agents that are missing, die, hang, or claim an id that is taken.
mod lost_agents;
/// Processes that take the place of others.
mod lost_processes;
/// Old names of commands print the new ones and do what they did.
mod renamed_commands;
/// `launch_scripts/spawn.sh` starts a server and agents by hand.
mod spawn_script;
/// Agents and servers that die, hang or come twice, and the run is the same as if nothing had happened.
mod survival;
/// While the server waits: recordings are saved, runs can be stopped, late and repeated answers are what they are.
mod waiting;

/// The scenarios that come with the simulator end as their page says.
mod gallery;
/// Radios, relays and sensors that err.
mod radios;
/// Recordings are checked, and compared with others.
mod verify;

/// A real ROS 2 node looks on, and the run does not care.
mod onlookers;
/// Nodes of somebody else take part as agents.
mod own_nodes;
/// Recordings open with the Python packages that people use, and hold what they should.
mod recordings;
/// Recordings are played on ROS 2 topics: everything comes, late readers see what holds, and runs take no notice.
mod replay;
/// A real ROS 2 node controls a run: pauses, steps, entities, parameters.
mod services;

/// The page, in a browser.
mod viewer;
/// People look on in a browser, or in Foxglove.
mod viewing;

/// Rules of the workspace that the compiler does not check.
mod tidy;
