//! The linear system that holds while no contact changes, in closed form.
//!
//! `M q″ + C q′ + K q = f + Re(F̂ e^{iΩt})` with `Bᵀq + Δι z` constant for the joints that stick. In a basis of the remaining freedom
//! that is orthonormal in M and diagonalises K, the motion is a sum of exponentials, one for each natural motion and one for
//! the excitation: every displacement, velocity and joint force is `constant + Re Σ cⱼ zⱼ`, with `zⱼ′ = λⱼ zⱼ`.

use damprig_core::integrator::exact::excitation::Wave;
use nalgebra::{Complex, DMatrix, DVector};

use crate::Refused;

/// A complex number.
pub(crate) type C64 = Complex<f64>;

const I: C64 = C64::new(0.0, 1.0);

/// Largest relative coupling between natural modes that counts as rounding.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Largest loss of digits by the coordinates of the natural motions: ten digits are left.
const MOST_CONDITION: f64 = 1e5;

/// A spring and a dashpot on the displacement `row · q`.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub row: Vec<f64>,
    pub stiffness: f64,
    pub damping: f64,
}

/// Modal coordinates, tuned masses and particles, relative to the base: masses, springs and dashpots.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bodies {
    /// Mass of each, kg (1 of a modal coordinate).
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

/// The scalar product.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Bodies {
    pub fn len(&self) -> usize {
        self.mass.len()
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
    fn matrix(&self, of: impl Fn(&Self, &[f64]) -> Vec<f64>) -> DMatrix<f64> {
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

/// Adds `factor · row` to `sum`.
pub(crate) fn add(sum: &mut [f64], factor: f64, row: &[f64]) {
    sum.iter_mut().zip(row).for_each(|(sum, row)| *sum += factor * row);
}

/// A joint that sticks: `row · q + influence · z` is constant.
#[derive(Clone, Debug)]
pub(crate) struct Constraint {
    pub row: Vec<f64>,
    pub influence: f64,
}

/// The freedom that is left.
#[derive(Clone, Debug)]
struct Basis {
    /// Ψ: q = Ψ η + D κ(t), orthonormal in M.
    shapes: DMatrix<f64>,
    /// Ψᵀ M.
    project: DMatrix<f64>,
    /// D = B (BᵀB)⁻¹.
    fixed: DMatrix<f64>,
    /// Δι of each constraint.
    influence: Vec<f64>,
    rows: Vec<Vec<f64>>,
}

/// Which natural motions a coordinate η consists of, and how they follow from it.
#[derive(Clone, Debug)]
enum Motions {
    /// Every natural motion belongs to one coordinate: its number, and what of it and of its rate is in the motion.
    Modal(Vec<(usize, C64, C64)>),
    /// η = Re(right · z); z = left · η + left_rate · η′.
    Coupled { right: DMatrix<C64>, left: DMatrix<C64>, left_rate: DMatrix<C64> },
}

/// A linear system with the constraints of one state of the contacts.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    /// λ of each natural motion, 1/s, and iΩ of the excitation, by magnitude.
    pub rates: Vec<C64>,
    /// Which of them is the excitation.
    pub wave: usize,
    /// ω² of each coordinate.
    square: Vec<f64>,
    basis: Option<Basis>,
    motions: Motions,
    /// η of the forced motion per wave.
    forced: Vec<C64>,
    /// q of the forced motion per wave.
    forced_q: Vec<C64>,
    turning: f64,
}

/// A linear function of the motion: `on · η + fixed · κ` with its coefficients on the natural motions.
#[derive(Clone, Debug)]
pub(crate) struct Signal {
    on: Vec<f64>,
    fixed: Vec<f64>,
    /// Coefficients of the natural motions and the excitation.
    pub coefficients: Vec<C64>,
}

/// Constant parts of a motion.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rest {
    /// η at rest under the constant forces.
    eta: Vec<f64>,
    /// κ − Δι times the constant part of z.
    kappa: Vec<f64>,
}

impl Linear {
    /// Solves the system once. `force` is F̂ on each body; Ω is 0 without an excitation.
    pub fn new(bodies: &Bodies, stuck: &[Constraint], turning: f64, force: &[C64]) -> Result<Self, Refused> {
        let is_modal = stuck.is_empty() && bodies.links.is_empty() && bodies.coupling.is_empty();
        if is_modal && bodies.mass.iter().all(|&mass| mass == 1.0) {
            let square = bodies.stiffness.clone();
            return Self::with(bodies, None, square, None, &bodies.damping, turning, force);
        }
        let n = bodies.len();
        let (stiffness, damping) = (bodies.matrix(Bodies::springs), bodies.matrix(Bodies::dashpots));
        let rows = DMatrix::from_fn(n, stuck.len(), |i, j| stuck[j].row[i]);
        let mass = DMatrix::from_diagonal(&DVector::from_column_slice(&bodies.mass));
        let (shapes, square) = if stuck.len() == n {
            (DMatrix::zeros(n, 0), Vec::new())
        } else {
            let free = complement(&rows).ok_or(Refused::Redundant)?;
            let root = (free.transpose() * &mass * &free).cholesky().ok_or(Refused::Redundant)?.l();
            let orthonormal = root.solve_lower_triangular(&free.transpose()).ok_or(Refused::Redundant)?.transpose();
            let eigen = symmetric(&(orthonormal.transpose() * &stiffness * &orthonormal)).symmetric_eigen();
            (orthonormal * &eigen.eigenvectors, eigen.eigenvalues.iter().copied().collect())
        };
        let fixed = if stuck.is_empty() {
            DMatrix::zeros(n, 0)
        } else {
            let gram = (rows.transpose() * &rows).try_inverse().ok_or(Refused::Redundant)?;
            &rows * gram
        };
        let damping = symmetric(&(shapes.transpose() * damping * &shapes));
        let basis = Basis {
            project: shapes.transpose() * mass,
            shapes,
            fixed,
            influence: stuck.iter().map(|joint| joint.influence).collect(),
            rows: stuck.iter().map(|joint| joint.row.clone()).collect(),
        };
        let diagonal: Vec<f64> = damping.diagonal().iter().copied().collect();
        let largest = diagonal.iter().fold(0.0, |most: f64, c| most.max(*c));
        let size = diagonal.len();
        let is_modal = (0..size).all(|i| (0..i).all(|j| damping[(i, j)].abs() <= ROUNDING * largest));
        Self::with(bodies, Some(basis), square, (!is_modal).then_some(&damping), &diagonal, turning, force)
    }

    fn with(
        bodies: &Bodies,
        basis: Option<Basis>,
        square: Vec<f64>,
        coupled: Option<&DMatrix<f64>>,
        damping: &[f64],
        turning: f64,
        force: &[C64],
    ) -> Result<Self, Refused> {
        if let Some(&lowest) = square.iter().min_by(|a, b| a.total_cmp(b))
            && lowest <= 0.0
        {
            return Err(Refused::Unsupported);
        }
        let (mut rates, mut motions) = match coupled {
            None => modal(&square, damping)?,
            Some(damping) => natural(&square, damping)?,
        };
        let wave = rates.iter().filter(|rate| rate.norm() <= turning).count();
        rates.insert(wave, I * turning);
        match &mut motions {
            Motions::Modal(list) => list.insert(wave, (usize::MAX, C64::ZERO, C64::ZERO)),
            Motions::Coupled { right, left, left_rate } => {
                *right = right.clone().insert_column(wave, C64::ZERO);
                *left = left.clone().insert_row(wave, C64::ZERO);
                *left_rate = left_rate.clone().insert_row(wave, C64::ZERO);
            }
        }
        let mut linear =
            Self { rates, wave, square, basis, motions, forced: Vec::new(), forced_q: Vec::new(), turning };
        let moved = linear.forced_load(bodies, force);
        linear.forced = linear.response(&moved, coupled, damping)?;
        linear.forced_q = linear.expand(&linear.forced, bodies.len());
        Ok(linear)
    }

    /// F̂ on the coordinates, with the reaction of what the constraints move.
    fn forced_load(&self, bodies: &Bodies, force: &[C64]) -> Vec<C64> {
        let Some(basis) = &self.basis else { return force.to_vec() };
        let mut load: Vec<C64> = force.to_vec();
        let moved = basis.moved();
        if moved.iter().any(|q| *q != 0.0) {
            // q = D (κ − Δι z), and z = Re(−i W).
            let (springs, dashpots) = (bodies.springs(&moved), bodies.dashpots(&moved));
            for (i, load) in load.iter_mut().enumerate() {
                let dynamic = C64::new(springs[i] - self.turning * self.turning * bodies.mass[i] * moved[i], 0.0)
                    + I * (self.turning * dashpots[i]);
                *load -= dynamic * -I;
            }
        }
        (0..self.square.len()).map(|i| load.iter().enumerate().map(|(n, f)| basis.shapes[(n, i)] * f).sum()).collect()
    }

    /// η of the forced motion.
    fn response(&self, load: &[C64], coupled: Option<&DMatrix<f64>>, damping: &[f64]) -> Result<Vec<C64>, Refused> {
        let at_rest = load.iter().all(|f| f.norm() == 0.0);
        if at_rest {
            return Ok(vec![C64::ZERO; load.len()]);
        }
        let of = |i: usize| C64::new(self.square[i] - self.turning * self.turning, self.turning * damping[i]);
        match coupled {
            None => (0..load.len())
                .map(|i| {
                    let dynamic = of(i);
                    let resonant = dynamic.norm() <= 1e-12 * self.square[i] && load[i].norm() > 0.0;
                    if resonant { Err(Refused::Resonance) } else { Ok(load[i] / dynamic) }
                })
                .collect(),
            Some(damping) => {
                let n = load.len();
                let matrix =
                    DMatrix::from_fn(n, n, |i, j| if i == j { of(i) } else { I * (self.turning * damping[(i, j)]) });
                let solved = matrix.lu().solve(&DVector::from_column_slice(load)).ok_or(Refused::Resonance)?;
                Ok(solved.iter().copied().collect())
            }
        }
    }

    /// q of the forced motion from η.
    fn expand(&self, eta: &[C64], n: usize) -> Vec<C64> {
        let Some(basis) = &self.basis else { return eta.to_vec() };
        let moved = basis.moved();
        (0..n)
            .map(|row| {
                let free: C64 = eta.iter().enumerate().map(|(i, eta)| basis.shapes[(row, i)] * eta).sum();
                free + moved.get(row).copied().unwrap_or(0.0) * -I
            })
            .collect()
    }

    /// The constant part of a motion that starts from q, under the constant force. `share`: 1 where the base moves, otherwise 0.
    pub fn rest(&self, bodies: &Bodies, q: &[f64], force: &[f64], wave: &Wave, share: f64, rest: &mut Rest) {
        rest.eta.clear();
        rest.kappa.clear();
        let Some(basis) = &self.basis else {
            rest.eta.extend(force.iter().zip(&self.square).map(|(f, square)| f / square));
            return;
        };
        // z without its constant part.
        let of = |(row, influence): (&Vec<f64>, &f64)| dot(row, q) + influence * share * wave.sine;
        rest.kappa.extend(basis.rows.iter().zip(&basis.influence).map(of));
        let prescribed = &basis.fixed * DVector::from_column_slice(&rest.kappa);
        let springs = bodies.springs(prescribed.as_slice());
        let load = DVector::from_iterator(force.len(), force.iter().zip(&springs).map(|(f, k)| f - k));
        rest.eta.extend((basis.shapes.transpose() * load).iter().zip(&self.square).map(|(f, square)| f / square));
    }

    /// The natural motions of a state.
    pub fn enter(&self, rest: &Rest, q: &[f64], v: &[f64], wave: C64, z: &mut Vec<C64>) {
        z.clear();
        let turning = I * self.turning;
        let left = |i: usize, eta: f64, rate: f64| {
            let forced = self.forced[i] * wave;
            (eta - rest.eta[i] - forced.re, rate - (turning * forced).re)
        };
        let (eta, rate) = match &self.basis {
            None => (None, None),
            Some(basis) => {
                // Without what the constraints prescribe.
                let moved = basis.moved();
                let prescribed = &basis.fixed * DVector::from_column_slice(&rest.kappa);
                let eta = (0..q.len()).map(|i| q[i] - prescribed[i] - moved[i] * wave.im);
                let rate = (0..q.len()).map(|i| v[i] - moved[i] * self.turning * wave.re);
                let project = |x: DVector<f64>| &basis.project * x;
                let (eta, rate) = (DVector::from_iterator(q.len(), eta), DVector::from_iterator(q.len(), rate));
                (Some(project(eta)), Some(project(rate)))
            }
        };
        let eta = eta.as_ref().map_or(q, |eta| eta.as_slice());
        let rate = rate.as_ref().map_or(v, |rate| rate.as_slice());
        match &self.motions {
            Motions::Modal(list) => z.extend(list.iter().map(|&(i, of, of_rate)| {
                if i == usize::MAX {
                    return wave;
                }
                let (eta, rate) = left(i, eta[i], rate[i]);
                of * eta + of_rate * rate
            })),
            Motions::Coupled { left: of, left_rate, .. } => {
                z.resize(self.rates.len(), C64::ZERO);
                for (i, (&eta, &rate)) in eta.iter().zip(rate).enumerate() {
                    let (eta, rate) = left(i, eta, rate);
                    for (z, (of, of_rate)) in z.iter_mut().zip(of.column(i).iter().zip(left_rate.column(i).iter())) {
                        *z += of * eta + of_rate * rate;
                    }
                }
                z[self.wave] = wave;
            }
        }
    }

    /// The state of natural motions.
    pub fn leave(&self, rest: &Rest, z: &[C64], q: &mut [f64], v: &mut [f64]) {
        match &self.basis {
            None => self.leave_natural(rest, z, q, v),
            Some(basis) => {
                let n = self.square.len();
                let (mut eta, mut rate) = (DVector::zeros(n), DVector::zeros(n));
                self.leave_natural(rest, z, eta.as_mut_slice(), rate.as_mut_slice());
                let wave = z[self.wave];
                let prescribed = &basis.fixed * DVector::from_column_slice(&rest.kappa);
                let moved = basis.moved();
                let (free, free_rate) = (&basis.shapes * eta, &basis.shapes * rate);
                for i in 0..q.len() {
                    q[i] = free[i] + prescribed[i] + moved[i] * wave.im;
                    v[i] = free_rate[i] + moved[i] * self.turning * wave.re;
                }
            }
        }
    }

    /// η and η′.
    fn leave_natural(&self, rest: &Rest, z: &[C64], eta: &mut [f64], rate: &mut [f64]) {
        let wave = z[self.wave];
        for (i, (eta, rate)) in eta.iter_mut().zip(rate.iter_mut()).enumerate() {
            let forced = self.forced[i] * wave;
            (*eta, *rate) = (rest.eta[i] + forced.re, (I * self.turning * forced).re);
        }
        match &self.motions {
            Motions::Modal(list) => {
                for (&(i, ..), (z, faster)) in list.iter().zip(z.iter().zip(&self.rates)) {
                    if i != usize::MAX {
                        eta[i] += z.re;
                        rate[i] += (faster * z).re;
                    }
                }
            }
            Motions::Coupled { right, .. } => {
                for (j, (z, faster)) in z.iter().zip(&self.rates).enumerate().filter(|(j, _)| *j != self.wave) {
                    let faster = faster * z;
                    for (i, right) in right.column(j).iter().enumerate() {
                        eta[i] += (right * z).re;
                        rate[i] += (right * faster).re;
                    }
                }
            }
        }
    }

    /// The displacement `row · q`.
    pub fn displacement(&self, row: &[f64]) -> Signal {
        let on: Vec<f64> = match &self.basis {
            None => row.to_vec(),
            Some(basis) => (0..self.square.len()).map(|i| dot(row, basis.shapes.column(i).as_slice())).collect(),
        };
        let fixed = match &self.basis {
            None => Vec::new(),
            Some(basis) => (0..basis.fixed.ncols()).map(|i| dot(row, basis.fixed.column(i).as_slice())).collect(),
        };
        let mut coefficients: Vec<C64> = match &self.motions {
            Motions::Modal(list) => {
                list.iter().map(|&(i, ..)| C64::from(on.get(i).copied().unwrap_or_default())).collect()
            }
            Motions::Coupled { right, .. } => {
                (0..self.rates.len()).map(|j| on.iter().enumerate().map(|(i, on)| right[(i, j)] * *on).sum()).collect()
            }
        };
        coefficients[self.wave] = row.iter().zip(&self.forced_q).map(|(row, q)| q * *row).sum();
        Signal { on, fixed, coefficients }
    }

    /// The velocity `row · q′`.
    pub fn velocity(&self, row: &[f64]) -> Signal {
        let displacement = self.displacement(row);
        let coefficients = displacement.coefficients.iter().zip(&self.rates).map(|(c, rate)| c * rate).collect();
        Signal { on: Vec::new(), fixed: Vec::new(), coefficients }
    }

    /// The force of the `which`-th constraint along its row: `Dᵀ (M q″ + C q′ + K q − f)`; its constant part is
    /// [`Linear::holding_rest`].
    pub fn holding(&self, bodies: &Bodies, which: usize, force: &[C64]) -> Vec<C64> {
        let Some(basis) = &self.basis else { return Vec::new() };
        let row = basis.fixed.column(which);
        let row = row.as_slice();
        let springs = bodies.springs(row);
        let dashpots = bodies.dashpots(row);
        let inertia: Vec<f64> = row.iter().zip(&bodies.mass).map(|(row, mass)| row * mass).collect();
        let [springs, dashpots, inertia] = [springs, dashpots, inertia].map(|row| self.displacement(&row).coefficients);
        let mut coefficients: Vec<C64> = (0..self.rates.len())
            .map(|j| springs[j] + self.rates[j] * (dashpots[j] + self.rates[j] * inertia[j]))
            .collect();
        coefficients[self.wave] -= row.iter().zip(force).map(|(row, f)| f * *row).sum::<C64>();
        coefficients
    }

    /// The constant part of that force under the constant `force`.
    pub fn holding_rest(&self, bodies: &Bodies, which: usize, rest: &Rest, force: &[f64]) -> f64 {
        let Some(basis) = &self.basis else { return 0.0 };
        let q = &basis.shapes * DVector::from_column_slice(&rest.eta)
            + &basis.fixed * DVector::from_column_slice(&rest.kappa);
        let springs = bodies.springs(q.as_slice());
        basis.fixed.column(which).iter().zip(springs.iter().zip(force)).map(|(row, (k, f))| row * (k - f)).sum()
    }
}

impl Signal {
    /// The constant part.
    pub fn constant(&self, rest: &Rest) -> f64 {
        dot(&self.on, &rest.eta) + dot(&self.fixed, &rest.kappa)
    }
}

impl Basis {
    /// q per sine of the base that the constraints prescribe: −D Δι.
    fn moved(&self) -> Vec<f64> {
        let influence = DVector::from_column_slice(&self.influence);
        (&self.fixed * influence).iter().map(|q| -q).collect()
    }
}

/// The symmetric part of a matrix that is symmetric but for rounding.
fn symmetric(matrix: &DMatrix<f64>) -> DMatrix<f64> {
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

/// The natural motions of uncoupled coordinates, by the magnitude of their rates.
fn modal(square: &[f64], damping: &[f64]) -> Result<(Vec<C64>, Motions), Refused> {
    let mut list = Vec::new();
    for (i, (&square, &damping)) in square.iter().zip(damping).enumerate() {
        let decay = -0.5 * damping;
        let left = square - decay * decay;
        if left.abs() <= 1e-10 * square {
            return Err(Refused::Critical);
        } else if left > 0.0 {
            let turning = left.sqrt();
            let (of, of_rate) = (C64::new(1.0, decay / turning), C64::new(0.0, -1.0 / turning));
            list.push((C64::new(decay, turning), (i, of, of_rate)));
        } else {
            let split = (-left).sqrt();
            // The slow rate from the product of both, without cancellation.
            let fast = decay - split;
            let slow = square / fast;
            for (rate, other) in [(fast, slow), (slow, fast)] {
                let of = C64::from(-other / (rate - other));
                list.push((C64::from(rate), (i, of, C64::from(1.0 / (rate - other)))));
            }
        }
    }
    list.sort_by(|a, b| a.0.norm().total_cmp(&b.0.norm()));
    let (rates, motions) = list.into_iter().unzip();
    Ok((rates, Motions::Modal(motions)))
}

/// The natural motions of coordinates with ω² = `square` that the damping couples: eigenvalues and eigenvectors of
/// `(ωη, η′)′ = [0 ω; −ω −C] (ωη, η′)`, which is normal but for C.
fn natural(square: &[f64], damping: &DMatrix<f64>) -> Result<(Vec<C64>, Motions), Refused> {
    let n = square.len();
    let omega: Vec<f64> = square.iter().map(|square| square.sqrt()).collect();
    let matrix = DMatrix::from_fn(2 * n, 2 * n, |i, j| {
        C64::from(match (i < n, j < n) {
            (true, false) if i == j - n => omega[i],
            (false, true) if i - n == j => -omega[j],
            (false, false) => -damping[(i - n, j - n)],
            _ => 0.0,
        })
    });
    let (unitary, triangle) = matrix.schur().unpack();
    let vectors = unitary * eigenvectors(&triangle);
    let inverse = vectors.clone().try_inverse().ok_or(Refused::Critical)?;
    if vectors.norm() * inverse.norm() > MOST_CONDITION * n as f64 {
        return Err(Refused::Critical);
    }
    let size = triangle.diagonal().iter().fold(0.0, |most: f64, rate| most.max(rate.norm()));
    let mut kept: Vec<(usize, C64, f64)> = triangle
        .diagonal()
        .iter()
        .enumerate()
        .filter(|(_, rate)| rate.im > -1e-12 * size)
        .map(|(j, rate)| if rate.im > 1e-12 * size { (j, *rate, 2.0) } else { (j, C64::from(rate.re), 1.0) })
        .collect();
    kept.sort_by(|a, b| a.1.norm().total_cmp(&b.1.norm()));
    let count = kept.len();
    Ok((
        kept.iter().map(|(_, rate, _)| C64::new(rate.re.min(0.0), rate.im)).collect(),
        Motions::Coupled {
            right: DMatrix::from_fn(n, count, |i, j| vectors[(i, kept[j].0)] * (kept[j].2 / omega[i])),
            left: DMatrix::from_fn(count, n, |j, i| inverse[(kept[j].0, i)] * omega[i]),
            left_rate: DMatrix::from_fn(count, n, |j, i| inverse[(kept[j].0, n + i)]),
        },
    ))
}

/// The eigenvectors of an upper triangular matrix, as columns of length 1.
fn eigenvectors(triangle: &DMatrix<C64>) -> DMatrix<C64> {
    let n = triangle.nrows();
    let least = f64::EPSILON * triangle.norm();
    let mut vectors = DMatrix::from_element(n, n, C64::ZERO);
    for k in 0..n {
        let mut vector = DVector::from_element(n, C64::ZERO);
        vector[k] = C64::ONE;
        for i in (0..k).rev() {
            let sum: C64 = (i + 1..=k).map(|j| triangle[(i, j)] * vector[j]).sum();
            let mut gap = triangle[(k, k)] - triangle[(i, i)];
            if gap.norm() < least {
                gap = C64::from(least);
            }
            vector[i] = sum / gap;
        }
        let norm = vector.norm();
        vectors.set_column(k, &(vector / C64::from(norm)));
    }
    vectors
}
