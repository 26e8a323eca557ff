//! Power series of the motion within one mode, from tables computed once per set-up and excitation.
//!
//! In every mode the system is linear with constant coefficients. The series over an arc is therefore a fixed matrix
//! times the state at its start (displacement, velocity, constant acceleration, rotating pair). The tables store that
//! matrix by columns, so the loop needs only multiplications and additions.

use super::excitation::{Excitation, Wave};
use super::series::{Series, TERMS, mean_product};
use crate::integrator::modes::Sign;
use crate::model::{SetUp, Structure};

/// Length of a full arc times the fastest rate of its mode, rad.
pub const LARGEST_ARC_RAD: f64 = 0.8;

/// State: displacements and velocities. The particle (or the tuned mass) is relative to the structure, so that wall
/// positions and a held particle are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExactState {
    /// x, m.
    pub x_m: f64,
    /// x′, m/s.
    pub v_m_per_s: f64,
    /// y − x, m.
    pub offset_m: f64,
    /// y′ − x′, m/s.
    pub slide_m_per_s: f64,
}

impl ExactState {
    /// y, m.
    #[must_use]
    pub fn y_m(&self) -> f64 {
        self.x_m + self.offset_m
    }

    /// y′, m/s.
    #[must_use]
    pub fn u_m_per_s(&self) -> f64 {
        self.v_m_per_s + self.slide_m_per_s
    }
}

/// `q″ = −stiffness q − damping q′ + sine·S + cosine·C + a`: one oscillator under the wave and a constant acceleration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rates {
    stiffness: f64,
    damping: f64,
    sine: f64,
    cosine: f64,
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
    fn new(rates: Rates, turning: f64) -> Self {
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
    fn with_means(mut self) -> Self {
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
    fn new(rates: Rates, link: Link, mass: f64, turning: f64) -> Self {
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

    fn series(&self, unit: &[f64; 8]) -> (Series, Series) {
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

/// The motions in which a link joins structure and second mass.
#[derive(Clone, Debug)]
struct Joined {
    link: Link,
    coupled: Coupled,
    /// The second mass on the link, on a structure that is stuck to the base.
    carried: Oscillator,
}

/// Selects the equations of motion of the structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Path {
    /// The structure moves alone.
    Alone,
    /// The structure moves with the held particle as one body.
    Together,
    /// The link joins the structure and the second mass.
    Coupled,
    /// The structure is stuck to the base.
    Carried,
    /// The structure is stuck to the base, and the second mass moves on the link.
    CarriedCoupled,
}

/// The equations of motion of the present mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    pub path: Path,
    /// Whether the particle moves relative to the structure (otherwise the offset is constant).
    pub sliding: bool,
    /// Constant acceleration of the structure, m/s².
    pub structure_acceleration: f64,
    /// Constant acceleration of the particle, m/s².
    pub particle_acceleration: f64,
    /// Side of the soft wall that is compressed, 0 if none is.
    pub pressed: Sign,
    /// Offset at which the link is unloaded, m.
    pub rest_offset: f64,
    /// Length of a full arc, s.
    pub step_s: f64,
}

/// The motions of structure, second mass and base over one arc.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// x, m, over τ = 0 … 1.
    pub x: Series,
    /// y − x, m.
    pub offset: Series,
    /// z, m.
    pub base: Series,
    /// Time that τ = 1 stands for, s.
    pub step_s: f64,
}

/// The tables of one set-up under one excitation.
#[derive(Clone, Debug)]
pub struct Flows {
    pub(super) alone: Oscillator,
    together: Option<Oscillator>,
    /// The same two for the displacement relative to the moving base, x − z.
    relative_alone: Oscillator,
    relative_together: Option<Oscillator>,
    /// With a tuned mass the first; with soft walls that of the negative and that of the positive side, the latter only where it
    /// differs.
    joined: [Option<Joined>; 2],
    pub(super) turning: f64,
    pub(super) base_share: f64,
}

impl Flows {
    /// The tables of a validated set-up.
    pub(super) fn new(set_up: &SetUp, excitation: &Excitation) -> Self {
        let turning = excitation.angular_frequency_rad_per_s();
        let base_share = if excitation.moves_base() { 1.0 } else { 0.0 };
        let structure = &set_up.structure;
        let rates = |mass: f64| Rates::of(structure, mass, excitation);
        // (x − z)″ has −z″ in place of the base's spring and dashpot force.
        let relative = |mass: f64| Rates {
            sine: if base_share > 0.0 { turning * turning } else { 1.0 / mass },
            cosine: 0.0,
            ..rates(mass)
        };
        let mass = structure.mass_kg;
        let alone = Oscillator::new(rates(mass), turning).with_means();
        let joint = |(second, stiffness, damping): (f64, f64, f64)| {
            let link = Link { stiffness, damping, mass_ratio: mass / second };
            let carried = Rates {
                stiffness: stiffness / second,
                damping: damping / second,
                sine: base_share * turning * turning,
                cosine: 0.0,
            };
            Joined {
                link,
                coupled: Coupled::new(rates(mass), link, mass, turning),
                carried: Oscillator::new(carried, turning),
            }
        };
        let soft = set_up.particle.map_or([None; 2], |p| {
            let springs = p.walls().map(|wall| wall.spring_and_dashpot());
            let positive = springs[1].filter(|_| springs[0] != springs[1]);
            [springs[0], positive].map(|spring| spring.map(|(stiffness, damping)| (p.mass_kg, stiffness, damping)))
        });
        let tuned = set_up.tmd.map(|t| (t.mass_kg, t.stiffness_n_per_m, t.damping_n_s_per_m));
        Self {
            together: set_up.particle.map(|p| Oscillator::new(rates(mass + p.mass_kg), turning).with_means()),
            relative_alone: Oscillator::new(relative(mass), turning),
            relative_together: set_up.particle.map(|p| Oscillator::new(relative(mass + p.mass_kg), turning)),
            joined: [soft[0].or(tuned).map(joint), soft[1].map(joint)],
            turning,
            base_share,
            alone,
        }
    }

    /// What joins structure and second mass: a tuned mass, or the pressed soft wall of that side.
    #[inline]
    fn joined(&self, pressed: Sign) -> Option<&Joined> {
        let [first, positive] = &self.joined;
        positive.as_ref().filter(|_| pressed > 0).or(first.as_ref())
    }

    /// The link of a tuned mass, or of the soft wall of that side.
    #[inline]
    pub(super) fn link(&self, pressed: Sign) -> Link {
        self.joined(pressed).map_or(Link::default(), |joined| joined.link)
    }

    /// The oscillator of the structure on `path`; `None` on the other paths.
    #[inline]
    pub(super) fn oscillator(&self, path: Path) -> Option<&Oscillator> {
        match path {
            Path::Alone => Some(&self.alone),
            Path::Together => self.together.as_ref(),
            Path::Coupled | Path::Carried | Path::CarriedCoupled => None,
        }
    }

    /// The oscillator of x − z on `path`; its constant acceleration is that of the structure on the resting base.
    #[inline]
    pub(super) fn relative_oscillator(&self, path: Path) -> Option<&Oscillator> {
        match path {
            Path::Alone => Some(&self.relative_alone),
            Path::Together => self.relative_together.as_ref(),
            Path::Coupled | Path::Carried | Path::CarriedCoupled => None,
        }
    }

    /// Length of a full arc on `path`, s, while the soft wall of side `pressed` is compressed.
    pub(super) fn step_s(&self, path: Path, pressed: Sign) -> f64 {
        let joined = self.joined(pressed);
        match path {
            Path::Coupled => joined.map_or(self.alone.step_s, |joined| joined.coupled.step_s),
            Path::CarriedCoupled => joined.map_or(self.alone.step_s, |joined| joined.carried.step_s),
            Path::Together => self.together.as_ref().map_or(self.alone.step_s, |together| together.step_s),
            Path::Alone | Path::Carried => self.alone.step_s,
        }
    }

    /// Sum of the magnitudes of the terms in each coefficient of x in [`Flows::span`], for rounding bounds; `None`
    /// where the second mass and the structure are joined.
    pub(super) fn sizes(&self, leg: &Leg, state: &ExactState, wave: &Wave) -> Option<Series> {
        let unit = [state.x_m, state.v_m_per_s, leg.structure_acceleration, wave.sine, wave.cosine].map(f64::abs);
        match leg.path {
            Path::Alone | Path::Together => self.oscillator(leg.path).map(|table| {
                core::array::from_fn(|n| (0..5).map(|which| table.columns[which][n].abs() * unit[which]).sum())
            }),
            Path::Carried => {
                let angle = self.turning * leg.step_s;
                let turned = wave_series(self.base_share * unit[3], self.base_share * unit[4], angle);
                Some(turned.map(f64::abs))
            }
            Path::Coupled | Path::CarriedCoupled => None,
        }
    }

    /// The series of the arc that starts from `state`.
    #[inline]
    pub(super) fn span(&self, leg: &Leg, state: &ExactState, wave: &Wave) -> Span {
        let h = leg.step_s;
        let mut base = wave_series(self.base_share * wave.sine, self.base_share * wave.cosine, self.turning * h);
        base[0] += wave.offset;
        let velocity = state.v_m_per_s * h;
        let unit = [state.x_m, state.v_m_per_s, leg.structure_acceleration, wave.sine, wave.cosine];
        let mut offset = [0.0; TERMS];
        offset[0] = state.offset_m;
        let mut x = base;
        match (leg.path, self.joined(leg.pressed), &self.together) {
            (Path::Coupled, Some(Joined { coupled, .. }), _) => {
                let unit = [
                    state.x_m,
                    velocity,
                    state.offset_m - leg.rest_offset,
                    state.slide_m_per_s * h,
                    leg.structure_acceleration,
                    leg.particle_acceleration,
                    wave.sine,
                    wave.cosine,
                ];
                (x, offset) = coupled.series(&unit);
                offset[0] = state.offset_m;
                return Span { x, offset, base, step_s: h };
            }
            (Path::CarriedCoupled, Some(Joined { carried, .. }), _) => {
                let from_rest = state.offset_m - leg.rest_offset;
                let sliding = state.slide_m_per_s;
                offset = carried.series(&[from_rest, sliding, leg.particle_acceleration, wave.sine, wave.cosine]);
                offset[0] = state.offset_m;
                x[0] = state.x_m;
                return Span { x, offset, base, step_s: h };
            }
            (Path::Together, _, Some(together)) => x = together.series(&unit),
            (Path::Carried, _, _) => x[0] = state.x_m,
            _ => x = self.alone.series(&unit),
        }
        if leg.sliding {
            offset[1] = state.slide_m_per_s * h;
            offset[2] = 0.5 * leg.particle_acceleration * h * h - x[2];
            for n in 3..TERMS {
                offset[n] = -x[n];
            }
        }
        Span { x, offset, base, step_s: h }
    }
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
