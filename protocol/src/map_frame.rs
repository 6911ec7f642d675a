//! Where the map of another agent is on that of an agent whose localisation drifts.
//!
//! The message is `maes_msgs/MapFrames`, the data of a message of the server to an agent.

use msgs::ids::{AgentId, Tick};
use msgs::shared_bytes::SharedBytes;
use msgs::{cdr, maes_msgs};
use nalgebra::Point3;
use voxels::Extent;

use crate::geometry::{point, point_of};
use crate::server_message::{decode, wrong};
use crate::wire_error::WireError;

/// The map of another agent, as seen from an agent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapFrame {
    /// The other agent.
    pub agent: AgentId,
    /// Where the origin of its map is on the own map, metres: a whole number of cells.
    pub origin: Point3<f64>,
}

impl MapFrame {
    /// What to add to a cell of that map to get the cell of the own map.
    #[must_use]
    pub fn offset(&self, extent: Extent) -> [i32; 3] {
        [0, 1, 2].map(|axis: usize| libm::round(self.origin[axis] / extent.cell_m()) as i32)
    }

    /// The data of the message of the server.
    pub(crate) fn to_data(frames: &[Self]) -> SharedBytes {
        let frames =
            frames.iter().map(|frame| maes_msgs::Contact { agent: frame.agent.0, position: point(&frame.origin) });
        SharedBytes::from(cdr::encode(&maes_msgs::MapFrames { frames: frames.collect() }))
    }

    /// The frames that the data of a message of the server in the observation of a tick holds, in a
    /// team of `agents`.
    ///
    /// # Errors
    /// If it is no `maes_msgs/MapFrames`, or a value in it is none that a run can have.
    pub(crate) fn from_data(data: &[u8], tick: Tick, agents: u32) -> Result<Vec<Self>, WireError> {
        let maes_msgs::MapFrames { frames } = decode(data, tick, "a maes_msgs/MapFrames of kind MAP_FRAMES")?;
        let frames: Vec<Self> = frames
            .iter()
            .map(|frame| Self { agent: AgentId(frame.agent), origin: point_of(&frame.position) })
            .collect();
        if !frames.is_sorted_by(|a, b| a.agent < b.agent) || frames.iter().any(|frame| frame.agent.0 >= agents) {
            let allowed = format!("agents of the run, 0 to {}, each once, ascending", agents.saturating_sub(1));
            return Err(wrong(tick, "map_frames", frames.len(), allowed));
        }
        // No map has more than 2^30 cells along an axis.
        let is_offset = |frame: &&Self| frame.origin.iter().all(|along| along.abs() < ORIGIN_MAX_M);
        match frames.iter().find(|frame| !is_offset(frame)) {
            Some(frame) => Err(wrong(tick, "map_frames", format_args!("{frame:?}"), "numbers below 1e9")),
            None => Ok(frames),
        }
    }
}

/// Bound of the coordinates of an origin, metres.
const ORIGIN_MAX_M: f64 = 1e9;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_round_trips() {
        let frame = |agent, x| MapFrame { agent: AgentId(agent), origin: Point3::new(x, 0.0, -0.5) };
        let frames = vec![frame(1, 1.5), frame(4, -2.0)];
        let data = MapFrame::to_data(&frames);
        assert_eq!(MapFrame::from_data(&data, Tick(3), 5), Ok(frames.clone()));
        assert_eq!(frames[0].offset(Extent::new([9, 9, 9], 0.5).unwrap()), [3, 0, -1]);
    }

    #[test]
    fn impossible_frames_are_refused() {
        let frame = |agent, x| MapFrame { agent: AgentId(agent), origin: Point3::new(x, 0.0, 0.0) };
        let refused =
            |frames: &[MapFrame]| MapFrame::from_data(&MapFrame::to_data(frames), Tick(3), 5).unwrap_err().to_string();
        assert!(refused(&[frame(5, 1.0)]).ends_with("expected agents of the run, 0 to 4, each once, ascending"));
        assert!(refused(&[frame(1, 1.0), frame(1, 1.0)]).contains("map_frames = 2"));
        assert!(refused(&[frame(1, f64::NAN)]).contains("expected numbers below 1e9"));
        assert!(MapFrame::from_data(&[1, 2], Tick(3), 5).is_err());
    }
}
