//! What a command found, in blocks that the terminal and a page show alike.

pub mod optimum;
mod sensitivity;
pub mod study;

use std::fmt;

use maud::{Markup, html};

use super::text_table;

/// Sections of blocks.
#[derive(Clone, Debug, Default)]
pub struct Document(Vec<Vec<Block>>);

/// A block of a section.
#[derive(Clone, Debug)]
pub enum Block {
    /// A sentence or several.
    Text(String),
    /// Names with their values.
    Facts(Vec<(String, String)>),
    /// A table.
    Table(Rows),
}

/// Rows of a table.
#[derive(Clone, Debug)]
pub struct Rows {
    /// Name and unit of each column; empty without a unit.
    heads: Vec<(String, String)>,
    /// Whether a column has words, not numbers.
    are_words: Vec<bool>,
    rows: Vec<Vec<String>>,
}

/// Width of the names of facts in the terminal.
const NAMES_WIDTH: usize = 34;

impl Document {
    /// Adds a section, if it has blocks.
    pub fn add(&mut self, section: Vec<Block>) {
        if !section.is_empty() {
            self.0.push(section);
        }
    }

    /// Whether it says nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// As a part of a page.
    #[must_use]
    pub fn html(&self) -> Markup {
        html! { @for block in self.0.iter().flatten() { (block.html()) } }
    }
}

impl fmt::Display for Document {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for (n, section) in self.0.iter().enumerate() {
            let blocks: Vec<String> = section.iter().map(ToString::to_string).collect();
            write!(f, "{}{}", if n > 0 { "\n\n" } else { "" }, blocks.join("\n"))?;
        }
        Ok(())
    }
}

impl Block {
    fn html(&self) -> Markup {
        match self {
            Self::Text(text) => html! { p { (text) } },
            Self::Facts(facts) => html! { dl { @for (name, value) in facts { dt { (name) } dd { (value) } } } },
            Self::Table(rows) => rows.html(),
        }
    }
}

impl fmt::Display for Block {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Text(text) => f.write_str(text),
            Self::Facts(facts) => {
                let line = |(name, value): &(String, String)| format!("  {name:NAMES_WIDTH$} {value}");
                f.write_str(&facts.iter().map(line).collect::<Vec<_>>().join("\n"))
            }
            Self::Table(rows) => write!(f, "{}", rows.for_terminal()),
        }
    }
}

impl Rows {
    /// Without rows; the first column has words, the others numbers.
    #[must_use]
    pub fn new(heads: &[&str]) -> Self {
        let are_words = (0..heads.len()).map(|column| column == 0).collect();
        Self { heads: heads.iter().map(|head| ((*head).into(), String::new())).collect(), are_words, rows: Vec::new() }
    }

    /// Without rows, of columns with their units; those without a unit have words.
    #[must_use]
    pub fn with_units(heads: &[(&str, &str)]) -> Self {
        let are_words = heads.iter().map(|(_, unit)| unit.is_empty()).collect();
        let heads = heads.iter().map(|(name, unit)| ((*name).into(), (*unit).into())).collect();
        Self { heads, are_words, rows: Vec::new() }
    }

    /// Adds a row.
    pub fn add(&mut self, row: impl IntoIterator<Item = String>) {
        self.rows.push(row.into_iter().collect());
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// As a table of the terminal.
    #[must_use]
    pub fn for_terminal(&self) -> comfy_table::Table {
        let head =
            |(name, unit): &(String, String)| if unit.is_empty() { name.clone() } else { format!("{name}\n({unit})") };
        let mut table = text_table::table(&self.heads.iter().map(head).collect::<Vec<_>>());
        for row in &self.rows {
            table.add_row(row);
        }
        table
    }

    /// As a table of a page.
    #[must_use]
    pub fn html(&self) -> Markup {
        html! {
            div.wide { table {
                thead { tr { @for ((name, unit), is_word) in self.heads.iter().zip(&self.are_words) {
                    th.word[*is_word] { (name) @if !unit.is_empty() { small { (unit) } } }
                } } }
                tbody { @for row in &self.rows {
                    tr { @for (cell, is_word) in row.iter().zip(&self.are_words) {
                        td.word[*is_word] { @if *is_word { (cell) } @else { (cell.replace('-', "−")) } }
                    } }
                } }
            } }
        }
    }
}
