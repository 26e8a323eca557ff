//! Says how long a structure must settle until X/Z is within its tolerance of its limit.
//!
//! From rest the free vibration decays with the time constant τ = 1/(ζω), to exp(−ζωt) of its amplitude. At resonance the amplitude is 1 − e^(−t/τ) of its limit,
//! so its mean over a dwell D from t on is τ/D·e^(−t/τ)·(1 − e^(−D/τ)) below it. Off resonance X/Z is nearer to its limit. Friction
//! shortens the decay of a driven motion by nothing: near resonance the amplitude approaches its limit as without it. An impact damper makes
//! it faster by an amount that this does not know, and the text says so; a tuned mass takes the free vibration away and is not judged.

use damprig_core::model::Structure;

use super::stepped_sine::whole_cycles;
use super::trim;
use crate::campaign::{Campaign, CampaignSetUp, Experiment, PointStart, SteppedSine};

/// The verdict on a point needs this many times its tolerance, for the uncertainty of the extrapolation.
const WITH_UNCERTAINTY: f64 = 1.3;

/// Longest time for which settling is advised, s.
const DAY_S: f64 = 86_400.0;

/// Points within this share of the natural frequency count as near resonance.
const NEAR: f64 = 0.1;

/// Relative deviation of X/Z from its limit at resonance, as the mean over a dwell that begins `start_s` after rest.
fn deviation(start_s: f64, dwell_s: f64, time_constant_s: f64) -> f64 {
    // `expm1` keeps its digits where the structure hardly decays within the dwell.
    time_constant_s / dwell_s * libm::exp(-start_s / time_constant_s) * -libm::expm1(-dwell_s / time_constant_s)
}

/// Time after rest from which a dwell has at most this relative deviation.
fn settled_after_s(deviation_of: f64, dwell_s: f64, time_constant_s: f64) -> f64 {
    (time_constant_s * libm::log(deviation(0.0, dwell_s, time_constant_s) / deviation_of)).max(0.0)
}

/// A mean over cycles that begins before the free vibration has decayed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnsettledMean {
    /// Share of the free vibration's amplitude that is left when it begins.
    pub share: f64,
    /// Relative deviation of X/Z from its limit at resonance.
    pub deviation: f64,
    /// τ, s.
    pub time_constant_s: f64,
    /// Time after rest from which the deviation is within the tolerance, s.
    pub enough_s: f64,
}

/// Judges a mean over `counted_s` that begins `start_s` after rest; `None` if its deviation is within the tolerance, or without damping.
#[must_use]
pub fn unsettled(structure: &Structure, [start_s, counted_s]: [f64; 2], tolerance: f64) -> Option<UnsettledMean> {
    let rate = structure.damping_ratio() * structure.angular_frequency_rad_per_s();
    if rate <= 0.0 {
        return None;
    }
    let time_constant_s = 1.0 / rate;
    let deviation = deviation(start_s, counted_s, time_constant_s);
    (WITH_UNCERTAINTY * deviation > tolerance).then(|| UnsettledMean {
        share: libm::exp(-start_s / time_constant_s),
        deviation,
        time_constant_s,
        enough_s: settled_after_s(tolerance / WITH_UNCERTAINTY, counted_s, time_constant_s),
    })
}

/// Time of all dwells that a point may need to be steady, s: whole dwells, the last of which begins when the structure has settled.
#[must_use]
pub fn longest_dwell_s(time_constant_s: f64, settle_s: f64, dwell_s: f64, tolerance: f64) -> f64 {
    let needed_s = settled_after_s(tolerance / WITH_UNCERTAINTY, dwell_s, time_constant_s);
    (1.0 + ((needed_s - settle_s).max(0.0) / dwell_s).ceil()) * dwell_s
}

/// A line for each experiment whose points near resonance will not be steady, with what would do.
#[must_use]
pub fn advice(campaign: &Campaign) -> Vec<String> {
    let judged = |set_up: &CampaignSetUp, experiment: &Experiment| {
        let sine = experiment.base_driven().filter(|sine| sine.start == PointStart::FromRest)?;
        of_experiment(set_up, experiment, sine)
    };
    let once = campaign.experiments.iter().filter(|experiment| experiment.repeat == 0);
    let pairs = once.flat_map(|e| e.set_ups.iter().map(move |i| (&campaign.set_ups[*i], e)));
    pairs.filter_map(|(set_up, experiment)| judged(set_up, experiment)).collect()
}

fn of_experiment(set_up: &CampaignSetUp, experiment: &Experiment, sine: &SteppedSine) -> Option<String> {
    let model = set_up.model();
    let natural_hz = set_up.natural_frequency_hz();
    let frequency_hz = sine.frequencies_hz.iter().copied().find(|f| (f / natural_hz - 1.0).abs() < NEAR)?;
    if set_up.has_unmodelled_damper || model.tmd.is_some() {
        return None;
    }
    let times_s = whole_cycles(sine, frequency_hz).map(|cycles| cycles / frequency_hz);
    let tolerance = f64::from(sine.steady.tolerance);
    let found = unsettled(&model.structure, times_s, tolerance)?;
    let what_to_do = if found.enough_s > DAY_S {
        "It would have to settle for more than a day; is the damping right?".into()
    } else {
        let longest_s = longest_dwell_s(found.time_constant_s, sine.settle_s, sine.dwell_s, tolerance);
        let (longest, settle) = (trim(longest_s), found.enough_s.ceil());
        format!("For steady points write steady = {{ longest_dwell_s = {longest} }}, or settle_s = {settle}.")
    };
    let unless = if model.particle.is_some() { " unless the damper shortens it" } else { "" };
    Some(format!(
        "Set-up {:?}, experiment {:?}: near resonance X/Z will be measured {:.0} % below its limit (time constant {} s){unless}:\n  when the last dwell begins, {:.0} % of the free vibration is left, exp(−ζωt).\n  {what_to_do}",
        set_up.name,
        experiment.name,
        100.0 * found.deviation,
        trim(found.time_constant_s),
        100.0 * found.share,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Source;

    fn campaign(damping_ratio: f64, times: &str, damper: &str) -> Campaign {
        let text = format!(
            "name = \"t\"\n[structure]\nmass_kg = 1.6\nnatural_frequency_hz = 2.5\ndamping_ratio = {damping_ratio}\n\
             [[set_up]]\nname = \"bare\"\nbase_amplitude_m = 0.0004\n{damper}\
             [[experiment]]\nname = \"sweep\"\nkind = \"stepped_sine\"\nfrequencies_hz = [2.5]\nstart = \"from_rest\"\n{times}\n"
        );
        Campaign::parse(Source::new("t.toml", text)).unwrap()
    }

    #[test]
    fn a_dwell_that_ends_before_the_structure_has_settled_is_told_with_what_would_do() {
        // τ = 16.75 s: 32 s from rest leave τ/32·(1 − e^(−32/τ)) = 44.6 %.
        let told = advice(&campaign(0.0038, "dwell_s = 32", ""));
        let [line] = &told[..] else { panic!("{told:?}") };
        assert!(line.contains("45 % below its limit (time constant 16.753 s)"), "{line}");
        // Needed: 44.6 % · e^(−t/τ) = 1 %/1.3, t = 68.02 s: three more dwells.
        assert!(line.contains("longest_dwell_s = 128 }, or settle_s = 69."), "{line}");
        for enough in ["dwell_s = 32\nsteady = { longest_dwell_s = 128 }", "dwell_s = 32\nsettle_s = 69"] {
            assert_eq!(advice(&campaign(0.0038, enough, "")), [""; 0], "{enough}");
        }
    }

    #[test]
    fn a_structure_that_hardly_decays_gets_finite_numbers_and_no_dwell_of_years() {
        for damping_ratio in [1e-6, 1e-9] {
            let told = advice(&campaign(damping_ratio, "dwell_s = 32", ""));
            let [line] = &told[..] else { panic!("{told:?}") };
            assert!(line.contains("100 % below its limit") && line.contains("more than a day"), "{line}");
        }
        // With D/τ = 5e-13 the deviation is 1 − D/(2τ).
        let left = deviation(0.0, 32.0, 6.4e13);
        assert!((1.0 - left - 2.5e-13).abs() < 1e-15, "{left}");
    }

    #[test]
    fn strong_damping_and_a_tuned_mass_need_no_advice() {
        assert_eq!(advice(&campaign(0.1, "dwell_s = 40\nsettle_s = 4", "")), [""; 0]);
        let damper = "tmd = { mass_ratio = 0.1, tuning = \"warburton\" }\n";
        assert_eq!(advice(&campaign(0.0038, "dwell_s = 32", damper)), [""; 0]);
    }

    #[test]
    fn friction_does_not_shorten_the_decay_and_a_particle_may() {
        let bare = advice(&campaign(0.0038, "dwell_s = 32", ""));
        let friction = "friction_damper = { friction_ratio = 0.6 }\n";
        assert_eq!(advice(&campaign(0.0038, "dwell_s = 32", friction)), bare);
        let wall = "wall = { kind = \"restitution\", coefficient = 0.5 }";
        let particle = format!("particle = {{ mass_ratio = 0.1, clearance_ratio = 5, {wall} }}\n");
        assert!(advice(&campaign(0.0038, "dwell_s = 32", &particle))[0].contains("unless the damper shortens it"));
    }
}
