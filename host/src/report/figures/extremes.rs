//! Test: figures of extreme values are drawn, and say how many values are not on them.

use super::frequency_response::{Ordinate, ResponseCurve, ResponseNotes, ResponsePoint};
use super::study_curves::{Curve, CurveLabels, Mark};
use super::study_map::{MapAxis, StudyMap};
use super::time_histories::{HistoryCurve, HistoryPanel};
use super::{bifurcation, branches, curves, frequency_response, study_curves, study_map, time_histories};
use crate::continuation::{FoundBranch, FoundBranches, FoundCurve, FoundOrbit, FoundSpecial};
use crate::report::plot::axis::Scale;
use crate::report::plot::palette::Look;
use crate::report::plot::{Breadth, Picture};
use crate::study::bifurcation::{Direction, Sample};

/// Values that no simulation should give, and that one may.
const EXTREMES: [f64; 10] =
    [1e308, -1e308, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 5e-324, 0.0, -3.0, 1e29, f64::MAX];

/// Sets of sixteen values: one extreme value everywhere, one among usual values, two of them, and any.
fn sets() -> Vec<Vec<f64>> {
    let usual = |place: usize| 1.0 + place as f64 / 7.0;
    let mut sets: Vec<Vec<f64>> = EXTREMES.iter().map(|extreme| vec![*extreme; 16]).collect();
    for a in EXTREMES {
        sets.push((0..16).map(|place| if place == 5 { a } else { usual(place) }).collect());
        for b in EXTREMES {
            sets.push((0..16).map(|place| if place % 2 == 0 { a } else { b }).collect());
        }
    }
    let mut random = fastrand::Rng::with_seed(3);
    sets.extend((0..50).map(|_| (0..16).map(|_| EXTREMES[random.usize(..EXTREMES.len())]).collect()));
    // Any bits are a value.
    sets.extend((0..50).map(|_| (0..16).map(|_| f64::from_bits(random.u64(..))).collect()));
    sets
}

/// Checks that the figure is finite, small and says what it leaves out.
fn check(picture: &Picture, values: impl IntoIterator<Item = f64>, shown: &[f64]) {
    let svg = picture.svg();
    assert!(!svg.contains("NaN") && !svg.contains("\"inf") && svg.len() < 400_000, "{shown:?}");
    match Scale::Linear.undrawn(values) {
        None => assert!(!svg.contains("are not drawn"), "{shown:?}"),
        Some(words) => assert!(svg.contains(&words), "no {words:?} for {shown:?}"),
    }
}

fn map(values: &[f64]) -> StudyMap {
    let axis = || MapAxis { label: "a".into(), values: vec![1.0, 2.0, 3.0, 4.0], is_log: false };
    StudyMap {
        title: "m".into(),
        x: axis(),
        y: axis(),
        label: "b".into(),
        values: values.to_vec(),
        marked: vec![("odd".into(), (0..16).map(|place| place % 3 == 0).collect())],
        curves: Vec::new(),
        best: Some(((2.0, 3.0), "best".into())),
    }
}

#[test]
fn maps_of_extreme_values_say_how_many_are_not_drawn() {
    for values in sets() {
        check(&study_map::draw(&map(&values)).expect("a map"), values.iter().copied(), &values);
    }
    let picture = study_map::draw(&map(&[&[1e308, f64::NEG_INFINITY][..], &[2.0; 14]].concat())).expect("a map");
    assert!(picture.svg().contains("2 of 16 values are not drawn: infinite or beyond ±1e30"));
    assert!(picture.png().is_ok());
    let far = StudyMap {
        x: MapAxis { label: "far".into(), values: vec![1.0, 2.0, 3.0, 1e308], is_log: false },
        ..map(&[1.0; 16])
    };
    assert!(
        study_map::draw(&far)
            .is_err_and(|error| error.to_string().contains("1e308") && error.to_string().contains("far"))
    );
}

#[test]
fn curves_of_extreme_values_say_how_many_are_not_drawn() {
    for values in sets() {
        for (is_log, is_scattered) in [(false, false), (true, true)] {
            let points: Vec<(f64, f64)> = (1u8..).map(f64::from).zip(values.iter().copied()).collect();
            let band = points.iter().map(|(x, y)| (*x, *y, 2.0 * y)).collect();
            let curve = Curve { label: "c".into(), points: points.clone(), band, is_scattered };
            let labels = CurveLabels {
                title: "t".into(),
                x: "x".into(),
                is_log,
                y: "y".into(),
                best: Some((points[0], "best".into())),
                marks: vec![Mark { at: points[5], curve: 0, is_measured: true }],
            };
            check(
                &study_curves::draw(&[curve.clone(), curve], &labels, Breadth::Broad),
                [values.clone(), values.clone()].concat(),
                &values,
            );
        }
    }
    assert!(
        study_curves::draw(&[], &CurveLabels { is_log: true, ..CurveLabels::default() }, Breadth::Narrow,)
            .png()
            .is_ok()
    );
}

#[test]
fn bifurcations_of_extreme_values_say_how_many_are_not_drawn() {
    for values in sets() {
        let sample = |(place, value): (usize, &f64)| Sample {
            direction: if place % 2 == 0 { Direction::Up } else { Direction::Down },
            value: place as f64,
            x_m: *value,
            v_m_per_s: *value,
            offset_m: 0.0,
            slide_m_per_s: 0.0,
            cycle_max_m: *value,
        };
        let samples: Vec<Sample> = values.iter().enumerate().map(sample).collect();
        let both = || values.iter().chain(&values).map(|value| value * 1e3);
        check(&bifurcation::diagram(&samples, "d/Z", "t"), both(), &values);
        check(&bifurcation::section(&samples, "t"), both(), &values);
    }
    assert!(bifurcation::diagram(&[], "d/Z", "t").png().is_ok() && bifurcation::section(&[], "t").png().is_ok());
}

#[test]
fn responses_and_histories_of_extreme_values_say_how_many_are_not_drawn() {
    for values in sets() {
        let point = |(place, value): (usize, &f64)| ResponsePoint {
            frequency_hz: 2.0 + 0.1 * place as f64,
            value: *value,
            is_settled: true,
            half_width: value.abs() / 7.0,
            repeats: if place % 5 == 0 { vec![*value, 1.1 * value, 0.9] } else { Vec::new() },
        };
        let curve = ResponseCurve {
            label: "c".into(),
            detail: "d".into(),
            points: values.iter().enumerate().map(point).collect(),
            place: 0,
            look: Look::default(),
            unresolved_peak_hz: values.iter().position(|v| *v > 0.0).map(|place| 2.0 + 0.1 * place as f64),
        };
        for scale in [Scale::Linear, Scale::Log] {
            let quantity = Ordinate { label: "y", rings_peaks: true, scale };
            let notes = ResponseNotes { natural_frequency_hz: Some(1.0), caption: "c.".into() };
            for breadth in [Breadth::Broad, Breadth::Narrow] {
                let drawn = frequency_response::draw(std::slice::from_ref(&curve), &quantity, &notes, breadth);
                check(&drawn, values.iter().copied(), &values);
            }
        }
        let history = HistoryCurve {
            look: Look::default(),
            label: "c".into(),
            points: (0u8..).map(f64::from).zip(values.iter().copied()).collect(),
        };
        let panel = HistoryPanel { title: "t".into(), curves: vec![history], base: None };
        check(&time_histories::draw(&[panel]), values.iter().map(|value| value * 1e3), &values);
    }
}

#[test]
fn branches_and_curves_of_extreme_values_are_drawn_and_say_how_many_are_not() {
    for values in sets() {
        let orbit = |(place, value): (usize, &f64)| FoundOrbit {
            parameter: place as f64,
            is_stable: place % 4 < 2,
            max_abs_x_m: *value,
            mean_cycle_max_m: *value,
            max_abs_y_minus_x_m: *value,
            impacts: 2,
            fastest_impact_m_per_s: *value,
            multipliers: vec![[*value, 0.0]],
        };
        let special = FoundSpecial {
            kind: "fold",
            meaning: String::new(),
            parameter: 5.0,
            parameter_error: 0.0,
            max_abs_x_m: values[5],
            after_orbits: 5,
        };
        let branch = FoundBranch {
            number: 1,
            origin: String::new(),
            periods: 1,
            ends: ["", ""],
            special_points: vec![special],
            orbits: values.iter().enumerate().map(orbit).collect(),
        };
        let curve = FoundCurve {
            branch: 1,
            kind: "fold",
            meaning: String::new(),
            ends: ["", ""],
            points: values.iter().enumerate().map(|(place, value)| [place as f64, *value, *value]).collect(),
        };
        let found = FoundBranches {
            case: "case".into(),
            case_text: String::new(),
            walls: None,
            parameter: "base.frequency_hz".into(),
            reference: "Z",
            branches: vec![branch],
            not_covered: Vec::new(),
            gaps: Vec::new(),
            not_started: Vec::new(),
            is_cut_short: false,
            second_parameter: Some("base.amplitude_m".into()),
            curves: vec![curve],
        };
        check(&branches::draw(&found).expect("branches"), values.iter().map(|value| value * 1e3), &values);
        let picture = curves::draw(&found).expect("curves");
        assert!(!picture.svg().contains("NaN") && !picture.svg().contains("inf,"), "{values:?}");
    }
}
