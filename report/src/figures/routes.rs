//! Pictures of routes: the map of a run of each variant from above, and where its bodies went.

use std::collections::BTreeMap;
use std::fmt::Write;

use msgs::ids::AgentId;
use recording::routes::Route;

use super::super::floor_plan::FloorPlan;
use super::super::marks::{Mark, WHITE, draw_end, draw_start, route_pen};
use super::super::plot::{Drawn, EDGE, NORMAL, SMALL, draw_head, round_length};
use super::super::svg::{Anchor, Area, INK, Label, Paint, Pen, SOFT, Section, Svg};
use super::{Figure, columns};

/// Widths of a plan, for one column, two, and more, pixels.
const WIDTHS: [f64; 3] = [480.0, 340.0, 250.0];
/// Height of a plan relative to its width, at most.
const TALLNESS_MAX: f64 = 1.4;
/// Space between two plans, pixels.
const GAP: f64 = 24.0;
/// Height of the two lines above a plan, and of the scale bar below it, pixels.
const TITLE: f64 = 40.0;
const FOOT: f64 = 30.0;
/// Most agents that have an entry of their own in the legend.
const NAMED_MAX: usize = 20;
/// A corner of a route that is nearer than this to the line without it is left out, pixels.
const TOLERANCE: f64 = 0.2;
/// Solid rock, and from the least open columns of the map to the most open ones.
const ROCK: Paint = Paint { colour: "#d3d7dc", class: "" };
const OPEN: [Paint; 4] = [
    Paint { colour: "#e4e7ea", class: "" },
    Paint { colour: "#eef0f2", class: "" },
    Paint { colour: "#f7f8f9", class: "" },
    WHITE,
];
/// The line around what is open.
const OUTLINE: Pen = Pen { paint: Paint { colour: "#6b747e", class: "" }, width: 0.7, dash: "", opacity: 1.0 };

/// The routes of a run, on its map.
#[derive(Debug)]
pub(in super::super) struct RoutesOfRun {
    pub(in super::super) variant: String,
    /// What run it is, in one line.
    pub(in super::super) about: String,
    pub(in super::super) plan: FloorPlan,
    pub(in super::super) routes: BTreeMap<AgentId, Route>,
}

/// The picture of a panel. `name` is the stem of its files, `panel` what it has in common.
pub(in super::super) fn picture(name: &str, panel: &str, runs: &[RoutesOfRun]) -> Figure {
    let agents = runs.iter().flat_map(|run| run.routes.keys()).map(|agent| agent.0 as usize).max().unwrap_or(0) + 1;
    let mut legend: Vec<(Mark, String)> =
        (0..agents.min(NAMED_MAX)).map(|agent| (Mark::Route(agent), format!("agent {agent}"))).collect();
    legend.extend([(Mark::Start, "start".to_owned()), (Mark::End, "end".to_owned())]);
    let title = if panel.is_empty() { "Routes".to_owned() } else { format!("Routes: {panel}") };
    let caption = "The routes of the bodies of one run of each variant, from above, x to the right and y upwards: of \
                   the run with the median of the primary measure, the lower one of an even number, among those that \
                   have not failed. The map is that at the start of the run, between the lowest and the highest place \
                   of a body: the more cells of a column are free, the lighter it is. All plans have one scale.";
    let note = "one run of each variant, from above: the median of the primary measure";
    let drawn = draw(name, &title, note, &legend, runs);
    Figure { name: name.to_owned(), title, caption: caption.to_owned(), legend, is_by_variant: false, drawn }
}

fn draw(name: &str, title: &str, note: &str, legend: &[(Mark, String)], runs: &[RoutesOfRun]) -> Drawn {
    let columns = columns(runs.len());
    let width = WIDTHS[columns.min(WIDTHS.len()) - 1];
    let sizes_m: Vec<[f64; 2]> = runs.iter().map(|run| size_m(&run.plan)).collect();
    let longest_m = |axis: usize| sizes_m.iter().map(|size_m| size_m[axis]).fold(0.0, f64::max);
    let scale = (width / longest_m(0)).min(width * TALLNESS_MAX / longest_m(1));
    let height = longest_m(1) * scale;
    let mut svg = Svg::new(name);
    let full_width = 2.0 * EDGE + columns as f64 * (width + GAP) - GAP;
    let head = draw_head(&mut svg, title, note, legend, full_width);
    let mut body = svg.take();
    let mut panels = Vec::new();
    for (number, run) in runs.iter().enumerate() {
        let (column, row) = (number % columns, number / columns);
        let area = Area {
            left: EDGE + column as f64 * (width + GAP),
            top: head + row as f64 * (TITLE + height + FOOT),
            width,
            height: TITLE + height + FOOT,
        };
        draw_run(&mut svg, run, area, scale);
        let drawn = svg.take();
        let title = format!("Routes of {}: {}", run.variant, run.about);
        panels.push(Svg::section(&drawn, Section { area, title: &title, data: "" }));
        body.push_str(&drawn);
    }
    let rows = runs.len().div_ceil(columns) as f64;
    svg.append(&body);
    let full_height = head + rows * (TITLE + height + FOOT) + EDGE;
    Drawn { svg: svg.finish(full_width, full_height, title), panels }
}

/// The lengths of the open part of a plan along x and y, m.
fn size_m(plan: &FloorPlan) -> [f64; 2] {
    plan.open_part().map(|squares| (squares.end() + 1 - squares.start()) as f64 * plan.side_m())
}

/// Draws title, plan, routes and scale bar of a run; `scale` is in pixels for each metre.
fn draw_run(svg: &mut Svg, run: &RoutesOfRun, area: Area, scale: f64) {
    let line = |text, size| Label::new(text, size, Anchor::Start);
    svg.text_within(
        (area.left, area.top + NORMAL + 3.0),
        Label { bold: true, ..line(&run.variant, NORMAL) },
        area.width,
    );
    let about = Label { paint: SOFT, ..line(&run.about, SMALL) };
    svg.text_within((area.left, area.top + NORMAL + SMALL + 9.0), about, area.width);
    let [width, height] = size_m(&run.plan).map(|length_m| length_m * scale);
    let map = Area { left: area.left, top: area.top + TITLE, width, height };
    let side = run.plan.side_m() * scale;
    let [first_x, first_y] = run.plan.open_part().map(|squares| *squares.start() as f64 * side);
    // The place of the corner of the map at 0, 0.
    let origin = (map.left - first_x, map.top + map.height + first_y);
    svg.fill(map, ROCK, 1.0);
    for (level, paint) in OPEN.into_iter().enumerate() {
        let mut line = String::new();
        for outline in run.plan.outlines(level as f64 / OPEN.len() as f64) {
            for (number, [x, y]) in outline.into_iter().enumerate() {
                let command = if number == 0 { 'M' } else { 'L' };
                write!(line, "{command}{x} {y}").expect("a String can be written");
            }
            line.push('z');
        }
        svg.area(&line, origin, (side, -side), paint, (level == 0).then_some(OUTLINE));
    }
    let at = |[x, y, _]: [f64; 3]| (origin.0 + x * scale, origin.1 - y * scale);
    for (agent, route) in &run.routes {
        for part in route {
            let points: Vec<(f64, f64)> = part.iter().map(|position| at(*position)).collect();
            svg.polyline(&thinned(&points), &route_pen(agent.0 as usize));
        }
    }
    for (agent, route) in &run.routes {
        let ends = (route.first().and_then(|part| part.first()), route.last().and_then(|part| part.last()));
        if let (Some(start), Some(end)) = ends {
            draw_start(svg, route_pen(agent.0 as usize).paint, at(*start));
            draw_end(svg, route_pen(agent.0 as usize).paint, at(*end));
        }
    }
    draw_scale_bar(svg, (map.left, map.top + map.height + 10.0), scale, width.min(area.width));
}

/// A bar of a round length of at most a third of `width`, pixels, with that length.
fn draw_scale_bar(svg: &mut Svg, (x, y): (f64, f64), scale: f64, width: f64) {
    let length_m = round_length(width / 3.0 / scale);
    let end = x + length_m * scale;
    let pen = Pen::solid(INK, 1.2);
    svg.line((x, y), (end, y), &pen);
    for place in [x, end] {
        svg.line((place, y - 3.0), (place, y + 3.0), &pen);
    }
    svg.text((end + 6.0, y + 0.36 * SMALL), &Label::new(&format!("{length_m} m"), SMALL, Anchor::Start));
}

/// The points of a line without those that hardly bend it (Douglas and Peucker, 1973).
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut is_kept = vec![false; points.len()];
    let mut spans = vec![(0, points.len().saturating_sub(1))];
    for end in [0, points.len().saturating_sub(1)] {
        is_kept.iter_mut().skip(end).take(1).for_each(|kept| *kept = true);
    }
    while let Some((first, last)) = spans.pop() {
        let off = |index: usize| distance_squared(points[index], points[first], points[last]);
        let farthest = (first + 1..last).max_by(|one, other| off(*one).total_cmp(&off(*other)));
        if let Some(farthest) = farthest.filter(|index| off(*index) > TOLERANCE * TOLERANCE) {
            is_kept[farthest] = true;
            spans.extend([(first, farthest), (farthest, last)]);
        }
    }
    points.iter().zip(is_kept).filter_map(|(point, kept)| kept.then_some(*point)).collect()
}

/// The square of the distance of a point from a segment.
fn distance_squared((x, y): (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (along_x, along_y) = (to.0 - from.0, to.1 - from.1);
    let length_squared = along_x * along_x + along_y * along_y;
    let dot = (x - from.0) * along_x + (y - from.1) * along_y;
    let share = if length_squared > 0.0 { (dot / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    let (off_x, off_y) = (x - from.0 - share * along_x, y - from.1 - share * along_y);
    off_x * off_x + off_y * off_y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinned_lines_keep_their_corners() {
        let corner = [(0.0, 0.0), (1.0, 0.05), (2.0, 0.0), (2.0, 1.0), (2.0, 2.0)];
        assert_eq!(thinned(&corner), [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)]);
        // There and back: the turning point stays.
        assert_eq!(thinned(&[(0.0, 0.0), (5.0, 0.0), (0.0, 0.0)]).len(), 3);
        assert_eq!(thinned(&[(1.0, 1.0)]), [(1.0, 1.0)]);
        assert!(thinned(&[]).is_empty());
    }
}
