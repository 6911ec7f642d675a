//! What programs say beside their results: events of `tracing`, as lines on stderr.
//!
//! An event of level INFO is its text; those of ERROR and WARN have `error: ` and `warning: `
//! before it. With [`FORMAT`] = `json` each event is an object of JSON with its level, its module
//! and the time. `RUST_LOG` names levels: one alone is that of the programs, `MODULE=LEVEL` that of
//! a module. Libraries beneath the programs, such as that of DDS, are silent unless it names them.
//! What was asked for, such as an address, is shown whatever it says ([`REQUESTED`]).
//!
//! Lines go above the progress bar, if there is one. A closed stderr is no failure. Control
//! characters are escaped in the text, and by JSON: text may come from files and messages.

use std::fmt;
use std::io;
use std::process::Command;
use std::str::FromStr;
use std::sync::OnceLock;

use msgs::printable;
use msgs::rcl_interfaces::Level;
use tracing::field::{Field, Visit};
use tracing::{Event, Subscriber};
use tracing_log::NormalizeEvent as _;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields, MakeWriter};
use tracing_subscriber::layer::{Layer, SubscriberExt as _};
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt as _;

/// The environment variable that names the format, and that a program sets for those it starts.
pub const FORMAT: &str = "MAES_LOG_FORMAT";

/// The environment variable that names what is shown: levels by modules.
const WANTED: &str = "RUST_LOG";

/// The crates that say something without it, from INFO on.
pub const OWN: [&str; 5] = ["agent_node", "maes", "ros_node", "sim_server", "system"];

/// The target of events that a flag has asked for.
pub const REQUESTED: &str = "requested";

/// The form of the lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Format {
    /// Text for people.
    #[default]
    Text,
    /// An object of JSON in each line.
    Json,
}

impl Format {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Json => "json",
        }
    }
}

impl FromStr for Format {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let format = [Self::Text, Self::Json].into_iter().find(|format| format.name() == name);
        format.ok_or_else(|| "expected text or json".to_owned())
    }
}

/// The format of this process, once it has been chosen.
static CHOSEN: OnceLock<Format> = OnceLock::new();

/// Shows events on stderr from now on, in this format, or in that of the environment; the first
/// call counts. Variables of the environment that cannot be read have no effect but a warning.
pub fn show(format: Option<Format>) {
    let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    let named = variable(FORMAT);
    let of_environment = named.as_deref().map(str::parse::<Format>);
    let format = format.or(of_environment.clone().and_then(Result::ok)).unwrap_or_default();
    if CHOSEN.set(format).is_err() {
        return;
    }
    let (filter, unread) = filter(variable(WANTED).as_deref());
    let lines = tracing_subscriber::fmt::layer().with_writer(Lines);
    let lines = match format {
        Format::Text => lines.event_format(Text).boxed(),
        Format::Json => lines.json().flatten_event(true).boxed(),
    };
    // Programs that embed this one may show events as they like.
    drop(tracing_subscriber::registry().with(lines.with_filter(filter)).try_init());
    if let (Some(name), Some(Err(error))) = (named, of_environment) {
        tracing::warn!("{FORMAT} = {name:?}: {error}");
    }
    if let Some(error) = unread {
        tracing::warn!("{WANTED} = {error}");
    }
}

/// The format that the programs which this one starts are to have, if it is not theirs anyway.
#[must_use]
pub fn format_to_pass_on() -> Option<(&'static str, &'static str)> {
    CHOSEN.get().filter(|&&format| format != Format::default()).map(|format| (FORMAT, format.name()))
}

/// Lets a program whose stderr is read say its errors as text.
pub fn as_read(command: &mut Command) {
    command.env(FORMAT, Format::Text.name()).env_remove(WANTED);
}

/// A text of a level as the line of it on stderr, for a file beside it.
#[must_use]
pub fn line(level: Level, text: &str) -> String {
    let before = match level {
        Level::Error => ERROR,
        Level::Warn => WARNING,
        Level::Info => "",
    };
    format!("{before}{text}")
}

/// What goes before the text of an event.
const ERROR: &str = "error: ";
const WARNING: &str = "warning: ";

/// What `RUST_LOG` shows, and why that could not be read.
fn filter(wanted: Option<&str>) -> (Targets, Option<String>) {
    // Of no text at all, the level alone would be ERROR.
    let (named, unread) = match wanted.map(str::parse::<Targets>) {
        None => (Targets::new(), None),
        Some(Ok(targets)) => (targets, None),
        Some(Err(error)) => (Targets::new(), wanted.map(|wanted| format!("{wanted:?}: {error}"))),
    };
    let level = named.default_level().unwrap_or(LevelFilter::INFO);
    let filter = Targets::new().with_targets(OWN.map(|name| (name, level)));
    let named = named.iter().map(|(name, level)| (name.to_owned(), level)).collect::<Vec<_>>();
    (filter.with_targets(named).with_target(REQUESTED, LevelFilter::INFO), unread)
}

/// Events as text.
struct Text;

impl<S: Subscriber + for<'span> LookupSpan<'span>, N: for<'writer> FormatFields<'writer> + 'static> FormatEvent<S, N>
    for Text
{
    fn format_event(&self, _: &FmtContext<'_, S, N>, mut to: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        let normalised = event.normalized_metadata();
        let metadata = normalised.as_ref().unwrap_or_else(|| event.metadata());
        let before = match *metadata.level() {
            tracing::Level::ERROR => ERROR,
            tracing::Level::WARN => WARNING,
            tracing::Level::INFO => "",
            tracing::Level::DEBUG => "debug: ",
            tracing::Level::TRACE => "trace: ",
        };
        let mut fields = Fields::default();
        event.record(&mut fields);
        let text = printable::text(&fields.0);
        // What the programs themselves say needs no name.
        let is_own = OWN.iter().any(|name| metadata.target().split("::").next() == Some(name));
        if metadata.target() == REQUESTED || is_own && *metadata.level() <= tracing::Level::INFO {
            writeln!(to, "{before}{text}")
        } else {
            writeln!(to, "{before}{}: {text}", metadata.target())
        }
    }
}

/// The text of an event, and its fields behind it.
#[derive(Default)]
struct Fields(String);

impl Visit for Fields {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        match field.name() {
            "message" => self.0.insert_str(0, &format!("{value:?}")),
            // Where a record of `log` comes from is in its metadata.
            name if name.starts_with("log.") => {}
            name => self.0 += &format!(" {name}={value:?}"),
        }
    }
}

/// Stderr, above the progress bar.
struct Lines;

impl<'a> MakeWriter<'a> for Lines {
    type Writer = Self;

    fn make_writer(&'a self) -> Self {
        Self
    }
}

impl io::Write for Lines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // A reader that is gone, or a full disk, ends nothing.
        let write = || drop(io::Write::write_all(&mut io::stderr(), bytes));
        #[cfg(feature = "progress_bar")]
        crate::progress_bar::above(write);
        #[cfg(not(feature = "progress_bar"))]
        write();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    /// What is written.
    #[derive(Clone, Default)]
    struct Buffer(Arc<Mutex<Vec<u8>>>);

    impl io::Write for Buffer {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Buffer {
        /// What events become, as text, with a value of `RUST_LOG`.
        fn text(wanted: Option<&str>, events: impl FnOnce()) -> String {
            let buffer = Self::default();
            let writer = buffer.clone();
            let lines = tracing_subscriber::fmt::layer().event_format(Text).with_writer(move || writer.clone());
            let shown = tracing_subscriber::registry().with(lines.with_filter(filter(wanted).0));
            tracing::subscriber::with_default(shown, events);
            String::from_utf8(buffer.0.lock().unwrap().clone()).unwrap()
        }
    }

    fn events() {
        tracing::error!("a \u{1b}[31mred word");
        tracing::warn!(agent = 3, "late");
        tracing::info!("3 agents");
        tracing::debug!("details");
        tracing::warn!(target: "rustdds::discovery", "no reply");
    }

    #[test]
    fn levels_are_words_and_libraries_are_silent() {
        let own = "error: a \\u{1b}[31mred word\nwarning: late agent=3\n3 agents\n";
        assert_eq!(Buffer::text(None, events), own);
        let library = "warning: rustdds::discovery: no reply\n";
        assert_eq!(Buffer::text(Some("rustdds=warn"), events), format!("{own}{library}"));
    }

    #[test]
    fn a_level_alone_is_that_of_the_programs() {
        let errors = "error: a \\u{1b}[31mred word\n";
        assert_eq!(Buffer::text(Some("error"), events), errors);
        let debug = Buffer::text(Some("debug"), events);
        assert!(
            debug.contains("debug: system::diagnostics::tests: details\n") && !debug.contains("rustdds"),
            "{debug}"
        );
        assert!(Buffer::text(Some("error,rustdds=warn"), events).contains("warning: rustdds::discovery: no reply\n"));
        assert_eq!(Buffer::text(Some("off"), events), "");
        assert_eq!(Buffer::text(Some("off"), || tracing::info!(target: REQUESTED, "the address")), "the address\n");
    }

    #[test]
    fn what_cannot_be_read_is_said() {
        let (_, unread) = filter(Some("rustdds=loud"));
        assert!(unread.unwrap().starts_with("\"rustdds=loud\": "));
        assert!(filter(Some("rustdds=debug")).1.is_none());
        assert_eq!(
            ["text", "json", "xml"].map(|name| name.parse().ok()),
            [Some(Format::Text), Some(Format::Json), None]
        );
    }
}
