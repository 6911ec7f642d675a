//! Foreign crates: licences, duplicate versions and sources by the rules of `deny.toml`, and one
//! set of features everywhere. Foreign packages of the page: licences, sources, and no scripts.

use std::collections::{BTreeMap, BTreeSet};

use crate::support::binaries::cargo;
use crate::support::root;

/// Members whose own features a build of the workspace enables, so that building them alone builds
/// them again; and this one.
const WITHOUT_UNIFIED_FEATURES: [&str; 3] = ["fuzz", "maes_python", "workspace_features"];

/// Licences of packages that the page ships, beside those of `deny.toml`.
const PAGE_LICENCES: [&str; 1] = ["0BSD"];

/// Licences of packages that only build and test the page, beside these.
const TOOL_LICENCES: [&str; 3] = ["BlueOak-1.0.0", "ISC", "MPL-2.0"];

/// The foreign crates of `cargo tree` with these arguments: name, version, and `field`.
fn tree(arguments: &[&str], field: &str) -> BTreeSet<(String, String, String)> {
    let mut crates = crates(&[arguments, &["-e", "normal,build,dev"]].concat(), field);
    crates.retain(|(_, version, _)| !version.is_empty());
    crates
}

/// The crates of `cargo tree` with these arguments: name, version (none for members), and `field`.
fn crates(arguments: &[&str], field: &str) -> BTreeSet<(String, String, String)> {
    let mut tree = cargo();
    tree.args(["tree", "--locked", "--prefix", "none", "--format"]).arg(format!("{{p}}|{field}")).args(arguments);
    let output = tree.output().expect("cargo runs");
    assert!(output.status.success(), "{tree:?}: {}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).expect("names of packages are texts");
    let crates = lines.lines().filter_map(|line| line.trim_end_matches(" (*)").split_once('|'));
    crates
        .map(|(package, field)| {
            let mut words = package.split(' ');
            let (name, version) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
            // Members have a path in parentheses, procedural macros the words `proc-macro`.
            let version = if package.contains("(/") { "" } else { version.trim_start_matches('v') };
            (name.to_owned(), version.to_owned(), field.to_owned())
        })
        .collect()
}

fn rules() -> toml::Table {
    let text = std::fs::read_to_string(root().join("deny.toml")).expect("there are rules");
    text.parse().expect("the rules are TOML")
}

/// The texts in an array of the rules: plain ones, or those with the key `crate` of tables.
fn texts(rules: &toml::Table, section: &str, key: &str) -> BTreeSet<String> {
    let entries = rules[section][key].as_array().expect("an array");
    let texts = entries.iter().map(|entry| entry.get("crate").unwrap_or(entry).as_str().expect("a text").to_owned());
    texts.collect()
}

/// Whether an SPDX expression can be met with allowed licences. `/` is an old form of `OR`; an
/// exception with `WITH` only grants more.
fn is_allowed(expression: &str, allowed: &BTreeSet<String>) -> bool {
    if let Some(start) = expression.find('(') {
        let length = expression[start..].find(')').expect("parentheses are closed and not nested");
        let inner = is_allowed(&expression[start + 1..start + length], allowed);
        let word = if inner { "allowed" } else { "refused" };
        return is_allowed(&format!("{}{word}{}", &expression[..start], &expression[start + length + 1..]), allowed);
    }
    let is_met = |licence: &str| {
        let name = licence.split(" WITH ").next().unwrap_or_default().trim();
        name == "allowed" || allowed.contains(name)
    };
    expression.replace('/', " OR ").split(" OR ").any(|all| all.split(" AND ").all(is_met))
}

/// The licences that the rules allow for single crates.
fn exceptions(rules: &toml::Table) -> BTreeMap<String, BTreeSet<String>> {
    let entries = rules["licenses"]["exceptions"].as_array().expect("an array").iter();
    let text = |value: &toml::Value| value.as_str().expect("a text").to_owned();
    let licences = |entry: &toml::Value| entry["allow"].as_array().expect("an array").iter().map(text).collect();
    entries.map(|entry| (text(&entry["crate"]), licences(entry))).collect()
}

#[test]
fn licences_are_allowed() {
    let allowed = texts(&rules(), "licenses", "allow");
    let mut exceptions = exceptions(&rules());
    for (name, version, licence) in tree(&["--workspace", "--all-features"], "{l}") {
        let is_exception = exceptions.remove(&name).is_some_and(|allowed| is_allowed(&licence, &allowed));
        assert!(
            is_exception || is_allowed(&licence, &allowed),
            "{name} {version}: {licence:?}; deny.toml allows {allowed:?}"
        );
    }
    assert!(exceptions.is_empty(), "deny.toml has exceptions for what is not used: {exceptions:?}");
    for (expression, expected) in [
        ("MIT", true),
        ("GPL-3.0", false),
        ("GPL-3.0 OR MIT", true),
        ("MIT AND GPL-3.0", false),
        ("(GPL-3.0 OR MIT) AND Zlib", true),
        ("(MIT OR Zlib) AND GPL-3.0", false),
        ("Apache-2.0 WITH LLVM-exception", true),
        ("Unlicense/MIT", true),
        ("", false),
    ] {
        assert_eq!(is_allowed(expression, &allowed), expected, "{expression}");
    }
}

#[test]
fn versions_are_not_duplicated() {
    let mut skipped = texts(&rules(), "bans", "skip");
    let mut versions: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (name, version, _) in tree(&["--workspace", "--all-features"], "") {
        versions.entry(name).or_default().push(version);
    }
    for (name, versions) in versions.into_iter().filter(|(_, versions)| versions.len() > 1) {
        let kept: Vec<_> = versions.iter().filter(|version| !skipped.remove(&format!("{name}@{version}"))).collect();
        assert!(kept.len() <= 1, "{name} is there in the versions {versions:?}; deny.toml names all but one of them");
    }
    assert!(skipped.is_empty(), "deny.toml names what is no duplicate: {skipped:?}");
}

#[test]
fn sources_are_crates_io() {
    let lock: toml::Table = std::fs::read_to_string(root().join("Cargo.lock"))
        .expect("there is a lock file")
        .parse()
        .expect("a lock file is TOML");
    let packages = lock["package"].as_array().expect("an array of packages");
    let mut foreign = 0;
    let mut sources = BTreeSet::new();
    for package in packages {
        let Some(source) = package.get("source").and_then(toml::Value::as_str) else { continue };
        assert!(source.starts_with("registry+"), "{} comes from {source}", package["name"]);
        assert!(package.get("checksum").is_some(), "{} has a checksum", package["name"]);
        sources.insert(source);
        foreign += 1;
    }
    assert_eq!(sources.len(), 1, "one registry: {sources:?}");
    assert!(foreign > 100, "{foreign} foreign crates");
}

/// What `npm ci` installs for the page. `npm audit` asks a service for advisories, which not every
/// network reaches; this needs the lock file alone.
#[test]
fn packages_of_the_page_are_locked() {
    let lock = std::fs::read_to_string(root().join("viewer/package-lock.json")).expect("there is a lock file");
    let lock: serde_json::Value = serde_json::from_str(&lock).expect("a lock file is JSON");
    let packages = lock["packages"].as_object().expect("packages by their folder");
    let mut shipped = texts(&rules(), "licenses", "allow");
    shipped.extend(PAGE_LICENCES.map(str::to_owned));
    let tools: BTreeSet<String> = shipped.iter().cloned().chain(TOOL_LICENCES.map(str::to_owned)).collect();
    let foreign: Vec<_> = packages.iter().filter(|(folder, _)| !folder.is_empty()).collect();
    for (folder, package) in &foreign {
        let text = |key: &str| package[key].as_str().unwrap_or_default();
        assert!(text("integrity").starts_with("sha512-"), "{folder} has a strong hash: {:?}", text("integrity"));
        let resolved = text("resolved");
        let is_of_registry = resolved.is_empty() || resolved.starts_with("https://registry.npmjs.org/");
        assert!(is_of_registry && package.get("link").is_none(), "{folder} comes from {resolved}");
        assert!(package.get("hasInstallScript").is_none(), "{folder} runs a script when it is installed");
        assert!(package.get("deprecated").is_none(), "{folder} is deprecated: {}", text("deprecated"));
        let allowed = if package["dev"] == true { &tools } else { &shipped };
        assert!(is_allowed(text("license"), allowed), "{folder}: {:?}; allowed are {allowed:?}", text("license"));
    }
    assert!(foreign.len() > 50, "{} foreign packages", foreign.len());
}

/// So that `cargo test -p CRATE` compiles no foreign crate again after a build of the workspace.
#[test]
fn members_share_the_features_of_the_workspace() {
    let workspace = tree(&["--workspace"], "{f}");
    let members = unified_members();
    assert!(members.len() >= 5, "{members:?}");
    for member in members {
        let other: Vec<_> = tree(&["-p", &member], "{f}").difference(&workspace).cloned().collect();
        assert!(
            other.is_empty(),
            "{member} alone asks for other features than the workspace; is `workspace_features` among its development \
             dependencies, with all of these crates? {other:#?}"
        );
    }
    // The programs and the Python package as the tests build them, with the crates of the
    // workspace.
    let with_members = crates(&["--workspace", "-e", "normal,build,dev"], "{f}");
    for arguments in [
        &["-p", "sim_server", "-p", "agent_node", "-p", "maes", "-e", "normal,build,dev"][..],
        &["-p", "maes_python", "--features", "unified", "-e", "normal"],
    ] {
        let built = crates(arguments, "{f}");
        let other: Vec<_> = built.difference(&with_members).filter(|(name, ..)| name != "maes_python").collect();
        assert!(
            other.is_empty(),
            "{arguments:?} builds crates that a build of the workspace builds otherwise: give them there the features \
             that the workspace gives them (`default-features`, or `unified` of python/Cargo.toml): {other:#?}"
        );
    }
}

/// The members of the workspace that are built with unified features.
fn unified_members() -> Vec<String> {
    let manifest = std::fs::read_to_string(root().join("Cargo.toml")).expect("there is a manifest");
    let manifest: toml::Table = manifest.parse().expect("a manifest is TOML");
    let folders = manifest["workspace"]["members"].as_array().expect("an array of members");
    let names = folders.iter().map(|folder| {
        let manifest = root().join(folder.as_str().expect("a path")).join("Cargo.toml");
        let manifest = std::fs::read_to_string(&manifest).expect("a member has a manifest");
        let manifest: toml::Table = manifest.parse().expect("a manifest is TOML");
        manifest["package"]["name"].as_str().expect("a name").to_owned()
    });
    names.filter(|name| !WITHOUT_UNIFIED_FEATURES.contains(&name.as_str())).collect()
}
