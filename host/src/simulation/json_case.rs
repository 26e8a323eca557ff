//! A JSON text as TOML, byte for byte at the same places, so that one reader serves both and answers point into
//! the file as written.
//!
//! Inside inline tables the two languages differ in `:` against `=` only; the outermost braces become blanks and
//! the commas between top-level members line ends.

use crate::input::{Problem, Source};

/// The same case as TOML; `None` when the text is not JSON, which is then noted.
pub(super) fn to_toml(source: &Source) -> Option<String> {
    let text = source.text();
    if let Err(error) = serde_json::from_str::<serde::de::IgnoredAny>(text) {
        let line_start: usize = text.split_inclusive('\n').take(error.line().saturating_sub(1)).map(str::len).sum();
        let at = (line_start + error.column().saturating_sub(1)).min(text.len());
        let at = (0..=at).rev().find(|i| text.is_char_boundary(*i)).unwrap_or(0);
        source.report(Problem {
            title: "this is not JSON".into(),
            span: at..text.len().min(at + 1),
            allowed: error.to_string(),
            help: None,
        });
        return None;
    }
    if !text.trim_start().starts_with('{') {
        let start = text.len() - text.trim_start().len();
        source.report(Problem {
            title: "this JSON is not an object".into(),
            span: start..text[start..].find('\n').map_or(text.len(), |end| start + end),
            allowed: "a case is one object of tables, {\"structure\": {…}, \"run\": {…}}".into(),
            help: text[start..].starts_with('[').then(|| "of a list of cases, put each in a file of its own".into()),
        });
        return None;
    }
    let nulls = nulls(text);
    for at in &nulls {
        source.report(Problem {
            title: "`null` says nothing".into(),
            span: *at..at + NULL.len(),
            allowed: "a key has a value or is left out".into(),
            help: Some("leave the key out".into()),
        });
    }
    if !nulls.is_empty() {
        return None;
    }
    let (mut depth, mut in_string, mut escaped) = (0u32, false, false);
    let convert = |c: char| {
        if in_string {
            in_string = escaped || c != '"';
            escaped = !escaped && c == '\\';
            return c;
        }
        match c {
            '"' => in_string = true,
            '{' | '[' => {
                depth += 1;
                if depth == 1 {
                    return ' ';
                }
            }
            '}' | ']' => {
                depth -= 1;
                if depth == 0 {
                    return ' ';
                }
            }
            ':' => return '=',
            ',' if depth == 1 => return '\n',
            '\r' | '\n' if depth == 1 => return ' ',
            _ => {}
        }
        c
    };
    Some(text.chars().map(convert).collect())
}

const NULL: &str = "null";

/// Where each `null` of a JSON text begins: outside of strings no other word of JSON has an n in it.
fn nulls(text: &str) -> Vec<usize> {
    let (mut in_string, mut escaped) = (false, false);
    let mut found = Vec::new();
    for (at, byte) in text.bytes().enumerate() {
        match byte {
            _ if in_string => {
                in_string = escaped || byte != b'"';
                escaped = !escaped && byte == b'\\';
            }
            b'"' => in_string = true,
            b'n' => found.push(at),
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_becomes_toml_of_the_same_length() {
        let json = "{\"a\": {\"b\": 1e-05, \"c\": [1, 2.5]},\n \"d\": \"x:{,}\\\"y\"}";
        let source = Source::new("case.json", json);
        let toml = to_toml(&source).expect("it is JSON");
        assert_eq!(toml.len(), json.len());
        let table: toml::Table = toml.parse().expect("it is TOML");
        assert_eq!(table["a"]["b"].as_float(), Some(1e-5));
        assert_eq!(table["a"]["c"][1].as_float(), Some(2.5));
        assert_eq!(table["d"].as_str(), Some("x:{,}\"y"));
    }

    #[test]
    fn a_null_is_answered_where_it_stands_and_a_word_that_has_one_is_none() {
        let source = Source::new("case.json", "{\"null\": {\"a\": \"null \\\"null\"},\n \"b\": [1, null]}");
        assert!(to_toml(&source).is_none());
        let answer = source.verdict().expect_err("a null").to_string();
        assert!(answer.contains("case.json:2") && answer.contains("leave the key out"), "{answer}");
        assert_eq!(answer.matches("`null` says nothing").count(), 1, "{answer}");
    }

    #[test]
    fn broken_json_is_answered_where_it_breaks() {
        let source = Source::new("case.json", "{\"a\": 1,\n \"b\" 2}");
        assert!(to_toml(&source).is_none());
        let answer = source.verdict().expect_err("broken").to_string();
        assert!(answer.contains("case.json:2"), "{answer}");
    }
}
