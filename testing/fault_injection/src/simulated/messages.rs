//! The messages of the simulated network as bytes, and as texts for the log of events.

use agent_node::transport::Inbound as ToAgents;
use msgs::cdr;
use msgs::maes_msgs::{Command, Observation, SignedCommand, SignedJoin, SignedObservation};
use transport::{Inbound as ToServer, Incoming};

/// The bytes that a message has on the wire.
pub(super) fn bytes_to_agents(message: &ToAgents) -> Vec<u8> {
    match message {
        ToAgents::Scenario(scenario) => cdr::encode(scenario),
        ToAgents::JoinReply(reply) => cdr::encode(reply),
        ToAgents::Observation(fragment) => cdr::encode(&SignedObservation::from(fragment.clone())),
    }
}

/// As [`bytes_to_agents`], of a message to the server.
pub(super) fn bytes_to_server(message: &ToServer) -> Vec<u8> {
    match message {
        ToServer::Join(join) => cdr::encode(&SignedJoin::from(join.clone())),
        ToServer::Command(command) => cdr::encode(&SignedCommand::from(command.clone())),
        ToServer::Undecodable { reason } => reason.clone().into_bytes(),
    }
}

/// A message to agents, for the log of events.
pub(super) fn described(message: &ToAgents) -> String {
    match message {
        ToAgents::Scenario(_) => "the scenario".to_owned(),
        ToAgents::JoinReply(reply) => {
            let verdict = if reply.accepted { "accepted" } else { "refused" };
            format!("reply to the join of agent {} by process {}: {verdict}", reply.agent, reply.instance)
        }
        ToAgents::Observation(fragment) => {
            let Observation { agent, tick, part, parts, phase, .. } = fragment.claimed();
            let end = if *phase == Observation::ENDED { ", shutdown" } else { "" };
            format!("observation of agent {agent}, tick {tick}, {} of {parts}{end}", part + 1)
        }
    }
}

/// As [`described`], of a message to the server.
pub(super) fn described_to_server(incoming: &Incoming) -> String {
    match &incoming.message {
        ToServer::Join(request) => format!("join of agent {}", request.claimed().join.agent),
        ToServer::Command(command) => {
            let Command { agent, tick, .. } = command.claimed();
            format!("command of agent {agent}, tick {tick}")
        }
        ToServer::Undecodable { .. } => "an undecodable message".to_owned(),
    }
}
