//! The conditions that define a special point, as rows below the boundary value problem.
//!
//! - A **grazing** has its conditions on the flow.
//! - A **fold** or a **period doubling** has σ = 0, where σ solves `[J b; cᵀ 0] [v; σ] = [0; 1]` with the derivatives J of the (twisted)
//!   problem: σ is zero where J is singular. Its gradient is `−wᵀ (∂J/∂z) v` with the solution w of the transposed system; nested dual
//!   numbers give it exactly.
//! - At a **Neimark-Sacker point** the problem whose last images are multiplied by exp(iα) is singular: σ is complex, and α is an unknown.
//! - Where the **symmetry breaks**, J is singular in the direction c without the symmetry, and so is the fold's system. It is regular
//!   with the row `cᵀ (z − z₀) = 0`, which keeps the symmetry, and the unknown μ of the residual `F + μ b`, which stays 0 (Werner and
//!   Spence, *The computation of symmetry-breaking bifurcation points*, SIAM J. Numer. Anal. 21, 1984).

use nalgebra::{Complex, ComplexField, DMatrix, DVector};

use crate::boundary_problem::{BoundaryProblem, Condition};
use crate::dual::Dual;
use crate::special::{Special, SpecialKind};

type RealVector = DVector<f64>;
type Wave = DVector<Complex<f64>>;

/// The vectors b and c at the edge of a singular problem.
pub struct Borders<T> {
    /// Column.
    b: DVector<T>,
    /// Row.
    c: DVector<T>,
}

/// The conditions of a special point.
pub enum Defining {
    /// Conditions on the flow, with an unknown time or without.
    Conditions(Vec<Condition>, bool),
    /// The problem with this twist is singular.
    Singular(f64, Borders<f64>),
    /// The problem is singular in a direction without its symmetry; the last orbit.
    Symmetry(Borders<f64>, RealVector),
    /// The problem with the twist exp(iα) is singular.
    Circle(Borders<Complex<f64>>),
}

/// A condition with its derivatives.
pub struct Row {
    /// Its value.
    pub value: f64,
    /// Derivatives by the unknowns of the boundary value problem.
    pub by_unknowns: RealVector,
    /// Derivatives by both parameters.
    pub by_parameters: [f64; 2],
    /// Derivative by the unknown of its own.
    pub by_extra: f64,
}

impl Defining {
    /// Of a special point; `None` for a kind that is not followed.
    pub fn of(problem: &BoundaryProblem, special: &Special, values: &[f64]) -> Option<Self> {
        let real = |twist: f64| singular_vectors(derivatives(problem, &special.unknowns, values, twist));
        Some(match &special.kind {
            SpecialKind::Grazing(conditions) => {
                Self::Conditions(conditions.clone(), conditions.iter().any(Condition::has_time))
            }
            SpecialKind::Fold => Self::Singular(1.0, real(1.0)?),
            SpecialKind::PeriodDoubling => Self::Singular(-1.0, real(-1.0)?),
            SpecialKind::SymmetryBreaking => Self::Symmetry(real(1.0)?, DVector::from_column_slice(&special.unknowns)),
            SpecialKind::NeimarkSacker => {
                let twist = Complex::from_polar(1.0, circle_angle(special));
                Self::Circle(singular_vectors(twisted(problem, &special.unknowns, values, twist))?)
            }
            SpecialKind::BranchPoint => return None,
        })
    }

    /// Unknowns of its own: 1 or none.
    pub fn extra_unknowns(&self) -> usize {
        match self {
            Self::Conditions(_, has_time) => usize::from(*has_time),
            Self::Singular(..) => 0,
            Self::Symmetry(..) | Self::Circle(_) => 1,
        }
    }

    /// The first value of that unknown: a time, the angle α, or μ.
    pub fn first_extra(&self, special: &Special) -> f64 {
        match self {
            Self::Conditions(..) => special.touch_time,
            Self::Circle(_) => circle_angle(special),
            Self::Singular(..) | Self::Symmetry(..) => 0.0,
        }
    }

    /// What its unknown multiplies in the residual of the boundary value problem.
    pub fn unfolding(&self) -> Option<&RealVector> {
        if let Self::Symmetry(borders, _) = self { Some(&borders.b) } else { None }
    }

    /// The conditions: one more than [`Defining::extra_unknowns`].
    pub fn rows(&self, problem: &BoundaryProblem, unknowns: &[f64], values: &[f64; 2], extra: f64) -> Option<Vec<Row>> {
        Some(match self {
            Self::Conditions(conditions, _) => {
                let row = |condition: &Condition| {
                    let (value, by_unknowns, by_parameter, by_extra) =
                        problem.condition(*condition, unknowns, values, extra);
                    Row { value, by_unknowns, by_parameters: [by_parameter[0], by_parameter[1]], by_extra }
                };
                conditions.iter().map(row).collect()
            }
            Self::Singular(twist, borders) => vec![singular_row(problem, unknowns, values, *twist, borders)?],
            Self::Symmetry(borders, last) => {
                let moved: f64 = (0..last.len()).map(|k| borders.c[k] * (unknowns[k] - last[k])).sum();
                let kept = Row { value: moved, by_unknowns: borders.c.clone(), by_parameters: [0.0; 2], by_extra: 0.0 };
                vec![singular_row(problem, unknowns, values, 1.0, borders)?, kept]
            }
            Self::Circle(borders) => circle_rows(problem, unknowns, values, extra, borders)?.into(),
        })
    }

    /// Lets the borders follow the null vectors to a point on the curve.
    pub fn follow(&mut self, problem: &BoundaryProblem, unknowns: &[f64], values: &[f64], extra: f64) -> Option<()> {
        let real = |twist: f64, borders: &Borders<f64>| {
            let (_, v, w) = solve(&derivatives(problem, unknowns, values, twist), borders)?;
            Some(Borders { b: w.normalize(), c: v.normalize() })
        };
        match self {
            Self::Conditions(..) => {}
            Self::Singular(twist, borders) => *borders = real(*twist, borders)?,
            Self::Symmetry(borders, last) => {
                *borders = real(1.0, borders)?;
                last.copy_from_slice(unknowns);
            }
            Self::Circle(borders) => {
                let matrix = twisted(problem, unknowns, values, Complex::from_polar(1.0, extra));
                let (_, v, w) = solve(&matrix, borders)?;
                // b meets wᵀ, c meets v.
                *borders = Borders { b: w.conjugate().normalize(), c: v.normalize() };
            }
        }
        Some(())
    }
}

/// The angle of the multipliers on the unit circle, rad, 0 to π.
fn circle_angle(special: &Special) -> f64 {
    let off = |m: &&Complex<f64>| (m.norm() - 1.0).abs();
    let complex = special.orbit.multipliers.iter().filter(|m| m.im > 0.0);
    complex.min_by(|a, b| off(a).total_cmp(&off(b))).map_or(0.0, |m| m.arg())
}

fn derivatives(problem: &BoundaryProblem, unknowns: &[f64], values: &[f64], twist: f64) -> DMatrix<f64> {
    let linear = problem.linearise::<f64>(unknowns, values, twist);
    DMatrix::from_fn(problem.len(), problem.len(), |row, k| linear.by_unknowns[row][k])
}

/// The derivatives with a complex twist, in which they are linear.
fn twisted(problem: &BoundaryProblem, unknowns: &[f64], values: &[f64], twist: Complex<f64>) -> DMatrix<Complex<f64>> {
    let [plus, minus] = [1.0, -1.0].map(|twist| derivatives(problem, unknowns, values, twist));
    plus.zip_map(&minus, |plus, minus| shares(twist)[0] * plus + shares(twist)[1] * minus)
}

/// A twist as shares of the twists 1 and −1.
fn shares(twist: Complex<f64>) -> [Complex<f64>; 2] {
    [(twist + 1.0) * 0.5, (-twist + 1.0) * 0.5]
}

/// The singular vectors of the smallest singular value.
fn singular_vectors<T: ComplexField<RealField = f64>>(matrix: DMatrix<T>) -> Option<Borders<T>> {
    let last = matrix.nrows() - 1;
    let svd = matrix.svd(true, true);
    Some(Borders { b: svd.u?.column(last).into_owned(), c: svd.v_t?.row(last).adjoint() })
}

/// σ with its vectors v and w, the latter of the transposed problem.
fn solve<T: ComplexField>(matrix: &DMatrix<T>, borders: &Borders<T>) -> Option<(T, DVector<T>, DVector<T>)> {
    let size = matrix.nrows();
    let bordered = DMatrix::from_fn(size + 1, size + 1, |row, k| match (row < size, k < size) {
        (true, true) => matrix[(row, k)].clone(),
        (true, false) => borders.b[row].clone(),
        (false, true) => borders.c[k].clone().conjugate(),
        (false, false) => T::zero(),
    });
    let mut unit = DVector::from_element(size + 1, T::zero());
    unit[size] = T::one();
    let solved = bordered.clone().lu().solve(&unit)?;
    let transposed = bordered.transpose().lu().solve(&unit)?;
    Some((solved[size].clone(), solved.rows(0, size).into_owned(), transposed.rows(0, size).into_owned()))
}

/// The derivatives of J v along z and along each parameter, for real v: the derivatives of the problem along v.
fn second(
    problem: &BoundaryProblem,
    unknowns: &[f64],
    values: &[f64; 2],
    twist: f64,
    v: impl Iterator<Item = f64>,
) -> (DMatrix<f64>, [RealVector; 2]) {
    let along: Vec<Dual<f64>> = unknowns.iter().zip(v).map(|(value, slope)| Dual { value: *value, slope }).collect();
    let linear = problem.linearise(&along, &values.map(Dual::constant), twist);
    let size = problem.len();
    let by_unknowns = DMatrix::from_fn(size, size, |row, k| linear.by_unknowns[row][k].slope);
    let by_parameter = |p: usize| DVector::from_fn(size, |row, _| linear.by_parameters[p][row].slope);
    (by_unknowns, [by_parameter(0), by_parameter(1)])
}

/// σ of the problem with a real twist.
fn singular_row(
    problem: &BoundaryProblem,
    unknowns: &[f64],
    values: &[f64; 2],
    twist: f64,
    borders: &Borders<f64>,
) -> Option<Row> {
    let (value, v, w) = solve(&derivatives(problem, unknowns, values, twist), borders)?;
    let (matrix, by_parameters) = second(problem, unknowns, values, twist, v.iter().copied());
    let by_parameters = by_parameters.map(|column| -w.dot(&column));
    Some(Row { value, by_unknowns: -(matrix.transpose() * w), by_parameters, by_extra: 0.0 })
}

/// Real and imaginary part of σ of the problem with the twist exp(iα).
fn circle_rows(
    problem: &BoundaryProblem,
    unknowns: &[f64],
    values: &[f64; 2],
    angle: f64,
    borders: &Borders<Complex<f64>>,
) -> Option<[Row; 2]> {
    let twist = Complex::from_polar(1.0, angle);
    let (sigma, v, w) = solve(&twisted(problem, unknowns, values, twist), borders)?;
    let size = problem.len();
    let mut by_unknowns: Wave = DVector::zeros(size);
    let mut by_parameters = [Complex::new(0.0, 0.0); 2];
    for (share, sign) in shares(twist).into_iter().zip([1.0, -1.0]) {
        let parts: [(Complex<f64>, Vec<f64>); 2] = [
            (share, v.iter().map(|entry| entry.re).collect()),
            (share * Complex::i(), v.iter().map(|entry| entry.im).collect()),
        ];
        for (factor, part) in parts {
            let (matrix, columns) = second(problem, unknowns, values, sign, part.into_iter());
            for k in 0..size {
                let product: Complex<f64> = (0..size).map(|row| w[row] * matrix[(row, k)]).sum();
                by_unknowns[k] -= factor * product;
            }
            for (sum, column) in by_parameters.iter_mut().zip(&columns) {
                *sum -= factor * (0..size).map(|row| w[row] * column[row]).sum::<Complex<f64>>();
            }
        }
    }
    // The twist turns with the angle: d exp(iα)/dα = i exp(iα).
    let [plus, minus] = [1.0, -1.0].map(|twist| derivatives(problem, unknowns, values, twist));
    let image = (plus - minus).map(|entry| Complex::from(0.5 * entry)) * v;
    let by_extra = -(Complex::<f64>::i() * twist) * (0..size).map(|row| w[row] * image[row]).sum::<Complex<f64>>();
    let row = |part: fn(Complex<f64>) -> f64| Row {
        value: part(sigma),
        by_unknowns: by_unknowns.map(part),
        by_parameters: by_parameters.map(part),
        by_extra: part(by_extra),
    };
    Some([row(|value| value.re), row(|value| value.im)])
}
