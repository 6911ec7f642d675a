//! The goals of the planner.

use msgs::ids::AgentId;
use voxels::Cell;

use agent::command::Stage;

/// A goal, by the stage that chose it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Goal {
    /// Exploration: the end of a branch, for the unexplored cells visible from there.
    Viewpoint {
        /// The end of the branch.
        cell: Cell,
        /// Its gain when it was chosen.
        gain: u32,
    },
    /// Relocation: the nearest frontier.
    Frontier {
        /// The viewpoint of the frontier.
        cell: Cell,
        /// The frontier.
        frontier: Cell,
    },
    /// A place from which a body that is too wide to go there sees something unexplored.
    Sight {
        /// The place.
        cell: Cell,
        /// What is seen from there.
        target: Cell,
    },
    /// Pursuit of another agent at its last known position, to deliver the map.
    Pursuit {
        /// The agent.
        agent: AgentId,
        /// Its last known position.
        cell: Cell,
    },
    /// A random region, to deliver the map to whichever agent is met.
    Wandering {
        /// The centre of the region.
        cell: Cell,
    },
    /// The place of a planned meeting.
    Meeting {
        /// The place.
        cell: Cell,
    },
    /// Evasion of other agents that block the path.
    Evasion {
        /// The cell to evade to.
        cell: Cell,
    },
}

impl Goal {
    /// The cell of the goal.
    pub(super) fn cell(self) -> Cell {
        match self {
            Self::Viewpoint { cell, .. }
            | Self::Frontier { cell, .. }
            | Self::Sight { cell, .. }
            | Self::Pursuit { cell, .. }
            | Self::Wandering { cell }
            | Self::Meeting { cell }
            | Self::Evasion { cell } => cell,
        }
    }

    /// What an agent on the way to it is busy with.
    pub(super) fn stage(self) -> Stage {
        match self {
            Self::Viewpoint { .. } => Stage::Exploring,
            Self::Frontier { .. } | Self::Sight { .. } => Stage::Relocating,
            Self::Pursuit { .. } | Self::Wandering { .. } | Self::Meeting { .. } => Stage::Carrying,
            Self::Evasion { .. } => Stage::Waiting,
        }
    }

    /// The text for people.
    pub(super) fn info(self) -> String {
        let at = |cell: Cell| format!("({}, {}, {})", cell.x, cell.y, cell.z);
        match self {
            Self::Viewpoint { cell, gain } => format!("exploration to {}, {gain} unexplored cells", at(cell)),
            Self::Frontier { cell, .. } => format!("relocation to {}", at(cell)),
            Self::Sight { cell, .. } => format!("to {}, to look from there", at(cell)),
            Self::Pursuit { agent, cell } => format!("with news to agent {agent}, last at {}", at(cell)),
            Self::Evasion { cell } => format!("out of the way to {}", at(cell)),
            Self::Meeting { cell } => format!("to the meeting at {}", at(cell)),
            Self::Wandering { cell } => format!("with news to {}", at(cell)),
        }
    }
}
