//! Free motion of a structure with viscous and Coulomb damping, in closed form.
//!
//! M ẍ + c ẋ + k x + F sgn ẋ = 0. Between two turning points the friction has one sign: the motion is a damped sine about
//! ±F/k. From turning point to turning point |x| goes to (|x| − F/k)·e^(−πζ/√(1−ζ²)) − F/k. The structure sticks where |x| at a
//! turning point is at most F/k.

use std::f64::consts::PI;

/// A free motion and the sensor that sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecayMotion {
    /// ωn = √(k/M), rad/s; greater than 0.
    pub angular_frequency_rad_per_s: f64,
    /// ζ = c/(2√(kM)); magnitude less than 1.
    pub damping_ratio: f64,
    /// Displacement at the turning point, m.
    pub turning_m: f64,
    /// Time of that turning point, s.
    pub turning_s: f64,
    /// Reading at x = 0, m.
    pub offset_m: f64,
    /// F/k, m. An estimate may be negative when there is no friction.
    pub coulomb_m: f64,
    /// What a lag τ of the sensor adds to the reading of a motion about ±F/k besides delay and scale, in the direction of ±F/k:
    /// (ωτ)²/2·F/k, m. Left out, it shifts the frequency.
    pub lag_m: f64,
    /// Third-order error of the sensor: the reading is x + cubic·x³, 1/m².
    pub cubic_per_m2: f64,
}

impl DecayMotion {
    /// The readings at these times, which rise, s; appended to `out`.
    pub fn readings(&self, times_s: &[f64], out: &mut Vec<f64>) {
        let Self { angular_frequency_rad_per_s: omega, damping_ratio: zeta, coulomb_m: stop, .. } = *self;
        let root = (1.0 - zeta * zeta).max(1e-12).sqrt();
        let half_s = PI / (omega * root);
        let decay = (-PI * zeta / root).exp();
        // The turning point at or before the first time.
        let mut place = times_s.first().map_or(0.0, |t| ((t - self.turning_s) / half_s).floor());
        let mut turning = self.turning_m;
        for _ in 0..(-place).max(0.0) as usize {
            turning = -((turning.abs() + stop) / decay + stop) * turning.signum();
        }
        for _ in 0..place.max(0.0) as usize {
            turning = next_turning(turning, stop, decay);
        }
        for t_s in times_s {
            let mut since_s = t_s - self.turning_s - place * half_s;
            while since_s >= half_s {
                turning = next_turning(turning, stop, decay);
                place += 1.0;
                since_s -= half_s;
            }
            let mut lag_m = 0.0;
            let x = if turning.abs() <= stop {
                turning
            } else {
                lag_m = self.lag_m * turning.signum();
                let centre = stop * turning.signum();
                let angle = omega * root * since_s;
                let swing = angle.cos() + zeta / root * angle.sin();
                centre + (turning - centre) * (-zeta * omega * since_s).exp() * swing
            };
            out.push(self.offset_m + x + lag_m + self.cubic_per_m2 * x * x * x);
        }
    }
}

/// The displacement at the next turning point; the same when the structure sticks.
fn next_turning(turning: f64, stop: f64, decay: f64) -> f64 {
    if turning.abs() <= stop {
        return turning;
    }
    let centre = stop * turning.signum();
    centre - (turning - centre) * decay
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: the equation of motion by the classical Runge-Kutta method in steps of 10 µs, error 1e-9 of the start; a
    /// change of sign inside a step costs F/M·h² = 4e-11 m each.
    #[test]
    fn the_closed_form_solves_the_equation_of_motion() {
        let (omega, zeta, stop) = (2.0 * PI * 2.5, 0.01, 0.0016);
        let motion = DecayMotion {
            angular_frequency_rad_per_s: omega,
            damping_ratio: zeta,
            turning_m: 0.035,
            turning_s: 0.0,
            offset_m: 0.0,
            coulomb_m: stop,
            lag_m: 0.0,
            cubic_per_m2: 0.0,
        };
        let h = 1e-5;
        let acceleration = |x: f64, v: f64| {
            -omega * omega * (x + stop * if v == 0.0 { -1.0 } else { v.signum() }) - 2.0 * zeta * omega * v
        };
        let (mut x, mut v) = (0.035f64, 0.0f64);
        let (mut times, mut expected) = (vec![], vec![]);
        for n in 0..100_000 {
            if n % 100 == 0 {
                times.push(f64::from(n) * h);
                expected.push(x);
            }
            let (k1x, k1v) = (v, acceleration(x, v));
            let (k2x, k2v) = (v + 0.5 * h * k1v, acceleration(x + 0.5 * h * k1x, v + 0.5 * h * k1v));
            let (k3x, k3v) = (v + 0.5 * h * k2v, acceleration(x + 0.5 * h * k2x, v + 0.5 * h * k2v));
            let (k4x, k4v) = (v + h * k3v, acceleration(x + h * k3x, v + h * k3v));
            x += h / 6.0 * (k1x + 2.0 * k2x + 2.0 * k3x + k4x);
            v += h / 6.0 * (k1v + 2.0 * k2v + 2.0 * k3v + k4v);
        }
        let mut readings = vec![];
        motion.readings(&times, &mut readings);
        let worst = readings.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 2e-7, "{worst}");
    }

    #[test]
    fn a_motion_that_sticks_stays_where_it_is() {
        let motion = DecayMotion {
            angular_frequency_rad_per_s: 10.0,
            damping_ratio: 0.0,
            turning_m: 0.01,
            turning_s: 0.0,
            offset_m: 0.0,
            coulomb_m: 0.003,
            lag_m: 0.0,
            cubic_per_m2: 0.0,
        };
        let mut readings = vec![];
        motion.readings(&[0.0, PI / 10.0, 2.0 * PI / 10.0, 100.0], &mut readings);
        // 10 mm, then −(10 − 3) + 3 = −4 mm, then 4 − 2·3 = −2 mm on the same side: it sticks there.
        for (reading, expected) in readings.iter().zip([0.01, -0.004, -0.002, -0.002]) {
            assert!((reading - expected).abs() < 1e-9, "{readings:?}");
        }
    }
}
