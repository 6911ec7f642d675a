//! The agents of a run on its hosts.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::rc::Rc;
use std::time::{Duration, Instant};

use protocol::signing;
use system::program;
use system::wall_clock::now;

use crate::child::Signal;
use crate::hosts::connection::Connection;
use crate::hosts::{self, Hosts};
use crate::processes::JoinSecret;
use crate::run::Run;
use crate::team::Group;
use crate::{SupervisorError, domain};

/// The environment variables of ROS by which the processes find each other.
pub(crate) const RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";
const STATIC_PEERS: &str = "ROS_STATIC_PEERS";

/// The middleware, which has to be the same everywhere.
const RMW_IMPLEMENTATION: &str = "RMW_IMPLEMENTATION";

/// The range of a run on several hosts, unless the environment has one that reaches them.
pub(crate) const SUBNET: &str = "SUBNET";

/// Wall time that a host has to answer at the start.
const HELLO: Duration = Duration::from_secs(60);

/// The connections of a run, and which agents run where.
pub(crate) struct RemoteTeam {
    hosts: Option<Hosts>,
    build: &'static str,
    connections: Vec<Rc<Connection>>,
    begun: Instant,
    binaries: PathBuf,
    logs: PathBuf,
    /// What every process of agents has in its environment.
    environment: BTreeMap<String, String>,
    /// The host of each process.
    places: Vec<(Group, usize)>,
    /// Hosts whose loss was reported.
    reported: BTreeSet<usize>,
}

/// A process of agents on a host.
pub(crate) struct RemoteProcess {
    connection: Rc<Connection>,
    agents: Group,
}

impl Default for RemoteTeam {
    /// No hosts.
    fn default() -> Self {
        Self {
            hosts: None,
            build: "",
            connections: Vec::new(),
            begun: now(),
            binaries: PathBuf::new(),
            logs: PathBuf::new(),
            environment: BTreeMap::new(),
            places: Vec::new(),
            reported: BTreeSet::new(),
        }
    }
}

/// Whether a discovery range reaches other hosts.
pub(crate) fn reaches_hosts(range: Option<&str>) -> bool {
    matches!(range, Some("SUBNET" | "SYSTEM_DEFAULT"))
}

impl RemoteTeam {
    /// Starts the launchers of all hosts.
    pub(crate) fn open(
        hosts: &Hosts,
        build: &'static str,
        run: &Run<'_>,
        secret: &JoinSecret,
    ) -> Result<Self, SupervisorError> {
        if !run.scenario.agents.command.is_empty() {
            let reason = "agents.command: programs of one's own do not run on other hosts".to_owned();
            return Err(SupervisorError::Hosts { file: hosts.file.clone(), reason });
        }
        let range = std::env::var(RANGE).ok().filter(|range| reaches_hosts(Some(range)));
        let domain = run.domain.map_or_else(domain::of_environment, |id| id.to_string());
        let mut environment = BTreeMap::from([
            (domain::VARIABLE.to_owned(), domain),
            (RANGE.to_owned(), range.unwrap_or_else(|| SUBNET.to_owned())),
            (STATIC_PEERS.to_owned(), hosts.server.clone()),
        ]);
        environment.extend(std::env::var(RMW_IMPLEMENTATION).ok().map(|name| (RMW_IMPLEMENTATION.to_owned(), name)));
        environment.extend(secret.text().map(|secret| (signing::JOIN_SECRET.to_owned(), secret)));
        let binaries = program::within(std::path::Path::new(""), &run.binaries);
        let open = |host| Connection::open(host, &binaries, &run.logs).map(Rc::new);
        let connections = hosts.hosts.iter().map(open).collect::<Result<_, _>>()?;
        Ok(Self {
            hosts: Some(hosts.clone()),
            build,
            connections,
            binaries,
            logs: run.logs.clone(),
            environment,
            ..Self::default()
        })
    }

    /// Whether all hosts have answered.
    ///
    /// # Errors
    /// If one has ended, has another build, or takes too long.
    pub(crate) fn is_ready(&self) -> Result<bool, SupervisorError> {
        for connection in &self.connections {
            let name = connection.name();
            match connection.hello()? {
                Some((build, _)) if build != self.build => {
                    let here = self.build;
                    let reason =
                        format!("host {name:?}: its build is {build}, and this is {here}; install the same one");
                    return Err(SupervisorError::Host(reason));
                }
                Some(_) => {}
                None if self.begun.elapsed() >= HELLO => {
                    let seconds = HELLO.as_secs();
                    return Err(SupervisorError::Host(format!("host {name:?}: no answer within {seconds} s")));
                }
                None => return Ok(false),
            }
        }
        Ok(true)
    }

    /// Spreads the agents of each host over processes.
    pub(crate) fn assign(&mut self, run: &Run<'_>, agents: &[BTreeSet<u32>]) {
        for (place, (connection, agents)) in self.connections.iter().zip(agents).enumerate() {
            let cores = connection.hello().ok().flatten().map_or(1, |(_, cores)| cores);
            let count = u32::try_from(agents.len()).unwrap_or(u32::MAX);
            let size = run.team.process_size(run.scenario, count, cores);
            self.places.extend(hosts::groups(agents, size).into_iter().map(|group| (group, place)));
        }
        self.places.sort_unstable();
        run.team.arrange(&mut self.places);
    }

    pub(crate) fn groups(&self) -> Vec<Group> {
        self.places.iter().map(|&(group, _)| group).collect()
    }

    /// Starts a process of agents on its host, and connects to that again if it was lost.
    pub(crate) fn start(&mut self, group: Group, run: &Run<'_>) -> Result<RemoteProcess, SupervisorError> {
        let hosts = self.hosts.as_ref().map_or(&[][..], |hosts| &hosts.hosts);
        // Of agents that share a process, one may start alone when it has left and is to come back.
        let has = |other: &Group| other.first <= group.first && group.last <= other.last;
        let place = self.places.iter().find(|(other, _)| has(other)).map_or(0, |&(_, place)| place);
        if self.connections[place].launcher_code().is_some() {
            self.connections[place] = Rc::new(Connection::open(&hosts[place], &self.binaries, &self.logs)?);
            self.reported.remove(&place);
        }
        let mut environment = self.environment.clone();
        environment.extend(hosts[place].environment.clone());
        let connection = Rc::clone(&self.connections[place]);
        connection.start(group, run.remote_arguments(group), environment, &run.log_of(group))?;
        Ok(RemoteProcess { connection, agents: group })
    }

    /// A line for each host that was lost since the last call.
    pub(crate) fn lost_hosts(&mut self) -> Vec<String> {
        let mut lines = Vec::new();
        for (place, connection) in self.connections.iter().enumerate() {
            if let Some(code) = connection.launcher_code()
                && self.reported.insert(place)
            {
                lines.push(format!("host {} is lost: its launcher ended with exit code {code}", connection.name()));
            }
        }
        lines
    }
}

impl RemoteProcess {
    pub(crate) fn ended(&self) -> Option<u8> {
        self.connection.ended(self.agents)
    }

    pub(crate) fn signal(&self, signal: Signal) {
        self.connection.signal(self.agents, signal);
    }
}
