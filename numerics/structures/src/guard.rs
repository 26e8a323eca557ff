//! Guards: linear functions of the motion that stay positive until an event, and the certified first root of one.
//!
//! Over a step of length h a guard is a polynomial in time (of a free particle, of a recorded base: a cubic) and `Re Σ cⱼ zⱼ`. With rates |λⱼ| and
//! amplitudes |zⱼ|, which never grow, its fourth derivative is at most `Σ |cⱼ||λⱼ|⁴|zⱼ|` and that of the polynomial: it lies within that times h⁴/384 of the cubic with the
//! values and slopes of both ends (Hermite's remainder), and its slope within that times √3 h³/216 of the cubic's (Birkhoff and Priver 1967), or within
//! `(Σ |cⱼ||λⱼ|³|zⱼ| + |jerk of the polynomial|) h²/8` of its chord, which values within rounding do not disturb. Natural motions that turn
//! by more than [`FAST_RAD`] in a step are left out of cubic and chord; they add at most their amplitude. So a
//! fast but small natural motion does not shorten the steps.

use crate::linear::C64;
use crate::polynomial::Polynomial;

/// A natural motion that turns further than this within a step counts with its amplitude.
const FAST_RAD: f64 = 4.0;

const ROOT_3: f64 = 1.732_050_807_568_877_2;

/// The natural motions over a step of one length.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    /// h, s.
    pub length_s: f64,
    /// e^{λh}.
    pub turn: Vec<C64>,
    /// How many natural motions are slow: they come first.
    pub slow: usize,
}

impl Step {
    pub fn new(rates: &[C64], length_s: f64) -> Self {
        Self {
            length_s,
            slow: rates.iter().take_while(|rate| rate.norm() * length_s <= FAST_RAD).count(),
            turn: rates.iter().map(|rate| (rate * length_s).exp()).collect(),
        }
    }
}

/// A guard in its system, without its constant part.
#[derive(Clone, Debug)]
pub(crate) struct Guard {
    /// c.
    pub coefficients: Vec<C64>,
    /// Real parts and negative imaginary parts of c and c λ, which a real part of a product needs.
    terms: Vec<[f64; 4]>,
    /// c λ².
    bends: Vec<C64>,
    /// |c|, |c λ|, |c λ³| and |c λ⁴|.
    sizes: Vec<[f64; 4]>,
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

/// What the natural motions of a guard can do while their amplitudes last, by how many of them count as slow.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reach {
    /// `Σ |c||λ|³|z|` and `Σ |c||λ|⁴|z|` of the slow ones.
    slow: Vec<[f64; 2]>,
    /// `Σ |c||z|` and `Σ |c||λ||z|` of the fast ones.
    fast: Vec<[f64; 2]>,
}

/// Bounds of a guard over a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    /// Deviation from the cubic by the slow motions.
    smooth: f64,
    /// Amplitude of the fast motions.
    ripple: f64,
    /// Deviation of the slope from that of the cubic and from its chord, 1/s.
    slope: f64,
    chord: f64,
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
            terms: coefficients
                .iter()
                .zip(rates)
                .map(|(c, rate)| {
                    let slope = c * rate;
                    [c.re, -c.im, slope.re, -slope.im]
                })
                .collect(),
            bends: coefficients.iter().zip(rates).map(|(c, rate)| c * rate * rate).collect(),
            sizes: coefficients
                .iter()
                .zip(rates)
                .map(|(c, rate)| {
                    let (size, fast) = (c.norm(), rate.norm());
                    [size, size * fast, size * fast.powi(3), size * fast.powi(4)]
                })
                .collect(),
            coefficients,
        }
    }

    /// Value and slope by the first `count` natural motions, with the cubic.
    #[inline]
    pub fn at(&self, z: &[C64], count: usize, cubic: Here) -> Here {
        let mut sums = [0.0; 4];
        for (z, [c, c_im, slope, slope_im]) in z[..count].iter().zip(&self.terms) {
            let more = [c * z.re, c_im * z.im, slope * z.re, slope_im * z.im];
            sums.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
        // In this order wherever a guard is evaluated: a value that rounding makes zero is zero everywhere.
        Here { value: sums[0] + sums[1], slope: sums[2] + sums[3] }.plus(cubic)
    }

    /// Its second derivative at z, without that of the cubic.
    pub fn bend(&self, z: &[C64]) -> f64 {
        z.iter().zip(&self.bends).map(|(z, bend)| bend.re * z.re - bend.im * z.im).sum()
    }
}

impl Reach {
    /// Of a guard with these amplitudes of the natural motions.
    pub fn take(&mut self, guard: &Guard, amplitudes: &[f64]) {
        self.slow.clear();
        self.slow.push([0.0; 2]);
        self.fast.resize(amplitudes.len() + 1, [0.0; 2]);
        self.fast[amplitudes.len()] = [0.0; 2];
        let mut most = [0.0; 2];
        for ([.., third, fourth], amplitude) in guard.sizes.iter().zip(amplitudes) {
            most = [most[0] + third * amplitude, most[1] + fourth * amplitude];
            self.slow.push(most);
        }
        let [mut ripple, mut slope] = [0.0; 2];
        for (([size, rate, ..], amplitude), fast) in guard.sizes.iter().zip(amplitudes).zip(&mut self.fast).rev() {
            ripple += size * amplitude;
            slope += rate * amplitude;
            *fast = [ripple, slope];
        }
    }

    /// The size of all natural motions.
    pub fn size(&self) -> f64 {
        self.fast[0][0]
    }

    /// Bounds over a step of length h in which the first `slow` natural motions are slow, with the polynomial of the guard.
    #[inline]
    pub fn over(&self, h: f64, slow: usize, polynomial: Polynomial) -> Bounds {
        let ([third, fourth], [ripple, fast]) = (self.slow[slow], self.fast[slow]);
        let (third, fourth) = (third + polynomial.most(3, h), fourth + polynomial.most(4, h));
        let square = h * h;
        Bounds {
            smooth: fourth * square * square / 384.0,
            ripple,
            slope: fourth * square * h * (ROOT_3 / 216.0) + fast,
            chord: third * square / 8.0 + fast,
        }
    }
}

impl Bounds {
    /// Decides about a step of length h from what the slow motions with the cubic are at both ends. `is_zero`: the guard is zero at the start by
    /// definition.
    #[inline]
    pub fn judge(&self, h: f64, start: Here, end: Here, is_zero: bool) -> Verdict {
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
        // The slope of the cubic is within its three Bernstein coefficients.
        let middle = 3.0 * (end.value - start.value) / h - start.slope - end.slope;
        let rises = low > self.chord || (low.min(middle) > self.slope && !is_zero);
        if rises && (is_zero || start.value >= self.ripple) {
            return Verdict::Clear;
        }
        if high < -self.chord || high.max(middle) < -self.slope {
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
