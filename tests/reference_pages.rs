//! Pages of reference that say the same as the code: the list of messages, the tables of topics, of
//! counters and of columns.
//!
//! With the environment variable `UPDATE_DOCS` the generated parts are written: `UPDATE_DOCS=1
//! cargo test --release -p tests reference_pages`.

use std::collections::BTreeSet;
use std::fs;

use experiments::columns::ColumnInfo;
use experiments::rows::{RunRow, WallRow};
use msgs::counters::{CounterInfo, CounterName};
use msgs::ids::AgentId;
use msgs::topics::{self, Durability, Qos, Reliability, Topic};
use regex_lite::Regex;
use textwrap::{Options, WordSplitter};

use crate::support::root;
use crate::tidy::{files, read};

#[test]
fn message_definitions_are_published() {
    let mut definitions = String::new();
    for file in files("msgs/msg", "msg") {
        let name = file.file_stem().expect("a message has a name").to_string_lossy().into_owned();
        definitions += &format!("- [`{name}`](../msgs/msg/{name}.msg): {}\n", purpose(&read(&file)));
    }
    check_generated("docs/messages.md", "messages", &definitions);
}

#[test]
fn documented_counters_are_those_of_results() {
    let varying = [CounterName::MessageBytesOfType(0), CounterName::TickExplored { permille: 0 }];
    let counters = CounterName::PLAIN.iter().copied().chain(varying).map(|counter| counter.info());
    let list = counters.map(|CounterInfo { name, unit, meaning }| item(&format!("`{name}` ({unit}): {meaning}")));
    check_generated("docs/recording.md", "counters", &list.collect::<String>());
}

#[test]
fn documented_columns_are_those_of_runs() {
    let of_wall = |column: &ColumnInfo| (format!("wall_{}", column.name), column.meaning);
    let of_run = RunRow::COLUMNS.iter().filter(|column| column.name != "wall_<figure>");
    let columns = of_run.map(|column| (column.name.replace(", ", "`, `"), column.meaning));
    let rows = columns.chain(WallRow::COLUMNS.iter().map(of_wall));
    let list = rows.map(|(name, meaning)| item(&format!("`{name}`: {meaning}")));
    check_generated("docs/experiments.md", "columns", &list.collect::<String>());
}

/// An item of a list, in lines of at most 100 columns.
fn item(text: &str) -> String {
    let options = Options::new(100).initial_indent("- ").subsequent_indent("  ");
    textwrap::fill(text, options.word_splitter(WordSplitter::NoHyphenation).break_words(false)) + "\n"
}

/// Checks the generated part of a page, which stands between two marks; writes it if asked to.
fn check_generated(page: &str, part: &str, expected: &str) {
    let (begin, end) = (format!("<!-- generated: {part} -->\n"), "<!-- end of generated -->");
    let present = read(&root().join(page));
    let (before, rest) = present.split_once(&begin).unwrap_or_else(|| panic!("{page} has no {begin}"));
    let (_, after) = rest.split_once(end).unwrap_or_else(|| panic!("{page} has no {end} after {begin}"));
    let expected = format!("{before}{begin}\n{expected}\n{end}{after}");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(root().join(page), &expected).expect("the page can be written");
    }
    let hint = "run UPDATE_DOCS=1 cargo test --release -p tests reference_pages";
    assert!(read(&root().join(page)) == expected, "{page} differs from the code in its part {part}: {hint}");
}

/// The first sentence of a message definition, which says what the message is.
fn purpose(definition: &str) -> String {
    let comment: Vec<&str> = definition.lines().map_while(|line| line.strip_prefix("# ")).collect();
    let comment = comment.join(" ");
    let sentence = comment.split_once(". ").map_or(comment.trim_end_matches('.'), |(first, _)| first);
    assert!(!sentence.is_empty(), "a message definition begins with what the message is: {definition}");
    sentence.to_owned()
}

/// The agent of the topics in the tables.
const AGENT: AgentId = AgentId(3);

/// A row of a table of topics.
#[derive(Debug)]
struct Row {
    name: String,
    message: String,
    /// As the row words it.
    qos: String,
}

/// The rows of the tables of topics in a document.
fn rows(document: &str) -> Vec<Row> {
    let row = Regex::new(r"(?m)^\| `(/[^`]*)` \| `([a-z_0-9]+)/([A-Za-z0-9]+)` \|(.*)$").expect("it is written here");
    let text = read(&root().join(document));
    let found = row.captures_iter(&text).map(|found| {
        let further: Vec<&str> = found[4].split('|').map(str::trim).collect();
        let qos = further.iter().find(|cell| cell.contains("volatile") || cell.contains("latched"));
        Row {
            name: found[1].replace("<id>", &AGENT.to_string()),
            message: format!("{}/msg/{}", &found[2], &found[3]),
            qos: qos.copied().unwrap_or_default().to_owned(),
        }
    });
    found.collect()
}

/// A quality of service in the words of the tables.
fn worded(qos: Qos) -> String {
    let reliability = match qos.reliability {
        Reliability::Reliable => "reliable",
        Reliability::BestEffort => "best effort",
    };
    let durability = match qos.durability {
        Durability::TransientLocal => "latched",
        Durability::Volatile => "volatile",
    };
    format!("{reliability}, {durability}, {}", qos.depth)
}

/// The topics of a run with their types between processes.
fn of_runs() -> Vec<Topic> {
    let signed = [topics::signed_join(AGENT), topics::signed_observation(AGENT), topics::signed_command(AGENT)];
    let mine = format!("/agent_{AGENT}/");
    let all = topics::all(AGENT.0 + 1).into_iter();
    let of_one = all.filter(|topic| topics::split(&topic.name).is_none() || topic.name.starts_with(&mine));
    of_one.map(|topic| signed.iter().find(|signed| signed.name == topic.name).cloned().unwrap_or(topic)).collect()
}

/// Names, types and qualities of service in the tables are those of `msgs::topics`, and every topic
/// is in a table.
#[test]
fn documented_topics_are_those_of_runs() {
    let expected = of_runs();
    let mut documented = BTreeSet::new();
    // In this one all topics are reliable, and the table does not say so.
    for (document, prefix) in [("docs/topics.md", "reliable, "), ("docs/ros2.md", "")] {
        let rows = rows(document);
        assert!(rows.len() >= 8, "{document}: {rows:?}");
        for row in rows {
            let topic = expected.iter().find(|topic| topic.name == row.name);
            let topic = topic.unwrap_or_else(|| panic!("{document}: no run has {row:?}"));
            assert_eq!(row.message, topic.message.to_string(), "{document}: {row:?}");
            if [topics::intervention().name, topics::map_change().name].contains(&topic.name) {
                assert_eq!(row.qos, "", "{document}: it is in recordings only");
            } else {
                assert_eq!(format!("{prefix}{}", row.qos), worded(topic.qos), "{document}: {row:?}");
            }
            documented.insert(row.name);
        }
    }
    let missing: Vec<_> = expected.iter().map(|topic| &topic.name).filter(|name| !documented.contains(*name)).collect();
    assert!(missing.is_empty(), "topics in no table: {missing:?}");
}
