use std::cell::RefCell;
use std::rc::Rc;

use msgs::cdr::{self, Encoded};
use msgs::geometry_msgs::Point;
use msgs::ids::AgentId;
use msgs::maes_msgs::Progress;
use msgs::message::MessageType;
use msgs::service::{Ask, Reply};
use msgs::simulation_interfaces::{
    Result as Outcome, SetSimulationStateRequest, SetSimulationStateResponse, SimulationState, StepSimulationRequest,
    StepSimulationResponse,
};
use msgs::std_msgs::{ColorRGBA, Header};
use msgs::topics::{self, Qos, Topic};
use msgs::visualization_msgs::Marker;

use super::*;
use crate::Recording;
use crate::SCENARIO_ATTACHMENT;
use crate::recorder::{Document, Recorder};
use simulation::visualisation::{self, StaticFrames, VisualisationMessage, VisualisationTopic};
use world::lidar::PlaceOnBody;

const SCENARIO: &str = "seed = 1\nduration_s = 100.0\nmap = { kind = \"spheres\", size = 5 }\nagents = { count = 2 }\n";
const MAP: &str = "###\n###\n###\n\n###\n#.#\n###\n\n###\n###\n###\n";

type Recorded = (Topic, u64, Vec<u8>);

fn progress(tick: u64) -> Recorded {
    (topics::progress(), tick, cdr::encode(&Progress { tick, ..Progress::default() }))
}

/// A message of a topic that is not latched.
fn passing(tick: u64) -> Recorded {
    (topics::odometry(AgentId(1)), tick, vec![0, 1, 0, 0, u8::try_from(tick).unwrap_or(u8::MAX)])
}

/// A marker next_retransmission of unexplored cells.
fn next_retransmission(tick: u64, id: i32, cubes: usize) -> Recorded {
    let points = vec![Point::default(); cubes];
    let marker = Marker::cubes(Header::default(), "unexplored", id, 1.0, ColorRGBA::default(), points);
    (topics::unexplored(), tick, cdr::encode(&marker))
}

fn bytes(messages: &[Recorded], map: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let document = |name, text: &'static str| Document { name, media_type: "text/plain", data: text.as_bytes() };
    let map = Document { data: map.as_bytes(), ..document("map.txt", "") };
    let mut recorder = Recorder::create(&file, &[document(SCENARIO_ATTACHMENT, SCENARIO), map]).unwrap();
    for (topic, tick, bytes) in messages {
        recorder.write(topic, Tick(*tick), bytes).unwrap();
    }
    recorder.finish().unwrap();
    std::fs::read(file).unwrap()
}

fn recording(messages: &[Recorded]) -> Recording {
    Recording::from_bytes("run.mcap".to_owned(), bytes(messages, MAP)).unwrap()
}

/// All topics without the static ones.
fn options(start_s: f64, end_s: Option<f64>) -> PlaybackOptions {
    let exclude = ["/sim/map", "/tf_static"].map(str::to_owned).into();
    PlaybackOptions { start_s, end_s, exclude, ..PlaybackOptions::default() }
}

/// Messages before the first tick, and those of each tick.
fn played(recording: &Recording, options: &PlaybackOptions) -> (Vec<Recorded>, Vec<Recorded>) {
    let schedule = PlaybackSchedule::new(recording, options).unwrap();
    let (first, last) = schedule.ticks();
    let recorded = |message: ScheduledMessage, tick: u64| {
        (schedule.topics()[message.topic].clone(), tick, cdr::encode(&message.message))
    };
    let mut cursor = PlaybackCursor::new(recording, &schedule);
    let opening = std::iter::from_fn(|| cursor.next_initial()).map(|message| recorded(message, first.0)).collect();
    let ticks = (first.0..=last.0).flat_map(|tick| {
        let messages: Vec<ScheduledMessage> = std::iter::from_fn(|| cursor.next_until(Tick(tick))).collect();
        messages.into_iter().map(move |message| (message, tick)).collect::<Vec<_>>()
    });
    let ticks: Vec<(ScheduledMessage, u64)> = ticks.collect();
    (opening, ticks.into_iter().map(|(message, tick)| recorded(message, tick)).collect())
}

#[test]
fn messages_come_in_their_tick_and_file_order() {
    let all =
        [progress(0), passing(0), passing(3), next_retransmission(3, 1, 2), passing(3), passing(50), progress(51)];
    let recording = recording(&all);
    assert_eq!(played(&recording, &options(0.0, None)), (vec![], all.to_vec()));
    assert_eq!(played(&recording, &options(0.06, Some(1.0))).1, all[2..6]);
    // Times between ticks select the ticks inside.
    assert_eq!(played(&recording, &options(0.061, Some(1.019))).1, all[5..6]);
}

#[test]
fn latched_messages_from_before_the_start_come_first() {
    let (old, new, other) = (next_retransmission(0, 7, 3), next_retransmission(2, 7, 1), next_retransmission(1, 8, 2));
    let all = [progress(0), old, passing(0), other.clone(), progress(2), new.clone(), passing(3), progress(4)];
    let (opening, ticks) = played(&recording(&all), &options(0.06, None));
    let opening: Vec<_> = opening.into_iter().map(|(topic, _, bytes)| (topic, bytes)).collect();
    let held = [progress(2), other, new].map(|(topic, _, bytes)| (topic, bytes));
    assert_eq!(opening, held);
    assert_eq!(ticks, all[6..]);
}

#[test]
fn missing_static_messages_are_made() {
    let recording = recording(&[passing(0)]);
    let (opening, _) = played(&recording, &PlaybackOptions::default());
    let terrain = voxels::Grid::from_text(MAP).unwrap();
    let frames = StaticFrames { lidars: vec![vec![(None, PlaceOnBody::default())]; 2], has_drift: false };
    let made: Vec<(Topic, Vec<u8>)> = visualisation::static_messages(&terrain, &frames)
        .into_iter()
        .map(|(view, picture)| (view.topic(), cdr::encode(&picture)))
        .collect();
    assert!(made.iter().any(|(topic, _)| *topic == topics::map()), "there are walls");
    assert_eq!(opening.into_iter().map(|(topic, _, bytes)| (topic, bytes)).collect::<Vec<_>>(), made);

    let walls = visualisation::static_messages(&terrain, &frames)
        .into_iter()
        .find(|(view, _)| *view == VisualisationTopic::Map)
        .unwrap()
        .1;
    let VisualisationMessage::Marker(marker) = walls else { panic!("walls are markers") };
    let own = (topics::map(), 0, cdr::encode(&*marker));
    let (opening, ticks) = played(&self::recording(std::slice::from_ref(&own)), &PlaybackOptions::default());
    assert_eq!(opening.iter().map(|(topic, ..)| topic.clone()).collect::<Vec<_>>(), [topics::tf_static()]);
    assert_eq!(ticks, [own]);
}

#[test]
fn unplayable_messages_are_noted() {
    let unknown = MessageType { package: "robot_msgs", name: "Leg", definition: "int32 angle\n" };
    let strange = Topic { name: "/chatter".to_owned(), message: unknown, ..topics::progress() };
    let wrong_type = Topic { name: "/sim/info".to_owned(), ..topics::progress() };
    let big_endian = (topics::digest(), 1, vec![0, 0, 0, 0, 1]);
    let messages = [(strange, 0, progress(0).2), (wrong_type, 0, progress(0).2), big_endian, passing(2)];
    let whole = bytes(&messages, "no map");
    let schedule = |bytes: &[u8]| {
        let recording = Recording::from_bytes("run.mcap".to_owned(), bytes.to_vec()).unwrap();
        PlaybackSchedule::new(&recording, &PlaybackOptions::default())
    };
    let notes = schedule(&whole).unwrap().notes().to_vec();
    let wrong = "not a topic of a run, and of another type, robot_msgs/msg/Leg; `ros2 bag play` plays it";
    assert_eq!(notes[0], format!("/chatter: 1 not played: {wrong}"));
    assert!(notes[1].starts_with("/sim/digest: 1 not played: the message is big-endian"), "{notes:?}");
    assert!(notes[2].starts_with("/sim/info: 1 not played: its type is maes_msgs/msg/Progress, not diag"), "{notes:?}");
    assert!(notes[3].starts_with("run.mcap: no map to show: the map of the recording: map.txt: "), "{notes:?}");
    assert_eq!(notes.len(), 4);

    let many: Vec<Recorded> = (0..2000).map(progress).collect();
    let cut = bytes(&many, MAP);
    let schedule = schedule(&cut[..cut.len() * 2 / 3]).unwrap();
    let [note] = schedule.notes() else { panic!("one note: {:?}", schedule.notes()) };
    assert!(note.starts_with("run.mcap is cut off behind byte "), "{note}");
    assert!(schedule.ticks().1 > Tick(0) && schedule.ticks().1 < Tick(1999));
}

#[test]
fn topics_of_other_programs_are_played() {
    let added = |name: &str, qos| Topic { name: name.to_owned(), qos, ..topics::robot_description() };
    let chatter = (added("/chatter", Qos::reliable(7)), 2, vec![0, 1, 0, 0, 1]);
    let latched = (added("/notes/of_me", Qos::latched(7)), 2, vec![0, 1, 0, 0, 2]);
    let illegal = (added("/no name", Qos::reliable(7)), 2, vec![0, 1, 0, 0, 3]);
    let recording = recording(&[passing(0), chatter, latched, illegal, passing(3)]);
    let ticks = played(&recording, &options(0.0, None)).1;
    let topics: Vec<(&str, u64, u8)> =
        ticks.iter().map(|(topic, tick, bytes)| (topic.name.as_str(), *tick, bytes[4])).collect();
    assert_eq!(topics, [("/agent_1/odom", 0, 0), ("/chatter", 2, 1), ("/notes/of_me", 2, 2), ("/agent_1/odom", 3, 3)]);
    assert_eq!([ticks[1].0.qos, ticks[2].0.qos], [Qos::reliable(10), Qos::latched(10)]);
    let only = |pattern: &str| PlaybackOptions { only: vec![pattern.to_owned()], ..PlaybackOptions::default() };
    assert_eq!(played(&recording, &only("/chatter")).1.len(), 1);
    let refused = PlaybackSchedule::new(&recording, &only("/no*")).unwrap().topics().len();
    assert_eq!(refused, 1, "the legal one");
    let refused = PlaybackSchedule::new(&recording, &only("/no name")).unwrap_err().to_string();
    assert!(refused.starts_with("--topics /no name: in run.mcap, but not played: not a name"), "{refused}");
}

#[test]
fn messages_in_any_order_are_played_in_that_of_their_times() {
    let sorted = [progress(0), passing(0), passing(2), passing(700), progress(1400), passing(4900)];
    let mut mixed = sorted.clone();
    mixed.reverse();
    mixed.swap(1, 4);
    let other = recording(&mixed);
    // Those of a tick stay in the order of the file.
    let mut expected = sorted.to_vec();
    expected.swap(0, 1);
    assert_eq!(played(&other, &options(0.0, None)).1, expected);
    let schedule = |recording: &Recording| PlaybackSchedule::new(recording, &options(0.0, None)).unwrap();
    assert_eq!(ticks_played(&schedule(&other)), ticks_played(&schedule(&recording(&sorted))));
    assert!(schedule(&other).notes()[0].contains("not in the order of their log times"));
    assert_eq!(played(&other, &options(20.0, None)).1, sorted[4..]);
}

#[test]
fn illegal_options_are_refused() {
    let recording = recording(&[passing(0), progress(100)]);
    let refused = |options: PlaybackOptions| PlaybackSchedule::new(&recording, &options).unwrap_err().to_string();
    let only = |only: &[&str], exclude: &[&str]| PlaybackOptions {
        only: only.iter().map(ToString::to_string).collect(),
        exclude: exclude.iter().map(ToString::to_string).collect(),
        ..PlaybackOptions::default()
    };
    assert!(refused(options(-1.0, None)).starts_with("--start -1: expected"));
    assert!(refused(options(f64::NAN, None)).starts_with("--start NaN: expected"));
    assert!(refused(options(1.0, Some(1.0))).starts_with("--end 1: expected"));
    assert_eq!(refused(options(3.0, None)), "run.mcap: no tick from 3 s on: the recording ends at 2 s");
    assert_eq!(
        refused(options(0.001, Some(0.002))),
        "run.mcap: no tick from 0.001 s on up to 0.002 s: the recording ends at 2 s"
    );
    let there = "run.mcap, which has /agent_1/odom, /sim/map, /sim/progress, /tf_static";
    assert_eq!(refused(only(&["/sim"], &[])), format!("--topics /sim: no such topic in {there}"));
    assert_eq!(refused(only(&[], &["/x*"])), format!("--exclude /x*: no such topic in {there}"));
    assert_eq!(refused(only(&["/sim/*"], &["/*"])), "run.mcap: no message is left to play");

    let topics = |options: &PlaybackOptions| -> Vec<String> {
        let schedule = PlaybackSchedule::new(&recording, options).unwrap();
        schedule.topics().iter().map(|topic| topic.name.clone()).collect()
    };
    assert_eq!(topics(&only(&["/sim/*", "/tf_static"], &["/sim/map"])), ["/sim/progress", "/tf_static"]);
}

#[test]
fn late_readers_get_what_the_publisher_does_not_keep() {
    assert!(LatchedCache::for_topic(&topics::odometry(AgentId(0))).is_none());
    let message = |id: i32, cubes: usize| Encoded::new(&next_retransmission(0, id, cubes).2).unwrap();
    let mut cache = LatchedCache::for_topic(&topics::unexplored()).unwrap();
    cache.record_published(&message(1, 1));
    cache.record_published(&message(2, 1));
    for _ in 0..topics::unexplored().qos.depth - 1 {
        cache.record_published(&message(3, 1));
    }
    assert_eq!(cache.next_missing(), None);
    cache.reader_joined();
    assert_eq!(cache.next_missing(), Some(&message(1, 1)));
    // A newer message on the subject needs no retransmission.
    cache.record_published(&message(1, 2));
    assert_eq!(cache.next_missing(), None);
    cache.reader_joined();
    assert_eq!(cache.next_missing(), Some(&message(2, 1)));
    cache.record_published(&message(2, 1));
    cache.reader_joined();
    assert_eq!(cache.next_missing(), None);
    // A new publisher keeps nothing.
    cache.publisher_replaced();
    cache.reader_joined();
    assert_eq!(cache.next_missing(), Some(&message(1, 2)));
}

/// A replay of the ticks 10 to 12 at real time.
fn player(is_loop: bool, is_paused: bool) -> Player {
    let schedule = PlaybackSchedule::new(&recording(&[passing(0), passing(12)]), &options(0.2, None)).unwrap();
    Player::new(&schedule, PlaybackTiming { rate: Rtf::Limit(1.0), is_loop, is_paused }, 5)
}

const TICK_NS: u64 = Tick::TICK_NS;

/// Sends a request; the cell holds the result code once it is answered.
fn ask<R: 'static>(
    player: &mut Player,
    wall_ns: u64,
    outcome: fn(R) -> Outcome,
    request: impl FnOnce(Reply<R>) -> Request,
) -> Rc<RefCell<Option<u8>>> {
    let code = Rc::new(RefCell::new(None));
    let answered = Rc::clone(&code);
    let reply = Reply::new(move |response| *answered.borrow_mut() = Some(outcome(response).result));
    player.answer(request(reply), wall_ns);
    code
}

fn set_state(player: &mut Player, state: u8, wall_ns: u64) -> Option<u8> {
    let request = SetSimulationStateRequest { state: SimulationState { state } };
    let code = ask(
        player,
        wall_ns,
        |response: SetSimulationStateResponse| response.result,
        |reply| Request::SetState(Ask { request, reply }),
    );
    code.take()
}

fn step(player: &mut Player, steps: u64) -> Rc<RefCell<Option<u8>>> {
    ask(
        player,
        0,
        |response: StepSimulationResponse| response.result,
        |reply| Request::Step(Ask { request: StepSimulationRequest { steps }, reply }),
    )
}

#[test]
fn ticks_are_due_at_the_rate() {
    let mut player = player(false, false);
    assert_eq!(player.next_action(5), PlayerAction::Play(Tick(10)));
    player.played();
    assert_eq!(player.next_action(6), PlayerAction::Wait(TICK_NS - 1));
    assert_eq!(player.next_action(5 + TICK_NS), PlayerAction::Play(Tick(11)));
    player.played();
    // A late tick does not delay the next one.
    assert_eq!(player.next_action(5 + 2 * TICK_NS), PlayerAction::Play(Tick(12)));
    player.played();
    assert_eq!(
        (player.next_action(5 + 2 * TICK_NS), player.sim_ticks(), player.position()),
        (PlayerAction::End, 2, Tick(12))
    );
}

#[test]
fn loop_rewinds_after_the_last_tick() {
    let mut player = player(true, false);
    for round in 0..3 {
        let begun = 5 + round * 1000 * TICK_NS;
        for tick in 0..3 {
            assert_eq!(player.next_action(begun + tick * TICK_NS), PlayerAction::Play(Tick(10 + tick)));
            player.played();
        }
        assert_eq!(player.next_action(begun + 2 * TICK_NS), PlayerAction::Wait(TICK_NS));
        assert_eq!(player.next_action(begun + 1000 * TICK_NS), PlayerAction::Rewind);
    }
    assert_eq!(player.sim_ticks(), 6);
}

#[test]
fn pause_and_rate_change_take_effect_at_once() {
    let mut player = player(false, false);
    player.played();
    assert_eq!(set_state(&mut player, SimulationState::STATE_PAUSED, 6), Some(Outcome::RESULT_OK));
    assert_eq!(player.next_action(100 * TICK_NS), PlayerAction::Idle);
    assert_eq!(set_state(&mut player, SimulationState::STATE_PLAYING, 200 * TICK_NS), Some(Outcome::RESULT_OK));
    assert_eq!(player.next_action(200 * TICK_NS), PlayerAction::Play(Tick(11)));
    player.played();
    assert_eq!(player.next_action(200 * TICK_NS), PlayerAction::Wait(TICK_NS));
    player.answer(Request::Rtf(Rtf::MAX), 200 * TICK_NS);
    assert_eq!(player.next_action(200 * TICK_NS), PlayerAction::Play(Tick(12)));
    assert_eq!(set_state(&mut player, SimulationState::STATE_QUITTING, 0), Some(Outcome::RESULT_OK));
    assert_eq!((player.next_action(0), player.is_quitting()), (PlayerAction::End, true));
}

#[test]
fn steps_are_answered_after_the_last_or_at_the_end() {
    let mut player = player(false, true);
    assert_eq!(player.next_action(9), PlayerAction::Idle);
    let answer = step(&mut player, 2);
    for tick in [10, 11] {
        assert_eq!((player.next_action(0), answer.take()), (PlayerAction::Play(Tick(tick)), None));
        player.played();
    }
    assert_eq!((player.next_action(0), answer.take()), (PlayerAction::Idle, Some(Outcome::RESULT_OK)));
    let answer = step(&mut player, 2);
    assert_eq!(player.next_action(0), PlayerAction::Play(Tick(12)));
    player.played();
    assert_eq!((player.next_action(0), answer.take()), (PlayerAction::Idle, Some(Outcome::RESULT_OPERATION_FAILED)));
    // It stays at its end until it is set to play or quit.
    assert_eq!(player.next_action(0), PlayerAction::Idle);
    let answer = step(&mut player, 1);
    player.end();
    assert_eq!(answer.take(), Some(Outcome::RESULT_OPERATION_FAILED));
    assert_eq!(set_state(&mut player, SimulationState::STATE_PLAYING, 0), Some(Outcome::RESULT_OK));
    assert_eq!(player.next_action(0), PlayerAction::End);
}

/// The ticks that a replay as fast as possible plays.
fn ticks_played(schedule: &PlaybackSchedule) -> Vec<u64> {
    let mut player = Player::new(schedule, PlaybackTiming { rate: Rtf::MAX, is_loop: false, is_paused: false }, 0);
    let mut ticks = Vec::new();
    while let PlayerAction::Play(tick) = player.next_action(0) {
        ticks.push(tick.0);
        player.played();
    }
    assert_eq!(player.next_action(0), PlayerAction::End);
    ticks
}

#[test]
fn stamps_after_the_duration_are_refused() {
    let all = [progress(0), passing(1), progress(5001), passing(u64::MAX / Tick::TICK_NS), passing(2), progress(3)];
    let recording = recording(&all);
    assert_eq!(played(&recording, &options(0.0, None)).1, [&all[..2], &all[4..]].concat());
    assert_eq!(played(&recording, &options(0.04, None)).1, all[4..]);
    let schedule = PlaybackSchedule::new(&recording, &options(0.0, None)).unwrap();
    let notes = ["/agent_1/odom", "/sim/progress"]
        .map(|topic| format!("{topic}: 1 not played: stamped after 100 s, the duration of its run"));
    assert_eq!(schedule.notes(), notes);
    assert_eq!(ticks_played(&schedule), [0, 1, 2, 3]);
    let late = self::recording(&[progress(5001)]);
    let refused = PlaybackSchedule::new(&late, &options(0.0, None)).unwrap_err().to_string();
    assert_eq!(refused, "run.mcap: no message is left to play");
}

#[test]
fn empty_time_is_skipped() {
    let all = [progress(0), passing(2), passing(4900), progress(1), progress(4902)];
    let schedule = |options| PlaybackSchedule::new(&recording(&all), &options).unwrap();
    assert_eq!(ticks_played(&schedule(options(0.0, None))), [0, 1, 2, 4900, 4901, 4902]);
    // From or to the middle of a gap.
    assert_eq!(ticks_played(&schedule(options(20.0, None))), [1000, 4900, 4901, 4902]);
    assert_eq!(ticks_played(&schedule(options(0.0, Some(20.0)))), [0, 1, 2]);
    // A second of wall time before the tick after a gap would be one of sim time.
    let timing = PlaybackTiming { rate: Rtf::Limit(1.0), is_loop: false, is_paused: false };
    let mut player = Player::new(&schedule(options(0.0, None)), timing, 0);
    (0..3).for_each(|_| player.played());
    assert_eq!(player.next_action(7 * TICK_NS), PlayerAction::Play(Tick(4900)));
    player.played();
    assert_eq!(player.next_action(7 * TICK_NS), PlayerAction::Wait(TICK_NS));
    // A gap that is just short enough is played.
    let short = recording(&[progress(0), progress(500)]);
    assert_eq!(ticks_played(&PlaybackSchedule::new(&short, &options(0.0, None)).unwrap()).len(), 501);
}

#[test]
fn mutants_of_stamps_end() {
    let honest: Vec<Recorded> =
        (0..300).map(|tick| if tick % 2 == 0 { progress(tick) } else { passing(tick) }).collect();
    for bit in 0..58 {
        for place in [0, 57, 299] {
            let mut mutant = honest.clone();
            mutant[place].1 = (mutant[place].1 ^ (1 << bit)).min(u64::MAX / Tick::TICK_NS);
            let recording = recording(&mutant);
            let schedule = PlaybackSchedule::new(&recording, &options(0.0, None)).unwrap();
            let (messages, ticks) = (played_by(&recording, &schedule), ticks_played(&schedule));
            assert!(ticks.len() <= 1000, "{} ticks with bit {bit} of {place}", ticks.len());
            let refused = usize::from(mutant[place].1 > 5000);
            assert_eq!(messages, honest.len() - refused, "bit {bit} of {place}");
        }
    }
}

/// The number of messages that a cursor yields at the ticks that a player plays.
fn played_by(recording: &Recording, schedule: &PlaybackSchedule) -> usize {
    let mut cursor = PlaybackCursor::new(recording, schedule);
    let ticks = ticks_played(schedule).into_iter();
    ticks.map(|tick| std::iter::from_fn(|| cursor.next_until(Tick(tick))).count()).sum()
}
