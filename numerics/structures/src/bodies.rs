//! The bodies of a set-up with the springs and dashpots between them.

use nalgebra::{DMatrix, DVector};

/// A spring and a dashpot on the displacement `row · q`.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub row: Vec<f64>,
    pub stiffness: f64,
    pub damping: f64,
}

/// Modal coordinates, tuned masses, charges of piezoelectric walls and particles, relative to the base: masses, springs and dashpots. The displacement
/// of a charge is in C, its stiffness in V/C and its damping in Ω.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bodies {
    /// Mass of each, kg (1 of a modal coordinate, 0 of a charge).
    pub mass: Vec<f64>,
    /// Force per −z″, kg.
    pub inertia: Vec<f64>,
    /// Stiffness to the base, N/m.
    pub stiffness: Vec<f64>,
    /// Damping to the base, N·s/m.
    pub damping: Vec<f64>,
    /// Damping among the modal coordinates by rows; empty if there is none.
    pub coupling: Vec<f64>,
    /// Springs and dashpots between them.
    pub links: Vec<Link>,
}

impl Bodies {
    pub fn len(&self) -> usize {
        self.mass.len()
    }

    /// What accelerates a body by its force: its mass; infinite of a charge, which has no acceleration of its own.
    pub fn divisors(&self) -> impl Iterator<Item = f64> {
        self.mass.iter().map(|&mass| if mass == 0.0 { f64::INFINITY } else { mass })
    }

    /// Whether each is a modal coordinate and nothing couples them.
    pub fn are_modal(&self) -> bool {
        self.links.is_empty() && self.coupling.is_empty() && self.mass.iter().all(|&mass| mass == 1.0)
    }

    /// K q.
    pub fn springs(&self, q: &[f64]) -> Vec<f64> {
        let mut force: Vec<f64> = self.stiffness.iter().zip(q).map(|(k, q)| k * q).collect();
        for link in &self.links {
            add(&mut force, link.stiffness * dot(&link.row, q), &link.row);
        }
        force
    }

    /// C q′.
    pub fn dashpots(&self, v: &[f64]) -> Vec<f64> {
        let mut force: Vec<f64> = self.damping.iter().zip(v).map(|(c, v)| c * v).collect();
        for link in self.links.iter().filter(|link| link.damping > 0.0) {
            add(&mut force, link.damping * dot(&link.row, v), &link.row);
        }
        let modes = self.coupling.len().isqrt();
        for (force, row) in force.iter_mut().zip(self.coupling.chunks(modes.max(1))) {
            *force += dot(row, v);
        }
        force
    }

    /// K or C as a matrix.
    pub fn matrix(&self, of: impl Fn(&Self, &[f64]) -> Vec<f64>) -> DMatrix<f64> {
        let n = self.len();
        let mut matrix = DMatrix::zeros(n, n);
        let mut unit = vec![0.0; n];
        for column in 0..n {
            unit[column] = 1.0;
            matrix.set_column(column, &DVector::from_vec(of(self, &unit)));
            unit[column] = 0.0;
        }
        matrix
    }
}

/// The scalar product.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Adds `factor · row` to `sum`.
pub(crate) fn add(sum: &mut [f64], factor: f64, row: &[f64]) {
    sum.iter_mut().zip(row).for_each(|(sum, row)| *sum += factor * row);
}
