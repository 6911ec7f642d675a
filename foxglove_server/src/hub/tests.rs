use std::sync::mpsc::sync_channel;

use foxglove::websocket::ws_protocol::client::{FetchAsset, SetParameters};
use futures_util::FutureExt as _;
use msgs::geometry_msgs::Point;
use msgs::ids::AgentId;
use recording::live_stream::LiveStream;

use super::*;

fn scenario() -> Scenario {
    Scenario::parse("default.toml", include_str!("../../../launch_scripts/scenarios/default.toml"), &[]).unwrap()
}

/// The texts of the replies that wait.
fn replies(outbox: &Outbox) -> Vec<String> {
    let next = || outbox.next().now_or_never().flatten();
    std::iter::from_fn(next).filter_map(|message| message.into_text().ok()).map(|text| text.to_string()).collect()
}

#[test]
fn dropped_request_is_not_reported_as_set() {
    let (sender, requests) = sync_channel(1);
    let hub = Hub::new(sender, false);
    let (id, outbox) = hub.join();
    let set = |value: f64| {
        replies(&outbox);
        let wanted = Parameter {
            name: parameters::RTF.to_owned(),
            r#type: Some(ParameterType::Float64),
            value: Some(ParameterValue::Float64(value)),
        };
        let message = ClientMessage::SetParameters(SetParameters { parameters: vec![wanted], id: None });
        hub.handle(id, &outbox, message);
        replies(&outbox)
    };
    let answer = set(2.0);
    assert!(answer.len() == 1 && answer[0].contains("execution.rtf"), "{answer:?}");
    let reason = "execution.rtf: not set: too many requests are waiting";
    let answer = set(3.0);
    assert!(answer.len() == 2 && answer[0].contains(reason), "{answer:?}");
    assert!(!answer[1].contains("execution.rtf"), "{answer:?}");
    drop(requests);
    assert!(set(3.0)[0].contains("the simulator is about to end"));
}

#[test]
fn only_present_readers_of_the_present_run_are_waited_for() {
    let (sender, _requests) = sync_channel(1);
    let hub = Hub::new(sender, false);
    let (id, outbox) = hub.join();
    let read = |id: u32, uri: &str| {
        let message = ClientMessage::FetchAsset(FetchAsset { uri: uri.to_owned(), request_id: 1 });
        hub.handle(id, &outbox, message);
    };
    let stream = LiveStream::create(&[]).unwrap();
    hub.set_next_stream(stream.reader());
    hub.start_session(1, &scenario(), []);
    let uri = format!("{SCHEME}{:016x}/0", 1);
    read(id, &uri);
    assert_eq!(hub.state().readers, BTreeMap::from([(id, false)]));
    hub.leave(id);
    assert!(hub.state().readers.is_empty());
    // Its request was still on the way.
    read(id, &uri);
    assert!(hub.state().readers.is_empty());

    let (id, _outbox) = hub.join();
    read(id, &uri);
    hub.start_session(2, &scenario(), []);
    // It has read the end of a run that is no longer there.
    hub.reader_has_end(id, &format!("{:016x}", 1));
    assert!(hub.state().readers.is_empty());
}

#[test]
fn late_subscribers_receive_all_pieces_of_a_map() {
    let (sender, _requests) = sync_channel(1);
    let hub = Hub::new(sender, false);
    let topic = msgs::topics::belief(AgentId(0));
    hub.start_session(1, &scenario(), [topic.clone()]);
    let kept = |hub: &Hub| hub.state().topics.values().map(|topic| topic.latched.len()).sum::<usize>();
    for id in (0..600).chain(0..600) {
        let piece = Marker { id, points: vec![Point::default(); 10], ..Marker::default() };
        hub.publish_latched_marker(&topic.name, &piece, 0);
    }
    assert_eq!(kept(&hub), 600, "more than the depth of the topic");
    for id in 0..600 {
        let large = Marker { id, points: vec![Point::default(); 2000], ..Marker::default() };
        hub.publish_latched_marker(&topic.name, &large, 0);
    }
    assert!(kept(&hub) < 200 && kept_bytes(&hub) <= DATA_BYTES_MAX);
}

/// Bytes that the hub keeps: for late subscribers, and for clients that have not read them yet.
fn kept_bytes(hub: &Hub) -> usize {
    let state = hub.state();
    let latched = state.topics.values().flat_map(|topic| &topic.latched).map(|kept| kept.bytes.len()).sum::<usize>();
    latched + state.clients.values().map(|client| client.outbox.bytes()).sum::<usize>()
}

#[test]
fn bytes_kept_do_not_grow_with_the_length_of_a_run() {
    let (sender, _requests) = sync_channel(1);
    let hub = Hub::new(sender, false);
    let (id, outbox) = hub.join();
    let topics = [msgs::topics::tf(), msgs::topics::belief(AgentId(0)), msgs::topics::progress()];
    hub.start_session(1, &scenario(), topics.clone());
    let channels: Vec<u64> = hub.state().topics.keys().copied().collect();
    for (number, channel) in channels.into_iter().enumerate() {
        let wanted = Subscription { id: u32::try_from(number).unwrap(), channel_id: channel };
        hub.state().subscribe(id, wanted).unwrap();
    }
    replies(&outbox);
    let after = |seconds: std::ops::Range<u64>| {
        for second in seconds {
            hub.publish(&topics[0].name, &[1; 30_000], second * 1_000_000_000);
            // Seven pieces of a map, each with some thousand cells.
            let piece = Marker { id: (second % 7) as i32, points: vec![Point::default(); 4000], ..Marker::default() };
            hub.publish_latched_marker(&topics[1].name, &piece, second * 1_000_000_000);
            hub.publish_latched(&topics[2].name, vec![3; 200], Tick(second * 50));
            hub.broadcast_time(Tick(second * 50));
        }
        kept_bytes(&hub)
    };
    // A client that reads nothing costs most.
    let (early, late) = (after(0..120), after(120..6000));
    assert!(early.abs_diff(late) <= 130_000, "{early} bytes after two minutes, {late} after 100");
    hub.leave(id);
    let of_pieces = 7 * cdr::encode(&Marker { points: vec![Point::default(); 4000], ..Marker::default() }).len();
    assert_eq!(kept_bytes(&hub), of_pieces + 200, "the last of each piece, and of the progress");
}
