//! Power series of one oscillator, and of two that a link joins: the tables of [`super::flow`].

use super::excitation::Excitation;
use super::flow::LARGEST_ARC_RAD;
use super::series::{Series, TERMS, mean_product};
use crate::model::Structure;

/// `q″ = −stiffness q − damping q′ + sine·S + cosine·C + a`: one oscillator under the wave and a constant acceleration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rates {
    pub stiffness: f64,
    pub damping: f64,
    pub sine: f64,
    pub cosine: f64,
}

impl Rates {
    /// A structure with this moving mass.
    pub fn of(structure: &Structure, mass: f64, excitation: &Excitation) -> Self {
        let base_share = if excitation.moves_base() { 1.0 } else { 0.0 };
        Self {
            stiffness: structure.stiffness_n_per_m / mass,
            damping: structure.damping_n_s_per_m / mass,
            sine: if base_share > 0.0 { structure.stiffness_n_per_m / mass } else { 1.0 / mass },
            cosine: base_share * structure.damping_n_s_per_m * excitation.angular_frequency_rad_per_s() / mass,
        }
    }

    /// Upper bound of every rate in the solution, rad/s: with `|q| ≤ N`, `|q′| ≤ ρN`, `|q⁽ⁿ⁾| ≤ ρⁿN`.
    pub fn fastest(&self, turning: f64) -> f64 {
        let half = 0.5 * self.damping;
        (half + libm::sqrt(half * half + self.stiffness)).max(turning)
    }
}

/// Tables of one oscillator over a full arc, for unit values of displacement, velocity, acceleration, sine and cosine.
#[derive(Clone, Debug)]
pub(super) struct Oscillator {
    /// Length of a full arc, s, and its reciprocal.
    pub step_s: f64,
    pub per_step: f64,
    /// Angle of the wave over an arc, rad; the cosine of that angle minus one, and its sine.
    pub angle: f64,
    pub turn: (f64, f64),
    pub columns: [Series; 5],
    /// Displacement at the end minus displacement at the start.
    pub shift: [f64; 5],
    /// Velocity at the end minus velocity at the start.
    pub gain: [f64; 5],
    /// k/M of the moving mass, 1/s².
    pub stiffness_per_mass: f64,
    /// Second to fifth derivatives by τ at the start.
    pub rates: [[f64; 5]; 4],
    /// Bounds of the second, third and fourth derivatives by τ over the arc.
    pub second: [f64; 5],
    pub third: [f64; 5],
    pub fourth: [f64; 5],
    /// Largest amount by which the velocity can lie below its chord.
    pub sag: [f64; 5],
    /// Mean over the arc of the products of two unit motions: the mean square of a motion is a quadratic form in its
    /// state at the start.
    means: [[f64; 5]; 5],
}

impl Oscillator {
    pub fn new(rates: Rates, turning: f64) -> Self {
        let fastest = rates.fastest(turning);
        let h = LARGEST_ARC_RAD / fastest;
        let mut columns = [[0.0; TERMS]; 5];
        for (which, column) in columns.iter_mut().enumerate() {
            let mut unit = [0.0; 5];
            unit[which] = if which == 1 { h } else { 1.0 };
            *column = solve(&rates, turning, h, unit);
        }
        let sum = |column: &Series, weight: fn(f64) -> f64, first: usize| -> f64 {
            (first..TERMS).rev().map(|n| column[n] * weight(n as f64)).sum()
        };
        let bound = |column: &Series, weight: fn(f64) -> f64| -> f64 {
            (0..TERMS).map(|n| column[n].abs() * weight(n as f64)).sum()
        };
        let third = columns.each_ref().map(|c| bound(c, |n| n * (n - 1.0) * (n - 2.0)));
        let angle = turning * h;
        let half_sine = libm::sin(0.5 * angle);
        let factorial = [2.0, 6.0, 24.0, 120.0];
        Self {
            step_s: h,
            per_step: 1.0 / h,
            angle,
            turn: (-2.0 * half_sine * half_sine, libm::sin(angle)),
            shift: columns.each_ref().map(|c| sum(c, |_| 1.0, 1)),
            gain: columns.each_ref().map(|c| sum(c, |n| n, 2) / h),
            stiffness_per_mass: rates.stiffness,
            rates: core::array::from_fn(|n| columns.each_ref().map(|c| c[n + 2] * factorial[n])),
            fourth: columns.each_ref().map(|c| bound(c, |n| n * (n - 1.0) * (n - 2.0) * (n - 3.0))),
            sag: third.map(|bound| bound / (8.0 * h)),
            second: columns.each_ref().map(|c| bound(c, |n| n * (n - 1.0))),
            third,
            means: [[0.0; 5]; 5],
            columns,
        }
    }

    /// The same with the table of [`Oscillator::mean_square`].
    pub fn with_means(mut self) -> Self {
        self.means = means(&self.columns);
        self
    }

    /// Mean of the squared displacement over a full arc, m²; needs [`Oscillator::with_means`].
    #[inline]
    pub fn mean_square(&self, unit: &[f64; 5]) -> f64 {
        dot(&self.means.each_ref().map(|row| dot(row, unit)), unit)
    }

    /// Largest amount by which a displacement can lie outside its values at the ends of the arc, m.
    #[inline]
    pub fn bulge(&self, unit: &[f64; 5]) -> f64 {
        dot(&self.second, &unit.map(f64::abs)) * 0.125
    }

    /// The sum of the columns, weighted by `unit`.
    #[inline]
    pub fn series(&self, unit: &[f64; 5]) -> Series {
        core::array::from_fn(|n| {
            (self.columns[0][n] * unit[0] + self.columns[1][n] * unit[1])
                + (self.columns[2][n] * unit[2] + (self.columns[3][n] * unit[3] + self.columns[4][n] * unit[4]))
        })
    }
}

/// `row · unit`.
#[inline]
pub(super) fn dot(row: &[f64; 5], unit: &[f64; 5]) -> f64 {
    (row[0] * unit[0] + row[1] * unit[1]) + (row[2] * unit[2] + (row[3] * unit[3] + row[4] * unit[4]))
}

/// The series of an oscillator over an arc of `h` seconds, from displacement, velocity × h, constant acceleration, sine and
/// cosine.
pub(super) fn solve(rates: &Rates, turning: f64, h: f64, unit: [f64; 5]) -> Series {
    let wave = wave_series(unit[3], unit[4], turning * h);
    let quarter = wave_series(unit[4], -unit[3], turning * h);
    let mut q = [0.0; TERMS];
    q[0] = unit[0];
    q[1] = unit[1];
    let square = h * h;
    for n in 0..TERMS - 2 {
        let constant = if n == 0 { unit[2] } else { 0.0 };
        let next = (n + 1) as f64;
        let forces = rates.sine * wave[n] + rates.cosine * quarter[n] + constant - rates.stiffness * q[n];
        q[n + 2] = (square * forces - rates.damping * h * next * q[n + 1]) / (next * (next + 1.0));
    }
    q
}

/// Series of the rotating part: `sine cos a τ + cosine sin a τ`, where `a` is the angle of an arc.
#[inline]
pub(super) fn wave_series(sine: f64, cosine: f64, angle: f64) -> Series {
    let mut series = [0.0; TERMS];
    series[0] = sine;
    series[1] = cosine * angle;
    let square = angle * angle;
    for n in 2..TERMS {
        series[n] = -series[n - 2] * square / ((n * (n - 1)) as f64);
    }
    series
}

/// Structure and second mass joined by a spring and a dashpot. The columns are for unit values of x, v·h, w, s·h,
/// acceleration of the structure, acceleration of the second mass, sine, cosine.
#[derive(Clone, Debug)]
pub(super) struct Coupled {
    pub step_s: f64,
    x: [Series; 8],
    w: [Series; 8],
}

impl Coupled {
    pub fn new(rates: Rates, link: Link, mass: f64, turning: f64) -> Self {
        // In the coordinates (√M x, √m y) the matrices are symmetric; their row sums bound both rates.
        let second = mass / link.mass_ratio;
        let cross = libm::sqrt(mass / second);
        let row = |structure: f64, joint: f64| {
            let at_structure = structure + joint / mass * (1.0 + cross);
            at_structure.max(joint / second * (1.0 + 1.0 / cross))
        };
        let bound = Rates {
            stiffness: row(rates.stiffness, link.stiffness),
            damping: row(rates.damping, link.damping),
            ..rates
        };
        let h = LARGEST_ARC_RAD / bound.fastest(turning);
        let (mut x, mut w) = ([[0.0; TERMS]; 8], [[0.0; TERMS]; 8]);
        for which in 0..8 {
            let mut unit = [0.0; 8];
            unit[which] = 1.0;
            (x[which], w[which]) = Self::solve(&rates, &link, mass, turning, h, &unit);
        }
        Self { step_s: h, x, w }
    }

    fn solve(rates: &Rates, link: &Link, mass: f64, turning: f64, h: f64, unit: &[f64; 8]) -> (Series, Series) {
        let wave = wave_series(unit[6], unit[7], turning * h);
        let quarter = wave_series(unit[7], -unit[6], turning * h);
        let (mut x, mut w) = ([0.0; TERMS], [0.0; TERMS]);
        (x[0], x[1], w[0], w[1]) = (unit[0], unit[1], unit[2], unit[3]);
        let square = h * h;
        for n in 0..TERMS - 2 {
            let next = (n + 1) as f64;
            let (ax, aw) = if n == 0 { (unit[4], unit[5]) } else { (0.0, 0.0) };
            let joint = (square * link.stiffness * w[n] + h * link.damping * next * w[n + 1]) / mass;
            let forces = rates.sine * wave[n] + rates.cosine * quarter[n] + ax - rates.stiffness * x[n];
            let acceleration = square * forces - rates.damping * h * next * x[n + 1] + joint;
            let scale = next * (next + 1.0);
            x[n + 2] = acceleration / scale;
            w[n + 2] = (square * aw - acceleration - joint * link.mass_ratio) / scale;
        }
        (x, w)
    }

    pub fn series(&self, unit: &[f64; 8]) -> (Series, Series) {
        let (mut x, mut w) = ([0.0; TERMS], [0.0; TERMS]);
        for (which, &amount) in unit.iter().enumerate() {
            for n in 0..TERMS {
                x[n] += self.x[which][n] * amount;
                w[n] += self.w[which][n] * amount;
            }
        }
        (x, w)
    }
}

/// The spring and dashpot between structure and second mass: those of a soft wall or of a tuned mass damper.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Link {
    /// k1, N/m.
    pub stiffness: f64,
    /// c1, N·s/m.
    pub damping: f64,
    /// M/m.
    pub mass_ratio: f64,
}

/// [`mean_product`] of each pair.
fn means(columns: &[Series; 5]) -> [[f64; 5]; 5] {
    let mut means = [[0.0; 5]; 5];
    for first in 0..5 {
        for second in first..5 {
            let mean = mean_product(&columns[first], &columns[second]);
            (means[first][second], means[second][first]) = (mean, mean);
        }
    }
    means
}
