//! Declares the keys of a continuation file.

use crate::input::key::DefaultValue::{Number, Word};
use crate::input::key::Need::{Default, Optional, Required};
use crate::input::key::Range::{Above, Any, Whole};
use crate::input::key::{KeyedQuantity, Table, ValueKind, key, number, tables, word};

/// Most drive periods that a simulation may take to repeat, unless the file states another number.
pub(super) const MAX_PERIODS: u64 = 6000;

/// Most new starts by simulation beyond grazings, unless the file states another number.
pub(super) const MAX_RESTARTS: usize = 6;

tables! {
    "All tables of a continuation file."

    "What is followed: the case, its parameter and the range."
    file("") {
        CASE: Required, [key("case", ValueKind::Text, "the case file, relative to this file")];
        PARAMETER: Required, [key("parameter", ValueKind::Text, "the parameter by its key in a case, e.g. \"particle.clearance_m\"")];
        FROM: Required, [number("from", Any, "lower end of the range, in the unit of the parameter")];
        TO: Required, [number("to", Any, "upper end of the range")];
        START_AT: Optional, [number("start_at", Any, "value at which the first orbit is simulated; default: that of the case")];
        BRANCHES: Default(Word("main")), [
            word("branches", &["main", "all"], "whether branches are followed that branch off at a period doubling or where the symmetry breaks"),
        ];
        RESTARTS: Default(Number(MAX_RESTARTS as f64)), [
            number("restarts", Whole(0.0, 100.0), "most new starts by simulation beyond grazings"),
        ];
        STEP: Default(Number(0.01)), [number("longest_step", Above(0.0, 0.2), "longest step, as a share of the range")];
        SETTLE: Default(Number(MAX_PERIODS as f64)), [
            number("settle_periods", Whole(200.0, 1e6), "most drive periods that a simulation may take to repeat"),
        ];
        SECOND: Optional, [key("second", ValueKind::Table, "a second parameter: curves of the special points in both")];
    }

    "The second parameter."
    second("second") {
        PARAMETER: Required, [key("parameter", ValueKind::Text, "the parameter by its key in a case")];
        FROM: Required, [number("from", Any, "lower end of the range")];
        TO: Required, [number("to", Any, "upper end of the range")];
    }
}
