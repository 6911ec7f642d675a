use super::*;

const BASE: &str = "seed = 7\nduration_s = 60.0\nmap = { kind = \"spheres\", size = 50 }\n";

fn parse(rest: &str) -> Result<Scenario, ScenarioError> {
    Scenario::parse("s.toml", &format!("{BASE}{rest}"), &[])
}

fn scenario(events: &str) -> Scenario {
    parse(&format!("agents = {{ count = 3, set = {{ turn_min_rad = 1.0 }} }}\nevent = [{events}]\n")).unwrap()
}

fn refused(events: &str) -> String {
    parse(&format!("agents = {{ count = 3 }}\nevent = [{events}]\n")).unwrap_err().to_string()
}

fn set(key: &str, value: impl Into<toml::Value>) -> Override {
    let value = value.into();
    Override { origin: format!("--set {key}={value}"), key: key.to_owned(), value: Some(value) }
}

#[test]
fn events_leave_the_beginning_of_a_run_as_it_is() {
    let with = scenario("{ kind = \"break_down\", at_s = 10.0, agent = 1 }");
    let without = scenario("");
    assert_eq!(with.initial_identity(), without.identity());
    assert_ne!(with.identity(), without.identity());
    assert!(!without.identity().contains("event"));
    let again = Scenario::parse("s.toml", &with.identity(), &[]).unwrap();
    assert_eq!(again.event, with.event);
}

#[test]
fn name_of_a_map_file_is_no_part_of_the_beginning_of_a_run() {
    let of = |map: &str| {
        let text =
            format!("seed = 7\nduration_s = 60.0\nagents = {{ count = 1 }}\nmap = {{ kind = \"file\", {map} }}\n");
        Scenario::parse("s.toml", &text, &[]).unwrap()
    };
    let one = of("file = \"m.m3dm\", cell_m = 0.5");
    let other = of("file = \"./m.m3dm\", cell_m = 0.5, import = { cells_max = 9 }");
    assert_eq!(one.initial_identity(), other.initial_identity());
    assert_ne!(one.initial_identity_with_map_file(), other.initial_identity_with_map_file());
    assert!(one.identity().contains("file = \"m.m3dm\""), "a recording names the file");
    assert_ne!(one.initial_identity(), of("file = \"m.m3dm\", cell_m = 1.0").initial_identity());
    let generated = scenario("");
    assert_eq!(generated.initial_identity_with_map_file(), generated.initial_identity());
}

#[test]
fn schedule_has_each_event_with_what_holds_from_then_on() {
    let scenario = scenario(
        "{ kind = \"join\", at_s = 0.5, agent = 2 }, { kind = \"radio_off\", at_s = 1.0, agent = 0 }, \
         { kind = \"set\", at_s = 2.0, set = { \"agents.controller\" = \"lvd\" } }, \
         { kind = \"set\", at_s = 2.0, set = { \"communication.loss\" = 0.5, \"agents.set.x\" = 1 } }",
    );
    assert_eq!(scenario.late_agents(), BTreeSet::from([AgentId(2)]));
    let schedule = scenario.schedule();
    assert_eq!(schedule.iter().map(|event| event.tick.0).collect::<Vec<_>>(), [25, 50, 100, 100]);
    assert_eq!(schedule[1].action, EventAction::SwitchRadio(AgentId(0), false));
    let phases = scenario.phases();
    let shown: Vec<_> = phases
        .iter()
        .map(|phase| (phase.agents.controller.as_str(), phase.agents.set.len(), phase.communication.loss))
        .collect();
    assert_eq!(shown, [("rbw", 1, 0.0), ("lvd", 0, 0.0), ("lvd", 1, 0.5)], "another controller has its own settings");
}

#[test]
fn illegal_events_are_refused_with_their_place() {
    let leave = "{ kind = \"leave\", at_s = 5.0, agent = 1 }";
    for (events, expected) in [
        (
            "{ kind = \"leave\", at_s = 0.03, agent = 1 }",
            "s.toml:5: event[0].at_s = 0.03: expected a multiple of 0.02 s",
        ),
        ("{ kind = \"leave\", at_s = 1.0 }", "event[0].agent = nothing: expected the id of an agent, 0 to 2"),
        ("{ kind = \"leave\", at_s = 1.0, agent = 3 }", "event[0].agent = 3: expected the id of an agent, 0 to 2"),
        (
            "{ kind = \"leave\", at_s = 1.0, agent = 0, set = { seed = 1 } }",
            "event[0].set = { \"seed\" = 1 }: expected only",
        ),
        ("{ kind = \"set\", at_s = 1.0 }", "event[0].set = {}: expected a table of keys"),
        (
            "{ kind = \"set\", at_s = 1.0, agent = 0, set = { duration_s = 1.0 } }",
            "event[0].agent = 0: expected no agent",
        ),
        ("{ kind = \"leaves\", at_s = 1.0, agent = 0 }", "did you mean \"leave\"?"),
        ("{ kind = \"explode\", at_s = 1.0, agent = 0 }", "event[0].kind = \"explode\": expected \"join\", "),
        (
            &format!("{leave}, {{ kind = \"leave\", at_s = 4.0, agent = 0 }}"),
            "event[1].at_s = 4: expected events in the order",
        ),
        (
            &format!("{leave}, {{ kind = \"join\", at_s = 6.0, agent = 1 }}"),
            "event[1].kind = \"join\": agent 1 has left before",
        ),
        ("{ kind = \"radio_on\", at_s = 1.0, agent = 0 }", "the radio of agent 0 is on already"),
    ] {
        let error = refused(events);
        assert!(error.contains(expected), "{events}: {error}");
    }
}

#[test]
fn only_what_has_not_shaped_the_past_changes() {
    for (key, value, expected) in [
        ("map.size", "60", "map.size cannot change during a run: the map and every random number"),
        ("seed", "1", "seed cannot change during a run"),
        ("agents.count", "2", "the team is the one of the past"),
        ("body.radius_m", "0.1", "the bodies have moved with it"),
        ("lidar.range_m", "9.0", "what the agents know was measured with it"),
        ("sensor.range_sigma_m", "0.1", "what the agents know was measured with it"),
        ("localisation.turn_bias", "0.1", "what the agents know was measured with it"),
        ("energy.reserve", "0.3", "energy.reserve cannot change during a run: batteries have drained with it"),
        ("communication.relays.per_agent", "3", "have carried their relays from the start"),
        ("faults.on_agent_loss", "\"drop\"", "it holds for a recording as a whole"),
        ("execution.threads", "2", "it is no part of the run"),
        ("communication.los", "0.5", "unknown key `communication.los`; did you mean `communication.loss`?"),
        ("communication.loss", "1.5", "communication.loss = 1.5: expected 0 to 1"),
        ("duration_s", "\"x\"", "duration_s = \"x\": expected a number (s)"),
    ] {
        let error = refused(&format!("{{ kind = \"set\", at_s = 1.0, set = {{ \"{key}\" = {value} }} }}"));
        assert!(error.contains(expected) && error.starts_with("s.toml:5: event[0].set"), "{key}: {error}");
        let value = toml::from_str::<toml::Table>(&format!("v = {value}")).unwrap()["v"].clone();
        let forked = scenario("").fork(Tick(50), "ab", &[set(key, value)]).unwrap_err().to_string();
        assert!(forked.contains(expected) && forked.starts_with(&format!("--set {key}=")), "{key}: {forked}");
    }
    let keys = keys::TABLES.iter().flat_map(|table| table.keys.iter().map(|key| table.path_of(key.name)));
    // A mix changes as a whole.
    for key in keys.filter(|key| !key.starts_with("agents.mix.")) {
        let refusal = changeable(&key).err();
        assert_eq!(refusal.is_none(), keys::find(&key).unwrap().is_changeable || key == "agents.mix", "{key}");
        assert!(!refusal.is_some_and(|words| words.contains("unknown key")), "{key} has a reason");
    }
}

#[test]
fn forks_have_the_events_of_their_parent_and_one_more() {
    let parent = scenario("{ kind = \"leave\", at_s = 5.0, agent = 1 }");
    let same = parent.fork(Tick(50), "ab", &[set("agents.controller", "rbw"), set("communication.loss", 0.0)]).unwrap();
    assert_eq!(same, parent, "a fork that changes nothing");
    let fork = parent.fork(Tick(50), "ab", &[set("communication.loss", 0.5), set("agents.controller", "rbw")]).unwrap();
    let expected = "{ \"communication.loss\" = 0.5 }";
    assert_eq!((shown(&fork.event[0].set).as_str(), fork.event[0].parent.as_deref()), (expected, Some("ab")));
    assert_eq!(fork.event[1], parent.event[0]);
    assert!(!fork.event[0].digested().contains("parent"));
    let broken = toml::from_str::<toml::Table>("v = [{ kind = \"break_down\", at_s = 7.0, agent = 0 }]").unwrap();
    let event = |table: &toml::Table| set("event", table["v"].clone());
    let fork = fork.fork(Tick(350), "cd", &[event(&broken)]).unwrap();
    assert_eq!(fork.event.len(), 3);
    let mut own = parent.clone();
    own.agents.command = vec!["./own".to_owned()];
    let repeated = |word: &str| own.fork(Tick(50), "ab", &[set("agents.command", vec![word])]);
    assert_eq!(repeated("./own").unwrap(), own, "a program that is repeated changes nothing");
    assert!(repeated("./other").unwrap_err().to_string().contains("programs run for all of a run"));
    let early = parent.fork(Tick(351), "cd", &[event(&broken)]).unwrap_err().to_string();
    assert!(early.contains("at_s = 7: expected no event before the fork, tick 351"), "{early}");
    let join = toml::from_str::<toml::Table>("v = [{ kind = \"join\", at_s = 9.0, agent = 0 }]").unwrap();
    assert!(parent.fork(Tick(350), "cd", &[event(&join)]).unwrap_err().to_string().contains("from the start"));
}

#[test]
fn changes_of_keys_are_bounded_by_what_they_copy() {
    let change =
        |number: usize| format!("{{ kind = \"set\", at_s = {number}.0, set = {{ \"communication.loss\" = 0.5 }} }}");
    let changes = |count: usize| (0..count).map(change).collect::<Vec<_>>().join(", ");
    let with = |count: usize, settings: usize| {
        let set: String = (0..settings).map(|number| format!("agents.set.k{number} = 1\n")).collect();
        let text = format!(
            "{set}seed = 1\nduration_s = 900.0\nmap = {{ kind = \"spheres\", size = 20 }}\nagents.count = 2\n\
             event = [{}]\n",
            changes(count)
        );
        Scenario::parse("s.toml", &text, &[]).map_err(|error| error.to_string())
    };
    assert_eq!(with(50, 100).unwrap().phases().len(), 51);
    let refused = with(800, 9000).unwrap_err();
    assert!(refused.contains("event = 800 changes of keys: expected at most"), "{refused}");
}
