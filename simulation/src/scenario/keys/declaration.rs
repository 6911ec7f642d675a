//! The rows of the declaration: one for each key, in the order of docs/scenario.md.
//!
//! A row is `key(name, type, default, range, meaning, source)`. `source` is Markdown for
//! docs/scenario.md and says where the default comes from: "reference" is MAES3D, "ours" has no
//! counterpart there. Tests compare every row with the structs of the scenario.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use protocol::limits::{AGENT_MESSAGE_BYTES_MAX, RELAYS_PER_AGENT_MAX};

use crate::scenario::{AGENTS_MAX, PointsField, RecordedView};

use super::DefaultValue::{Is, Required, Unset};
use super::Kind::{
    Boolean, Bytes, Corners, Ids, Integer, Keys, Name, Number, NumberOrMax, Numbers, Path, Poses, Position, Positions,
    Seed, Settings, Size, Texts, Word, Words,
};
use super::{POSITIVE, Range, Table, above, at_least, between, key};

const NONE: Option<Range> = None;

/// Ticks between two events.
const PERIOD: Option<Range> = at_least(1.0, U32_MAX);

/// Ticks between two events; 0 switches them off.
const PERIOD_OR_NEVER: Option<Range> = at_least(0.0, U32_MAX);

/// Two full messages, so that a send queue never blocks, to 1 GiB.
const QUEUE_BYTES: Option<Range> = between(2.0 * AGENT_MESSAGE_BYTES_MAX as f64, 1_073_741_824.0);

const U32_MAX: f64 = 4_294_967_295.0;
const UNLIMITED: f64 = f64::INFINITY;

/// All keys, table by table.
#[rustfmt::skip]
pub const TABLES: [Table; 27] = [
    Table::new("", &[
        key("seed", Seed, Required, NONE,
            "seed of everything random: the map, unless map.seed is given, and the agents",
            "reference, but see [differences](reference-differences.md)"),
        key("duration_s", Number("s"), Required, between(0.02, 2e8),
            "sim time after which the run ends", "reference: 60 to 7200, 1800 by default")
            .checked_elsewhere().limits("a multiple of 0.02, 0.02 to 2e8").changeable(),
        key("stop_when_explored", Boolean, Is("true"), NONE,
            "whether the run ends once every free cell has been seen, no more can be seen, or the team stands still \
             for five minutes",
            "ours").changeable(),
        key("stop_when_covered", Boolean, Is("false"), NONE,
            "whether the run ends once a body has been in every free cell; full exploration does not end it then",
            "ours").changeable(),
        key("stop_when_back", Boolean, Is("false"), NONE,
            "whether the run ends once all agents rest in their bases, and all is explored or they have waited there \
             for 10 s; nothing else but the duration ends it then", "ours").limits("true only with `[energy]`").changeable()
            .see("energy.md"),
        key("stop_when_known_at_base", Boolean, Is("false"), NONE,
            "whether the run ends once a base station knows all that the team can see; exploration and coverage do not \
             end it then", "ours").limits("true only with `agents.base_stations`").changeable()
            .see("communication.md#base-stations"),
    ]),
    Table::new("map", &[
        key("kind", Word(&["spheres", "noise", "building", "mine", "scene", "file"]), Required, NONE,
            "the generator of the map, or a map file", "reference").see("maps.md"),
        key("size", Size, Unset("required unless `\"file\"`"), between(5.0, 1024.0),
            "cells along each axis; one number for a cube", "reference: 30 to 100, 50 by default")
            .limits("5 to 1024 along each axis; not with `\"file\"`"),
        key("cell_m", Number("m"), Unset("1.0, or as stored in the map file"), POSITIVE,
            "edge length of a cell", "reference: 1")
            .limits("above 0, up to 1e6; with a file that stores it, the same"),
        key("seed", Seed, Unset("that of the run"), NONE,
            "seed of the map alone: the same map with other random streams of the agents", "ours"),
        key("file", Path, Unset("required for `\"file\"`"), NONE,
            "the map file; it and other paths of the map start from the folder of the scenario file, those of flags from the \
             present one", "reference: one fixed path")
            .limits("a known [format](maps.md#file-formats); only with `\"file\"`"),
    ]),
    Table::new("map.import", &[
        key("fill", Word(&["solid", "shell"]), Unset("`\"solid\"`"), NONE,
            "meshes: which cells are wall, the solid ones or those of the surface alone", "ours"),
        key("inside", Word(&["wall", "free"]), Unset("`\"wall\"`"), NONE,
            "meshes: what the inside is; free makes a cave of a mesh", "ours"),
        key("unknown", Word(&["wall", "free"]), Unset("`\"wall\"`"), NONE,
            "OctoMap, map.yaml, point clouds with a sensor: what the cells are that the file does not know", "ours"),
        key("up", Word(&["y", "z"]), Unset("`\"z\"`"), NONE,
            "meshes and point clouds: axis of the file that points upwards", "ours"),
        key("scale", Number("m"), Unset("1.0"), above(0.0, f64::MAX),
            "meshes and point clouds: length of a unit of the file", "ours").limits("a finite number above 0"),
        key("margin_cells", Integer("cells"), Unset("0"), between(0.0, 500.0),
            "meshes and point clouds: layers of free cells around the content of the file", "ours"),
        key("crop", Corners("m"), Unset("all of the file"), NONE,
            "meshes, point clouds and OctoMap: what lies outside this box (lowest and highest corner, in the coordinates of \
             the origin that the report gives) is left out", "ours")
            .limits("six finite numbers, each of the last three above that of the first three"),
        key("free_from", Position("units of the file"), Unset("all free cells stay"), NONE,
            "meshes, point clouds and OctoMap: only cells connected with this position of the file stay free", "ours")
            .limits("three finite numbers"),
        key("gap_cells", Integer("cells"), Unset("0"), between(0.0, 100.0),
            "openings of at most so many cells are closed, so that the space around free_from ends at them", "ours")
            .limits("0 to 100; only with `free_from`"),
        key("sensor", Position("units of the file"), Unset("that of the file, if it has one"), NONE,
            "point clouds: position of the sensor; cells between it and the points are free, all others unknown", "ours")
            .limits("three finite numbers"),
        key("stations", Positions("units of the file"), Unset("none"), NONE,
            "point clouds: positions of the sensor; each point counts as seen from the nearest one in sight", "ours")
            .limits("1 to 10000 positions; not with `sensor`"),
        key("trajectory", Path, Unset("none"), NONE,
            "point clouds: a file of TUM (timestamp tx ty tz qx qy qz qw) with the positions of the sensor: of each point \
             that at its time if the cloud has times, else the nearest one in sight", "ours")
            .limits("at most 1 GiB; not with `sensor` or `stations`"),
        key("voxel_min_points", Integer(""), Unset("1"), between(1.0, 1_000_000.0),
            "point clouds: cells with fewer points count as empty, and these points as absent", "ours"),
        key("outliers", Integer("cells"), Unset("0"), between(0.0, 1_000_000.0),
            "point clouds: the points of groups of at most so many cells, which touch at least at a corner, are dropped",
            "ours"),
        key("classes", Bytes, Unset("all"), NONE,
            "LAS: only points of these classes are used", "ours"),
        key("drop_flags", Words(&["withheld", "synthetic", "key_point", "overlap", "none"]),
            Unset("`[\"withheld\"]`"), NONE,
            "LAS: points with one of these flags are dropped", "ours"),
        key("model_path", Texts, Unset("none"), NONE,
            "SDF: folders in which model://NAME is looked for, beside that of the file", "ours")
            .limits("up to 16 folders"),
        key("height_cells", Integer("cells"), Unset("5"), between(1.0, 1022.0),
            "floor plans: free cells from floor to ceiling; of a map.yaml as many as come nearest to 2.5 m", "ours"),
        key("threshold", Number(""), Unset("0.9"), between(0.0, 1.0),
            "floor plans: brightness from which a pixel is free", "ours"),
        key("cells_max", Integer("cells"), Unset("2^24, or 1024 for each byte of the file if that is more, up to 2^27"),
            between(1.0, 1_073_741_824.0), "largest number of cells of the map, a bound on its memory", "ours"),
        key("steps_max", Integer(""), Unset("2^28, some seconds"), between(1.0, 1_099_511_627_776.0),
            "meshes and point clouds: largest number of steps of the import, a bound on its time", "ours"),
    ]).checked_by_mapgen(),
    Table::new("map.spheres", &[
        key("fill_ratio", Number(""), Is("0.2"), above(0.0, 1.0),
            "spheres are added until they have freed this share of the volume; tunnels come on top",
            "reference: 0.01 to 0.30, 0.20")
            .limits("above 0, up to the share of the cells that spheres can reach: (x-3)(y-3)(z-3) / xyz"),
        key("radius_min", Integer("cells"), Is("3"), between(0.0, 510.0),
            "smallest radius of a sphere, and radius of every tunnel", "reference: 2 to 15, 3")
            .limits("0 to (shortest side - 4) / 2"),
        key("radius_max", Integer("cells"), Is("8"), between(0.0, 510.0),
            "largest radius of a sphere", "reference: 2 to 15, 8")
            .limits("`radius_min` to (shortest side - 4) / 2"),
        key("connections", Integer(""), Is("3"), between(0.0, 64.0),
            "number of its nearest spheres to which each sphere is joined", "reference: 1 to 10, 3"),
        key("smoothing", Integer(""), Is("5"), between(0.0, 1000.0),
            "smoothing passes", "reference: 0 to 20, 5"),
        key("random", Word(&["chacha", "unity", "unity-named"]), Is("\"chacha\""), NONE,
            "the random numbers; with those of the reference's engine, a seed of 32 bits makes \
             [the reference's map](maps.md#maps-of-maes3d)", "reference: unity"),
    ]).checked_by_mapgen(),
    Table::new("map.noise", &[
        key("fill", Number(""), Is("0.53"), between(0.0, 1.0),
            "probability that an inner cell starts as wall", "reference: 0.45 to 0.60, 0.53"),
        key("smoothing", Integer(""), Is("5"), between(0.0, 1000.0),
            "smoothing passes", "reference: 0 to 20, 5"),
    ]).checked_by_mapgen(),
    Table::new("map.building", &[
        key("floors", Integer(""), Is("3"), between(1.0, 500.0),
            "floors on top of each other; everything above them is solid", "ours")
            .limits("1 to as many as fit into `map.size`, up to 500: z of at least \
                     `floors` * (`floor_height` + `slab`) - `slab` + 2"),
        key("floor_height", Integer("cells"), Is("3"), between(2.0, 1022.0),
            "free cells between floor and ceiling", "ours").limits("2 to z - 2"),
        key("slab", Integer("cells"), Is("1"), between(1.0, 1024.0),
            "solid cells between two floors", "ours"),
        key("hall_share", Number(""), Is("0.2"), above(0.0, 0.9),
            "hallways are added until they have this share of a floor; there is always one",
            "ancestor: 20 %"),
        key("hall_width", Integer("cells"), Is("4"), between(1.0, 1020.0),
            "width of every hallway", "ancestor").limits("1 to the width that leaves a room on either side"),
        key("room_side_min", Integer("cells"), Is("6"), between(2.0, 1020.0),
            "shortest side of a room", "ancestor").limits("2 to the width that fits beside the first hallway"),
        key("split_chance", Number(""), Is("0.85"), between(0.0, 1.0),
            "probability that a part is split once more into rooms, after the first split", "ancestor: 85 %"),
        key("door_width", Integer("cells"), Is("2"), between(1.0, 1020.0),
            "width of a door", "ancestor")
            .limits("1 to the smaller of `hall_width` and `room_side_min` - 2 * `door_padding`"),
        key("door_height", Integer("cells"), Is("2"), between(1.0, 1022.0),
            "height of a door", "ours").limits("1 to `floor_height`"),
        key("door_padding", Integer("cells"), Is("2"), between(0.0, 510.0),
            "wall on either side of a door, where it fits", "ancestor").limits("0 to (`room_side_min` - 1) / 2"),
        key("staircases", Integer(""), Is("2"), between(0.0, 64.0),
            "staircases, each through all floors", "ours")
            .limits("0 to 64, as many as fit along the first hallway; \
                     at least 1 if there are several floors without lift shafts"),
        key("stair_width", Integer("cells"), Is("2"), between(1.0, 1020.0),
            "width of a flight, and length of its landings", "ours").limits("1 to `room_side_min`"),
        key("lift_shafts", Integer(""), Is("0"), between(0.0, 64.0),
            "shafts through all floors, for bodies that can go straight up", "ours")
            .limits("0 to 64, as many as fit along the first hallway"),
        key("lift_width", Integer("cells"), Is("2"), between(1.0, 1020.0),
            "sides of a lift shaft", "ours").limits("1 to `room_side_min`"),
        key("entrances", Integer(""), Is("2"), between(0.0, 64.0),
            "doors to the outside on the ground floor, each a niche in the outer wall", "ours")
            .limits("0 to 64, as many as hallways end at the outer wall"),
    ]).checked_by_mapgen(),
    Table::new("map.mine", &[
        key("levels", Integer(""), Is("3"), between(1.0, 50.0),
            "levels on top of each other", "ours")
            .limits("1 to as many as fit into `map.size`, up to 50: z of at least \
                     (`levels` - 1) * `level_spacing` + `drift_height` + 4"),
        key("level_spacing", Integer("cells"), Is("20"), between(4.0, 500.0),
            "from the floor of a level to that of the next", "ours").limits("4 to 500, more than `drift_height`"),
        key("drift_width", Integer("cells"), Is("4"), between(1.0, 100.0),
            "width of drifts, crosscuts and the ramp", "ours: that of vehicles; Sangdong: 3 m")
            .limits("1 to 100, as far as the mine fits into x and y"),
        key("drift_height", Integer("cells"), Is("4"), between(2.0, 100.0),
            "height of drifts, crosscuts and the ramp", "ours; Sangdong: 3 m")
            .limits("2 to 100, less than `level_spacing`"),
        key("crosscut_spacing", Integer("cells"), Is("12"), between(2.0, 500.0),
            "from a crosscut to the next", "Sangdong: 12 m"),
        key("crosscut_chance", Number(""), Is("0.7"), between(0.0, 1.0),
            "probability that a crosscut goes through; others end blind halfway, and one of a level always goes through",
            "ours"),
        key("ramp_gradient", Number(""), Is("0.15"), between(0.02, 1.0),
            "rise of the ramp for each cell along it", "Sangdong: at most 15 %"),
        key("stopes", Integer(""), Is("2"), between(0.0, 64.0),
            "stopes on each level; they may overlap", "ours"),
        key("stope_length", Integer("cells"), Is("17"), between(1.0, 500.0),
            "size of a stope along the ore drift", "Obuasi: 17 m"),
        key("stope_width", Integer("cells"), Is("12"), between(1.0, 500.0),
            "size of a stope across the drift", "ours; Obuasi: 30 m").limits("1 to 500, as far as the mine fits into y"),
        key("stope_height", Integer("cells"), Is("16"), between(1.0, 500.0),
            "height of a stope, cut off below the top of the map", "ours; Obuasi: 27 m"),
        key("overbreak", Number(""), Is("0.15"), between(0.0, 1.0),
            "probability that a cell of a wall or roof breaks out", "ours"),
    ]).checked_by_mapgen(),
    Table::new("map.scene", &[
        key("name", Word(&["office", "octagon-maze", "tunnels", "garage", "pillars", "campus", "forest"]), Is("\"office\""), NONE,
            "which place", "ours; see [maps.md](maps.md#scenes-at-true-scale)"),
    ]).checked_by_mapgen(),
    Table::new("agents", &[
        key("count", Integer(""), Required, between(1.0, AGENTS_MAX as f64),
            "number of agents; their ids are 0 to count - 1", "reference: 1 to 10, 3"),
        key("controller", Name, Is("\"rbw\""), NONE,
            "controller of every agent to which neither mix nor its command line gives another", "reference: RBW")
            .limits("a name from [controllers.md](controllers.md), or that of a controller of your own").changeable(),
        key("share_period_ticks", Integer("ticks"), Is("251"), PERIOD_OR_NEVER,
            "ticks between two map updates that an agent sends to its contacts; 0: it only receives",
            "reference: 5.02 s").changeable(),
        key("set", Settings, Is("{}"), NONE,
            "settings of the controller", "ours").changeable(),
        key("cmd_vel", Ids, Is("[]"), NONE,
            "agents without a controller, externally controlled by velocity commands over ROS 2", "ours")
            .limits("0 to `count` - 1, each once; over ROS 2 only").see("own-node.md"),
        key("reserve", Ids, Is("[]"), NONE,
            "agents that are not in the world until the service spawn_entity lets them join", "ours")
            .limits("0 to `count` - 1, each once, and without `[[event]]`").see("ros2.md#services"),
        key("base_stations", Ids, Is("[]"), NONE,
            "agents that stay at their start, as base stations that need the map", "ours; SubT")
            .limits("0 to `count` - 1, each once, neither in `cmd_vel` nor in `mix`")
            .see("communication.md#base-stations"),
        key("command", Texts, Is("[]"), NONE,
            "program of one's own, with its arguments, that runs agents; empty: agent_node", "ours")
            .limits("a program, then its arguments, in which `{id}` is the id of the agent; over memory only without it")
            .see("controllers.md#in-a-program-of-your-own"),
        key("command_ids", Ids, Is("[]"), NONE,
            "agents that the program runs; empty: all", "ours")
            .limits("0 to `count` - 1, each once; only with `command`"),
        key("command_signs", Boolean, Is("true"), NONE,
            "whether the program signs its commands, as one based on agent_node does", "ours")
            .limits("false only with `command`").see("own-node.md#in-plans"),
    ]),
    Table::new("agents.mix", &[
        key("controller", Name, Required, NONE,
            "controller of these agents", "ours")
            .limits("a name from [controllers.md](controllers.md), or that of a controller of your own"),
        key("share", Number(""), Unset("required without `ids`"), between(0.0, 1.0),
            "which part of the agents that run controllers, cut along their ids in the order of the entries", "ours")
            .limits("0 to 1, at most 1 taken together; all entries have it, or none"),
        key("ids", Ids, Is("[]"), NONE,
            "the agents, instead of a share", "ours").limits("0 to `count` - 1, each in one entry at most"),
        key("set", Settings, Is("{}"), NONE,
            "settings of the controller", "ours"),
    ]),
    Table::new("spawn", &[
        key("kind", Word(&["nearest_origin", "list", "scattered", "box", "entrances"]), Is("\"nearest_origin\""), NONE,
            "how start poses are chosen", "reference: the first"),
        key("yaw_rad", Number("rad"), Is("0.0"), between(-TAU, TAU),
            "start heading of all agents", "reference: along its depth axis, our y")
            .only_with(&["nearest_origin", "scattered", "box"]),
        key("poses", Poses, Unset("required for `\"list\"`"), NONE,
            "start poses by agent: [x, y, z] or [x, y, z, yaw]", "ours")
            .limits("one entry for each agent, with room for its body").only_with(&["list"]),
        key("min_distance_m", Number("m"), Is("0.0"), between(0.0, 1e6),
            "least distance between the centres of two bodies", "ours").only_with(&["scattered"]),
        key("seed", Seed, Unset("that of the run"), NONE,
            "seed of the start poses alone", "ours").only_with(&["scattered"]),
        key("low", Position("m"), Unset("required for `\"box\"`"), NONE,
            "lowest corner of the box", "ours").limits("finite").only_with(&["box"]),
        key("high", Position("m"), Unset("required for `\"box\"`"), NONE,
            "highest corner of the box", "ours")
            .limits("finite, no coordinate below that of `low`").only_with(&["box"]),
    ]),
    Table::new("body", &[
        key("kind", Word(&["submarine", "aerial", "ground"]), Is("\"submarine\""), NONE,
            "how the body moves; the keys left out are those of the kind", "reference: the first"),
        key("radius_m", Number("m"), Is("0.4"), POSITIVE,
            "radius of the sphere that collides", "reference").limits("0.001 to 16 cells"),
        key("speed_max_m_s", Number("m/s"), Is("1.5"), POSITIVE,
            "top speed along the path, whatever its direction", "reference")
            .limits("above 0, up to 50 cells in a second"),
        key("acceleration_m_s2", Number("m/s^2"), Is("0.5"), POSITIVE,
            "acceleration", "reference"),
        key("deceleration_m_s2", Number("m/s^2"), Is("0.25"), POSITIVE,
            "braking", "reference"),
        key("turn_rate_max_rad_s", Number("rad/s"), Is("1.7453292519943295"), POSITIVE,
            "top turn rate", "reference: 100 degrees/s"),
        key("turn_acceleration_rad_s2", Number("rad/s^2"), Is("0.8726646259971648"), POSITIVE,
            "acceleration of a turn", "reference: 50 degrees/s^2"),
        key("turn_deceleration_rad_s2", Number("rad/s^2"), Is("0.4363323129985824"), POSITIVE,
            "braking of a turn", "reference: 25 degrees/s^2"),
        key("drive", Word(&["differential", "holonomic"]), Unset("`\"differential\"`"), NONE,
            "how it moves on the floor", "ours")
            .limits("only with `\"ground\"`").see("ground.md"),
        key("step_max_m", Number("m"), Unset("0.1"), between(0.0, 1e6),
            "highest step that it climbs", "ours").limits("0 to 16 cells, only with `\"ground\"`"),
        key("slope_max_rad", Number("rad"), Unset("0.35"), between(0.0, FRAC_PI_4),
            "steepest slope that it climbs", "ours").limits("0 to pi/4, only with `\"ground\"`"),
    ]),
    Table::new("bodies", &[
        key("agents", Ids, Required, NONE,
            "agents with this body", "ours").limits("0 to `agents.count` - 1, each in one entry at most"),
    ]),
    Table::new("lidar", &[
        key("preset", Word(&["vlp-16", "os1-64", "mid-360", "depth-camera"]), Unset("none"), NONE,
            "a ready LiDAR or camera; the other keys change it", "[makers](sensors.md#presets)"),
        key("pattern", Word(&["lattice", "shell", "ring", "frustum"]), Unset("`\"lattice\"`, or that of the preset"), NONE,
            "how rays are spread: evenly over all directions, to each cell on the edge of a sphere, in lines about the vertical, or \
             through the pixels of a depth camera",
            "reference: the first; the second is its older sensing").see("sensors.md"),
        key("rays", Integer(""), Is("5124"), between(1.0, 1e6),
            "rays of the lattice", "reference"),
        key("shell_radius_cells", Integer("cells"), Is("5"), between(1.0, 200.0),
            "radius of the shell, and its range", "reference"),
        key("range_m", Number("m"), Unset("`inf`; of a frustum 4.5"), above(0.0, UNLIMITED),
            "length of the rays; the shell does not use it", "reference: unlimited"),
        key("fov_rad", Number("rad"), Is("6.283185307179586"), above(0.0, TAU),
            "full opening angle of the cone about the heading", "reference: 360 degrees"),
        key("schedule", Word(&["on_request", "maes3d"]), Is("\"on_request\""), NONE,
            "who decides when to scan: each agent, which gets a scan every period_ticks until it does; \
             or one agent is scanned in each tick, in turn", "reference: the second"),
        key("period_ticks", Integer("ticks"), Is("10"), PERIOD,
            "ticks between two scans until an agent requests otherwise",
            "reference: as many as there are agents, so 10 with its largest team"),
        key("sees_agents", Boolean, Is("false"), NONE,
            "whether rays end at the bodies of other agents", "ours").see("sensors.md"),
        key("horizontal_rad", Number("rad"), Unset("all around; of a frustum 80 degrees"), above(0.0, TAU),
            "full horizontal angle about the heading; this key and the next ones are of rings and frustums alone", "ours").limits("above 0, up to 2 pi, of a frustum up to 3"),
        key("vertical_rad", Number("rad"), Unset("60 degrees"), above(0.0, 3.0),
            "full vertical angle of a frustum", "ours"),
        key("lowest_rad", Number("rad"), Unset("-15 degrees"), between(-FRAC_PI_2, FRAC_PI_2),
            "elevation of the lowest line of a ring", "ours").limits("-pi/2 to `highest_rad`"),
        key("highest_rad", Number("rad"), Unset("15 degrees"), between(-FRAC_PI_2, FRAC_PI_2),
            "elevation of the highest line", "ours").limits("`lowest_rad` to pi/2"),
        key("elevations_rad", Numbers("rad"), Unset("at equal distances"), NONE,
            "elevations of the lines of a ring; without the two keys before and the rows", "ours")
            .limits("1 to 1024 different numbers from -pi/2 to pi/2"),
        key("columns", Integer(""), Unset("1024; of a frustum 80"), between(1.0, 8192.0),
            "rays of a row", "ours"),
        key("rows", Integer(""), Unset("16; of a frustum 60"), between(1.0, 1024.0),
            "rows of pixels, or lines, which have equal distances", "ours")
            .limits("1 to 1024, up to 2^20 rays"),
        key("min_range_m", Number("m"), Unset("0"), between(0.0, 1e6),
            "a ray that meets a wall up to this distance has no return", "ours")
            .limits("0 to below `range_m`"),
        key("mount_height_m", Number("m"), Unset("0"), between(-1e6, 1e6),
            "height of the sensor above the centre of the body", "ours")
            .limits("within the radius of the smallest body"),
        key("mount_pitch_rad", Number("rad"), Unset("0"), between(-FRAC_PI_2, FRAC_PI_2),
            "by how much the sensor looks up", "ours").limits("-pi/2 to pi/2"),
    ]),
    Table::new("lidars", &[
        key("name", Name, Required, NONE,
            "part of its topics and frames", "ours").see("sensors.md#several-sensors")
            .limits("a to z, 0 to 9 and single `_` inside, up to 32; of each agent once"),
        key("agents", Ids, Unset("all"), NONE,
            "agents that have it", "ours").limits("0 to `agents.count` - 1, each once"),
    ]),
    Table::new("communication", &[
        key("range_m", Number("m"), Is("inf"), at_least(0.0, UNLIMITED),
            "greatest distance between two agents in contact; inf: unlimited",
            "reference: unlimited; 50 in its later branch").changeable(),
        key("model", Word(&["line_of_sight", "range", "line_of_sight_and_range", "global", "attenuated"]),
            Is("\"line_of_sight_and_range\""), NONE,
            "when two radios are in contact; range_m belongs to the second and the third", "reference: the first")
            .changeable(),
        key("loss", Number(""), Is("0.0"), between(0.0, 1.0),
            "probability that a message is lost on its way to one receiver", "ours; MAES: a transmission probability")
            .changeable(),
        key("bytes_per_s", Number("bytes/s"), Is("inf"), at_least(1.0, UNLIMITED),
            "bandwidth of each agent", "ours").changeable(),
        key("queue_bytes", Integer("bytes"), Is("1048576"), QUEUE_BYTES,
            "capacity of the send queue of each agent, at least two full messages", "ours").changeable(),
    ]),
    Table::new("communication.attenuation", &[
        key("tx_dbm", Number("dBm"), Is("-20.0"), between(-200.0, 100.0), "transmitted power", "IR2").changeable(),
        key("threshold_dbm", Number("dBm"), Is("-70.0"), between(-200.0, 100.0),
            "least power that can be received", "IR2").changeable(),
        key("reference_loss_db", Number("dB"), Is("31.0"), between(0.0, 300.0),
            "loss over reference_m in the open", "IR2").changeable(),
        key("reference_m", Number("m"), Is("35.0"), POSITIVE, "the reference distance", "IR2").changeable(),
        key("free_exponent", Number(""), Is("2.0"), above(0.0, 20.0), "path loss exponent in the open", "IR2")
            .changeable(),
        key("wall_exponent", Number(""), Is("4.0"), between(0.0, 1000.0),
            "path loss exponent of the part inside walls", "IR2").changeable(),
        key("wall_reference_m", Number("m"), Is("1.0"), POSITIVE,
            "unit length of the part inside walls", "ours").changeable(),
    ]),
    Table::new("communication.relays", &[
        key("per_agent", Integer(""), Is("0"), between(0.0, RELAYS_PER_AGENT_MAX as f64),
            "relays that each agent carries", "SubT: 6 to 12"),
        key("read_range_m", Number("m"), Is("inf"), at_least(0.0, UNLIMITED),
            "distance within which a relay in contact can be read and written; inf: contact is enough",
            "MAES: a range").changeable(),
    ]),
    Table::new("sensor", &[
        key("range_sigma_m", Number("m"), Is("0.0"), between(0.0, 1e6),
            "standard deviation of the distances that LiDARs measure", "ours"),
        key("missed_returns", Number(""), Is("0.0"), between(0.0, 1.0),
            "probability that a ray that meets a wall has no return", "ours"),
        key("pose_bound_m", Number("m"), Is("0.0"), between(0.0, 1e6),
            "greatest error of the measured position along each axis", "MAES"),
        key("pose_step_m", Number("m"), Unset("a tenth of the bound"), between(0.0, 1e6),
            "greatest change of that error along each axis in a tick", "MAES"),
    ]),
    Table::new("localisation", &[
        key("position_noise_m", Number("m"), Is("0.0"), between(0.0, 1e3),
            "standard deviation of the position by odometry along each axis after 1 m; it grows with the root of the distance",
            "ours").see("drift.md"),
        key("position_bias", Number(""), Is("0.0"), between(0.0, 0.5),
            "standard deviation over the agents of the bias of the distances that odometry measures", "ours"),
        key("heading_noise_rad", Number("rad"), Is("0.0"), between(0.0, 1.0),
            "standard deviation of the heading by odometry after 1 m; it grows with the root of the distance", "ours"),
        key("heading_bias_rad_per_m", Number("rad/m"), Is("0.0"), between(0.0, 1.0),
            "standard deviation over the agents of the bias of the heading", "ours"),
        key("turn_noise_rad", Number("rad"), Is("0.0"), between(0.0, 1.0),
            "standard deviation of the heading after a turn of 1 rad; it grows with the root of the angle", "ours"),
        key("turn_bias", Number(""), Is("0.0"), between(0.0, 0.5),
            "standard deviation over the agents of the bias of the turns that odometry measures", "ours"),
        key("closure_range_m", Number("m"), Is("0.0"), between(0.0, 1e3),
            "distance of a place seen before, or of an agent in contact, up to which it closes a loop; 0: none does", "ours"),
        key("closure_gain_m", Number("m"), Is("20.0"), between(0.0, 1e9),
            "least length of odometry that a closure saves", "ours"),
    ]),
    Table::new("energy", &[
        key("capacity_j", Number("J"), Unset("required without `endurance_s`"), above(0.0, 1e12),
            "what a full battery holds; the table is left out where bodies need no energy", "ours").see("energy.md"),
        key("endurance_s", Number("s"), Unset("required without `capacity_j`"), above(0.0, 1e9),
            "how long a full battery lasts at rest away from bases", "ours").limits("above 0, up to 1e9; not with `capacity_j`"),
        key("idle_w", Number("W"), Is("1.0"), between(0.0, 1e6),
            "power that a body draws, except at rest in a base", "ours"),
        key("hover_w", Number("W"), Is("0.0"), between(0.0, 1e6),
            "power that an aerial body draws in addition, to stay in the air", "ours"),
        key("move_j_per_m", Number("J/m"), Is("0.0"), between(0.0, 1e6),
            "energy that a body draws in addition for each metre", "ours"),
        key("charge_w", Number("W"), Is("10.0"), between(0.0, 1e9),
            "power that a body gains at rest in a base; 0: bases do not charge", "ours"),
        key("bases", Positions("m"), Unset("the start of each agent, for it alone"), NONE,
            "centres of the bases, for all agents", "ours").limits("1 to 64 positions in free cells"),
        key("base_radius_m", Number("m"), Is("2.0"), above(0.0, 1e6),
            "distance of the centre of a body from that of a base up to which it is in the base", "ours")
            .limits("above 0, up to 1e6; at least half of the diagonal of a cell"),
        key("return_home", Boolean, Is("true"), NONE,
            "whether controllers go back to a base before their energy ends", "ours"),
        key("reserve", Number(""), Is("0.2"), between(0.0, 0.9),
            "share of the capacity that they plan to have left when they are back", "ours"),
    ]),
    Table::new("recording", &[
        key("poses_period_ticks", Integer("ticks"), Is("10"), PERIOD_OR_NEVER,
            "ticks between two recordings of all poses on /tf; 0: none", "ours"),
    ]),
    Table::new("faults", &[
        key("on_agent_loss", Word(&["abort", "drop", "wait"]), Is("\"abort\""), NONE,
            "what the server does when an agent does not answer within execution.decision_timeout_s: end the run (exit code \
             4), continue without it, or hold the clock until it or another process answers", "ours").see("reliability.md"),
    ]),
    Table::new("event", &[
        key("at_s", Number("s"), Required, between(0.0, 2e8),
            "sim time at which it happens, before the scans of its tick", "ours")
            .checked_elsewhere().limits("a multiple of 0.02, 0 to 2e8; in the order of their times"),
        key("kind", Word(&["join", "leave", "break_down", "radio_off", "radio_on", "wall", "free", "set"]), Required, NONE,
            "what happens to an agent, its radio, cells of the map or keys", "ours"),
        key("agent", Integer(""), Unset("required unless `\"wall\"`, `\"free\"` or `\"set\"`"),
            between(0.0, (AGENTS_MAX - 1) as f64),
            "the agent; of a change of the map the one whose approach it waits for", "ours")
            .only_with(&["join", "leave", "break_down", "radio_off", "radio_on", "wall", "free"])
            .checked_elsewhere().limits("0 to `agents.count` - 1; of a change of the map any agent by default"),
        key("low", Position("m"), Unset("required for `\"wall\"` and `\"free\"`"), NONE,
            "lowest corner of the box whose cells change", "ours").limits("finite").only_with(&["wall", "free"]),
        key("high", Position("m"), Unset("required for `\"wall\"` and `\"free\"`"), NONE,
            "highest corner of the box", "ours")
            .limits("finite, no coordinate below that of `low`").only_with(&["wall", "free"]),
        key("within_m", Number("m"), Unset("it waits for no agent"), at_least(0.0, 1e6),
            "from at_s on the change waits until the centre of a body is as near to its cells", "ours")
            .only_with(&["wall", "free"]),
        key("set", Keys, Unset("required for `\"set\"`"), NONE,
            "new values of keys of the scenario, by their dotted paths", "ours").only_with(&["set"])
            .limits("[these keys](what-if.md#what-may-change)"),
        key("parent", Name, Unset("none"), NONE,
            "where a run was forked, the last digest of the recording that was forked", "ours").only_with(&["set"]),
    ]),
    Table::new("obstacle", &[
        key("kind", Word(&["sphere", "box"]), Required, NONE,
            "its shape; a box lies along the axes", "ours"),
        key("radius_m", Number("m"), Unset("required for `\"sphere\"`"), POSITIVE,
            "its radius", "ours").only_with(&["sphere"]),
        key("size_m", Position("m"), Unset("required for `\"box\"`"), NONE,
            "its edges", "ours").limits("above 0, up to 1e6").only_with(&["box"]),
        key("path", Positions("m"), Required, NONE,
            "points that its centre goes through", "ours")
            .limits("2 to 100, each apart from the next; clear of walls, and no agent at the first one"),
        key("speed_m_s", Number("m/s"), Required, POSITIVE,
            "its speed", "ours").limits("above 0, up to 50 cells in a second"),
        key("repeat", Word(&["to_and_fro", "loop", "once"]), Is("\"to_and_fro\""), NONE,
            "what follows the last point: the way back, the first point, or nothing", "ours"),
        key("start_s", Number("s"), Is("0.0"), between(0.0, 2e8),
            "sim time at which it begins to move", "ours"),
    ]),
    Table::new("views", &[
        key("max_hz", Number("Hz"), Is("30.0"), between(0.1, 1000.0),
            "greatest rate of messages of one topic per second of wall time; recorded topics have no such limit", ""),
        key("tf_period_ticks", Integer("ticks"), Is("5"), PERIOD,
            "ticks between two messages on /tf; those of a recording have recording.poses_period_ticks", ""),
        key("odom_period_ticks", Integer("ticks"), Is("5"), PERIOD,
            "ticks between two messages on /agent_<id>/odom", ""),
        key("points_period_ticks", Integer("ticks"), Is("1"), PERIOD,
            "least ticks between two scans on /agent_<id>/points, scan and depth/image", ""),
        key("points_fields", Words(PointsField::WORDS), Is("[]"), NONE,
            "fields that points have beside x, y and z; ring: with a LiDAR of the pattern ring", "").see("sensors.md#messages"),
        key("path_period_ticks", Integer("ticks"), Is("5"), PERIOD,
            "ticks between two checks whether /agent_<id>/path has changed", ""),
        key("unexplored_period_ticks", Integer("ticks"), Is("50"), PERIOD,
            "ticks between two checks whether /sim/unexplored and the /sim/explored_* maps have changed", ""),
        key("contacts_period_ticks", Integer("ticks"), Is("50"), PERIOD,
            "ticks between two messages on /sim/contacts", ""),
        key("info_period_ticks", Integer("ticks"), Is("50"), PERIOD,
            "ticks between two messages on /sim/info", ""),
        key("record", Words(RecordedView::WORDS),
            Is("[]"), NONE, "visualisation topics that the recording holds as well; all: all of them", ""),
    ]),
    Table::new("execution", &[
        key("threads", Integer(""), Is("0"), between(0.0, 1024.0),
            "threads that cast scans, and execute agents in memory; 0: one for each core", ""),
        key("look_ahead", Boolean, Is("true"), NONE,
            "whether agents are asked only when they are due; otherwise they are asked at every tick", ""),
        key("unix_sockets", Boolean, Is("false"), NONE,
            "whether observations and commands go over Unix sockets to the agents of the same machine", "")
            .limits("on Linux; without effect over memory").see("topics.md#unix-sockets"),
        key("rtf", NumberOrMax, Is("\"max\""), between(1e-3, 1e6),
            "greatest real-time factor: sim seconds per second of wall time; max: as fast as possible", ""),
        key("paused", Boolean, Is("false"), NONE,
            "whether the run starts paused, until a service call resumes it", "")
            .limits("not over memory").see("ros2.md"),
        key("join_timeout_s", Number("s"), Is("60.0"), POSITIVE,
            "wall time to wait for all agents at the start", ""),
        key("decision_timeout_s", Number("s"), Is("10.0"), POSITIVE,
            "wall time to wait for a reply; for the first one join_timeout_s, if that is longer", ""),
        key("record", Path, Unset("none"), NONE,
            "file of the recording; a name that ends in / is a rosbag2 folder with metadata.yaml", ""),
    ]),
];
