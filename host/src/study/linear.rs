//! The settled response of a structure without impacts and friction, bare or with a tuned mass, to a sine: in closed form.

use damprig_core::integrator::exact::Excitation;
use nalgebra::{Complex, Matrix2, Matrix4, Schur, Vector2};

use super::simulate::Counted;
use crate::simulation::Case;
use crate::simulation::result::Summary;

/// Negative logarithm of what is left of the free motion at the first counted instant: e⁻⁴⁵ is 3e-20. The modes of a structure and a
/// tuned mass are far enough from each other that the motion at the start is at most some thousand times what is left then.
const SETTLED: f64 = 45.0;

/// Steps of the search for eigenvalues.
const MAX_ITERATIONS: usize = 1000;

/// The statistics of the counted cycles, if the case is linear, whole cycles are counted and the free motion is over before them. Every
/// counted cycle is then the same sine.
pub(super) fn settled(case: &Case, counted: &Counted) -> Option<Summary> {
    let set_up = &case.set_up;
    let is_other = set_up.particle.is_some()
        || set_up.friction_damper.is_some()
        || case.many_particles.is_some()
        || case.multi_degree.is_some()
        || case.record.is_some();
    let cycles = counted.cycles();
    if is_other || (cycles - cycles.round()).abs() > 1e-9 || cycles < 0.5 {
        return None;
    }
    let (base_m, force_n, omega) = match case.excitation {
        Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, .. } => {
            (amplitude_m, 0.0, angular_frequency_rad_per_s)
        }
        Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s, .. } => {
            (0.0, amplitude_n, angular_frequency_rad_per_s)
        }
        _ => return None,
    };
    let structure = &set_up.structure;
    let (m, k, c) = (structure.mass_kg, structure.stiffness_n_per_m, structure.damping_n_s_per_m);
    // Without a tuned mass: one of its own that nothing moves and that needs no time to rest.
    let (m1, k1, c1) =
        set_up.tmd.map_or((1.0, 0.0, 0.0), |tmd| (tmd.mass_kg, tmd.stiffness_n_per_m, tmd.damping_n_s_per_m));
    let decay = match set_up.tmd {
        None => slowest(&[c / (2.0 * m) - (c * c / (4.0 * m * m) - k / m).max(0.0).sqrt()]),
        Some(_) => {
            #[rustfmt::skip]
            let rates = Matrix4::new(
                0.0, 1.0, 0.0, 0.0,
                -(k + k1) / m, -(c + c1) / m, k1 / m, c1 / m,
                0.0, 0.0, 0.0, 1.0,
                k1 / m1, c1 / m1, -k1 / m1, -c1 / m1,
            );
            // Without a bound the iteration may not end, as for some matrices with several zeros.
            let schur = Schur::try_new(rates, f64::EPSILON, MAX_ITERATIONS)?;
            slowest(schur.complex_eigenvalues().map(|value| -value.re).as_slice())
        }
    };
    if decay * counted.first_cycle * counted.cycle_s < SETTLED {
        return None;
    }
    let (own, link) = (Complex::new(k, omega * c), Complex::new(k1, omega * c1));
    let inertia = |mass: f64| Complex::from(omega * omega * mass);
    let matrix = Matrix2::new(own + link - inertia(m), -link, -link, link - inertia(m1));
    let load = Vector2::new(own * base_m + force_n, Complex::from(0.0));
    let x = matrix.lu().solve(&load)?.x;
    let (amplitude_m, stroke_m) = (x.norm(), (x - base_m).norm());
    Some(Summary {
        simulated_s: counted.end_s,
        rms_x_m: amplitude_m * std::f64::consts::FRAC_1_SQRT_2,
        max_abs_x_m: amplitude_m,
        max_abs_x_minus_z_m: stroke_m,
        steady_max_abs_x_m: Some(amplitude_m),
        steady_mean_cycle_max_abs_x_m: Some(amplitude_m),
        ..Summary::default()
    })
}

fn slowest(rates: &[f64]) -> f64 {
    rates.iter().copied().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use damprig_core::integrator::exact::Exact;
    use damprig_core::integrator::exact::response::Wanted;
    use damprig_motion::stop::response_from;

    use super::*;
    use crate::input::Source;
    use crate::study::simulate::SimulationRecord;

    /// The engine's error over a counted cycle and what it accumulates in the settling ones is below 1e-12 of the amplitude.
    #[test]
    fn the_settled_response_is_what_the_engine_simulates() {
        let excitations = [
            "force = { kind = \"sine\", amplitude_n = 12, frequency_hz = 111 }",
            "base = { kind = \"sine\", amplitude_m = 1e-4, frequency_hz = 124 }",
        ];
        let dampers = ["tmd = { mass_ratio = 0.1, frequency_ratio = 0.9, damping_ratio = 0.17 }", ""];
        for (excitation, damper) in excitations.iter().flat_map(|e| dampers.iter().map(move |d| (e, d))) {
            let text = format!(
                "structure = {{ mass_kg = 3.1, natural_frequency_hz = 118, damping_ratio = 0.05 }}\n\
                 {excitation}\n{damper}\nrun = {{ duration_s = 3 }}\n"
            );
            let case =
                Case::parse(&Source::new("case.toml", text.as_str()), "case").unwrap_or_else(|why| panic!("{why}"));
            let record =
                |settle_cycles| SimulationRecord { cycles: Some(7.0), duration_s: None, settle_cycles, settle_s: 0.0 };
            let counted = Counted::of(&case, Some(record(200.0)));
            let found = settled(&case, &counted).expect("it is linear and settled");
            let wanted = Wanted { cycle_s: Some(counted.cycle_s), steady_from_cycle: Some(200), whole_run: true };
            let mut motion = Exact::new(&case.set_up, &case.excitation, &case.initial).expect("sound");
            let from = (200, 200.0 * counted.cycle_s);
            let response = response_from(&mut motion, from, counted.end_s, wanted, &|| true).expect("not stopped");
            let of_engine = Summary::of(&case, &response, counted.end_s, 0);
            let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-11, "{a} {b} {excitation} {damper}");
            near(found.max_abs_x_m, of_engine.max_abs_x_m);
            near(found.max_abs_x_minus_z_m, of_engine.max_abs_x_minus_z_m);
            near(found.rms_x_m, of_engine.rms_x_m);
            near(found.steady_max_abs_x_m.unwrap(), of_engine.steady_max_abs_x_m.unwrap());
            near(found.steady_mean_cycle_max_abs_x_m.unwrap(), of_engine.steady_mean_cycle_max_abs_x_m.unwrap());
            assert_eq!(settled(&case, &Counted::of(&case, Some(record(10.0)))), None, "it has not settled");
        }
    }
}
