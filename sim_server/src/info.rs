//! Summary of a recording.
//!
//! Truncated recordings are summarised up to the truncation. Large ones that are finished are
//! summarised by their index, without a pass over the file. Control characters are escaped, so that
//! no name in a recording can imitate the digest.

use std::collections::BTreeMap;
use std::path::Path;

use msgs::ids::{AgentId, Tick};
use msgs::{maes_msgs, printable, topics};
use protocol::stage::Stage;

use recording::index::IndexedRecording;
use recording::{End, Recording, RecordingError, SCENARIO_ATTACHMENT};

/// Bytes up to which a file is read whole, which also finds damage, in a fraction of a second.
const READ_WHOLE_BYTES_MAX: u64 = 64 << 20;

/// What a user is told of a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Overview {
    /// Scenario as TOML; empty if the attachment is missing.
    pub scenario: String,
    /// The messages, by topic.
    pub messages: BTreeMap<String, Traffic>,
    pub digest: Option<maes_msgs::Digest>,
    /// The result, if the run ended.
    pub result: Option<maes_msgs::Result>,
    /// Where and why reading stopped, unless at the end.
    pub damage: Option<String>,
    /// How a large file was read.
    pub reading: Option<String>,
}

impl From<Info> for Overview {
    fn from(info: Info) -> Self {
        let Info { scenario, messages, digest, result, damage, .. } = info;
        Self { scenario, messages, digest, result, damage, reading: None }
    }
}

/// Describes a file: a large one by its index, if it has one.
///
/// # Errors
/// If it cannot be opened or is no recording.
pub fn overview(file: &Path) -> Result<Overview, RecordingError> {
    if std::fs::metadata(file).is_ok_and(|metadata| metadata.len() <= READ_WHOLE_BYTES_MAX) {
        return read(file).map(Overview::from);
    }
    match IndexedRecording::open(file)?.and_then(|indexed| by_index(&indexed)) {
        Ok(overview) => Ok(overview),
        Err(reason) => {
            let reading = Some(format!("read: the whole file, because {reason}"));
            Ok(Overview { reading, ..Overview::from(read(file)?) })
        }
    }
}

fn by_index(indexed: &IndexedRecording) -> Result<Overview, &'static str> {
    let scenario = indexed.attachment(SCENARIO_ATTACHMENT).ok_or("it has no scenario")?;
    let traffic = indexed.traffic()?.into_iter();
    let digest = indexed.last(&topics::digest().name)?.and_then(|message| message.decode().ok());
    let result = indexed.last(&topics::result().name)?.and_then(|message| message.decode().ok());
    Ok(Overview {
        scenario: String::from_utf8_lossy(scenario).into_owned(),
        messages: traffic.map(|(topic, (count, bytes))| (topic, Traffic { count, bytes })).collect(),
        digest,
        result,
        damage: None,
        reading: Some("read: the index alone; `maes verify` reads the whole file and finds damage".to_owned()),
    })
}

/// The summary of a recording, as far as it can be read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Info {
    /// Scenario as TOML.
    pub scenario: String,
    /// The messages, by topic.
    pub messages: BTreeMap<String, Traffic>,
    pub digest: Option<maes_msgs::Digest>,
    /// The scenario as announced to agents.
    pub announced: Option<maes_msgs::Scenario>,
    /// Progress messages, in order.
    pub progress: Vec<maes_msgs::Progress>,
    /// The stages that commands name, in order: agent, tick and stage.
    pub stages: Vec<(AgentId, Tick, Stage)>,
    /// The result, if the run ended.
    pub result: Option<maes_msgs::Result>,
    /// Where and why reading stopped, unless at the end.
    pub damage: Option<String>,
}

/// The messages of a topic.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Number of messages.
    pub count: u64,
    /// Bytes of all of them as they are sent, without the headers of a transport.
    pub bytes: u64,
}

/// Summarises a file.
///
/// # Errors
/// If it cannot be opened or is no recording.
pub fn read(file: &Path) -> Result<Info, RecordingError> {
    Recording::open_messages(file).map(|recording| of(&recording))
}

/// Summarises a recording.
#[must_use]
pub fn of(recording: &Recording) -> Info {
    let mut info = Info { scenario: recording.scenario().into_owned(), ..Info::default() };
    let mut messages = recording.messages();
    for message in &mut messages {
        let topic = &message.channel.topic;
        let traffic = info.messages.entry(topic.clone()).or_default();
        traffic.count += 1;
        let added = if message.channel.lacks_stage { maes_msgs::Command::UNDIGESTED_BYTES } else { 0 };
        traffic.bytes += (message.data.len() - added) as u64;
        if *topic == topics::digest().name {
            let latest = info.digest.as_ref().map_or(0, |digest| digest.tick);
            let digest = message.decode().ok().filter(|digest: &maes_msgs::Digest| digest.tick >= latest);
            info.digest = digest.or(info.digest.take());
        } else if *topic == topics::result().name {
            info.result = message.decode().ok();
        } else if *topic == topics::progress().name {
            info.progress.extend(message.decode());
        } else if *topic == topics::scenario().name {
            info.announced = message.decode().ok();
        } else if topic.starts_with("/agent_")
            && topic.ends_with("/command")
            && let Ok(maes_msgs::Command { agent, tick, stage, .. }) = message.decode()
            && let Ok(Some(stage)) = Stage::from_wire(stage)
        {
            info.stages.push((AgentId(agent), Tick(tick), stage));
        }
    }
    // Another program may have written the messages in another order.
    info.progress.sort_by_key(|progress| progress.tick);
    info.stages.sort_by_key(|&(_, tick, _)| tick);
    if let Some(end @ (End::CutOff { .. } | End::Damage { .. })) = messages.end() {
        info.damage = Some(end.to_string());
    }
    info
}

/// A line for each fork that the run goes back to.
fn forks(scenario: &str) -> String {
    let scenario: toml::Table = scenario.parse().unwrap_or_default();
    let events = scenario.get("event").and_then(toml::Value::as_array).into_iter().flatten();
    let fork = |event: &toml::Value| {
        let parent = event.get("parent")?.as_str()?;
        let (at_s, set) = (event.get("at_s")?, event.get("set")?);
        let line = format!("forked at {at_s} s from the run with digest {parent}: {set}");
        Some(format!("\n{}\n", printable::line(&line)))
    };
    events.filter_map(fork).collect()
}

/// The summary as text; the last line is the digest.
#[must_use]
pub fn text(info: &Overview) -> String {
    let scenario = match info.scenario.as_str() {
        "" => "none: another program has written this recording again without its attachments\n",
        scenario => scenario,
    };
    let mut text = format!("scenario:\n{}\nmessages:\n", printable::text(scenario));
    text += &format!("{:>10} {:>12}\n", "number", "bytes");
    for (topic, Traffic { count, bytes }) in &info.messages {
        text += &format!("{count:>10} {bytes:>12} {}\n", printable::line(topic));
    }
    text += &forks(&info.scenario);
    match &info.result {
        Some(result) => text += &format!("\nresult:\n{}\n", crate::terminal::result_table(result)),
        None => text += "\nno result: the run did not come to its end\n",
    }
    for line in info.damage.iter().chain(&info.reading) {
        text += &format!("{}\n", printable::line(line));
    }
    match &info.digest {
        Some(digest) => {
            let hex = simulation::digest::Digest(digest.digest);
            text += &format!("tick: {}\ndigest: {hex}", digest.tick);
        }
        None => text += "digest: none",
    }
    text
}

#[cfg(test)]
mod tests {
    use msgs::cdr;
    use msgs::maes_msgs::{Command, Digest, Progress};

    use super::*;
    use recording::recorder::{Document, Recorder};

    const SCENARIO: Document<'_> =
        Document { name: SCENARIO_ATTACHMENT, media_type: "application/toml", data: b"seed = 1\n" };

    /// Topics begin in different chunks, and messages have different sizes.
    fn recorded(file: &Path, is_finished: bool) {
        let mut recorder = Recorder::create(file, &[SCENARIO]).unwrap();
        recorder.publish().unwrap();
        for tick in 0..2600 {
            let explored_by = vec![0.5; (tick % 7) as usize];
            let progress = Progress { tick, explored_by, ..Progress::default() };
            recorder.write(&topics::progress(), Tick(tick), &cdr::encode(&progress)).unwrap();
            if tick % 50 == 0 {
                let digest = Digest { tick, ..Digest::default() };
                recorder.write(&topics::digest(), Tick(tick), &cdr::encode(&digest)).unwrap();
            }
            let agent = AgentId((tick / 700) as u32);
            let command = Command { agent: agent.0, tick, ..Command::default() };
            recorder.write(&topics::command(agent), Tick(tick), &cdr::encode(&command)).unwrap();
        }
        let result = maes_msgs::Result { tick: 2600, ..maes_msgs::Result::default() };
        recorder.write(&topics::result(), Tick(2600), &cdr::encode(&result)).unwrap();
        if is_finished {
            recorder.finish().unwrap();
        } else {
            recorder.save_provisionally().unwrap();
        }
    }

    fn indexed(file: &Path) -> Result<Overview, &'static str> {
        IndexedRecording::open(file).unwrap().and_then(|indexed| by_index(&indexed))
    }

    #[test]
    fn index_says_what_a_pass_says() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.mcap");
        recorded(&file, true);
        let by_pass = Overview::from(read(&file).unwrap());
        assert_eq!(by_pass.messages.len(), 7);
        let mut by_index = indexed(&file).unwrap();
        assert!(by_index.reading.take().is_some());
        assert_eq!(by_index, by_pass);
        assert_eq!(by_index.result.unwrap().tick, 2600);
        assert_eq!(overview(&file).unwrap(), by_pass, "small files are read whole");
    }

    #[test]
    fn order_of_messages_does_not_change_the_summary() {
        let folder = tempfile::tempdir().unwrap();
        let of = |ticks: [u64; 3]| {
            let mut recorder = Recorder::create(&folder.path().join("a.mcap"), &[SCENARIO]).unwrap();
            for tick in ticks {
                let (digest, progress) =
                    (Digest { tick, ..Digest::default() }, Progress { tick, ..Progress::default() });
                recorder.write(&topics::digest(), Tick(tick), &cdr::encode(&digest)).unwrap();
                recorder.write(&topics::progress(), Tick(tick), &cdr::encode(&progress)).unwrap();
            }
            recorder.finish().unwrap();
            read(&folder.path().join("a.mcap")).unwrap()
        };
        let info = of([0, 50, 100]);
        assert_eq!(info.digest.as_ref().unwrap().tick, 100);
        assert_eq!(of([100, 50, 0]), info);
        assert_eq!(of([50, 100, 0]), info);
    }

    #[test]
    fn index_that_is_no_use_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.mcap");
        recorded(&file, false);
        assert_eq!(indexed(&file), Err("it has no end, so no index"));
        recorded(&file, true);
        let whole = std::fs::read(&file).unwrap();
        let mut other = whole.clone();
        let end = other.len();
        other[end - 100] ^= 1;
        std::fs::write(&file, other).unwrap();
        assert_eq!(indexed(&file), Err("its index does not match its checksum"));
        let mut other = whole;
        let library = other.windows(4).position(|bytes| bytes == b"maes").unwrap();
        other[library] = b'M';
        std::fs::write(&file, other).unwrap();
        assert_eq!(indexed(&file), Err("another program has written it"));
    }
}
