//! Free vibrations whose damping or stiffness goes with the amplitude: a reference integrator and closed forms.

use std::f64::consts::{FRAC_2_PI, PI, TAU};

/// x″ + ω²(x + α x³ + (F/k) sgn x′) + 2ζω x′ + b |x′| x′ = 0.
#[derive(Clone, Copy, Debug)]
pub struct Oscillator {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    /// b = c/M of air damping c |x′| x′, 1/m.
    pub air_per_m: f64,
    /// F/k, m.
    pub coulomb_m: f64,
    /// α, 1/m².
    pub cubic_per_m2: f64,
}

/// A structure without anything else.
pub const LINEAR: Oscillator =
    Oscillator { frequency_hz: 2.5, damping_ratio: 0.004, air_per_m: 0.0, coulomb_m: 0.0, cubic_per_m2: 0.0 };

/// Release, m.
pub const START_M: f64 = 0.035;
/// Time between readings, s.
pub const STEP_S: f64 = 0.002;

impl Oscillator {
    /// Times and displacements of a release, by the classical Runge-Kutta method in steps of a tenth of a millisecond: error below 1e-9 m, and
    /// where friction changes its sign inside a step 1e-8·ω²·F/k.
    pub fn release(&self, seconds: f64) -> (Vec<f64>, Vec<f64>) {
        let omega = TAU * self.frequency_hz;
        let acceleration = |x: f64, v: f64| {
            let friction = if v == 0.0 { 0.0 } else { self.coulomb_m * v.signum() };
            -omega * omega * (x + self.cubic_per_m2 * x * x * x + friction)
                - 2.0 * self.damping_ratio * omega * v
                - self.air_per_m * v.abs() * v
        };
        const PARTS: usize = 20;
        let h = STEP_S / PARTS as f64;
        let (mut x, mut v) = (START_M, 0.0);
        let count = (seconds / STEP_S) as usize;
        let mut readings = Vec::with_capacity(count);
        for _ in 0..count {
            readings.push(x);
            for _ in 0..PARTS {
                let (k1x, k1v) = (v, acceleration(x, v));
                let (k2x, k2v) = (v + 0.5 * h * k1v, acceleration(x + 0.5 * h * k1x, v + 0.5 * h * k1v));
                let (k3x, k3v) = (v + 0.5 * h * k2v, acceleration(x + 0.5 * h * k2x, v + 0.5 * h * k2v));
                let (k4x, k4v) = (v + h * k3v, acceleration(x + h * k3x, v + h * k3v));
                x += h / 6.0 * (k1x + 2.0 * k2x + 2.0 * k3x + k4x);
                v += h / 6.0 * (k1v + 2.0 * k2v + 2.0 * k3v + k4v);
            }
        }
        ((0..count).map(|n| n as f64 * STEP_S).collect(), readings)
    }

    /// −a′/(Ω·a) at an amplitude, by the loss of energy of a cycle. Air damping loses c·ω²a³·8/3, as much as the damping ratio
    /// (4/3π)·(c/M)·a; friction 4·F·a, as much as (2/π)·(F/k)/a. With the stiffness k(1 + αx²) the energy rises by k·a(1 + αa²)
    /// with the amplitude and the frequency by the factor 1 + ⅜αa², which makes ζ(1 − ⅝αa²) of a viscous ζ.
    pub fn damping_ratio_at(&self, a: f64) -> f64 {
        let linear = self.damping_ratio + 4.0 / (3.0 * PI) * self.air_per_m * a + FRAC_2_PI * self.coulomb_m / a;
        linear * (1.0 - 0.625 * self.cubic_per_m2 * a * a)
    }

    /// Ω at an amplitude, Hz.
    pub fn frequency_hz_at(&self, a: f64) -> f64 {
        self.frequency_hz * (1.0 + 0.375 * self.cubic_per_m2 * a * a)
    }
}

/// Normal noise from a seed.
pub struct Noise(fastrand::Rng);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(fastrand::Rng::with_seed(seed))
    }

    /// A number between 0 and 1.
    pub fn uniform(&mut self) -> f64 {
        self.0.f64()
    }

    /// A normal number of standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.0.f64()).ln()).sqrt() * (TAU * self.0.f64()).cos()
    }

    /// These values with white noise.
    pub fn added(&mut self, values: &[f64], rms: f64) -> Vec<f64> {
        values.iter().map(|value| value + rms * self.normal()).collect()
    }
}
