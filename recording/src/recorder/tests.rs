use std::cell::{Cell, RefCell};
use std::fs;
use std::rc::Rc;

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
fn written_messages_are_read_back() {
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
    assert!(messages[0].channel.metadata["topic_type_hash"].starts_with("RIHS01_"));
    assert_eq!(messages[2002].data.as_ref(), progress(1999));
}

#[test]
fn provisional_saves_leave_the_finished_file_unchanged() {
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
fn provisional_saves_are_readable_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    let mut recorder = Recorder::create(&file, &[SCENARIO]).unwrap();
    recorder.publish().unwrap();
    for end in [3_u64, 400, 499, 500, 501, 730, 1500] {
        let start = readable(&file).iter().filter(|(topic, _)| topic == "/sim/progress").count() as u64;
        write(&mut recorder, start..end);
        recorder.save_provisionally().unwrap();
        let read = readable(&file);
        let ticks: Vec<u64> =
            read.iter().filter(|(topic, _)| topic == "/sim/progress").map(|&(_, tick)| tick).collect();
        assert_eq!(ticks, (0..end).collect::<Vec<_>>());
    }
    // A killed process leaves everything saved.
    std::mem::forget(recorder);
    assert_eq!(readable(&file).len(), 1503);
}

#[test]
fn error_names_the_file() {
    let error = Recorder::create(Path::new("/nowhere/a.mcap"), &[]).err().unwrap().to_string();
    assert!(error.contains("/nowhere/a.mcap"), "{error}");
}

/// File names in a folder.
fn listed(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn aborted_recording_keeps_the_older_one() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    for (older, expected) in [(None, &[][..]), (Some(mcap::MAGIC), &["a.mcap"][..])] {
        if let Some(older) = older {
            fs::write(&file, older).unwrap();
        }
        let mut recorder = Recorder::create(&file, &[SCENARIO]).unwrap();
        write(&mut recorder, 0..600);
        recorder.save_provisionally().unwrap();
        assert_eq!(listed(folder.path()).len(), expected.len() + 1, "it has a temporary name");
        drop(recorder);
        assert_eq!(listed(folder.path()), expected);
        assert_eq!(fs::read(&file).ok().as_deref(), older);
    }
    let mut recorder = Recorder::create(&file, &[SCENARIO]).unwrap();
    write(&mut recorder, 0..600);
    recorder.finish().unwrap();
    assert_eq!(listed(folder.path()), ["a.mcap"]);
    assert_eq!(readable(&file).len(), 601);
}

/// A disk that counts how often it is synced.
struct CountingDisk(Rc<Cell<u32>>);

impl sink::Store for CountingDisk {
    fn write_all_at(&self, _bytes: &[u8], _at: u64) -> std::io::Result<()> {
        Ok(())
    }

    fn set_len(&self, _length: u64) -> std::io::Result<()> {
        Ok(())
    }

    fn sync(&self) -> std::io::Result<()> {
        self.0.set(self.0.get() + 1);
        Ok(())
    }
}

#[test]
fn provisional_saves_are_synced_periodically() {
    let syncs = Rc::new(Cell::new(0));
    let mut recorder = Recorder::with_sink(Path::new("a.mcap"), Sink::new(CountingDisk(Rc::clone(&syncs))));
    recorder.attach(&[SCENARIO]).unwrap();
    let mut save = |ticks: std::ops::Range<u64>, saves: u32| {
        write(&mut recorder, ticks);
        (0..saves).for_each(|_| recorder.save_provisionally().unwrap());
        syncs.get()
    };
    assert_eq!(save(0..3, SAVES_PER_SYNC - 1), 0);
    assert_eq!(save(3..3, 1), 1);
    assert_eq!(save(3..3, 3 * SAVES_PER_SYNC), 1, "nothing is new");
    assert_eq!(save(3..4, 1), 2);
    recorder.finish().unwrap();
    assert_eq!(syncs.get(), 4, "before and after the final name");
}

/// A disk with limited space, which takes the part of a write that fits.
#[derive(Clone)]
struct SmallDisk {
    room: usize,
    bytes: Rc<RefCell<Vec<u8>>>,
}

impl sink::Store for SmallDisk {
    fn write_all_at(&self, bytes: &[u8], at: u64) -> std::io::Result<()> {
        let mut disk = self.bytes.borrow_mut();
        let end = at as usize + bytes.len();
        let fits = end.min(self.room);
        if disk.len() < fits {
            disk.resize(fits, 0);
        }
        let at = (at as usize).min(fits);
        disk[at..fits].copy_from_slice(&bytes[..fits - at]);
        if end > self.room { Err(std::io::ErrorKind::StorageFull.into()) } else { Ok(()) }
    }

    fn set_len(&self, length: u64) -> std::io::Result<()> {
        self.bytes.borrow_mut().truncate(length as usize);
        Ok(())
    }

    fn sync(&self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Records on a small disk until it fails; returns what is on the disk.
fn record_on(room: usize) -> (Result<(), RecordError>, Vec<u8>) {
    let disk = SmallDisk { room, bytes: Rc::default() };
    let mut recorder = Recorder::with_sink(Path::new("a.mcap"), Sink::new(disk.clone()));
    let record = |recorder: &mut Recorder| {
        recorder.attach(&[SCENARIO])?;
        for tick in 0..1700 {
            recorder.write(&topics::progress(), Tick(tick), &progress(tick))?;
            if tick % 90 == 0 {
                recorder.save_provisionally()?;
            }
        }
        Ok(())
    };
    let recorded = record(&mut recorder).and_then(|()| recorder.finish());
    (recorded, disk.bytes.take())
}

#[test]
fn full_disk_leaves_whole_chunks_without_an_end() {
    let (recorded, whole) = record_on(usize::MAX);
    recorded.unwrap();
    let read = |bytes: &[u8]| -> Vec<u64> {
        let stream = MessageStream::new_with_options(bytes, Options::IgnoreEndMagic.into());
        stream.map_or(Vec::new(), |stream| stream.map_while(Result::ok).map(|message| message.log_time).collect())
    };
    let all = read(&whole);
    let mut lengths = Vec::new();
    for room in (0..whole.len()).step_by(37) {
        let (recorded, left) = record_on(room);
        recorded.unwrap_err();
        assert!(whole.starts_with(&left), "room {room}: cut off behind whole chunks");
        assert!(
            left.len() < mcap::MAGIC.len() * 2 || !left.ends_with(mcap::MAGIC),
            "room {room}: a false end of the file"
        );
        assert!(all.starts_with(&read(&left)), "room {room}");
        lengths.push(left.len());
    }
    lengths.dedup();
    assert!(lengths.len() >= 5, "nothing, the documents, and each of the chunks: {lengths:?}");
}

#[test]
fn metadata_of_a_folder_are_those_of_its_recording() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("night/");
    let mut recorder = Recorder::create(&bag, &[SCENARIO]).unwrap();
    write(&mut recorder, 3..1500);
    recorder.finish().unwrap();
    let recording = crate::Recording::open(&bag.join("night_0.mcap")).unwrap();
    let written = fs::read_to_string(bag.join("metadata.yaml")).unwrap();
    assert_eq!(written, format!("{}\n", crate::bag::metadata(&recording, "night_0.mcap")));
    for line in [
        "  version: 8",
        "    nanoseconds: 29920000000",
        "    nanoseconds_since_epoch: 60000000",
        "  message_count: 1499",
        "        type_description_hash: \"RIHS01_",
        "        offered_qos_profiles: \"- history: 1\\n",
        "    - \"night_0.mcap\"",
    ] {
        assert!(written.lines().any(|found| found.starts_with(line)), "{line} in\n{written}");
    }
    // Written again under its own name, as when its run is resumed. With another file it is no bag.
    let rewrite = |file: &Path| {
        let mut recorder = Recorder::create(file, &[SCENARIO]).unwrap();
        write(&mut recorder, 3..1500);
        recorder.finish().unwrap();
    };
    let metadata = bag.join("metadata.yaml");
    fs::remove_file(&metadata).unwrap();
    rewrite(&bag.join("night_0.mcap"));
    assert_eq!(fs::read_to_string(&metadata).unwrap(), written);
    fs::remove_file(&metadata).unwrap();
    fs::write(bag.join("notes"), "").unwrap();
    rewrite(&bag.join("night_0.mcap"));
    assert!(!metadata.exists());
}
