//! The keys of a recorded base motion in a case or a campaign: their declaration, and reading the file that they name.

use std::path::PathBuf;

use super::read::{RecordError, Spec, Which, read};
use super::record::{Quantity as Recorded, Record};
use super::units::{UNITS, unit_list};
use crate::input::key::Need::{Optional, Required};
use crate::input::key::Range::{NotZero, Positive};
use crate::input::key::{Kind, Quantity, Table, key, names, number, tables, word};
use crate::input::section::Given;
use crate::input::{Problem, Section};

tables! {
    "The table of a recorded base motion."

    "A recorded base motion."
    base_record("base", "record") {
        FILE: Required, [key("file", Kind::Text, "CSV or AT2 file, path relative to this file")];
        QUANTITY: Optional, [word("quantity", &["acceleration", "displacement"], "quantity of the values; given by an AT2 file")];
        UNIT: Optional, [word("unit", names!(UNITS, unit => unit.0), "unit of the values; given by an AT2 file")];
        SCALE: Optional, [number("scale", NotZero, "factor on every value")];
        TIME_STEP: Optional, [number("time_step_s", Positive, "time between samples; otherwise the file has a time column")];
        COLUMN: Optional, [key("column", Kind::TextOrPlace, "column of the values; default: the only one beside the time column")];
        TIME_COLUMN: Optional, [key("time_column", Kind::TextOrPlace, "time column; default: the first")];
    }
}

/// The table of a recorded base motion in a case.
pub(crate) const BASE_RECORD: Table = base_record::TABLE;

/// Reads the keys of a record in a case or a campaign, and its file, whose path `find` gives. Does not finish the table.
pub(crate) fn read_record(s: &Section, find: &dyn Fn(&str) -> PathBuf) -> Option<Record> {
    let file = s.text_of(&base_record::FILE);
    let quantity = s.word(&base_record::QUANTITY).map(|word| [Recorded::Acceleration, Recorded::Displacement][word]);
    let unit = s.word(&base_record::UNIT).map(|word| UNITS[word]);
    if let (Some(quantity), Some((_, of, _))) = (quantity, unit)
        && quantity != of
    {
        s.reject(base_record::UNIT.name(), format!("must be {}", unit_list(quantity)), None);
    }
    let spec = Spec {
        quantity,
        unit_si: unit.map(|(.., si)| si),
        scale: s.scalar(&base_record::SCALE),
        time_step_s: s.scalar(&base_record::TIME_STEP),
        column: which(s, &base_record::COLUMN),
        time_column: which(s, &base_record::TIME_COLUMN),
    };
    let file = file?;
    // Problems of this table are reported first: reading the file depends on its keys.
    if !s.source().is_clean() {
        return None;
    }
    match read(&find(&file.value), &spec) {
        Ok(record) => Some(record),
        Err(RecordError(message)) => {
            let mut lines = message.lines();
            let first = lines.next().unwrap_or_default();
            s.source().report(Problem {
                title: format!("`{}` = {:?} cannot be used", s.full("file"), file.value),
                span: file.span,
                allowed: first.into(),
                help: lines.next().map(|line| line.trim().into()),
            });
            None
        }
    }
}

/// A column by place or name.
fn which(s: &Section, quantity: &Quantity) -> Option<Which> {
    match s.given(quantity)? {
        (_, Given::Text(name)) => Some(Which::Name(name.value)),
        (_, Given::Number(place)) => Some(Which::Place(place as usize)),
        _ => None,
    }
}
