//! Runs with batteries: the same bytes over ROS 2 and in memory, forked, and with a killed server,
//! and the messages of the batteries.

use msgs::cdr;
use msgs::ids::Tick;
use msgs::maes_msgs::{AgentMessage, Energy, Observation};
use msgs::sensor_msgs::BatteryState;

use crate::sensors::agrees_with_the_map;
use crate::support::processes::signal;
use crate::support::recordings::{Recording, counter};
use crate::support::runs::{Site, scenario, text};

#[test]
fn endurance_is_the_same_forked_and_resumed() {
    let site = Site::new();
    let scenario = scenario("endurance.toml");
    let whole = site.record(&[text(&scenario), "--transport", "memory"]);

    let paced = ["--rtf", "60", "--decision-timeout", "2", "--record", "run.mcap"];
    let mut run = site.start(&mut site.run_sh(&[&[text(&scenario)][..], &paced].concat()));
    run.is_under_way(&site.path("run.mcap"));
    signal(run.process().member(&["sim_server", "run"]), "KILL");
    run.ended().with_code(137);
    let resumed = site.start(&mut site.run_sh(&["--resume", "run.mcap"])).ended().with_code(0);
    assert_eq!(resumed.digest(), whole.digest());
    let recording = site.recording("run.mcap");
    assert!(std::fs::read(site.path("run.mcap")).expect("it is complete") == whole.bytes, "run.mcap");
    assert!(counter(&recording.result(), "energy_used_millijoules") > 0, "{:?}", recording.result());
    site.assert_fork_is_same("200", &whole.digest());
}

#[test]
fn battery_states_are_those_of_the_observations() {
    let site = Site::new();
    let scenario = scenario("endurance.toml");
    let arguments = ["--duration", "240", "--record-topics", "battery"];
    let memory = site.record(&[&[text(&scenario), "--transport", "memory"][..], &arguments].concat());
    let ros = site.record(&[&[text(&scenario)][..], &arguments].concat());
    memory.assert_same(&ros, "endurance.toml");

    let recording = Recording::from_bytes(&memory.bytes);
    let observations: Vec<Observation> = recording.of("/agent_1/observation");
    let of_tick = |tick: u64| observations.iter().filter(move |observation| observation.tick == tick);
    let states: Vec<BatteryState> = recording.of("/agent_1/battery_state");
    let mut compared = 0;
    for state in &states {
        let time_ns = i64::from(state.header.stamp.sec) * 1_000_000_000 + i64::from(state.header.stamp.nanosec);
        let tick = u64::try_from(time_ns).expect("sim time is positive") / Tick::TICK_NS;
        let messages = of_tick(tick).flat_map(|observation| &observation.messages);
        for message in
            messages.filter(|message| message.agent == AgentMessage::SERVER && message.kind == AgentMessage::ENERGY)
        {
            let energy: Energy = cdr::decode(&message.data).expect("the server sends an Energy");
            assert_eq!(state.percentage, (energy.left_j / energy.capacity_j) as f32, "tick {tick}");
            compared += 1;
        }
    }
    assert!(states.len() == 241 && compared > 3, "{compared} of {}", states.len());
    let is_known = |value: f32| !value.is_nan();
    assert!(!states.iter().any(|state| is_known(state.voltage) || is_known(state.charge) || !state.present));
}

#[test]
fn batteries_are_drained_and_charged_for_a_node_of_ros() {
    agrees_with_the_map("endurance.toml", &["batteries"], &["--rtf", "20"]);
}
