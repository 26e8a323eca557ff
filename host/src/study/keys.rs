//! Declares the keys of a study file.

use super::distribution::DISTRIBUTION_WORDS;
use super::metric::METRIC_NAMES;
use super::over::OVER_WORDS;
use super::sampling::SAMPLING_WORDS;
use crate::input::key::DefaultValue::{Number, Word};
use crate::input::key::Need::{Default, Forbidden, If, IfWord, Optional, Required};
use crate::input::key::Range::{Any, Between, Positive, Whole};
use crate::input::key::{KeyedQuantity, MAX_WHOLE, Table, ValueKind, key, number, tables, word};

tables! {
    "All tables of a study."

    "The top level of a study."
    study("") {
        NAME: Optional, [key("name", ValueKind::Text, "name of the study in figures; the file name when left out")];
        CASE: Required, [key("case", ValueKind::Text, "the case that the study varies; relative to this file")];
        METRICS: Required, [key("metrics", ValueKind::Texts, "what is computed at each point, e.g. metrics = [\"x_over_z\"]; docs/STUDIES.md lists them")];
        OBJECTIVE: Optional, [word("objective", METRIC_NAMES, "the metric whose best value is shown and marked; the first metric when left out")];
        GOAL: Default(Word("minimum")), [word("goal", &["minimum", "maximum"], "whether the smallest or the largest value of the objective is the best")];
        POINTS: Optional, [key("points", ValueKind::Text, "a CSV file of points from outside, relative to this file: a line with keys of the case, then a line of numbers for each point; other axes are combined with them")];
        AXIS: If(&POINTS, "points", &Optional, &Required), [key("axis", ValueKind::Tables, "what is varied, a table for each key of the case")];
        SAMPLING: If(&POINTS, "points", &Forbidden, &Optional), [key("sampling", ValueKind::Table, "points drawn from the ranges of the axes without a `count`, in place of a grid")];
        RECORD: Optional, [key("record", ValueKind::Table, "what is counted of each simulation; default: as the case's `run` says")];
        PART: Optional, [number("points_per_part", Whole(1.0, 1e6), "points of a part of the results: a kill costs those being computed; default: about two million cycles")];
        ENSEMBLE: Optional, [key("ensemble", ValueKind::Table, "several starts of the particle at each point")];
        OVERLAY: Optional, [key("overlay", ValueKind::Tables, "curves over the map: where periodic motions of the case change")];
    }

    "An axis: one key of the case and its values."
    axis("axis") {
        KEY: Required, [key("key", ValueKind::Text, "the key with its tables, as in the case: particle.clearance_ratio")];
        FROM: Optional, [number("from", Any, "first value of a range")];
        TO: Optional, [number("to", Any, "last value of the range; greater than `from`")];
        COUNT: Optional, [number("count", Whole(2.0, 1e6), "number of values of the range; left out with [sampling]: drawn from the range")];
        SCALE: Default(Word("linear")), [word("scale", &["linear", "log"], "spacing of the values in the range")];
        DISTRIBUTION: Default(Word("uniform")), [word("distribution", DISTRIBUTION_WORDS, "what a value is drawn from with [sampling]: a range, or a distribution that is cut off at `from` and `to`, by default 4 standard deviations (of the logarithm of a lognormal value) from its middle")];
        MEAN: IfWord(&DISTRIBUTION, "uniform", &Forbidden, &Required), [number("mean", Any, "mean of the value before its distribution is cut off, in the key's unit")];
        STANDARD_DEVIATION: IfWord(&DISTRIBUTION, "uniform", &Forbidden, &Required), [number("standard_deviation", Positive, "standard deviation of the value (not of its logarithm) before its distribution is cut off, in the key's unit")];
        VALUES: Optional, [
            key("values", ValueKind::Numbers(Any), "the values, in place of a range"),
            key("words", ValueKind::Texts, "the values of a key that takes words, in place of a range"),
        ];
        REDUCE: Optional, [word("reduce", &["maximum", "minimum", "mean", "grid_maximum", "scan_maximum"], "the points of this axis become one: the largest (smallest, mean) value over it; over drive frequencies the largest and smallest are looked for between the values too, on 1600 intervals with scan_maximum; grid_maximum is that of the values alone")];
    }

    "Points drawn from the ranges of the axes without a `count`."
    sampling("sampling") {
        METHOD: Required, [word("method", SAMPLING_WORDS, "how points are drawn: a Latin hypercube, Sobol's sequence, or those that sensitivity indices need: Sobol' indices (variance shares) or Morris's elementary effects")];
        COUNT: Required, [number("count", Whole(1.0, 1e8), "number of points; of base points with sobol_indices (count × (ranges + 2) points in all), of trajectories with morris (count × (ranges + 1) points)")];
        SEED: IfWord(&METHOD, "sobol", &Optional, &Default(Number(1.0))), [number("seed", Whole(0.0, MAX_WHOLE), "of the random numbers")];
    }

    "What is counted of each simulation."
    record("record") {
        LENGTH: Required, [
            number("cycles", Whole(1.0, 1e9), "counted cycles of the drive, or of the structure without one"),
            number("duration_s", Positive, "counted time; the cycle maxima are those of its whole cycles"),
        ];
        SETTLE: Default(Number(0.0)), [
            number("settle_cycles", Whole(0.0, 1e9), "cycles simulated before, from rest, not counted"),
            number("settle_s", Positive, "time simulated before, from rest, not counted; rounded up to whole cycles"),
        ];
    }

    "Curves over the map of a study: where a periodic motion of the case changes, in the two keys that the study varies."
    overlay("overlay") {
        CONTINUATION: Required, [key("continuation", ValueKind::Text, "a continuation file with a table [second], relative to this file; its case and its two parameters are those of the study")];
    }

    "Several starts of the particle at each point."
    ensemble("ensemble") {
        STARTS: Required, [number("starts", Whole(2.0, 10_000.0), "number of starts, evenly spread from one wall to the other")];
        OVER: Default(Word("worst")), [word("over", OVER_WORDS, "the value over the starts that maps, curves and the best point have: the worst, that which 95 % are as good as, the median or the mean")];
        QUANTILES: Optional, [key("quantiles", ValueKind::Numbers(Between(0.0, 1.0)), "quantiles over the starts that the table has; default: 0.05, 0.5 and 0.95")];
    }
}

/// The tables that an optimisation has too.
pub const SHARED: [Table; 2] = [axis::TABLE, record::TABLE];
