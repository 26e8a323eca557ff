//! The freedom that sticking joints leave: coordinates η in which masses and springs are uncoupled.

use nalgebra::{DMatrix, DVector};

use crate::Refused;
use crate::bodies::{Bodies, dot};
use crate::circuits::{Charges, Circuits};
use crate::linear::C64;
use crate::polynomial::Polynomial;

/// A joint that sticks: `row · q + influence · z` is constant.
#[derive(Clone, Debug)]
pub(crate) struct Constraint {
    pub row: Vec<f64>,
    pub influence: f64,
}

/// `q = Ψ η + D (κ − Δι z)`: Ψ is orthonormal in M and diagonalises K, D moves the sticking joints, whose κ is constant. Coordinates of charges come last
/// ([`Charges`]).
#[derive(Clone, Debug)]
pub(crate) struct Basis {
    /// Ψ.
    pub shapes: DMatrix<f64>,
    /// What forces on the bodies are on the coordinates, by columns: Ψ where there are no charges.
    pub loads: DMatrix<f64>,
    /// The coordinates of displacements, by rows: Ψᵀ M where there are no charges.
    pub project: DMatrix<f64>,
    /// D = B (BᵀB)⁻¹.
    pub held: DMatrix<f64>,
    constraints: Vec<Constraint>,
    /// −D Δι: q per displacement of the base that the constraints prescribe.
    pub moved: Vec<f64>,
    /// How the coordinates of charges follow the others.
    pub circuits: Circuits,
}

impl Basis {
    /// The basis, with ω² of the coordinates of its masses.
    pub fn new(bodies: &Bodies, stuck: &[Constraint]) -> Result<(Self, Vec<f64>), Refused> {
        let n = bodies.len();
        let stiffness = bodies.matrix(Bodies::springs);
        let rows = DMatrix::from_fn(n, stuck.len(), |i, j| stuck[j].row[i]);
        let mass = DMatrix::from_diagonal(&DVector::from_column_slice(&bodies.mass));
        let charges = Charges::of(bodies, &stiffness);
        let (shapes, loads, project, circuits, square) = match charges {
            None => {
                let (shapes, square) = shapes(&mass, &stiffness, &rows)?;
                (shapes.clone(), shapes.clone(), shapes.transpose() * mass, Circuits::default(), square)
            }
            Some(charges) => {
                let of = |all: &DMatrix<f64>| all.select_rows(&charges.masses).select_columns(&charges.masses);
                let settled = of(&stiffness) - charges.to_masses.transpose() * &charges.to_masses;
                let mass = of(&mass);
                let (shapes, square) = shapes(&mass, &settled, &rows.select_rows(&charges.masses))?;
                let project = charges.project(&(shapes.transpose() * mass));
                (charges.shapes(&shapes), charges.loads(&shapes), project, charges.circuits(&shapes), square)
            }
        };
        let held = if stuck.is_empty() {
            DMatrix::zeros(n, 0)
        } else {
            let gram = (rows.transpose() * &rows).try_inverse().ok_or(Refused::Redundant)?;
            &rows * gram
        };
        let influence = DVector::from_iterator(stuck.len(), stuck.iter().map(|joint| joint.influence));
        let moved = (&held * influence).iter().map(|q| -q).collect();
        Ok((Self { shapes, loads, project, held, constraints: stuck.to_vec(), moved, circuits }, square))
    }

    /// C on the coordinates of the masses.
    pub fn damping(&self, bodies: &Bodies) -> DMatrix<f64> {
        let shapes = self.loads.columns(0, self.loads.ncols() - self.circuits.len()).clone_owned();
        symmetric(&(shapes.transpose() * bodies.matrix(Bodies::dashpots) * &shapes))
    }

    /// κ of a state, less Δι times the cubic `base` of z; `sine` is the rest of z.
    pub fn kappa(&self, q: &[f64], sine: f64, base: Polynomial) -> impl Iterator<Item = Polynomial> {
        let rise = base + Polynomial::constant(-base.value);
        let now = move |joint: &Constraint| dot(&joint.row, q) + joint.influence * sine;
        self.constraints.iter().map(move |joint| Polynomial::constant(now(joint)) + -joint.influence * rise)
    }

    /// D κ, or a derivative.
    pub fn prescribed(&self, kappa: &[Polynomial], order: usize) -> DVector<f64> {
        &self.held * DVector::from_iterator(kappa.len(), kappa.iter().map(|kappa| kappa.derivative(order)))
    }

    /// Forces x on the bodies as those on the coordinates.
    pub fn on_coordinates(&self, x: &[C64]) -> Vec<C64> {
        self.loads.column_iter().map(|shape| shape.iter().zip(x).map(|(shape, x)| x * *shape).sum()).collect()
    }
}

/// Coordinates of bodies with this M and K that leave the displacements along the columns of `rows` as they are, with ω² of each.
fn shapes(
    mass: &DMatrix<f64>,
    stiffness: &DMatrix<f64>,
    rows: &DMatrix<f64>,
) -> Result<(DMatrix<f64>, Vec<f64>), Refused> {
    if rows.ncols() == rows.nrows() {
        return Ok((DMatrix::zeros(rows.nrows(), 0), Vec::new()));
    }
    let free = complement(rows).ok_or(Refused::Redundant)?;
    let root = (free.transpose() * mass * &free).cholesky().ok_or(Refused::Redundant)?.l();
    let orthonormal = root.solve_lower_triangular(&free.transpose()).ok_or(Refused::Redundant)?.transpose();
    let eigen = symmetric(&(orthonormal.transpose() * stiffness * &orthonormal)).symmetric_eigen();
    Ok((orthonormal * &eigen.eigenvectors, eigen.eigenvalues.iter().copied().collect()))
}

/// The symmetric part of a matrix that is symmetric but for rounding.
pub(crate) fn symmetric(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    (matrix + matrix.transpose()) * 0.5
}

/// An orthonormal basis of what is perpendicular to all columns; `None` if these depend on each other.
fn complement(columns: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = columns.nrows();
    let mut basis: Vec<DVector<f64>> = Vec::new();
    let mut orthogonal = |vector: DVector<f64>, least: f64| {
        let size = vector.norm();
        let mut rest = vector;
        // Twice, so that rounding leaves nothing.
        for _ in 0..2 {
            for known in &basis {
                let share = known.dot(&rest);
                rest -= known * share;
            }
        }
        let left = rest.norm();
        let keeps = left > least * size;
        if keeps {
            basis.push(rest / left);
        }
        keeps
    };
    for column in columns.column_iter() {
        if !orthogonal(column.into_owned(), 1e-10) {
            return None;
        }
    }
    let taken = columns.ncols();
    // Units in the order of how much of each is free, so that the basis is well conditioned.
    let mut units: Vec<usize> = (0..n).collect();
    let occupied = |i: usize| basis_share(columns, i);
    units.sort_by(|&a, &b| occupied(a).total_cmp(&occupied(b)));
    for i in units {
        orthogonal(DVector::from_fn(n, |row, _| if row == i { 1.0 } else { 0.0 }), 1e-8);
    }
    let free = &basis[taken..];
    (free.len() == n - taken).then(|| DMatrix::from_columns(free))
}

/// How much of the unit vector `i` the columns take.
fn basis_share(columns: &DMatrix<f64>, i: usize) -> f64 {
    columns.column_iter().map(|column| column[i] * column[i] / column.norm_squared()).sum()
}
