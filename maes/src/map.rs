//! The commands `maes map generate|info|convert|check`.
//!
//! Results go to stdout. A command that fails has written no file: a file is complete under a
//! temporary name before it takes its own. Maps themselves are made and read in [`mapgen`]; here
//! are only files, options and words.

mod check;
mod error;
mod output;
mod picture;
pub(crate) mod reach;
mod slices;
mod spec;

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use protocol::body_model::BodyKind;
use voxels::{Extent, close_shell, free_components};

use map_files::{ImportSpec, Imported, Note};
use mapgen::{self, Built, ImportOptions, MapReport};

pub(crate) use error::MapCliError;
use foxglove_server::capture;
use output::{Encoding, Output, write_file};
use sim_server::cli::{assignment, of_key, whole};
use sim_server::map_file;
use slices::Slice;

/// Make, describe and convert maps.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub(crate) enum MapCommand {
    /// Make a map and write it to a file.
    Generate(GenerateArgs),
    /// Describe map files as they stand.
    Info(InfoArgs),
    /// Write a map in another format, with its shell closed and its pockets filled.
    Convert(ConvertArgs),
    /// Tell what agents could do in a map: what they reach, where it is narrow, where they can
    /// start.
    Check(CheckArgs),
}

/// Options of `map generate`.
#[derive(Debug, Clone, PartialEq, Args)]
pub(crate) struct GenerateArgs {
    /// How the map is made.
    #[arg(long, value_enum, default_value_t = MapKind::Spheres)]
    pub(crate) kind: MapKind,
    /// Cells along every axis, as one number or as XxYxZ.
    #[arg(long, value_name = "S|XxYxZ", value_parser = parse_size)]
    pub(crate) size: [u32; 3],
    /// Length of a cell's edge in metres, which every written file holds.
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    pub(crate) cell_m: f64,
    /// Seed of the map; without it one is drawn and printed.
    #[arg(long, value_name = "K", value_parser = of_key::<u64>("map.seed"))]
    pub(crate) seed: Option<u64>,
    /// Spheres: share of the volume to free [default: 0.2]. Noise: probability of wall [default:
    /// 0.53].
    #[arg(long, value_name = "SHARE")]
    pub(crate) fill: Option<f64>,
    /// Spheres: smallest radius and radius of tunnels, in cells [default: 3].
    #[arg(long, value_name = "CELLS", value_parser = of_key::<u32>("map.spheres.radius_min"))]
    pub(crate) radius_min: Option<u32>,
    /// Spheres: largest radius in cells [default: 8].
    #[arg(long, value_name = "CELLS", value_parser = of_key::<u32>("map.spheres.radius_max"))]
    pub(crate) radius_max: Option<u32>,
    /// Spheres: nearest spheres that each one is joined to [default: 3].
    #[arg(long, value_name = "N", value_parser = of_key::<u32>("map.spheres.connections"))]
    pub(crate) connections: Option<u32>,
    /// Smoothing passes [default: 5].
    #[arg(long, value_name = "N", value_parser = of_key::<u32>("map.spheres.smoothing"))]
    pub(crate) smoothing: Option<u32>,
    /// Any parameter of the kind of map by its name in a scenario, for instance floors=5; comes
    /// last.
    #[arg(long, value_name = "KEY=VALUE", value_parser = assignment)]
    pub(crate) set: Vec<(String, toml::Value)>,
    #[command(flatten)]
    pub(crate) encoding: Encoding,
    /// The file to write: .m3dm, .txt, .bt, .obj, .stl, .glb, .pcd or .yaml.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
}

/// The generators that need no file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MapKind {
    /// Random Connected Spheres.
    Spheres,
    /// Smoothed Noise.
    Noise,
    /// Floors of hallways and rooms; its parameters are set with --set.
    Building,
    /// Levels of drifts with crosscuts, stopes and a ramp; its parameters are set with --set.
    Mine,
    /// A place of the literature at true scale; which one is set with --set name=NAME.
    Scene,
}

/// Options of `map info`.
#[derive(Debug, Clone, PartialEq, Args)]
pub(crate) struct InfoArgs {
    /// Map files of any known format.
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Draw one layer of cells, for instance z=25.
    #[arg(long, value_name = "AXIS=K", value_parser = slices::parse, conflicts_with = "slices")]
    pub(crate) slice: Option<Slice>,
    /// Draw so many layers side by side, scaled to the terminal; 0: none [default: 3 on a terminal,
    /// else 0].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(0..=1024))]
    pub(crate) slices: Option<u32>,
    /// Write layers as a picture; only with one map file.
    #[arg(long, value_name = "FILE.png", value_parser = crate::recordings::png)]
    pub(crate) png: Option<PathBuf>,
    /// Length of a cell's edge in metres [default: that of the file, or 1].
    #[arg(long, value_name = "M")]
    pub(crate) cell_m: Option<f64>,
    /// How the files are read.
    #[command(flatten)]
    pub(crate) import: ImportOptions,
}

/// Options of `map convert`.
#[derive(Debug, Clone, PartialEq, Args)]
pub(crate) struct ConvertArgs {
    /// The map to read, of any known format.
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// The file to write: .m3dm, .txt, .bt, .obj, .stl, .glb, .pcd or .yaml.
    #[arg(value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Length of a cell's edge in metres [default: that of the file, or 1].
    #[arg(long, value_name = "M")]
    pub(crate) cell_m: Option<f64>,
    /// How the map is read.
    #[command(flatten)]
    pub(crate) import: ImportOptions,
    #[command(flatten)]
    pub(crate) encoding: Encoding,
    /// Leave the shell open where it is open, and the pockets.
    #[arg(long)]
    pub(crate) as_is: bool,
}

/// Options of `map check`.
#[derive(Debug, Clone, PartialEq, Args)]
pub(crate) struct CheckArgs {
    /// The map, of any known format.
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Radius of a body in metres, as body.radius_m [default: 0.4, or 16 cells if that is less]
    #[arg(long, value_name = "M")]
    pub(crate) radius_m: Option<f64>,
    /// body.kind.
    #[arg(long, value_enum, value_name = "KIND", default_value_t = BodyChoice::Submarine)]
    pub(crate) body: BodyChoice,
    /// body.step_max_m of a ground body [default: 0.1]
    #[arg(long, value_name = "M")]
    pub(crate) step_max_m: Option<f64>,
    /// body.slope_max_rad of a ground body [default: 0.35]
    #[arg(long, value_name = "RAD")]
    pub(crate) slope_max_rad: Option<f64>,
    /// Number of agents, as agents.count.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = whole::<u32>(1..=1000))]
    pub(crate) agents: u32,
    /// Let the page render the repaired map in three dimensions, with labels in metres.
    #[arg(long, value_name = "FILE.png", value_parser = crate::recordings::png)]
    pub(crate) picture: Option<PathBuf>,
    /// Size of the picture in pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = capture::size, requires = "picture")]
    pub(crate) picture_size: [u32; 2],
    /// Leave out of the picture what lies from this layer of cells on, for instance z=5.
    #[arg(long, value_name = "AXIS=K", value_parser = slices::parse, requires = "picture")]
    pub(crate) cut: Option<Slice>,
    /// The folder of the page [default: the one that was built here].
    #[arg(long, value_name = "DIR", requires = "picture")]
    pub(crate) page: Option<PathBuf>,
    /// Length of a cell's edge in metres [default: that of the file, or 1].
    #[arg(long, value_name = "M")]
    pub(crate) cell_m: Option<f64>,
    /// How the file is read.
    #[command(flatten)]
    pub(crate) import: ImportOptions,
}

/// The kinds of bodies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BodyChoice {
    /// Turns on the spot, then moves along its heading.
    Submarine,
    /// Moves in any direction.
    Aerial,
    /// Stands on the floor.
    Ground,
}

impl From<BodyChoice> for BodyKind {
    fn from(choice: BodyChoice) -> Self {
        match choice {
            BodyChoice::Submarine => Self::Submarine,
            BodyChoice::Aerial => Self::Aerial,
            BodyChoice::Ground => Self::Ground,
        }
    }
}

/// Runs a map command and prints its report on stdout. On an error no file has been written or
/// changed.
pub(crate) fn run(command: MapCommand) -> Result<(), MapCliError> {
    let columns = io::stdout().is_terminal().then(|| usize::from(console::Term::stdout().size().1));
    match run_to(command, columns, &mut io::stdout().lock()) {
        // A reader may stop reading the report, as `head` does.
        Err(MapCliError::Print(error)) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}

/// Runs a command; `columns` is the width of the terminal, if `out` is one.
fn run_to(command: MapCommand, columns: Option<usize>, out: &mut dyn Write) -> Result<(), MapCliError> {
    match command {
        MapCommand::Generate(args) => generate(&args, out),
        MapCommand::Info(args) => info(&args, columns, out),
        MapCommand::Convert(args) => convert(&args, out),
        MapCommand::Check(args) => check::check(&args, out),
    }
}

fn generate(args: &GenerateArgs, out: &mut dyn Write) -> Result<(), MapCliError> {
    let output = Output::new(&args.output, args.encoding)?;
    output.check_replaced(None)?;
    let extent = Extent::new(args.size, args.cell_m)?;
    let spec = spec::of(args)?;
    spec.check(extent)?;
    let seed = match args.seed {
        Some(seed) => seed,
        // 32 bits are enough for maps to differ, and short enough to be typed again.
        None => getrandom::u32().map_err(MapCliError::Seed)?.into(),
    };
    let map = mapgen::generate(&spec, extent, seed)?;
    let notes = output.write(&map.terrain, [0.0; 3], 0.0)?;

    let mut report = Report::new(out);
    report.line("file", args.output.display())?;
    report.line("seed", seed)?;
    let [x_m, y_m, z_m] = extent.size().map(|cells| f64::from(cells) * extent.cell_m());
    report.line("size", format_args!("{} ({x_m} m x {y_m} m x {z_m} m)", by(extent)))?;
    report.line("cell_m", extent.cell_m())?;
    report.written(&notes)?;
    report.cells(extent, map.report.free_cells)?;
    if let Some(carved) = map.report.carved {
        report.line("spheres", carved.spheres)?;
        report.line("tunnels", carved.tunnels)?;
    }
    if let Some(built) = map.report.built {
        let Built { floors, rooms, doors, staircases, lift_shafts, entrances } = built;
        report.line("building", format_args!("{floors} floor(s), {rooms} room(s), {doors} door(s)"))?;
        report.line("ways up", format_args!("{staircases} staircase(s), {lift_shafts} lift shaft(s)"))?;
        report.line("entrances", entrances)?;
    }
    report.repairs(&map.report)?;
    report.line("blake3", mapgen::terrain_hash(&map.terrain))
}

fn info(args: &InfoArgs, columns: Option<usize>, out: &mut dyn Write) -> Result<(), MapCliError> {
    if let (Some(file), count @ 2..) = (&args.png, args.files.len()) {
        return Err(MapCliError::OnePicture { file: file.clone(), count });
    }
    let count = args.slices.unwrap_or(if columns.is_some() && args.slice.is_none() { slices::SHOWN } else { 0 });
    for (index, file) in args.files.iter().enumerate() {
        if index > 0 {
            writeln!(out)?;
        }
        let imported = import(file, &args.import, args.cell_m)?.read()?;
        let slice = args.slice.map(|slice| slice.draw(&imported.terrain, file)).transpose()?;
        if let Some(picture) = &args.png {
            let pixels = slices::png(&imported.terrain);
            let pixels = pixels.map_err(|reason| MapCliError::Picture { file: picture.clone(), reason })?;
            write_file(picture, &pixels)?;
        }
        describe(file, &imported, args.cell_m, out)?;
        if let Some(slice) = slice {
            write!(out, "\n{slice}")?;
        }
        if count > 0 {
            write!(out, "\n{}", slices::overview(&imported.terrain, count, columns.unwrap_or(slices::COLUMNS)))?;
        }
    }
    Ok(())
}

/// A map file to read.
pub(crate) fn import(file: &Path, options: &ImportOptions, cell_m: Option<f64>) -> Result<ImportSpec, MapCliError> {
    let spec = map_file::load(file, options);
    let spec = spec.map_err(|reason| MapCliError::Read { file: file.to_path_buf(), reason })?;
    Ok(ImportSpec { cell_m, ..spec })
}

fn describe(file: &Path, imported: &Imported, asked: Option<f64>, out: &mut dyn Write) -> Result<(), MapCliError> {
    let Imported { terrain, notes, .. } = imported;
    let extent = terrain.extent();
    let components = free_components(terrain);
    let open = close_shell(&mut terrain.clone(), 1);
    let mut report = Report::new(out);
    report.line("file", file.display())?;
    report.line("size", by(extent))?;
    report.cell_m(imported, asked)?;
    report.notes(notes)?;
    report.cells(extent, mapgen::free_cells(terrain))?;
    match components.sizes.as_slice() {
        sizes @ ([] | [_]) => report.line("components", sizes.len())?,
        sizes => {
            let largest = sizes.iter().max().copied().unwrap_or_default();
            report.line("components", format_args!("{} (the largest has {largest} cells)", sizes.len()))?;
        }
    }
    match open {
        0 => report.line("shell", "closed")?,
        _ => report.line("shell", format_args!("open ({open} free cells in the outermost layer)"))?,
    }
    report.line("blake3", mapgen::terrain_hash(terrain))
}

fn convert(args: &ConvertArgs, out: &mut dyn Write) -> Result<(), MapCliError> {
    let output = Output::new(&args.output, args.encoding)?;
    output.check_replaced(Some(&args.input))?;
    let spec = import(&args.input, &args.import, args.cell_m)?;
    let mut imported = spec.read()?;
    let extent = imported.terrain.extent();
    let repairs = if args.as_is {
        None
    } else {
        // Of an import, the seed is part of the report alone.
        let map = mapgen::repair(&spec.file, imported.terrain, 0)?;
        imported.terrain = map.terrain;
        Some(map.report)
    };
    let notes = output.write(&imported.terrain, imported.origin_m.unwrap_or_default(), imported.yaw_rad)?;

    let mut report = Report::new(out);
    report.line("file", args.output.display())?;
    report.line("size", by(extent))?;
    report.cell_m(&imported, args.cell_m)?;
    report.notes(&imported.notes)?;
    report.written(&notes)?;
    report.cells(extent, mapgen::free_cells(&imported.terrain))?;
    match &repairs {
        Some(repairs) => report.repairs(repairs)?,
        None => report.line("repairs", "none (--as-is)")?,
    }
    report.line("blake3", mapgen::terrain_hash(&imported.terrain))
}

/// Aligned lines of a name and a value.
struct Report<'a> {
    out: &'a mut dyn Write,
}

impl<'a> Report<'a> {
    fn new(out: &'a mut dyn Write) -> Self {
        Self { out }
    }

    fn line(&mut self, name: &str, value: impl Display) -> Result<(), MapCliError> {
        Ok(writeln!(self.out, "{name:<11}{value}")?)
    }

    /// The length of cells, and whether anybody has said it.
    fn cell_m(&mut self, imported: &Imported, asked: Option<f64>) -> Result<(), MapCliError> {
        let cell_m = imported.terrain.extent().cell_m();
        match (imported.stores_cell_m, asked) {
            (false, None) => self.line("cell_m", format_args!("{cell_m} (the file has none; --cell-m sets it)")),
            _ => self.line("cell_m", cell_m),
        }
    }

    /// What a file was written with, or does not hold.
    fn written(&mut self, notes: &[(&str, String)]) -> Result<(), MapCliError> {
        notes.iter().try_for_each(|(name, text)| self.line(name, text))
    }

    fn notes(&mut self, notes: &[Note]) -> Result<(), MapCliError> {
        notes.iter().try_for_each(|note| self.line(note.name, &note.text))
    }

    fn cells(&mut self, extent: Extent, free: u64) -> Result<(), MapCliError> {
        let volume = extent.volume();
        self.line("cells", volume)?;
        self.line("free", format_args!("{free} ({:.2} %)", 100.0 * free as f64 / volume as f64))
    }

    fn repairs(&mut self, map: &MapReport) -> Result<(), MapCliError> {
        self.line("shell", format_args!("closed ({} free cells filled)", map.shell_cells_closed))?;
        let MapReport { pockets_removed, pocket_cells_removed, .. } = map;
        self.line("pockets", format_args!("{pockets_removed} filled ({pocket_cells_removed} cells)"))
    }
}

fn by(extent: Extent) -> String {
    let [x, y, z] = extent.size();
    format!("{x}x{y}x{z}")
}

fn parse_size(text: &str) -> Result<[u32; 3], String> {
    let sides: Result<Vec<u32>, _> = text.split('x').map(str::parse).collect();
    match sides.as_deref() {
        Ok(&[side]) => Ok([side; 3]),
        Ok(&[x, y, z]) => Ok([x, y, z]),
        _ => Err("a size is one number of cells, or three as in 50x40x30".to_owned()),
    }
}

#[cfg(test)]
mod tests;
