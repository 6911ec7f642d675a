//! The controllers that a process can run: the built-in ones, and those of a program that depends
//! on this crate.
//!
//! Invariant: names are unique, also between the two, so that a name in a scenario, a join or a
//! recording stands for one algorithm.

use msgs::ids::AgentId;
use thiserror::Error;

use super::settings::{Setting, SettingError};
use super::suggestion::did_you_mean;
use super::{Controller, OF_BASE_STATIONS, REGISTRY, Registration, Successors};
use crate::stopwatch::DecisionTimes;
use agent::observation::RunInfo;

/// Controllers by name.
#[derive(Debug, Clone, Copy, Default)]
pub struct Registry {
    own: &'static [Registration],
}

/// Why a program cannot register its controllers. It is a mistake in that program.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RegistryError {
    /// Two controllers have one name.
    #[error("controller {0}: registered twice, here or among the built-in ones; expected a name of its own")]
    Twice(&'static str),
    /// The name would not be one word in a join message.
    #[error("controller `{0}`: expected a name of letters, digits, - and _")]
    Name(&'static str),
}

/// Why a controller cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ControllerError {
    /// The registry has no such name.
    #[error("controller {name}: unknown; known are {}{}", known.join(", "), did_you_mean(name, known))]
    Unknown {
        /// The name.
        name: String,
        /// The names of the registry.
        known: Vec<&'static str>,
    },
    /// A setting is unknown or out of range.
    #[error("controller {name}: {source}")]
    Setting {
        /// The controller.
        name: String,
        /// What is wrong.
        source: SettingError,
    },
}

impl Registry {
    /// The built-in controllers alone.
    pub const BUILT_IN: Self = Self { own: &[] };

    /// The built-in controllers, and those of a program.
    ///
    /// # Errors
    /// If a name is in use, or not one word.
    pub fn with(own: &'static [Registration]) -> Result<Self, RegistryError> {
        for (place, Registration { name, .. }) in own.iter().enumerate() {
            if name.is_empty() || !name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte)) {
                return Err(RegistryError::Name(name));
            }
            let mut others = REGISTRY.iter().chain([&OF_BASE_STATIONS]).chain(&own[..place]);
            if others.any(|other| other.name == *name) {
                return Err(RegistryError::Twice(name));
            }
        }
        Ok(Self { own })
    }

    /// All controllers: the built-in ones, then those of the program.
    pub fn registrations(self) -> impl Iterator<Item = &'static Registration> {
        REGISTRY.iter().chain(self.own)
    }

    /// Checks the name of a controller and its settings.
    ///
    /// # Errors
    /// If the name or a setting is unknown, or a value is out of range.
    pub fn check(self, name: &str, settings: &[String]) -> Result<(), ControllerError> {
        self.resolve_settings(name, settings).map(drop)
    }

    /// All settings of a controller with their values: those given, and defaults for the others.
    ///
    /// # Errors
    /// If the name or a setting is unknown, or a value is out of range.
    pub fn resolve_settings(self, name: &str, settings: &[String]) -> Result<Vec<Setting>, ControllerError> {
        self.build_with_settings(name, settings, AgentId(0), &RunInfo::smallest()).map(|(_, settings)| settings)
    }

    /// Builds a controller by name, with settings `KEY=VALUE`, for one agent of a run.
    ///
    /// # Errors
    /// If the name or a setting is unknown, or a value is out of range.
    pub fn build(
        self,
        name: &str,
        settings: &[String],
        agent: AgentId,
        run_info: &RunInfo,
    ) -> Result<Box<dyn Controller>, ControllerError> {
        self.build_with_settings(name, settings, agent, run_info).map(|(controller, _)| controller)
    }

    /// How the controller of an agent is replaced when the scenario asks for another one. An agent
    /// that runs another controller than the scenario says, or other settings, keeps it.
    #[must_use]
    pub fn successors(self, agent: AgentId, follows_scenario: bool, times: Option<DecisionTimes>) -> Successors {
        Box::new(move |run_info| {
            if !follows_scenario {
                return Ok(None);
            }
            let controller = self.build(&run_info.controller, &run_info.settings, agent, run_info)?;
            Ok(Some(match &times {
                Some(times) => times.of(controller),
                None => controller,
            }))
        })
    }

    fn build_with_settings(
        self,
        name: &str,
        settings: &[String],
        agent: AgentId,
        run_info: &RunInfo,
    ) -> Result<(Box<dyn Controller>, Vec<Setting>), ControllerError> {
        let unknown = || {
            let known = self.registrations().map(|registration| registration.name).collect();
            ControllerError::Unknown { name: name.to_owned(), known }
        };
        let mut registrations = self.registrations().chain([&OF_BASE_STATIONS]);
        let registration = registrations.find(|registration| registration.name == name).ok_or_else(unknown)?;
        registration
            .build(settings, agent, run_info)
            .map_err(|source| ControllerError::Setting { name: name.to_owned(), source })
    }

    /// Name, description and settings of all controllers, for people.
    #[must_use]
    pub fn text(self) -> String {
        let mut text = String::new();
        for registration in self.registrations() {
            text += &format!("{}: {}\n", registration.name, registration.description);
            for Setting { key, value, allowed } in registration.settings() {
                text += &format!("  {key} = {value}: {allowed}\n");
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rbw_maes3d::RbwMaes3d;
    use crate::settings::SettingValue;

    static OWN: &[Registration] = &[Registration {
        name: "own",
        description: "a controller of a program",
        stream: "own",
        construct: &|settings, setup| {
            settings.number("turn_rad", 2.0, 0.0, 3.0)?;
            Ok(Box::new(RbwMaes3d::new(setup.rng)))
        },
    }];

    const fn named(name: &'static str) -> Registration {
        Registration {
            name,
            description: "",
            stream: "",
            construct: &|_, setup| Ok(Box::new(RbwMaes3d::new(setup.rng))),
        }
    }

    #[test]
    fn own_controllers_are_checked_as_built_in_ones() {
        let registry = Registry::with(OWN).unwrap();
        assert!(registry.check("rbw", &[]).is_ok());
        let taken = registry.resolve_settings("own", &["turn_rad=1".to_owned()]).unwrap();
        assert_eq!(taken[0].value, SettingValue::Number(1.0, 0.0, 3.0));
        let refused = |name: &str, setting: &str| registry.check(name, &[setting.to_owned()]).unwrap_err().to_string();
        assert_eq!(refused("own", "turn_rad=4"), "controller own: setting turn_rad = 4: expected a number from 0 to 3");
        assert!(refused("own", "turn=1").ends_with("unknown; known are turn_rad"));
        assert!(refused("owm", "turn=1").ends_with(", boustrophedon, own; did you mean `own`?"));
        assert!(Registry::BUILT_IN.check("own", &[]).is_err());
        assert!(
            registry
                .text()
                .ends_with("own: a controller of a program\n  turn_rad = 2: expected a number from 0 to 3\n")
        );
    }

    #[test]
    fn names_are_unique_words() {
        static BUILT_IN: &[Registration] = &[named("rbw")];
        static TWICE: &[Registration] = &[named("own"), named("own")];
        static WORDS: &[Registration] = &[named("my own")];
        assert_eq!(Registry::with(BUILT_IN).unwrap_err(), RegistryError::Twice("rbw"));
        assert_eq!(Registry::with(TWICE).unwrap_err(), RegistryError::Twice("own"));
        assert_eq!(Registry::with(WORDS).unwrap_err(), RegistryError::Name("my own"));
    }
}
