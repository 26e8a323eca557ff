//! The statements of `damprig simulate --analyse` agree with each other and with the motion, over drawn cases.

use std::collections::BTreeMap;
use std::path::Path;

use damprig::input::Source;
use damprig::report::terminal;
use damprig::simulation::analysis::{Analysis, ForcedResponse, MotionKind};
use damprig::simulation::{Case, RunOptions, SimulationResult, simulate};

/// Numbers between 0 and 1 (a linear congruential generator, upper bits).
struct Draw(u64);

impl Draw {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
}

/// A case of one of seven kinds, with drawn d/Z, e, friction, damping, frequency and number of periods.
fn drawn(n: usize, draw: &mut Draw) -> (String, f64, f64) {
    let frequency = 2.5 * draw.between(0.5, 1.6);
    let zeta = 10_f64.powf(draw.between(-2.7, -1.0));
    let periods = draw.between(15.0, 120.0);
    let (d, e) = (draw.between(0.5, 20.0), draw.between(0.1, 0.9));
    let (mu, gamma) = (if n.is_multiple_of(2) { 0.0 } else { draw.between(0.0, 0.2) }, draw.between(0.05, 1.0));
    let base = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = F }\n";
    let hard = format!("wall = {{ kind = \"restitution\", coefficient = {e} }}");
    let soft = "wall = { kind = \"voigt\", material = \"pu_foam\", law = \"contact\", release = \"zero_force\" }";
    let particle = |wall: &str| {
        format!("particle = {{ mass_ratio = 0.1, clearance_m = {}, friction_coefficient = {mu}, {wall} }}\n", 0.003 * d)
    };
    let friction = format!("friction_damper = {{ friction_ratio = {gamma} }}\n");
    let force = "force = { kind = \"sine\", amplitude_n = 1.2, frequency_hz = F }\n";
    let tmd = "tmd = { mass_ratio = 0.1, tuning = \"den_hartog\" }\n";
    let parts = match n % 7 {
        0 => base.to_string(),
        1 | 2 => format!("{base}{}", particle(&hard)),
        3 => format!("{base}{friction}"),
        4 => format!("{base}{friction}{}", particle(&hard)),
        5 => format!("{base}{}", particle(soft)),
        _ => format!("{force}{tmd}"),
    };
    let head = format!(
        "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = {zeta} }}\n{}",
        parts.replace('F', &frequency.to_string())
    );
    (head, frequency, periods)
}

fn case(head: &str, duration_s: f64) -> Case {
    let text = format!("{head}run = {{ duration_s = {duration_s:?} }}\n");
    Case::parse(&Source::new("case.toml", text.clone()), "case").unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn run(case: &Case) -> SimulationResult {
    let options = RunOptions { keep: false, longest_part_s: 1e9, go_on: &mut |_| true };
    simulate(case, &mut (), options).expect("it is physical")
}

/// Checks one answer, and returns its verdict.
fn check(case: &Case) -> (ForcedResponse, String) {
    let (result, analysis) = (run(case), Analysis::of(case).expect("in closed form"));
    let text = format!("{}\n{}", terminal::simulation::summary(case, &result), terminal::analysis::text(&analysis));
    let energy = analysis.energy.expect("in closed form");
    let dissipated = energy.structure_damping_j
        + energy.impacts_j
        + energy.internal_friction_j
        + energy.friction_damper_j
        + energy.link_damping_j;
    let through = energy.input_j.abs() + energy.stored_change_j.abs() + dissipated;
    assert!((energy.input_j - dissipated - energy.stored_change_j).abs() < 1e-9 * through, "{text}");
    assert!(text.contains("change of stored energy") && !text.contains("energy stored"), "{text}");
    let driven = analysis.driven.expect("a driven motion");
    let says = |words: &str| text.contains(words);

    // What is said of |x|.
    assert_eq!(
        result.last_cycles.map(|last| last.is_steady()),
        driven.cycle_maxima_spread.map(|s| s < driven.tolerance)
    );
    let is_steady = says("|x| is steady: the last 20");
    let is_unsteady = says("|x| is not steady");
    assert!(!(is_steady && is_unsteady), "{text}");
    assert_eq!(is_steady, driven.cycle_maxima_spread.is_some_and(|spread| spread < driven.tolerance), "{text}");
    // What is said of the motion: one verdict, which agrees with |x| and with the orbit.
    let verdicts = ["periodic: repeats every", "settling: ", "not periodic: does not repeat"];
    assert_eq!(
        verdicts.iter().filter(|verdict| says(&format!("motion                   {verdict}"))).count(),
        1,
        "{text}"
    );
    assert!(driven.repeats_after.is_none_or(|_| driven.repeats_within <= driven.tolerance), "{text}");
    if driven.motion == MotionKind::Periodic && driven.repeats_after == Some(1) {
        assert!(!is_unsteady, "{text}");
    }
    if driven.motion == MotionKind::NotPeriodic {
        assert!(driven.repeats_after.is_none() && !says("it is on this orbit") && !says("settles onto"), "{text}");
        // A steady |x| of a motion that does not repeat is explained.
        assert_eq!(is_steady, says("(its largest |x| is steady within"), "{text}");
    }
    if let Some(orbit) = &driven.orbit {
        assert_eq!(orbit.is_run_on_it, orbit.distance <= driven.tolerance, "{text}");
        assert_eq!(says("it is on this orbit"), driven.motion == MotionKind::Periodic, "{text}");
        if driven.motion == MotionKind::Periodic {
            assert!(orbit.is_run_on_it, "{text}");
        }
        if says("settles onto") {
            assert!(
                driven.motion == MotionKind::Settling && orbit.stability != "unstable" && orbit.distance < 0.11,
                "{text}"
            );
        }
    }
    (driven, text)
}

#[test]
fn no_two_statements_of_an_answer_contradict_each_other() {
    let mut draw = Draw(16);
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    for n in 0..140 {
        let (head, frequency, periods) = drawn(n, &mut draw);
        let duration_s = periods / frequency;
        let (driven, text) = check(&case(&head, duration_s));
        *seen.entry(format!("{:?}", driven.motion)).or_default() += 1;
        let is_unstable = driven.orbit.as_ref().is_some_and(|orbit| orbit.stability == "unstable");
        if driven.motion == MotionKind::Periodic && driven.repeats_after == Some(1) && !is_unstable {
            // Twenty periods later it is the same motion.
            let later = check(&case(&head, duration_s + 20.0 / frequency)).0;
            let change = later.mean_cycle_max_abs_x_m / driven.mean_cycle_max_abs_x_m - 1.0;
            let start_share = f64::from(driven.periods as u32).max(20.0) / 20.0;
            assert!(
                later.cycle_maxima_spread.is_none_or(|s| s < 2.0 * driven.tolerance),
                "{change} {start_share}: {text}"
            );
        }
    }
    assert!(seen.len() == 3 && seen.values().all(|count| *count >= 5), "{seen:?}");
}

#[test]
fn the_shipped_cases_have_one_account_of_their_motion() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("cases");
    let of = |name: &str| check(&Case::read(&folder.join(name)).expect("a case"));
    // |x| is steady in the last 20 cycles, and so is everything else.
    let (spid, text) = of("spid.toml");
    assert_eq!((spid.motion, spid.repeats_after), (MotionKind::Periodic, Some(1)), "{text}");
    let (tmd, text) = of("tmd.toml");
    assert_eq!((tmd.motion, tmd.repeats_after), (MotionKind::Periodic, Some(1)), "{text}");
    // A stable orbit exists, far from the end of the run.
    let (soft, text) = of("soft-wall.toml");
    assert_eq!(soft.motion, MotionKind::NotPeriodic, "{text}");
    assert!(text.contains("it is not on this orbit"), "{text}");
}

#[test]
fn a_release_gives_off_its_energy_and_the_text_says_so() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("cases");
    let case = Case::read(&folder.join("hybrid.toml")).expect("a case");
    let text = terminal::analysis::text(&Analysis::of(&case).expect("in closed form"));
    assert!(text.contains("change of stored energy  -0.24175 J (end minus start)"), "{text}");
}
