//! What each benchmark measures: worlds, teams, radios, localisation and seeds.
//!
//! Invariant: all of it is fixed by the name of the benchmark.

/// Number of public seeds of each track: 1 to 30.
pub const SEEDS: usize = 30;

/// What a benchmark measures. A *track* is a world, a team, a radio and a localisation; each has
/// [`SEEDS`] runs.
#[derive(Debug, PartialEq, Eq)]
pub struct Benchmark {
    pub name: &'static str,
    /// Numbers of agents.
    pub teams: &'static [u32],
    /// `[communication]`.
    pub(super) radios: &'static [Named],
    /// `[localisation]`; empty: it is exact, and no track names one.
    pub(super) localisations: &'static [Named],
    /// Tables of the scenario that all worlds have, as TOML: lines of keys.
    pub(super) common: &'static str,
    pub(super) worlds: &'static [BenchmarkWorld],
}

/// A name, and an inline table of TOML.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Named {
    pub(super) name: &'static str,
    pub(super) keys: &'static str,
}

/// A world: its name, the greatest sim time, and what a scenario has beside team, radio and
/// localisation.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct BenchmarkWorld {
    pub(super) name: &'static str,
    pub(super) duration_s: u32,
    pub(super) map: &'static str,
    pub(super) spawn: &'static str,
    /// `[lidar]`, unless it is the usual one.
    pub(super) lidar: Option<&'static str>,
}

impl Benchmark {
    /// All benchmarks.
    pub const ALL: [&'static Self; 2] = [&EXPLORATION_1, &EXPLORATION_2];

    /// The benchmark of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        Self::ALL.into_iter().find(|benchmark| benchmark.name == name)
    }

    /// The names of its worlds, which no other benchmark has.
    pub fn worlds(&self) -> impl Iterator<Item = &'static str> + use<> {
        self.worlds.iter().map(|world| world.name)
    }

    /// The names of its radios.
    pub fn radios(&self) -> impl Iterator<Item = &'static str> + use<> {
        self.radios.iter().map(|radio| radio.name)
    }

    /// The names of its localisations; without a choice, a single `None`.
    pub fn localisations(&self) -> impl Iterator<Item = Option<&'static str>> + use<> {
        let is_exact = self.localisations.is_empty();
        self.localisations.iter().map(|localisation| Some(localisation.name)).chain(is_exact.then_some(None))
    }

    /// File name of the results, in the folder of the runs.
    #[must_use]
    pub fn result_file(&self) -> String {
        format!("{}.json", self.name)
    }
}

impl Named {
    /// What the rows of runs with it say of the axis.
    pub(super) fn label(&self) -> String {
        let keys = format!("keys = {}", self.keys);
        let mut table: toml::Table = keys.parse().expect("the tables of a benchmark are TOML");
        table.remove("keys").expect("it was just written").to_string()
    }
}

/// The caves and buildings of the first release.
pub static EXPLORATION_1: Benchmark = Benchmark {
    name: "exploration-1",
    teams: &[1, 2, 5, 10, 20],
    radios: &[
        Named { name: "perfect", keys: "{ model = \"line_of_sight\" }" },
        Named { name: "lossy", keys: "{ range_m = 15.0, loss = 0.3, bytes_per_s = 20000.0 }" },
    ],
    localisations: &[],
    common: "",
    worlds: &[
        cave("cave-50", 300, "{ kind = \"spheres\", size = 50 }"),
        cave("cave-75", 600, "{ kind = \"spheres\", size = 75 }"),
        cave("cave-100", 900, "{ kind = \"spheres\", size = 100 }"),
        cave("noise", 600, "{ kind = \"noise\", size = 60 }"),
        BenchmarkWorld {
            name: "building",
            duration_s: 600,
            map: "{ kind = \"building\", size = [60, 60, 13] }",
            spawn: "{ kind = \"entrances\" }",
            lidar: None,
        },
        BenchmarkWorld {
            name: "station",
            duration_s: 300,
            map: "{ kind = \"file\", file = \"station.obj\", cell_m = 1.0, import = { free_from = [20.5, 20.5, 2.5] } }",
            spawn: "{ kind = \"scattered\", min_distance_m = 1.0 }",
            lidar: None,
        },
    ],
};

const NEAR: &str = "{ kind = \"nearest_origin\" }";

const fn cave(name: &'static str, duration_s: u32, map: &'static str) -> BenchmarkWorld {
    BenchmarkWorld { name, duration_s, map, spawn: NEAR, lidar: None }
}

/// The imported world, which is written beside its plan: its name and text.
pub(super) const STATION: (&str, &str) = ("station.obj", include_str!("station.obj"));

/// The scenes at true scale that the literature compares on, with its robots: bodies of 2 m/s and
/// 2 m/s^2, depth cameras of 80 x 60 degrees and 4.5 m indoors, spinning LiDARs where it is wide.
pub static EXPLORATION_2: Benchmark = Benchmark {
    name: "exploration-2",
    teams: &[1, 2, 4, 10],
    radios: &[
        Named { name: "perfect", keys: "{ model = \"line_of_sight\" }" },
        Named { name: "short", keys: "{ model = \"line_of_sight_and_range\", range_m = 10.0 }" },
        Named { name: "lossy", keys: "{ range_m = 20.0, loss = 0.3, bytes_per_s = 50000.0 }" },
    ],
    localisations: &[
        Named { name: "exact", keys: "{}" },
        Named {
            name: "drift",
            keys: "{ position_noise_m = 0.01, position_bias = 0.002, heading_noise_rad = 0.0005, \
                   heading_bias_rad_per_m = 0.0001, turn_noise_rad = 0.002, turn_bias = 0.001, closure_range_m = 3.0 }",
        },
    ],
    common: "body = { kind = \"aerial\", radius_m = 0.25, speed_max_m_s = 2.0, acceleration_m_s2 = 2.0, \
             deceleration_m_s2 = 2.0 }\n",
    worlds: &[
        scene(
            "office",
            240,
            "{ kind = \"scene\", size = [102, 102, 15], cell_m = 0.2, scene = { name = \"office\" } }",
            CAMERA,
        ),
        scene(
            "two-storeys",
            480,
            "{ kind = \"scene\", size = [102, 102, 34], cell_m = 0.2, scene = { name = \"office\" } }",
            CAMERA,
        ),
        scene(
            "octagon-maze",
            300,
            "{ kind = \"scene\", size = [102, 102, 12], cell_m = 0.2, scene = { name = \"octagon-maze\" } }",
            CAMERA,
        ),
        scene(
            "pillars",
            240,
            "{ kind = \"scene\", size = [102, 102, 17], cell_m = 0.2, scene = { name = \"pillars\" } }",
            CAMERA,
        ),
        scene(
            "tunnels",
            480,
            "{ kind = \"scene\", size = [256, 181, 21], cell_m = 0.4, scene = { name = \"tunnels\" } }",
            RING,
        ),
        scene(
            "garage",
            360,
            "{ kind = \"scene\", size = [127, 77, 18], cell_m = 0.4, scene = { name = \"garage\" } }",
            RING,
        ),
        scene(
            "campus",
            360,
            "{ kind = \"scene\", size = [202, 152, 32], cell_m = 0.5, scene = { name = \"campus\" } }",
            RING,
        ),
        scene(
            "forest",
            300,
            "{ kind = \"scene\", size = [127, 127, 22], cell_m = 0.4, scene = { name = \"forest\" } }",
            RING,
        ),
    ],
};

const CAMERA: &str = "{ preset = \"depth-camera\" }";
const RING: &str = "{ preset = \"vlp-16\", columns = 360, range_m = 15.0 }";

const fn scene(name: &'static str, duration_s: u32, map: &'static str, lidar: &'static str) -> BenchmarkWorld {
    BenchmarkWorld { name, duration_s, map, spawn: NEAR, lidar: Some(lidar) }
}
