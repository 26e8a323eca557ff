//! A linear oscillator under an acceleration that is linear between its samples, in closed form (Nigam and Jennings 1969).
//!
//! Over a step with z″ = a + s·τ the motion is u = e^(−ζωτ)·(P cos ωdτ + Q sin ωdτ) + R + S·τ, with S = −s/ω², R = −a/ω² + 2ζs/ω³, and P and Q of
//! the state at its start. Its derivatives and the absolute acceleration u″ + z″ = −2ζω u′ − ω² u have the same form, so one search finds the extremes of
//! all.

use super::Largest;
use crate::motion_record::Record;

/// Parts of a period in which the search for a root of a derivative looks for a change of sign.
const PARTS: f64 = 16.0;
/// Halvings of an interval with a root: to 1e-6 of a sixteenth of a period, where a maximum is right to 1e-13 of its value.
const HALVINGS: usize = 20;

/// e^(−ζωτ)·(P cos ωdτ + Q sin ωdτ) + R + S·τ.
#[derive(Clone, Copy, Debug)]
struct Form {
    cosine: f64,
    sine: f64,
    constant: f64,
    slope: f64,
}

/// ζω, ωd and ω.
#[derive(Clone, Copy, Debug)]
struct Rates {
    decay: f64,
    damped: f64,
    natural: f64,
}

impl Form {
    fn at(&self, rates: &Rates, tau: f64) -> f64 {
        let (sine, cosine) = (rates.damped * tau).sin_cos();
        (-rates.decay * tau).exp() * (self.cosine * cosine + self.sine * sine) + self.constant + self.slope * tau
    }

    fn derivative(&self, rates: &Rates) -> Self {
        Self {
            cosine: rates.damped * self.sine - rates.decay * self.cosine,
            sine: -rates.damped * self.cosine - rates.decay * self.sine,
            constant: self.slope,
            slope: 0.0,
        }
    }

    /// The largest magnitude in 0 ≤ τ ≤ `end`, if it exceeds `most`.
    fn largest(&self, rates: &Rates, end: f64, most: f64) -> f64 {
        let ends = self.at(rates, 0.0).abs().max(self.at(rates, end).abs());
        // |f″| is at most ω² times the amplitude.
        let bend = rates.natural.powi(2) * self.cosine.hypot(self.sine);
        if ends + 0.125 * end * end * bend <= most {
            return most;
        }
        let slope = self.derivative(rates);
        let parts = (PARTS * end * rates.damped / std::f64::consts::TAU).ceil().max(1.0) as usize;
        let step = end / parts as f64;
        let mut found = most.max(ends);
        let mut before = slope.at(rates, 0.0);
        for n in 0..parts {
            let (mut low, mut high) = (n as f64 * step, (n + 1) as f64 * step);
            let after = slope.at(rates, high);
            if before * after < 0.0 {
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (low + high);
                    if slope.at(rates, middle) * before > 0.0 { low = middle } else { high = middle }
                }
                found = found.max(self.at(rates, 0.5 * (low + high)).abs());
            }
            before = after;
        }
        found
    }
}

/// The largest responses to an acceleration record. With `is_between` also between its samples and in the first period after it, in which a free
/// oscillation is largest.
pub(super) fn exact(record: &Record, omega: f64, zeta: f64, is_between: bool) -> Largest {
    let rates = Rates { decay: zeta * omega, damped: omega * (1.0 - zeta * zeta).sqrt(), natural: omega };
    let (mut u, mut v) = (0.0, 0.0);
    let mut largest = Largest { sa_m_per_s2: 0.0, ..Largest::default() };
    let mut step = |a: f64, b: f64, length_s: f64, is_between: bool| {
        let slope = (b - a) / length_s;
        let square = omega * omega;
        let constant = -a / square + 2.0 * zeta * slope / (square * omega);
        let cosine = u - constant;
        let sine = (v + slope / square + rates.decay * cosine) / rates.damped;
        let motion = Form { cosine, sine, constant, slope: -slope / square };
        let velocity = motion.derivative(&rates);
        let of = |c: fn(&Form) -> f64| -2.0 * rates.decay * c(&velocity) - square * c(&motion);
        let acceleration = Form {
            cosine: of(|f| f.cosine),
            sine: of(|f| f.sine),
            constant: of(|f| f.constant),
            slope: of(|f| f.slope),
        };
        for (form, most) in [
            (&motion, &mut largest.sd_m),
            (&velocity, &mut largest.sv_m_per_s),
            (&acceleration, &mut largest.sa_m_per_s2),
        ] {
            *most = if is_between {
                form.largest(&rates, length_s, *most)
            } else {
                most.max(form.at(&rates, length_s).abs())
            };
        }
        (u, v) = (motion.at(&rates, length_s), velocity.at(&rates, length_s));
    };
    for pair in record.samples.windows(2) {
        step(pair[0], pair[1], record.step_s, is_between);
    }
    if is_between {
        step(0.0, 0.0, std::f64::consts::TAU / omega, true);
    }
    largest
}

/// The largest responses at the steps of Newmark's average acceleration (γ = ½, β = ¼), two steps a sample. Starts at rest with the acceleration of
/// the first sample.
pub(super) fn newmark(record: &Record, omega: f64, zeta: f64) -> Largest {
    const STEPS: usize = 2;
    let h = record.step_s / STEPS as f64;
    let mut largest = Largest::default();
    let (mut u, mut v, mut acceleration) = (0.0, 0.0, -record.samples[0]);
    for pair in record.samples.windows(2) {
        for n in 1..=STEPS {
            let ground = pair[0] + (pair[1] - pair[0]) * n as f64 / STEPS as f64;
            let (u_0, v_0) = (u + h * v + 0.25 * h * h * acceleration, v + 0.5 * h * acceleration);
            acceleration = (-ground - 2.0 * zeta * omega * v_0 - omega * omega * u_0)
                / (1.0 + zeta * omega * h + 0.25 * omega * omega * h * h);
            (u, v) = (u_0 + 0.25 * h * h * acceleration, v_0 + 0.5 * h * acceleration);
            largest.sd_m = largest.sd_m.max(u.abs());
            largest.sv_m_per_s = largest.sv_m_per_s.max(v.abs());
            largest.sa_m_per_s2 = largest.sa_m_per_s2.max((acceleration + ground).abs());
        }
    }
    largest
}
