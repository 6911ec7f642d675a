//! Geometry on a voxel grid: cells, extents, dense grids, ray traversal, map files.
//!
//! **Axes.** Right-handed, x forward, y left, z up; the map spans 0 to `size * cell_m` metres on
//! each axis.
//! **Rounding.** A point lies in the cell whose coordinates are the floor of the point's
//! coordinates divided by `cell_m`; a point on the boundary of two cells belongs to the upper one.
//! **Order.** The index of a cell is `(z * size_y + y) * size_x + x`. [`Cell`]'s `Ord` agrees with
//! it, and every function here that returns several cells returns them in that order unless it
//! says otherwise.
//!
//! There are no agents and no time here, and what is random is drawn from [`random_streams`], whose
//! seed is an argument.

#![warn(missing_docs)]

pub mod bits;
pub mod blocks;
pub mod body_lattice;
pub mod cell;
pub mod cell_set;
pub mod clearance;
pub mod components;
pub mod extent;
pub mod footing;
pub mod grid;
pub mod lattice;
pub mod m3dm;
pub mod octree;
pub mod open_space;
pub mod packed;
pub mod projection;
pub mod random_streams;
pub mod runs;
pub mod sight;
pub mod terrain;
pub mod through;
pub mod traverse;

pub use bits::{bits, bits_of};
pub use blocks::Blocks;
pub use body_lattice::BodyLattice;
pub use cell::{Cell, FACES};
pub use cell_set::CellSet;
pub use clearance::{Clearance, Passage};
pub use components::{
    Components, Pockets, STRETCH_BYTES, close_shell, free_components, free_stretches, keep_largest_component,
};
pub use extent::{Extent, ExtentError};
pub use footing::{Climb, Footing, Ground};
pub use grid::{Grid, GridError};
pub use m3dm::M3dmError;
pub use open_space::OpenSpace;
pub use packed::PackedError;
pub use runs::{RunsError, check_runs, indices, runs};
pub use sight::{Sight, WallBox, line_of_sight, sight};
pub use terrain::{Terrain, TextError, is_wall_at};
pub use through::length_in_walls_m;
pub use traverse::{walk, walk_segment};
