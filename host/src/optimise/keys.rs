//! Declares the keys of an optimisation file. Its axes and its record have the keys of a study.

use crate::input::key::DefaultValue::{Number, Word};
use crate::input::key::Need::{Default, Forbidden, IfWord, Optional, Required};
use crate::input::key::Range::{Any, Inside, Positive, Whole};
use crate::input::key::{KeyedQuantity, MAX_WHOLE, Table, ValueKind, key, number, tables, word};
use crate::study::distribution::DISTRIBUTION_WORDS;
use crate::study::metric::METRIC_NAMES;
use crate::study::over::OVER_WORDS;

tables! {
    "All tables of an optimisation other than its axes and its record, which are those of a study."

    "The top level of an optimisation."
    optimisation("") {
        NAME: Optional, [key("name", ValueKind::Text, "name of the optimisation; the file name when left out")];
        CASE: Required, [key("case", ValueKind::TextOrCase, "the case that the optimisation varies: its file, relative to this one, or its tables here ([case.structure] and so on)")];
        OBJECTIVE: Required, [word("objective", METRIC_NAMES, "the metric that is to be best; docs/STUDIES.md has their meanings")];
        GOAL: Default(Word("minimum")), [word("goal", &["minimum", "maximum"], "whether the smallest or the largest value of the objective is the best")];
        EVALUATIONS: Optional, [number("evaluations", Whole(100.0, 1e8), "most points that are evaluated; default: 2000 for each variable, 500 with tolerances or uncertain keys")];
        SEED: Default(Number(1.0)), [number("seed", Whole(0.0, MAX_WHOLE), "of the search's random numbers")];
        VARIABLE: Required, [key("variable", ValueKind::Tables, "what is looked for, a table for each key of the case")];
        UNCERTAIN: Optional, [key("uncertain", ValueKind::Tables, "what is not known, a table for each key of the case")];
        ALTERNATIVE: Optional, [key("alternative", ValueKind::Tables, "other dampers, each optimised under the same rules")];
        AXIS: Optional, [key("axis", ValueKind::Tables, "the band that each point is judged over: an axis of a study with `reduce`")];
        CONSTRAINT: Optional, [key("constraint", ValueKind::Tables, "what must hold at every point of the band, from every start, within all tolerances and for all uncertain values")];
        FRONT: Optional, [key("front", ValueKind::Table, "a second objective, and the front of both")];
        RECORD: Optional, [key("record", ValueKind::Table, "what is counted of each simulation, as in a study; default: as the case's `run` says")];
        ENSEMBLE: Optional, [key("ensemble", ValueKind::Table, "what counts of starts, tolerances and uncertain values")];
    }

    "A variable: one key of the case and its range, or the values that there are."
    variable("variable") {
        KEY: Required, [key("key", ValueKind::Text, "the key with its tables, as in the case: particle.clearance_ratio")];
        FROM: Optional, [number("from", Any, "least value")];
        TO: Optional, [number("to", Any, "largest value; greater than `from`")];
        VALUES: Optional, [key("values", ValueKind::Numbers(Any), "the values that there are (a catalogue), in place of a range")];
        STEP: Optional, [number("step", Positive, "the values that can be made are `from` and whole steps from it, in the key's unit")];
        TOLERANCE: Optional, [
            number("tolerance", Positive, "how far from the nominal value the made one may be, to either side, in the key's unit; the objective counts within it. Left out: the nominal value counts, and the answer says what 0.1 % of it (of the range where it is 0) does"),
            number("relative_tolerance", Inside(0.0, 1.0), "the same as a share of the nominal value"),
        ];
        SCALE: Default(Word("linear")), [word("scale", &["linear", "log"], "whether the search is even in the value or in its logarithm")];
    }

    "A key of the case that nobody knows exactly or that changes in use: the objective counts over its values."
    uncertain("uncertain") {
        KEY: Required, [key("key", ValueKind::Text, "the key with its tables, as in the case: particle.wall.coefficient")];
        FROM: Optional, [number("from", Any, "least value; without a distribution all between it and `to` are as likely")];
        TO: Optional, [number("to", Any, "largest value; greater than `from`")];
        SCALE: Default(Word("linear")), [word("scale", &["linear", "log"], "whether the value or its logarithm is as likely everywhere")];
        DISTRIBUTION: Default(Word("uniform")), [word("distribution", DISTRIBUTION_WORDS, "how likely a value is: as likely everywhere in the range, or as a distribution that is cut off at `from` and `to`, by default 4 standard deviations (of the logarithm of a lognormal value) from its middle. The worst counts all values between the ends alike")];
        MEAN: IfWord(&DISTRIBUTION, "uniform", &Forbidden, &Required), [number("mean", Any, "mean of the value before its distribution is cut off, in the key's unit")];
        STANDARD_DEVIATION: IfWord(&DISTRIBUTION, "uniform", &Forbidden, &Required), [number("standard_deviation", Positive, "standard deviation of the value (not of its logarithm) before its distribution is cut off, in the key's unit")];
        VALUES: Optional, [key("values", ValueKind::Numbers(Any), "values that are as likely as each other, in place of a range; the middle one is that of the answer's small changes")];
    }

    "Another damper that is optimised over the same band, with the same objective and record; a constraint on impacts or contact forces is kept where nothing strikes."
    alternative("alternative") {
        NAME: Required, [key("name", ValueKind::Text, "name of the alternative")];
        CASE: Required, [key("case", ValueKind::TextOrCase, "its case: a file, or tables that take the place of the case's own and of all its dampers: case = { friction_damper = { force_n = 5 } }")];
        VARIABLE: Optional, [key("variable", ValueKind::Tables, "as [[variable]]; none: the case as it is")];
        UNCERTAIN: Optional, [key("uncertain", ValueKind::Tables, "as [[uncertain]]")];
    }

    "A constraint on a metric, at every point of the band, from every start, within all tolerances and for all uncertain values."
    constraint("constraint") {
        METRIC: Required, [word("metric", METRIC_NAMES, "the metric; docs/STUDIES.md has their meanings")];
        LIMIT: Required, [
            number("at_most", Any, "largest allowed value, in the metric's unit"),
            number("at_least", Any, "least allowed value, in the metric's unit"),
            number("equals", Any, "the only allowed value: period_cycles = 1"),
        ];
    }

    "A second objective: the front has the best value of the objective for each of some limits of this metric, which counts as in a constraint."
    front("front") {
        METRIC: Required, [word("metric", METRIC_NAMES, "the second objective's metric; docs/STUDIES.md has their meanings")];
        GOAL: Default(Word("minimum")), [word("goal", &["minimum", "maximum"], "whether its smallest or its largest value is the best")];
        COUNT: Default(Number(9.0)), [number("count", Whole(3.0, 101.0), "most points of the front; each is an optimisation")];
    }

    "What counts of everything that is not certain: starts, tolerances and uncertain values."
    ensemble("ensemble") {
        STARTS: Optional, [number("starts", Whole(2.0, 10_000.0), "number of starts of the particle at each point, evenly spread from one wall to the other; left out: the case's own")];
        OVER: Default(Word("worst")), [word("over", OVER_WORDS, "the value over all of them that is optimised: the worst, that which 95 % are as good as, the median or the mean")];
    }
}
