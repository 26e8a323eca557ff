//! The points to measure next: their derivatives, what they narrow on drawn rigs, and the command on a run of the virtual rig.

use damprig::identify::next::{CandidatePoint, IdentifiedParameter, MeasurableSetUp, ParameterCovariance};
use damprig_continuation::Parameter;
use damprig_core::model::{Cavity, FrictionDamper, Particle, SetUp, Structure, Wall};
use nalgebra::{DMatrix, DVector};
use predicates::prelude::*;
use predicates::str::contains;
use rayon::prelude::*;

use crate::common::{damprig, folder_with, is_full};

/// Relative standard uncertainties before, of fn, ζ, d, e and F.
const BEFORE: [(&str, Parameter, f64); 5] = [
    ("structure.natural_frequency_hz", Parameter::NaturalFrequency, 0.002),
    ("structure.damping_ratio", Parameter::StructureDampingRatio, 0.1),
    ("particle.clearance_m", Parameter::Clearance, 0.02),
    ("particle.wall.coefficient", Parameter::Restitution, 0.05),
    ("friction_damper.force_n", Parameter::DamperForce, 0.05),
];

/// Relative standard uncertainty of a point, and of X/Z by the scales of both sensors.
const OF_POINT: f64 = 0.005;
const OF_SCALE: f64 = 0.002;

/// Largest |x|, m.
const LIMIT_M: f64 = 0.078;

fn bare(fn_hz: f64, zeta: f64) -> MeasurableSetUp {
    MeasurableSetUp {
        name: "bare".into(),
        label: "bare".into(),
        model: SetUp::bare(Structure::from_modal(1.6, fn_hz, zeta)),
        base_amplitude_m: 4e-4,
        start_m: 0.0,
        own: vec![0, 1],
        measured: vec![(0.0, Some(OF_POINT))],
    }
}

fn normal(random: &mut fastrand::Rng) -> f64 {
    (0..12).map(|_| random.f64()).sum::<f64>() - 6.0
}

/// A rig: its set-ups at the identified values, the parameters, and the true values.
struct Drawn {
    set_ups: Vec<MeasurableSetUp>,
    all: Vec<IdentifiedParameter>,
    truth: Vec<f64>,
    random: fastrand::Rng,
}

impl Drawn {
    /// A bare structure, an impact damper, a friction damper and both, whose identified values are off by their uncertainty.
    fn of(seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * random.f64();
        let (fn_hz, zeta) = (between(2.2, 2.8), between(0.004, 0.012));
        let base_m = 1.5e-3;
        let bare = bare(fn_hz, zeta);
        let force_n = between(0.2, 0.6) * bare.model.structure.stiffness_n_per_m * base_m;
        let (clearance_m, e) = (base_m * between(5.0, 15.0), between(0.4, 0.85));
        let particle = Particle {
            mass_kg: 0.16,
            clearance_m,
            friction_coefficient: 0.0,
            wall: Wall::Restitution { coefficient: e },
            cavity: Cavity::default(),
        };
        let with = |name: &str, particle: Option<Particle>, force_n: Option<f64>, own: &[usize]| MeasurableSetUp {
            name: name.into(),
            model: SetUp { particle, friction_damper: force_n.map(|force_n| FrictionDamper { force_n }), ..bare.model },
            base_amplitude_m: base_m,
            own: own.to_vec(),
            ..bare.clone()
        };
        let true_set_ups = [
            bare.clone(),
            with("spid", Some(particle), None, &[0, 1, 2, 3]),
            with("fd", None, Some(force_n), &[0, 1, 4]),
            with("hybrid", Some(particle), Some(force_n), &[0, 1, 2, 3, 4]),
        ];
        let truth = vec![fn_hz, zeta, clearance_m, e, force_n];
        let all: Vec<IdentifiedParameter> = BEFORE
            .iter()
            .zip(&truth)
            .map(|((key, parameter, share), truth)| IdentifiedParameter {
                key: (*key).into(),
                value: truth * (1.0 + share * normal(&mut random)),
                standard_uncertainty: share * truth,
                set_ups: Vec::new(),
                parameter: *parameter,
            })
            .collect();
        let mut drawn = Self { set_ups: true_set_ups.to_vec(), all, truth, random };
        let identified: Vec<f64> = drawn.all.iter().map(|of| of.value).collect();
        drawn.set_ups = (0..4).map(|n| drawn.at(n, &identified)).collect();
        drawn
    }

    /// A set-up at these values of the parameters.
    fn at(&self, set_up: usize, values: &[f64]) -> MeasurableSetUp {
        let own = &self.set_ups[set_up];
        let settings: Vec<(Parameter, f64)> = own.own.iter().map(|n| (self.all[*n].parameter, values[*n])).collect();
        own.at(&settings).unwrap()
    }

    /// ln(X/Z) at these values, and its changes by one standard uncertainty of each parameter and of the scale; none where there is no settled motion.
    fn point(&self, candidate: &CandidatePoint, values: &[f64]) -> Option<(f64, DVector<f64>)> {
        let own = self.at(candidate.set_up, values);
        let parameters: Vec<Parameter> = own.own.iter().map(|n| self.all[*n].parameter).collect();
        let settled = own.point(candidate.frequency_hz, &parameters).ok()?;
        let mut changes = DVector::zeros(self.all.len() + 1);
        changes[self.all.len()] = OF_SCALE;
        for (n, by) in own.own.iter().zip(&settled.by_parameters) {
            changes[*n] = by * self.all[*n].standard_uncertainty;
        }
        Some((settled.x_over_z.ln(), changes))
    }

    /// The points that can be used, from 0.8 to 1.2 of fn.
    fn candidates(&self, steps: u32) -> Vec<CandidatePoint> {
        let hz = |n: u32| self.all[0].value * (0.8 + 0.4 * f64::from(n) / f64::from(steps));
        let places: Vec<(usize, f64)> = (0..4).flat_map(|set_up| (0..=steps).map(move |n| (set_up, hz(n)))).collect();
        let of = |at: &(usize, f64)| self.set_ups[at.0].candidate(*at, &self.all, OF_SCALE, LIMIT_M).ok();
        places.par_iter().filter_map(of).collect()
    }

    /// What is known at the true values after each of the points in this order.
    fn known(&self, points: &[&CandidatePoint]) -> Vec<ParameterCovariance> {
        let after = |known: &mut ParameterCovariance, candidate: &&CandidatePoint| {
            if let Some((_, changes)) = self.point(candidate, &self.truth) {
                *known = known.after(&changes, OF_POINT);
            }
            Some(known.clone())
        };
        points.iter().scan(ParameterCovariance::before(self.all.len(), None), after).collect()
    }
}

/// This many points of the candidates, as many on each set-up that has any, evenly spaced over those that can be used there.
fn evenly(candidates: &[CandidatePoint], points: usize) -> Vec<&CandidatePoint> {
    let of = |set_up: usize| candidates.iter().filter(move |candidate| candidate.set_up == set_up).collect::<Vec<_>>();
    let all: Vec<Vec<&CandidatePoint>> = (0..4).map(of).filter(|own| !own.is_empty()).collect();
    let each = points / all.len();
    all.iter().flat_map(|own| (0..each).map(move |n| own[(2 * n + 1) * own.len() / (2 * each)])).collect()
}

/// The points of drawn rigs, chosen at identified values that are off by their uncertainty and judged at the true ones.
#[test]
fn on_most_rigs_half_as_many_chosen_points_narrow_as_much_as_evenly_spaced_ones() {
    const EVEN: usize = 24;
    let (seeds, steps) = if is_full() { (100, 100) } else { (3, 50) };
    let (mut together, mut each) = (Vec::new(), Vec::new());
    for seed in 0..seeds {
        let drawn = Drawn::of(seed);
        let candidates = drawn.candidates(steps);
        let even = drawn.known(&evenly(&candidates, EVEN)).pop().unwrap();
        let chosen = ParameterCovariance::before(drawn.all.len(), None).choose(&candidates, 2 * EVEN);
        let chosen: Vec<&CandidatePoint> = chosen.iter().map(|(n, _)| &candidates[*n]).collect();
        let known = drawn.known(&chosen);
        let needed = |is_enough: &dyn Fn(&ParameterCovariance) -> bool| {
            known.iter().position(is_enough).map_or(f64::INFINITY, |n| (n + 1) as f64 / EVEN as f64)
        };
        together.push(needed(&|known| known.uncertainty() <= even.uncertainty()));
        each.push(needed(&|known| known.shares().iter().zip(even.shares()).all(|(own, even)| *own <= even)));
        println!("{seed}: {:?} {:?} {:?}", together.last(), each.last(), even.shares());
    }
    let at_most_half = |shares: &[f64]| shares.iter().filter(|share| **share <= 0.5).count();
    for (what, shares) in [("all together", &mut together), ("each parameter", &mut each)] {
        shares.sort_by(f64::total_cmp);
        let (median, ends) = (shares[shares.len() / 2], [shares[0], shares[shares.len() - 1]]);
        println!("{what}: median {median:.2}, from {ends:.2?}, at most half in {} of {seeds}", at_most_half(shares));
    }
    assert!(5 * at_most_half(&together) >= 4 * together.len());
}

/// The fit of all parameters to noisy points of drawn rigs is off by as much as the covariance says.
#[test]
fn the_uncertainties_after_the_chosen_points_are_those_of_a_fit_to_them() {
    let (seeds, steps) = if is_full() { (100, 100) } else { (2, 50) };
    let (mut square, mut freedom) = (0.0, 0.0);
    for seed in 1000..1000 + seeds {
        let mut drawn = Drawn::of(seed);
        let candidates = drawn.candidates(steps);
        let chosen = ParameterCovariance::before(drawn.all.len(), None).choose(&candidates, 12);
        let size = drawn.all.len() + 1;
        let scale_error = normal(&mut drawn.random);
        let mut measured = Vec::new();
        for (n, _) in &chosen {
            let noise = OF_SCALE * scale_error + OF_POINT * normal(&mut drawn.random);
            let truth = drawn.point(&candidates[*n], &drawn.truth);
            measured.extend(truth.map(|(ln, _)| (&candidates[*n], ln + noise)));
        }
        let truth = DVector::from_fn(size, |n, _| match drawn.all.get(n) {
            Some(of) => (drawn.truth[n] - of.value) / of.standard_uncertainty,
            None => scale_error,
        });
        // Gauss-Newton; the identified values are a measurement too.
        let mut fitted = DVector::zeros(size);
        let mut information = DMatrix::identity(size, size);
        for _ in 0..8 {
            let values: Vec<f64> =
                drawn.all.iter().enumerate().map(|(n, of)| of.value + fitted[n] * of.standard_uncertainty).collect();
            information = DMatrix::identity(size, size);
            let mut right: DVector<f64> = DVector::zeros(size);
            for (candidate, ln) in &measured {
                let Some((model, changes)) = drawn.point(candidate, &values) else { continue };
                let left = ln - model - OF_SCALE * fitted[size - 1] + changes.dot(&fitted);
                right += &changes * (left / OF_POINT.powi(2));
                information += &changes * changes.transpose() / OF_POINT.powi(2);
            }
            fitted = information.clone().lu().solve(&right).unwrap();
        }
        let error = &fitted - &truth;
        let own = error.dot(&(&information * &error));
        println!("{seed}: {own:.2} of {size}, {} points", measured.len());
        square += own;
        freedom += size as f64;
    }
    let ratio: f64 = square / freedom;
    println!("mean square of the errors over that of the covariance: {ratio:.3}");
    // Four standard deviations of a χ² with these degrees of freedom.
    assert!((ratio - 1.0).abs() < 4.0 * (2.0 / freedom).sqrt(), "{ratio}");
}

/// |X/Z|² = (1 + s²)/((1 − r²)² + s²) with s = 2ζr.
#[test]
fn the_derivatives_of_a_bare_structure_are_those_of_the_closed_form() {
    let ln = |fn_hz: f64, zeta: f64, hz: f64| {
        let (r, s) = (hz / fn_hz, 2.0 * zeta * hz / fn_hz);
        0.5 * ((1.0 + s * s) / ((1.0 - r * r).powi(2) + s * s)).ln()
    };
    for hz in [2.2, 2.49, 2.5, 2.52, 2.9] {
        let settled = bare(2.5, 0.0038).point(hz, &[BEFORE[0].1, BEFORE[1].1]).unwrap();
        assert!((settled.x_over_z.ln() - ln(2.5, 0.0038, hz)).abs() < 1e-9, "{hz}: {settled:?}");
        // Central differences of the closed form: their error is the sixth of h² times the third derivative, below 1e-5 of the
        // largest slope for steps of a 2000th of the half-power width.
        let (h, k) = (1e-5, 2e-6);
        let slopes = [
            (ln(2.5 + h, 0.0038, hz) - ln(2.5 - h, 0.0038, hz)) / (2.0 * h),
            (ln(2.5, 0.0038 + k, hz) - ln(2.5, 0.0038 - k, hz)) / (2.0 * k),
        ];
        for (own, slope) in settled.by_parameters.iter().zip(slopes) {
            assert!((own - slope).abs() < 1e-5 * slope.abs().max(1.0), "{hz}: {own} {slope}");
        }
    }
}

const SWEEP: &str = r#"name = "sweep"
[structure]
mass_kg = 1.6
natural_frequency_hz = 2.50
damping_ratio = 0.02
[particle]
mass_ratio = 0.1
clearance_m = 0.0075
wall = { kind = "restitution", coefficient = 0.5 }
[[set_up]]
name = "bare"
base_amplitude_m = 0.0015
[[set_up]]
name = "spid"
base_amplitude_m = 0.0015
particle = {}
[[experiment]]
name = "sweep"
kind = "stepped_sine"
frequencies_hz = [2.3, 2.4, 2.45, 2.5, 2.55, 2.6, 2.7]
start = "from_rest"
dwell_s = 16
steady = { longest_dwell_s = 48, tolerance = 0.02 }
"#;

const FILE: &str = r#"[[identified]]
key = "structure.natural_frequency_hz"
value = 2.501
standard_uncertainty = 0.002
interval_95 = [2.497, 2.505]
taken_from = "a release"
[[identified]]
key = "structure.damping_ratio"
value = 0.0201
standard_uncertainty = 0.001
interval_95 = [0.018, 0.022]
taken_from = "a release"
[[identified]]
key = "particle.wall.coefficient"
value = 0.52
standard_uncertainty = 0.03
interval_95 = [0.46, 0.58]
taken_from = "drops.csv"
[[identified]]
key = "particle.wall.contact_time_s"
value = 0.002
standard_uncertainty = 0.0001
interval_95 = [0.0018, 0.0022]
taken_from = "pulses.csv"
"#;

#[test]
fn the_command_tells_set_up_and_frequency_of_the_next_points_of_a_run() {
    let folder = folder_with(SWEEP);
    std::fs::write(folder.path().join("identified.toml"), FILE).unwrap();
    damprig(&folder).args(["run", "test.toml", "--out", "run"]).assert().success();
    let with_step = |step_hz: &str, more: &[&str]| {
        let first = ["identify", "next", "run", "--set-up-file", "identified.toml", "--step-hz", step_hz];
        damprig(&folder).args(first).args(more).assert()
    };
    let next = |more: &[&str]| with_step("0.01", more);
    let text = contains("narrow all parameters together most").and(contains("contact_time_s of identified.toml"));
    next(&["--plot", "next.png"]).success().stdout(text);
    assert!(std::fs::read(folder.path().join("next.png")).unwrap().starts_with(b"\x89PNG"));
    let json = |more: &[&str]| -> serde_json::Value {
        let output = next(&[&["--json"], more].concat()).success().get_output().stdout.clone();
        serde_json::from_slice(&output).unwrap()
    };
    let of_e = json(&["--for", "particle.wall.coefficient", "--points", "3"]);
    let after = |answer: &serde_json::Value, point: usize, parameter: usize| {
        answer["points"][point]["standard_uncertainties"][parameter].as_f64().unwrap()
    };
    assert_eq!(of_e["points"].as_array().unwrap().len(), 3, "{of_e}");
    assert_eq!(of_e["parameters"][2]["set_ups"], serde_json::json!(["spid"]), "{of_e}");
    // Only the impact damper tells of e, and each further point narrows it.
    assert_eq!(of_e["points"][0]["set_up"], "spid", "{of_e}");
    assert!(after(&of_e, 0, 2) < 0.03 && after(&of_e, 1, 2) < after(&of_e, 0, 2), "{of_e}");
    // What is chosen for one parameter narrows it at least as much in the first point as what is chosen for all.
    assert!(after(&of_e, 0, 2) <= after(&json(&[]), 0, 2), "{of_e}");
    // The spelling as an option is the same command.
    damprig(&folder).args(["identify", "--next", "run", "--set-up-file", "identified.toml"]).assert().success();
    next(&["--plot", "next.png"]).code(2).stderr(contains("next.png"));
    next(&["--for", "particle.clearance_m"]).code(2).stderr(contains("one of structure.natural_frequency_hz"));
    next(&["--from-hz", "3"]).code(2).stderr(contains("--from-hz must be less than --to-hz"));
    next(&["--from-hz", "1e-3"]).code(2).stderr(contains("down to a tenth"));
    with_step("1e-6", &[]).code(2).stderr(contains("larger step"));
    let rewritten = |from: &str, to: &str| {
        std::fs::write(folder.path().join("identified.toml"), FILE.replace(from, to)).unwrap();
        next(&[]).code(2)
    };
    rewritten("value = 0.52", "value = 1.52")
        .stderr(contains("identified.toml: set-up \"spid\"").and(contains("from 0 to 1")));
    rewritten("particle.wall.coefficient", "structure.damping_ratio").stderr(contains("is identified twice"));
    rewritten("standard_uncertainty", "uncertainty")
        .stderr(contains("identified.toml:4").and(contains("standard_uncertainty")));
    let without = damprig(&folder).args(["identify", "next", "run"]).assert();
    without.code(2).stderr(contains("names no set-up file").and(contains("--set-up-file identified.toml")));
    std::fs::write(folder.path().join("identified.toml"), "[structure]\ndamping_ratio = 0.02\n").unwrap();
    next(&[]).code(2).stderr(contains("none of its identified values").and(contains("--out")));
}

#[test]
fn a_run_whose_points_did_not_settle_is_refused_with_what_to_do() {
    let folder = folder_with(
        &SWEEP
            .replace("0.02\n", "0.0038\n")
            .replace("0.0015", "0.0004")
            .replace("dwell_s = 16\nsteady = { longest_dwell_s = 48, tolerance = 0.02 }", "dwell_s = 4"),
    );
    std::fs::write(folder.path().join("identified.toml"), FILE).unwrap();
    damprig(&folder).args(["run", "test.toml", "--out", "run"]).assert().success();
    let refusal = contains("no settled point of a stepped sine").and(contains("longest_dwell_s"));
    damprig(&folder)
        .args(["identify", "next", "run", "--set-up-file", "identified.toml"])
        .assert()
        .code(2)
        .stderr(refusal);
}
