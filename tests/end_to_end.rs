//! End-to-end tests: the installed programs, and the libraries in the combination that the programs
//! use.
//!
//! No test depends on speed: every wait is for a line, a message, a file or the end of a process,
//! and wall time only turns a hang into a failure.

/// Processes, ROS domains, recordings and in-memory runs, shared by the tests.
mod support;

/// Every controller is deterministic and sends no illegal command, on every kind of map.
mod controllers;
/// The same scenario gives the same bytes: repeated, in another start order, with delays, more
/// threads, another transport.
mod determinism;
/// Mutants: the comparisons of the determinism tests detect nondeterministic controllers and
/// servers.
mod determinism_mutants;
/// Look-ahead is exact: requests at every tick do not change the run of agents that act only on
/// their wake-up conditions.
mod look_ahead;

/// Agents that are missing, die, hang, or join with an id in use.
mod agent_loss;
/// Replacement of lost agent processes.
mod agent_replacement;
/// Bad scenarios, maps, recordings and arguments: one line of error with the place, exit code 2, no
/// file.
mod bad_input;
/// What the programs say beside their results.
mod diagnostics;
/// Localisation that drifts: the same bytes over ROS 2 and in memory, verified, forked and resumed.
mod drift;
/// Batteries: the same bytes over ROS 2 and in memory, forked and resumed.
mod energy;
/// Plans of many runs, and their reports.
mod experiments;
/// Random fault injection: runs over ROS 2 are the same with processes killed, suspended and sent
/// garbage.
mod faults;
/// Attacks with files: devices and FIFOs as input, links as output, bombs, control characters.
mod file_attacks;
/// Forged, replayed and unsigned messages: refused, counted, without effect.
mod forged_commands;
/// Ground bodies: the same bytes over ROS 2 and in memory, verified and forked.
mod ground;
/// Illegal, foreign and undecodable messages: refused, counted, without effect.
mod hostile_agents;
/// Runs over several hosts: the same over bad links, and a lost host is its agents lost.
mod hosts;
/// What `cargo install` installs.
mod installation;
/// Interrupted runs, killed servers, full disks.
mod interruptions;
/// RTPS packets with random changes: no memory, and no effect.
mod mutated_packets;
/// RTPS packets of strangers: no memory, no effect, and none from outside the machine.
mod network_attacks;
/// Limits of a process: its start, its shutdown, its memory.
mod process_limits;
/// Recovery: killed, hanging and duplicate agents and killed servers leave the run unchanged.
mod recovery;
/// The server while it waits for replies: saving, stopping, late and repeated replies.
mod reply_timeouts;
/// `launch_scripts/spawn.sh` starts a server and agents by hand.
mod spawn_script;

/// Plans on a real Slurm whose node is killed, and with GNU parallel.
mod clusters;
/// Programs of one's own, from outside the workspace, run agents in runs and plans.
mod own_programs;
/// The Python package: its tests, its types and its stubs.
mod python_package;
/// SIERRA executes runs and compares them.
mod sierra;

/// Forks of recorded runs, and events of scenarios.
mod forks;
/// The scenarios of the gallery end as documented.
mod gallery;
/// Teams whose agents run different controllers.
mod mixed_teams;
/// Radio models, relays and sensor noise.
mod radios;
/// Bodies of the server on trajectories of the agents.
mod trajectories;
/// Verification and comparison of recordings.
mod verify;

/// Client libraries, checkers and converters of others, and the buffer of tf2.
mod clients;
/// External ROS 2 nodes as agents.
mod external_agents;
/// Observers on a real ROS 2 and on a second DDS do not change a run.
mod observers;
/// Recordings open with the usual Python packages, and their content is complete.
mod recordings;
/// Replay on ROS 2 topics: complete, latched for late readers, no effect on runs beside it.
mod replay;
/// The ROS 2 package with the programs.
mod ros_package;
/// Depth cameras and spinning LiDARs: the same bytes over ROS 2 and in memory, and forked.
mod sensors;
/// Simulation control from a real ROS 2 node: pause, steps, entities, parameters.
mod services;
/// Runs over Zenoh, and another implementation of the format of rmw_zenoh that observes and
/// controls them.
#[cfg(feature = "zenoh")]
mod zenoh;

/// The viewer in a browser. Tests start in the order of their names, and these take longest.
mod browser;
/// The configurations of RViz 2 and Foxglove.
mod layouts;
/// Maps in the programs of others.
mod map_tools;
/// Recordings in the viewer Rerun.
mod rerun;

/// The Foxglove server: live stream, control, served recordings.
mod foxglove_server;
/// Agents over sockets of the system instead of ROS 2.
mod unix_sockets;
/// Attacks on the page and the WebSocket, each without effect.
mod view_attacks;

/// Foreign crates: licences, duplicate versions, sources, features.
mod dependencies;
/// The code blocks of the documents work.
mod documented_commands;
/// What documents name exists, and every document is a chapter of the site.
mod documents;
/// Message definitions and tables of topics in the documents are those of the code.
mod reference_pages;
/// What a chapter of the site links to is on the site.
mod site;
/// Rules of the workspace that the compiler does not check.
mod tidy;
