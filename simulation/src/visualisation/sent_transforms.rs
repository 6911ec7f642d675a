//! The transforms that were sent to one side, live or recorded, and those that have to precede
//! other messages.
//!
//! Topics are thinned, each at its own time, and tf2 interpolates between the transforms that it
//! has: without the transform of its stamp, a scan is shown where its body was not. So each message
//! with a stamp is preceded by the transforms of that stamp. No transform is sent twice, which tf2
//! warns of. Stamps of a body ascend: where a scan is still to come, its transform comes before
//! later ones, because a reader of several topics may take the scan before the transform sent just
//! before it, and would interpolate between those that enclose it.

use std::collections::{BTreeMap, BTreeSet};

use msgs::geometry_msgs::TransformStamped;
use msgs::ids::{AgentId, Tick};

use super::{VisualisationMessage, VisualisationMessages, VisualisationTopic, poses};
use crate::wire;
use world::World;

/// Stamps of the transforms that one side has.
#[derive(Debug)]
pub(super) struct SentTransforms {
    /// By agent, as far as messages with these stamps may still come.
    stamps: Vec<BTreeSet<Tick>>,
    /// Tick of the last transforms of all agents.
    complete_at: Option<Tick>,
    /// The side has all transforms of each multiple of so many ticks anyway; 0: of none.
    period_ticks: u64,
}

impl SentTransforms {
    pub(super) fn new(agents: u32, period_ticks: u32) -> Self {
        let stamps = vec![BTreeSet::new(); agents as usize];
        Self { stamps, complete_at: None, period_ticks: period_ticks.into() }
    }

    /// Forgets what was sent, for a side that has nothing.
    pub(super) fn forget(&mut self) {
        self.stamps.iter_mut().for_each(BTreeSet::clear);
        self.complete_at = None;
    }

    /// Whether the transforms of all agents at this tick were sent.
    pub(super) fn is_complete_at(&self, tick: Tick) -> bool {
        self.complete_at == Some(tick)
    }

    /// Whether the side has all transforms of this stamp without these messages.
    fn has_anyway(&self, stamp: Tick) -> bool {
        self.period_ticks > 0 && stamp.0.is_multiple_of(self.period_ticks)
    }

    /// Notes a transform as sent; returns whether it was not before.
    pub(super) fn insert(&mut self, world: &World, agent: AgentId, stamp: Tick) -> bool {
        if self.has_anyway(stamp) {
            return false;
        }
        let stamps = &mut self.stamps[agent.index()];
        // No later message is older than the last scan.
        let oldest = world.last_scan(agent).map_or(stamp, |(_, scan)| scan.min(stamp));
        *stamps = stamps.split_off(&oldest);
        stamps.insert(stamp)
    }

    /// The transforms of the last scan of an agent with their stamp, unless they were sent before.
    pub(super) fn of_scan(&mut self, world: &World, agent: AgentId) -> Option<(Tick, Vec<TransformStamped>)> {
        let (pose, scan) = world.last_scan(agent)?;
        let frames = world.frames_at_last_scan(agent);
        self.insert(world, agent, scan).then(|| (scan, wire::transforms_of(agent, scan, &pose, frames.as_ref())))
    }

    /// The messages with the transforms of their stamps before them; scans of the agents that
    /// `may_follow` names may be sent later.
    pub(super) fn precede(
        &mut self,
        world: &World,
        messages: VisualisationMessages,
        may_follow: impl Fn(AgentId) -> bool,
    ) -> VisualisationMessages {
        if messages.is_empty() {
            return messages;
        }
        let has_all = messages.iter().any(|(topic, _)| *topic == VisualisationTopic::Transforms);
        // A message has transforms of one stamp, the oldest first.
        let mut preceding: BTreeMap<Tick, Vec<TransformStamped>> = BTreeMap::new();
        for (topic, _) in &messages {
            if let Some(agent) = topic.scanned_by()
                && let Some((scan, transforms)) = self.of_scan(world, agent)
            {
                preceding.entry(scan).or_default().extend(transforms);
            }
        }
        let is_due = messages.iter().any(|(topic, _)| topic.needs_present_transforms());
        if has_all || is_due {
            for agent in world.agents().filter(|&agent| world.presence(agent).is_in_world()) {
                let is_earlier = world.last_scan(agent).is_some_and(|(_, scan)| scan < world.tick());
                if is_earlier
                    && may_follow(agent)
                    && let Some((scan, transforms)) = self.of_scan(world, agent)
                {
                    preceding.entry(scan).or_default().extend(transforms);
                }
                // Those of a message among these come with it.
                if self.insert(world, agent, world.tick()) && !has_all {
                    preceding.entry(world.tick()).or_default().extend(wire::present_transforms(world, agent));
                }
            }
            if !has_all && !self.has_anyway(world.tick()) && self.complete_at != Some(world.tick()) {
                preceding.entry(world.tick()).or_default().extend(wire::obstacle_transforms(world));
            }
            self.complete_at = Some(world.tick());
        }
        let preceding = preceding.into_values().flat_map(poses::in_parts).map(VisualisationMessage::Transforms);
        preceding.map(|message| (VisualisationTopic::Transforms, message)).chain(messages).collect()
    }
}
