//! A page of the manual as plain text for the terminal: paragraphs filled to its width, tables drawn, code indented.

use crate::report::terminal::plain_table;

/// The part of a page that is being read.
enum PageBlock<'a> {
    /// A paragraph or an entry of a list: indent of its further lines, text.
    Text(usize, String),
    /// Rows of a table.
    Table(Vec<&'a str>),
}

/// Markdown as text of at most `width` columns; code and long words may be wider.
#[must_use]
pub fn to_text(markdown: &str, width: usize) -> String {
    let mut out = String::new();
    let mut block: Option<PageBlock> = None;
    let mut is_code = false;
    for line in markdown.lines() {
        if line.trim_start().starts_with("```") {
            end(&mut block, &mut out, width);
            is_code = !is_code;
        } else if is_code {
            push(&mut out, format!("    {line}").trim_end());
        } else if line.trim().is_empty() || line.starts_with("<!--") {
            end(&mut block, &mut out, width);
            push(&mut out, "");
        } else if line.starts_with('#') {
            end(&mut block, &mut out, width);
            heading(line, &mut out);
        } else if line.starts_with('|') {
            match &mut block {
                Some(PageBlock::Table(rows)) => rows.push(line),
                _ => {
                    end(&mut block, &mut out, width);
                    block = Some(PageBlock::Table(vec![line]));
                }
            }
        } else {
            text(line, &mut block, &mut out, width);
        }
    }
    end(&mut block, &mut out, width);
    out.trim_end().to_string()
}

/// Adds a line of text to the block that it continues, or begins one.
fn text(line: &str, block: &mut Option<PageBlock>, out: &mut String, width: usize) {
    let spaces = line.len() - line.trim_start().len();
    let rest = line.trim_start();
    let number = rest.bytes().take_while(u8::is_ascii_digit).count();
    let mark = if rest.starts_with("- ") || rest.starts_with("* ") {
        2
    } else if number > 0 && rest[number..].starts_with(". ") {
        number + 2
    } else {
        0
    };
    match block {
        Some(PageBlock::Text(_, text)) if mark == 0 => {
            text.push(' ');
            text.push_str(rest);
        }
        _ => {
            end(block, out, width);
            *block = Some(PageBlock::Text(spaces + mark, format!("{}{rest}", " ".repeat(spaces))));
        }
    }
}

/// A heading, underlined.
fn heading(line: &str, out: &mut String) {
    let level = line.bytes().take_while(|byte| *byte == b'#').count();
    let text = plain(line[level..].trim());
    let under = if level == 1 { "=" } else { "-" };
    push(out, &text);
    if level < 3 {
        push(out, &under.repeat(text.chars().count()));
    }
}

/// Ends a block and prints it.
fn end(block: &mut Option<PageBlock>, out: &mut String, width: usize) {
    match block.take() {
        None => {}
        Some(PageBlock::Text(indent, text)) => {
            fill(&plain(&text), indent, width).iter().for_each(|line| push(out, line))
        }
        Some(PageBlock::Table(rows)) => {
            let cells = |row: &str| -> Vec<String> {
                let row = row.trim().trim_start_matches('|').trim_end_matches('|').replace("\\|", "\u{0}");
                row.split('|').map(|cell| plain(cell.trim()).replace('\u{0}', "|")).collect()
            };
            let header = cells(rows[0]);
            let mut drawn = plain_table(&header);
            // The second row is the line below the header.
            rows.iter().skip(2).for_each(|row| {
                drawn.add_row(cells(row));
            });
            drawn.set_content_arrangement(comfy_table::ContentArrangement::Dynamic);
            drawn.set_width(u16::try_from(width).unwrap_or(u16::MAX));
            push(out, &drawn.to_string());
        }
    }
}

fn push(out: &mut String, line: &str) {
    out.push_str(line);
    out.push('\n');
}

/// A text in lines of at most `width` columns; all but the first begin with `indent` spaces.
fn fill(text: &str, indent: usize, width: usize) -> Vec<String> {
    let spaces = text.len() - text.trim_start().len();
    let mut lines = Vec::new();
    let mut line = " ".repeat(spaces);
    let mut is_empty = true;
    for word in text.split_whitespace() {
        if !is_empty && line.chars().count() + 1 + word.chars().count() > width {
            lines.push(std::mem::replace(&mut line, " ".repeat(indent)));
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line.push_str(word);
        is_empty = false;
    }
    lines.push(line);
    lines
}

/// A text without the marks of Markdown: links are their names, pictures their descriptions. Code keeps its marks and its contents.
fn plain(text: &str) -> String {
    let parts = text.split('`').enumerate().map(
        |(place, part)| {
            if place % 2 == 1 { part.to_string() } else { part.replace("**", "") }
        },
    );
    let mut rest = parts.collect::<Vec<_>>().join("`");
    let mut out = String::new();
    while let Some(middle) = rest.find("](") {
        let Some(start) = rest[..middle].rfind('[') else { break };
        let Some(end) = rest[middle..].find(')').map(|end| middle + end) else { break };
        let is_picture = rest[..start].ends_with('!');
        out.push_str(if is_picture { &rest[..start - 1] } else { &rest[..start] });
        let name = &rest[start + 1..middle];
        out.push_str(&if is_picture { format!("[picture: {name}]") } else { name.to_string() });
        rest = rest[end + 1..].to_string();
    }
    out + &rest
}

#[cfg(test)]
mod tests {
    use super::super::PAGES;
    use super::*;

    #[test]
    fn text_is_filled_and_keeps_its_code() {
        let page = "# Title\nOne two three\nfour `a  *b*` [name](PAGE.md#x) **bold** end.\n\n- first entry that is long\n  and goes on\n- second\n\n```sh\ndamprig  runs\n```\n";
        let expected = "Title\n=====\nOne two three four\n`a *b*` name bold\nend.\n\n- first entry that\n  is long and goes\n  on\n- second\n\n    damprig  runs";
        assert_eq!(to_text(page, 18), expected);
    }

    #[test]
    fn a_table_fits_the_width_and_keeps_its_bars() {
        let text = to_text("| a | b |\n|---|---|\n| \\|x\\| | some longer words that must be broken |\n", 30);
        assert!(text.contains("|x|") && text.lines().all(|line| line.chars().count() <= 30), "{text}");
    }

    #[test]
    fn every_page_keeps_its_words() {
        for page in PAGES {
            let text = to_text(page.text, 100);
            assert!(text.starts_with(&plain(page.title())), "{}", page.path);
            assert!(!text.contains("```") && !text.contains("]("), "{}", page.path);
            assert!(text.len() > page.text.len() / 2, "{}", page.path);
        }
    }
}
