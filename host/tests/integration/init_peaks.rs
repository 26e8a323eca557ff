//! The sweep that `damprig init` writes, on random designs beside a dense sweep of the same structure with the same dwell.
//!
//! Each design is drawn from a fixed seed and simulated exactly. With DAMPRIG_FULL 100 designs are taken, and their dense sweep is finer.

use std::f64::consts::TAU;

use damprig::campaign::Campaign;
use damprig::file_keys::new_file::{self, CaseValues, Excitation, MountedDamper};
use damprig::input::Source;
use damprig::quantity::Quantity;
use damprig::report::peak::Peak;
use damprig::simulation::Case;
use damprig::study::simulate::{SimulationRecord, metrics_of_all};
use damprig_core::integrator::exact;

use crate::common::is_full;

/// Largest relative error of a reported peak.
const WITHIN: f64 = 0.02;

fn drawn(rng: &mut fastrand::Rng) -> CaseValues {
    let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
    CaseValues {
        natural_frequency_hz: between(0.0, 8.0_f64.ln()).exp(),
        damping_ratio: between(0.002_f64.ln(), 0.03_f64.ln()).exp(),
        mass_ratio: between(0.03, 0.2),
        clearance_ratio: between(2.0, 25.0),
        restitution: between(0.1, 0.85),
        friction_ratio: between(0.1, 1.2),
        ..CaseValues::default()
    }
}

/// Frequency (Hz) and X/Z of points whose counted cycles begin after `settle_cycles`.
fn simulated(case: &Case, frequencies_hz: &[f64], [settle_cycles, cycles]: [f64; 2]) -> Vec<(f64, f64)> {
    let at = |frequency_hz: &f64| {
        let mut case = case.clone();
        let exact::Excitation::Sine { angular_frequency_rad_per_s, .. } = &mut case.excitation else {
            panic!("{case:?}")
        };
        *angular_frequency_rad_per_s = TAU * frequency_hz;
        case
    };
    let cases: Vec<Case> = frequencies_hz.iter().map(at).collect();
    let record = SimulationRecord { cycles: Some(cycles), duration_s: None, settle_cycles, settle_s: 0.0 };
    let found = metrics_of_all(&cases, Some(record), &[Quantity::XOverZ], &|| true);
    let found = found.unwrap_or_else(|_| panic!("{case:?} cannot be simulated"));
    frequencies_hz.iter().zip(found).map(|(frequency_hz, (values, _))| (*frequency_hz, values[0])).collect()
}

/// The peak that a new campaign's points show, and the highest X/Z of a dense sweep over the same range.
fn peaks(damper: MountedDamper, values: &CaseValues) -> (Peak, f64) {
    let text = new_file::campaign("new", &[damper], &[Excitation::SteppedSine], values);
    let campaign = Campaign::parse(Source::new("new.toml", text.clone())).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let (set_up, experiment) = (&campaign.set_ups[0], &campaign.experiments[0]);
    let sine = experiment.stepped_sine().unwrap();
    let case = new_file::case("new", damper, Excitation::SteppedSine, values);
    let case = Case::parse(&Source::new("case.toml", case), "case").unwrap();
    let dwell = (sine.dwell_s * values.natural_frequency_hz).round();
    let cycles = [(sine.longest_dwell_s() / sine.dwell_s - 1.0).round() * dwell, dwell];
    let mut points = simulated(&case, &sine.frequencies_hz, cycles);
    points.extend(simulated(&case, &sine.around_peak(&points).frequencies_hz, cycles));
    let [first, last] = [sine.frequencies_hz.first().unwrap(), sine.frequencies_hz.last().unwrap()];
    let count = if is_full() { 800 } else { 400 };
    let dense: Vec<f64> = (0..=count).map(|n| first + (last - first) * f64::from(n) / f64::from(count)).collect();
    let highest = simulated(&case, &dense, cycles).iter().map(|(_, ratio)| *ratio).fold(0.0, f64::max);
    (Peak::measured(set_up, experiment, &points).unwrap(), highest)
}

/// Of the 100 designs four are missed. Three are marked: one in an irregular motion, two beside a jump. The other (design 68) has two motions
/// that take turns from frequency to frequency: the higher one appears between two points of the grid of which neither is a maximum.
#[test]
fn the_sweep_of_a_new_campaign_finds_the_peak_of_random_designs_or_marks_it() {
    let (designs, most_missed, most_unmarked) = if is_full() { (100, 5, 1) } else { (8, 1, 0) };
    let mut rng = fastrand::Rng::with_seed(1);
    let dampers = [MountedDamper::Spid, MountedDamper::Hybrid, MountedDamper::Fd, MountedDamper::Tmd];
    let (mut missed, mut unmarked, mut unresolved, mut jumps) = (Vec::new(), Vec::new(), 0, 0);
    for design in 0..designs {
        let (damper, values) = (dampers[design % dampers.len()], drawn(&mut rng));
        let (peak, highest) = peaks(damper, &values);
        let words = format!("design {design}: {damper:?}, {values:?}: {peak:?}, dense sweep {highest}");
        match peak.verdict() {
            "at a jump" => jumps += 1,
            "resolved" => {}
            _ => unresolved += 1,
        }
        if peak.x_over_z < (1.0 - WITHIN) * highest {
            if peak.is_resolved() {
                unmarked.push(words.clone());
            }
            missed.push(words);
        }
    }
    println!("{designs} designs: {} missed, {unresolved} not resolved, {jumps} at a jump", missed.len());
    assert!(unmarked.len() <= most_unmarked, "not marked: {}", unmarked.join("\n"));
    assert!(missed.len() <= most_missed && unresolved <= most_missed, "{}", missed.join("\n"));
}

/// fn = 4.1 Hz, ζ = 0.006: with steps of fn/50 the highest point had 56 % of the peak and was called steady.
#[test]
fn the_peak_of_a_lightly_damped_structure_is_found_and_resolved() {
    let values = CaseValues { natural_frequency_hz: 4.1, damping_ratio: 0.006, ..CaseValues::default() };
    let (peak, highest) = peaks(MountedDamper::Bare, &values);
    assert!(peak.is_resolved() && peak.x_over_z > (1.0 - WITHIN) * highest, "{peak:?}, {highest}");
}
