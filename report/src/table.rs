//! Tables of estimates, and their formats: HTML, Markdown, LaTeX and CSV.

use std::fmt::Write;

use super::estimates::{Estimate, Quartiles};
use super::svg::escape;
use experiments::tables::csv_text;
use msgs::printable;
use statistics::Interval;

/// Shown in place of a missing value.
const NONE: &str = "\u{2013}";

/// An entry of a table; the last number of a variant is the number of decimals shown.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Entry {
    Text(String),
    /// Size of a map in cells.
    Size([u32; 3]),
    Count(usize),
    Number(Option<f64>, usize),
    /// A part of a number of runs.
    Share(usize, usize),
    Mean(Option<Estimate>, usize),
    Median(Option<Quartiles>, usize),
    /// `None` if there is no test.
    Probability(Option<f64>),
}

impl Entry {
    /// For readers.
    fn shown(&self) -> String {
        match self {
            Self::Text(text) => printable::line(text).into_owned(),
            Self::Size([x, y, z]) if x == y && y == z => format!("{x}\u{b3}"),
            Self::Size([x, y, z]) => format!("{x} \u{d7} {y} \u{d7} {z}"),
            Self::Count(count) => count.to_string(),
            Self::Number(None, _) => NONE.to_owned(),
            Self::Number(Some(number), digits) => fixed(*number, *digits),
            Self::Share(some, all) => format!("{some}/{all}"),
            Self::Mean(None, _) => NONE.to_owned(),
            Self::Mean(Some(Estimate { mean, interval: None }), digits) => fixed(*mean, *digits),
            Self::Mean(Some(Estimate { mean, interval: Some(Interval { low, high }) }), digits) => {
                format!("{} [{}, {}]", fixed(*mean, *digits), fixed(*low, *digits), fixed(*high, *digits))
            }
            Self::Median(None, _) => NONE.to_owned(),
            Self::Median(Some(Quartiles { low, median, high }), digits) => {
                format!("{} ({}{NONE}{})", fixed(*median, *digits), fixed(*low, *digits), fixed(*high, *digits))
            }
            Self::Probability(None) => NONE.to_owned(),
            Self::Probability(Some(p)) if *p < 0.001 => "<0.001".to_owned(),
            Self::Probability(Some(p)) => fixed(*p, 3),
        }
    }

    /// For programs: the values of the entry, with all digits.
    fn values(&self) -> Vec<String> {
        let optional = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        match self {
            Self::Text(text) => vec![csv_text(text).into_owned()],
            Self::Size([x, y, z]) => vec![format!("{x}x{y}x{z}")],
            Self::Count(count) => vec![count.to_string()],
            Self::Number(number, _) => vec![optional(*number)],
            Self::Share(some, all) => vec![some.to_string(), all.to_string()],
            Self::Mean(estimate, _) => {
                let interval = estimate.and_then(|estimate| estimate.interval);
                let ends = [interval.map(|interval| interval.low), interval.map(|interval| interval.high)];
                [estimate.map(|estimate| estimate.mean), ends[0], ends[1]].map(optional).to_vec()
            }
            Self::Median(quartiles, _) => {
                let of = |value: fn(&Quartiles) -> f64| optional(quartiles.as_ref().map(value));
                vec![of(|quartiles| quartiles.median), of(|quartiles| quartiles.low), of(|quartiles| quartiles.high)]
            }
            Self::Probability(p) => vec![optional(*p)],
        }
    }

    /// The column names of [`Self::values`].
    fn keys(&self, key: &str) -> Vec<String> {
        let with = |suffixes: &[&str]| suffixes.iter().map(|suffix| format!("{key}_{suffix}")).collect();
        match self {
            Self::Text(_) | Self::Size(_) | Self::Count(_) | Self::Number(..) | Self::Probability(_) => {
                vec![key.to_owned()]
            }
            Self::Share(..) => with(&["some", "all"]),
            Self::Mean(..) => with(&["mean", "low", "high"]),
            Self::Median(..) => with(&["median", "q1", "q3"]),
        }
    }

    fn is_text(&self) -> bool {
        matches!(self, Self::Text(_) | Self::Size(_))
    }
}

/// The number of decimals for three significant digits: 0 to 3, and 0 for zero.
pub(super) fn digits_for(number: f64) -> usize {
    if number == 0.0 {
        return 0;
    }
    let magnitude = libm::log10(number.abs().max(1e-3)).floor();
    (2.0 - magnitude).clamp(0.0, 3.0) as usize
}

/// A mean with three significant digits.
pub(super) fn mean_entry(estimate: Estimate) -> Entry {
    Entry::Mean(Some(estimate), digits_for(estimate.mean))
}

fn fixed(number: f64, digits: usize) -> String {
    let text = format!("{number:.digits$}");
    // No negative zero after rounding.
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|byte| matches!(byte, b'0' | b'.')) => rest.to_owned(),
        _ => text,
    }
}

/// Rows of entries. Every row has an entry per column, of the same variant in all rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Table {
    /// Stem of the file names.
    pub(super) name: &'static str,
    pub(super) caption: String,
    /// A title for readers, and a column name for programs.
    pub(super) columns: Vec<(String, String)>,
    pub(super) rows: Vec<Vec<Entry>>,
}

impl Table {
    /// Without its caption, which a page shows where it does not scroll with the table.
    pub(super) fn html(&self) -> String {
        let mut text = format!("<table id=\"table-{}\">\n<thead><tr>", self.name);
        for (title, _) in &self.columns {
            write!(text, "<th scope=\"col\">{}</th>", escape(title)).expect("a String can be written");
        }
        text.push_str("</tr></thead>\n<tbody>\n");
        for row in &self.rows {
            text.push_str("<tr>");
            text.extend(row.iter().map(Self::cell));
            text.push_str("</tr>\n");
        }
        text.push_str("</tbody>\n</table>\n");
        text
    }

    /// An entry as a cell of HTML.
    pub(super) fn cell(entry: &Entry) -> String {
        let class = if entry.is_text() { "" } else { " class=\"number\"" };
        format!("<td{class}>{}</td>", escape(&entry.shown()))
    }

    pub(super) fn markdown(&self) -> String {
        let cell = |entry: &Entry| {
            let shown = entry.shown();
            if matches!(entry, Entry::Text(_)) { markdown(&shown) } else { shown }
        };
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let mut text = format!("{}\n\n", self.caption);
        text.push_str(&line(self.columns.iter().map(|(title, _)| title.replace('|', "\\|")).collect()));
        let rule = |i: usize| if self.rows.first().is_some_and(|row| !row[i].is_text()) { "--:" } else { ":--" };
        text.push_str(&line((0..self.columns.len()).map(|i| rule(i).to_owned()).collect()));
        for row in &self.rows {
            text.push_str(&line(row.iter().map(cell).collect()));
        }
        text
    }

    /// A `table` for the package booktabs, with the columns that vary; the caption names the values
    /// of the others.
    pub(super) fn latex(&self) -> String {
        let line = |cells: Vec<String>| format!("{} \\\\\n", cells.join(" & "));
        let is_same = |i: &usize| self.rows.len() > 1 && self.rows.iter().all(|row| row[*i] == self.rows[0][*i]);
        let (same, varying): (Vec<usize>, Vec<usize>) = (0..self.columns.len()).partition(is_same);
        let kind = |&i: &usize| if self.rows.first().is_some_and(|row| !row[i].is_text()) { 'r' } else { 'l' };
        let kinds: String = varying.iter().map(kind).collect();
        // A line break could end the argument.
        let mut caption = latex(&printable::line(&self.caption));
        for (place, &i) in same.iter().enumerate() {
            let (before, after) =
                (if place == 0 { " In all rows: " } else { ", " }, if i == same[same.len() - 1] { "." } else { "" });
            let (title, value) = (latex(&self.columns[i].0), latex(&self.rows[0][i].shown()));
            caption += &format!("{before}{title} {value}{after}");
        }
        let mut text = format!(
            "% \\usepackage{{booktabs}}\n\\begin{{table}}\n\\centering\n\\caption{{{caption}}}\n\\label{{tab:{}}}\n\
             \\begin{{tabular}}{{{kinds}}}\n\\toprule\n",
            self.name
        );
        text.push_str(&line(varying.iter().map(|&i| latex(&self.columns[i].0)).collect()));
        text.push_str("\\midrule\n");
        for row in &self.rows {
            text.push_str(&line(varying.iter().map(|&i| latex(&row[i].shown())).collect()));
        }
        text.push_str("\\bottomrule\n\\end{tabular}\n\\end{table}\n");
        text
    }

    /// For programs, with all digits.
    pub(super) fn csv(&self) -> Vec<u8> {
        let header: Vec<String> = match self.rows.first() {
            Some(first) => self.columns.iter().zip(first).flat_map(|((_, key), entry)| entry.keys(key)).collect(),
            None => self.columns.iter().map(|(_, key)| key.clone()).collect(),
        };
        let rows = self.rows.iter().map(|row| row.iter().flat_map(Entry::values).collect());
        let mut writer = csv::Writer::from_writer(Vec::new());
        for record in std::iter::once(header).chain(rows) {
            writer.write_record(&record).expect("rows have the columns of the header, and memory can be written");
        }
        writer.into_inner().expect("memory can be written")
    }
}

/// Escapes text for Markdown: a name is no link, no element and no column. An underscore within a
/// word marks nothing.
fn markdown(text: &str) -> String {
    let characters: Vec<char> = text.chars().collect();
    let mut escaped = String::with_capacity(text.len());
    for (place, &character) in characters.iter().enumerate() {
        let is_word =
            |place: Option<usize>| place.and_then(|at| characters.get(at)).is_some_and(|near| near.is_alphanumeric());
        let is_marking = match character {
            '\\' | '`' | '*' | '[' | ']' | '<' | '>' | '|' | '~' | '#' | '!' | '&' | '$' => true,
            '_' => !(is_word(place.checked_sub(1)) && is_word(Some(place + 1))),
            _ => false,
        };
        if is_marking {
            escaped.push('\\');
        }
        escaped.push(character);
    }
    escaped
}

/// Escapes text for LaTeX.
fn latex(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                escaped.push('\\');
                escaped.push(character);
            }
            '\\' => escaped.push_str("\\textbackslash{}"),
            '~' => escaped.push_str("\\textasciitilde{}"),
            '^' => escaped.push_str("\\textasciicircum{}"),
            '<' => escaped.push_str("$<$"),
            '>' => escaped.push_str("$>$"),
            '\u{d7}' => escaped.push_str("$\\times$"),
            '\u{b3}' => escaped.push_str("$^3$"),
            '\u{b5}' => escaped.push_str("$\\mu$"),
            '\u{2013}' => escaped.push_str("--"),
            // A bracket at the start of a line would be an argument of the preceding line break.
            '[' => escaped.push_str("{[}"),
            character => escaped.push(character),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let columns = [("controller", "controller"), ("runs", "runs"), ("explored (%)", "explored"), ("p", "p")];
        let interval = Some(Interval { low: 95.26, high: 99.0 });
        Table {
            name: "outcome",
            caption: "What & why".to_owned(),
            columns: columns.map(|(title, key)| (title.to_owned(), key.to_owned())).to_vec(),
            rows: vec![
                vec![
                    Entry::Text("a_b|c,d".to_owned()),
                    Entry::Share(3, 10),
                    Entry::Mean(Some(Estimate { mean: 97.5, interval }), 1),
                    Entry::Probability(Some(0.000_1)),
                ],
                vec![
                    Entry::Text("50³".to_owned()),
                    Entry::Share(0, 1),
                    Entry::Mean(Some(Estimate { mean: -0.01, interval: None }), 1),
                    Entry::Probability(Some(0.25)),
                ],
            ],
        }
    }

    #[test]
    fn markdown_latex_and_csv_match() {
        assert_eq!(
            table().markdown(),
            "What & why\n\n| controller | runs | explored (%) | p |\n| :-- | --: | --: | --: |\n\
             | a_b\\|c,d | 3/10 | 97.5 [95.3, 99.0] | <0.001 |\n| 50³ | 0/1 | 0.0 | 0.250 |\n"
        );
        assert_eq!(
            table().latex(),
            "% \\usepackage{booktabs}\n\\begin{table}\n\\centering\n\\caption{What \\& why}\n\
             \\label{tab:outcome}\n\\begin{tabular}{lrrr}\n\\toprule\n\
             controller & runs & explored (\\%) & p \\\\\n\\midrule\n\
             a\\_b|c,d & 3/10 & 97.5 {[}95.3, 99.0] & $<$0.001 \\\\\n50$^3$ & 0/1 & 0.0 & 0.250 \\\\\n\
             \\bottomrule\n\\end{tabular}\n\\end{table}\n"
        );
        assert_eq!(
            String::from_utf8(table().csv()).unwrap(),
            "controller,runs_some,runs_all,explored_mean,explored_low,explored_high,p\n\
             \"a_b|c,d\",3,10,97.5,95.26,99,0.0001\n50³,0,1,-0.01,,,0.25\n"
        );
    }

    #[test]
    fn equal_columns_of_latex_are_in_its_caption() {
        let mut table = table();
        table.rows.iter_mut().for_each(|row| row[1] = Entry::Share(10, 10));
        let latex = table.latex();
        assert!(latex.contains("\\caption{What \\& why In all rows: runs 10/10.}"), "{latex}");
        assert!(latex.contains("{lrr}\n\\toprule\ncontroller & explored (\\%) & p "), "{latex}");
        assert!(table.markdown().contains("| controller | runs |"), "only that of a paper is short of room");
    }

    #[test]
    fn names_of_others_are_text_alone() {
        let hostile = "=1+1 [x](javascript:a) <img src=x> *b* _c_\u{1b}[2J\u{202e}\n| \\input{/etc/passwd}";
        let column = vec![("variant".to_owned(), "variant".to_owned())];
        let table = Table {
            name: "outcome",
            caption: "a\n\\input{b}".to_owned(),
            columns: column,
            rows: vec![vec![Entry::Text(hostile.to_owned())]],
        };
        let markdown = table.markdown();
        let row = markdown.lines().last().unwrap();
        assert_eq!(
            row,
            r"| =1+1 \[x\](javascript:a) \<img src=x\> \*b\* \_c\_\\u{1b}\[2J\\u{202e}\\n\| \\input{/etc/passwd} |"
        );
        let latex = table.latex();
        assert!(latex.contains("\\caption{a\\textbackslash{}n\\textbackslash{}input\\{b\\}}\n"), "{latex}");
        assert!(latex.contains("\\textbackslash{}input\\{/etc/passwd\\}"), "{latex}");
        let csv = String::from_utf8(table.csv()).unwrap();
        assert!(csv.starts_with("variant\n'=1+1 "), "{csv}");
        for text in [row, &latex, &csv, &table.html()] {
            assert!(!text.contains(['\u{1b}', '\u{202e}']), "{text}");
        }
        assert!(table.html().contains("&lt;img src=x&gt;"));
    }

    #[test]
    fn three_significant_digits_are_shown() {
        assert_eq!([1234.0, 123.4, 12.34, 1.2, 0.01, 0.0].map(digits_for), [0, 0, 1, 2, 3, 0]);
    }
}
