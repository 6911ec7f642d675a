//! An SVG writer: shapes in pixels from the top left, in drawing order.
//!
//! Colours are attributes, so that a file looks the same everywhere; neutral colours also have a
//! class, which a page may override for a dark background. An image has an opaque background, is
//! self-contained, and prefixes its ids with its name, so that several can be part of one page.

use std::borrow::Cow;
use std::fmt::Write;

use msgs::printable;

/// Colour of text, frames and neutral lines.
pub(super) const INK: Paint = Paint { colour: "#1a1a1a", class: "ink" };
/// Colour of secondary text.
pub(super) const SOFT: Paint = Paint { colour: "#5a5a5a", class: "soft" };
/// Colour of grid lines.
pub(super) const GRID: Paint = Paint { colour: "#e3e3e3", class: "rule" };
/// Background.
pub(super) const PAPER: Paint = Paint { colour: "#ffffff", class: "paper" };
/// Width of bold text relative to regular text.
pub(super) const BOLD: f64 = 1.12;
/// Font of all text, beginning with that of the PNG files.
const FONT: &str = "'DejaVu Sans', Verdana, 'Noto Sans', sans-serif";

/// A colour and the class by which a page may override it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Paint {
    /// `#rrggbb`.
    pub(super) colour: &'static str,
    /// Empty for none.
    pub(super) class: &'static str,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Pen {
    pub(super) paint: Paint,
    /// Pixels.
    pub(super) width: f64,
    /// Lengths of dashes and gaps, pixels; empty for a solid line.
    pub(super) dash: &'static str,
    /// 0 to 1.
    pub(super) opacity: f64,
}

impl Pen {
    /// A solid, opaque line.
    pub(super) fn solid(paint: Paint, width: f64) -> Self {
        Self { paint, width, dash: "", opacity: 1.0 }
    }

    fn attributes(&self) -> String {
        let Self { paint, width, dash, opacity } = self;
        let mut text = format!("{} stroke=\"{}\" stroke-width=\"{width}\"", class(paint, "-line"), paint.colour);
        if !dash.is_empty() {
            write!(text, " stroke-dasharray=\"{dash}\"").expect("a String can be written");
        }
        if *opacity < 1.0 {
            write!(text, " stroke-opacity=\"{opacity}\"").expect("a String can be written");
        }
        text
    }
}

/// The alignment of text at its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A line of text.
#[derive(Debug, Clone, Copy)]
pub(super) struct Label<'a> {
    pub(super) text: &'a str,
    /// Size of the font, pixels.
    pub(super) size: f64,
    pub(super) anchor: Anchor,
    pub(super) bold: bool,
    pub(super) paint: Paint,
    /// Rotated by 90°, to be read upwards.
    pub(super) upright: bool,
}

impl<'a> Label<'a> {
    /// Regular text in ink.
    pub(super) fn new(text: &'a str, size: f64, anchor: Anchor) -> Self {
        Self { text, size, anchor, bold: false, paint: INK, upright: false }
    }
}

/// An axis-aligned rectangle, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Area {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

/// An image under construction.
#[derive(Debug)]
pub(super) struct Svg {
    name: String,
    body: String,
    clips: usize,
}

/// The part of an image that another image shows, pixels, and what it is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Section<'a> {
    pub(super) area: Area,
    /// Text alternative.
    pub(super) title: &'a str,
    /// Attributes for scripts; empty for none.
    pub(super) data: &'a str,
}

impl Svg {
    /// An empty image; `name` is the prefix of its ids.
    pub(super) fn new(name: &str) -> Self {
        Self { name: name.to_owned(), body: String::new(), clips: 0 }
    }

    /// Takes what has been drawn since the last call, so that images can be put together of parts.
    pub(super) fn take(&mut self) -> String {
        std::mem::take(&mut self.body)
    }

    /// Adds a part that was taken.
    pub(super) fn append(&mut self, part: &str) {
        self.body.push_str(part);
    }

    /// Begins a group of shapes of a variant. If `is_curve`, its line can be read at any place.
    pub(super) fn begin_variant(&mut self, variant: usize, is_curve: bool) {
        let curve = if is_curve { " data-curve=\"\"" } else { "" };
        self.push(format_args!("<g data-variant=\"{variant}\"{curve}>"));
    }

    /// Begins a group of shapes with a value, for readers.
    pub(super) fn begin_value(&mut self, value: &str) {
        self.push(format_args!("<g data-value=\"{}\">", escape(value)));
    }

    /// Begins a group of shapes of a run.
    pub(super) fn begin_run(&mut self, id: &str) {
        self.push(format_args!("<g data-run=\"{}\">", escape(id)));
    }

    pub(super) fn end_group(&mut self) {
        self.push(format_args!("</g>"));
    }

    /// A straight line.
    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64), pen: &Pen) {
        self.push(format_args!(
            "<line x1=\"{:.2}\" y1=\"{:.2}\" x2=\"{:.2}\" y2=\"{:.2}\"{}/>",
            from.0,
            from.1,
            to.0,
            to.1,
            pen.attributes()
        ));
    }

    /// A line through points.
    pub(super) fn polyline(&mut self, points: &[(f64, f64)], pen: &Pen) {
        let attributes = pen.attributes();
        self.push(format_args!(
            "<polyline points=\"{}\" fill=\"none\" stroke-linejoin=\"round\"{attributes}/>",
            joined(points)
        ));
    }

    /// A filled area with no outline.
    pub(super) fn polygon(&mut self, points: &[(f64, f64)], paint: Paint, opacity: f64) {
        self.push(format_args!(
            "<polygon points=\"{}\"{} fill=\"{}\" fill-opacity=\"{opacity}\"/>",
            joined(points),
            class(&paint, ""),
            paint.colour
        ));
    }

    /// A filled rectangle with no outline.
    pub(super) fn fill(&mut self, area: Area, paint: Paint, opacity: f64) {
        let Area { left, top, width, height } = area;
        self.push(format_args!(
            "<rect x=\"{left:.2}\" y=\"{top:.2}\" width=\"{width:.2}\" height=\"{height:.2}\"{} fill=\"{}\" \
             fill-opacity=\"{opacity}\"/>",
            class(&paint, ""),
            paint.colour
        ));
    }

    /// The outline of a rectangle.
    pub(super) fn frame(&mut self, area: Area, pen: &Pen) {
        let Area { left, top, width, height } = area;
        let attributes = pen.attributes();
        self.push(format_args!(
            "<rect x=\"{left:.2}\" y=\"{top:.2}\" width=\"{width:.2}\" height=\"{height:.2}\" \
             fill=\"none\"{attributes}/>"
        ));
    }

    /// A filled disc.
    pub(super) fn disc(&mut self, centre: (f64, f64), radius: f64, paint: Paint, opacity: f64) {
        self.push(format_args!(
            "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius}\"{} fill=\"{}\" fill-opacity=\"{opacity}\"/>",
            centre.0,
            centre.1,
            class(&paint, ""),
            paint.colour
        ));
    }

    /// A line of text with its baseline at a position.
    pub(super) fn text(&mut self, (x, y): (f64, f64), label: &Label) {
        let Label { text, size, anchor, bold, paint, upright } = *label;
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let weight = if bold { " font-weight=\"bold\"" } else { "" };
        let turned = if upright { format!(" transform=\"rotate(-90 {x:.2} {y:.2})\"") } else { String::new() };
        self.push(format_args!(
            "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{size}\" text-anchor=\"{anchor}\"{weight}{turned}{} \
             fill=\"{}\">{}</text>",
            class(&paint, ""),
            paint.colour,
            escape(text)
        ));
    }

    /// A line of text that is made smaller if it is wider than `width`, pixels.
    pub(super) fn text_within(&mut self, at: (f64, f64), label: Label, width: f64) {
        let weight = if label.bold { BOLD } else { 1.0 };
        let size = label.size.min(label.size * width / text_width(label.text, label.size * weight).max(1.0));
        self.text(at, &Label { size, ..label });
    }

    /// An area that is bounded by closed lines, `path` (SVG path data), by the even-odd rule. Its
    /// coordinates are from `origin`, pixels, and `scale` pixels long.
    pub(super) fn area(
        &mut self,
        path: &str,
        origin: (f64, f64),
        scale: (f64, f64),
        paint: Paint,
        outline: Option<Pen>,
    ) {
        // A transformation also scales the width of lines.
        let pen = outline.map(|pen| Pen { width: pen.width / scale.0.abs(), ..pen }.attributes());
        self.push(format_args!(
            "<path transform=\"translate({:.3} {:.3}) scale({:.6} {:.6})\" d=\"{path}\" fill-rule=\"evenodd\"{} \
             fill=\"{}\"{}/>",
            origin.0,
            origin.1,
            scale.0,
            scale.1,
            class(&paint, ""),
            paint.colour,
            pen.unwrap_or_default()
        ));
    }

    /// Clips all shapes up to [`Self::end_clip`] to an area.
    pub(super) fn begin_clip(&mut self, area: Area) {
        let Area { left, top, width, height } = area;
        let id = format!("{}-clip-{}", self.name, self.clips);
        self.clips += 1;
        self.push(format_args!(
            "<clipPath id=\"{id}\"><rect x=\"{left:.2}\" y=\"{top:.2}\" width=\"{width:.2}\" \
             height=\"{height:.2}\"/></clipPath>"
        ));
        self.push(format_args!("<g clip-path=\"url(#{id})\">"));
    }

    pub(super) fn end_clip(&mut self) {
        self.push(format_args!("</g>"));
    }

    /// A section of a drawing as an image of its own, for a page.
    pub(super) fn section(body: &str, Section { area, title, data }: Section) -> String {
        let Area { left, top, width, height } = area;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"panel\" viewBox=\"{left:.1} {top:.1} {width:.1} \
             {height:.1}\" width=\"{width:.0}\" height=\"{height:.0}\" font-family=\"{FONT}\" \
             role=\"img\"{data}>\n<title>{}</title>\n{body}</svg>\n",
            escape(title),
        )
    }

    /// The image as a file; `title` is its text alternative.
    pub(super) fn finish(self, width: f64, height: f64, title: &str) -> String {
        let background = format!(
            "<rect width=\"{width:.0}\" height=\"{height:.0}\"{} fill=\"{}\"/>",
            class(&PAPER, ""),
            PAPER.colour
        );
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" \
             font-family=\"{FONT}\" role=\"img\">\n<title>{}</title>\n{background}\n{}</svg>\n",
            escape(title),
            self.body
        )
    }

    fn push(&mut self, element: std::fmt::Arguments) {
        writeln!(self.body, "{element}").expect("a String can be written");
    }
}

const ELLIPSIS: char = '\u{2026}';

/// The text, or as much of its beginning as fits into a width (pixels), with an ellipsis.
pub(super) fn fitted(text: &str, size: f64, width: f64) -> Cow<'_, str> {
    if text_width(text, size) <= width {
        return Cow::Borrowed(text);
    }
    let mut used = character_width(ELLIPSIS) * size;
    let end = text.char_indices().find(|&(_, character)| {
        used += character_width(character) * size;
        used > width
    });
    let beginning = end.map_or(text, |(end, _)| &text[..end]);
    Cow::Owned(format!("{}{ELLIPSIS}", beginning.trim_end()))
}

/// Approximate width of a line of text, pixels; rather too large than too small.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    text.chars().map(character_width).sum::<f64>() * size
}

/// Approximate width of a character of DejaVu Sans, relative to the font size.
fn character_width(character: char) -> f64 {
    match character {
        'i' | 'j' | 'l' | 'I' | '.' | ',' | ':' | ' ' | '\'' | '|' => 0.33,
        'f' | 't' | 'r' | 's' | '-' | '(' | ')' | '/' | '\u{b3}' => 0.44,
        'm' | 'w' | 'M' | 'W' | '%' => 0.97,
        'A'..='Z' => 0.75,
        _ => 0.64,
    }
}

/// Escapes text for an XML element or a quoted attribute, and control characters, of which XML
/// allows few, and those that change the order of others.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in printable::text(text).chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            character => escaped.push(character),
        }
    }
    escaped
}

fn class(paint: &Paint, suffix: &str) -> String {
    if paint.class.is_empty() { String::new() } else { format!(" class=\"{}{suffix}\"", paint.class) }
}

fn joined(points: &[(f64, f64)]) -> String {
    let mut text = String::with_capacity(points.len() * 14);
    for (x, y) in points {
        let gap = if text.is_empty() { "" } else { " " };
        write!(text, "{gap}{x:.2},{y:.2}").expect("a String can be written");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_end_before_the_edge() {
        assert_eq!(fitted("dsvp", 10.0, 100.0), "dsvp");
        let name = "a variant with a name that says all of its settings";
        let shortened = fitted(name, 10.0, 100.0);
        assert!(shortened.ends_with(ELLIPSIS) && text_width(&shortened, 10.0) <= 100.0, "{shortened}");
        assert!(name.starts_with(shortened.trim_end_matches(ELLIPSIS)) && shortened.len() > 10);
    }

    #[test]
    fn xml_is_escaped() {
        assert_eq!(escape("a<b & \"c\">\u{1}\n"), "a&lt;b &amp; &quot;c&quot;&gt;\\u{1}\n");
    }

    #[test]
    fn image_is_well_formed_with_prefixed_ids() {
        let mut svg = Svg::new("times");
        let area = Area { left: 1.0, top: 2.0, width: 30.0, height: 40.0 };
        svg.begin_clip(area);
        svg.line((0.0, 0.0), (1.0, 1.0), &Pen::solid(INK, 1.0));
        svg.polyline(&[(0.0, 1.0), (2.0, 3.0)], &Pen { dash: "3 2", opacity: 0.5, ..Pen::solid(GRID, 1.0) });
        svg.end_clip();
        svg.text((3.0, 4.0), &Label::new("a < b", 11.0, Anchor::End));
        let text = svg.finish(100.0, 50.0, "Title & all");
        let tree = resvg::usvg::roxmltree::Document::parse(&text).unwrap();
        let clips: Vec<_> = tree.descendants().filter_map(|node| node.attribute("id")).collect();
        assert_eq!(clips, ["times-clip-0"]);
    }
}
