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
    /// Roots of the masses of the bodies.
    roots: Vec<f64>,
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
        case.refuse_walls()?;
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
            roots: mass.iter().map(|mass| mass.sqrt()).collect(),
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

    /// w and its changes after a time, by the exponential of `[A δA; 0 A] t` for each of the quantities, which come first among the changes.
    /// `size_m_per_s`: size of the velocities.
    pub(super) fn whole(
        &self,
        w: &DVector<f64>,
        s: &DMatrix<f64>,
        quantities: usize,
        after_s: f64,
        size_m_per_s: f64,
    ) -> (DVector<f64>, DMatrix<f64>) {
        let (a, count) = (&self.equations.a, w.len());
        let unit = self.units(size_m_per_s);
        let scaled =
            |of: &DMatrix<f64>| DMatrix::from_fn(count, count, |i, j| after_s * of[(i, j)] * unit[i] / unit[j]);
        let unscaled = |of: DMatrix<f64>| DMatrix::from_fn(count, count, |i, j| of[(i, j)] * unit[j] / unit[i]);
        let (of_a, mut exponential) = (scaled(a), None);
        let mut changes = DMatrix::zeros(count, quantities);
        let rates = self.changes_of_rates.iter().enumerate();
        for (quantity, _) in rates.filter(|(_, entries)| !entries.is_empty()) {
            let change = &self.changes[quantity];
            let mut both = DMatrix::zeros(2 * count, 2 * count);
            both.view_mut((0, 0), (count, count)).copy_from(&of_a);
            both.view_mut((count, count), (count, count)).copy_from(&of_a);
            both.view_mut((0, count), (count, count)).copy_from(&scaled(&change.a));
            let both = both.exp();
            exponential = Some(unscaled(both.view((0, 0), (count, count)).clone_owned()));
            let of_change = unscaled(both.view((0, count), (count, count)).clone_owned());
            changes.set_column(quantity, &(of_change * w));
        }
        let exponential = exponential.unwrap_or_else(|| unscaled(of_a.exp()));
        let mut moved = &exponential * s;
        let mut own = moved.columns_mut(0, quantities);
        own += changes;
        (exponential * w, moved)
    }

    /// Units of w in which all entries of A are rates.
    fn units(&self, size_m_per_s: f64) -> Vec<f64> {
        let fastest = self.fastest_rad_per_s;
        let bodies = (self.equations.a.nrows() - MORE) / 2;
        let of = |i: usize| match i {
            _ if i < bodies => fastest * self.roots[i],
            _ if i < 2 * bodies => self.roots[i - bodies],
            _ if i < self.equations.a.nrows() - 1 => fastest,
            _ => size_m_per_s,
        };
        (0..self.equations.a.nrows()).map(of).collect()
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
