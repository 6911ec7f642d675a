//! The ROS environment variables that select the network a process joins, and its middleware.
//!
//! Invariants: a pure function of the variables passed in, so that a test needs no environment; an
//! unknown value is an error that names the variable, its value and the allowed values. This module
//! does not use the ROS client.
//!
//! One default differs from ROS: without any variable, discovery is limited to this machine.
//! Static peers need a range that reaches them: with `LOCALHOST` the list has no effect, because
//! nothing leaves the machine then.

use std::fmt;

use thiserror::Error;

/// Highest domain id: the UDP ports of a domain start at 7400 + 250 times its id, and ports end at
/// 65535.
const DOMAIN_ID_MAX: u16 = 232;

const DOMAIN_ID: &str = "ROS_DOMAIN_ID";

/// The middleware of the ROS nodes here.
pub(crate) const RMW_IMPLEMENTATION: &str = "RMW_IMPLEMENTATION";

/// The value of it that means Zenoh; all others mean DDS.
const ZENOH: &str = "rmw_zenoh_cpp";

/// The discovery range, since ROS 2 Iron.
const RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";

/// The older variable; a value of 1 takes precedence, as in ROS.
const LOCALHOST_ONLY: &str = "ROS_LOCALHOST_ONLY";

/// Addresses of machines, separated by semicolons.
const STATIC_PEERS: &str = "ROS_STATIC_PEERS";

/// Most static peers: each gets twelve packets with every announcement.
const STATIC_PEERS_MAX: usize = 32;

/// An environment variable with an unknown value.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{variable} is {value:?}; allowed are {allowed}")]
pub struct RosEnvError {
    pub variable: &'static str,
    pub value: String,
    pub allowed: &'static str,
}

/// The middleware.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Middleware {
    /// DDS, for every other value of `RMW_IMPLEMENTATION`.
    #[default]
    Dds,
    /// Zenoh, as `rmw_zenoh` uses it.
    #[cfg(feature = "zenoh")]
    Zenoh,
}

/// Which other processes are discovered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DiscoveryRange {
    /// None.
    Off,
    /// Those on this machine; nothing is sent to the network.
    #[default]
    Localhost,
    /// Those that multicast reaches.
    Subnet,
    /// The middleware's default.
    SystemDefault,
}

impl fmt::Display for DiscoveryRange {
    /// The value of the variable.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            DiscoveryRange::Off => "OFF",
            DiscoveryRange::Localhost => "LOCALHOST",
            DiscoveryRange::Subnet => "SUBNET",
            DiscoveryRange::SystemDefault => "SYSTEM_DEFAULT",
        })
    }
}

/// The ROS network that a process joins.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RosEnv {
    /// Domain id, 0 to 232: processes of different domains do not discover each other.
    pub domain_id: u16,
    pub middleware: Middleware,
    /// Over Zenoh only [`DiscoveryRange::Off`] has an effect: there the session configuration says
    /// who connects to whom.
    pub range: DiscoveryRange,
    /// Names or addresses of machines that multicast does not reach; empty with `OFF` and
    /// `LOCALHOST`.
    pub static_peers: Vec<String>,
}

impl RosEnv {
    /// Reads `ROS_DOMAIN_ID`, `RMW_IMPLEMENTATION`, `ROS_AUTOMATIC_DISCOVERY_RANGE`,
    /// `ROS_LOCALHOST_ONLY` and `ROS_STATIC_PEERS`. An empty variable counts as unset.
    ///
    /// Defaults: domain 0, DDS, this machine only. `ROS_LOCALHOST_ONLY=0` selects the network
    /// unless a range is set.
    ///
    /// # Errors
    /// If a variable has an unknown value.
    ///
    /// ```
    /// use ros_node::ros_env::{DiscoveryRange, RosEnv};
    ///
    /// let env = RosEnv::from_vars(|name| (name == "ROS_DOMAIN_ID").then(|| "7".to_owned())).unwrap();
    /// assert_eq!(env.domain_id, 7);
    /// assert_eq!(env.range, DiscoveryRange::Localhost);
    /// ```
    pub fn from_vars(variable: impl Fn(&str) -> Option<String>) -> Result<Self, RosEnvError> {
        let set = |name| variable(name).filter(|value| !value.is_empty());
        let range = range(set(RANGE), set(LOCALHOST_ONLY))?;
        let static_peers = match range {
            DiscoveryRange::Off | DiscoveryRange::Localhost => Vec::new(),
            DiscoveryRange::Subnet | DiscoveryRange::SystemDefault => static_peers(set(STATIC_PEERS))?,
        };
        let middleware = middleware(set(RMW_IMPLEMENTATION))?;
        Ok(RosEnv { domain_id: domain_id(set(DOMAIN_ID))?, middleware, range, static_peers })
    }
}

impl fmt::Display for RosEnv {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        #[cfg(feature = "zenoh")]
        if self.middleware == Middleware::Zenoh {
            return write!(f, "ROS domain {} over Zenoh", self.domain_id);
        }
        write!(f, "ROS domain {}, range {}", self.domain_id, self.range)?;
        if self.static_peers.is_empty() { Ok(()) } else { write!(f, ", peers {}", self.static_peers.join(";")) }
    }
}

fn domain_id(value: Option<String>) -> Result<u16, RosEnvError> {
    let Some(value) = value else { return Ok(0) };
    match value.parse() {
        Ok(id) if id <= DOMAIN_ID_MAX => Ok(id),
        _ => Err(RosEnvError { variable: DOMAIN_ID, value, allowed: "0 to 232" }),
    }
}

#[cfg(feature = "zenoh")]
fn middleware(value: Option<String>) -> Result<Middleware, RosEnvError> {
    Ok(if value.as_deref() == Some(ZENOH) { Middleware::Zenoh } else { Middleware::Dds })
}

#[cfg(not(feature = "zenoh"))]
fn middleware(value: Option<String>) -> Result<Middleware, RosEnvError> {
    match value {
        Some(value) if value == ZENOH => {
            let allowed = "those of DDS, because this build has no Zenoh; `cargo build --release --features zenoh` \
                           makes one that has it";
            Err(RosEnvError { variable: RMW_IMPLEMENTATION, value, allowed })
        }
        _ => Ok(Middleware::Dds),
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

fn static_peers(value: Option<String>) -> Result<Vec<String>, RosEnvError> {
    let Some(value) = value else { return Ok(Vec::new()) };
    let peers: Vec<String> =
        value.split(';').map(str::trim).filter(|peer| !peer.is_empty()).map(str::to_owned).collect();
    if peers.len() <= STATIC_PEERS_MAX {
        return Ok(peers);
    }
    let allowed = "at most 32 names or addresses, separated by semicolons";
    Err(RosEnvError { variable: STATIC_PEERS, value, allowed })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn env(variables: &[(&str, &str)]) -> Result<RosEnv, RosEnvError> {
        RosEnv::from_vars(|name| variables.iter().find(|(n, _)| *n == name).map(|(_, value)| (*value).to_owned()))
    }

    #[test]
    fn default_is_this_machine_only() {
        let home = RosEnv::default();
        assert_eq!(env(&[]), Ok(home.clone()));
        let empty = [(DOMAIN_ID, ""), (RANGE, ""), (LOCALHOST_ONLY, ""), (STATIC_PEERS, "")];
        assert_eq!(env(&empty), Ok(home.clone()));
        assert_eq!(home.to_string(), "ROS domain 0, range LOCALHOST");
    }

    #[test]
    fn other_middleware_than_zenoh_is_dds() {
        for value in ["", "rmw_fastrtps_cpp", "rmw_cyclonedds_cpp", "rmw_unknown"] {
            assert_eq!(env(&[(RMW_IMPLEMENTATION, value)]).unwrap().middleware, Middleware::Dds, "{value}");
        }
    }

    #[cfg(feature = "zenoh")]
    #[test]
    fn zenoh_is_chosen_by_rmw_implementation() {
        let env = env(&[(RMW_IMPLEMENTATION, ZENOH), (DOMAIN_ID, "7")]).unwrap();
        assert_eq!(env.middleware, Middleware::Zenoh);
        assert_eq!(env.to_string(), "ROS domain 7 over Zenoh");
    }

    #[cfg(not(feature = "zenoh"))]
    #[test]
    fn a_build_without_zenoh_says_how_to_make_one() {
        let error = env(&[(RMW_IMPLEMENTATION, ZENOH)]).unwrap_err().to_string();
        assert!(error.starts_with("RMW_IMPLEMENTATION is \"rmw_zenoh_cpp\"; allowed are those of DDS"), "{error}");
        assert!(error.contains("cargo build --release --features zenoh"), "{error}");
    }

    #[test]
    fn every_range_is_parsed() {
        for range in
            [DiscoveryRange::Off, DiscoveryRange::Localhost, DiscoveryRange::Subnet, DiscoveryRange::SystemDefault]
        {
            assert_eq!(env(&[(RANGE, &range.to_string())]).unwrap().range, range);
        }
    }

    #[test]
    fn localhost_only_1_takes_precedence() {
        let range = |variables: &[(&str, &str)]| env(variables).unwrap().range;
        assert_eq!(range(&[(LOCALHOST_ONLY, "1"), (RANGE, "SUBNET")]), DiscoveryRange::Localhost);
        assert_eq!(range(&[(LOCALHOST_ONLY, "0"), (RANGE, "OFF")]), DiscoveryRange::Off);
        assert_eq!(range(&[(LOCALHOST_ONLY, "0")]), DiscoveryRange::Subnet);
    }

    #[test]
    fn domain_id_ends_at_232() {
        assert_eq!(env(&[(DOMAIN_ID, "232")]).unwrap().domain_id, 232);
        for value in ["233", "-1", "65536", "1.0", "seven"] {
            let error = env(&[(DOMAIN_ID, value)]).unwrap_err();
            assert_eq!(error.to_string(), format!("ROS_DOMAIN_ID is {value:?}; allowed are 0 to 232"));
        }
    }

    #[test]
    fn static_peers_are_of_ranges_that_reach_them() {
        let peers =
            |range: &str, peers: &str| env(&[(RANGE, range), (STATIC_PEERS, peers)]).map(|env| env.static_peers);
        assert_eq!(peers("SUBNET", "10.0.0.1; server ;"), Ok(vec!["10.0.0.1".to_owned(), "server".to_owned()]));
        assert_eq!(peers("SUBNET", ";"), Ok(Vec::new()));
        assert_eq!(peers("LOCALHOST", "10.0.0.1"), Ok(Vec::new()));
        assert_eq!(peers("OFF", "10.0.0.1"), Ok(Vec::new()));
        let many = "a;".repeat(STATIC_PEERS_MAX + 1);
        assert!(peers("SUBNET", &many).unwrap_err().to_string().contains("at most 32"));
        let env = env(&[(RANGE, "SUBNET"), (STATIC_PEERS, "a;b")]).unwrap();
        assert_eq!(env.to_string(), "ROS domain 0, range SUBNET, peers a;b");
    }

    #[test]
    fn errors_name_variable_and_allowed_values() {
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
