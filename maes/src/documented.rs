//! Every `maes` command in a block of code of the documents is one that this program understands.
//!
//! The commands are parsed and not executed: files that they name need not exist.

mod reference;

use std::fs;
use std::path::{Path, PathBuf};

use clap::Parser;

use crate::Cli;

/// The documents of the workspace that show commands.
fn documents() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the workspace");
    let mut found = vec![root.join("README.md"), root.join("CONTRIBUTING.md"), root.join("SECURITY.md")];
    for entry in fs::read_dir(root.join("docs")).expect("the workspace has documents") {
        let path = entry.expect("a folder can be listed").path();
        if path.extension().is_some_and(|extension| extension == "md") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The words of each `maes` command in the blocks of code of a text.
fn commands(text: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let joined = text.replace("\\\n", " ");
    let mut is_code = false;
    for line in joined.lines() {
        if line.trim_start().starts_with("```") {
            is_code = !is_code;
        } else if is_code {
            found.extend(line.split(['&', '|', ';', '>']).filter_map(command));
        }
    }
    found
}

/// The words of a simple command, if it is one of this program.
fn command(text: &str) -> Option<Vec<String>> {
    let words = shlex::split(text)?;
    let is_assignment = |word: &String| word.contains('=') && !word.starts_with('-');
    let words: Vec<String> = words.into_iter().skip_while(is_assignment).collect();
    let program = Path::new(words.first()?).file_name()?.to_str()?;
    let is_here =
        program == "maes" && words.get(1).is_some_and(|word| !["sim_server", "agent_node"].contains(&&**word));
    is_here.then_some(words)
}

#[test]
fn commands_are_found() {
    let text = "maes no code\n```sh\n$ ls\nA=1 target/release/maes run x.toml \\\n  --seed 2 # why\nmaes map a & maes info\n```\n";
    let found: Vec<String> = commands(text).iter().map(|words| words.join(" ")).collect();
    assert_eq!(found, ["target/release/maes run x.toml --seed 2", "maes map a", "maes info"]);
}

#[test]
fn documented_commands_are_understood() {
    let mut refused = Vec::new();
    let mut count = 0;
    for document in documents() {
        for words in commands(&fs::read_to_string(&document).expect("a document is text")) {
            count += 1;
            if let Err(error) = Cli::try_parse_from(&words)
                && error.use_stderr()
            {
                let first = error.to_string().lines().next().unwrap_or_default().to_owned();
                refused.push(format!("{}: {}: {first}", document.display(), words.join(" ")));
            }
        }
    }
    assert!(refused.is_empty(), "{refused:#?}");
    assert!(count > 60, "{count} commands");
}
