//! Gradient steps of `damprig optimise`: on smooth problems they need a third to a tenth of the simulations and find no worse.

use damprig::optimise::Optimisation;
use damprig::optimise::search::{self, SearchOutcome};
use fastrand::Rng;

use crate::common::is_full;
use crate::optimise::{CASE, folder, read};

/// A damper with the ranges of its variables, the objective and what is recorded.
type Smooth = (String, String, &'static str, &'static str);

fn smooth(damper: &str, variables: &[(&str, f64, f64)], objective: &'static str, record: &'static str) -> Smooth {
    let variable =
        |(key, from, to): &(&str, f64, f64)| format!("[[variable]]\nkey = {key:?}\nfrom = {from}\nto = {to}\n");
    (damper.into(), variables.iter().map(variable).collect(), objective, record)
}

/// The search of a smooth problem, and of the same one with a constraint that every point keeps, which leaves it to points over the whole range.
fn with_gradients_and_without((damper, variables, objective, record): &Smooth) -> [(Optimisation, SearchOutcome); 2] {
    let constraint = "[[constraint]]\nmetric = \"rms_x_m\"\nat_most = 1e9\n";
    [("", ""), (constraint, "evaluations = 600\n")].map(|(constraint, evaluations)| {
        let case = CASE.replace("particle = { mass_ratio = 0.1, clearance_ratio = 10, wall = { kind = \"restitution\", coefficient = 0.5 } }", damper);
        let band = "[[axis]]\nkey = \"base.frequency_hz\"\nfrom = 2\nto = 3\ncount = 21\nreduce = \"maximum\"\n";
        let file = format!("case = \"case.toml\"\nobjective = {objective:?}\n{evaluations}{variables}{band}[record]\n{record}\n{constraint}");
        let optimisation = read(&folder(&case, &file));
        let found = search::run(&optimisation, &|_| true).expect("it is valid");
        (optimisation, found)
    })
}

/// Checks a problem: a value that is no worse than by the accuracy of a peak, and, where gradient steps end the search, at most a third of the
/// simulations that the grid alone of all points would take. Whether they end it: an objective with many local optima is left to another search.
fn check_smooth(smooth: &Smooth) -> bool {
    let [(optimisation, found), (_, other)] = with_gradients_and_without(smooth);
    let [best, least] = [&found, &other].map(|found| found.points[found.best].1.objective);
    assert!(!other.is_complete, "{smooth:?}");
    let all = optimisation.evaluations * optimisation.band_points() as u64;
    assert!(!found.is_complete || 3 * found.simulations < all, "{} of {all}: {smooth:?}", found.simulations);
    assert!(best < least * (1.0 + 1e-3), "{best} after {least}: {smooth:?}");
    println!("{} of {all} simulations, ended {}: {smooth:?}", found.simulations, found.is_complete);
    found.is_complete
}

/// Tuned masses and friction dampers of random structures, in the steady state and from rest.
#[test]
fn a_smooth_objective_takes_at_most_a_third_of_the_simulations_and_is_no_worse() {
    let count = if is_full() { 20 } else { 1 };
    let mut random = Rng::with_seed(36);
    let mut between = |from: f64, to: f64| from + (to - from) * random.f64();
    let mut ended = 0;
    for number in 0..count {
        let record = ["settle_cycles = 60\ncycles = 5", "duration_s = 16"][number % 2];
        let objective = ["x_over_z", "max_x_over_z", "rms_x_m"][number % 3];
        let problem = if number % 4 < 2 {
            let mass_ratio = between(0.03, 0.2);
            let tmd = format!("tmd = {{ mass_ratio = {mass_ratio}, frequency_ratio = 0.9, damping_ratio = 0.2 }}");
            let tuning = ("tmd.frequency_ratio", between(0.6, 0.85), between(0.95, 1.2));
            let damping = ("tmd.damping_ratio", 0.02, between(0.3, 0.6));
            smooth(&tmd, &[tuning, damping], objective, record)
        } else {
            let force = ("friction_damper.friction_ratio", 0.05, between(1.0, 4.0));
            smooth("friction_damper = { friction_ratio = 0.5 }", &[force], objective, record)
        };
        ended += usize::from(check_smooth(&problem));
    }
    println!("gradient steps end the search of {ended} of {count}");
    assert!(2 * ended > count);
}
