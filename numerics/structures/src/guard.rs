//! Guards: linear functions of the motion that stay positive until an event, and the certified first root of one.
//!
//! Over a step of length h a guard is a cubic in time (of a free particle, of a recorded base) and `Re Σ cⱼ zⱼ`. With rates |λⱼ| and
//! amplitudes |zⱼ|, which never grow, its fourth derivative is at most `Σ |cⱼ||λⱼ|⁴|zⱼ|`: it lies within that times h⁴/384 of the cubic with the
//! values and slopes of both ends (Hermite's remainder), and its slope within `(Σ |cⱼ||λⱼ|³|zⱼ| + |jerk of the cubic|) h²/8` of its chord. Natural motions that turn
//! by more than [`FAST_RAD`] in a step are left out of cubic and chord; they add at most their amplitude. So a
//! fast but small natural motion does not shorten the steps.

use crate::linear::C64;

/// A natural motion that turns further than this within a step counts with its amplitude.
const FAST_RAD: f64 = 4.0;

/// The natural motions over a step of one length.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    /// h, s.
    pub length_s: f64,
    /// e^{λh}.
    pub turn: Vec<C64>,
    /// How many natural motions are slow: they come first.
    pub slow: usize,
    /// Deviation from the cubic per amplitude, of each natural motion.
    bend: Vec<f64>,
    /// Deviation of the slope from its chord per amplitude, 1/s.
    slope: Vec<f64>,
}

impl Step {
    pub fn new(rates: &[C64], length_s: f64) -> Self {
        let angle = |rate: &C64| rate.norm() * length_s;
        let slow = rates.iter().take_while(|rate| angle(rate) <= FAST_RAD).count();
        let bend = rates.iter().enumerate().map(|(j, rate)| if j < slow { angle(rate).powi(4) / 384.0 } else { 1.0 });
        let slope = rates.iter().enumerate().map(|(j, rate)| {
            let size = rate.norm();
            if j < slow { size * angle(rate).powi(2) / 8.0 } else { size }
        });
        Self {
            length_s,
            slow,
            bend: bend.collect(),
            slope: slope.collect(),
            turn: rates.iter().map(|rate| (rate * length_s).exp()).collect(),
        }
    }
}

/// A guard in its system, without its constant part.
#[derive(Clone, Debug)]
pub(crate) struct Guard {
    /// c.
    pub coefficients: Vec<C64>,
    /// c λ.
    slopes: Vec<C64>,
    /// |c|.
    sizes: Vec<f64>,
}

/// A guard at an instant: value, and derivatives by time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Here {
    pub value: f64,
    pub slope: f64,
}

impl Here {
    /// The sum of two parts of a guard.
    pub fn plus(self, other: Self) -> Self {
        Self { value: self.value + other.value, slope: self.slope + other.slope }
    }
}

/// Bounds of a guard over any step of one length while the amplitudes last.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bounds {
    /// Deviation from the cubic by the slow motions.
    smooth: f64,
    /// Amplitude of the fast motions.
    ripple: f64,
    /// Deviation of the slope from its chord, 1/s.
    slope: f64,
}

/// What is known of a guard over a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It stays positive.
    Clear,
    /// It falls through zero once.
    Falls,
    /// Undecided.
    Unsure,
}

impl Guard {
    pub fn new(coefficients: Vec<C64>, rates: &[C64]) -> Self {
        Self {
            slopes: coefficients.iter().zip(rates).map(|(c, rate)| c * rate).collect(),
            sizes: coefficients.iter().map(|c| c.norm()).collect(),
            coefficients,
        }
    }

    /// Value and slope by the first `count` natural motions, with the cubic.
    #[inline]
    pub fn at(&self, z: &[C64], count: usize, cubic: Here) -> Here {
        let mut here = Here::default();
        for ((z, c), slope) in z[..count].iter().zip(&self.coefficients).zip(&self.slopes) {
            here.value += c.re * z.re - c.im * z.im;
            here.slope += slope.re * z.re - slope.im * z.im;
        }
        // In this order wherever a guard is evaluated: a value that rounding makes zero is zero everywhere.
        here.plus(cubic)
    }

    /// Its second derivative at z, without that of the cubic.
    pub fn bend(&self, z: &[C64], rates: &[C64]) -> f64 {
        let terms = z.iter().zip(&self.slopes).zip(rates).map(|((z, slope), rate)| (slope * rate * z).re);
        terms.sum()
    }

    /// The size of its natural motions with these amplitudes.
    pub fn size(&self, amplitudes: &[f64]) -> f64 {
        self.sizes.iter().zip(amplitudes).map(|(size, amplitude)| size * amplitude).sum()
    }

    /// Bounds over steps like `step` with these amplitudes.
    pub fn bounds(&self, step: &Step, amplitudes: &[f64]) -> Bounds {
        let mut bounds = Bounds::default();
        for (j, (size, amplitude)) in self.sizes.iter().zip(amplitudes).enumerate() {
            let most = size * amplitude;
            if j < step.slow {
                bounds.smooth += most * step.bend[j];
            } else {
                bounds.ripple += most * step.bend[j];
            }
            bounds.slope += most * step.slope[j];
        }
        bounds
    }
}

impl Bounds {
    /// Decides about a step of length h from what the slow motions with the cubic are at both ends. `jerk`: the cubic's. `is_zero`: the guard is zero
    /// at the start by definition.
    #[inline]
    pub fn judge(&self, h: f64, start: Here, end: Here, jerk: f64, is_zero: bool) -> Verdict {
        let (first, second) = (start.value + start.slope * h / 3.0, end.value - end.slope * h / 3.0);
        let inner = first.min(second);
        let off = self.smooth + self.ripple;
        if !is_zero && start.value.min(end.value).min(inner) > off {
            return Verdict::Clear;
        }
        // The bracket of the bound on a cubic that starts from zero: 3 min(b₁, b₂) − M₄h⁴/96.
        if is_zero && self.ripple == 0.0 && end.value > 0.0 && 3.0 * inner > 4.0 * self.smooth {
            return Verdict::Clear;
        }
        let (low, high) = (start.slope.min(end.slope), start.slope.max(end.slope));
        let off_chord = self.slope + jerk.abs() * h * h / 8.0;
        if low > off_chord && (is_zero || start.value >= self.ripple) {
            return Verdict::Clear;
        }
        if high < -off_chord {
            if end.value > self.ripple {
                return Verdict::Clear;
            }
            if end.value <= -self.ripple && start.value > self.ripple {
                return Verdict::Falls;
            }
        }
        Verdict::Unsure
    }
}
