//! The algorithms that decide what an agent does: their trait, and the registry of all of them.
//!
//! [`REGISTRY`] is the only list of built-in controllers: names, descriptions, settings and
//! construction follow from it everywhere. A new controller is a file in this folder, its `mod`
//! line, and its entry; or a program of its own adds it with [`Registry::with`].
//!
//! Invariants: a controller decides from its arguments alone, draws from its own random stream, and
//! terminates; equal observations give equal commands. This crate knows no transport, and only
//! [`stopwatch`] a wall clock.

#![warn(missing_docs)]

pub mod auction;
mod base_station;
mod blockage;
pub mod boustrophedon;
pub mod collision_recovery;
pub mod ctx;
pub mod dsvp;
pub mod dsvp_maes3d;
mod failed_goals;
mod go_home;
mod look_around;
pub mod lvd;
pub mod lvd_maes3d;
mod maes3d_legs;
pub mod nearest_frontier;
pub mod rbw;
pub mod rbw_maes3d;
mod registry;
pub mod relays;
mod report_to_base;
pub mod settings;
pub mod stopwatch;
mod suggestion;
#[cfg(test)]
pub(crate) mod testing;
mod viewpoints;
pub mod way_home;
mod wrapped;
/// The example of docs/controllers.md, word for word.
#[cfg(test)]
pub mod zigzag;

use std::fmt;

use msgs::ids::AgentId;
use protocol::run_info::BASE_STATION;
use rand_chacha::ChaCha8Rng;

use agent::command::Command;
use agent::observation::{Observation, RunInfo};
pub use ctx::Ctx;
use go_home::GoHome;
use look_around::LookAround;
pub use registry::{ControllerError, Registry, RegistryError};
use report_to_base::Reporting;
use settings::{Setting, SettingError, Settings};
pub use suggestion::did_you_mean;

/// An algorithm that controls one agent. How to write one: docs/controllers.md.
///
/// Runs in memory execute an agent on whichever thread is free, one at a time.
pub trait Controller: Send {
    /// Replies to an observation.
    ///
    /// It is called when the wake-up condition of its last command fires, whether the server looks
    /// ahead or not.
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command;

    /// Whether a server without look-ahead also calls it between its wake-ups, which changes the
    /// run if it then acts. A reply between its wake-ups that does nothing ([`Command::is_noop`])
    /// must leave the controller and the map unchanged.
    fn is_polled_between_wakes(&self) -> bool {
        false
    }

    /// Whether its aim is to visit cells, and not only to see them: then cells that its body visits
    /// count as new.
    fn covers(&self) -> bool {
        false
    }

    /// Whether it waits for a body in its way, and not for lack of a goal: a wrapper that looks for
    /// what its controller has left out leaves it alone then.
    fn is_blocked(&self) -> bool {
        false
    }

    /// Why the last decision failed, if it did: then its command is not sent, and the agent ends.
    ///
    /// Controllers in Rust need it for nothing; those in other languages can raise errors.
    fn failure(&mut self) -> Option<Failure> {
        None
    }
}

/// Builds the controller that takes over when the run info has changed; `None`: the present one
/// stays.
pub type Successors = Box<dyn Fn(&RunInfo) -> Result<Option<Box<dyn Controller>>, ControllerError> + Send>;

/// Why a controller cannot continue.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// What the controller of an agent is built from, beside its settings.
#[derive(Debug)]
pub struct Setup<'r> {
    /// The id of the agent.
    pub agent: AgentId,
    /// The static information on the run.
    pub run_info: &'r RunInfo,
    /// The random stream of the agent.
    pub rng: ChaCha8Rng,
}

/// Takes the settings of a controller and builds it for one agent.
///
/// It also serves to check settings, with the setup of [`RunInfo::smallest`]: which settings are
/// legal must not depend on the run.
pub type Construct =
    &'static (dyn Fn(&mut Settings, Setup<'_>) -> Result<Box<dyn Controller>, SettingError> + Send + Sync);

/// An entry of the registry.
pub struct Registration {
    /// The name in scenario files, flags and results.
    pub name: &'static str,
    /// What it does, on one line: what comes before the first colon is a title for menus.
    pub description: &'static str,
    /// The purpose of its random stream. Two purposes that are equal give equal random numbers.
    pub stream: &'static str,
    /// Takes its settings and builds the controller of one agent.
    pub construct: Construct,
}

/// All built-in controllers, in the order in which they are listed everywhere.
pub const REGISTRY: &[Registration] = &[
    Registration {
        name: "rbw",
        description: "random ballistic walk: straight on, and off in a random direction at each obstacle",
        stream: "rbw",
        construct: &|settings, setup| Ok(Box::new(rbw::Rbw::new(settings, setup.rng)?)),
    },
    Registration {
        name: "rbw-maes3d",
        description: "random ballistic walk as coded in MAES3D",
        stream: "rbw-maes3d",
        construct: &|_, setup| Ok(Box::new(rbw_maes3d::RbwMaes3d::new(setup.rng))),
    },
    Registration {
        name: "lvd",
        description: "local Voronoi decomposition: visits what is nearer to it than to the agents in contact",
        stream: "lvd",
        construct: &|settings, setup| Ok(Box::new(lvd::Lvd::new(settings, setup.run_info.extent.cell_m(), setup.rng)?)),
    },
    Registration {
        name: "lvd-maes3d",
        description: "local Voronoi decomposition as coded in MAES3D",
        stream: "lvd-maes3d",
        construct: &|_, _| Ok(Box::new(lvd_maes3d::LvdMaes3d::new())),
    },
    Registration {
        name: "dsvp",
        description: "dual-stage viewpoint planner: most gain within a horizon, else the nearest frontier",
        stream: "dsvp",
        construct: &|settings, setup| Ok(Box::new(dsvp::alone(settings, setup)?)),
    },
    Registration {
        name: "dsvp-maes3d",
        description: "dual-stage viewpoint planner as coded in MAES3D, slips included",
        stream: "dsvp-maes3d",
        construct: &|_, setup| Ok(Box::new(dsvp_maes3d::DsvpMaes3d::new(setup.rng))),
    },
    Registration {
        name: "dsvp-auction",
        description: "dual-stage viewpoint planner with an auction: agents bid for goals and claim them",
        stream: "dsvp",
        construct: &|settings, setup| Ok(Box::new(dsvp::with_auction(settings, setup)?)),
    },
    Registration {
        name: "dsvp-team",
        description: "viewpoint planner with tours for the whole team over all that is left to see",
        stream: "dsvp",
        construct: &|settings, setup| {
            let (agent, run_info) = (setup.agent, setup.run_info);
            let team = Box::new(dsvp::with_team(settings, setup)?);
            Ok(Reporting::from_settings(settings, agent, run_info)?.around(team))
        },
    },
    Registration {
        name: "hungarian",
        description: "Hungarian assignment: a frontier to each agent in contact by the least sum of paths (baseline)",
        stream: "dsvp",
        construct: &|settings, setup| Ok(Box::new(dsvp::hungarian(settings, setup)?)),
    },
    Registration {
        name: "rendezvous",
        description: "planned meetings: agents agree where and when to meet again, and explore until then (baseline)",
        stream: "dsvp",
        construct: &|settings, setup| Ok(Box::new(dsvp::rendezvous(settings, setup)?)),
    },
    Registration {
        name: "racer",
        description: "pairwise division: two agents that meet divide the blocks left, and each tours its own (baseline)",
        stream: "dsvp",
        construct: &|settings, setup| Ok(Box::new(dsvp::racer(settings, setup)?)),
    },
    Registration {
        name: "c2-explorer",
        description: "contiguous regions: agents that meet divide the unexplored components (baseline)",
        stream: "dsvp",
        construct: &|settings, setup| Ok(Box::new(dsvp::c2_explorer(settings, setup)?)),
    },
    Registration {
        name: "nearest-frontier",
        description: "greedy exploration: by the shortest path to the nearest frontier of its map",
        stream: "nearest-frontier",
        construct: &|settings, setup| Ok(Box::new(nearest_frontier::NearestFrontier::new(settings, setup.rng)?)),
    },
    Registration {
        name: "boustrophedon",
        description: "coverage: sweeps the free space in straight lines until every cell is covered",
        stream: "boustrophedon",
        construct: &|settings, setup| Ok(Box::new(boustrophedon::Boustrophedon::new(settings, setup.rng)?)),
    },
];

/// The controller of base stations, which no list offers: a scenario gives it to the agents of
/// `agents.base_stations`.
static OF_BASE_STATIONS: Registration = Registration {
    name: BASE_STATION,
    description: "base station: stays where it is, gathers the map, and tells how much it has",
    stream: BASE_STATION,
    construct: &|_, _| Ok(Box::new(base_station::BaseStation::default())),
};

/// The names of all built-in controllers, in the order of the registry.
pub const NAMES: [&str; REGISTRY.len()] = {
    let mut names = [""; REGISTRY.len()];
    let mut number = 0;
    while number < names.len() {
        names[number] = REGISTRY[number].name;
        number += 1;
    }
    names
};

impl fmt::Debug for Registration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, description, stream, construct: _ } = self;
        f.debug_struct("Registration")
            .field("name", name)
            .field("description", description)
            .field("stream", stream)
            .finish_non_exhaustive()
    }
}

impl Registration {
    /// The settings of the controller with their defaults.
    ///
    /// # Panics
    /// If the controller refuses its own defaults.
    #[must_use]
    pub fn settings(&self) -> Vec<Setting> {
        let (_, settings) = self.build(&[], AgentId(0), &RunInfo::smallest()).expect("defaults are in range");
        settings
    }

    fn build(
        &self,
        settings: &[String],
        agent: AgentId,
        run_info: &RunInfo,
    ) -> Result<(Box<dyn Controller>, Vec<Setting>), SettingError> {
        let mut settings = Settings::parse(settings)?;
        let rng = voxels::random_streams::stream(run_info.agents_seed, agent.0.into(), self.stream);
        let controller = (self.construct)(&mut settings, Setup { agent, run_info, rng })?;
        let stream = |purpose| voxels::random_streams::stream(run_info.agents_seed, agent.0.into(), purpose);
        let controller = Box::new(LookAround::around(controller, stream(look_around::STREAM)));
        Ok((Box::new(GoHome::around(controller, stream(go_home::STREAM))), settings.finish()?))
    }
}

/// Checks the name of a built-in controller and its settings.
///
/// # Errors
/// If the name or a setting is unknown, or a value is out of range.
pub fn check(name: &str, settings: &[String]) -> Result<(), ControllerError> {
    Registry::BUILT_IN.check(name, settings)
}

/// All settings of a built-in controller with their values: those given, and defaults for the
/// others.
///
/// # Errors
/// If the name or a setting is unknown, or a value is out of range.
pub fn resolve_settings(name: &str, settings: &[String]) -> Result<Vec<Setting>, ControllerError> {
    Registry::BUILT_IN.resolve_settings(name, settings)
}

/// Builds a built-in controller by name, with settings `KEY=VALUE`, for one agent of a run.
///
/// # Errors
/// If the name or a setting is unknown, or a value is out of range.
pub fn build(
    name: &str,
    settings: &[String],
    agent: AgentId,
    run_info: &RunInfo,
) -> Result<Box<dyn Controller>, ControllerError> {
    Registry::BUILT_IN.build(name, settings, agent, run_info)
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;
    use std::path::Path;

    use super::*;

    #[test]
    fn every_registered_controller_builds() {
        for registration in REGISTRY {
            let Registration { name, description, .. } = registration;
            assert!(check(name, &[]).is_ok(), "{name}");
            assert_eq!(registration.settings(), resolve_settings(name, &[]).unwrap(), "{name}");
            assert!(!description.is_empty() && !description.contains('\n'), "{name}");
            assert_eq!(NAMES.iter().filter(|other| *other == name).count(), 1, "{name} is registered once");
        }
    }

    #[test]
    fn example_of_the_documents_can_be_registered() {
        // In the form of the document.
        #[rustfmt::skip]
        static WITH_EXAMPLE: &[Registration] = &[
            Registration {
                name: "zigzag",
                description: "zigzag: straight on, and a turn to a random side at each obstacle",
                stream: "zigzag",
                construct: &|settings, setup| Ok(Box::new(zigzag::Zigzag::new(settings, setup.rng)?)),
            },
        ];
        let registry = Registry::with(WITH_EXAMPLE).unwrap();
        assert!(registry.build("zigzag", &["turn_rad=2.5".to_owned()], AgentId(0), &RunInfo::smallest()).is_ok());
        let refused =
            registry.build("zigzag", &["turn_rad=4".to_owned()], AgentId(0), &RunInfo::smallest()).err().unwrap();
        assert!(refused.to_string().contains("turn_rad = 4"), "{refused}");
    }

    #[test]
    fn unknown_names_and_wrong_settings_are_refused() {
        let refused = |name: &str, settings: &[String]| check(name, settings).unwrap_err().to_string();
        let known = NAMES.join(", ");
        assert_eq!(refused("rwb", &[]), format!("controller rwb: unknown; known are {known}; did you mean `rbw`?"));
        assert!(refused("dspv", &[]).ends_with("; did you mean `dsvp`?"));
        for deleted in ["dsvp-tours", "dsvp-voronoi", "dsvp-swift"] {
            assert!(refused(deleted, &[]).starts_with(&format!("controller {deleted}: unknown; known are {known}")));
        }
        let meetings = refused("dsvp-team", &["meeting_chance=0.5".to_owned()]);
        assert!(meetings.starts_with("controller dsvp-team: setting `meeting_chance`: unknown; known are "));
        assert_eq!(refused("astar", &[]), format!("controller astar: unknown; known are {known}"));
        assert_eq!(
            refused("rbw", &["speed=1".to_owned()]),
            "controller rbw: setting `speed`: unknown; \
             known are pitch_min_rad, pitch_max_rad, turn_min_rad, turn_max_rad"
        );
        assert!(refused("rbw", &["turn_mim_rad=1".to_owned()]).ends_with("; did you mean `turn_min_rad`?"));
        assert_eq!(
            refused("rbw-maes3d", &["speed=1".to_owned()]),
            "controller rbw-maes3d: setting `speed`: unknown; there are none"
        );
        assert_eq!(
            refused("rbw", &["pitch_min_rad=9".to_owned()]),
            "controller rbw: setting pitch_min_rad = 9: expected a number from 0 to 1.5707963267948966"
        );
    }

    /// Fails unless a file holds what follows from the registry, or writes it with the environment
    /// variable `UPDATE_DOCS`: `UPDATE_DOCS=1 cargo test --release -p agent_node
    /// controllers::tests`.
    fn publish(file: &str, expected: impl FnOnce(&str) -> String) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file);
        let present = std::fs::read_to_string(&path).unwrap_or_default();
        let expected = expected(&present);
        if std::env::var_os("UPDATE_DOCS").is_some() {
            std::fs::write(&path, expected).unwrap();
        } else {
            assert!(present == expected, "{file} does not match the registry: run the tests with UPDATE_DOCS=1");
        }
    }

    #[test]
    fn document_lists_the_registry() {
        publish("docs/controllers.md", |page| {
            let (before, rest) = page.split_once("<!-- generated: controllers -->\n").unwrap();
            let (_, after) = rest.split_once("<!-- end of generated -->").unwrap();
            let mut table = "| name | what it does |\n|---|---|\n".to_owned();
            for Registration { name, description, .. } in REGISTRY {
                writeln!(table, "| `{name}` | {description} |").unwrap();
            }
            format!("{before}<!-- generated: controllers -->\n{table}<!-- end of generated -->{after}")
        });
    }

    #[test]
    fn start_form_of_the_page_lists_the_registry() {
        publish("viewer/src/app/controllers.json", |_| {
            let entries = REGISTRY.iter().map(|registration| {
                let Registration { name, description, .. } = registration;
                let title = description.split_once(':').map_or(*description, |(title, _)| title);
                let searches = registration.settings().iter().any(|setting| setting.key == "search_time");
                format!("  {{ \"value\": \"{name}\", \"label\": \"{name} - {title}\", \"searches\": {searches} }}")
            });
            format!("[\n{}\n]\n", entries.collect::<Vec<_>>().join(",\n"))
        });
    }
}
