//! Makes text from files and devices safe to show on a terminal, in a figure and on a page.
//!
//! A name or a label may hold anything. Terminal escapes would control the terminal, most control characters are forbidden in
//! XML even as entities, and direction marks make a text read differently from what it is.

use std::borrow::Cow;

/// The text with every control character, direction mark and invisible character spelled out (`\u{1b}`). Line ends and tabs
/// stay.
#[must_use]
pub fn shown(text: &str) -> Cow<'_, str> {
    spelled_out(text, |c| is_hidden(c) && c != '\n' && c != '\t')
}

/// As [`shown`], in one line: line ends and tabs are spelled out too.
#[must_use]
pub fn shown_in_line(text: &str) -> Cow<'_, str> {
    spelled_out(text, is_hidden)
}

fn spelled_out(text: &str, is_spelled_out: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&is_spelled_out) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if is_spelled_out(c) { out.extend(c.escape_default()) } else { out.push(c) }
    }
    Cow::Owned(out)
}

/// Control characters, line and paragraph separators, direction marks, characters without width, and those that XML forbids.
fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}'
            | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{fffe}' | '\u{ffff}' | '\u{e0000}'..='\u{e007f}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ordinary_text_of_any_language_stays_as_it_is() {
        for text in ["", "d/Z = 5, γF = 0.6", "Schaum, weiß – 研究", "a\tb\nc", "e\u{301}"] {
            assert!(matches!(shown(text), Cow::Borrowed(same) if same == text), "{text:?}");
        }
    }

    #[test]
    fn what_controls_a_terminal_or_hides_is_spelled_out() {
        let text = "a\u{1b}[2Jb\u{9b}c\u{202e}d\u{7}\u{feff}\u{ffff}\r";
        assert_eq!(shown(text), r"a\u{1b}[2Jb\u{9b}c\u{202e}d\u{7}\u{feff}\u{ffff}\r");
        assert_eq!(shown_in_line("a\nb"), r"a\nb");
    }
}
