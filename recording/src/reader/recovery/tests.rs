use std::fs;
use std::path::PathBuf;

use mcap::WriteOptions;
use msgs::cdr;
use msgs::maes_msgs::Progress;
use msgs::topics;

use super::*;
use crate::reader::tests::{Rewriting, SCENARIO, recorded, rewritten};
use crate::recorder::{Document, Recorder};
use crate::{Recording, SCENARIO_ATTACHMENT};

/// Id, topic, times, sequence and bytes of all messages, as the library reads a finished file.
type Listed = Vec<(u16, String, u64, u64, u32, Vec<u8>)>;

fn listed(bytes: &[u8]) -> Listed {
    let messages = mcap::MessageStream::new(bytes).unwrap().map(|message| {
        let mcap::Message { channel, sequence, log_time, publish_time, data } = message.unwrap();
        (channel.id, channel.topic.clone(), log_time, publish_time, sequence, data.into_owned())
    });
    messages.collect()
}

struct Files {
    _folder: tempfile::TempDir,
    input: PathBuf,
    output: PathBuf,
}

impl Files {
    fn new(input: &[u8]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let [input_file, output] = ["in.mcap", "out.mcap"].map(|name| folder.path().join(name));
        fs::write(&input_file, input).unwrap();
        Self { _folder: folder, input: input_file, output }
    }

    fn recover(&self) -> Result<Recovered, RecoverError> {
        recover(&self.input, &self.output)
    }
}

#[test]
fn cut_files_are_finished() {
    let messages = recorded(60, 100);
    let options = || WriteOptions::new().profile("ros2").library("a tool").chunk_size(Some(900));
    for (name, options) in [
        ("zstd", options().compression(Some(Compression::Zstd))),
        ("lz4", options().compression(Some(Compression::Lz4))),
        ("no compression", options().compression(None)),
        ("no chunks", options().use_chunks(false)),
        ("no chunk checksums", options().calculate_chunk_crcs(false)),
    ] {
        let whole = rewritten(&messages, Rewriting { metadata_in_the_middle: true, ..Rewriting::with(options) });
        let all = listed(&whole);
        let mut kept_before = 0;
        for length in (300..whole.len()).step_by(61).chain([whole.len()]) {
            let files = Files::new(&whole[..length]);
            let read = Recording::from_bytes("in".to_owned(), whole[..length].to_vec());
            let Ok(recovered) = files.recover() else {
                assert!(read.is_err(), "{name}, {length} bytes: has a scenario");
                continue;
            };
            let count = recovered.messages as usize;
            assert_eq!(count, read.unwrap().messages().count(), "{name}, {length} bytes: all that can be read");
            assert!(count >= kept_before);
            kept_before = count;
            let output = fs::read(&files.output).unwrap();
            assert_eq!(listed(&output), all[..count], "{name}, {length} bytes");
            let summary = mcap::Summary::read(&output).unwrap().unwrap();
            assert_eq!(summary.stats.unwrap().message_count, recovered.messages);
            assert!(count == 0 || !summary.chunk_indexes.is_empty());
            assert_eq!(recovered.attachments, [SCENARIO_ATTACHMENT, "notes of a tool.txt"]);
            let recording = Recording::open(&files.output).unwrap();
            assert_eq!(recording.scenario().as_bytes(), SCENARIO);
            let mut read = recording.messages();
            assert_eq!(read.by_ref().count(), count);
            assert_eq!(read.end(), Some(&End::Whole));
            assert_eq!(recovered.end == End::Whole, length == whole.len(), "{name}, {length} bytes");
        }
        assert_eq!(kept_before, all.len(), "{name}");
    }
}

#[test]
fn recording_of_a_killed_server_becomes_that_of_one_that_ends() {
    let folder = tempfile::tempdir().unwrap();
    let [killed, ended, output] = ["killed.mcap", "ended.mcap", "out.mcap"].map(|name| folder.path().join(name));
    let document = Document { name: SCENARIO_ATTACHMENT, media_type: "application/toml", data: b"seed = 1\n" };
    let written = |path: &Path| {
        let mut recorder = Recorder::create(path, &[document]).unwrap();
        recorder.publish().unwrap();
        for tick in 0..1210 {
            let topic = if tick < 1100 { topics::progress() } else { topics::digest() };
            recorder.write(&topic, Tick(tick), &cdr::encode(&Progress { tick, ..Progress::default() })).unwrap();
        }
        recorder
    };
    let mut recorder = written(&killed);
    recorder.save_provisionally().unwrap();
    drop(recorder);
    written(&ended).finish().unwrap();
    let recovered = recover(&killed, &output).unwrap();
    assert_eq!((recovered.messages, recovered.topics, recovered.tick), (1210, 2, Some(Tick(1209))));
    assert_eq!((recovered.end.clone(), recovered.bytes - recovered.bytes_kept), (End::Missing, 0));
    assert!(fs::read(&output).unwrap() == fs::read(&ended).unwrap(), "the same bytes");
    assert!(text(&recovered).starts_with("kept 1210 messages on 2 topics, up to tick 1209 (24.18 s)\n"));
}

#[test]
fn damage_ends_what_is_kept() {
    let messages = recorded(60, 100);
    let options = WriteOptions::new().chunk_size(Some(900)).compression(None);
    let mut bytes = rewritten(&messages, Rewriting::with(options));
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let files = Files::new(&bytes);
    let recovered = files.recover().unwrap();
    assert!(matches!(recovered.end, End::Damage { .. }) && recovered.bytes_kept < middle as u64);
    let kept = listed(&fs::read(&files.output).unwrap());
    assert!((5..55).contains(&kept.len()), "{}", kept.len());
    assert!(text(&recovered).contains("bytes were left out"));
}

#[test]
fn bytes_after_the_end_are_named() {
    let bytes = rewritten(&recorded(6, 30), Rewriting::with(WriteOptions::new()));
    for rest in [b"trail".as_slice(), &bytes] {
        let files = Files::new(&[&bytes, rest].concat());
        let recovered = files.recover().unwrap();
        assert_eq!(recovered.bytes - recovered.bytes_kept, rest.len() as u64);
        let expected = format!("{} bytes after the end of the recording; its last {} of", rest.len(), rest.len());
        assert!(text(&recovered).contains(&expected), "{}", text(&recovered));
        assert_eq!(listed(&fs::read(&files.output).unwrap()), listed(&bytes));
    }
    let files = Files::new(&bytes[..bytes.len() - 3]);
    assert!(matches!(files.recover().unwrap().end, End::CutOff { .. }));
}

#[test]
fn nothing_is_overwritten_and_nothing_is_left_behind() {
    let bytes = rewritten(&recorded(6, 30), Rewriting::with(WriteOptions::new()));
    let files = Files::new(&bytes);
    fs::write(&files.output, "mine").unwrap();
    assert!(
        files
            .recover()
            .unwrap_err()
            .to_string()
            .ends_with("out.mcap: it exists; nothing was written; choose another name")
    );
    assert_eq!(fs::read(&files.output).unwrap(), b"mine");
    assert!(recover(&files.input, &files.input).is_err());
    assert_eq!(fs::read(&files.input).unwrap(), bytes);
    for (input, reason) in [
        (&b"no mcap"[..], "in.mcap: no MCAP recording: it does not begin as MCAP does"),
        (&bytes[..40], ", before the end of its first message or attachment; nothing was written"),
        (b"", "it does not begin as MCAP does"),
    ] {
        let files = Files::new(input);
        let error = files.recover().unwrap_err().to_string();
        assert!(error.contains(reason), "{error}");
        assert_eq!(fs::read_dir(files.input.parent().unwrap()).unwrap().count(), 1, "no temporary file stays");
    }
}
