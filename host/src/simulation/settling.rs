//! Warns of a case whose counted cycles begin before the structure has settled; [`crate::prediction::settling`] has the equations.

use super::Case;
use crate::prediction::settling::unsettled;
use crate::prediction::trim;

/// Tolerance of the mean over a case's counted cycles.
const CASE_TOLERANCE: f64 = 0.01;

/// A warning if a case under a sine is counted from a cycle (from 0, of `cycle_s`) to `end_s` before the free vibration has decayed. `key`
/// is the one that says from which cycle it counts.
#[must_use]
pub fn warning(case: &Case, key: &str, first_cycle: f64, [cycle_s, end_s]: [f64; 2]) -> Option<String> {
    if !case.is_under_a_sine() || case.set_up.tmd.is_some() {
        return None;
    }
    let start_s = first_cycle * cycle_s;
    let found = unsettled(&case.set_up.structure, [start_s, end_s - start_s], CASE_TOLERANCE)?;
    let may_shorten = case.has_impacts();
    let unless = if may_shorten { ", unless the damper shortens it" } else { "" };
    Some(format!(
        "the counted cycles begin after {first_cycle} cycles, when {:.0} % of the structure's free vibration is left{unless}: exp(−ζωt), time \
         constant {} s\n  write {key} = {}",
        100.0 * found.share,
        trim(found.time_constant_s),
        (found.enough_s / cycle_s).ceil(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Source;

    #[test]
    fn a_case_that_counts_too_early_is_told_what_is_left_and_from_which_cycle_it_may_count() {
        let text = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n\
                    base = { kind = \"sine\", amplitude_m = 0.001, frequency_hz = 2.5 }\nrun = { duration_s = 40 }\n";
        let case = Case::parse(&Source::new("c.toml", text), "c").unwrap();
        // exp(−0.0038 · 2π · 40) = 38.5 %; over 20 cycles τ/8·(1 − e^(−8/τ)) = 79.5 %, and 79.5 % · e^(−t/τ) = 1 %/1.3 at t = 77.7 s.
        let told = warning(&case, "settle_cycles", 40.0, [0.4, 24.0]).unwrap();
        assert!(told.contains("after 40 cycles, when 38 % ") && told.ends_with("write settle_cycles = 195"), "{told}");
        assert_eq!(warning(&case, "settle_cycles", 195.0, [0.4, 86.0]), None);
    }
}
