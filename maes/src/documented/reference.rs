//! docs/cli.md, the reference of the commands, follows from their declaration.
//!
//! The test fails when the page is stale; with the environment variable `UPDATE_DOCS` it writes the
//! page: `UPDATE_DOCS=1 cargo test --release -p maes documented`.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use clap::{Arg, Command, CommandFactory};
use simulation::scenario::keys;
use textwrap::{Options, WordSplitter};

use crate::Cli;

const PAGE: &str = "docs/cli.md";
const BEGIN: &str = "<!-- generated: commands -->\n";
const END: &str = "<!-- end of generated -->";

/// The heading of the options that have none.
const OPTIONS: &str = "Options";

/// The heading of the flags that set keys of the scenario.
const KEYS: &str = "Keys of the scenario";

/// Titles of what is each command's own, and written in full.
const OF_COMMANDS: [&str; 2] = ["arguments", "options"];

/// What the page has already, with the command under which it has it.
#[derive(Default)]
struct CommandPages {
    /// By the title and the items of a list of options.
    lists: BTreeMap<(String, String), String>,
    /// By the item of one option.
    items: BTreeMap<String, String>,
}

/// A command with its options, and the commands below it. What several commands share is written
/// once, and named by the others.
fn write_command(page: &mut String, command: &mut Command, written: &mut CommandPages) {
    let name = command.get_bin_name().unwrap_or(command.get_name()).to_owned();
    let usage = command.render_usage().to_string();
    let usage = usage.trim_start_matches("Usage: ").lines().map(str::trim).collect::<Vec<_>>().join(" ");
    let about = command.get_about().map(ToString::to_string).unwrap_or_default();
    write!(page, "\n## {name}\n\n{}\n", wrapped(&format!("{about}."))).expect("a text takes everything");
    // Without required options a usage says nothing that the list does not say.
    let (options, _) = usage.split_once("<COMMAND>").unwrap_or((&usage, ""));
    if options.contains("--") {
        write!(page, "\nUsage: `{usage}`\n").expect("a text takes everything");
    }
    // `maes map generate` has an option `--fill` of its own.
    let reads_maps = shown(command).any(|arg| arg.get_long() == Some("free-from"));
    for heading in headings(command) {
        let all = shown(command).filter(|arg| heading_of(arg) == heading);
        let (of_import, arguments): (Vec<&Arg>, Vec<&Arg>) = all.partition(|arg| reads_maps && is_import_option(arg));
        let items: String = arguments.iter().map(|arg| item(arg)).collect();
        let title = heading.to_lowercase();
        let of = written.lists.entry((heading, items)).or_insert_with(|| name.clone());
        if *of == name || OF_COMMANDS.contains(&title.as_str()) {
            page.push_str(&list(&title, &arguments, &name, &mut written.items));
        } else {
            write!(page, "\nFurther options: *{title}*, as of {}.\n", link(of)).expect("a text takes everything");
        }
        if !of_import.is_empty() {
            write!(page, "\nFurther options: those of [`[map.import]`](scenario.md#mapimport).\n")
                .expect("a text takes everything");
        }
    }
    for below in command.get_subcommands_mut() {
        if !below.is_hide_set() && below.get_name() != "help" {
            write_command(page, below, written);
        }
    }
}

/// The items of some arguments, and the names of those options that the page has already.
fn list(title: &str, arguments: &[&Arg], name: &str, written: &mut BTreeMap<String, String>) -> String {
    let mut items = String::new();
    let mut elsewhere: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for arg in arguments {
        let of = written.entry(item(arg)).or_insert_with(|| name.to_owned());
        match arg.get_long() {
            Some(long) if of != name => elsewhere.entry(of.clone()).or_default().push(format!("`--{long}`")),
            _ => items.push_str(&item(arg)),
        }
    }
    // Arguments and options are told apart by their names.
    let title = if OF_COMMANDS.contains(&title) { String::new() } else { format!("\n*{title}*\n") };
    let mut text = if items.is_empty() { String::new() } else { format!("{title}\n{items}") };
    for (of, names) in elsewhere {
        write!(text, "\n{}\n", wrapped(&format!("As of {}: {}.", link(&of), names.join(", "))))
            .expect("a text takes everything");
    }
    text
}

/// Whether an option is a key of `[map.import]`, which docs/scenario.md describes.
fn is_import_option(arg: &Arg) -> bool {
    arg.get_long().is_some_and(|long| keys::find(&format!("map.import.{}", long.replace('-', "_"))).is_some())
}

/// A link to the part of the page that describes a command.
fn link(command: &str) -> String {
    format!("[`{command}`](#{})", command.replace(' ', "-"))
}

/// A paragraph, or an item of a list, in lines of at most 100 columns.
fn wrapped(text: &str) -> String {
    let indent = if text.starts_with("- ") { "  " } else { "" };
    let options = Options::new(100).subsequent_indent(indent).word_splitter(WordSplitter::NoHyphenation);
    textwrap::fill(text, options.break_words(false))
}

/// The arguments of a command, without those that every command has.
fn shown(command: &Command) -> impl Iterator<Item = &Arg> {
    command.get_arguments().filter(|arg| !arg.is_hide_set() && !["help", "version"].contains(&arg.get_id().as_str()))
}

fn heading_of(arg: &Arg) -> String {
    let of_all = if arg.is_positional() { "Arguments" } else { OPTIONS };
    arg.get_help_heading().unwrap_or(of_all).to_owned()
}

/// The headings in the order of the help: arguments, options, and the others as they are declared.
fn headings(command: &Command) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for heading in shown(command).map(heading_of) {
        if !found.contains(&heading) {
            found.push(heading);
        }
    }
    found.sort_by_key(|heading| ["Arguments", OPTIONS].iter().position(|first| first == heading).unwrap_or(2));
    found
}

/// An item of a list: how the argument is written, and what it means.
fn item(arg: &Arg) -> String {
    let names = arg.get_value_names().unwrap_or_default().iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
    let takes_value = arg.get_action().takes_values();
    let is_optional = arg.get_num_args().is_some_and(|range| range.min_values() == 0);
    let value = match (takes_value, is_optional) {
        (false, _) => String::new(),
        (true, true) => format!("[{names}]"),
        (true, false) => format!("<{names}>"),
    };
    let flag = [arg.get_short().map(|short| format!("-{short}")), arg.get_long().map(|long| format!("--{long}"))];
    let flag = flag.into_iter().flatten().collect::<Vec<_>>().join(", ");
    let written = if flag.is_empty() { names } else { format!("{flag} {value}") };
    let mut meaning = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    let values: Vec<String> = arg
        .get_possible_values()
        .iter()
        .filter(|value| !value.is_hide_set())
        .map(|value| format!("`{}`", value.get_name()))
        .collect();
    let is_boolean = values == ["`true`", "`false`"];
    if takes_value && !values.is_empty() && !is_boolean && !arg.is_hide_possible_values_set() {
        write!(meaning, ". One of {}", values.join(", ")).expect("a text takes everything");
    }
    let defaults: Vec<String> =
        arg.get_default_values().iter().map(|value| format!("`{}`", value.to_string_lossy())).collect();
    if takes_value && !defaults.is_empty() {
        write!(meaning, " [default: {}]", defaults.join(" ")).expect("a text takes everything");
    }
    if heading_of(arg) == KEYS {
        // What a key means is in docs/scenario.md.
        meaning = meaning.split_once(": ").map_or(meaning.clone(), |(keys, _)| keys.to_owned());
    }
    let words: Vec<String> = meaning.split_whitespace().map(linked).collect();
    wrapped(&format!("- `{}`: {}", written.trim(), words.join(" "))) + "\n"
}

/// A word, with a link if it is the name of a page.
fn linked(word: &str) -> String {
    let page = word.trim_matches(['(', ')', ',', '.', ';']);
    match page.strip_prefix("docs/").filter(|file| file.ends_with(".md")) {
        Some(file) => word.replace(page, &format!("[{file}]({file})")),
        None => word.to_owned(),
    }
}

#[test]
fn reference_lists_the_commands() {
    let mut program = Cli::command();
    program.build();
    let mut generated = String::new();
    let mut written = CommandPages::default();
    for command in program.get_subcommands_mut() {
        if !command.is_hide_set() && command.get_name() != "help" {
            write_command(&mut generated, command, &mut written);
        }
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(PAGE);
    let present = fs::read_to_string(&file).expect("the page is a text");
    let (before, rest) = present.split_once(BEGIN).expect("the page has the mark of its beginning");
    let (_, after) = rest.split_once(END).expect("the page has the mark of its end");
    let expected = format!("{before}{BEGIN}{generated}\n{END}{after}");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(&file, &expected).expect("the page can be written");
    }
    let hint = "run UPDATE_DOCS=1 cargo test --release -p maes documented";
    assert!(fs::read_to_string(&file).expect("a text") == expected, "{PAGE} does not match the declaration: {hint}");
}
