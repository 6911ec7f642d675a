//! What an agent is on its way for.

use msgs::ids::AgentId;
use voxels::Cell;

/// Where an agent goes, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Goal {
    /// Exploration: to the end of a branch, for the unexplored cells that are seen from there.
    Viewpoint {
        /// The end of the branch.
        cell: Cell,
        /// Unexplored cells that it was chosen for.
        gain: u32,
    },
    /// Relocation: to the nearest frontier.
    Frontier {
        /// Where to look at it from.
        cell: Cell,
        /// The frontier.
        frontier: Cell,
    },
    /// With news, to where another agent was last.
    Pursuit {
        /// Who.
        agent: AgentId,
        /// Where.
        cell: Cell,
    },
    /// With news, to anywhere.
    Wandering {
        /// Where.
        cell: Cell,
    },
    /// Out of the way of others.
    Evasion {
        /// Where.
        cell: Cell,
    },
}

impl Goal {
    /// Where it leads.
    pub(super) fn cell(self) -> Cell {
        match self {
            Self::Viewpoint { cell, .. }
            | Self::Frontier { cell, .. }
            | Self::Pursuit { cell, .. }
            | Self::Wandering { cell }
            | Self::Evasion { cell } => cell,
        }
    }

    /// For people.
    pub(super) fn info(self) -> String {
        let at = |cell: Cell| format!("({}, {}, {})", cell.x, cell.y, cell.z);
        match self {
            Self::Viewpoint { cell, gain } => format!("exploration to {}, {gain} unexplored cells", at(cell)),
            Self::Frontier { cell, .. } => format!("relocation to {}", at(cell)),
            Self::Pursuit { agent, cell } => format!("with news to agent {agent}, last at {}", at(cell)),
            Self::Evasion { cell } => format!("out of the way to {}", at(cell)),
            Self::Wandering { cell } => format!("with news to {}", at(cell)),
        }
    }
}
