//! The force of a friction damper whose spring the rig adjusts: as the run measured it, or that of the target with the tolerance of
//! the spring's controller.
//!
//! Forces are shares of the target's, so that they apply to other models of the same set-up too. docs/COMPARE.md derives the
//! uncertainties.

use std::ops::Range;

use damprig_core::control::friction_spring::SpringConfig;
use damprig_core::io::TICK_HZ;

use super::recorded::RecordedSamples;
use crate::campaign::CampaignSetUp;
use crate::identify::sensors::{ASSUMED_LINEARITY, by_linearity, rectangular};
use crate::setup::SpringTarget;

/// Half-width of the stiffness of a real spring about its nominal value: the tolerance of usual compression springs.
const ASSUMED_STIFFNESS: f64 = 0.1;

/// The friction force over that of the target.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SpringForce {
    /// In each tick; the last value holds on.
    shares: Vec<f64>,
    /// Relative standard uncertainty of all of them together.
    pub(super) uncertainty: f64,
    /// The force was measured.
    pub(super) is_measured: bool,
}

impl SpringForce {
    /// Of a set-up whose friction does not come from a spring.
    pub(super) fn exact() -> Self {
        Self { shares: vec![1.0], uncertainty: 0.0, is_measured: false }
    }

    /// Of a run's set-up in these ticks. `z_m`: measured base amplitudes, which a friction ratio is kept by; empty where none is kept.
    pub(super) fn of(
        own: &CampaignSetUp,
        config: &SpringConfig,
        is_simulated: bool,
        recorded: Option<&RecordedSamples>,
        ticks: &Range<u64>,
        (z_m, frequency_hz): (&[f64], f64),
    ) -> Self {
        let Some(spring) = own.spring() else { return Self::exact() };
        let target_n = spring.normal_force_n(own.model().structure.stiffness_n_per_m, own.base_amplitude_m);
        if target_n.is_nan() || target_n <= 0.0 {
            return Self::exact();
        }
        let of_sensor = if is_simulated { 0.0 } else { by_linearity(ASSUMED_LINEARITY) };
        let window = f64::from(config.average_s * TICK_HZ);
        if let Some((forces_n, noise_n)) = recorded.and_then(|own| own.spring_n(ticks, window)) {
            // The reading without contact is the mean over this time.
            let bias_ticks = f64::from((config.average_s + config.settle_s) * TICK_HZ);
            let of_bias = noise_n / bias_ticks.sqrt() / target_n;
            let shares = forces_n.iter().map(|force_n| force_n.max(0.0) / target_n).collect();
            return Self { shares, uncertainty: of_bias.hypot(of_sensor), is_measured: true };
        }
        let of_dead_band = rectangular(f64::from(config.dead_band_n) / target_n);
        let (share, uncertainty) = match spring.target {
            SpringTarget::Deflection(_) => {
                let steps = rectangular(0.5 * f64::from(config.step_m) * spring.stiffness_n_per_m / target_n);
                (1.0, steps.hypot(rectangular(ASSUMED_STIFFNESS)))
            }
            SpringTarget::FrictionRatio(_) if !z_m.is_empty() => {
                // The board measures Z over whole ticks of a cycle.
                let of_z = rectangular(0.5 * frequency_hz / f64::from(TICK_HZ));
                let n = z_m.len() as f64;
                let mean_m = z_m.iter().sum::<f64>() / n;
                let spread_m = (z_m.iter().map(|z| (z - mean_m) * (z - mean_m)).sum::<f64>() / n).sqrt();
                (mean_m / own.base_amplitude_m, of_dead_band.hypot(of_z).hypot(spread_m / mean_m))
            }
            _ => (1.0, of_dead_band),
        };
        Self { shares: vec![share], uncertainty: uncertainty.hypot(of_sensor), is_measured: false }
    }

    /// The same force in all ticks: the mean.
    pub(super) fn mean(&self) -> Self {
        Self { shares: vec![self.mean_share()], ..self.clone() }
    }

    fn mean_share(&self) -> f64 {
        self.shares.iter().sum::<f64>() / self.shares.len().max(1) as f64
    }

    /// What is worth saying about it; `None` for a friction that does not come from a spring.
    pub(super) fn remark(&self) -> Option<String> {
        if self.uncertainty == 0.0 {
            return None;
        }
        let percent = 200.0 * self.uncertainty;
        Some(if self.is_measured {
            let off = 100.0 * (self.mean_share() - 1.0);
            format!("the spring's force as measured: {off:+.2} % from its target, ± {percent:.2} %")
        } else {
            format!("the spring's force is known within ± {percent:.1} %; record \"spring_force\" to know it better")
        })
    }

    /// Its share in each tick; the last value holds on.
    pub(super) fn shares(&self) -> &[f64] {
        &self.shares
    }
}
