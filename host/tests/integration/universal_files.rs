//! Universal files (UFF, UNV) of other programs and of a run.

use std::path::Path;

use crate::common::{damprig, field, folder_with};
use crate::signal_files::{files, only};
use damprig::signal_file::unit::UnitKind;
use damprig::signal_file::{Signal, parse, read};

/// Values, their sum, the sum of their magnitudes, and the places, as pyuff 2.5 reads them.
struct Expected(&'static str, usize, f64, f64, f64, f64);

fn check_uff(folder: &Path, Expected(file, count, sum, magnitudes, first, last): &Expected) {
    let signal = only(read(&folder.join(file)).unwrap());
    assert_eq!(signal.values.len(), *count, "{file}");
    let of = |n: usize| signal.values[n].hypot(signal.imaginary.as_ref().map_or(0.0, |imaginary| imaginary[n]));
    // The sums are rounded in another order.
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-12 * magnitudes.max(1.0);
    assert!(close(signal.values.iter().sum(), *sum), "{file}");
    assert!(close((0..*count).map(of).sum(), *magnitudes), "{file}");
    assert!(close(signal.axis.at(0), *first) && close(signal.axis.at(count - 1), *last), "{file}");
}

#[test]
fn universal_files_of_other_programs_give_what_pyuff_reads() {
    let folder = files().join("uff");
    for expected in [
        Expected("binary8byte.uff", 250, 6.313748425276373, 157.84385135698756, 0.0, 2.49),
        Expected("dataset_milestone_in_header.uff", 42, -0.04821587846, 0.21782363954, 1.11858e-5, 0.000811965),
        Expected("non_ascii_header.uff", 6, 2.0227436, 8.092115415616368, 0.0, 0.976565),
        Expected("time-history-not-all-columns-filled.uff", 13, -47.70823, 47.70823, 0.0, 0.0006),
    ] {
        check_uff(&folder, &expected);
    }
    let unit = |file: &str| {
        let signal = only(read(&folder.join(file)).unwrap());
        (signal.kind(), signal.unit.map(|unit| unit.si), signal.axis.is_time())
    };
    assert_eq!(unit("binary8byte.uff"), (Some(UnitKind::Acceleration), Some(9.80665), true));
    assert_eq!(unit("time-history-not-all-columns-filled.uff"), (Some(UnitKind::Acceleration), Some(1.0), true));
    assert_eq!(unit("dataset_milestone_in_header.uff"), (Some(UnitKind::Pressure), Some(1.0), true));
    // A unit that is not known is not guessed.
    assert_eq!(unit("non_ascii_header.uff"), (None, None, false));
    let cut = only(read(&folder.join("dataset_milestone_in_header.uff")).unwrap()).remark.unwrap();
    assert!(cut.contains("42 of 2508876 values: the file is cut short"), "{cut}");
    let other = read(&folder.join("1858.uff")).unwrap();
    assert!(other.signals.is_empty() && other.remarks[0].contains("(1858) is not read"), "{:?}", other.remarks);
}

#[test]
fn large_universal_files_give_what_pyuff_reads() {
    let (Some(folder), count) = (field("uff"), 79292) else { return };
    for expected in [
        Expected("Sample_UFF58_ascii.uff", count, 5.715039728042096, 845.5341488043879, 0.0, 1.2098855108),
        Expected("Sample_UFF58b_bin.uff", count, 5.715040058740556, 845.5341574322093, 0.0, 1.2098855108),
    ] {
        check_uff(&folder, &expected);
    }
}

#[test]
fn a_runs_universal_file_can_be_inspected_and_its_signals_read() {
    let folder = folder_with(&crate::common::short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    damprig(&folder).args(["runs", "export", "out", "--format", "uff", "--out", "run.uff"]).assert().success();
    let contents = read(&folder.path().join("run.uff")).unwrap();
    let kinds: Vec<Option<UnitKind>> = contents.signals.iter().map(Signal::kind).collect();
    assert!(kinds.contains(&Some(UnitKind::Displacement)), "{kinds:?}");
    assert!(contents.signals.iter().any(|signal| signal.imaginary.is_some()), "no frequency response");
    assert!(contents.signals.iter().any(|signal| signal.axis.is_time()), "no time history");
}

/// A dataset 58 of five values as the format's description has it: data type 2, 4, 5 or 6 (real or complex, single or double precision).
fn dataset_58(kind: u32, is_even: bool, order: Option<u32>, has_wide_abscissa: bool) -> Vec<u8> {
    let (is_complex, is_double) = (kind > 4, matches!(kind, 4 | 6));
    let mut values = Vec::new();
    for n in 0..5 {
        let place = (!is_even).then(|| PLACES[n]);
        values.push((place, VALUES[n], is_complex.then(|| -VALUES[n])));
    }
    let abscissa = if is_complex { (18, "Frequency", "Hz") } else { (17, "Time", "s") };
    let spacing = if is_even { "1  0.00000E+00  1.00000E-01" } else { "0  0.00000E+00  0.00000E+00" };
    let axis = |(kind, label, unit): (u32, &str, &str)| format!("{kind:>10}    0    0    0 {label:<20} {unit:<20}\n");
    let header = format!(
        "id\nNONE\nNONE\nNONE\nNONE\n    1         0    0         0 NONE               1   1 NONE               1   1\n\
         {kind:>10}         5         {spacing}  0.00000E+00\n{}{}{}{}",
        axis(abscissa),
        axis((12, "a", "m/s2")),
        axis((0, "NONE", "NONE")),
        axis((0, "NONE", "NONE"))
    );
    let Some(order) = order else {
        // Fields of 13 or 20 characters; negative values touch those before.
        let field = |value: f64| if is_double { format!("{value:>20.11e}") } else { format!("{value:>13.5e}") };
        let row = |(place, value, imaginary): &(Option<f64>, f64, Option<f64>)| {
            let place = place.map_or(String::new(), |place| format!("{place:>13.5e}"));
            format!("{place}{}{}\n", field(*value), imaginary.map_or(String::new(), field))
        };
        let rows: String = values.iter().map(row).collect();
        return format!("    -1\n    58\n{header}{rows}    -1\n").into_bytes();
    };
    let number = |value: f64, is_wide: bool| -> Vec<u8> {
        match (is_wide, order) {
            (true, 1) => value.to_le_bytes().to_vec(),
            (true, _) => value.to_be_bytes().to_vec(),
            (false, 1) => (value as f32).to_le_bytes().to_vec(),
            (false, _) => (value as f32).to_be_bytes().to_vec(),
        }
    };
    let mut bytes = Vec::new();
    for (place, value, imaginary) in values {
        bytes.extend(place.into_iter().flat_map(|place| number(place, is_double && has_wide_abscissa)));
        bytes.extend(number(value, is_double));
        bytes.extend(imaginary.into_iter().flat_map(|imaginary| number(imaginary, is_double)));
    }
    let first = format!(
        "    -1\n    58b     {order}     2          11{:>12}     0     0           0           0\n",
        bytes.len()
    );
    [first.as_bytes(), header.as_bytes(), &bytes, b"\n    -1\n"].concat()
}

/// Exact in single precision and in five decimals.
const PLACES: [f64; 5] = [0.0, 0.125, 0.25, 0.5, 1.0];
const VALUES: [f64; 5] = [1.5, -2.25, 3.0, 4.5, -6.0];

#[test]
fn every_form_of_dataset_58_gives_the_same_values() {
    for kind in [2, 4, 5, 6] {
        for is_even in [true, false] {
            for order in [None, Some(1), Some(2)] {
                // The description has abscissas of single precision; some programs write them in double precision.
                for has_wide_abscissa in [false, true] {
                    let form = format!("data type {kind}, even {is_even}, order {order:?}, wide {has_wide_abscissa}");
                    let signal = only(parse(&dataset_58(kind, is_even, order, has_wide_abscissa)).unwrap());
                    assert_eq!(signal.values, VALUES, "{form}");
                    let expected: Option<Vec<f64>> = (kind > 4).then(|| VALUES.iter().map(|value| -value).collect());
                    assert_eq!(signal.imaginary, expected, "{form}");
                    let at: Vec<f64> = (0..5).map(|n| signal.axis.at(n)).collect();
                    let places = if is_even {
                        [0.0, 0.1, 0.2, 0.3, 0.4].map(|at: f64| (at * 10.0).round() * 0.1)
                    } else {
                        PLACES
                    };
                    assert!(at.iter().zip(places).all(|(a, b)| (a - b).abs() < 1e-12), "{form}: {at:?}");
                    assert_eq!(signal.axis.is_time(), kind < 5, "{form}");
                }
            }
        }
    }
}
