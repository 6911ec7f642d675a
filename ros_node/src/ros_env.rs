//! The ROS environment variables that say which network a process joins.
//!
//! Invariants: a pure function of the variables it is handed, so that a test needs no environment; what is not understood is
//! an error that names the variable, its value and the values allowed, never a guess. This module knows no ROS client.
//!
//! One thing differs from ROS itself: where nothing is set, nothing leaves the machine. `ROS_STATIC_PEERS` is not supported:
//! the middleware has no such list.

use std::fmt;

use thiserror::Error;

/// Highest domain: the UDP ports of a domain are counted from 7400 + 250 times its number, and ports end at 65535.
const DOMAIN_ID_MAX: u16 = 232;

/// The variable with the domain.
const DOMAIN_ID: &str = "ROS_DOMAIN_ID";

/// The variable with the range, as of ROS 2 Iron.
const RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";

/// The variable that did this before. Where it is 1 it prevails, as in ROS itself.
const LOCALHOST_ONLY: &str = "ROS_LOCALHOST_ONLY";

/// A variable that is set to something that does not exist.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{variable} is {value:?}; allowed are {allowed}")]
pub struct RosEnvError {
    /// The variable.
    pub variable: &'static str,
    /// What it is set to.
    pub value: String,
    /// What it may be set to.
    pub allowed: &'static str,
}

/// How far away other processes may be to be found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DiscoveryRange {
    /// Nobody is found.
    Off,
    /// Processes on this machine; nothing is sent to the network.
    Localhost,
    /// Processes that multicast reaches.
    Subnet,
    /// Whatever the middleware does by itself.
    SystemDefault,
}

impl fmt::Display for DiscoveryRange {
    /// The value that the variable has for it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            DiscoveryRange::Off => "OFF",
            DiscoveryRange::Localhost => "LOCALHOST",
            DiscoveryRange::Subnet => "SUBNET",
            DiscoveryRange::SystemDefault => "SYSTEM_DEFAULT",
        })
    }
}

/// Which network a process joins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RosEnv {
    /// The domain, 0 to 232: processes of different domains do not see each other.
    pub domain_id: u16,
    /// How far away others are looked for.
    pub range: DiscoveryRange,
}

impl RosEnv {
    /// Reads `ROS_DOMAIN_ID`, `ROS_AUTOMATIC_DISCOVERY_RANGE` and `ROS_LOCALHOST_ONLY`. An empty variable is as good as none.
    ///
    /// Without any of them: domain 0, on this machine only. `ROS_LOCALHOST_ONLY=0` asks for the network, as long as no range
    /// says otherwise.
    ///
    /// # Errors
    /// If a variable has a value that does not exist.
    ///
    /// ```
    /// use ros_node::ros_env::{DiscoveryRange, RosEnv};
    ///
    /// let env = RosEnv::from_vars(|name| (name == "ROS_DOMAIN_ID").then(|| "7".to_owned())).unwrap();
    /// assert_eq!(env, RosEnv { domain_id: 7, range: DiscoveryRange::Localhost });
    /// ```
    pub fn from_vars(variable: impl Fn(&str) -> Option<String>) -> Result<Self, RosEnvError> {
        let set = |name| variable(name).filter(|value| !value.is_empty());
        Ok(RosEnv { domain_id: domain_id(set(DOMAIN_ID))?, range: range(set(RANGE), set(LOCALHOST_ONLY))? })
    }
}

impl fmt::Display for RosEnv {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ROS domain {}, range {}", self.domain_id, self.range)
    }
}

fn domain_id(value: Option<String>) -> Result<u16, RosEnvError> {
    let Some(value) = value else { return Ok(0) };
    match value.parse() {
        Ok(id) if id <= DOMAIN_ID_MAX => Ok(id),
        _ => Err(RosEnvError { variable: DOMAIN_ID, value, allowed: "0 to 232" }),
    }
}

fn range(range: Option<String>, localhost_only: Option<String>) -> Result<DiscoveryRange, RosEnvError> {
    let unless_ranged = match localhost_only {
        None => DiscoveryRange::Localhost,
        Some(value) => match value.as_str() {
            "0" => DiscoveryRange::Subnet,
            "1" => return Ok(DiscoveryRange::Localhost),
            _ => return Err(RosEnvError { variable: LOCALHOST_ONLY, value, allowed: "0 and 1" }),
        },
    };
    let Some(value) = range else { return Ok(unless_ranged) };
    match value.as_str() {
        "OFF" => Ok(DiscoveryRange::Off),
        "LOCALHOST" => Ok(DiscoveryRange::Localhost),
        "SUBNET" => Ok(DiscoveryRange::Subnet),
        "SYSTEM_DEFAULT" => Ok(DiscoveryRange::SystemDefault),
        _ => Err(RosEnvError { variable: RANGE, value, allowed: "SUBNET, LOCALHOST, OFF and SYSTEM_DEFAULT" }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn env(variables: &[(&str, &str)]) -> Result<RosEnv, RosEnvError> {
        RosEnv::from_vars(|name| variables.iter().find(|(n, _)| *n == name).map(|(_, value)| (*value).to_owned()))
    }

    #[test]
    fn nothing_leaves_the_machine_unless_asked() {
        let home = RosEnv { domain_id: 0, range: DiscoveryRange::Localhost };
        assert_eq!(env(&[]), Ok(home));
        assert_eq!(env(&[(DOMAIN_ID, ""), (RANGE, ""), (LOCALHOST_ONLY, "")]), Ok(home));
        assert_eq!(home.to_string(), "ROS domain 0, range LOCALHOST");
    }

    #[test]
    fn every_range_by_its_name() {
        for range in
            [DiscoveryRange::Off, DiscoveryRange::Localhost, DiscoveryRange::Subnet, DiscoveryRange::SystemDefault]
        {
            assert_eq!(env(&[(RANGE, &range.to_string())]).unwrap().range, range);
        }
    }

    #[test]
    fn the_old_variable_prevails_where_it_is_1() {
        let range = |variables: &[(&str, &str)]| env(variables).unwrap().range;
        assert_eq!(range(&[(LOCALHOST_ONLY, "1"), (RANGE, "SUBNET")]), DiscoveryRange::Localhost);
        assert_eq!(range(&[(LOCALHOST_ONLY, "0"), (RANGE, "OFF")]), DiscoveryRange::Off);
        assert_eq!(range(&[(LOCALHOST_ONLY, "0")]), DiscoveryRange::Subnet);
    }

    #[test]
    fn the_domains_end_at_232() {
        assert_eq!(env(&[(DOMAIN_ID, "232")]).unwrap().domain_id, 232);
        for value in ["233", "-1", "65536", "1.0", "seven"] {
            let error = env(&[(DOMAIN_ID, value)]).unwrap_err();
            assert_eq!(error.to_string(), format!("ROS_DOMAIN_ID is {value:?}; allowed are 0 to 232"));
        }
    }

    #[test]
    fn errors_name_the_variable_and_what_it_may_be() {
        assert_eq!(
            env(&[(RANGE, "localhost")]).unwrap_err().to_string(),
            "ROS_AUTOMATIC_DISCOVERY_RANGE is \"localhost\"; allowed are SUBNET, LOCALHOST, OFF and SYSTEM_DEFAULT"
        );
        assert_eq!(
            env(&[(LOCALHOST_ONLY, "yes")]).unwrap_err().to_string(),
            "ROS_LOCALHOST_ONLY is \"yes\"; allowed are 0 and 1"
        );
    }
}
