//! Tables for the terminal.

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{CellAlignment, Table};

use crate::quantity::Quantity;

/// A table with a header; all columns but the first are aligned right, for numbers.
#[must_use]
pub fn table(header: &[impl AsRef<str>]) -> Table {
    let mut table = plain_table(header);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Head of a column of a quantity, the unit that people read in a line of its own.
#[must_use]
pub fn head(own: Quantity) -> String {
    match own.head() {
        (label, "") => label.into(),
        (label, unit) => format!("{label}\n({unit})"),
    }
}

/// A table with a header, aligned left.
#[must_use]
pub fn plain_table(header: &[impl AsRef<str>]) -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED).set_header(header.iter().map(AsRef::as_ref));
    table
}
