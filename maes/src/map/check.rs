//! `maes map check`: what agents could do in a map.
//!
//! The map is repaired as a run repairs it. What a body sees from the places that it reaches
//! ([`super::reach`]) no team of such bodies can exceed.

use std::f64::consts::FRAC_PI_4;
use std::io::Write;

use mapgen::repair;
use protocol::body_model::{BodyKind, BodyModel};
use voxels::clearance::REACH_CELLS;
use voxels::{Clearance, Components, Extent, Grid, Passage, Terrain, close_shell, free_components};
use world::attainable::{Attainable, Bodies, standing_parts};
use world::lidar::{Pattern, Scanner};
use world::spawn::{Site, SpawnSpec};

use super::reach::{Reach, radius_max_m};
use super::{BodyChoice, CheckArgs, MapCliError, Report, by, import, picture};

/// Share of the free cells that a part behind a passage has at least.
const PART: f64 = 0.01;

/// Share of the free cells that is enough to be called reachable.
const ENOUGH: f64 = 0.95;

/// Rays of the LiDAR that sees the map: as many as that of MAES3D.
const RAYS: u32 = 5124;

/// Most parts and passages that a report names.
const SHOWN: usize = 3;

/// Seed of the starts that are tried.
const SEED: u64 = 1;

/// Describes a map for bodies of one radius.
pub(super) fn check(args: &CheckArgs, out: &mut dyn Write) -> Result<(), MapCliError> {
    let spec = import(&args.file, &args.import, args.cell_m)?;
    let imported = spec.read()?;
    let extent = imported.terrain.extent();
    let model = body_model(args, extent.cell_m())?;
    let radius_m = model.radius_m;
    let mut advice = Vec::new();
    let mut report = Report::new(out);
    report.line("file", args.file.display())?;
    report.line("size", by(extent))?;
    report.cell_m(&imported, args.cell_m)?;
    report.notes(&imported.notes)?;
    if !imported.stores_cell_m && args.cell_m.is_none() {
        advice.push("give the length of a cell: map.cell_m (--cell-m)".to_owned());
    }
    advice.extend(imported.notes.iter().filter(|note| note.is_warning).map(|note| note.text.clone()));
    let has_option = |name: &str| spec.options_of_format().contains(&name);
    if leaks(&mut report, &imported.terrain)? {
        let kept = "; map.import.margin_cells keeps free space of a mesh or cloud";
        let kept = if has_option("margin_cells") { kept } else { "" };
        advice.push(format!("a run closes the outermost layer{kept}"));
    }
    if parts(&mut report, &free_components(&imported.terrain), extent)? {
        let kept = if has_option("free_from") { "; map.import.free_from keeps another one" } else { "" };
        advice.push(format!("a run keeps the largest part of free space only{kept}"));
    }

    let terrain = repair(&spec.file, imported.terrain, 0)?.terrain;
    let free = mapgen::free_cells(&terrain);
    report.cells(extent, free)?;
    let body_on = |clearance: &Clearance, radius_m: f64| Reach::new(clearance, radius_m / extent.cell_m(), free);
    let body = |radius_m: f64| body_on(&Clearance::for_body(radius_m, &terrain), radius_m);
    let clearance = Clearance::for_body(radius_m, &terrain);
    let here = body_on(&clearance, radius_m);
    let (room, reached) = (100.0 * here.fits(), 100.0 * here.reached());
    report.line("body", format_args!("radius {radius_m} m: fits in {room:.1} % of the free cells"))?;
    report.line("reachable", format_args!("{reached:.1} % of the free cells, from the largest part with room"))?;
    let scanner = Scanner::new(Pattern::Lattice { rays: RAYS }, f64::INFINITY, std::f64::consts::TAU);
    let start = match model.kind {
        BodyKind::Ground => floor(&mut report, &terrain, &model)?,
        BodyKind::Submarine | BodyKind::Aerial => here.start().map(|index| extent.cell_at(index)),
    };
    let bodies = Bodies { model, sensors: scanner.into(), starts: start.into_iter().collect() };
    let seen = Attainable::of(&terrain, &[bodies]);
    report.line("seen", format_args!("{:.1} % of the free cells, from there", 100.0 * seen.seen_share()))?;
    // Where bodies of this size are in a cell decides which passages are narrow for them.
    let passages = clearance.passages(((PART * free as f64) as usize).max(1));
    narrow(&mut report, &passages, extent)?;
    if here.reached() < ENOUGH {
        let half_m = extent.cell_m() / 2.0;
        let narrow = passages.iter().map(|passage| passage.radius_cells * extent.cell_m());
        let mut radii_m: Vec<f64> = narrow.chain([half_m]).filter(|&narrow_m| narrow_m < radius_m).collect();
        radii_m.sort_by(f64::total_cmp);
        radii_m.dedup();
        // A smaller body reaches no less.
        let count = radii_m.partition_point(|&radius_m| body(radius_m).reached() >= ENOUGH);
        advice.push(if let Some(&radius_m) = radii_m[..count].last() {
            let share = 100.0 * body(radius_m).reached();
            format!("body.radius_m = {} reaches {share:.1} %", in_millimetres(radius_m))
        } else {
            let share = 100.0 * body(half_m).reached();
            // Only what is made of points and triangles can be divided into shorter cells.
            let remedy = if has_option("scale") {
                "shorter cells (map.cell_m) tell narrow passages apart"
            } else {
                "a file with shorter cells would tell narrow passages apart"
            };
            format!("a body of half a cell reaches {share:.1} %: {remedy}")
        });
    }
    let has_starts = starts(&mut report, &terrain, (args.agents, model), &mut advice)?;
    if advice.is_empty() {
        report.line("advice", "none: the map is sound for these bodies")?;
    }
    advice.iter().try_for_each(|text| report.line("advice", text))?;
    if let Some(file) = &args.picture {
        picture::draw(&terrain, args, file)?;
        report.line("picture", file.display())?;
    }
    if has_starts {
        return Ok(());
    }
    Err(MapCliError::NoStart { file: args.file.clone(), agents: args.agents, radius_m })
}

/// The body that the flags describe.
///
/// # Errors
/// [`MapCliError::OutOfRange`] or [`MapCliError::NotForBody`].
fn body_model(args: &CheckArgs, cell_m: f64) -> Result<BodyModel, MapCliError> {
    let kind = BodyModel::of(args.body.into());
    let most_m = radius_max_m(cell_m);
    let within_reach = format!("{most_m} m, {REACH_CELLS} cells");
    let climbs = [
        ("--step-max-m", args.step_max_m, most_m, format!("0 to {within_reach}")),
        ("--slope-max-rad", args.slope_max_rad, FRAC_PI_4, format!("0 to {FRAC_PI_4} rad")),
    ];
    for (flag, value, most, allowed) in climbs {
        let Some(value) = value else { continue };
        if args.body != BodyChoice::Ground {
            return Err(MapCliError::NotForBody { flag });
        }
        if !(0.0..=most).contains(&value) {
            return Err(MapCliError::OutOfRange { flag, value, allowed });
        }
    }
    let radius_m = args.radius_m.unwrap_or(kind.radius_m.min(most_m));
    if !(radius_m > 0.0 && radius_m <= most_m) {
        let allowed = format!("above 0 to {within_reach}");
        return Err(MapCliError::OutOfRange { flag: "--radius-m", value: radius_m, allowed });
    }
    let step_max_m = args.step_max_m.unwrap_or(kind.step_max_m);
    let slope_max_rad = args.slope_max_rad.unwrap_or(kind.slope_max_rad);
    Ok(BodyModel { radius_m, step_max_m, slope_max_rad, ..kind })
}

/// Reports where a ground body stands and what it reaches; returns a cell of the largest part.
fn floor(
    report: &mut Report<'_>,
    terrain: &Grid<Terrain>,
    model: &BodyModel,
) -> Result<Option<voxels::Cell>, MapCliError> {
    let parts = standing_parts(terrain, model);
    let stands: usize = parts.iter().map(|part| part.cells).sum();
    let largest = parts.iter().max_by_key(|part| part.cells);
    let share = 100.0 * largest.map_or(0.0, |part| part.cells as f64 / stands as f64);
    let BodyModel { step_max_m, slope_max_rad, .. } = model;
    report.line(
        "floor",
        format_args!(
            "a ground body stands in {stands} cells; with steps of {step_max_m} m and slopes of {slope_max_rad} rad it reaches \
             {share:.1} % of them, from the largest of {} parts",
            parts.len()
        ),
    )?;
    Ok(largest.map(|part| part.first))
}

/// A length in metres, rounded down to millimetres so that it still fits.
fn in_millimetres(length_m: f64) -> f64 {
    (length_m * 1000.0).floor() / 1000.0
}

/// Free cells in the outermost layer, by side. Returns whether there are any.
fn leaks(report: &mut Report<'_>, terrain: &Grid<Terrain>) -> Result<bool, MapCliError> {
    let open = close_shell(&mut terrain.clone(), 1);
    if open == 0 {
        report.line("leaks", "none: the shell is closed")?;
        return Ok(false);
    }
    let extent = terrain.extent();
    let last = extent.size().map(|cells| cells as i32 - 1);
    let sides = [
        ("x = 0", 0, 0),
        ("x = max", 0, last[0]),
        ("y = 0", 1, 0),
        ("y = max", 1, last[1]),
        ("z = 0", 2, 0),
        ("z = max", 2, last[2]),
    ];
    let mut found = Vec::new();
    for (name, axis, at) in sides {
        let is_there = |cell: voxels::Cell| [cell.x, cell.y, cell.z][axis] == at;
        let mut cells =
            terrain.iter().filter(|&(cell, &here)| here == Terrain::Free && is_there(cell)).map(|(cell, _)| cell);
        if let Some(first) = cells.next() {
            found.push(format!("{} at {name} (first at {})", 1 + cells.count(), place(extent, first)));
        }
    }
    report.line("leaks", format_args!("{open} free cells in the outermost layer: {}", found.join(", ")))?;
    Ok(true)
}

/// The connected parts of free space, the largest first. Returns whether the others are more than a
/// trifle.
fn parts(report: &mut Report<'_>, components: &Components, extent: Extent) -> Result<bool, MapCliError> {
    let mut order: Vec<usize> = (0..components.sizes.len()).collect();
    order.sort_by_key(|&part| std::cmp::Reverse(components.sizes[part]));
    let all: usize = components.sizes.iter().sum();
    let shown: Vec<String> = order
        .iter()
        .take(SHOWN)
        .map(|&part| {
            let share = 100.0 * components.sizes[part] as f64 / all as f64;
            format!("{share:.1} % from {} on", place(extent, extent.cell_at(components.firsts[part])))
        })
        .collect();
    report.line("parts", format_args!("{}: {}", order.len(), shown.join(", ")))?;
    let largest = order.first().map_or(0, |&part| components.sizes[part]);
    Ok((largest as f64) < ENOUGH * all as f64)
}

/// The narrowest passages.
fn narrow(report: &mut Report<'_>, passages: &[Passage], extent: Extent) -> Result<(), MapCliError> {
    if passages.is_empty() {
        return report.line("narrowest", "none: one part of free space without narrow passages");
    }
    for passage in passages.iter().take(SHOWN) {
        let at_most_m = in_millimetres(passage.radius_cells * extent.cell_m());
        let text = format!(
            "for bodies of radius {at_most_m} m and less at {}, with {} free cells behind it",
            place(extent, passage.cell),
            passage.cells_behind
        );
        report.line("narrowest", text)?;
    }
    Ok(())
}

/// Where the team finds starts. Returns whether it does in some way.
fn starts(
    report: &mut Report<'_>,
    terrain: &Grid<Terrain>,
    (agents, model): (u32, BodyModel),
    advice: &mut Vec<String>,
) -> Result<bool, MapCliError> {
    let team = vec![model; agents as usize];
    let site = Site { terrain, entrances: &[], seed: SEED };
    let scattered = SpawnSpec::Scattered { min_distance_m: 0.0, seed: None, yaw_rad: 0.0 };
    let nearest = SpawnSpec::NearestOrigin { yaw_rad: 0.0 };
    let mut has_starts = false;
    for (name, spawn) in [("nearest_origin", nearest), ("scattered", scattered)] {
        match spawn.poses(&site, &team) {
            Ok(_) => {
                has_starts = true;
                report.line("starts", format_args!("spawn.kind = {name:?}: {agents} agents fit"))?;
            }
            Err(error) => {
                report.line("starts", format_args!("spawn.kind = {name:?}: {error}"))?;
                if name == "scattered" {
                    advice.push("fewer agents (agents.count) or smaller ones (body.radius_m) find starts".to_owned());
                }
            }
        }
    }
    Ok(has_starts)
}

/// The centre of a cell, metres.
fn place(extent: Extent, cell: voxels::Cell) -> String {
    let centre = extent.centre(cell);
    format!("({:.2}, {:.2}, {:.2}) m", centre.x, centre.y, centre.z)
}
