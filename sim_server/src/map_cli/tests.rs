use super::*;
use clap::Parser;
use tempfile::TempDir;

#[derive(Debug, Parser)]
struct Cli {
    #[command(subcommand)]
    command: MapCommand,
}

/// A folder for files, and the commands run in it; `@` in an argument stands for the folder.
struct Scratch(TempDir);

impl Scratch {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).unwrap();
    }

    fn files(&self) -> Vec<String> {
        let names = fs::read_dir(self.0.path()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }

    /// The report of a command, or its error with the folder's name taken out.
    fn map(&self, line: &str) -> Result<String, String> {
        let folder = format!("{}/", self.0.path().display());
        let words = line.split(' ').map(|word| word.replace('@', &folder));
        let cli = Cli::try_parse_from(std::iter::once("map".to_owned()).chain(words)).map_err(|e| e.to_string())?;
        let mut out = Vec::new();
        let result = run_to(cli.command, &mut out).map_err(|error| error.to_string());
        result.map(|()| String::from_utf8(out).unwrap().replace(&folder, "")).map_err(|e| e.replace(&folder, ""))
    }
}

/// The value of a line of a report.
fn value<'a>(report: &'a str, name: &str) -> &'a str {
    let line = report.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("no {name} in:\n{report}"));
    line[11..].trim()
}

/// A map with an open shell and a pocket.
const OPEN: &str = "#####\n#####\n#####\n\n#####\n..#.#\n#####\n\n#####\n#####\n#####\n";

#[test]
fn a_generated_map_is_described_and_reproduced_by_its_seed() {
    let scratch = Scratch::new();
    let report = scratch.map("generate --kind spheres --size 30x24x26 --cell-m 0.5 -o @a.m3dm").unwrap();
    assert_eq!(value(&report, "size"), "30x24x26 (15 m x 12 m x 13 m)");
    let seed = value(&report, "seed");
    scratch.map(&format!("generate --size 30x24x26 --seed {seed} -o @b.txt")).unwrap();
    let info = scratch.map("info @a.m3dm @b.txt").unwrap();
    let (first, second) = info.split_once("\n\n").unwrap();
    assert_eq!(value(first, "blake3"), value(&report, "blake3"));
    assert_eq!(value(second, "blake3"), value(&report, "blake3"));
    assert_eq!(value(first, "free"), value(&report, "free"));
    assert_eq!((value(first, "components"), value(first, "shell")), ("1", "closed"));
    assert_eq!(scratch.files(), ["a.m3dm", "b.txt"]);
}

#[test]
fn every_option_reaches_the_generator() {
    let scratch = Scratch::new();
    let hash = |options: &str| {
        let report = scratch.map(&format!("generate --size 50 -o @a.m3dm --seed {options}"));
        value(&report.unwrap(), "blake3").to_owned()
    };
    let spheres =
        ["1 --fill 0.25", "1 --radius-min 4", "1 --radius-max 7", "1 --connections 1", "1 --smoothing 1", "2"];
    let noise = ["1", "1 --fill 0.5", "1 --smoothing 4", "2"].map(|rest| hash(&format!("{rest} --kind noise")));
    let mut all: Vec<String> = spheres.map(hash).into_iter().chain(noise).chain([hash("1")]).collect();
    all.sort();
    all.dedup();
    assert_eq!(all.len(), 11);
    let defaults = "1 --kind spheres --fill 0.2 --radius-min 3 --radius-max 8 --connections 3 --smoothing 5 --cell-m 2";
    assert_eq!(hash(defaults), hash("1"));
}

#[test]
fn the_parameters_of_a_building_are_set_by_their_names() {
    let scratch = Scratch::new();
    let report = scratch
        .map("generate --kind building --size 40x40x20 --set floors=2 --set lift_shafts=1 --seed 3 -o @a.txt")
        .unwrap();
    assert!(value(&report, "building").starts_with("2 floor(s), "), "{report}");
    assert_eq!(value(&report, "ways up"), "2 staircase(s), 1 lift shaft(s)");
    assert_eq!(value(&report, "entrances"), "2");
    assert_eq!(value(&report, "pockets"), "0 filled (0 cells)");
    let by_name = scratch.map("generate --size 30 --seed 3 --set fill_ratio=0.25 -o @a.txt").unwrap();
    let by_option = scratch.map("generate --size 30 --seed 3 --fill 0.25 -o @a.txt").unwrap();
    assert_eq!(by_name, by_option);
}

#[test]
fn info_describes_a_map_as_it_stands() {
    let scratch = Scratch::new();
    scratch.write("open.txt", OPEN);
    let terrain = Grid::from_text(OPEN).unwrap();
    let expected = format!(
        "file       open.txt\nsize       5x3x3\ncells      45\nfree       3 (6.67 %)\n\
         components 2 (the largest has 2 cells)\nshell      open (1 free cells in the outermost layer)\n\
         blake3     {}\n",
        mapgen::terrain_hash(&terrain)
    );
    assert_eq!(scratch.map("info @open.txt").unwrap(), expected);
    let with_slice = |slice: &str| scratch.map(&format!("info @open.txt --slice {slice}")).unwrap();
    let z = "\nz = 1, x to the right, y upwards\n#####\n..#.#\n#####\n";
    assert_eq!(with_slice("z=1"), format!("{expected}{z}"));
    assert!(with_slice("y=1").ends_with("\n\ny = 1, x to the right, z upwards\n#####\n..#.#\n#####\n"));
    assert!(with_slice("x=3").ends_with("\n\nx = 3, y to the right, z upwards\n###\n#.#\n###\n"));
}

#[test]
fn convert_repairs_unless_told_otherwise() {
    let scratch = Scratch::new();
    scratch.write("open.txt", OPEN);
    let report = scratch.map("convert @open.txt @closed.m3dm").unwrap();
    assert_eq!(value(&report, "shell"), "closed (1 free cells filled)");
    assert_eq!(value(&report, "pockets"), "1 filled (1 cells)");
    scratch.map("convert @closed.m3dm @closed.txt").unwrap();
    let closed = OPEN.replace("..#.#", "#.###");
    assert_eq!(fs::read_to_string(scratch.path("closed.txt")).unwrap(), closed);

    let report = scratch.map("convert --as-is @open.txt @same.M3DM").unwrap();
    assert_eq!(value(&report, "repairs"), "none (--as-is)");
    // A file may be its own source.
    scratch.map("convert --as-is @same.M3DM @open.txt").unwrap();
    assert_eq!(fs::read_to_string(scratch.path("open.txt")).unwrap(), OPEN);
}

#[test]
fn bad_input_is_one_line_and_writes_nothing() {
    let scratch = Scratch::new();
    scratch.write("bad.txt", "..\n.x\n");
    scratch.write("bad.m3dm", [0x64, 0xC9, 0x90, 0xFF]);
    scratch.write("solid.txt", "###\n###\n###\n");
    scratch.write("long.txt", ".".repeat(128));
    scratch.write("good.txt", OPEN);
    let before = scratch.files();
    for (line, expected) in [
        ("generate --size 30 -o @a.vox", "a.vox: the file's extension is \"vox\", known are .m3dm and .txt"),
        ("generate --size 30 -o @a", "a: the file's extension is missing, known are .m3dm and .txt"),
        ("generate --size 30x128x30 -o @a.m3dm", "a.m3dm: map size along y is 128 cells, an M3DM file holds 1 to 127"),
        ("generate --size 2000 -o @a.txt", "map size along x is 2000 cells, allowed are 1 to 1024"),
        ("generate --size 30 --cell-m 0 -o @a.txt", "cell_m is 0, allowed are finite lengths in metres above 0"),
        ("generate --size 30 --radius-max 14 -o @a.txt", "radius_max is 14, allowed is 3 to 13"),
        (
            "generate --kind noise --size 30 --connections 3 -o @a.txt",
            "--connections is not an option of --kind noise, which has --fill and --smoothing",
        ),
        (
            "generate --kind building --size 30 --fill 0.3 -o @a.txt",
            "--fill is not an option of --kind building, which has --set KEY=VALUE",
        ),
        (
            "generate --kind building --size 30 --set floors=9 -o @a.txt",
            "floors is 9, allowed is 1 to 7: floors of 3 cells with 1 between them, in 30 along z",
        ),
        (
            "generate --kind building --size 30 --set floors=x -o @a.txt",
            "--set floors=\"x\": invalid type: string \"x\", expected u32",
        ),
        ("generate --size 30 -o @none/a.txt", "none/a.txt: cannot be written: No such file or directory (os error 2)"),
        ("info @none.txt", "none.txt: cannot be read: No such file or directory (os error 2)"),
        ("info @good.txt --slice z=3", "good.txt: --slice z=3 is outside the map, z goes from 0 to 2"),
        (
            "convert @bad.txt @a.txt",
            "bad.txt: line 2, column 2: 'x' is no cell, allowed are '#' (wall), '.' and ' ' (free)",
        ),
        ("convert @bad.m3dm @a.txt", "bad.m3dm: byte 4: the file ends here, expected length 15628 bytes"),
        ("convert @solid.txt @a.txt", "solid.txt: the map has no free cell inside its outermost layer"),
        ("convert --as-is @long.txt @a.m3dm", "a.m3dm: map size along x is 128 cells, an M3DM file holds 1 to 127"),
    ] {
        assert_eq!(scratch.map(line), Err(expected.to_owned()), "{line}");
        assert_eq!(scratch.files(), before, "{line}");
    }
    let reached = scratch.map("generate --size 30 --fill 0.3 --radius-min 11 --radius-max 11 --seed 1 -o @a.txt");
    assert!(reached.unwrap_err().starts_with("fill_ratio 0.3 is out of reach on a map of 30x30x30 cells"));
    assert_eq!(scratch.files(), before);
}

#[test]
fn malformed_options_say_what_is_allowed() {
    let scratch = Scratch::new();
    for size in ["", "x", "30x", "30x30", "1x2x3x4", "-3", "3.5"] {
        let error = scratch.map(&format!("generate -o @a.txt --size={size}")).unwrap_err();
        assert!(error.contains("a size is one number of cells, or three as in 50x40x30"), "{size}: {error}");
    }
    for slice in ["", "z", "w=3", "z=", "z=-1", "z=1=2"] {
        let error = scratch.map(&format!("info @a.txt --slice={slice}")).unwrap_err();
        assert!(error.contains("a slice is x=K, y=K or z=K"), "{slice}: {error}");
    }
}

#[test]
fn a_file_that_cannot_take_its_name_leaves_nothing_behind() {
    let scratch = Scratch::new();
    fs::create_dir(scratch.path("folder.txt")).unwrap();
    let error = scratch.map("generate --size 30 --seed 1 -o @folder.txt").unwrap_err();
    assert!(error.starts_with("folder.txt: cannot be written: "), "{error}");
    assert_eq!(scratch.files(), ["folder.txt"]);
}
