//! Motions for unit values at the start of a step, and means of their products.

use super::excitation::Excitation;
use super::flow::{LARGEST_ARC_RAD, Rates, solve};
use super::series::{Series, TERMS};
use crate::model::SetUp;

/// [`mean_product`] of each pair.
pub(super) fn means(columns: &[Series; 5]) -> [[f64; 5]; 5] {
    let mut means = [[0.0; 5]; 5];
    for first in 0..5 {
        for second in first..5 {
            let mean = mean_product(&columns[first], &columns[second]);
            (means[first][second], means[second][first]) = (mean, mean);
        }
    }
    means
}

/// Motions of a structure without a second mass over one step, for unit values at its start: displacement, velocity ×
/// step, sine and cosine of the excitation ([`super::excitation::Wave`]).
#[derive(Clone, Debug)]
pub struct UnitMotions {
    /// Length of the step, s.
    pub step_s: f64,
    /// Angle of the excitation over the step, rad.
    pub angle_rad: f64,
    /// Displacement over the step for each unit value.
    pub columns: [Series; 4],
}

impl UnitMotions {
    /// For a step that divides `whole_s` into the smallest number of equal steps of at most [`LARGEST_ARC_RAD`] of the
    /// fastest rate. The set-up must be valid.
    #[must_use]
    pub fn dividing(set_up: &SetUp, excitation: &Excitation, whole_s: f64) -> (f64, Self) {
        let turning = excitation.angular_frequency_rad_per_s();
        let rates = Rates::of(&set_up.structure, set_up.structure.mass_kg, excitation);
        let steps = libm::ceil(whole_s * rates.fastest(turning) / LARGEST_ARC_RAD).max(1.0);
        let h = whole_s / steps;
        let columns = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
            .map(|[x, v, sine, cosine]| solve(&rates, turning, h, [x, v, 0.0, sine, cosine]));
        (steps, Self { step_s: h, angle_rad: turning * h, columns })
    }
}

/// ∫₀¹ a b dτ.
#[must_use]
pub fn mean_product(a: &Series, b: &Series) -> f64 {
    let mut product = [0.0; 2 * TERMS];
    for (n, a) in a.iter().enumerate() {
        for (m, b) in b.iter().enumerate() {
            product[n + m] += a * b;
        }
    }
    product.iter().enumerate().rev().map(|(n, c)| c / (n + 1) as f64).sum()
}
