//! Text of others on a terminal: control characters are escaped, so that a message, a recording or
//! a file name can neither steer the terminal nor imitate other lines.
//!
//! Escaped are C0 and C1 controls, DEL, line and paragraph separators, and the characters that
//! change the direction of text ("Trojan Source", CVE-2021-42574). Everything else stays as it is.

use std::borrow::Cow;

/// Text that may have several lines: line breaks and tabs stay.
#[must_use]
pub fn text(text: &str) -> Cow<'_, str> {
    escaped(text, |character| !matches!(character, '\n' | '\t') && is_control(character))
}

/// Text that is part of a line, such as a name or a reason.
#[must_use]
pub fn line(text: &str) -> Cow<'_, str> {
    escaped(text, is_control)
}

fn escaped(text: &str, is_escaped: impl Fn(char) -> bool + Copy) -> Cow<'_, str> {
    if !text.contains(is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut printable = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        if is_escaped(character) {
            printable.extend(character.escape_default());
        } else {
            printable.push(character);
        }
    }
    Cow::Owned(printable)
}

/// Whether a character steers a terminal or changes the order of others.
fn is_control(character: char) -> bool {
    character.is_control()
        || matches!(
            character,
            '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}'
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped() {
        // The title of a window, a coloured word, a cleared screen in C1, a carriage return.
        let hostile = "\u{1b}]0;title\u{7} \u{1b}[31mred \u{9b}2J\rok\u{7f}\u{8}";
        let expected = r"\u{1b}]0;title\u{7} \u{1b}[31mred \u{9b}2J\rok\u{7f}\u{8}";
        assert_eq!(text(hostile), expected);
        assert_eq!(line(hostile), expected);
        assert_eq!(text("a\u{202e}b\u{2066}c\u{2028}d\u{200f}"), r"a\u{202e}b\u{2066}c\u{2028}d\u{200f}");
        for character in ('\0'..='\u{ffff}').filter(|character| character.is_control()) {
            assert!(!line(&character.to_string()).contains(char::is_control));
        }
    }

    #[test]
    fn line_breaks_stay_in_text_alone() {
        assert_eq!(text("one\n\ttwo"), "one\n\ttwo");
        assert_eq!(line("one\n\tdigest: 00"), r"one\n\tdigest: 00");
    }

    #[test]
    fn other_text_is_not_copied() {
        for plain in ["", "│ agent 4 ┆  99.23 % ┆ é ü 漢字 🤖", r"C:\n"] {
            assert!(matches!(text(plain), Cow::Borrowed(same) if same == plain));
            assert!(matches!(line(plain), Cow::Borrowed(same) if same == plain));
        }
    }
}
