//! The configuration of the session, by the environment variables of `rmw_zenoh`.
//!
//! `ZENOH_SESSION_CONFIG_URI` names a file, `ZENOH_CONFIG_OVERRIDE` changes single values, and
//! `ZENOH_ROUTER_CHECK_ATTEMPTS` says how often to look for a router. Without a file the settings
//! are the defaults of `rmw_zenoh`: a peer that connects to the router of this machine, by which
//! it finds the others, and that others of this machine connect to.

use ::zenoh::Config;

/// A configuration file, instead of [`DEFAULT`].
const FILE: &str = "ZENOH_SESSION_CONFIG_URI";

/// Settings that go before those of the file: `key=value`, separated by semicolons.
const OVERRIDE: &str = "ZENOH_CONFIG_OVERRIDE";

/// How often to look for a router.
const ROUTER_CHECKS: &str = "ZENOH_ROUTER_CHECK_ATTEMPTS";

/// What `rmw_zenoh` sets otherwise than Zenoh, and a smaller limit for received messages: nothing
/// that a process here subscribes to is larger. Late readers of latched topics need the timestamps.
const DEFAULT: &str = r#"{
  mode: "peer",
  connect: { endpoints: ["tcp/localhost:7447"], timeout_ms: { peer: -1 }, exit_on_failure: { peer: false } },
  listen: { endpoints: ["tcp/localhost:0"] },
  scouting: {
    multicast: { enabled: false },
    gossip: {
      target: { router: ["router", "peer"], peer: ["router"] },
      autoconnect: { router: [], peer: ["router", "peer"] },
      autoconnect_strategy: { peer: { to_router: "always", to_peer: "greater-zid" } },
    },
  },
  timestamping: { enabled: true },
  queries_default_timeout: 600000,
  transport: {
    unicast: { open_timeout: 60000, accept_timeout: 60000, accept_pending: 10000, max_sessions: 10000 },
    link: { tx: { lease: 60000 }, rx: { max_message_size: 1000000 } },
  },
}"#;

/// How often to look for a router before the session counts as ready.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RouterChecks {
    None,
    AtMost(u32),
    Forever,
}

/// The configuration.
pub(super) fn session(variable: impl Fn(&str) -> Option<String>) -> Result<Config, String> {
    let mut config = match variable(FILE) {
        Some(file) => Config::from_file(&file).map_err(|error| format!("{FILE}: {file}: {}", reason(&error)))?,
        None => Config::from_json5(DEFAULT).map_err(|error| error.to_string())?,
    };
    for setting in variable(OVERRIDE).iter().flat_map(|all| all.split(';')).map(str::trim).filter(|one| !one.is_empty())
    {
        let (key, value) = setting
            .split_once('=')
            .ok_or_else(|| format!("{OVERRIDE}: {setting:?}; expected key=value, separated by semicolons"))?;
        config
            .insert_json5(key.trim(), value.trim())
            .map_err(|error| format!("{OVERRIDE}: {}: {}", key.trim(), reason(&error)))?;
    }
    Ok(config)
}

/// The text of an error of Zenoh, without the place in its sources.
pub(super) fn reason(error: &::zenoh::Error) -> String {
    let text = error.to_string();
    match text.rsplit_once(" at ") {
        Some((reason, place)) if place.contains(".rs:") => reason.to_owned(),
        _ => text,
    }
}

/// How often to look for a router: once, unless the variable says otherwise.
pub(super) fn router_check_attempts(variable: impl Fn(&str) -> Option<String>) -> Result<RouterChecks, String> {
    let Some(value) = variable(ROUTER_CHECKS) else { return Ok(RouterChecks::AtMost(1)) };
    match value.parse::<i32>() {
        Ok(0) => Ok(RouterChecks::Forever),
        Ok(attempts) => Ok(u32::try_from(attempts).map_or(RouterChecks::None, RouterChecks::AtMost)),
        Err(_) => Err(format!("{ROUTER_CHECKS} is {value:?}; allowed are whole numbers: 0 waits, -1 does not look")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with<'a>(variables: &'a [(&'a str, &'a str)]) -> impl Fn(&str) -> Option<String> + 'a {
        |name| variables.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned())
    }

    fn value(variables: &[(&str, &str)], key: &str) -> String {
        session(with(variables)).unwrap().get_json(key).unwrap()
    }

    #[test]
    fn default_is_a_peer_of_this_machine() {
        assert_eq!(value(&[], "mode"), "\"peer\"");
        assert_eq!(value(&[], "connect/endpoints"), "[\"tcp/localhost:7447\"]");
        assert_eq!(value(&[], "scouting/multicast/enabled"), "false");
        assert_eq!(value(&[], "timestamping/enabled"), "true");
        assert_eq!(value(&[], "transport/link/rx/max_message_size"), "1000000");
    }

    #[test]
    fn overrides_go_before_the_file() {
        let file = tempfile::NamedTempFile::with_suffix(".json5").unwrap();
        std::fs::write(&file, "{ mode: \"client\", connect: { endpoints: [\"tcp/10.0.0.1:1\"] } }").unwrap();
        let file = file.path().to_str().unwrap();
        assert_eq!(value(&[(FILE, file)], "mode"), "\"client\"");
        let both = [(FILE, file), (OVERRIDE, "mode=\"peer\"; connect/endpoints=[\"tcp/localhost:7448\"];")];
        assert_eq!(value(&both, "mode"), "\"peer\"");
        assert_eq!(value(&both, "connect/endpoints"), "[\"tcp/localhost:7448\"]");
    }

    #[test]
    fn errors_name_the_variable() {
        for (variable, value) in
            [(FILE, "/does/not/exist.json5"), (OVERRIDE, "mode"), (OVERRIDE, "mode=7"), (OVERRIDE, "no/such/key=1")]
        {
            let error = session(with(&[(variable, value)])).err().unwrap();
            assert!(error.starts_with(variable) && !error.contains(".rs:"), "{value}: {error}");
        }
        let error = router_check_attempts(with(&[(ROUTER_CHECKS, "often")])).unwrap_err();
        assert!(error.starts_with("ZENOH_ROUTER_CHECK_ATTEMPTS is \"often\"; allowed are"), "{error}");
    }

    #[test]
    fn router_checks_are_those_of_rmw_zenoh() {
        let checks = |value| router_check_attempts(with(&[(ROUTER_CHECKS, value)])).unwrap();
        assert_eq!(router_check_attempts(with(&[])), Ok(RouterChecks::AtMost(1)));
        assert_eq!(checks("0"), RouterChecks::Forever);
        assert_eq!(checks("-1"), RouterChecks::None);
        assert_eq!(checks("3"), RouterChecks::AtMost(3));
    }
}
