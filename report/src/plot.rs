//! The layout of figures: sheets of equal panels with axes, a title and a legend.
//!
//! Panels are arranged in rows; the legend is above them, where it covers no data. A figure is also
//! available panel by panel, for a page that arranges panels by its width. This module does not
//! depend on runs.

use super::marks::{Mark, SAMPLE, draw_mark};
use super::svg::{Anchor, Area, BOLD, GRID, INK, Label, Pen, SOFT, Section, Svg, fitted, text_width};

/// Size of the font of tick labels, pixels.
pub(super) const SMALL: f64 = 10.5;
/// Size of the font of axis labels and the legend, pixels.
pub(super) const NORMAL: f64 = 11.5;
/// Size of the font of the title of a figure, pixels.
const LARGE: f64 = 14.0;
/// Space at the outer edges, pixels.
pub(super) const EDGE: f64 = 12.0;
/// Space between a frame and its tick labels, pixels.
const TICK_GAP: f64 = 6.0;
/// Width of a vertical axis label with its distance to the tick labels, pixels.
const LABEL: f64 = NORMAL + 10.0;
/// Space to the right of a panel for half of its last tick label, pixels.
const RIGHT_GAP: f64 = 22.0;
/// Height of a title over a panel, pixels.
const PANEL_TITLE: f64 = 24.0;
/// Height of a line of the legend, pixels.
const LEGEND_LINE: f64 = 20.0;
/// An axis of a panel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    logarithmic: bool,
    ticks: Vec<(f64, String)>,
    rules: bool,
}

impl Axis {
    /// From `low` to at least `high`, with about `count` round ticks.
    pub(super) fn linear(low: f64, high: f64, count: usize) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        let step = round_step((high - low) / count as f64);
        let digits = decimals(step);
        let first = (low / step).ceil() as i64;
        let last = (high / step * (1.0 + 1e-9)).floor() as i64;
        let ticks = (first..=last).map(|i| (i as f64 * step, format!("{:.digits$}", i as f64 * step))).collect();
        Self { low, high, logarithmic: false, ticks, rules: true }
    }

    /// Like [`Self::linear`], but ends slightly above a tick, so that marks stay clear of the
    /// frame.
    pub(super) fn rounded(low: f64, high: f64, count: usize) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        let step = round_step((high - low) / count as f64);
        let last = (high / step * (1.0 - 1e-9)).ceil() * step;
        Self { high: last + 0.025 * (last - low), ..Self::linear(low, last, count) }
    }

    /// Shares in per cent, with room for lines at 0 and 100.
    pub(super) fn shares() -> Self {
        Self { low: -2.5, high: 102.5, ..Self::linear(0.0, 100.0, 5) }
    }

    /// Logarithmic, of positive values, from tick to tick: 1, 2 and 5 in each decade, or only
    /// decades if there are many.
    pub(super) fn logarithmic(low: f64, high: f64) -> Self {
        let (first, last) = (libm::log10(low).floor() as i32, libm::log10(high).ceil() as i32);
        let factors: &[f64] = if last - first <= 3 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let ticks = (first..=last).flat_map(|decade| factors.iter().map(move |factor| tick(decade, *factor)));
        let ticks: Vec<_> = ticks.collect();
        let from = ticks.iter().rposition(|(tick, _)| *tick <= low).unwrap_or(0);
        let to = ticks.iter().position(|(tick, _)| *tick >= high).unwrap_or(ticks.len() - 1).max(from + 1);
        let ticks = ticks[from..=to.min(ticks.len() - 1)].to_vec();
        let (low, high) = (ticks[0].0, ticks[ticks.len() - 1].0);
        Self { low, high, logarithmic: true, ticks, rules: true }
    }

    /// Categorical: names at 0, 1, 2, ...
    pub(super) fn names(names: impl IntoIterator<Item = String>) -> Self {
        let ticks: Vec<_> = names.into_iter().enumerate().map(|(i, name)| (i as f64, name)).collect();
        Self { low: -0.5, high: ticks.len() as f64 - 0.5, logarithmic: false, ticks, rules: false }
    }

    /// From `low` to `high` with the given ticks.
    pub(super) fn at(low: f64, high: f64, ticks: impl IntoIterator<Item = (f64, String)>) -> Self {
        Self { low, high, logarithmic: false, ticks: ticks.into_iter().collect(), rules: true }
    }

    /// Approximate width of the longest tick label, pixels.
    fn label_width(&self) -> f64 {
        self.ticks.iter().map(|(_, label)| text_width(label, SMALL)).fold(0.0, f64::max)
    }

    /// Position of a value: 0 at the low end, 1 at the high end.
    fn position(&self, value: f64) -> f64 {
        if self.logarithmic {
            let (low, high) = (libm::log10(self.low), libm::log10(self.high));
            (libm::log10(value.max(self.low)) - low) / (high - low)
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }
}

#[derive(Debug, Clone)]
pub(super) struct Layout<'a> {
    /// Stem of the file names.
    pub(super) name: &'a str,
    pub(super) title: &'a str,
    /// Below the title: how to read the figure.
    pub(super) note: &'a str,
    /// Name and unit along the horizontal axes.
    pub(super) x_label: &'a str,
    /// Names and units along the vertical axes, one per panel or one for all; shown unless it is
    /// that of the panel to the left.
    pub(super) y_labels: &'a [String],
    pub(super) legend: &'a [(Mark, String)],
    pub(super) panels: usize,
    pub(super) columns: usize,
    /// Space for tick labels to the left of each panel, pixels.
    pub(super) left: f64,
    /// Factor on the default height of a panel.
    pub(super) tallness: f64,
}

/// The space for the tick labels of vertical axes, pixels.
pub(super) fn room_for<'a>(axes: impl IntoIterator<Item = &'a Axis>) -> f64 {
    axes.into_iter().map(Axis::label_width).fold(0.0, f64::max)
}

/// A figure that is drawn.
#[derive(Debug, Clone)]
pub(super) struct Drawn {
    /// The whole figure as a file.
    pub(super) svg: String,
    /// Each panel with its labels as an image of its own, without title and legend.
    pub(super) panels: Vec<String>,
}

/// The parts of a panel.
#[derive(Debug)]
struct Parts {
    title: String,
    /// Labels that the whole figure shows at another panel.
    shared: String,
    body: String,
    /// Inside the frame.
    area: Area,
    /// See [`Section::data`].
    data: String,
}

/// A figure under construction.
#[derive(Debug)]
pub(super) struct Sheet<'a> {
    pub(super) svg: Svg,
    layout: Layout<'a>,
    panel: (f64, f64),
    head: f64,
    head_text: String,
    parts: Vec<Parts>,
    width: f64,
}

impl<'a> Sheet<'a> {
    /// An empty sheet with title and legend.
    pub(super) fn new(layout: Layout<'a>) -> Self {
        let panel = match layout.columns {
            0 | 1 => (440.0, 260.0 * layout.tallness),
            2 => (360.0, 230.0 * layout.tallness),
            3 => (250.0, 180.0 * layout.tallness),
            _ => (210.0, 170.0 * layout.tallness),
        };
        let columns = layout.columns.max(1) as f64;
        let svg = Svg::new(layout.name);
        let mut sheet = Self { svg, layout, panel, head: 0.0, head_text: String::new(), parts: Vec::new(), width: 0.0 };
        let text = text_width(sheet.layout.title, LARGE * BOLD).max(text_width(sheet.layout.note, SMALL));
        sheet.width = (2.0 * EDGE + sheet.outer_label() + columns * sheet.column_width()).max(2.0 * EDGE + text);
        let Layout { title, note, legend, .. } = sheet.layout;
        sheet.head = draw_head(&mut sheet.svg, title, note, legend, sheet.width);
        sheet.head_text = sheet.svg.take();
        sheet
    }

    /// Width of a panel with its labels and gaps, without the label of the first column.
    fn column_width(&self) -> f64 {
        let label = LABEL - self.outer_label();
        label + self.layout.left + TICK_GAP + self.panel.0 + RIGHT_GAP
    }

    /// Width of the label of the first column; 0 if every column has its own label.
    fn outer_label(&self) -> f64 {
        let differs =
            |index: usize| !index.is_multiple_of(self.layout.columns) && self.label(index) != self.label(index - 1);
        if (0..self.layout.panels).any(differs) { 0.0 } else { LABEL }
    }

    fn label(&self, index: usize) -> Option<&'a String> {
        let labels = self.layout.y_labels;
        labels.get(index).or(labels.last())
    }

    fn area(&self, index: usize) -> Area {
        let (column, row) = (index % self.layout.columns, index / self.layout.columns);
        let (width, height) = self.panel;
        Area {
            left: EDGE + self.outer_label() + (column + 1) as f64 * self.column_width() - RIGHT_GAP - width,
            top: self.head + PANEL_TITLE + row as f64 * (PANEL_TITLE + height + self.foot()),
            width,
            height,
        }
    }

    fn foot(&self) -> f64 {
        SMALL + NORMAL + 2.0 * TICK_GAP + 10.0
    }

    /// Draws the frame of a panel; what is drawn until the next one belongs to it.
    pub(super) fn panel(&mut self, index: usize, title: &str, x: &Axis, y: &Axis) -> Panel {
        self.end_panel();
        let area = self.area(index);
        let panel = Panel { area, x: x.clone(), y: y.clone() };
        let (bottom, right) = (area.top + area.height, area.left + area.width);
        let place = (area.left + area.width / 2.0, bottom + 2.0 * TICK_GAP + SMALL + NORMAL);
        self.svg.text(place, &Label::new(self.layout.x_label, NORMAL, Anchor::Middle));
        let x_label = self.svg.take();
        if let Some(y_label) = self.label(index) {
            let size = NORMAL.min(NORMAL * (area.height + PANEL_TITLE) / text_width(y_label, NORMAL));
            let label = Label { upright: true, ..Label::new(y_label, size, Anchor::Middle) };
            let x = area.left - TICK_GAP - self.layout.left - LABEL + NORMAL;
            self.svg.text((x, area.top + area.height / 2.0), &label);
        }
        let y_label = self.svg.take();
        let is_left = index.is_multiple_of(self.layout.columns) || self.label(index - 1) != self.label(index);
        let is_bottom = index + self.layout.columns >= self.layout.panels;
        let (here, shared): (Vec<_>, Vec<_>) =
            [(is_bottom, x_label), (is_left, y_label)].into_iter().partition(|(is_here, _)| *is_here);
        let text = |labels: Vec<(bool, String)>| labels.into_iter().map(|(_, label)| label).collect::<String>();
        self.parts.push(Parts {
            title: format!("{}{}{title}", self.layout.title, if title.is_empty() { "" } else { ": " }),
            shared: text(shared),
            body: String::new(),
            area,
            data: panel.data(),
        });
        let here = text(here);
        let title_label = Label { bold: true, ..Label::new(title, NORMAL, Anchor::Start) };
        self.svg.text_within((area.left, area.top - 8.0), title_label, area.width + RIGHT_GAP);
        let rule = Pen::solid(GRID, 1.0);
        let tick = Pen::solid(INK, 1.0);
        for (value, label) in &x.ticks {
            let at = panel.at(*value, y.low).0;
            if x.rules {
                self.svg.line((at, area.top), (at, bottom), &rule);
            }
            self.svg.line((at, bottom), (at, bottom + 3.0), &tick);
            self.svg.text((at, bottom + TICK_GAP + SMALL), &Label::new(label, SMALL, Anchor::Middle));
        }
        for (value, label) in &y.ticks {
            let at = panel.at(x.low, *value).1;
            if y.rules {
                self.svg.line((area.left, at), (right, at), &rule);
            }
            self.svg.line((area.left - 3.0, at), (area.left, at), &tick);
            self.svg.text((area.left - TICK_GAP, at + 0.36 * SMALL), &Label::new(label, SMALL, Anchor::End));
        }
        self.svg.frame(area, &Pen::solid(INK, 1.0));
        self.svg.append(&here);
        panel
    }

    /// Puts what has been drawn into the panel that it belongs to.
    fn end_panel(&mut self) {
        let body = self.svg.take();
        if let Some(panel) = self.parts.last_mut() {
            panel.body = body;
        }
    }

    /// Writes a note into a panel without data.
    pub(super) fn empty(&mut self, panel: &Panel, text: &str) {
        let Area { left, top, width, height } = panel.area;
        let label = Label { paint: SOFT, ..Label::new(text, NORMAL, Anchor::Middle) };
        self.svg.text((left + width / 2.0, top + height / 2.0), &label);
    }

    /// The figure as SVG, whole and panel by panel.
    pub(super) fn finish(mut self) -> Drawn {
        self.end_panel();
        let rows = self.layout.panels.div_ceil(self.layout.columns.max(1)) as f64;
        let height = self.head + rows * (PANEL_TITLE + self.panel.1 + self.foot()) + EDGE;
        let (left, foot) = (TICK_GAP + self.layout.left + LABEL, self.foot());
        let panel = |parts: &Parts| {
            let Area { left: x, top: y, width, height } = parts.area;
            let area = Area {
                left: x - left,
                top: y - PANEL_TITLE,
                width: left + width + RIGHT_GAP,
                height: PANEL_TITLE + height + foot,
            };
            let body = format!("{}{}", parts.shared, parts.body);
            Svg::section(&body, Section { area, title: &parts.title, data: &parts.data })
        };
        let panels = self.parts.iter().map(panel).collect();
        self.svg.append(&self.head_text);
        for parts in &self.parts {
            self.svg.append(&parts.body);
        }
        Drawn { svg: self.svg.finish(self.width, height, self.layout.title), panels }
    }
}

/// Draws title, note and legend at the top of a figure of this width; returns where they end.
pub(super) fn draw_head(svg: &mut Svg, title: &str, note: &str, legend: &[(Mark, String)], width: f64) -> f64 {
    let mut y = EDGE + LARGE;
    svg.text((EDGE, y), &Label { bold: true, ..Label::new(title, LARGE, Anchor::Start) });
    if !note.is_empty() {
        y += SMALL + 7.0;
        svg.text((EDGE, y), &Label { paint: SOFT, ..Label::new(note, SMALL, Anchor::Start) });
    }
    y += 8.0;
    let mut x = EDGE;
    for (i, (mark, name)) in legend.iter().enumerate() {
        let name = &*fitted(name, NORMAL, width - 2.0 * EDGE - SAMPLE - 6.0);
        let entry = SAMPLE + 6.0 + text_width(name, NORMAL) + 16.0;
        if i > 0 && x + entry > width {
            x = EDGE;
            y += LEGEND_LINE;
        }
        let middle = y + LEGEND_LINE / 2.0;
        let place = Area { left: x, top: middle - 5.0, width: SAMPLE, height: 10.0 };
        draw_mark(svg, *mark, place);
        svg.text((x + SAMPLE + 6.0, middle + 4.0), &Label::new(name, NORMAL, Anchor::Start));
        x += entry;
    }
    y + if legend.is_empty() { 0.0 } else { LEGEND_LINE + 6.0 }
}

/// The area and the axes of a panel.
#[derive(Debug, Clone)]
pub(super) struct Panel {
    /// Inside the frame.
    pub(super) area: Area,
    x: Axis,
    y: Axis,
}

impl Panel {
    /// The position of a pair of values on the sheet, pixels.
    pub(super) fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let Area { left, top, width, height } = self.area;
        (left + self.x.position(x) * width, top + (1.0 - self.y.position(y)) * height)
    }

    /// Frame and axes for scripts: left, top, width and height in pixels, and the ends of both
    /// axes; nothing for axes that are not linear scales.
    fn data(&self) -> String {
        let Area { left, top, width, height } = self.area;
        let (x, y) = (&self.x, &self.y);
        if x.logarithmic || y.logarithmic || !x.rules || !y.rules {
            return String::new();
        }
        format!(" data-plot=\"{left:.2} {top:.2} {width:.2} {height:.2} {} {} {} {}\"", x.low, x.high, y.low, y.high)
    }

    /// The area with a margin, pixels, so that a line along an edge is not cut.
    pub(super) fn with_margin(&self, margin: f64) -> Area {
        let Area { left, top, width, height } = self.area;
        Area { left: left - margin, top: top - margin, width: width + 2.0 * margin, height: height + 2.0 * margin }
    }
}

/// The greatest 1, 2 or 5 times a power of ten that is not above `length`.
pub(super) fn round_length(length: f64) -> f64 {
    let power = libm::exp10(libm::log10(length).floor());
    [5.0, 2.0, 1.0].iter().map(|factor| factor * power).find(|&round| round <= length * 1.000_001).unwrap_or(power)
}

/// The least 1, 2 or 5 times a power of ten that is not below `step`.
fn round_step(step: f64) -> f64 {
    let power = libm::exp10(libm::log10(step).floor());
    [1.0, 2.0, 5.0].iter().map(|factor| factor * power).find(|&round| round >= step * 0.999_999).unwrap_or(10.0 * power)
}

/// The number of decimals of multiples of a step.
fn decimals(step: f64) -> usize {
    (-libm::log10(step * 1.000_001).floor()).max(0.0) as usize
}

/// A factor times a power of ten, with a label that is written out if short.
fn tick(decade: i32, factor: f64) -> (f64, String) {
    let value = factor * libm::exp10(decade.into());
    let label = match decade {
        0..=4 => format!("{value:.0}"),
        -4..0 => format!("{value:.*}", decade.unsigned_abs() as usize),
        _ => format!("{factor}e{decade}"),
    };
    (value, label)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        let labels = |axis: Axis| axis.ticks.into_iter().map(|(_, label)| label).collect::<Vec<_>>();
        assert_eq!(labels(Axis::linear(0.0, 30.0, 6)), ["0", "5", "10", "15", "20", "25", "30"]);
        assert_eq!(labels(Axis::linear(0.0, 1.0, 5)), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(Axis::rounded(0.0, 0.31, 4)), ["0.0", "0.1", "0.2", "0.3", "0.4"]);
        assert_eq!(labels(Axis::logarithmic(0.3, 2500.0)), ["0.1", "1", "10", "100", "1000", "10000"]);
        assert_eq!(labels(Axis::logarithmic(0.3, 4.0)), ["0.2", "0.5", "1", "2", "5"]);
        assert_eq!(labels(Axis::logarithmic(100.0, 100.0)).len(), 2);
        assert_eq!(labels(Axis::linear(5.0, 5.0, 2)), ["5.0", "5.5", "6.0"]);
    }

    #[test]
    fn position_is_relative_to_the_axis() {
        assert_eq!(Axis::linear(10.0, 20.0, 5).position(12.5), 0.25);
        assert!((Axis::logarithmic(1.0, 100.0).position(10.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn lengths_of_scale_bars_are_round() {
        let lengths = [0.3, 1.0, 4.99, 33.3, 50.0, 700.0].map(round_length);
        assert_eq!(lengths, [0.2, 1.0, 2.0, 20.0, 50.0, 500.0]);
    }
}
