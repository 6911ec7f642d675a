//! Runs inside the test process over the in-memory transport, with agents of the test.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use agent_node::control_loop::{Agent, Reaction};
use agent_node::controllers::{Controller, Registry};
use agent_node::host::Options;
use agent_node::transport::{Inbound, ServerTransport};
use in_memory::{self, AgentsEnd, ServerEnd};
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Join, JoinReply};
use protocol::limits::PROTOCOL;
use protocol::run_info::RunInfo;
use protocol::signed::Signed;
use recording::Recording;
use recording::playback::Playback;
use sim_server::session::{self, JoinPolicy, Mode, Outcome, RunConfig, RunError, RunObserver};
use sim_server::setup;
use simulation::scenario::Scenario;
use transport::Transport;
use world::World;

use super::{HANG, bounded};

/// The set-up of an in-memory run.
pub(crate) struct Play {
    pub(crate) scenario: Scenario,
    /// Ids of the agents of each thread.
    pub(crate) groups: Vec<Vec<u32>>,
    /// The file of the recording.
    pub(crate) record: Option<PathBuf>,
    /// Called with every progress report.
    pub(crate) watch: Box<dyn FnMut(&World) + Send>,
    /// Wraps the server's end of the transport.
    pub(crate) server_link: fn(ServerEnd) -> Box<dyn Transport>,
    /// The recording to resume.
    pub(crate) resumed: Option<Recording>,
    /// Ends the run once it is set.
    pub(crate) stop: Arc<AtomicBool>,
    /// Which processes may join.
    pub(crate) policy: JoinPolicy,
}

/// The outcome of an in-memory run.
#[derive(Debug)]
pub(crate) struct FinishedRun {
    pub(crate) outcome: Result<Outcome, RunError>,
    /// The notes of the server for its user.
    pub(crate) notes: Vec<String>,
}

impl Play {
    /// A run with one thread for each agent, without a recording.
    pub(crate) fn new(scenario: &str) -> Self {
        let scenario = Scenario::parse("the test's scenario", scenario, &[]).expect("the scenario of a test is legal");
        Self {
            groups: (0..scenario.agents.count).map(|agent| vec![agent]).collect(),
            scenario,
            record: None,
            watch: Box::new(|_| {}),
            server_link: |end| Box::new(end),
            resumed: None,
            stop: Arc::default(),
            policy: JoinPolicy::default(),
        }
    }

    /// Two agents in a small cave, for so many seconds of sim time. Without look-ahead both send a
    /// command at every tick: many messages to interfere with.
    pub(crate) fn of_two(duration_s: f64) -> Self {
        Self::new(&format!(
            r#"
            seed = 7
            duration_s = {duration_s:?}
            stop_when_explored = false
            [map]
            kind = "spheres"
            size = 20
            [agents]
            count = 2
            [execution]
            look_ahead = false
            "#
        ))
    }

    /// Executes the run. `node` serves a group of agents until the run ends, which sets its flag.
    #[track_caller]
    pub(crate) fn with(
        self,
        node: impl Fn(AgentsEnd, Vec<AgentId>, &AtomicBool) + Send + Sync + 'static,
    ) -> FinishedRun {
        bounded("a run in memory", move || {
            let Self { scenario, groups, record, watch, server_link, resumed, stop, policy } = self;
            let ids = |group: Vec<u32>| group.into_iter().map(AgentId).collect();
            let groups: Vec<Vec<AgentId>> = groups.into_iter().map(ids).collect();
            let (world, _) = setup::build(&scenario).expect("there is such a world");
            let recorder = record.map(|file| setup::record(&file, &scenario, &world).expect("it can be recorded"));
            let (server_end, agents_ends) = in_memory::link(&groups);
            let mut link = server_link(server_end);
            let mut watcher = Notes { notes: Vec::new(), watch };
            let is_over = AtomicBool::new(false);
            let outcome = thread::scope(|scope| {
                for (end, agents) in agents_ends.into_iter().zip(groups) {
                    scope.spawn(|| node(end, agents, &is_over));
                }
                let playback = resumed.as_ref().map(|recording| Playback::new(recording).expect("it can be read"));
                let outcome = RunConfig::new(&scenario, playback.map_or(Mode::Live, Mode::Resume))
                    .map(|config| config.with_policy(policy))
                    .and_then(|config| session::run(config, world, &mut *link, recorder, &mut watcher, &stop));
                is_over.store(true, Ordering::Relaxed);
                outcome
            });
            FinishedRun { outcome, notes: watcher.notes }
        })
    }
}

impl FinishedRun {
    #[track_caller]
    pub(crate) fn outcome(&self) -> &Outcome {
        self.outcome.as_ref().unwrap_or_else(|error| panic!("{error}\n{}", self.notes.join("\n")))
    }

    #[track_caller]
    pub(crate) fn digest(&self) -> String {
        self.outcome().digest.to_string()
    }
}

/// Collects the notes of the server.
struct Notes {
    notes: Vec<String>,
    watch: Box<dyn FnMut(&World) + Send>,
}

impl RunObserver for Notes {
    fn waiting(&mut self, _missing: &[AgentId]) {}

    fn started(&mut self) {}

    fn progress(&mut self, world: &World) {
        (self.watch)(world);
    }

    fn note(&mut self, _level: transport::Level, text: &str) {
        self.notes.push(text.to_owned());
    }
}

/// Options of a group of agents with the controller of the scenario.
pub(crate) fn honest(instance: u64, agents: Vec<AgentId>) -> Options {
    Options {
        agents,
        registry: Registry::BUILT_IN,
        controller: None,
        settings: Vec::new(),
        instance,
        credentials: None,
        server_timeout: HANG,
        chaos_delay: Duration::ZERO,
        map_hz: 5.0,
        decision_times: None,
    }
}

/// Serves agents with controllers of the test until the run ends. `pause` is called before each
/// command.
pub(crate) fn serve(
    mut link: impl ServerTransport,
    ids: &[AgentId],
    controller: impl Fn(AgentId) -> Box<dyn Controller>,
    mut pause: impl FnMut(),
    is_over: &AtomicBool,
) {
    let mut agents = BTreeMap::new();
    let mut run = 0;
    while !is_over.load(Ordering::Relaxed) {
        let Some(message) = link.receive(Duration::from_millis(20)) else { continue };
        match message {
            Inbound::Scenario(scenario) => {
                run = scenario.run;
                for &id in ids {
                    let run_info = RunInfo::from_message(&scenario, id).expect("the server's scenario is legal");
                    agents.insert(id.0, Agent::new(id, run_info, controller(id)));
                    let controller = "of the test".to_owned();
                    let last_tick = Join::NONE;
                    let join = Join { run, agent: id.0, instance: 0, protocol: PROTOCOL, controller, last_tick };
                    link.send_join(&Signed::unsigned(join));
                }
            }
            // A process whose id another one still holds asks again, or waits to be replaced.
            Inbound::JoinReply(reply) => assert!(reply.accepted || reply.code == JoinReply::HELD, "{}", reply.reason),
            Inbound::Observation(part) => {
                let part = part.trusted();
                let agent = agents.get_mut(&part.agent).expect("the scenario comes first");
                match agent.take(part).expect("the server's observations are legal") {
                    Reaction::None => {}
                    Reaction::Reply(command) | Reaction::Acknowledge(command) => {
                        pause();
                        link.send_command(&Signed::unsigned(Command { run, ..command }));
                    }
                }
            }
        }
    }
}
