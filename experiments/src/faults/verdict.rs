//! Whether a disturbed run is the undisturbed one: digest, messages, and bytes.
//!
//! Invariant: nothing is let pass but the counters of refused messages, because the disturbances themselves are counted there.

use std::path::Path;

use msgs::maes_msgs;
use msgs::topics;
use sim_server::difference;
use sim_server::recording::{End, Message, Recording, RecordingError};

/// How the counters of refused messages begin.
const REFUSED: &str = "refused_";

/// In which way a run is the undisturbed one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sameness {
    /// The files are equal, byte for byte.
    Bytes,
    /// All is equal but the counters of refused messages, of which there were more by so many.
    Refusals(u64),
}

/// Compares a recording with the one that is expected.
///
/// # Errors
/// If they are not the same; says where, and what is different.
pub fn compare(expected: &Path, found: &Path) -> Result<Sameness, String> {
    let open = |file: &Path| Recording::open(file).map_err(|error: RecordingError| error.to_string());
    let (before, now) = (open(expected)?, open(found)?);
    if before.scenario() != now.scenario() {
        return Err("the scenario is another one".to_owned());
    }
    let refusals = compare_messages(&before, &now)?;
    if refusals > 0 {
        return Ok(Sameness::Refusals(refusals));
    }
    let bytes = |file: &Path| std::fs::read(file).map_err(|error| format!("{}: {error}", file.display()));
    if bytes(expected)? == bytes(found)? {
        Ok(Sameness::Bytes)
    } else {
        Err("all messages are the same, but the bytes of the files are not".to_owned())
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
            (one, two) => return Err(format!("message {number} is to be {}, and is {}", name(one), name(two))),
        }
    }
    match (expected.end(), found.end()) {
        (Some(End::Whole), Some(End::Whole)) => Ok(refusals),
        (Some(End::Whole), end) => Err(format!("the recording has no end: {end:?}")),
        (end, _) => Err(format!("the expected recording has no end: {end:?}")),
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

/// How many messages more were refused, if there is no other difference.
fn compare_results(before: &Message, now: &Message) -> Result<u64, String> {
    let decode = |message: &Message| message.decode::<maes_msgs::Result>().map_err(|error| error.to_string());
    let (mut before, mut now) = (decode(before)?, decode(now)?);
    let (expected, found) = (take_refusals(&mut before), take_refusals(&mut now));
    match difference::between(&before, &now) {
        Some(what) => Err(format!("the result: {what}")),
        None if found > expected => Ok(found - expected),
        None => Err(format!("{expected} refusals were expected, and there are {found}")),
    }
}

fn take_refusals(result: &mut maes_msgs::Result) -> u64 {
    let refused = result.counters.iter_mut().filter(|counter| counter.name.starts_with(REFUSED));
    refused.map(|counter| std::mem::take(&mut counter.value)).sum()
}

/// The digest of a recorded run.
///
/// # Errors
/// If there is none.
pub fn digest(file: &Path) -> Result<String, String> {
    let recording = Recording::open(file).map_err(|error| error.to_string())?;
    let result = recording.messages().filter(is_result).last();
    let result = result.ok_or_else(|| format!("{}: no result", file.display()))?;
    let result: maes_msgs::Result = result.decode().map_err(|error| error.to_string())?;
    Ok(simulation::digest::Digest(result.digest).to_string())
}
