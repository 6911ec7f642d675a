//! Complete runs in one process, with all controllers and kinds of bodies. One program, so that
//! cargo links it once and its tests share all cores.

mod support;

mod base_stations;
mod bodies;
mod changing_worlds;
mod corridors;
mod drift;
mod endings;
mod energy;
mod ground;
mod in_process;
mod lanes;
mod moving_obstacles;
mod sensors;
mod wide_bodies;
