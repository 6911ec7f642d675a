//! The command of an agent, its reply to an observation: motion, scans, messages, and the next
//! wake-up condition.
//!
//! The message is `maes_msgs/Command`. Lengths in metres, angles in radians, frame `map` unless a
//! name says otherwise.

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs;
use msgs::shared_bytes::SharedBytes;

pub use crate::agent_message::{AgentMessage, Peer};
use crate::event_mask::EventMask;
use crate::limits::{AGENT_MESSAGE_BYTES_BARE, INFO_BYTES_MAX, LIST_BYTES_MAX, POINT_BYTES};
pub use crate::message_type::MessageType;
pub use crate::motion::Motion;
use crate::relay_id::RelayId;
pub use crate::scan_request::ScanRequest;
pub use crate::stage::Stage;
pub use crate::wake_condition::WakeCondition;

/// The reply to an observation.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Task of the body.
    pub motion: Motion,
    /// Request to the LiDAR.
    pub lidar: ScanRequest,
    /// Whether the next observation includes the view of the last scan.
    pub want_view: bool,
    /// Messages to send in this tick, and contents to write to relays.
    pub messages: Vec<AgentMessage>,
    /// The wake-up condition of the next observation.
    pub wake: WakeCondition,
    /// What the agent is busy with from now on; `None`: unchanged.
    pub stage: Option<Stage>,
    /// A text for people, at most 1024 bytes; empty: unchanged.
    pub info: String,
}

impl Command {
    /// The command of a lost agent: its body stops, and its LiDAR is off if scans are requested.
    pub const LOST: Self = Self {
        motion: Motion::Stop,
        lidar: ScanRequest::Never,
        want_view: false,
        messages: Vec::new(),
        wake: WakeCondition::NEXT_TICK,
        stage: None,
        info: String::new(),
    };

    /// Continues the present task until `wake` fires.
    #[must_use]
    pub fn keep(wake: WakeCondition) -> Self {
        Self::new(Motion::Keep, wake)
    }

    /// Starts a task; everything else is unchanged.
    #[must_use]
    pub fn new(motion: Motion, wake: WakeCondition) -> Self {
        Self {
            motion,
            lidar: ScanRequest::Keep,
            want_view: false,
            messages: Vec::new(),
            wake,
            stage: None,
            info: String::new(),
        }
    }

    /// Adds a message: `kind` is the type of the content (not [`MessageType::Map`]), `to` the
    /// receiver (`None`: all agents in contact).
    #[must_use]
    pub fn with_message(self, to: Option<AgentId>, kind: u8, data: impl Into<SharedBytes>) -> Self {
        self.with(to.map_or(Peer::Broadcast, Peer::One), kind, data.into())
    }

    /// Drops a relay that stores these bytes, unless the agent has none left.
    #[must_use]
    pub fn with_relay(self, kind: u8, data: impl Into<SharedBytes>) -> Self {
        self.with(Peer::NewRelay, kind, data.into())
    }

    /// Replaces the content of a relay in reach.
    #[must_use]
    pub fn with_relay_update(self, relay: RelayId, kind: u8, data: impl Into<SharedBytes>) -> Self {
        self.with(Peer::Relay(relay), kind, data.into())
    }

    fn with(mut self, peer: Peer, kind: u8, data: SharedBytes) -> Self {
        self.messages.push(AgentMessage { peer, kind, data });
        self
    }

    /// Names what the agent is busy with from now on.
    #[must_use]
    pub fn with_stage(self, stage: Stage) -> Self {
        Self { stage: Some(stage), ..self }
    }

    /// Sets the text for people, cut at [`INFO_BYTES_MAX`].
    #[must_use]
    pub fn with_info(mut self, info: impl Into<String>) -> Self {
        self.info = info.into();
        let end = (0..=INFO_BYTES_MAX.min(self.info.len())).rev().find(|&end| self.info.is_char_boundary(end));
        self.info.truncate(end.unwrap_or(0));
        self
    }

    /// Requests the view of the last scan in the next observation.
    #[must_use]
    pub fn with_view_request(mut self) -> Self {
        self.want_view = true;
        self
    }

    /// Whether the run is the same without it: between its wake-ups the server ignores such a
    /// command, its wake-up condition included.
    #[must_use]
    pub fn is_noop(&self) -> bool {
        self.motion == Motion::Keep
            && self.lidar == ScanRequest::Keep
            && !self.want_view
            && self.messages.is_empty()
            && self.stage.is_none()
            && self.info.is_empty()
    }

    /// The command as a message, without the id of the run: messages to agents come before those to
    /// relays.
    #[must_use]
    pub fn into_message(self, agent: AgentId, tick: Tick) -> maes_msgs::Command {
        let (to_relays, to_agents): (Vec<_>, Vec<_>) =
            self.messages.into_iter().partition(|message| message.peer.is_relay());
        maes_msgs::Command {
            tick: tick.0,
            run: 0,
            agent: agent.0,
            motion: self.motion.into(),
            lidar: self.lidar.into(),
            want_view: self.want_view,
            messages: to_agents.into_iter().chain(to_relays).map(Into::into).collect(),
            wake: self.wake.into(),
            info: self.info,
            known_free: 0,
            failed_searches: 0,
            stage: Stage::on_wire(self.stage),
        }
    }

    /// The command of a message. A wake-up condition for the present tick or an earlier one is one
    /// for the next tick.
    ///
    /// # Errors
    /// Names the field, its value and the allowed values, if the command is not legal for a team of
    /// `agents`.
    pub fn from_message(message: &maes_msgs::Command, agents: u32) -> Result<Self, String> {
        if message.info.len() > INFO_BYTES_MAX {
            return Err(format!("info has {} bytes, at most {INFO_BYTES_MAX} are allowed", message.info.len()));
        }
        let stage = Stage::from_wire(message.stage).map_err(|error| error.to_string())?;
        let wake = WakeCondition {
            at: Tick(message.wake.at_tick.max(message.tick.saturating_add(1))),
            events: EventMask::from_bits_retain(message.wake.events),
        };
        let command = Self {
            motion: Motion::try_from(&message.motion)?,
            lidar: ScanRequest::try_from(message.lidar).map_err(|error| error.to_string())?,
            want_view: message.want_view,
            messages: AgentMessage::of_command(&message.messages, agents)?,
            wake,
            stage,
            info: message.info.clone(),
        };
        let list_bytes = POINT_BYTES * message.motion.path.len()
            + message.messages.iter().map(|message| AGENT_MESSAGE_BYTES_BARE + message.data.len()).sum::<usize>();
        if list_bytes > LIST_BYTES_MAX {
            return Err(format!("path and messages take {list_bytes} bytes, at most {LIST_BYTES_MAX} are allowed"));
        }
        Ok(command)
    }
}

#[cfg(test)]
mod tests;
