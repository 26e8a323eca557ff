//! The linear system that holds while no contact changes, in closed form.
//!
//! `M q″ + C q′ + K q = f + Re(F̂ W)` with `W = e^{iΩt}` and with the joints that stick. In the coordinates η that these leave ([`Basis`])
//! the motion is a sum of exponentials, one for each natural motion and one for the excitation ([`NaturalMotions`]): every displacement,
//! velocity and joint force is `constant + Re Σ cⱼ zⱼ`, with `zⱼ′ = λⱼ zⱼ`.

use nalgebra::{Complex, DMatrix, DVector};

use crate::Refused;
use crate::basis::{Basis, Constraint};
use crate::bodies::{Bodies, dot};
use crate::natural_motions::NaturalMotions;
use crate::sum::Sum;

/// A complex number.
pub(crate) type C64 = Complex<f64>;

const I: C64 = C64::new(0.0, 1.0);

/// Distance from a resonance without damping, relative to ω², at which the forced motion has lost all digits.
const RESONANT: f64 = 1e-12;

/// A linear system with the constraints of one state of the contacts.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    pub natural: NaturalMotions,
    /// ω² of each coordinate.
    square: Vec<f64>,
    /// `None`: the bodies' displacements are the coordinates.
    basis: Option<Basis>,
    /// η of the forced motion per W.
    forced: Vec<C64>,
    /// q of the forced motion per W.
    forced_q: Vec<C64>,
    turning: f64,
}

/// A linear function of the motion: `on · η + held · κ` with its coefficients on the natural motions.
#[derive(Clone, Debug)]
pub(crate) struct Signal {
    on: Vec<f64>,
    held: Vec<f64>,
    /// Coefficients of the natural motions and the excitation.
    pub coefficients: Vec<C64>,
}

/// Constant parts of a motion.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rest {
    /// η at rest under the constant forces.
    eta: Vec<f64>,
    /// κ less Δι times the constant part of z.
    kappa: Vec<f64>,
}

impl Linear {
    /// Solves the system once. `force` is F̂ on each body; `turning` is Ω, 0 without an excitation.
    pub fn new(bodies: &Bodies, stuck: &[Constraint], turning: f64, force: &[C64]) -> Result<Self, Refused> {
        let (basis, square, damping) = if stuck.is_empty() && bodies.are_modal() {
            let damping = DMatrix::from_diagonal(&DVector::from_column_slice(&bodies.damping));
            (None, bodies.stiffness.clone(), damping)
        } else {
            let (basis, square) = Basis::new(bodies, stuck)?;
            let damping = basis.damping(bodies);
            (Some(basis), square, damping)
        };
        let natural = NaturalMotions::new(&square, &damping, turning)?;
        let load = load(bodies, basis.as_ref(), turning, force);
        let forced = response(&square, &damping, turning, &load)?;
        let forced_q = match &basis {
            None => forced.clone(),
            Some(basis) => (basis.shapes.row_iter().zip(&basis.moved))
                .map(|(row, moved)| row.iter().zip(&forced).map(|(shape, eta)| eta * *shape).sum::<C64>() - I * *moved)
                .collect(),
        };
        Ok(Self { natural, square, basis, forced, forced_q, turning })
    }

    /// The constant part of a motion that starts from q, under the constant force. `sine` is z less its constant part.
    pub fn rest(&self, bodies: &Bodies, q: &[f64], force: &[f64], sine: f64, rest: &mut Rest) {
        rest.eta.clear();
        rest.kappa.clear();
        let at_rest = |(force, square): (f64, &f64)| force / square;
        let Some(basis) = &self.basis else {
            rest.eta.extend(force.iter().copied().zip(&self.square).map(at_rest));
            return;
        };
        rest.kappa.extend(basis.kappa(q, sine));
        let springs = bodies.springs(basis.prescribed(&rest.kappa).as_slice());
        let load = DVector::from_iterator(force.len(), force.iter().zip(&springs).map(|(f, k)| f - k));
        rest.eta.extend(basis.shapes.tr_mul(&load).iter().copied().zip(&self.square).map(at_rest));
    }

    /// The natural motions of a state, with their roundings. What is only the rounding of larger terms counts as zero, so that what is at rest
    /// stays so.
    pub fn enter(&self, rest: &Rest, q: &[f64], v: &[f64], wave: C64, to: (&mut Vec<C64>, &mut Vec<f64>)) {
        let projected = self.basis.as_ref().map(|basis| {
            let prescribed = basis.prescribed(&rest.kappa);
            let project = |value: &dyn Fn(usize) -> [f64; 3]| {
                let terms: Vec<[f64; 3]> = (0..q.len()).map(value).collect();
                let of = |row: usize| {
                    let along = basis.project.row(row);
                    let mut sum = Sum::default();
                    for (share, [a, b, c]) in along.iter().zip(&terms) {
                        sum.add(share * (a - b - c), share.abs() * (a.abs() + b.abs() + c.abs()));
                    }
                    sum
                };
                (0..self.square.len()).map(of).collect::<Vec<Sum>>()
            };
            let eta = project(&|i| [q[i], prescribed[i], basis.moved[i] * wave.im]);
            (eta, project(&|i| [v[i], 0.0, basis.moved[i] * self.turning * wave.re]))
        });
        let of = |i: usize| {
            let (mut eta, mut rate) = match &projected {
                Some((eta, rate)) => (eta[i], rate[i]),
                None => (Sum::of(q[i]), Sum::of(v[i])),
            };
            let forced = self.forced[i] * wave;
            let forced_rate = (I * self.turning * forced).re;
            eta.add(-rest.eta[i], rest.eta[i].abs());
            eta.add(-forced.re, forced.re.abs());
            rate.add(-forced_rate, forced_rate.abs());
            (eta, rate)
        };
        self.natural.enter(self.square.len(), of, wave, to);
    }

    /// The state of natural motions.
    pub fn leave(&self, rest: &Rest, z: &[C64], q: &mut [f64], v: &mut [f64]) {
        let Some(basis) = &self.basis else { return self.coordinates(rest, z, q, v) };
        let n = self.square.len();
        let (mut eta, mut rate) = (DVector::zeros(n), DVector::zeros(n));
        self.coordinates(rest, z, eta.as_mut_slice(), rate.as_mut_slice());
        let wave = z[self.natural.wave];
        let prescribed = basis.prescribed(&rest.kappa);
        let (free, free_rate) = (&basis.shapes * eta, &basis.shapes * rate);
        for i in 0..q.len() {
            q[i] = free[i] + prescribed[i] + basis.moved[i] * wave.im;
            v[i] = free_rate[i] + basis.moved[i] * self.turning * wave.re;
        }
    }

    /// η and η′ of natural motions.
    fn coordinates(&self, rest: &Rest, z: &[C64], eta: &mut [f64], rate: &mut [f64]) {
        let wave = z[self.natural.wave];
        for (i, (eta, rate)) in eta.iter_mut().zip(rate.iter_mut()).enumerate() {
            let forced = self.forced[i] * wave;
            (*eta, *rate) = (rest.eta[i] + forced.re, (I * self.turning * forced).re);
        }
        self.natural.leave(z, eta, rate);
    }

    /// The displacement `row · q`.
    pub fn displacement(&self, row: &[f64]) -> Signal {
        let (on, held) = match &self.basis {
            None => (row.to_vec(), Vec::new()),
            Some(basis) => {
                let along = |columns: &DMatrix<f64>| columns.column_iter().map(|c| dot(row, c.as_slice())).collect();
                (along(&basis.shapes), along(&basis.held))
            }
        };
        let mut coefficients = self.natural.coefficients(&on);
        coefficients[self.natural.wave] = row.iter().zip(&self.forced_q).map(|(row, q)| q * *row).sum();
        Signal { on, held, coefficients }
    }

    /// The velocity `row · q′`.
    pub fn velocity(&self, row: &[f64]) -> Signal {
        let displacement = self.displacement(row);
        let coefficients =
            displacement.coefficients.iter().zip(&self.natural.rates).map(|(c, rate)| c * rate).collect();
        Signal { on: Vec::new(), held: Vec::new(), coefficients }
    }

    /// The force of the `which`-th constraint along its row: `Dᵀ (M q″ + C q′ + K q − f)`; its constant part is
    /// [`Linear::holding_rest`].
    pub fn holding(&self, bodies: &Bodies, which: usize, force: &[C64]) -> Vec<C64> {
        let Some(basis) = &self.basis else { return Vec::new() };
        let row = basis.held.column(which);
        let row = row.as_slice();
        let springs = bodies.springs(row);
        let dashpots = bodies.dashpots(row);
        let inertia: Vec<f64> = row.iter().zip(&bodies.mass).map(|(row, mass)| row * mass).collect();
        let [springs, dashpots, inertia] = [springs, dashpots, inertia].map(|row| self.displacement(&row).coefficients);
        let mut coefficients: Vec<C64> = (0..self.natural.rates.len())
            .map(|j| springs[j] + self.natural.rates[j] * (dashpots[j] + self.natural.rates[j] * inertia[j]))
            .collect();
        coefficients[self.natural.wave] -= row.iter().zip(force).map(|(row, f)| f * *row).sum::<C64>();
        coefficients
    }

    /// The constant part of that force under the constant `force`.
    pub fn holding_rest(&self, bodies: &Bodies, which: usize, rest: &Rest, force: &[f64]) -> f64 {
        let Some(basis) = &self.basis else { return 0.0 };
        let q = &basis.shapes * DVector::from_column_slice(&rest.eta) + basis.prescribed(&rest.kappa);
        let springs = bodies.springs(q.as_slice());
        basis.held.column(which).iter().zip(springs.iter().zip(force)).map(|(row, (k, f))| row * (k - f)).sum()
    }
}

impl Signal {
    /// The constant part.
    pub fn constant(&self, rest: &Rest) -> f64 {
        dot(&self.on, &rest.eta) + dot(&self.held, &rest.kappa)
    }
}

/// F̂ on the coordinates, with the reaction of what the constraints move.
fn load(bodies: &Bodies, basis: Option<&Basis>, turning: f64, force: &[C64]) -> Vec<C64> {
    let Some(basis) = basis else { return force.to_vec() };
    let (springs, dashpots) = (bodies.springs(&basis.moved), bodies.dashpots(&basis.moved));
    let reaction = |i: usize| {
        // q per z, and z = Re(−i W).
        let dynamic = springs[i] - turning * turning * bodies.mass[i] * basis.moved[i];
        C64::new(dynamic, turning * dashpots[i]) * -I
    };
    let load: Vec<C64> = force.iter().enumerate().map(|(i, force)| force - reaction(i)).collect();
    basis.on_coordinates(&load)
}

/// η of the forced motion per W.
fn response(square: &[f64], damping: &DMatrix<f64>, turning: f64, load: &[C64]) -> Result<Vec<C64>, Refused> {
    let n = load.len();
    if load.iter().all(|f| f.norm() == 0.0) {
        return Ok(vec![C64::ZERO; n]);
    }
    let undamped = (0..n).find(|&i| {
        damping.row(i).amax() == 0.0 && load[i].norm() > 0.0 && {
            (square[i] - turning * turning).abs() <= RESONANT * square[i]
        }
    });
    if undamped.is_some() {
        return Err(Refused::Resonance);
    }
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        let elastic = if i == j { square[i] - turning * turning } else { 0.0 };
        C64::new(elastic, turning * damping[(i, j)])
    });
    let solved = matrix.lu().solve(&DVector::from_column_slice(load)).ok_or(Refused::Resonance)?;
    Ok(solved.iter().copied().collect())
}
