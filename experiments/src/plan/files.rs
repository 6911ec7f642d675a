//! The files that the runs of a plan read: maps, and the programs that run agents.
//!
//! Their paths are relative to the plan. So that the folder of the results needs no other file, and
//! can be moved to another machine, it gets copies at the same relative paths below [`FOLDER`], and
//! the plan in it says so with the key `folder`; the scenarios, and with them the digests of the
//! runs, stay as they are written. A path that begins with `..` is kept inside by subfolders that
//! are empty.
//!
//! Invariant: nothing is written outside of the folder of the results.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Component, Path, PathBuf};

use map_files::ImportSpec;
use sim_server::map_file;
use simulation::scenario::{MapKind, Scenario};

/// Where the copies are, in the folder of the results.
pub(crate) const FOLDER: &str = "files";

/// A level below it, for a path that begins with `..`.
const LEVEL: &str = "/d";

/// The allowed values of `folder`, for error messages.
pub(super) const FOLDER_EXPECTED: &str = "expected \"files\", or \"files/d\" with one /d for each .. at the start of a path: it is written by maes batch \
     beside the copies of the files; leave it out for paths that are relative to the plan";

/// Whether this is a value of the key `folder`.
pub(super) fn is_folder(text: &str) -> bool {
    text.strip_prefix(FOLDER).is_some_and(|levels| levels.replace(LEVEL, "").is_empty())
}

/// What is known of a file.
#[derive(Debug, Clone)]
struct Content {
    /// Of the bytes; of a map, of its cells and their length.
    hash: blake3::Hash,
    is_map: bool,
    /// Of a map.
    cells: u64,
    /// Files that it needs, relative to its folder, as the picture of a `map.yaml`.
    companions: Vec<PathBuf>,
}

/// The files of a plan, each read once.
#[derive(Debug)]
pub(super) struct Files {
    /// What relative paths start from.
    folder: PathBuf,
    /// By path, and of a map by what it is read with.
    contents: BTreeMap<(PathBuf, String), Content>,
}

/// The files of a run.
#[derive(Debug, Default)]
pub(super) struct RunFiles {
    /// In the order of the scenario.
    pub(super) hashes: Vec<blake3::Hash>,
    /// How many of them, the first ones, are of the map.
    pub(super) maps: usize,
    /// Cells of the map file; 1 if it is no map.
    pub(super) map_cells: Option<u64>,
}

/// A file that cannot be read: the key that names it, the path as it is written, and the reason.
pub(super) struct Unreadable {
    pub(super) key: &'static str,
    pub(super) path: PathBuf,
    pub(super) source: io::Error,
}

impl Files {
    pub(super) fn from(folder: PathBuf) -> Self {
        Self { folder, contents: BTreeMap::new() }
    }

    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Reads the files of a run that are not read yet.
    pub(super) fn of(&mut self, scenario: &Scenario) -> Result<RunFiles, Unreadable> {
        let mut files = RunFiles::default();
        if let (MapKind::File, Some(map)) = (scenario.map.kind, &scenario.map.file) {
            let how = format!("{:?} {:?}", scenario.map.import, scenario.map.cell_m);
            let folder = self.folder.clone();
            let content = self.content("map.file", map, how, |file| read_map(file, &folder, scenario))?;
            files.hashes.push(content.hash);
            files.map_cells = Some(content.cells);
            for named in content.companions {
                let companion = self.content("map.file", &named, String::new(), read_any)?;
                if !content.is_map {
                    files.hashes.push(companion.hash);
                }
            }
        }
        files.maps = files.hashes.len();
        for (place, word) in scenario.agents.command.iter().enumerate() {
            let is_file = if place == 0 { word.contains('/') } else { self.folder.join(word).is_file() };
            if is_file {
                files.hashes.push(self.content("agents.command", Path::new(word), String::new(), read_any)?.hash);
            }
        }
        Ok(files)
    }

    fn content(
        &mut self,
        key: &'static str,
        path: &Path,
        how: String,
        read: impl FnOnce(&Path) -> io::Result<Content>,
    ) -> Result<Content, Unreadable> {
        let key_of_content = (path.to_owned(), how);
        if let Some(content) = self.contents.get(&key_of_content) {
            return Ok(content.clone());
        }
        let unreadable = |source| Unreadable { key, path: path.to_owned(), source };
        let content = read(&self.folder.join(path)).map_err(unreadable)?;
        self.contents.insert(key_of_content, content.clone());
        Ok(content)
    }

    /// What a plan needs to be copied with.
    pub(super) fn into_inputs(self, folder_key: Option<String>) -> Inputs {
        let (absolute, relative): (BTreeSet<_>, BTreeSet<_>) =
            self.contents.into_keys().map(|(path, _)| path).partition(|path| path.is_absolute());
        let levels = relative.iter().map(|path| levels_above(path)).max().unwrap_or(0);
        let copies = folder_key.unwrap_or_else(|| format!("{FOLDER}{}", LEVEL.repeat(levels)));
        Inputs { folder: self.folder, copies, relative, absolute }
    }
}

/// The files that the runs of a plan read.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Inputs {
    /// What relative paths start from.
    folder: PathBuf,
    /// What the relative paths of the copies start from, in the folder of the results.
    copies: String,
    relative: BTreeSet<PathBuf>,
    /// Those with absolute paths, which are not copied.
    pub absolute: BTreeSet<PathBuf>,
}

impl Inputs {
    /// The line of a plan that is copied with its files; empty if it has none.
    pub(super) fn line(&self) -> String {
        if self.relative.is_empty() {
            return String::new();
        }
        format!("folder = {:?} # what the relative paths below start from\n", self.copies)
    }

    /// The scenario of a run as it stands in [`RUNS`](crate::store::RUNS): its map and what the map
    /// is imported with are looked up from there, and the files of its command from the folder of
    /// the results, in which the commands of its report are executed.
    #[must_use]
    pub fn as_copied(&self, mut scenario: Scenario) -> Scenario {
        let copies = Path::new(&self.copies);
        let from_runs = Path::new("..").join(copies);
        scenario.map.file = scenario.map.file.map(|file| from_runs.join(file));
        scenario.map.import = scenario.map.import.from_folder(&from_runs);
        for word in &mut scenario.agents.command {
            if self.relative.contains(Path::new(word.as_str())) {
                *word = copies.join(&*word).display().to_string();
            }
        }
        scenario
    }

    /// Copies the files with relative paths into the folder of the results. A copy that is there is
    /// kept.
    ///
    /// # Errors
    /// If a file cannot be read or written; names the file.
    pub fn copy_to(&self, out: &Path) -> Result<(), (PathBuf, io::Error)> {
        for path in &self.relative {
            let (from, to) = (self.folder.join(path), out.join(&self.copies).join(path));
            copy(&from, &to).map_err(|error| (from, error))?;
        }
        Ok(())
    }
}

/// How many folders above its start a relative path leads at most.
fn levels_above(path: &Path) -> usize {
    let mut depth = 0_isize;
    let mut lowest = 0;
    for part in path.components() {
        depth += match part {
            Component::ParentDir => -1,
            Component::Normal(_) => 1,
            _ => 0,
        };
        lowest = lowest.min(depth);
    }
    lowest.unsigned_abs()
}

/// Copies a file, unless it is there already.
pub(crate) fn copy(from: &Path, to: &Path) -> io::Result<()> {
    let folder = to.parent().unwrap_or(Path::new("."));
    // The system follows `a/..` only if there is an `a`.
    fs::create_dir_all(folder)?;
    match (fs::canonicalize(from)?, fs::canonicalize(to)) {
        (from, Ok(to)) if from == to || is_same_content(&from, &to)? => return Ok(()),
        _ => {}
    }
    let draft = tempfile::Builder::new().prefix(".").suffix(".part").tempfile_in(folder)?;
    // With its permissions: a program stays one.
    fs::copy(from, draft.path())?;
    draft.persist(to).map_err(|error| error.error)?;
    Ok(())
}

fn is_same_content(one: &Path, other: &Path) -> io::Result<bool> {
    Ok(fs::metadata(one)?.len() == fs::metadata(other)?.len() && read_any(one)?.hash == read_any(other)?.hash)
}

/// A map of a plan in this folder; the files that it needs start from the folder, too.
fn read_map(file: &Path, folder: &Path, scenario: &Scenario) -> io::Result<Content> {
    if file.is_dir() {
        let reason = "a folder of pictures; a plan needs one file (maes map convert)";
        return Err(io::Error::new(ErrorKind::InvalidInput, reason));
    }
    let options = scenario.map.import.clone().from_folder(folder);
    let import = map_file::load(file, &options)?;
    let of_bytes = blake3::hash(&import.bytes);
    let found = import.companions.values().flatten().map(|companion| companion.path.clone());
    let from_folder = |path: PathBuf| path.strip_prefix(folder).map(Path::to_path_buf).unwrap_or(path);
    let companions = found.chain(options.trajectory).map(from_folder).collect();
    let import = ImportSpec { cell_m: scenario.map.cell_m, ..import };
    let imported = import.read().ok().map(|map| map.terrain);
    let cells = imported.as_ref().map_or(1, |terrain| terrain.extent().volume() as u64);
    // What is no map fails when it is run, with the reason.
    let Some(map) = imported.and_then(|terrain| mapgen::repair(&import.file, terrain, 0).ok()) else {
        return Ok(Content { hash: of_bytes, is_map: false, cells, companions });
    };
    let mut hasher = blake3::Hasher::new();
    hasher.update(mapgen::terrain_hash(&map.terrain).as_bytes());
    hasher.update(&map.terrain.extent().cell_m().to_bits().to_le_bytes());
    Ok(Content { hash: hasher.finalize(), is_map: true, cells, companions })
}

fn read_any(file: &Path) -> io::Result<Content> {
    let mut reader = File::open(file)?;
    if !reader.metadata()?.is_file() {
        return Err(io::Error::new(ErrorKind::InvalidInput, "expected a regular file"));
    }
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(&mut reader)?;
    Ok(Content { hash: hasher.finalize(), is_map: false, cells: 1, companions: Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Plan;

    const MAP: &str = "#####\n#####\n#####\n\n#####\n#...#\n#####\n\n#####\n#####\n#####\n";

    /// A folder `plans` with a plan, and a map and a program beside it.
    fn site() -> tempfile::TempDir {
        let site = tempfile::tempdir().unwrap();
        let other = MAP.replace("...", "..#");
        for (name, text) in [("maps/a.txt", MAP), ("plans/b.txt", &other), ("plans/own.py", "pass")] {
            let file = site.path().join(name);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, text).unwrap();
        }
        site
    }

    fn plan(site: &Path, folder: &str, text: &str) -> Plan {
        Plan::parse("p.toml", text, &site.join(folder)).unwrap()
    }

    const TEXT: &str = "seeds = [1, 2]\n[axes]\n\"map.file\" = [\"../maps/a.txt\", \"b.txt\"]\n[scenario]\n\
                        duration_s = 1.0\nmap = { kind = \"file\", file = \"b.txt\", cell_m = 1.0 }\n\
                        agents = { count = 1, command = [\"python3\", \"own.py\", \"{id}\"] }\n";

    #[test]
    fn copy_of_a_plan_needs_no_other_file_and_has_the_same_runs() {
        let site = site();
        let first = plan(site.path(), "plans", TEXT);
        assert!(first.text.starts_with("folder = \"files/d\" # "), "{}", first.text);
        let out = site.path().join("moved/here");
        first.inputs.copy_to(&out).unwrap();
        for name in ["maps", "plans"] {
            fs::remove_dir_all(site.path().join(name)).unwrap();
        }
        let copy = plan(site.path(), "moved/here", &first.text);
        assert_eq!(copy.text, first.text);
        let key = |plan: &Plan| -> Vec<_> {
            plan.runs.iter().map(|run| (run.id.clone(), run.axes.clone(), run.cost, run.scenario.identity())).collect()
        };
        assert_eq!(key(&copy), key(&first));
        assert!(copy.runs[0].scenario.map.path().unwrap().is_file());
        copy.inputs.copy_to(&out).unwrap();
    }

    #[test]
    fn run_ids_follow_the_contents() {
        let site = site();
        let ids = || plan(site.path(), "plans", TEXT).runs.into_iter().map(|run| run.id).collect::<BTreeSet<_>>();
        let before = ids();
        fs::write(site.path().join("plans/own.py"), "pass # changed").unwrap();
        let with_other_program = ids();
        assert!(before.is_disjoint(&with_other_program));
        fs::write(site.path().join("maps/a.txt"), MAP.replace("...", ".##")).unwrap();
        assert_eq!(with_other_program.intersection(&ids()).count(), 2, "only the runs on that map change");
    }

    #[test]
    fn run_ids_do_not_depend_on_the_name_of_a_map() {
        let site = site();
        let maps = site.path().join("maps");
        let map = voxels::Grid::from_text(MAP).unwrap();
        fs::write(maps.join("plain.m3dm"), voxels::m3dm::write(&map).unwrap()).unwrap();
        fs::write(maps.join("packed.m3dm"), voxels::packed::write(&map)).unwrap();
        let absolute = maps.join("a.txt").display().to_string();
        let run = |file: &str, key: &str| {
            let text =
                TEXT.replace("\"../maps/a.txt\", \"b.txt\"", &format!("{file:?}")).replace(", cell_m = 1.0", key);
            let run = plan(site.path(), "plans", &text).runs.remove(0);
            (run.id, run.map)
        };
        let here = run("../maps/a.txt", ", cell_m = 1.0");
        for file in
            ["../maps/./a.txt", "../plans/../maps/a.txt", &absolute, "../maps/plain.m3dm", "../maps/packed.m3dm"]
        {
            assert_eq!(run(file, ", cell_m = 1.0"), here, "{file}");
        }
        assert_eq!(run("../maps/packed.m3dm", ""), here);
        for other in [run("b.txt", ", cell_m = 1.0"), run("../maps/a.txt", ", cell_m = 2.0")] {
            assert!(other.0 != here.0 && other.1 != here.1);
        }
        let twice = TEXT.replace("\"b.txt\"]", "\"../maps/plain.m3dm\"]");
        let error = Plan::parse("p.toml", &twice, &site.path().join("plans")).unwrap_err().to_string();
        assert!(error.contains("two combinations are the same run"), "{error}");
    }

    #[test]
    fn paths_stay_below_the_copies() {
        for (path, levels) in [("a", 0), ("a/../b", 0), ("../a", 1), ("a/../../../b", 2), ("../a/../../b", 2)] {
            assert_eq!(levels_above(Path::new(path)), levels, "{path}");
        }
        for good in ["files", "files/d", "files/d/d"] {
            assert!(is_folder(good), "{good}");
        }
        for bad in ["", "file", "files/..", "/files", "files/d/..", "files/e", "../files"] {
            assert!(!is_folder(bad), "{bad}");
        }
        let error = Plan::parse("p.toml", &format!("folder = \"..\"\n{TEXT}"), Path::new(".")).unwrap_err();
        assert!(error.to_string().starts_with("p.toml:1: folder = \"..\": expected \"files\""), "{error}");
    }

    #[test]
    fn missing_files_are_refused_by_key() {
        let site = site();
        for (from, to, expected) in [
            ("\"b.txt\"]", "\"c.txt\"]", "p.toml:3: map.file = \"c.txt\": "),
            ("\"python3\"", "\"./own\"", "p.toml:4: agents.command = \"./own\": "),
        ] {
            let error = Plan::parse("p.toml", &TEXT.replace(from, to), &site.path().join("plans")).unwrap_err();
            assert!(error.to_string().starts_with(expected), "{error}");
        }
    }
}
