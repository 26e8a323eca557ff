//! Structures from matrices, from storeys and as beams.

use nalgebra::{DMatrix, DVector};

use crate::basis::symmetric;
use crate::{Mode, Modes, Refused};
use damprig_core::io::{not_negative, positive, require};

/// Damping of a structure that is described by matrices.
#[derive(Clone, Debug, PartialEq)]
pub enum Damping {
    /// The same ratio ζ of every mode, 0 or greater.
    Ratio(f64),
    /// C = a M + b K (Rayleigh).
    Rayleigh {
        /// a, 1/s; 0 or greater.
        mass_per_s: f64,
        /// b, s; 0 or greater.
        stiffness_s: f64,
    },
    /// C by rows, N·s/m; symmetric, no negative eigenvalue.
    Matrix(Vec<f64>),
}

/// A storey of a frame whose floors move sideways.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Storey {
    /// Mass of its floor (the one above its columns), kg; greater than 0.
    pub mass_kg: f64,
    /// Stiffness of its columns, N/m; greater than 0.
    pub stiffness_n_per_m: f64,
    /// Damping between its floor and the one below, N·s/m; 0 or greater.
    pub damping_n_s_per_m: f64,
}

/// How a beam is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// Clamped at position 0, free at its end.
    Cantilever,
    /// Simply supported at both ends.
    SimplySupported,
}

/// A slender uniform beam (Euler and Bernoulli) that bends in one plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Beam {
    /// How it is held, on the moving base.
    pub support: Support,
    /// E I, N·m²; greater than 0.
    pub bending_stiffness_n_m2: f64,
    /// ρ A, kg/m; greater than 0.
    pub mass_per_length_kg_per_m: f64,
    /// Length, m; greater than 0.
    pub length_m: f64,
    /// Mass at the free end of a cantilever, kg; 0 or greater.
    pub tip_mass_kg: f64,
    /// Number of modes, 1 to 200.
    pub modes: usize,
    /// ζ of each mode; 0 or greater.
    pub damping_ratio: f64,
    /// Positions of the places, m from the first support; 0 to the length.
    pub places_m: Vec<f64>,
}

/// Largest number of modes: computing an event costs its square, coupled damping at the start its cube.
pub const MAX_MODES: usize = 200;

impl Modes {
    /// The natural modes of `M x″ + C x′ + K x`, x relative to the base: every row is a place. `mass` and `stiffness` are square, by rows, in
    /// kg and N/m; `influence` is the displacement of each place per displacement of the base (1 for floors of a frame).
    ///
    /// # Errors
    /// A matrix of a wrong size, not symmetric or not positive definite.
    pub fn from_matrices(
        mass: &[f64],
        stiffness: &[f64],
        damping: &Damping,
        influence: &[f64],
    ) -> Result<Self, Refused> {
        let n = influence.len();
        let mass = matrix("the mass matrix", mass, n)?;
        let stiffness = matrix("the stiffness matrix", stiffness, n)?;
        let root = mass.clone().cholesky().ok_or(Refused::NotDefinite("the mass matrix"))?.l();
        // L⁻¹ K L⁻ᵀ has the squares of the natural frequencies.
        let left = root.solve_lower_triangular(&stiffness).ok_or(Refused::NotDefinite("the mass matrix"))?;
        let both = root.solve_lower_triangular(&left.transpose()).ok_or(Refused::NotDefinite("the mass matrix"))?;
        let eigen = symmetric(&both).symmetric_eigen();
        let shapes = root
            .transpose()
            .solve_upper_triangular(&eigen.eigenvectors)
            .ok_or(Refused::NotDefinite("the mass matrix"))?;
        let largest = eigen.eigenvalues.max();
        if eigen.eigenvalues.min() <= n as f64 * f64::EPSILON * largest {
            return Err(Refused::Unsupported);
        }
        let omega: Vec<f64> = eigen.eigenvalues.iter().map(|square| square.sqrt()).collect();
        let coupled = match damping {
            Damping::Ratio(ratio) => {
                not_negative("structure.damping_ratio", *ratio)?;
                DMatrix::from_diagonal(&DVector::from_iterator(n, omega.iter().map(|omega| 2.0 * ratio * omega)))
            }
            Damping::Rayleigh { mass_per_s, stiffness_s } => {
                not_negative("structure.mass_damping_per_s", *mass_per_s)?;
                not_negative("structure.stiffness_damping_s", *stiffness_s)?;
                let of = |omega: &f64| mass_per_s + stiffness_s * omega * omega;
                DMatrix::from_diagonal(&DVector::from_iterator(n, omega.iter().map(of)))
            }
            Damping::Matrix(rows) => {
                let damping = matrix("the damping matrix", rows, n)?;
                let modal = shapes.transpose() * damping * &shapes;
                let modal = symmetric(&modal);
                not_growing(&modal)?;
                modal
            }
        };
        let participation = shapes.transpose() * mass * DVector::from_column_slice(influence);
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| omega[a].total_cmp(&omega[b]));
        let modes = order
            .iter()
            .map(|&i| Mode {
                angular_frequency_rad_per_s: omega[i],
                damping_ratio: (coupled[(i, i)] / (2.0 * omega[i])).max(0.0),
                shape: shapes.column(i).iter().copied().collect(),
                participation: participation[i],
            })
            .collect();
        let rest = |i: usize, j: usize| if i == j { 0.0 } else { coupled[(order[i], order[j])] };
        let largest = coupled.amax();
        let is_modal = (0..n).all(|i| (0..n).all(|j| rest(i, j).abs() <= 1e-13 * largest));
        let coupling_per_s = if is_modal { Vec::new() } else { (0..n * n).map(|at| rest(at / n, at % n)).collect() };
        Ok(Self { modes, influence: influence.to_vec(), coupling_per_s })
    }

    /// A frame of storeys with their own damping, from the ground up; the places are its floors.
    ///
    /// # Errors
    /// No storey, or a value out of range.
    pub fn storeys(storeys: &[Storey]) -> Result<Self, Refused> {
        Self::frame(storeys, &Damping::Matrix(chain(storeys, |storey| storey.damping_n_s_per_m)))
    }

    /// A frame of storeys with another damping than theirs.
    ///
    /// # Errors
    /// As [`Modes::storeys`].
    pub fn frame(storeys: &[Storey], damping: &Damping) -> Result<Self, Refused> {
        let n = storeys.len();
        if n == 0 {
            return Err(Refused::Count { what: "structure.storeys", found: 0, expected: 1 });
        }
        for storey in storeys {
            positive("structure.storeys.mass_kg", storey.mass_kg)?;
            positive("structure.storeys.stiffness_n_per_m", storey.stiffness_n_per_m)?;
            not_negative("structure.storeys.damping_n_s_per_m", storey.damping_n_s_per_m)?;
        }
        let mass: Vec<f64> =
            (0..n * n).map(|at| if at / n == at % n { storeys[at / n].mass_kg } else { 0.0 }).collect();
        let stiffness = chain(storeys, |storey| storey.stiffness_n_per_m);
        Self::from_matrices(&mass, &stiffness, damping, &vec![1.0; n])
    }

    /// The bending modes of a beam.
    ///
    /// # Errors
    /// A value out of range.
    pub fn beam(beam: &Beam) -> Result<Self, Refused> {
        positive("structure.beam.bending_stiffness_n_m2", beam.bending_stiffness_n_m2)?;
        positive("structure.beam.mass_per_length_kg_per_m", beam.mass_per_length_kg_per_m)?;
        positive("structure.beam.length_m", beam.length_m)?;
        not_negative("structure.beam.tip_mass_kg", beam.tip_mass_kg)?;
        not_negative("structure.beam.damping_ratio", beam.damping_ratio)?;
        let count = beam.modes as f64;
        require((1..=MAX_MODES).contains(&beam.modes), "structure.beam.modes", count, "from 1 to 200")?;
        let is_free = beam.support == Support::Cantilever;
        let tip = "0 for a beam that is supported at both ends";
        require(is_free || beam.tip_mass_kg == 0.0, "structure.beam.tip_mass_kg", beam.tip_mass_kg, tip)?;
        for &place in &beam.places_m {
            let on_beam = (0.0..=beam.length_m).contains(&place);
            require(on_beam, "structure.beam.places_m", place, "from 0 to the length of the beam")?;
        }
        let mass = beam.mass_per_length_kg_per_m * beam.length_m;
        let tip_ratio = beam.tip_mass_kg / mass;
        let modes = (1..=beam.modes)
            .map(|n| {
                let wave = if is_free { cantilever_root(n, tip_ratio) } else { n as f64 * std::f64::consts::PI };
                let shape = |s: f64| match is_free {
                    // Supports do not move.
                    _ if s == 0.0 || (!is_free && s == 1.0) => 0.0,
                    true => cantilever_shape(wave, s),
                    false => (wave * s).sin(),
                };
                let tip = if is_free { shape(1.0) } else { 0.0 };
                let square = integral(wave, |s| shape(s) * shape(s)) + tip_ratio * tip * tip;
                let scale = 1.0 / (mass * square).sqrt();
                let per_length = wave / beam.length_m;
                Mode {
                    angular_frequency_rad_per_s: per_length
                        * per_length
                        * (beam.bending_stiffness_n_m2 / beam.mass_per_length_kg_per_m).sqrt(),
                    damping_ratio: beam.damping_ratio,
                    shape: beam.places_m.iter().map(|place| scale * shape(place / beam.length_m)).collect(),
                    participation: scale * mass * (integral(wave, shape) + tip_ratio * tip),
                }
            })
            .collect();
        Ok(Self { modes, influence: vec![1.0; beam.places_m.len()], coupling_per_s: Vec::new() })
    }
}

/// The matrix of springs or dashpots between each floor and the one below, by rows.
fn chain(storeys: &[Storey], of: fn(&Storey) -> f64) -> Vec<f64> {
    let n = storeys.len();
    let mut rows = vec![0.0; n * n];
    for (i, storey) in storeys.iter().enumerate() {
        rows[i * n + i] += of(storey);
        if let Some(below) = i.checked_sub(1) {
            rows[below * n + below] += of(storey);
            rows[i * n + below] -= of(storey);
            rows[below * n + i] -= of(storey);
        }
    }
    rows
}

/// A symmetric matrix from its rows.
pub(crate) fn matrix(what: &'static str, rows: &[f64], n: usize) -> Result<DMatrix<f64>, Refused> {
    if rows.len() != n * n {
        return Err(Refused::Count { what, found: rows.len(), expected: n * n });
    }
    let matrix = DMatrix::from_row_slice(n, n, rows);
    let largest = matrix.amax();
    for i in 0..n {
        for j in 0..i {
            let (one, other) = (matrix[(i, j)], matrix[(j, i)]);
            if !(one.is_finite() && (one - other).abs() <= 1e-9 * largest) {
                return Err(Refused::NotSymmetric { what, row: i + 1, column: j + 1, one, other });
            }
        }
    }
    Ok(symmetric(&matrix))
}

/// Refuses damping that feeds a motion.
pub(crate) fn not_growing(damping: &DMatrix<f64>) -> Result<(), Refused> {
    let values = damping.clone().symmetric_eigenvalues();
    if values.min() < -1e-12 * values.amax() { Err(Refused::NegativeDamping) } else { Ok(()) }
}

/// The n-th root β of `1 + cos β cosh β + r β (cos β sinh β − sin β cosh β) = 0`, r the tip's mass per the beam's, divided by cosh β.
fn cantilever_root(n: usize, tip_ratio: f64) -> f64 {
    let function = |beta: f64| {
        let (sine, cosine) = beta.sin_cos();
        1.0 / beta.cosh() + cosine + tip_ratio * beta * (cosine * beta.tanh() - sine)
    };
    // One root between (n − 1) π and n π: without a tip mass near (n − ½) π, with a large one lower, down to (n − ¾) π.
    let pi = std::f64::consts::PI;
    let (mut low, mut high) = (((n - 1) as f64 * pi).max(1e-9), n as f64 * pi);
    let positive_low = function(low) > 0.0;
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if (function(middle) > 0.0) == positive_low {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Bending shape of a cantilever, `cosh βs − cos βs − σ (sinh βs − sin βs)` with σ = (cosh β + cos β)/(sinh β + sin β), in terms that do not
/// cancel.
fn cantilever_shape(beta: f64, s: f64) -> f64 {
    let (sine, cosine) = beta.sin_cos();
    // 1 − σ times e^β.
    let growing = 2.0 * (sine - cosine - (-beta).exp()) / (1.0 - (-2.0 * beta).exp() + 2.0 * sine * (-beta).exp());
    let sigma = 1.0 - growing * (-beta).exp();
    let angle = beta * s;
    0.5 * (growing * (angle - beta).exp() + (1.0 + sigma) * (-angle).exp()) - angle.cos() + sigma * angle.sin()
}

/// ∫ f ds from 0 to 1 of a function that waves like sin βs: Gauss's rule with four points on at least eight parts a wave.
fn integral(beta: f64, f: impl Fn(f64) -> f64) -> f64 {
    const POINTS: [(f64, f64); 2] =
        [(0.339_981_043_584_856_3, 0.652_145_154_862_546_1), (0.861_136_311_594_052_6, 0.347_854_845_137_453_9)];
    let parts = (16.0 + 8.0 * beta).ceil();
    let half = 0.5 / parts;
    let mut sum = 0.0;
    for part in 0..parts as usize {
        let middle = (2 * part + 1) as f64 * half;
        for (at, weight) in POINTS {
            sum += weight * (f(middle - at * half) + f(middle + at * half));
        }
    }
    sum * half
}
