//! The messages of the simulated network as bytes, and as texts for the log of events.

use agent_node::transport::Inbound as ToAgents;
use msgs::cdr;
use msgs::maes_msgs::{Observation, SignedCommand, SignedJoin, SignedObservation};
use transport::{Inbound as ToServer, Incoming};

/// The bytes that a message has on the wire.
pub(super) fn bytes_to_agents(message: &ToAgents) -> Vec<u8> {
    match message {
        ToAgents::Scenario(scenario) => cdr::encode(scenario),
        ToAgents::JoinReply(reply) => cdr::encode(reply),
        ToAgents::Observation(fragment) => cdr::encode(fragment),
        ToAgents::SignedObservation(signed) => cdr::encode(signed),
    }
}

/// As [`bytes_to_agents`], of a message to the server.
pub(super) fn bytes_to_server(message: &ToServer) -> Vec<u8> {
    match message {
        ToServer::Join(join) => cdr::encode(join),
        ToServer::SignedJoin(signed) => cdr::encode(signed),
        ToServer::Command(command) => cdr::encode(command),
        ToServer::SignedCommand(signed) => cdr::encode(signed),
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
        ToAgents::Observation(fragment)
        | ToAgents::SignedObservation(SignedObservation { observation: fragment, .. }) => {
            let Observation { agent, tick, part, parts, phase, .. } = fragment;
            let end = if *phase == Observation::ENDED { ", shutdown" } else { "" };
            format!("observation of agent {agent}, tick {tick}, {} of {parts}{end}", part + 1)
        }
    }
}

/// As [`described`], of a message to the server.
pub(super) fn described_to_server(incoming: &Incoming) -> String {
    match &incoming.message {
        ToServer::Join(join) | ToServer::SignedJoin(SignedJoin { join, .. }) => format!("join of agent {}", join.agent),
        ToServer::Command(command) | ToServer::SignedCommand(SignedCommand { command, .. }) => {
            format!("command of agent {}, tick {}", command.agent, command.tick)
        }
        ToServer::Undecodable { .. } => "an undecodable message".to_owned(),
    }
}
