//! A motion's equations at a value of a quantity, and their changes with the quantities.

use damprig_core::integrator::exact::time::Time;
use nalgebra::{DMatrix, DVector};

use super::equations::{BASE, COSINE, Equations, MORE, SINE};
use super::record::End;
use super::series::Series;
use super::stencil::relative;
use super::{Drive, MotionCase, NoDerivatives};
use crate::mount::Mount;

/// A value with its changes along every column: per relative change of the quantities, then by the start.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sloped {
    pub value: f64,
    pub slopes: DVector<f64>,
}

impl Sloped {
    pub(super) fn absolute(self) -> Self {
        if self.value < 0.0 { Self { value: -self.value, slopes: -self.slopes } } else { self }
    }
}

/// The equations of a state of the contacts and their changes per relative change of each quantity.
pub(super) struct Known {
    pub equations: Equations,
    pub changes: Vec<Equations>,
    /// The entries of A and of its changes that are not zero.
    pub rates: Entries,
    pub changes_of_rates: Vec<Entries>,
    /// A bound of the fastest rate, rad/s.
    pub fastest_rad_per_s: f64,
}

/// Row, column and value of entries of a matrix.
pub(super) type Entries = Vec<(usize, usize, f64)>;

/// The entries of a matrix that are not zero.
fn entries(a: &DMatrix<f64>) -> Entries {
    let all = (0..a.nrows()).flat_map(|i| (0..a.ncols()).map(move |j| (i, j)));
    all.map(|(i, j)| (i, j, a[(i, j)])).filter(|(.., of)| *of != 0.0).collect()
}

/// A set-up with the excitation, as the equations need it, at a value of a quantity.
pub(super) struct Setting<'a> {
    pub case: &'a MotionCase,
    pub mount: Mount,
    pub turning: f64,
}

impl<'a> Setting<'a> {
    pub(super) fn of(case: &'a MotionCase) -> Result<Self, NoDerivatives> {
        let excitation = case.excitation();
        let mount = Mount::new(case.set_up(), &excitation)?;
        Ok(Self { case, mount, turning: excitation.angular_frequency_rad_per_s() })
    }

    /// w from the bodies on, but for them, in a sample interval or, without samples, at a time of the excitation.
    pub(super) fn driven(&self, which: usize, at_s: f64) -> DVector<f64> {
        let wave = self.case.excitation().wave(Time::at(at_s));
        let [c0, c1, c2, c3] = self.case.powers(which);
        let offset = self.mount.share * wave.offset;
        DVector::from_vec(vec![wave.sine, wave.cosine, offset + c0, c1, 2.0 * c2, 6.0 * c3, 1.0])
    }

    /// w at the start.
    pub(super) fn start(&self) -> DVector<f64> {
        let driven = self.driven(0, 0.0);
        let share = self.mount.share;
        let base = (driven[BASE] + share * driven[SINE], driven[BASE + 1] + share * self.turning * driven[COSINE]);
        let (mut w, v) = self.mount.bodies_in(&self.case.start, base);
        w.extend(v);
        w.extend(driven.iter());
        DVector::from_vec(w)
    }

    /// When a timed end of an interval is, s.
    pub(super) fn time_s(&self, end: End) -> f64 {
        match (end, &self.case.drive) {
            (End::Break, _) => self.case.excitation().next_break_s(0.0),
            (End::Sample(which), Drive::Samples { step_s, .. }) => which as f64 * step_s,
            _ => self.case.duration_s,
        }
    }
}

impl Equations {
    /// The change of all coefficients per relative change of a quantity.
    pub(super) fn change(at: [Self; 6]) -> Self {
        let all = &at;
        let of = |field: fn(&Self) -> DMatrix<f64>| relative(all.each_ref().map(field));
        let of_vector = |field: fn(&Self) -> DVector<f64>| relative(all.each_ref().map(field));
        Self {
            a: of(|own| own.a.clone()),
            events: Vec::new(),
            guards: of(|own| own.guards.clone()),
            places: of(|own| own.places.clone()),
            slips: of(|own| own.slips.clone()),
            base_rate: of_vector(|own| own.base_rate.clone()),
            inertia: of_vector(|own| own.inertia.clone()),
        }
    }
}

impl Known {
    /// Of the bodies with these masses.
    pub(super) fn new(equations: Equations, changes: Vec<Equations>, mass: &[f64]) -> Self {
        Self {
            rates: entries(&equations.a),
            changes_of_rates: changes.iter().map(|change| entries(&change.a)).collect(),
            fastest_rad_per_s: fastest_rad_per_s(&equations.a, mass),
            equations,
            changes,
        }
    }

    /// A row with its changes.
    pub(super) fn row_of(&self, of: impl Fn(&Equations) -> DVector<f64>) -> (DVector<f64>, Vec<DVector<f64>>) {
        (of(&self.equations), self.changes.iter().map(of).collect())
    }

    /// The row of a place's displacement, with its changes.
    pub(super) fn place_rows(&self, place: usize) -> (DVector<f64>, Vec<DVector<f64>>) {
        self.row_of(|equations| equations.places.row(place).transpose())
    }

    /// Steps in which an interval is followed.
    pub(super) fn steps(&self, length_s: f64) -> f64 {
        (length_s * self.fastest_rad_per_s / Series::REACH).ceil().max(1.0)
    }

    /// The displacement of a place in a state.
    pub(super) fn place(&self, place: usize, w: &DVector<f64>, s: &DMatrix<f64>) -> Sloped {
        let (row, changes) = self.place_rows(place);
        sloped(&row, &changes, w, s)
    }

    /// A guard in a state.
    pub(super) fn guard(&self, which: usize, w: &DVector<f64>, s: &DMatrix<f64>) -> Sloped {
        let (row, changes) = self.row_of(|equations| equations.guards.row(which).transpose());
        sloped(&row, &changes, w, s)
    }
}

/// All six, or none.
pub(super) fn all_or_none<T>([a, b, c, d, e, f]: [Option<T>; 6]) -> Option<[T; 6]> {
    Some([a?, b?, c?, d?, e?, f?])
}

/// A row with its changes, in a state.
pub(super) fn sloped(row: &DVector<f64>, changes: &[DVector<f64>], w: &DVector<f64>, s: &DMatrix<f64>) -> Sloped {
    let mut slopes = s.tr_mul(row);
    slopes.iter_mut().zip(changes).for_each(|(slope, change)| *slope += change.dot(w));
    Sloped { value: row.dot(w), slopes }
}

/// A bound of the fastest rate of `w′ = A w` with these masses of the bodies, rad/s.
fn fastest_rad_per_s(a: &DMatrix<f64>, mass: &[f64]) -> f64 {
    let bodies = mass.len();
    let more = a.nrows() - MORE;
    // In displacements times the root of the mass.
    let sum = |i: usize, from: usize| -> f64 {
        (0..bodies).map(|j| a[(bodies + i, from + j)].abs() * (mass[i] / mass[j]).sqrt()).sum()
    };
    let most = |from: usize| (0..bodies).map(|i| sum(i, from)).fold(0.0, f64::max);
    let (square, damping) = (most(0), most(bodies));
    let turning = a[(more, more + 1)].abs();
    (square.sqrt() + damping).max(turning)
}
