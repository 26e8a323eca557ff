//! Cycles in the sampled driver are cut at their own boundaries, not at samples: its cycle maxima are those of the exact driver.

use std::f64::consts::TAU;
use std::fmt::Write;

use damprig::simulation::{Case, RunOptions, SimulationResult, simulate};
use tempfile::TempDir;

const Z_M: f64 = 0.003;

/// A versine pulse, which starts and ends at rest.
fn base_m(t_s: f64, duration_s: f64) -> f64 {
    if t_s < duration_s { 0.5 * Z_M * (1.0 - (TAU * t_s / duration_s).cos()) } else { 0.0 }
}

fn run(folder: &TempDir, text: &str) -> SimulationResult {
    let file = folder.path().join("case.toml");
    std::fs::write(&file, text).unwrap();
    let case = Case::read(&file).unwrap_or_else(|e| panic!("{e}"));
    simulate(&case, &mut (), RunOptions { keep: false, longest_part_s: 1e9, go_on: &mut |_| true }).unwrap()
}

/// The motion after the pulse decays, so the largest |x| of a cycle depends on where the cycle begins.
#[test]
fn cycle_maxima_do_not_depend_on_where_the_samples_lie_in_a_cycle() {
    const STEP_S: f64 = 0.005;
    let folder = TempDir::new().unwrap();
    let mut worst = 0.0_f64;
    for n in 0..24_u32 {
        let pulse_s = STEP_S * f64::from(60 + 7 * n);
        // The boundaries of cycles lie anywhere between samples.
        let cycle_s = 0.311 + 0.006_37 * f64::from(n);
        let zeta = [0.01, 0.03, 0.1][n as usize % 3];
        let mut text = format!("structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = {zeta} }}\n");
        if n % 2 == 1 {
            text += "friction_damper = { force_n = 0.02 }\n";
        }
        let run_table = format!("run = {{ duration_s = 8.0, cycle_s = {cycle_s:?}, steady_from_cycle = 0 }}\n");
        let mut rows = String::from("time_s,displacement_m\n");
        for k in 0..1700 {
            let t_s = f64::from(k) * STEP_S;
            writeln!(rows, "{t_s:.6},{:e}", base_m(t_s, pulse_s)).unwrap();
        }
        std::fs::write(folder.path().join("base.csv"), rows).unwrap();
        let record = "base = { kind = \"record\", file = \"base.csv\", quantity = \"displacement\", unit = \"m\" }\n";
        let pulse = format!("base = {{ kind = \"versine\", amplitude_m = {Z_M}, duration_s = {pulse_s:?} }}\n");
        let [sampled, exact] = [record, &pulse].map(|base| run(&folder, &[&text, base, &run_table].concat()).summary);
        let means = [&sampled, &exact].map(|summary| summary.steady_mean_cycle_max_abs_x_m.unwrap());
        // Relative to the motion: a pulse of whole periods leaves little behind.
        let mean = (means[0] - means[1]) / exact.max_abs_x_m;
        // At the ends of the pulse, where the acceleration jumps, the cubics err by some (Ωh)²/50 of the amplitude, Ω = 2π/T.
        let allowed = (TAU / pulse_s * STEP_S).powi(2) / 50.0;
        assert!(mean.abs() < allowed, "{pulse_s} {cycle_s} {zeta}: {mean:e}, {allowed:e} allowed");
        worst = worst.max(mean.abs());
    }
    println!("mean cycle maximum: within {worst:.1e} of the exact driver's");
}

#[test]
fn a_displacement_record_that_starts_with_a_velocity_says_that_its_start_is_smoothed() {
    let folder = TempDir::new().unwrap();
    let rows = |start_rad: f64| {
        let sample = |k: u32| {
            format!("{:.3},{:e}\n", f64::from(k) * 0.005, Z_M * (start_rad + TAU * 2.5 * 0.005 * f64::from(k)).sin())
        };
        format!("time_s,displacement_m\n{}", (0..2000).map(sample).collect::<String>())
    };
    let text = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.01 }\n\
                base = { kind = \"record\", file = \"base.csv\", quantity = \"displacement\", unit = \"m\" }\nrun = { duration_s = 5 }\n";
    std::fs::write(folder.path().join("base.csv"), rows(0.0)).unwrap();
    let result = run(&folder, text);
    let jump = result.summary.record_start_jump_m_per_s.expect("it starts with Z times its angular frequency");
    assert!((jump / (Z_M * TAU * 2.5) - 1.0).abs() < 2e-3, "{jump}");
    let case = Case::read(&folder.path().join("case.toml")).unwrap();
    let said = damprig::report::terminal::simulation::summary(&case, &result);
    assert!(
        said.contains(
            "the record starts with 0.0471 m/s; the base reaches it smoothly over the first interval of 0.005 s"
        ),
        "{said}"
    );
    // A record that starts at its peak starts at rest.
    std::fs::write(folder.path().join("base.csv"), rows(TAU / 4.0 - 0.5 * TAU * 2.5 * 0.005)).unwrap();
    assert_eq!(run(&folder, text).summary.record_start_jump_m_per_s, None);
}
