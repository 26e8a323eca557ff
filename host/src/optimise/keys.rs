//! Declares the keys of an optimisation file. Its axes and its record have the keys of a study.

use crate::input::key::DefaultValue::{Number, Word};
use crate::input::key::Need::{Default, Optional, Required};
use crate::input::key::Range::{Any, Between, Positive, Whole};
use crate::input::key::{Kind, MAX_WHOLE, Quantity, Table, key, number, tables, word};
use crate::study::metric::METRIC_NAMES;

/// Words for the value over several starts, from the largest value to the smallest.
pub(super) const OVER_STARTS: &[&str] = &["maximum", "median", "minimum"];

tables! {
    "All tables of an optimisation other than its axes and its record, which are those of a study."

    "The top level of an optimisation."
    optimisation("") {
        NAME: Optional, [key("name", Kind::Text, "name of the optimisation; the file name when left out")];
        CASE: Required, [key("case", Kind::Text, "the case that the optimisation varies; relative to this file")];
        OBJECTIVE: Required, [word("objective", METRIC_NAMES, "the metric that is to be best; docs/STUDIES.md has their meanings")];
        GOAL: Default(Word("minimum")), [word("goal", &["minimum", "maximum"], "whether the smallest or the largest value of the objective is the best")];
        EVALUATIONS: Optional, [number("evaluations", Whole(100.0, 1e8), "most points that are evaluated; default: 2000 for each variable")];
        SEED: Default(Number(1.0)), [number("seed", Whole(0.0, MAX_WHOLE), "of the search's random numbers")];
        VARIABLE: Required, [key("variable", Kind::Tables, "what is looked for, a table for each key of the case")];
        AXIS: Optional, [key("axis", Kind::Tables, "the band that each point is judged over: an axis of a study with `reduce`")];
        CONSTRAINT: Optional, [key("constraint", Kind::Tables, "what must hold at every point of the band and from every start")];
        RECORD: Optional, [key("record", Kind::Table, "what is counted of each simulation, as in a study; default: as the case's `run` says")];
        ENSEMBLE: Optional, [key("ensemble", Kind::Table, "several starts of the particle at each point")];
    }

    "A variable: one key of the case and its range."
    variable("variable") {
        KEY: Required, [key("key", Kind::Text, "the key with its tables, as in the case: particle.clearance_ratio")];
        FROM: Required, [number("from", Any, "least value")];
        TO: Required, [number("to", Any, "largest value; greater than `from`")];
        TOLERANCE: Optional, [number("tolerance", Positive, "how far from the wanted value the mounted one may be, to either side, in the key's unit; default: 0.1 % of the value (of the range where the value is 0)")];
        SCALE: Default(Word("linear")), [word("scale", &["linear", "log"], "whether the search is even in the value or in its logarithm")];
    }

    "A constraint on a metric, at every point of the band and from every start."
    constraint("constraint") {
        METRIC: Required, [word("metric", METRIC_NAMES, "the metric; docs/STUDIES.md has their meanings")];
        LIMIT: Required, [
            number("at_most", Any, "largest allowed value, in the metric's unit"),
            number("at_least", Any, "least allowed value, in the metric's unit"),
            number("equals", Any, "the only allowed value: period_cycles = 1"),
        ];
    }

    "Several starts of the particle at each point of an optimisation."
    ensemble("ensemble") {
        STARTS: Required, [number("starts", Whole(2.0, 10_000.0), "number of starts, evenly spread from one wall to the other")];
        OVER: Optional, [
            word("over_starts", OVER_STARTS, "the value over the starts that is optimised; default: the worst, so \"maximum\" for goal = \"minimum\""),
            number("over_starts_quantile", Between(0.0, 1.0), "the quantile over the starts that is optimised"),
        ];
    }
}
