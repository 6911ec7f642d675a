//! `maes new`: the folder of a controller of one's own, from the template in
//! `examples/own_controller`.

use std::fs;
use std::io;
use std::path::{Path, PathBuf, absolute};
use std::process::ExitCode;

use anyhow::{bail, ensure};
use clap::Args;
use thiserror::Error;

use agent_node::controllers;

use crate::output::print;

/// The name of the template's controller.
const TEMPLATE: &str = "zigzag";

const MANIFEST: &str = include_str!("../../examples/own_controller/Cargo.toml");
const MAIN: &str = include_str!("../../examples/own_controller/src/main.rs");
const PLAN: &str = include_str!("../../examples/own_controller/plan.toml");
const MODULE: &str = include_str!("../../examples/own_controller/zigzag.py");

/// The dependency of the template, in the place where it lies.
const DEPENDENCY: &str = "path = \"../../agent_node\"";

/// The versions of foreign crates that this build has.
const LOCK: &str = include_str!("../../Cargo.lock");

/// Names with another meaning: words of Rust and Python, of Cargo's own folders, and modules that
/// the template needs.
const TAKEN: [&str; 81] = [
    "abstract",
    "alloc",
    "and",
    "as",
    "assert",
    "async",
    "await",
    "become",
    "box",
    "break",
    "build",
    "class",
    "const",
    "continue",
    "core",
    "crate",
    "def",
    "del",
    "deps",
    "do",
    "dyn",
    "elif",
    "else",
    "enum",
    "examples",
    "except",
    "extern",
    "false",
    "final",
    "finally",
    "fn",
    "for",
    "from",
    "gen",
    "global",
    "if",
    "impl",
    "import",
    "in",
    "incremental",
    "is",
    "lambda",
    "let",
    "loop",
    "macro",
    "match",
    "math",
    "mod",
    "move",
    "mut",
    "nonlocal",
    "not",
    "numpy",
    "or",
    "override",
    "pass",
    "priv",
    "proc_macro",
    "pub",
    "raise",
    "random",
    "ref",
    "return",
    "self",
    "static",
    "std",
    "struct",
    "super",
    "test",
    "trait",
    "true",
    "try",
    "type",
    "typeof",
    "unsafe",
    "unsized",
    "use",
    "virtual",
    "while",
    "with",
    "yield",
];

/// Arguments of `new`.
#[derive(Debug, Args)]
pub(crate) struct NewArgs {
    /// Name of the controller and of its folder: lower-case letters, digits and `_`
    name: String,
    /// A Python module instead of a Rust crate
    #[arg(long)]
    python: bool,
    /// Folder with the sources of this simulator, on which the crate depends [default: the checkout
    /// whose target folder has this program]
    #[arg(long, value_name = "DIR", conflicts_with = "python")]
    sources: Option<PathBuf>,
}

/// The folder cannot be made, as on a full disk.
#[derive(Debug, Error)]
#[error("{name}: {source}")]
pub(crate) struct NotWritten {
    name: String,
    source: io::Error,
}

/// Makes the folder, and prints the commands that come next.
pub(crate) fn new(args: &NewArgs) -> anyhow::Result<ExitCode> {
    let name = &args.name;
    let is_name = name.starts_with(|first: char| first.is_ascii_lowercase())
        && name.chars().all(|char| char.is_ascii_lowercase() || char.is_ascii_digit() || char == '_');
    ensure!(is_name, "{name:?}: expected a name of lower-case letters, digits and `_` that begins with a letter");
    ensure!(
        !TAKEN.contains(&name.as_str()) && !is_package_of_this_build(name),
        "{name:?}: a word of Rust or Python, or the name of a package; choose another"
    );
    ensure!(
        !controllers::NAMES.contains(&name.as_str()),
        "{name:?}: a controller of this simulator has this name; choose another"
    );
    let files = if args.python { python(name) } else { rust(name, &sources(args.sources.as_deref())?) };
    let folder = Path::new(name);
    match fs::create_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            bail!("{name}: exists already; choose another name")
        }
        created => created.map_err(|source| NotWritten { name: name.clone(), source })?,
    }
    let written = files.into_iter().try_for_each(|(file, content)| {
        let path = folder.join(file);
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        fs::write(&path, content)
    });
    if let Err(source) = written {
        // A part of a controller is in the way of the next try. If it stays, the error tells why.
        drop(fs::remove_dir_all(folder));
        return Err(NotWritten { name: name.clone(), source }.into());
    }
    print(&if args.python {
        format!(
            "{name}/{name}.py is a controller: change its `decide`. Run it with\n  cd {name}\n  python {name}.py          # needs the package: \
             pip install maes-*.whl of a release, or ./python of a checkout\n  maes view run.mcap"
        )
    } else {
        format!(
            "{name}/src/main.rs is a controller: change its `decide`. Run it with\n  cd {name}\n  cargo build --release\n  maes run \
             --controller {name} --set 'agents.command=[\"target/release/{name}\"]' --transport memory --record \
             run.mcap\n  maes view run.mcap"
        )
    });
    Ok(ExitCode::SUCCESS)
}

/// Whether a package of the sources has this name, which Cargo does not tell from that of a
/// controller: the lock names no place for either.
fn is_package_of_this_build(name: &str) -> bool {
    let packages = LOCK.split("[[package]]").map(|package| package.lines().map(str::trim).collect::<Vec<_>>());
    let mut own = packages.filter(|lines| !lines.iter().any(|line| line.starts_with("source = ")));
    own.any(|lines| lines.contains(&format!("name = {name:?}").as_str()))
}

fn python(name: &str) -> Vec<(String, String)> {
    vec![(format!("{name}.py"), named(MODULE, name))]
}

fn rust(name: &str, sources: &Path) -> Vec<(String, String)> {
    let dependency = format!("path = {:?}", sources.join("agent_node"));
    vec![
        ("Cargo.toml".to_owned(), named(MANIFEST, name).replace(DEPENDENCY, &dependency)),
        ("Cargo.lock".to_owned(), LOCK.to_owned()),
        ("src/main.rs".to_owned(), named(MAIN, name)),
        ("plan.toml".to_owned(), named(PLAN, name)),
    ]
}

/// The text of the template with another name.
fn named(text: &str, name: &str) -> String {
    let title: String = name
        .split('_')
        .flat_map(|word| word.chars().take(1).map(|first| first.to_ascii_uppercase()).chain(word.chars().skip(1)))
        .collect();
    text.replace("Zigzag", &title).replace(TEMPLATE, name)
}

/// The folder of the sources: the one that was named, or that of the checkout two folders above
/// this program.
fn sources(given: Option<&Path>) -> anyhow::Result<PathBuf> {
    let has_sources = |folder: &Path| folder.join("agent_node/Cargo.toml").is_file();
    let found = match given {
        Some(folder) => Some(folder.to_owned()),
        None => {
            std::env::current_exe()?.ancestors().skip(1).take(3).find(|folder| has_sources(folder)).map(Path::to_owned)
        }
    };
    match found {
        Some(folder) if has_sources(&folder) => Ok(absolute(folder)?),
        Some(folder) => {
            bail!("--sources {}: has no agent_node/Cargo.toml; expected a checkout of this simulator", folder.display())
        }
        None => bail!("a crate needs the sources of this simulator: name a checkout with --sources, or take --python"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn template_is_renamed_and_depends_on_the_sources() {
        let files = rust("wall_follower", Path::new("/opt/maes"));
        let content = |name: &str| &files.iter().find(|(file, _)| file == name).unwrap().1;
        assert!(content("Cargo.toml").contains("name = \"wall_follower\""));
        assert!(content("Cargo.toml").contains("path = \"/opt/maes/agent_node\""));
        assert!(content("src/main.rs").contains("impl Controller for WallFollower"));
        let module = &python("wall_follower")[0];
        assert_eq!(module.0, "wall_follower.py");
        assert!(module.1.contains("class WallFollower(maes.Controller)"));
        for (_, text) in files.iter().filter(|(file, _)| file != "Cargo.lock").chain([module]) {
            assert!(!text.to_lowercase().contains(TEMPLATE), "{text}");
        }
        assert!(TAKEN.is_sorted());
    }

    #[test]
    fn names_that_cargo_refuses_are_taken() {
        let is_taken = |name: &str| TAKEN.contains(&name) || is_package_of_this_build(name);
        for name in ["build", "deps", "examples", "incremental", "yield", "maes", "agent_node", "agent", "voxels"] {
            assert!(is_taken(name), "{name}");
        }
        for name in ["wanderer", "serde", "nalgebra", "zigzag"] {
            assert!(!is_taken(name), "{name}");
        }
    }
}
