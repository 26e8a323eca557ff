//! Text of `damprig study`.

use crate::report::numbers::significant;
use crate::study::Study;
use crate::study::axis::AxisValue;
use crate::study::evaluate::main_column;

/// Size of a study: `Clearance and restitution: 10000 points, 1e4 simulations, 1e7 cycles`.
#[must_use]
pub fn scope(study: &Study, cycles: f64) -> String {
    let rows = study.rows();
    let each = match study.simulations_per_row() {
        1 => String::new(),
        each => format!(" of {each} simulations"),
    };
    format!("{}: {rows} points{each}, {} cycles", study.name, significant(cycles, 3))
}

/// The best point: its value and where it is.
#[must_use]
pub fn best(study: &Study, row: u64, value: f64) -> String {
    let values = study.points.values(&study.axes, row, 0);
    let place = |axis: &usize| {
        let axis_values = &values[*axis];
        let text = match axis_values {
            AxisValue::Number(number) => significant(*number, 6),
            AxisValue::Word(word) => word.clone(),
        };
        format!("\n  {:32} {text} {}", study.axes[*axis].key, study.axes[*axis].unit()).trim_end().to_string()
    };
    let places: String = study.points.kept().iter().map(place).collect();
    let what = if study.is_maximum { "largest" } else { "smallest" };
    let unit = study.objective.suffix();
    format!("{what} {}: {} {unit}", main_column(study, study.objective), significant(value, 6)).trim_end().to_string()
        + " at"
        + &places
}
