//! The comparison of a disturbed run with the undisturbed one: digest, messages, bytes.
//!
//! Invariant: every difference counts except in the counters of refused messages, which count the
//! injected messages themselves.

use std::fmt;
use std::path::Path;

use msgs::maes_msgs;
use msgs::topics;
use recording::difference;
use recording::{End, Message, Recording, RecordingError};

/// The degree to which a disturbed run equals the undisturbed one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Equivalence {
    /// The files are equal, byte for byte.
    Bytes,
    /// Only the refusal counters differ: this many more messages were refused.
    ExceptRefusals(u64),
}

impl fmt::Display for Equivalence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bytes => f.write_str("same, byte for byte"),
            Self::ExceptRefusals(count) => write!(f, "same, {count} messages refused"),
        }
    }
}

/// Compares a recording with the one that is expected.
///
/// # Errors
/// The first difference, as a line of text.
pub fn compare(expected: &Path, found: &Path) -> Result<Equivalence, String> {
    let open = |file: &Path| Recording::open(file).map_err(|error: RecordingError| error.to_string());
    compare_recordings(&open(expected)?, &open(found)?)
}

/// Compares a recording in memory with the one that is expected.
///
/// # Errors
/// The first difference, as a line of text.
pub fn compare_recordings(before: &Recording, now: &Recording) -> Result<Equivalence, String> {
    if before.scenario() != now.scenario() {
        return Err("the scenarios differ".to_owned());
    }
    let refusals = compare_messages(before, now)?;
    if refusals > 0 {
        return Ok(Equivalence::ExceptRefusals(refusals));
    }
    if before.has_same_bytes(now) {
        Ok(Equivalence::Bytes)
    } else {
        Err("all messages are equal, but the bytes of the files differ".to_owned())
    }
}

fn compare_messages(before: &Recording, now: &Recording) -> Result<u64, String> {
    let (mut expected, mut found) = (before.messages(), now.messages());
    let mut refusals = 0;
    for number in 0.. {
        match (expected.next(), found.next()) {
            (None, None) => break,
            (Some(one), Some(two)) if one == two => {}
            (Some(one), Some(two)) if is_result(&one) && is_result(&two) => refusals += compare_results(&one, &two)?,
            (one, two) => return Err(format!("message {number}: expected {}, found {}", name(one), name(two))),
        }
    }
    match (expected.end(), found.end()) {
        (Some(End::Whole), Some(End::Whole)) => Ok(refusals),
        (Some(End::Whole), end) => Err(format!("the recording is incomplete: {end:?}")),
        (end, _) => Err(format!("the expected recording is incomplete: {end:?}")),
    }
}

fn is_result(message: &Message) -> bool {
    message.channel.topic == topics::result().name
}

fn name(message: Option<Message>) -> String {
    message.map_or_else(
        || "the end".to_owned(),
        |message| format!("{} of tick {} ({} bytes)", message.channel.topic, message.tick(), message.data.len()),
    )
}

/// The number of additional refusals, if there is no other difference.
fn compare_results(before: &Message, now: &Message) -> Result<u64, String> {
    let decode = |message: &Message| message.decode::<maes_msgs::Result>().map_err(|error| error.to_string());
    let (mut before, mut now) = (decode(before)?, decode(now)?);
    let (expected, found) = (take_refusals(&mut before), take_refusals(&mut now));
    match difference::between(&before, &now) {
        Some(what) => Err(format!("the result: {what}")),
        None if found > expected => Ok(found - expected),
        None => Err(format!("expected {expected} refusals, found {found}")),
    }
}

fn take_refusals(result: &mut maes_msgs::Result) -> u64 {
    let refused = result.counters.iter_mut().filter(|counter| counter.is_refusal());
    refused.map(|counter| std::mem::take(&mut counter.value)).sum()
}

/// The digest of a recorded run.
///
/// # Errors
/// If the file is no recording, or has no result.
pub fn digest(file: &Path) -> Result<String, String> {
    let recording = Recording::open(file).map_err(|error| error.to_string())?;
    let result = recording.messages().filter(is_result).last();
    let result = result.ok_or_else(|| format!("{}: no result", file.display()))?;
    let result: maes_msgs::Result = result.decode().map_err(|error| error.to_string())?;
    Ok(simulation::digest::Digest(result.digest).to_string())
}
