//! Judges the source document's claims by what was computed. Each claim is a file with a written rule and a function that applies it to
//! the numbers.

mod evidence;
mod forced;
mod free;
mod friction;
mod hybrid;
mod particles;
mod tables;

use serde::Serialize;

use super::catalogue::Catalogue;
use super::published::Published;
use super::results::{ResultError, Results};

pub use evidence::Evidence;

/// The result of a judge: what it found, or a result that it could not read.
pub type Judged = Result<Judgement, ResultError>;

/// A function that judges a claim.
pub type Judge = fn(&Evidence) -> Judged;

/// All judges, in the order of the claims.
pub const ALL: [(u32, &str, Judge); 14] = [
    (1, "Table 3-4", tables::peaks_of_the_impact_damper),
    (2, "Table 4-6", tables::peaks_with_soft_walls),
    (3, "Best clearance and restitution in free vibration", free::best_clearance_and_restitution),
    (4, "Internal friction only harms", friction::only_harms),
    (5, "Faster than the tuned mass in free vibration", free::faster_than_the_tuned_mass),
    (6, "Only d/Z matters", forced::only_the_ratio_matters),
    (7, "Restitution at small clearance", forced::restitution_at_small_clearance),
    (8, "Steady response at d/Z = 14", forced::steady_at_fourteen),
    (9, "Best clearance and restitution at resonance", forced::best_design),
    (10, "The friction damper alone", hybrid::friction_alone),
    (11, "Four strongly damped cycles", hybrid::four_strong_cycles),
    (12, "The hybrid damper beside the tuned mass", hybrid::close_to_the_tuned_mass),
    (13, "The hybrid damper in an earthquake", hybrid::best_in_an_earthquake),
    (14, "One particle or many", particles::one_particle_or_many),
];

/// Judges every claim. One whose results are missing or cannot be read is not judged, and says why.
#[must_use]
pub fn judge_all(catalogue: &Catalogue, results: &Results, published: &Published) -> Vec<Judgement> {
    let judged = |&(number, claim, judge): &(u32, &str, Judge)| {
        let evidence = Evidence::new(catalogue, results, published);
        judge(&evidence).unwrap_or_else(|error| Judgement {
            number,
            claim: claim.into(),
            verdict: Verdict::NotJudged(error.to_string()),
            rule: String::new(),
            numbers: Vec::new(),
            reason: String::new(),
            not_computed: evidence.not_computed(),
        })
    };
    ALL.iter().map(judged).collect()
}

/// Whether a claim holds, by which rule and numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judgement {
    /// Number of the claim, from 1.
    pub number: u32,
    /// The claim, in our words.
    pub claim: String,
    /// The verdict.
    pub verdict: Verdict,
    /// The rule by which the verdict follows from the numbers.
    pub rule: String,
    /// The numbers.
    pub numbers: Vec<Number>,
    /// Why, in words.
    pub reason: String,
    /// Parts (item/part) that the rule asks for and that have not been computed: with them the verdict may be another.
    pub not_computed: Vec<String>,
}

impl Judgement {
    /// The verdict with its condition or reason, and how many readings it does without.
    #[must_use]
    pub fn words(&self) -> String {
        let (words, detail) = (self.verdict.words(), self.verdict.detail());
        let verdict = match detail {
            "" => words.to_owned(),
            _ if words.ends_with('…') => words.replace('…', detail),
            _ => format!("{words}: {detail}"),
        };
        verdict + &self.without()
    }

    /// How many readings the verdict does without, in parentheses; empty if none.
    #[must_use]
    pub fn without(&self) -> String {
        match (&self.verdict, self.not_computed.len()) {
            (Verdict::NotJudged(_), _) | (_, 0) => String::new(),
            (_, 1) => " (one reading is not computed)".into(),
            (_, count) => format!(" ({count} readings are not computed)"),
        }
    }
}

/// A verdict.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The claim holds.
    Holds,
    /// It holds only under this condition.
    HoldsOnlyIf(String),
    /// It does not hold.
    DoesNotHold,
    /// It could not be judged, for this reason.
    NotJudged(String),
}

impl Verdict {
    /// In words, without condition or reason.
    #[must_use]
    pub const fn words(&self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::HoldsOnlyIf(_) => "holds only if …",
            Self::DoesNotHold => "does not hold",
            Self::NotJudged(_) => "not judged",
        }
    }

    /// The condition or the reason; empty if there is none.
    #[must_use]
    pub fn detail(&self) -> &str {
        match self {
            Self::HoldsOnlyIf(text) | Self::NotJudged(text) => text,
            Self::Holds | Self::DoesNotHold => "",
        }
    }
}

/// A number behind a verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Number {
    /// What it is.
    pub label: String,
    /// Its value; not a number if it could not be had.
    pub value: f64,
    /// Symbol of its unit; empty for a plain number.
    pub unit: &'static str,
    /// The published value, if there is one.
    pub published: Option<f64>,
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow_array::{ArrayRef, Float64Array, RecordBatch};

    use super::*;
    use crate::files;
    use damprig::run_folder::sealed_parquet;
    use damprig::study::data_set::TABLE;

    /// Computed tables of a few parts, made up.
    struct Made {
        folder: tempfile::TempDir,
        catalogue: Catalogue,
        published: Published,
    }

    impl Made {
        fn new() -> Self {
            let folder = tempfile::tempdir().expect("a temporary folder");
            let shipped = files::write_out(folder.path()).expect("the shipped files");
            let catalogue = Catalogue::read(&shipped).expect("the shipped items");
            let published = Published::read(&catalogue).expect("the shipped values");
            Self { folder, catalogue, published }
        }

        fn table(self, item: &str, part: &str, columns: &[(&str, &[f64])]) -> Self {
            let arrays = columns.iter().map(|(name, values)| {
                let array: ArrayRef = Arc::new(Float64Array::from(values.to_vec()));
                (name.to_string(), array)
            });
            let table = RecordBatch::try_from_iter(arrays).expect("columns of equal length");
            let folder = self.folder.path().join(item).join(part);
            std::fs::create_dir_all(&folder).expect("a folder");
            std::fs::write(folder.join(TABLE), sealed_parquet::bytes(&table).expect("a table")).expect("a file");
            self
        }

        fn judge(&self, judge: Judge) -> Judged {
            let results = Results::at(self.folder.path());
            judge(&Evidence::new(&self.catalogue, &results, &self.published))
        }

        fn verdict(&self, judge: Judge) -> Verdict {
            self.judge(judge).expect("all tables that the judge needs").verdict
        }
    }

    fn peaks(part: &str, values: [f64; 3], made: Made) -> Made {
        made.table("table-3-4", part, &[("particle.clearance_ratio", &[5.0, 10.0, 15.0]), ("x_over_z", &values)])
    }

    #[test]
    fn a_table_holds_if_main_reading_and_converged_response_reproduce_it() {
        let printed = [35.6, 17.2, 9.3];
        let made = peaks("converged", printed, peaks("r1", printed, Made::new()));
        assert_eq!(made.verdict(tables::peaks_of_the_impact_damper), Verdict::Holds);
    }

    #[test]
    fn a_table_that_only_another_reading_reproduces_holds_only_under_it() {
        let made = peaks("grid-01", [35.0, 17.5, 9.1], peaks("r1", [32.0, 21.6, 11.4], Made::new()));
        let verdict = made.verdict(tables::peaks_of_the_impact_damper);
        assert_eq!(verdict, Verdict::HoldsOnlyIf("the grid is 0.1 Hz".into()));
    }

    #[test]
    fn a_table_that_no_reading_reproduces_does_not_hold() {
        let made = peaks("grid-01", [29.3, 17.8, 9.2], peaks("r1", [32.0, 21.6, 11.4], Made::new()));
        assert_eq!(made.verdict(tables::peaks_of_the_impact_damper), Verdict::DoesNotHold);
    }

    #[test]
    fn a_verdict_counts_the_readings_that_are_not_computed() {
        let made = peaks("grid-01", [29.3, 17.8, 9.2], peaks("r1", [32.0, 21.6, 11.4], Made::new()));
        let results = Results::at(made.folder.path());
        let judgements = judge_all(&made.catalogue, &results, &made.published);
        let table = &judgements[0];
        assert!(table.not_computed.contains(&"table-3-4/starts".into()), "{:?}", table.not_computed);
        assert!(!table.not_computed.contains(&"table-3-4/grid-01".into()), "{:?}", table.not_computed);
        assert_eq!(table.words(), format!("does not hold ({} readings are not computed)", table.not_computed.len()));
    }

    /// In that reading the printed d/Z = 5 is 2.5 here.
    #[test]
    fn a_reading_with_another_clearance_is_compared_at_its_own_rows() {
        let whole: (&str, &[f64]) = ("particle.clearance_ratio", &[2.5, 5.0, 7.5]);
        let made = peaks("r1", [32.0, 21.6, 11.4], Made::new());
        let made = made.table("table-3-4", "whole-travel", &[whole, ("x_over_z", &[35.6, 17.2, 9.3])]);
        let verdict = made.verdict(tables::peaks_of_the_impact_damper);
        assert_eq!(verdict, Verdict::HoldsOnlyIf("d is the whole free travel".into()));
    }

    #[test]
    fn the_length_of_the_records_that_gives_a_growing_peak_is_interpolated() {
        let ratios: &[f64] = &[0.6, 0.8];
        let peak = |part: &str, values: &[f64], made: Made| {
            made.table("fig-5-9", part, &[("friction_damper.friction_ratio", ratios), ("x_over_z", values)])
        };
        let mut made = peak("steady", &[31.0, 2.7], peak("damped", &[17.6, 3.0], Made::new()));
        for (part, value) in [("peak-16-s", 16.0), ("peak-32-s", 32.0), ("peak-64-s", 64.0)] {
            made = peak(part, &[value, 2.6], made);
        }
        let judgement = made.judge(hybrid::friction_alone).expect("all tables");
        let length = judgement.numbers.iter().find(|number| number.unit == "s").map(|number| number.value);
        assert_eq!(length, Some(20.0));
        assert!(matches!(judgement.verdict, Verdict::HoldsOnlyIf(_)));
        // A steady peak of 20 would confirm the claim.
        let made = peak("steady", &[20.5, 2.7], made);
        assert_eq!(made.verdict(hybrid::friction_alone), Verdict::Holds);
    }

    #[test]
    fn a_response_that_scales_only_without_friction_holds_only_without_it() {
        let columns = |with: f64| -> Vec<(&str, Vec<f64>)> {
            vec![
                ("base.amplitude_m", vec![0.003, 0.003, 0.006, 0.006]),
                ("particle.friction_coefficient", vec![0.0, 0.08, 0.0, 0.08]),
                ("particle.clearance_ratio", vec![5.0; 4]),
                ("base.frequency_hz", vec![2.5; 4]),
                ("x_over_z", vec![10.0, 9.0, 10.0, with]),
            ]
        };
        let verdict = |with: f64| {
            let columns = columns(with);
            let columns: Vec<(&str, &[f64])> =
                columns.iter().map(|(name, values)| (*name, values.as_slice())).collect();
            Made::new().table("fig-3-13", "friction", &columns).verdict(forced::only_the_ratio_matters)
        };
        assert_eq!(verdict(9.0), Verdict::Holds);
        assert_eq!(verdict(11.0), Verdict::HoldsOnlyIf("there is no internal friction".into()));
    }

    /// A verdict from nothing would be one without reason.
    #[test]
    fn a_claim_whose_table_lacks_a_number_or_a_row_is_not_judged() {
        let peak = |last: f64| -> Judged {
            let columns: [(&str, &[f64]); 3] = [
                ("particle.clearance_ratio", &[5.0, 5.0, 15.0, 15.0]),
                ("particle.wall.coefficient", &[0.0, 0.5, 0.0, 0.5]),
                ("x_over_z", &[40.0, 41.0, 10.0, last]),
            ];
            Made::new().table("fig-3-14", "peak", &columns).judge(forced::restitution_at_small_clearance)
        };
        let verdict = peak(30.0).expect("all numbers").verdict;
        assert_eq!(verdict, Verdict::HoldsOnlyIf("e is at most 0.500".into()), "nothing is known above");
        let error = peak(f64::NAN).expect_err("a number is missing").to_string();
        assert!(error.contains("fig-3-14/peak: x_over_z has no value in row 3"), "{error}");
        let columns: [(&str, &[f64]); 5] = [
            ("base.amplitude_m", &[0.003, 0.006]),
            ("particle.friction_coefficient", &[0.04, 0.08]),
            ("particle.clearance_ratio", &[5.0, 5.0]),
            ("base.frequency_hz", &[2.5, 2.5]),
            ("x_over_z", &[10.0, 10.0]),
        ];
        let without_zero = Made::new().table("fig-3-13", "friction", &columns).judge(forced::only_the_ratio_matters);
        assert!(without_zero.expect_err("no row without friction").to_string().contains("internal friction 0"));
    }

    #[test]
    fn a_claim_without_its_results_is_not_judged_and_names_the_command() {
        let made = Made::new();
        let results = Results::at(made.folder.path());
        let judgements = judge_all(&made.catalogue, &results, &made.published);
        assert_eq!(judgements.len(), ALL.len());
        for judgement in judgements {
            let Verdict::NotJudged(reason) = judgement.verdict else { panic!("claim {} was judged", judgement.number) };
            assert!(reason.contains("damprig-thesis"), "{reason}");
        }
    }
}
