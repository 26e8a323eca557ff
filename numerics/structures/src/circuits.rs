//! The charges of piezoelectric walls: bodies without mass, whose coordinates follow those of the masses with a delay.
//!
//! R Q′ + K_qq Q + K_qx x = f. With `τ = K_qq^½ Q + K_qq^-½ K_qx x` and the coordinates η of the masses at charges that have settled,
//! `η″ + C η′ + ω² η + Hᵀ τ = load` and `τ′ + Γ τ − H η′ = load`: what H moves from one to the other keeps its energy, and R takes
//! `Γ τ²`. A mass in place of the zero would cost rates that are faster than all others, and an error.

use nalgebra::DMatrix;

use crate::bodies::Bodies;
use crate::linear::C64;

/// The charges of a system.
#[derive(Clone, Debug)]
pub(crate) struct Charges {
    /// Numbers of the bodies with a mass, and of those without.
    pub masses: Vec<usize>,
    pub charges: Vec<usize>,
    /// K_qq^½ of each charge; they are not coupled with each other.
    pub roots: Vec<f64>,
    /// `K_qq^-½ K_qx`, by charge and mass.
    pub to_masses: DMatrix<f64>,
    /// Γ, 1/s.
    decay: Vec<f64>,
}

/// How the coordinates τ follow the others.
#[derive(Clone, Debug, Default)]
pub(crate) struct Circuits {
    /// H; without columns, nothing feeds them.
    pub feed: DMatrix<f64>,
    /// Γ, 1/s.
    pub decay: Vec<f64>,
}

impl Charges {
    /// Of bodies with this K; `None` if all have a mass.
    pub fn of(bodies: &Bodies, stiffness: &DMatrix<f64>) -> Option<Self> {
        let (charges, masses): (Vec<usize>, Vec<usize>) = (0..bodies.len()).partition(|&i| bodies.mass[i] == 0.0);
        if charges.is_empty() {
            return None;
        }
        let roots: Vec<f64> = charges.iter().map(|&i| stiffness[(i, i)].sqrt()).collect();
        let to_masses =
            DMatrix::from_fn(charges.len(), masses.len(), |j, i| stiffness[(charges[j], masses[i])] / roots[j]);
        let decay = charges.iter().map(|&i| stiffness[(i, i)] / bodies.damping[i]).collect();
        Some(Self { masses, charges, roots, to_masses, decay })
    }

    /// Of the coordinates `x = shapes · η` of the masses.
    pub fn circuits(&self, shapes: &DMatrix<f64>) -> Circuits {
        Circuits { feed: &self.to_masses * shapes, decay: self.decay.clone() }
    }

    /// Shapes over all bodies: of the coordinates of the masses at charges that have settled, and of τ.
    pub fn shapes(&self, of_masses: &DMatrix<f64>) -> DMatrix<f64> {
        let mut shapes = self.on_masses(of_masses);
        let settled = &self.to_masses * of_masses;
        for (j, (&charge, root)) in self.charges.iter().zip(&self.roots).enumerate() {
            for (i, of) in settled.row(j).iter().enumerate() {
                shapes[(charge, i)] = -of / root;
            }
            shapes[(charge, of_masses.ncols() + j)] = 1.0 / root;
        }
        shapes
    }

    /// What forces on the bodies are on the coordinates.
    pub fn loads(&self, of_masses: &DMatrix<f64>) -> DMatrix<f64> {
        let mut loads = self.on_masses(of_masses);
        for (j, (&charge, root)) in self.charges.iter().zip(&self.roots).enumerate() {
            loads[(charge, of_masses.ncols() + j)] = self.decay[j] / root;
        }
        loads
    }

    /// The coordinates of displacements; `of_masses`: those of the masses.
    pub fn project(&self, of_masses: &DMatrix<f64>) -> DMatrix<f64> {
        let mut project = self.on_masses(&of_masses.transpose()).transpose();
        for (j, (&charge, root)) in self.charges.iter().zip(&self.roots).enumerate() {
            let row = of_masses.nrows() + j;
            for (&body, of) in self.masses.iter().zip(self.to_masses.row(j).iter()) {
                project[(row, body)] = *of;
            }
            project[(row, charge)] = *root;
        }
        project
    }

    /// Columns over the masses as columns over all bodies, before empty ones of τ.
    fn on_masses(&self, of_masses: &DMatrix<f64>) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(self.masses.len() + self.charges.len(), of_masses.ncols() + self.charges.len());
        for (row, &body) in of_masses.row_iter().zip(&self.masses) {
            all.row_mut(body).columns_mut(0, of_masses.ncols()).copy_from(&row);
        }
        all
    }
}

impl Circuits {
    /// Number of coordinates τ.
    pub fn len(&self) -> usize {
        self.decay.len()
    }

    /// Whether a coordinate of the masses feeds none.
    pub fn are_not_fed_by(&self, coordinate: usize) -> bool {
        self.len() == 0 || self.feed.column(coordinate).iter().all(|feed| *feed == 0.0)
    }

    /// Whether nothing feeds them.
    pub fn are_alone(&self) -> bool {
        self.feed.iter().all(|feed| *feed == 0.0)
    }

    /// A derivative of τ while all follow cubics: `load` becomes it, from the next derivatives of η and τ.
    pub fn settle(&self, load: &mut [f64], next: &[f64]) {
        let (eta, tau) = next.split_at(next.len() - self.len());
        for (j, (load, tau)) in load.iter_mut().zip(tau).enumerate() {
            let fed: f64 = self.feed.row(j).iter().zip(eta).map(|(feed, eta)| feed * eta).sum();
            *load = (*load + fed - tau) / self.decay[j];
        }
    }

    /// Takes Hᵀ τ from loads of the masses.
    pub fn push_back(&self, load: &mut [f64], tau: &[f64]) {
        for (row, tau) in self.feed.row_iter().zip(tau) {
            load.iter_mut().zip(row.iter()).for_each(|(load, feed)| *load -= feed * tau);
        }
    }

    /// τ of a forced motion with the rate iΩ, per load of its own and per Hη.
    pub fn per_load_and_feed(&self, circuit: usize, rate: C64) -> (C64, C64) {
        let slow = C64::ONE / (rate + self.decay[circuit]);
        (slow, rate * slow)
    }
}
