//! The structure's motion at an impact: a fit to x on both sides, with a kink between them.
//!
//! x = Σ pₙτⁿ + S·H(τ) + Δv·h(τ)·H(τ) + Δa·g(τ)·H(τ), τ from the kink. The polynomial is the motion without the impact. Behind the impact
//! the structure also has its response h to a unit jump of its velocity, and g to the jump Δa of the friction's acceleration. S, a
//! step, is 0 where the kink is at the right time. The fit is linear, so a window of each part has its share of the answer. Readings during the contact and while the sensor still follows the kink are left
//! out.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::KnownSetUp;

/// Half-width of the fit, in periods of the structure: φ = 1.26 rad. The polynomial misses φ⁸/8!/2⁷ = 1.2e-6 of the amplitude.
pub(super) const HALF_WIDTH_PERIODS: f64 = 0.2;

/// Part of a period that a side of the fit must have at least.
pub(super) const MIN_SIDE_PERIODS: f64 = 0.05;

/// Time in which a sensor has followed a kink, s: five times the response of a slow laser, 1 ms.
pub(super) const SENSOR_S: f64 = 5e-3;

/// Coefficients of the polynomial.
const POLYNOMIAL: usize = 8;

/// Parameters of the fit: polynomial, step, jump of the velocity.
pub(super) const PARAMETERS: usize = POLYNOMIAL + 2;

/// Readings that a side must have at least.
pub(super) const MIN_READINGS: usize = 10;

/// The readings around an impact: times from the centre of its pulse.
#[derive(Clone, Debug)]
pub(super) struct ImpactWindow {
    /// s, rising.
    pub(super) t_s: Vec<f64>,
    /// m.
    pub(super) x_m: Vec<f64>,
    /// The wall, ±1.
    pub(super) side: f64,
}

/// The motion of the structure at an impact.
#[derive(Clone, Debug)]
pub(super) struct Kink {
    /// x at the impact, m.
    pub(super) x_m: f64,
    /// Velocity before the impact (m/s), its jump (m/s), and the step of x (m).
    pub(super) measured: Vector3<f64>,
    /// Whitens deviations of `measured`: they then have the variance of a reading, m².
    pub(super) whitening: Matrix3<f64>,
    /// Sum of the squared residuals, m².
    pub(super) residual_m2: f64,
}

type KinkRow = [f64; PARAMETERS];

impl ImpactWindow {
    /// The kink, `late_s` after the centre of the pulse. `None` when the readings do not determine it.
    pub(super) fn kink(&self, late_s: f64, known: &KnownSetUp) -> Option<Kink> {
        let scale_s = self.t_s.iter().fold(0.0f64, |most, t| most.max(t.abs()));
        let rows = self.rows(late_s, scale_s, known);
        let mut normal = SMatrix::<f64, PARAMETERS, PARAMETERS>::zeros();
        let mut right = SVector::<f64, PARAMETERS>::zeros();
        for (row, x_m) in &rows {
            for i in 0..PARAMETERS {
                right[i] += row[i] * x_m;
                for j in 0..=i {
                    normal[(i, j)] += row[i] * row[j];
                }
            }
        }
        // The lower triangle suffices.
        let decomposed = normal.cholesky()?;
        let solution = decomposed.solve(&right);
        let covariance = decomposed.inverse();
        let fitted = |row: &KinkRow| row.iter().zip(solution.iter()).map(|(r, p)| r * p).sum::<f64>();
        let residual_m2 = rows.iter().map(|(row, x_m)| (x_m - fitted(row)).powi(2)).sum();
        // Velocity, jump, step: place and unit of each.
        let wanted = [(1, 1.0 / scale_s), (POLYNOMIAL + 1, 1.0 / scale_s), (POLYNOMIAL, 1.0)];
        let measured = Vector3::from_fn(|n, _| solution[wanted[n].0] * wanted[n].1);
        let spread = Matrix3::from_fn(|i, j| {
            let ((a, unit_a), (b, unit_b)) = (wanted[i], wanted[j]);
            covariance[(a, b)] * unit_a * unit_b
        });
        let whitening = spread.cholesky()?.l().try_inverse()?;
        let kink = Kink { x_m: self.x_m[0] + solution[0], measured, whitening, residual_m2 };
        (kink.x_m.is_finite() && whitening.iter().all(|w| w.is_finite())).then_some(kink)
    }

    /// The part of the sensor's third-order error: x³ over the square of a length.
    pub(super) fn cubed(&self, length_m: f64) -> Self {
        Self { x_m: self.x_m.iter().map(|x| x.powi(3) / length_m.powi(2)).collect(), ..self.clone() }
    }

    /// The part of the friction for μi·g = 1 m/s²: it changes its sign with the impact.
    pub(super) fn friction(&self, late_s: f64, known: &KnownSetUp) -> Self {
        let (jump, response) = (-2.0 * self.side * known.mass_ratio, KinkResponse::of(known));
        let x_m = |t: &f64| if *t > 0.0 { jump * response.to_acceleration_s2(t - late_s) } else { 0.0 };
        Self { x_m: self.t_s.iter().map(x_m).collect(), ..self.clone() }
    }

    /// The rows of the fit: the functions of each parameter, in units of order 1, and x less the first reading.
    fn rows(&self, late_s: f64, scale_s: f64, known: &KnownSetUp) -> Vec<(KinkRow, f64)> {
        let response = KinkResponse::of(known);
        let row = |(t, x_m): (&f64, &f64)| {
            let tau = t - late_s;
            let mut row = [0.0; PARAMETERS];
            let mut power = 1.0;
            for place in &mut row[..POLYNOMIAL] {
                *place = power;
                power *= tau / scale_s;
            }
            // The contact lies between the sides, so its centre tells them apart.
            if *t > 0.0 {
                row[POLYNOMIAL] = 1.0;
                row[POLYNOMIAL + 1] = response.to_velocity_s(tau) / scale_s;
            }
            (row, x_m - self.x_m[0])
        };
        self.t_s.iter().zip(&self.x_m).map(row).collect()
    }
}

/// Responses of the structure over a base that goes on as it does.
struct KinkResponse {
    omega: f64,
    decay: f64,
    damped: f64,
}

impl KinkResponse {
    fn of(known: &KnownSetUp) -> Self {
        let (omega, zeta) = (known.angular_frequency_rad_per_s, known.damping_ratio.min(0.99));
        Self { omega, decay: zeta * omega, damped: omega * (1.0 - zeta * zeta).sqrt() }
    }

    /// x per unit of a jump of x′.
    fn to_velocity_s(&self, tau: f64) -> f64 {
        (-self.decay * tau).exp() * (self.damped * tau).sin() / self.damped
    }

    /// x per unit of a jump of the force over M.
    fn to_acceleration_s2(&self, tau: f64) -> f64 {
        let angle = self.damped * tau;
        let swing = angle.cos() + self.decay / self.damped * angle.sin();
        (1.0 - (-self.decay * tau).exp() * swing) / (self.omega * self.omega)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> KnownSetUp {
        KnownSetUp {
            angular_frequency_rad_per_s: 15.7,
            damping_ratio: 0.0038,
            mass_ratio: 0.1,
            friction_m_per_s2: 0.78,
            is_friction_held: false,
            clearance_m: 0.01,
            is_clearance_held: false,
            sensors: crate::Sensors::EXACT,
            mass_ratio_uncertainty: 0.0,
        }
    }

    /// A motion in closed form: a sine of another frequency, and from the kink on the responses to the jumps.
    #[test]
    fn position_velocity_and_jump_of_a_kinked_sine_are_found() {
        let (known, late_s, jump, side) = (known(), 0.8e-3, 0.05, -1.0);
        let response = KinkResponse::of(&known);
        let friction = -2.0 * side * 0.1 * 0.78;
        let before = |t: f64| 0.02 * (13.0 * (t - late_s) + 0.4).sin();
        let x = |t: f64| {
            let tau = t - late_s;
            let kinked = jump * response.to_velocity_s(tau) + friction * response.to_acceleration_s2(tau);
            before(t) + if tau > 0.0 { kinked } else { 0.0 }
        };
        let t_s: Vec<f64> = (-80..=80).filter(|n| *n < -2 || *n > 6).map(|n| f64::from(n) * 1e-3).collect();
        let window = ImpactWindow { x_m: t_s.iter().map(|t| x(*t)).collect(), t_s, side };
        let friction_part = window.friction(late_s, &known).kink(late_s, &known).unwrap();
        let mut kink = window.kink(late_s, &known).unwrap();
        kink.measured -= friction_part.measured * 0.78;
        kink.x_m -= friction_part.x_m * 0.78;
        // The polynomial misses 20 mm·(13·0.08)⁸/8!/2⁷ = 5 nm, over 80 ms.
        assert!((kink.x_m - before(late_s)).abs() < 5e-8, "{kink:?}");
        assert!((kink.measured[0] - 0.02 * 13.0 * 0.4f64.cos()).abs() < 5e-6, "{kink:?}");
        assert!((kink.measured[1] - jump).abs() < 1e-5, "{kink:?}");
        assert!(kink.measured[2].abs() < 5e-8, "{kink:?}");
        // A kink assumed 1 ms too early leaves the step −Δv·1 ms, which is not constant over the window: h′ = cos ωτ.
        let early = window.kink(late_s - 1e-3, &known).unwrap();
        assert!((early.measured[2] / (-jump * 1e-3) - 1.0).abs() < 0.25, "{early:?}");
    }
}
