use std::cell::RefCell;
use std::rc::Rc;

use msgs::cdr::{self, Encoded};
use msgs::geometry_msgs::Point;
use msgs::ids::AgentId;
use msgs::maes_msgs::Progress;
use msgs::service::{Ask, Reply};
use msgs::simulation_interfaces::{
    Result as Outcome, ResultResponse, SetSimulationStateRequest, SimulationState, StepRequest,
};
use msgs::std_msgs::{ColorRGBA, Header};
use msgs::topics::{self, Topic};
use msgs::visualization_msgs::Marker;

use super::*;
use crate::recorder::{Document, Recorder};
use crate::recording::Recording;
use crate::setup::SCENARIO_ATTACHMENT;
use simulation::visualisation::{self, VisualisationMessage, VisualisationTopic};

const SCENARIO: &str = "seed = 1\nduration_s = 10.0\nmap = { kind = \"spheres\", size = 5 }\nagents = { count = 2 }\n";
const MAP: &str = "###\n###\n###\n\n###\n#.#\n###\n\n###\n###\n###\n";

type Said = (Topic, u64, Vec<u8>);

fn progress(tick: u64) -> Said {
    (topics::progress(), tick, cdr::encode(&Progress { tick, ..Progress::default() }))
}

/// Something that does not hold on.
fn passing(tick: u64) -> Said {
    (topics::odometry(AgentId(1)), tick, vec![0, 1, 0, 0, u8::try_from(tick).unwrap_or(u8::MAX)])
}

/// Cubes of a piece of what nobody has seen.
fn piece(tick: u64, id: i32, cubes: usize) -> Said {
    let points = vec![Point::default(); cubes];
    let marker = Marker::cubes(Header::default(), "unexplored", id, 1.0, ColorRGBA::default(), points);
    (topics::unexplored(), tick, cdr::encode(&marker))
}

/// The bytes of a recording of these messages.
fn bytes(said: &[Said], map: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let document = |name, text: &'static str| Document { name, media_type: "text/plain", data: text.as_bytes() };
    let map = Document { data: map.as_bytes(), ..document("map.txt", "") };
    let mut recorder = Recorder::create(&file, &[document(SCENARIO_ATTACHMENT, SCENARIO), map]).unwrap();
    for (topic, tick, bytes) in said {
        recorder.write(topic, Tick(*tick), bytes).unwrap();
    }
    recorder.finish().unwrap();
    std::fs::read(file).unwrap()
}

fn recording(said: &[Said]) -> Recording {
    Recording::from_bytes("run.mcap".to_owned(), bytes(said, MAP)).unwrap()
}

/// Everything without the scenery.
fn wishes(start_s: f64, end_s: Option<f64>) -> Wishes {
    let exclude = ["/sim/map", "/tf_static"].map(str::to_owned).into();
    Wishes { start_s, end_s, exclude, ..Wishes::default() }
}

/// What comes before the first tick, and in each tick: topics and bytes.
fn played(recording: &Recording, wishes: &Wishes) -> (Vec<Said>, Vec<Said>) {
    let programme = Programme::new(recording, wishes).unwrap();
    let (first, last) = programme.ticks();
    let said = |cue: Cue, tick: u64| (programme.topics()[cue.topic].clone(), tick, cdr::encode(&cue.message));
    let mut pass = Pass::begin(recording, &programme);
    let opening = std::iter::from_fn(|| pass.opening()).map(|cue| said(cue, first.0)).collect();
    let ticks = (first.0..=last.0).flat_map(|tick| {
        let cues: Vec<Cue> = std::iter::from_fn(|| pass.until(Tick(tick))).collect();
        cues.into_iter().map(move |cue| (cue, tick)).collect::<Vec<_>>()
    });
    let ticks: Vec<(Cue, u64)> = ticks.collect();
    (opening, ticks.into_iter().map(|(cue, tick)| said(cue, tick)).collect())
}

#[test]
fn every_message_comes_in_its_tick_in_the_order_of_the_file() {
    let all = [progress(0), passing(0), passing(3), piece(3, 1, 2), passing(3), passing(50), progress(51)];
    let recording = recording(&all);
    assert_eq!(played(&recording, &wishes(0.0, None)), (vec![], all.to_vec()));
    assert_eq!(played(&recording, &wishes(0.06, Some(1.0))).1, all[2..6]);
    // Between two ticks: those that lie inside.
    assert_eq!(played(&recording, &wishes(0.061, Some(1.019))).1, all[5..6]);
}

#[test]
fn what_was_said_before_the_start_and_holds_on_comes_first() {
    let (old, new, other) = (piece(0, 7, 3), piece(2, 7, 1), piece(1, 8, 2));
    let all = [progress(0), old, passing(0), other.clone(), progress(2), new.clone(), passing(3), progress(4)];
    let (opening, ticks) = played(&recording(&all), &wishes(0.06, None));
    let opening: Vec<_> = opening.into_iter().map(|(topic, _, bytes)| (topic, bytes)).collect();
    let held = [progress(2), other, new].map(|(topic, _, bytes)| (topic, bytes));
    assert_eq!(opening, held);
    assert_eq!(ticks, all[6..]);
}

#[test]
fn scenery_is_made_if_the_recording_has_none() {
    let recording = recording(&[passing(0)]);
    let (opening, _) = played(&recording, &Wishes::default());
    let terrain = voxels::Grid::from_text(MAP).unwrap();
    let made: Vec<(Topic, Vec<u8>)> = visualisation::static_messages(&terrain, 2)
        .into_iter()
        .map(|(view, picture)| (view.topic(), cdr::encode(&picture)))
        .collect();
    assert!(made.iter().any(|(topic, _)| *topic == topics::map()), "there are walls");
    assert_eq!(opening.into_iter().map(|(topic, _, bytes)| (topic, bytes)).collect::<Vec<_>>(), made);

    let walls = visualisation::static_messages(&terrain, 2)
        .into_iter()
        .find(|(view, _)| *view == VisualisationTopic::Map)
        .unwrap()
        .1;
    let VisualisationMessage::Marker(marker) = walls else { panic!("walls are markers") };
    let own = (topics::map(), 0, cdr::encode(&*marker));
    let (opening, ticks) = played(&self::recording(std::slice::from_ref(&own)), &Wishes::default());
    assert_eq!(opening.iter().map(|(topic, ..)| topic.clone()).collect::<Vec<_>>(), [topics::tf_static()]);
    assert_eq!(ticks, [own]);
}

#[test]
fn what_cannot_be_played_is_told() {
    let strange = Topic { name: "/chatter".to_owned(), ..topics::progress() };
    let wrong_type = Topic { name: "/sim/info".to_owned(), ..topics::progress() };
    let big_endian = (topics::digest(), 1, vec![0, 0, 0, 0, 1]);
    let said = [(strange, 0, progress(0).2), (wrong_type, 0, progress(0).2), big_endian, passing(2)];
    let whole = bytes(&said, "no map");
    let programme = |bytes: &[u8]| {
        let recording = Recording::from_bytes("run.mcap".to_owned(), bytes.to_vec()).unwrap();
        Programme::new(&recording, &Wishes::default())
    };
    let notes = programme(&whole).unwrap().notes().to_vec();
    assert_eq!(notes[0], "/chatter: 1 not played: no topic of a run");
    assert!(notes[1].starts_with("/sim/digest: 1 not played: the message is big-endian"), "{notes:?}");
    assert!(notes[2].starts_with("/sim/info: 1 not played: its type is maes_msgs/msg/Progress, not diag"), "{notes:?}");
    assert!(
        notes[3].starts_with("run.mcap: there is no map to look at: the map of the recording: map.txt: "),
        "{notes:?}"
    );
    assert_eq!(notes.len(), 4);

    let many: Vec<Said> = (0..2000).map(progress).collect();
    let cut = bytes(&many, MAP);
    let programme = programme(&cut[..cut.len() * 2 / 3]).unwrap();
    let [note] = programme.notes() else { panic!("one note: {:?}", programme.notes()) };
    assert!(note.starts_with("run.mcap is cut off behind byte "), "{note}");
    assert!(programme.ticks().1 > Tick(0) && programme.ticks().1 < Tick(1999));
}

#[test]
fn wishes_that_make_no_sense_are_refused() {
    let recording = recording(&[passing(0), progress(100)]);
    let refused = |wishes: Wishes| Programme::new(&recording, &wishes).unwrap_err().to_string();
    let only = |only: &[&str], exclude: &[&str]| Wishes {
        only: only.iter().map(ToString::to_string).collect(),
        exclude: exclude.iter().map(ToString::to_string).collect(),
        ..Wishes::default()
    };
    assert!(refused(wishes(-1.0, None)).starts_with("--start -1: expected"));
    assert!(refused(wishes(f64::NAN, None)).starts_with("--start NaN: expected"));
    assert!(refused(wishes(1.0, Some(1.0))).starts_with("--end 1: expected"));
    assert_eq!(refused(wishes(3.0, None)), "run.mcap: no tick from 3 s on: it goes up to 2 s");
    assert_eq!(
        refused(wishes(0.001, Some(0.002))),
        "run.mcap: no tick from 0.001 s on up to 0.002 s: it goes up to 2 s"
    );
    let there = "run.mcap, which has /agent_1/odom, /sim/map, /sim/progress, /tf_static";
    assert_eq!(refused(only(&["/sim"], &[])), format!("--topics /sim: no such topic in {there}"));
    assert_eq!(refused(only(&[], &["/x*"])), format!("--exclude /x*: no such topic in {there}"));
    assert_eq!(refused(only(&["/sim/*"], &["/*"])), "run.mcap: no message of it is to be played");

    let topics = |wishes: &Wishes| -> Vec<String> {
        let programme = Programme::new(&recording, wishes).unwrap();
        programme.topics().iter().map(|topic| topic.name.clone()).collect()
    };
    assert_eq!(topics(&only(&["/sim/*", "/tf_static"], &["/sim/map"])), ["/sim/progress", "/tf_static"]);
}

#[test]
fn late_readers_are_told_what_the_publisher_does_not_keep() {
    assert!(Shelf::of(&topics::odometry(AgentId(0))).is_none());
    let said = |id: i32, cubes: usize| Encoded::new(&piece(0, id, cubes).2).unwrap();
    let mut shelf = Shelf::of(&topics::unexplored()).unwrap();
    shelf.note(&said(1, 1));
    shelf.note(&said(2, 1));
    for _ in 0..topics::unexplored().qos.depth - 1 {
        shelf.note(&said(3, 1));
    }
    assert_eq!(shelf.wanted(), None);
    shelf.greet();
    assert_eq!(shelf.wanted(), Some(&said(1, 1)));
    // What is said anew need not be said again.
    shelf.note(&said(1, 2));
    assert_eq!(shelf.wanted(), None);
    shelf.greet();
    assert_eq!(shelf.wanted(), Some(&said(2, 1)));
    shelf.note(&said(2, 1));
    shelf.greet();
    assert_eq!(shelf.wanted(), None);
    // A new publisher keeps nothing.
    shelf.forget_history();
    shelf.greet();
    assert_eq!(shelf.wanted(), Some(&said(1, 2)));
}

/// A replay of the ticks 10 to 12 at real time.
fn player(is_loop: bool, is_paused: bool) -> Player {
    let programme = Programme::new(&recording(&[passing(0), passing(12)]), &wishes(0.2, None)).unwrap();
    Player::new(&programme, Manner { rate: Rtf::Limit(1.0), is_loop, is_paused }, 5)
}

const TICK_NS: u64 = Tick::TICK_NS;

/// Asks for something whose answer is a code, which is there once it is answered.
fn ask(
    player: &mut Player,
    wall_ns: u64,
    request: impl FnOnce(Reply<ResultResponse>) -> Request,
) -> Rc<RefCell<Option<u8>>> {
    let code = Rc::new(RefCell::new(None));
    let answered = Rc::clone(&code);
    let reply = Reply::new(move |response: ResultResponse| *answered.borrow_mut() = Some(response.result.result));
    player.answer(request(reply), wall_ns);
    code
}

fn set_state(player: &mut Player, state: u8, wall_ns: u64) -> Option<u8> {
    let request = SetSimulationStateRequest { state: SimulationState { state } };
    let code = ask(player, wall_ns, |reply| Request::SetState(Ask { request, reply }));
    code.take()
}

fn step(player: &mut Player, steps: u64) -> Rc<RefCell<Option<u8>>> {
    ask(player, 0, |reply| Request::Step(Ask { request: StepRequest { steps }, reply }))
}

#[test]
fn ticks_come_at_the_rate() {
    let mut player = player(false, false);
    assert_eq!(player.turn(5), Turn::Play(Tick(10)));
    player.played();
    assert_eq!(player.turn(6), Turn::Wait(TICK_NS - 1));
    assert_eq!(player.turn(5 + TICK_NS), Turn::Play(Tick(11)));
    player.played();
    // Late is no reason to be late again.
    assert_eq!(player.turn(5 + 2 * TICK_NS), Turn::Play(Tick(12)));
    player.played();
    assert_eq!((player.turn(5 + 2 * TICK_NS), player.sim_ticks(), player.position()), (Turn::End, 2, Tick(12)));
}

#[test]
fn a_loop_begins_again_after_the_last_tick() {
    let mut player = player(true, false);
    for round in 0..3 {
        let begun = 5 + round * 1000 * TICK_NS;
        for tick in 0..3 {
            assert_eq!(player.turn(begun + tick * TICK_NS), Turn::Play(Tick(10 + tick)));
            player.played();
        }
        assert_eq!(player.turn(begun + 2 * TICK_NS), Turn::Wait(TICK_NS));
        assert_eq!(player.turn(begun + 1000 * TICK_NS), Turn::Rewind);
    }
    assert_eq!(player.sim_ticks(), 6);
}

#[test]
fn pauses_do_not_count_and_the_rate_changes_at_once() {
    let mut player = player(false, false);
    player.played();
    assert_eq!(set_state(&mut player, SimulationState::PAUSED, 6), Some(Outcome::OK));
    assert_eq!(player.turn(100 * TICK_NS), Turn::Rest);
    assert_eq!(set_state(&mut player, SimulationState::PLAYING, 200 * TICK_NS), Some(Outcome::OK));
    assert_eq!(player.turn(200 * TICK_NS), Turn::Play(Tick(11)));
    player.played();
    assert_eq!(player.turn(200 * TICK_NS), Turn::Wait(TICK_NS));
    player.answer(Request::Rtf(Rtf::MAX), 200 * TICK_NS);
    assert_eq!(player.turn(200 * TICK_NS), Turn::Play(Tick(12)));
    assert_eq!(set_state(&mut player, SimulationState::QUITTING, 0), Some(Outcome::OK));
    assert_eq!((player.turn(0), player.is_quitting()), (Turn::End, true));
}

#[test]
fn steps_are_answered_when_they_are_done_and_end_at_the_end() {
    let mut player = player(false, true);
    assert_eq!(player.turn(9), Turn::Rest);
    let answer = step(&mut player, 2);
    for tick in [10, 11] {
        assert_eq!((player.turn(0), answer.take()), (Turn::Play(Tick(tick)), None));
        player.played();
    }
    assert_eq!((player.turn(0), answer.take()), (Turn::Rest, Some(Outcome::OK)));
    let answer = step(&mut player, 2);
    assert_eq!(player.turn(0), Turn::Play(Tick(12)));
    player.played();
    assert_eq!((player.turn(0), answer.take()), (Turn::Rest, Some(Outcome::OPERATION_FAILED)));
    // It stays at its end until it is to play or to quit.
    assert_eq!(player.turn(0), Turn::Rest);
    let answer = step(&mut player, 1);
    player.end();
    assert_eq!(answer.take(), Some(Outcome::OPERATION_FAILED));
    assert_eq!(set_state(&mut player, SimulationState::PLAYING, 0), Some(Outcome::OK));
    assert_eq!(player.turn(0), Turn::End);
}
