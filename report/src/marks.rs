//! Colours, dashes and symbols of the series of figures, and their samples in legends.

use super::svg::{Area, INK, Paint, Pen, SOFT, Svg};

/// The ground of maps, on every background of a page.
pub(super) const WHITE: Paint = Paint { colour: "#ffffff", class: "" };
/// Length of a line sample in the legend, pixels.
pub(super) const SAMPLE: f64 = 34.0;

/// Colours for all types of colour vision (Okabe and Ito, "Color Universal Design", 2008), without
/// their yellow, which is too light for lines on white; their black follows the background.
const COLOURS: [Paint; 7] = [
    Paint { colour: "#0072b2", class: "blue" },
    Paint { colour: "#d55e00", class: "vermillion" },
    Paint { colour: "#009e73", class: "green" },
    Paint { colour: "#cc79a7", class: "" },
    Paint { colour: "#e69f00", class: "" },
    Paint { colour: "#56b4e9", class: "" },
    INK,
];
/// Dashes and gaps, pixels. Their number is coprime with that of the colours: 35 styles differ.
const DASHES: [&str; 5] = ["", "7 3", "2 2.5", "9 3 2 3", "13 4"];

pub(super) fn colour(index: usize) -> Paint {
    COLOURS[index % COLOURS.len()]
}

pub(super) fn pen(index: usize) -> Pen {
    Pen { dash: DASHES[index % DASHES.len()], ..Pen::solid(colour(index), 2.0) }
}

/// The symbol of a legend entry, for the series of an index.
#[derive(Debug, Clone, Copy)]
pub(super) enum Mark {
    /// Its line, with a band around it.
    Band(usize),
    /// Its line.
    Line(usize),
    /// Its colour.
    Box(usize),
    /// Its colour and shape.
    Point(usize),
    /// The line of an agent's route.
    Route(usize),
    /// Where a route starts.
    Start,
    /// Where a route ends.
    End,
}

/// The line of the route of an agent, in a colour that does not follow the background of a page:
/// maps are white. First all colours, then all dashes.
pub(super) fn route_pen(agent: usize) -> Pen {
    let paint = Paint { class: "", ..colour(agent) };
    Pen { dash: DASHES[agent / COLOURS.len() % DASHES.len()], opacity: 0.9, ..Pen::solid(paint, 1.3) }
}

/// The symbol of a legend entry as an image of its own, for a page.
pub(super) fn swatch(mark: Mark) -> String {
    let place = Area { left: 0.0, top: 0.0, width: SAMPLE, height: 10.0 };
    let mut svg = Svg::new("");
    draw_mark(&mut svg, mark, place);
    format!("<svg aria-hidden=\"true\" width=\"{SAMPLE}\" height=\"10\">\n{}</svg>", svg.take())
}

pub(super) fn draw_mark(svg: &mut Svg, mark: Mark, place: Area) {
    let Area { left, top, width, height } = place;
    let middle = top + height / 2.0;
    match mark {
        Mark::Box(series) => {
            svg.fill(place, colour(series), 0.35);
            svg.frame(place, &Pen::solid(colour(series), 1.5));
        }
        Mark::Point(series) => draw_point(svg, series, (left + width / 2.0, middle)),
        Mark::Route(agent) => svg.line((left, middle), (left + width, middle), &route_pen(agent)),
        Mark::Start => draw_start(svg, SOFT, (left + width / 2.0, middle)),
        Mark::End => draw_end(svg, SOFT, (left + width / 2.0, middle)),
        Mark::Line(series) => svg.line((left, middle), (left + width, middle), &pen(series)),
        Mark::Band(series) => {
            svg.fill(place, colour(series), 0.2);
            svg.line((left, middle), (left + width, middle), &pen(series));
        }
    }
}

/// Draws the point of a series: discs in all colours, then squares, diamonds and triangles.
pub(super) fn draw_point(svg: &mut Svg, series: usize, (x, y): (f64, f64)) {
    let paint = colour(series);
    let corners: &[(f64, f64)] = match series / COLOURS.len() % 4 {
        0 => return svg.disc((x, y), 4.0, paint, 1.0),
        1 => &[(-3.7, -3.7), (3.7, -3.7), (3.7, 3.7), (-3.7, 3.7)],
        2 => &[(0.0, -5.2), (5.2, 0.0), (0.0, 5.2), (-5.2, 0.0)],
        _ => &[(0.0, -5.0), (4.8, 3.6), (-4.8, 3.6)],
    };
    let corners: Vec<_> = corners.iter().map(|(right, down)| (x + right, y + down)).collect();
    svg.polygon(&corners, paint, 1.0);
}

/// Draws the ring where a route starts.
pub(super) fn draw_start(svg: &mut Svg, paint: Paint, at: (f64, f64)) {
    svg.disc(at, 3.8, paint, 1.0);
    svg.disc(at, 2.2, WHITE, 1.0);
}

/// Draws the disc where a route ends, which stands out from the lines around it.
pub(super) fn draw_end(svg: &mut Svg, paint: Paint, at: (f64, f64)) {
    svg.disc(at, 4.4, WHITE, 1.0);
    svg.disc(at, 3.4, paint, 1.0);
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn thirty_five_styles_differ() {
        let styles: BTreeSet<_> = (0..35).map(|i| (colour(i).colour, pen(i).dash)).collect();
        assert_eq!(styles.len(), 35);
        let routes: BTreeSet<_> = (0..35).map(|i| (route_pen(i).paint.colour, route_pen(i).dash)).collect();
        assert_eq!(routes.len(), 35);
    }
}
