use std::fs::File;
use std::io::{Cursor, Seek, SeekFrom, Write};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use msgs::topics::Topic;

use super::*;
use crate::recorder;

pub(super) const SCENARIO: &[u8] = b"seed = 1\n";

/// How a tool writes a recording.
pub(super) struct Rewriting {
    pub(super) options: WriteOptions,
    pub(super) are_attachments_last: bool,
    pub(super) metadata_in_the_middle: bool,
    /// Channels of its own that are added first, so that the others have other numbers.
    pub(super) other_channels: u16,
}

impl Rewriting {
    pub(super) fn with(options: WriteOptions) -> Self {
        Self { options, are_attachments_last: false, metadata_in_the_middle: false, other_channels: 0 }
    }
}

/// Topic, tick and bytes that do not compress away.
pub(super) fn recorded(count: u64, bytes: usize) -> Vec<(Topic, Tick, Vec<u8>)> {
    let message = |number: u64| {
        let mut state = number + 1;
        let data = (0..bytes).map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 56) as u8
        });
        let topic = if number.is_multiple_of(2) { topics::progress() } else { topics::digest() };
        (topic, Tick(number / 2), data.collect())
    };
    (0..count).map(message).collect()
}

fn attach(writer: &mut Writer<Cursor<Vec<u8>>>, name: &str, data: &[u8]) {
    let (name, media_type) = (name.to_owned(), String::new());
    writer.attach(&Attachment { log_time: 0, create_time: 0, name, media_type, data: data.into() }).unwrap();
}

pub(super) fn rewritten(messages: &[(Topic, Tick, Vec<u8>)], rewriting: Rewriting) -> Vec<u8> {
    let mut writer = rewriting.options.create(Cursor::new(Vec::new())).unwrap();
    let attach_all = |writer: &mut Writer<_>| {
        attach(writer, SCENARIO_ATTACHMENT, SCENARIO);
        attach(writer, "notes of a tool.txt", b"not of the run");
    };
    if !rewriting.are_attachments_last {
        attach_all(&mut writer);
    }
    for number in 0..rewriting.other_channels {
        let topic = Topic { name: format!("/of_a_tool_{number}"), ..topics::clock() };
        recorder::add_channel(&mut writer, &topic).unwrap();
    }
    for (number, (topic, tick, data)) in messages.iter().enumerate() {
        let channel_id = recorder::add_channel(&mut writer, topic).unwrap();
        let (log_time, publish_time) = (tick.time_ns(), tick.time_ns());
        let header = MessageHeader { channel_id, sequence: number as u32, log_time, publish_time };
        writer.write_to_known_channel(&header, data).unwrap();
        if rewriting.metadata_in_the_middle && number == messages.len() / 2 {
            let metadata = BTreeMap::from([("a".to_owned(), "b".to_owned())]);
            writer.write_metadata(&Metadata { name: "tool".to_owned(), metadata }).unwrap();
        }
    }
    if rewriting.are_attachments_last {
        attach_all(&mut writer);
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn opened(bytes: Vec<u8>) -> Recording {
    Recording::from_bytes("r.mcap".to_owned(), bytes).unwrap()
}

/// The messages, and where they end.
fn read(recording: &Recording) -> (Vec<(String, Tick, Vec<u8>)>, End) {
    let mut messages = recording.messages();
    let read = messages.by_ref().map(|message| (message.channel.topic.clone(), message.tick(), message.data));
    (read.collect(), messages.end().cloned().unwrap())
}

fn expected(messages: &[(Topic, Tick, Vec<u8>)]) -> Vec<(String, Tick, Vec<u8>)> {
    messages.iter().map(|(topic, tick, data)| (topic.name.clone(), *tick, data.clone())).collect()
}

#[test]
fn every_legal_rewriting_is_read() {
    let messages = recorded(200, 300);
    let options = || WriteOptions::new().profile("ros2").chunk_size(Some(5000));
    let of = |compression| Rewriting::with(options().compression(compression));
    let without_index = options()
        .emit_message_indexes(false)
        .emit_chunk_indexes(false)
        .emit_statistics(false)
        .emit_summary_offsets(false)
        .repeat_channels(false)
        .repeat_schemas(false)
        .calculate_chunk_crcs(false)
        .calculate_data_section_crc(false);
    for (name, rewriting) in [
        ("zstd", of(Some(Compression::Zstd))),
        ("lz4", of(Some(Compression::Lz4))),
        ("no compression", of(None)),
        ("no chunks", Rewriting::with(options().use_chunks(false))),
        ("one chunk", Rewriting::with(options().chunk_size(None))),
        ("no index", Rewriting::with(without_index.clone())),
        ("no index, lz4", Rewriting::with(without_index.compression(Some(Compression::Lz4)))),
        ("metadata", Rewriting { metadata_in_the_middle: true, ..of(Some(Compression::Lz4)) }),
        ("attachments last", Rewriting { are_attachments_last: true, ..of(None) }),
        ("other channels", Rewriting { other_channels: 5, ..of(Some(Compression::Zstd)) }),
    ] {
        let recording = opened(rewritten(&messages, rewriting));
        assert_eq!(recording.scenario().as_bytes(), SCENARIO, "{name}");
        assert_eq!(recording.attachments().len(), 1, "{name}: attachments of tools are none of the run");
        assert_eq!(read(&recording), (expected(&messages), End::Whole), "{name}");
    }
}

/// Their number belongs to what the statistics name, and their damage to the file.
#[test]
fn unwanted_messages_are_checked_and_not_returned() {
    let messages = recorded(200, 300);
    let is_digest: fn(&str) -> bool = |topic| topic == topics::digest().name;
    for options in [WriteOptions::new().chunk_size(Some(5000)), WriteOptions::new().use_chunks(false)] {
        let bytes = rewritten(&messages, Rewriting::with(options));
        let recording = opened(bytes.clone());
        let mut wanted = recording.messages_on(is_digest);
        let read: Vec<Message> = wanted.by_ref().collect();
        assert!(read.iter().all(|message| is_digest(&message.channel.topic)));
        assert_eq!((read.len(), wanted.left_out(), wanted.end()), (100, 100, Some(&End::Whole)));

        let mut damaged = bytes;
        let middle = damaged.len() / 2;
        damaged[middle] ^= 1;
        let recording = opened(damaged);
        let mut wanted = recording.messages_on(is_digest);
        wanted.by_ref().for_each(drop);
        assert!(matches!(wanted.end(), Some(End::Damage { .. })), "{:?}", wanted.end());
    }
}

/// More than is kept of a chunk.
#[test]
fn large_chunks_are_checked_before_their_first_message() {
    let messages = recorded(40, 1 << 20);
    for compression in [None, Some(Compression::Lz4), Some(Compression::Zstd)] {
        let options = WriteOptions::new().chunk_size(None).compression(compression);
        let mut bytes = rewritten(&messages, Rewriting::with(options));
        assert_eq!(read(&opened(bytes.clone())), (expected(&messages), End::Whole), "{compression:?}");
        let last = bytes.len() - (2 << 20);
        bytes[last] ^= 1;
        let (found, end) = read(&opened(bytes));
        assert!(found.is_empty() && matches!(end, End::Damage { .. }), "{compression:?}: {} {end:?}", found.len());
    }
}

/// Where the record at the top level with this number begins, by kind.
fn position(bytes: &[u8], kind: u8, number: usize) -> usize {
    let source = Source::of_bytes(bytes.to_vec());
    let mut frames = Frames::new(&source, mcap::MAGIC.len() as u64, WINDOW_BYTES);
    let of_kind = std::iter::from_fn(|| frames.next()).map(Result::unwrap).filter(|frame| frame.kind == kind);
    of_kind.map(|frame| frame.at as usize).nth(number).unwrap()
}

fn damage(bytes: Vec<u8>) -> String {
    read(&opened(bytes)).1.to_string()
}

#[test]
fn missing_parts_are_found() {
    let messages = recorded(200, 300);
    let options = || WriteOptions::new().chunk_size(Some(5000)).calculate_data_section_crc(false);
    let whole = rewritten(&messages, Rewriting::with(options()));
    // A chunk that seems to be a record of another program.
    let mut hidden = whole.clone();
    hidden[position(&whole, op::CHUNK, 3)] |= 0x80;
    assert!(damage(hidden).contains("a record of kind 0x07 that no recording has at this place"));
    let unindexed = rewritten(&messages, Rewriting::with(options().emit_message_indexes(false)));
    let mut hidden = unindexed.clone();
    hidden[position(&unindexed, op::CHUNK, 3)] |= 0x80;
    assert!(damage(hidden).contains(": the statistics name 200 messages, and "));
    let options = options().emit_message_indexes(false).emit_statistics(false).calculate_data_section_crc(true);
    let checked = rewritten(&messages, Rewriting::with(options));
    let mut hidden = checked.clone();
    hidden[position(&checked, op::CHUNK, 3)] |= 0x80;
    assert!(damage(hidden).ends_with("do not match the checksum at the end"));
}

#[test]
fn what_is_not_mcap_is_named() {
    let messages = recorded(20, 300);
    let whole = rewritten(&messages, Rewriting::with(WriteOptions::new()));
    let mut other = whole.clone();
    let name = position(&whole, op::CHUNK, 0) + 9 + 32;
    other[name..name + 4].copy_from_slice(b"zzzz");
    assert!(damage(other).ends_with("a chunk of compression \"zzzz\"; expected zstd, lz4 or none"));

    let mut unknown = rewritten(&messages, Rewriting::with(WriteOptions::new().use_chunks(false)));
    let message = position(&unknown, op::MESSAGE, 3);
    unknown[message + 9] = 77;
    assert!(damage(unknown).ends_with("a message of channel 77, which is unknown"));

    let cut = whole[..whole.len() - 3].to_vec();
    assert_eq!(read(&opened(cut.clone())), (expected(&messages), End::CutOff { bytes: cut.len() as u64 }));
    let longer = [&whole[..], b"more"].concat();
    assert!(damage(longer).ends_with("the file does not end there as MCAP does"));

    // Two runs, and one merged with itself, which has every message twice.
    for second in [b"seed = 2\n", SCENARIO] {
        let mut writer = Writer::new(Cursor::new(Vec::new())).unwrap();
        attach(&mut writer, SCENARIO_ATTACHMENT, SCENARIO);
        attach(&mut writer, SCENARIO_ATTACHMENT, second);
        writer.finish().unwrap();
        let merged = Recording::from_bytes("r.mcap".to_owned(), writer.into_inner().into_inner()).unwrap_err();
        assert!(merged.to_string().starts_with("r.mcap: two attachments scenario.toml: "), "{merged}");
    }
}

/// A file of more than 4 GiB, of which the most are a hole in a record of another program.
#[test]
fn files_have_no_largest_size() {
    const HOLE: u64 = 5 << 30;
    let messages = recorded(200, 300);
    let options = WriteOptions::new().chunk_size(Some(5000)).calculate_data_section_crc(false);
    let whole = rewritten(&messages, Rewriting { are_attachments_last: true, ..Rewriting::with(options) });
    let middle = position(&whole, op::CHUNK, 2);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.mcap");
    let mut file = File::create(&path).unwrap();
    file.write_all(&whole[..middle]).unwrap();
    file.write_all(&[0x80]).unwrap();
    file.write_all(&HOLE.to_le_bytes()).unwrap();
    file.seek(SeekFrom::Current(HOLE as i64)).unwrap();
    file.write_all(&whole[middle..]).unwrap();
    let recording = Recording::open(&path).unwrap();
    assert_eq!(recording.scenario().as_bytes(), SCENARIO);
    // Without the checksum of the file, for which the hole is read.
    let mut read = Messages::of_part(&recording.source, mcap::MAGIC.len() as u64, KnownChannels::default());
    let found = read.by_ref().map(|message| (message.channel.topic.clone(), message.tick(), message.data));
    assert_eq!(found.collect::<Vec<_>>(), expected(&messages));
    assert_eq!(read.end(), Some(&End::Whole));
}

/// The last chunk of a file that is being written may change after it was opened.
#[test]
fn every_pass_reads_the_same() {
    let messages = recorded(200, 300);
    let options = WriteOptions::new().chunk_size(Some(5000));
    let whole = rewritten(&messages, Rewriting::with(options));
    let last = position(&whole, op::CHUNK, 4);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("open.mcap");
    std::fs::write(&path, &whole[..position(&whole, op::CHUNK, 5)]).unwrap();
    let recording = Recording::open(&path).unwrap();
    let before = read(&recording);
    let mut file = File::options().write(true).open(&path).unwrap();
    file.seek(SeekFrom::Start(last as u64)).unwrap();
    file.write_all(&[0xff; 200]).unwrap();
    assert_eq!(read(&recording), before);
    assert!(before.0.len() > 50 && before.1 == End::Missing, "{:?}", before.1);
}

/// A tool that drops attachments leaves the messages.
#[test]
fn lost_attachments_are_named() {
    let mut writer = Writer::new(Cursor::new(Vec::new())).unwrap();
    let [(topic, tick, data)] = &recorded(1, 30)[..] else { unreachable!("one was asked for") };
    let mut write = |topic: &Topic| {
        let channel_id = recorder::add_channel(&mut writer, topic).unwrap();
        let header = MessageHeader { channel_id, sequence: 0, log_time: tick.time_ns(), publish_time: 0 };
        writer.write_to_known_channel(&header, data).unwrap();
    };
    write(&topics::clock());
    write(topic);
    writer.finish().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dropped.mcap");
    std::fs::write(&path, writer.into_inner().into_inner()).unwrap();
    let refused = Recording::open(&path).unwrap_err().to_string();
    assert!(refused.contains("dropped.mcap: its attachments scenario.toml and map.m3dm are missing"), "{refused}");
    let recording = Recording::open_messages(&path).unwrap();
    assert_eq!((recording.messages().count(), recording.scenario().as_ref()), (2, ""));

    let mut writer = Writer::new(Cursor::new(Vec::new())).unwrap();
    recorder::add_channel(&mut writer, &topics::clock()).unwrap();
    writer.finish().unwrap();
    std::fs::write(&path, writer.into_inner().into_inner()).unwrap();
    let refused = Recording::open_messages(&path).unwrap_err().to_string();
    assert!(refused.contains("not a recording of this simulator"), "{refused}");
}
