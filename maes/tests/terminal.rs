//! What commands show on terminals of 40, 80 and 100 columns: one line of progress that never
//! wraps, and nothing of it left at the end.

use std::process::{Command, Stdio};

const PLAN: &str = "seeds = \"1..8\"\n[axes]\n\"agents.controller\" = [\"rbw\", \"dsvp\"]\n[scenario]\nduration_s = 200.0\n\
                    map = { kind = \"spheres\", size = 40 }\nagents = { count = 2 }\n";

/// What the bar consists of.
const BAR: [char; 2] = ['█', '░'];

/// A terminal as far as the commands use one: characters, and the control sequences that move the
/// cursor and erase lines.
struct Screen {
    columns: usize,
    lines: Vec<Vec<char>>,
    row: usize,
    column: usize,
    /// Whether a line of progress has gone on in the next one.
    has_wrapped: bool,
    /// The lines of progress that were there, each once.
    progress: Vec<String>,
}

impl Screen {
    fn of(columns: usize, bytes: &[u8]) -> Self {
        let (lines, progress) = (vec![Vec::new()], Vec::new());
        let mut screen = Self { columns, lines, row: 0, column: 0, has_wrapped: false, progress };
        let text = String::from_utf8_lossy(bytes);
        let mut rest = text.chars().peekable();
        while let Some(char) = rest.next() {
            match char {
                '\r' => screen.column = 0,
                '\n' => screen.go_to(screen.row + 1),
                '\u{1b}' if rest.next_if_eq(&'[').is_some() => {
                    let mut number = String::new();
                    while let Some(digit) = rest.next_if(|next| next.is_ascii_digit() || "?;".contains(*next)) {
                        number.push(digit);
                    }
                    screen.obey(rest.next(), number.parse().unwrap_or(1));
                }
                _ => screen.put(char),
            }
        }
        screen
    }

    fn go_to(&mut self, row: usize) {
        self.row = row;
        self.lines.resize(self.lines.len().max(row + 1), Vec::new());
    }

    fn obey(&mut self, command: Option<char>, number: usize) {
        match command {
            Some('A') => self.row = self.row.saturating_sub(number),
            Some('B') => self.go_to(self.row + number),
            Some('K') => {
                let line = self.lines[self.row].iter().collect::<String>().trim_end().to_owned();
                if line.contains(BAR) {
                    self.progress.push(line);
                }
                self.lines[self.row].clear();
            }
            _ => {}
        }
    }

    fn put(&mut self, char: char) {
        if self.column >= self.columns {
            // Text above the progress is padded to the end of its line.
            self.has_wrapped |= self.lines[self.row].iter().any(|char| BAR.contains(char));
            self.go_to(self.row + 1);
            self.column = 0;
        }
        let line = &mut self.lines[self.row];
        line.resize(line.len().max(self.column + 1), ' ');
        line[self.column] = char;
        self.column += 1;
    }

    fn text(&self) -> String {
        self.lines.iter().map(|line| line.iter().collect::<String>().trim_end().to_owned() + "\n").collect()
    }
}

/// What a command shows on a terminal that is so wide; its results go nowhere.
fn shown(columns: usize, arguments: &str) -> Screen {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("plan.toml"), PLAN).expect("a new file");
    let line = format!("stty columns {columns} rows 24; exec {:?} {arguments} >/dev/null", env!("CARGO_BIN_EXE_maes"));
    let mut script = Command::new("script");
    script.args(["--quiet", "--return", "--command", &line, "/dev/null"]);
    let output = script.current_dir(folder.path()).env("TERM", "xterm").stdin(Stdio::null()).output();
    let output = output.expect("util-linux has script");
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stdout));
    Screen::of(columns, &output.stdout)
}

#[test]
fn progress_is_one_line_at_any_width_and_leaves_nothing() {
    for columns in [40, 80, 100] {
        for (arguments, word) in [
            ("run --agents 2 --duration 60 --rtf 60 --set stop_when_explored=false --transport memory", "% explored"),
            ("batch plan.toml --out out --jobs 1", "/16 runs"),
        ] {
            let screen = shown(columns, arguments);
            let text = screen.text();
            assert!(!screen.has_wrapped, "{columns} columns, {arguments}:\n{text}");
            let progress = screen.progress.iter().filter(|line| line.contains(word)).count();
            assert!(progress > 0, "{columns} columns, {arguments}: {:?}", screen.progress);
            assert!(!text.contains(BAR) && !text.contains(word), "{columns} columns:\n{text}");
        }
    }
}
