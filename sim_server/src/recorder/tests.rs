use mcap::MessageStream;
use mcap::read::Options;
use msgs::maes_msgs::{Digest, Progress};
use msgs::{cdr, topics};

use super::*;

const SCENARIO: Document<'_> = Document { name: "scenario.toml", media_type: "application/toml", data: b"seed = 1\n" };

fn progress(tick: u64) -> Vec<u8> {
    cdr::encode(&Progress { tick, explored_by: vec![0.5; 40], ..Progress::default() })
}

fn write(recorder: &mut Recorder, ticks: std::ops::Range<u64>) {
    for tick in ticks {
        recorder.write(&topics::progress(), Tick(tick), &progress(tick)).unwrap();
        if tick.is_multiple_of(700) {
            let digest = cdr::encode(&Digest { tick, ..Digest::default() });
            recorder.write(&topics::digest(), Tick(tick), &digest).unwrap();
        }
    }
}

/// Topics and ticks of the messages that can be read.
fn readable(file: &Path) -> Vec<(String, u64)> {
    let bytes = std::fs::read(file).unwrap();
    MessageStream::new_with_options(&bytes, Options::IgnoreEndMagic.into())
        .unwrap()
        .map_while(Result::ok)
        .map(|message| (message.channel.topic.clone(), message.log_time / Tick::TICK_NS))
        .collect()
}

#[test]
fn what_is_written_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    let mut recorder = Recorder::create(&file, &[SCENARIO]).unwrap();
    write(&mut recorder, 0..2000);
    recorder.finish().unwrap();

    let bytes = std::fs::read(&file).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.stats.as_ref().unwrap().message_count, 2003);
    assert_eq!(summary.stats.as_ref().unwrap().attachment_count, 1);
    assert_eq!(summary.chunk_indexes.len(), 4);
    let messages: Vec<_> = MessageStream::new(&bytes).unwrap().map(Result::unwrap).collect();
    assert_eq!(messages.len(), 2003);
    assert_eq!(messages[0].channel.schema.as_ref().unwrap().name, "maes_msgs/msg/Progress");
    assert!(messages[0].channel.metadata["offered_qos_profiles"].starts_with("- history: 1"));
    assert_eq!(messages[2002].data.as_ref(), progress(1999));
}

#[test]
fn saving_provisionally_changes_no_byte_of_the_finished_file() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["plain", "saved"].map(|name| folder.path().join(name));
    for (file, saves) in files.iter().zip([false, true]) {
        let mut recorder = Recorder::create(file, &[SCENARIO]).unwrap();
        for tick in 0..1700 {
            write(&mut recorder, tick..tick + 1);
            if saves && tick % 90 == 0 {
                recorder.save_provisionally().unwrap();
            }
        }
        recorder.finish().unwrap();
    }
    assert_eq!(std::fs::read(&files[0]).unwrap(), std::fs::read(&files[1]).unwrap());
}

#[test]
fn everything_saved_provisionally_is_readable_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    let mut recorder = Recorder::create(&file, &[SCENARIO]).unwrap();
    for end in [3_u64, 400, 499, 500, 501, 730, 1500] {
        let start = readable(&file).iter().filter(|(topic, _)| topic == "/sim/progress").count() as u64;
        write(&mut recorder, start..end);
        recorder.save_provisionally().unwrap();
        let read = readable(&file);
        let ticks: Vec<u64> =
            read.iter().filter(|(topic, _)| topic == "/sim/progress").map(|&(_, tick)| tick).collect();
        assert_eq!(ticks, (0..end).collect::<Vec<_>>());
    }
    // Killed: nothing is finished, and all is still there.
    std::mem::forget(recorder);
    assert_eq!(readable(&file).len(), 1503);
}

#[test]
fn a_file_that_cannot_be_made_is_named() {
    let error = Recorder::create(Path::new("/nowhere/a.mcap"), &[]).err().unwrap().to_string();
    assert!(error.contains("/nowhere/a.mcap"), "{error}");
}
