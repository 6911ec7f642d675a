use super::*;
use clap::Parser;
use std::fs;
use tempfile::TempDir;
use voxels::Grid;

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
        let (report, result) = self.reported(line);
        result.map(|()| report)
    }

    /// What a command has reported, and its error, with the folder's name taken out.
    fn reported(&self, line: &str) -> (String, Result<(), String>) {
        let folder = format!("{}/", self.0.path().display());
        let words = line.split(' ').map(|word| word.replace('@', &folder));
        let mut out = Vec::new();
        let result = Cli::try_parse_from(std::iter::once("map".to_owned()).chain(words))
            .map_err(|error| error.to_string())
            .and_then(|cli| run_to(cli.command, None, &mut out).map_err(|error| error.to_string()));
        (String::from_utf8(out).unwrap().replace(&folder, ""), result.map_err(|error| error.replace(&folder, "")))
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
    assert_eq!(value(&report, "cell_m"), "0.5");
    let seed = value(&report, "seed");
    scratch.map(&format!("generate --size 30x24x26 --seed {seed} -o @b.txt")).unwrap();
    assert_eq!(value(&scratch.map("info @a.m3dm").unwrap(), "cell_m"), "0.5");
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
        "file       open.txt\nsize       5x3x3\ncell_m     1 (the file has none; --cell-m sets it)\ncells      45\nfree       3 (6.67 %)\n\
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
    scratch.write("good.txt", OPEN);
    scratch.map("convert --as-is --rle --cell-m 0.5 @good.txt @packed.m3dm").unwrap();
    let before = scratch.files();
    for (line, expected) in [
        (
            "generate --size 30 -o @a.vox",
            "a.vox: the file's extension is \"vox\", written are .m3dm, .txt, .bt, .obj, .stl, .glb, .pcd and .yaml",
        ),
        (
            "generate --size 30 -o @a",
            "a: the file's extension is missing, written are .m3dm, .txt, .bt, .obj, .stl, .glb, .pcd and .yaml",
        ),
        (
            "convert @good.txt @a.foo",
            "a.foo: the file's extension is \"foo\", written are .m3dm, .txt, .bt, .obj, .stl, .glb, .pcd and .yaml",
        ),
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
        (
            "convert @solid.txt @a.txt",
            "solid.txt: the map has no free cell inside its outermost layer; a closed mesh is hollow with --inside free \
             (map.import.inside), and smaller cells (--cell-m) keep narrow spaces",
        ),
        ("convert @good.txt @a.txt --up y", "good.txt: up is not an option for .txt files, which have none"),
        (
            "convert @packed.m3dm @a.txt --cell-m 0.2",
            "packed.m3dm: the file has cells of 0.5 m, asked for are cells of 0.2 m; leave cell_m out, or let them agree",
        ),
        ("generate --size 30 --plain -o @a.txt", "a.txt: --plain is an option for m3dm files"),
        (
            "generate --size 130x30x30 --kind noise --fill 0.3 --seed 1 --plain -o @a.m3dm",
            "a.m3dm: map size along x is 130 cells, an M3DM file holds 1 to 127",
        ),
        ("convert @good.txt @a.obj --origin 1,2,0", "a.obj: --origin is an option for yaml files"),
        ("check @good.txt --radius-m 17", "--radius-m 17: allowed is above 0 to 16 m, 16 cells"),
        ("check @good.txt --step-max-m 0.2", "--step-max-m: only with --body ground"),
        ("check @good.txt --body ground --step-max-m=-5", "--step-max-m -5: allowed is 0 to 16 m, 16 cells"),
        (
            "check @good.txt --body ground --slope-max-rad 2",
            "--slope-max-rad 2: allowed is 0 to 0.7853981633974483 rad",
        ),
        (
            "check @good.txt --body ground --slope-max-rad nan",
            "--slope-max-rad NaN: allowed is 0 to 0.7853981633974483 rad",
        ),
        ("info @good.txt @bad.txt --png @a.png", "--png a.png: a picture is of one map, there are 2"),
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

#[test]
fn packed_maps_are_smaller_have_a_cell_length_and_no_limit_of_127_cells() {
    let scratch = Scratch::new();
    scratch.map("generate --size 60 --seed 1 -o @plain.m3dm").unwrap();
    let report = scratch.map("convert @plain.m3dm @packed.m3dm --rle --cell-m 0.25").unwrap();
    assert_eq!(value(&report, "cell_m"), "0.25");
    let length = |name: &str| fs::metadata(scratch.path(name)).unwrap().len();
    assert!(length("packed.m3dm") * 4 < length("plain.m3dm"));
    scratch.map("convert @packed.m3dm @again.m3dm").unwrap();
    assert_eq!(fs::read(scratch.path("again.m3dm")).unwrap(), fs::read(scratch.path("packed.m3dm")).unwrap());
    let report = scratch.map("convert @packed.m3dm @again.m3dm --plain").unwrap();
    assert_eq!(value(&report, "plain"), "the file does not hold the length of cells: read it with --cell-m 0.25");
    assert_eq!(fs::read(scratch.path("again.m3dm")).unwrap(), fs::read(scratch.path("plain.m3dm")).unwrap());
    let info = scratch.map("info @packed.m3dm").unwrap();
    assert_eq!((value(&info, "cell_m"), value(&info, "size")), ("0.25", "60x60x60"));

    scratch.map("generate --kind noise --size 130x20x20 --fill 0.4 --seed 1 -o @long.m3dm").unwrap();
    assert_eq!(fs::read(scratch.path("long.m3dm")).unwrap()[..8], *b"\0M3DMRLE");
    assert_eq!(value(&scratch.map("info @long.m3dm").unwrap(), "size"), "130x20x20");
}

#[test]
fn maps_come_from_other_programs_and_go_to_them() {
    let scratch = Scratch::new();
    let hash = |report: &str| value(report, "blake3").to_owned();
    let made = hash(&scratch.map("generate --size 30 --seed 2 --cell-m 0.5 -o @a.bt").unwrap());
    let info = scratch.map("info @a.bt --slices 2").unwrap();
    assert_eq!((hash(&info), value(&info, "cell_m")), (made, "0.5"));
    assert!(info.contains("\nz=7                             z=22\n"), "{info}");
    scratch.map("convert @a.bt @a.stl").unwrap();
    let report = scratch.map("convert @a.stl @b.bt --inside free --cell-m 0.5").unwrap();
    assert_eq!(value(&report, "pockets"), "0 filled (0 cells)");
    assert_eq!(value(&report, "free").split(' ').next(), value(&info, "free").split(' ').next());
    assert!(value(&report, "mesh").ends_with("0 dropped because they have no area or are not finite"));

    scratch.write("plan.pgm", "P2 3 2 9 9 9 9 9 0 9");
    let report = scratch.map("info @plan.pgm --height-cells 2 --png @plan.png").unwrap();
    assert_eq!(value(&report, "pixels"), "5 free, 1 wall, as bright as 0.9 of 9 is free");
    assert_eq!(fs::read(scratch.path("plan.png")).unwrap()[1..4], *b"PNG");
}

#[test]
fn only_regular_files_are_maps() {
    let scratch = Scratch::new();
    std::os::unix::fs::symlink("/dev/zero", scratch.path("zeros.m3dm")).unwrap();
    nix::unistd::mkfifo(&scratch.path("fifo.obj"), nix::sys::stat::Mode::S_IRWXU).unwrap();
    scratch.write("map.yaml", "image: image.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n");
    std::os::unix::fs::symlink("/dev/zero", scratch.path("image.pgm")).unwrap();
    for command in ["info @FILE", "convert @FILE @a.txt", "check @FILE"] {
        let refuse = |file: &str| scratch.map(&command.replace("FILE", file)).unwrap_err();
        assert_eq!(refuse("zeros.m3dm"), "zeros.m3dm: cannot be read: a device; expected a regular file");
        assert_eq!(refuse("fifo.obj"), "fifo.obj: cannot be read: a FIFO; expected a regular file");
        let expected = "map.yaml: cannot be read: it names \"image.pgm\": a device; expected a regular file";
        assert_eq!(refuse("map.yaml"), expected);
    }
}

#[test]
fn a_map_of_the_map_server_comes_back_with_its_metres_and_origin() {
    let scratch = Scratch::new();
    scratch.write("map.yaml", "image: map.pgm\nresolution: 0.05\norigin: [-10.1, 3.3, 0.25]\nnegate: 0\n");
    scratch.write("map.pgm", "P2 4 3 255 0 0 0 0 0 254 254 0 0 0 0 0");
    let report = scratch.map("convert @map.yaml @again.yaml").unwrap();
    assert_eq!(value(&report, "cell_m"), "0.05");
    let again = fs::read_to_string(scratch.path("again.yaml")).unwrap();
    assert!(again.starts_with("image: \"again.pgm\"\n"), "{again}");
    assert!(again.contains("resolution: 0.05\norigin: [-10.1, 3.3, 0.25]\n"), "{again}");
    let hash = |file: &str| value(&scratch.map(&format!("info @{file}")).unwrap(), "blake3").to_owned();
    assert_eq!(hash("map.yaml"), hash("again.yaml"));
    let moved = scratch.map("convert @again.yaml @moved.yaml --origin -1,2,0").unwrap();
    assert!(value(&moved, "image").ends_with("with its origin at (-1, 2) m, turned by 0 rad"), "{moved}");
}

#[test]
fn check_says_what_a_body_can_do() {
    let scratch = Scratch::new();
    let wall = "###########\n".repeat(5);
    let room = "###########\n#....#....#\n#.........#\n#....#....#\n###########\n";
    scratch.write("rooms.txt", format!("cell_m = 0.5\n{wall}\n{room}\n{room}\n{room}\n{wall}"));
    let report = scratch.map("check @rooms.txt --radius-m 0.2 --agents 2").unwrap();
    assert_eq!(value(&report, "reachable"), "100.0 % of the free cells, from the largest part with room");
    assert_eq!(value(&report, "leaks"), "none: the shell is closed");
    assert!(value(&report, "narrowest").starts_with("for bodies of radius 0.25 m and less at ("), "{report}");
    assert_eq!(value(&report, "advice"), "none: the map is sound for these bodies");
    assert_eq!(value(&report, "seen"), "100.0 % of the free cells, from there");
    let (report, result) = scratch.reported("check @rooms.txt --radius-m 0.4 --agents 200");
    let refused = "rooms.txt: 200 agents of radius 0.4 m find no starts; see the advice above";
    assert_eq!(result.unwrap_err(), refused);
    // The body stays in one room, and sees the other one through a gap of a cell.
    assert_eq!(value(&report, "reachable"), "16.0 % of the free cells, from the largest part with room");
    let seen: f64 = value(&report, "seen").split_once(' ').unwrap().0.parse().unwrap();
    assert!((51.0..=100.0).contains(&seen), "{report}");
    assert_eq!(value(&report, "advice"), "body.radius_m = 0.25 reaches 100.0 %");
    assert!(report.contains("fewer agents (agents.count)"), "{report}");

    scratch.write("open.txt", OPEN);
    let (report, _) = scratch.reported("check @open.txt");
    assert!(value(&report, "leaks").starts_with("1 free cells in the outermost layer: 1 at x = 0 (first at (0.50, "));
    assert!(value(&report, "parts").starts_with("2: 66.7 % from (0.50, 1.50, 1.50) m on, 33.3 % from "), "{report}");
}

#[test]
fn advice_names_options_of_the_format_only() {
    let scratch = Scratch::new();
    // Two rooms that are not connected, and a floor that is open at its sides.
    scratch.write("map.pgm", "P2 7 3 255 0 0 0 0 0 0 0 0 254 254 0 254 254 0 254 0 0 0 0 0 0");
    scratch.write("map.yaml", "image: map.pgm\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\n");
    scratch.write("rooms.xyz", "0 0 0\n4 0 0\n0 4 0\n4 4 4\n");
    scratch.write("open.txt", OPEN);
    for file in ["map.yaml", "map.pgm", "rooms.xyz", "open.txt"] {
        let (report, _) = scratch.reported(&format!("check @{file} --radius-m 0.9"));
        for option in ["free-from 1,1,1", "margin-cells 1", "cell-m 0.125"] {
            let flag = option.split(' ').next().unwrap();
            if report.contains(&format!("map.import.{}", flag.replace('-', "_")))
                || report.contains("shorter cells (map.cell_m)")
            {
                let refused = scratch.map(&format!("check @{file} --{option}")).err().unwrap_or_default();
                assert!(!refused.contains("is not an option") && !refused.contains("asked for"), "{file}: {refused}");
            }
        }
    }
    let (report, _) = scratch.reported("check @map.yaml --radius-m 0.9");
    assert!(report.contains("a run keeps the largest part of free space only\n"), "{report}");
    let (report, _) = scratch.reported("check @open.txt");
    assert!(report.contains("a run closes the outermost layer\n"), "{report}");
}

#[test]
fn a_folder_of_pictures_is_a_map() {
    let scratch = Scratch::new();
    fs::create_dir(scratch.path("scan")).unwrap();
    let refused = scratch.map("info @scan").unwrap_err();
    assert_eq!(refused, "scan: cannot be read: a folder without .png files; expected one for each layer of cells");
    let room = Grid::from_text("###\n#.#\n###\n").unwrap();
    for number in [9, 10] {
        scratch.write(&format!("scan/layer_{number}.png"), slices::png(&room).unwrap());
    }
    scratch.write("scan/notes.txt", "not a layer");
    let report = scratch.map("info @scan --cell-m 0.1").unwrap();
    assert_eq!(value(&report, "cell_m"), "0.1");
    assert!(value(&report, "layers").starts_with("2 from 9 to 10: "), "{report}");
    scratch.map("convert @scan @scan.m3dm --cell-m 0.1").unwrap();
    assert_eq!(value(&scratch.map("info @scan.m3dm").unwrap(), "blake3"), value(&report, "blake3"));
    scratch.write("scan/cover.png", slices::png(&room).unwrap());
    let refused = scratch.map("info @scan").unwrap_err();
    assert_eq!(refused, "scan: \"cover.png\": expected the number of a layer in its name");
}

#[test]
fn check_says_that_a_cave_is_solid_and_a_sensor_wrong() {
    let scratch = Scratch::new();
    let corner = |at: i32| format!("v {} {} {}\n", (at & 1) * 9, (at >> 1 & 1) * 8, (at >> 2) * 7);
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    let cave: String = (0..8).map(corner).collect();
    scratch.write("cave.obj", format!("{cave}{faces}"));
    let advice = "(--inside free) makes a cave of it";
    let report = scratch.map("check @cave.obj --cell-m 1 --inside free").unwrap();
    assert!(!report.contains(advice), "{report}");
    let report = scratch.map("check @cave.obj --cell-m 1 --margin-cells 2").unwrap();
    assert!(report.lines().any(|line| line.starts_with("advice") && line.contains(advice)), "{report}");
    let walls: String = (0..9)
        .flat_map(|x| (0..9).flat_map(move |y| (0..9).map(move |z| [x, y, z])))
        .filter(|place| place.iter().any(|along| along % 8 == 0))
        .map(|[x, y, z]| format!("{x} {y} {z}\n"))
        .collect();
    scratch.write("room.xyz", walls);
    let through = "% of the rays pass through cells with points";
    let inside = scratch.map("check @room.xyz --cell-m 1 --sensor 4,4,4").unwrap();
    assert!(!inside.contains(through), "{inside}");
    let outside = scratch.map("check @room.xyz --cell-m 1 --sensor -9,4,4").unwrap();
    assert!(outside.lines().any(|line| line.starts_with("advice") && line.contains(through)), "{outside}");
    assert!(!outside.contains("the map is sound"), "{outside}");
}
