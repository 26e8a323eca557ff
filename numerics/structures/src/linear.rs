//! The linear system that holds while no contact changes, in closed form.
//!
//! `M q″ + C q′ + K q = f + Re(F̂ W)` with `W = e^{iΩt}` and with the joints that stick. In the coordinates η that these leave ([`Basis`])
//! the motion is a sum of exponentials, one for each natural motion and one for the excitation ([`NaturalMotions`]): every displacement,
//! velocity and joint force is `c(t) + Re Σ cⱼ zⱼ`, with `zⱼ′ = λⱼ zⱼ` and a polynomial `c(t)`, which is constant unless
//! the base follows samples or a force changes ([`Rest`]).

use std::ops::Range;

use nalgebra::{Complex, DMatrix, DVector};

use crate::Refused;
use crate::basis::{Basis, Constraint};
use crate::bodies::{Bodies, dot};
use crate::circuits::Circuits;
use crate::natural_motions::NaturalMotions;
use crate::polynomial::{ORDERS, Polynomial};
use crate::push::{Push, response as response_to_push};
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
    /// ω² of each coordinate of the masses; those of charges come after them.
    square: Vec<f64>,
    /// C on the coordinates of the masses.
    damping: DMatrix<f64>,
    circuits: Circuits,
    /// `None`: the bodies' displacements are the coordinates.
    basis: Option<Basis>,
    /// η of the forced motion per W.
    forced: Vec<C64>,
    /// q of the forced motion per W.
    forced_q: Vec<C64>,
    turning: f64,
}

/// A linear function of the displacements: `on · η + held · κ` with its coefficients on the natural motions.
#[derive(Clone, Debug)]
pub(crate) struct Signal {
    on: Vec<f64>,
    held: Vec<f64>,
    /// Coefficients of the natural motions and the excitation.
    pub coefficients: Vec<C64>,
}

/// What is no exponential of a motion: polynomials from the present instant on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rest {
    /// η under the constant forces, the base's cubic and forces that change.
    eta: Vec<Polynomial>,
    /// κ less Δι times the base's cubic.
    kappa: Vec<Polynomial>,
    /// Forces on the bodies that change within a piece; empty where there are none.
    pushed: Vec<Polynomial>,
    /// How many derivatives are not zero, with the value.
    orders: usize,
}

impl Rest {
    /// Moves the origin of time to `t`.
    pub fn advance(&mut self, t: f64) {
        let all = self.eta.iter_mut().chain(&mut self.kappa).chain(&mut self.pushed);
        all.for_each(|polynomial| *polynomial = polynomial.after(t));
    }

    /// Whether it changes.
    pub fn drifts(&self) -> bool {
        self.orders > 1
    }
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
        let circuits = basis.as_ref().map_or_else(Circuits::default, |basis| basis.circuits.clone());
        let natural = NaturalMotions::new(&square, &damping, &circuits, turning)?;
        let load = load(bodies, basis.as_ref(), turning, force);
        let forced = response(&square, &damping, &circuits, turning, &load)?;
        let forced_q = match &basis {
            None => forced.clone(),
            Some(basis) => (basis.shapes.row_iter().zip(&basis.moved))
                .map(|(row, moved)| row.iter().zip(&forced).map(|(shape, eta)| eta * *shape).sum::<C64>() - I * *moved)
                .collect(),
        };
        Ok(Self { natural, square, damping, circuits, basis, forced, forced_q, turning })
    }

    /// The slowest rate of what swings, 1/s; infinite where nothing does.
    pub fn slowest_per_s(&self) -> f64 {
        let least = |rates: &mut dyn Iterator<Item = f64>| rates.filter(|of| *of > 0.0).fold(f64::INFINITY, f64::min);
        if self.circuits.len() == 0 {
            return least(&mut self.natural.rates.iter().map(|rate| rate.norm()));
        }
        // A circuit may be slower than all else by any factor.
        least(&mut self.square.iter().map(|square| square.sqrt()).chain([self.turning]))
    }

    /// How many coordinates there are.
    fn coordinate_count(&self) -> usize {
        self.square.len() + self.circuits.len()
    }

    /// The part of a motion from q on that is no exponential, under the constant force and the base's cubic. `sine` is z less the cubic.
    pub fn rest(&self, bodies: &Bodies, q: &[f64], force: &[f64], (base, sine): (Polynomial, f64), rest: &mut Rest) {
        rest.kappa.clear();
        if let Some(basis) = &self.basis {
            rest.kappa.extend(basis.kappa(q, sine, base));
        }
        rest.eta.clear();
        rest.pushed.clear();
        rest.orders = orders(base);
        if !rest.drifts() && self.basis.is_none() {
            let at_rest = |(force, square)| Polynomial::constant(force / square);
            rest.eta.extend(force.iter().zip(&self.square).map(at_rest));
            return;
        }
        rest.eta.resize(self.coordinate_count(), Polynomial::default());
        // ω² η⁽ᵏ⁾ = load⁽ᵏ⁾ − C η⁽ᵏ⁺¹⁾ − η⁽ᵏ⁺²⁾, from the highest derivative down.
        let mut higher = [(); 2].map(|()| vec![0.0; self.coordinate_count()]);
        let orders = rest.orders;
        for order in (0..orders).rev() {
            let force = external(bodies, force, base, order);
            let mut eta = match &self.basis {
                None => force,
                Some(basis) => {
                    let reaction = reaction(bodies, order..orders, |order| basis.prescribed(&rest.kappa, order));
                    let load = DVector::from_iterator(force.len(), force.iter().zip(reaction).map(|(f, r)| f - r));
                    basis.loads.tr_mul(&load).as_slice().to_vec()
                }
            };
            let (swinging, of_circuits) = eta.split_at_mut(self.square.len());
            self.circuits.settle(of_circuits, &higher[0]);
            self.circuits.push_back(swinging, of_circuits);
            if higher.iter().flatten().any(|eta| *eta != 0.0) {
                let damped = &self.damping * DVector::from_column_slice(&higher[0][..self.square.len()]);
                let more = damped.iter().zip(&higher[1]).map(|(damped, inertia)| damped + inertia);
                swinging.iter_mut().zip(more).for_each(|(eta, more)| *eta -= more);
            }
            eta.iter_mut().zip(&self.square).for_each(|(eta, square)| *eta /= square);
            for (cubic, eta) in rest.eta.iter_mut().zip(&eta) {
                let mut derivatives = cubic.derivatives();
                derivatives[order] = *eta;
                *cubic = Polynomial::of(derivatives);
            }
            let [next, _] = higher;
            higher = [eta, next];
        }
    }

    /// A force along a row of the bodies.
    pub fn push(&self, row: Vec<f64>) -> Push {
        let load = match &self.basis {
            None => row.clone(),
            Some(basis) => basis.loads.tr_mul(&DVector::from_column_slice(&row)).as_slice().to_vec(),
        };
        let compliance = load[..self.square.len()].iter().map(|load| load * load).sum();
        Push { natural: self.natural.loaded(&load), row, compliance }
    }

    /// Adds what forces that are cubics over a piece of this length do; at least one.
    pub fn pushed(&self, pushes: &[(&Push, Polynomial)], length_s: f64, rest: &mut Rest) {
        rest.orders = ORDERS;
        rest.pushed.resize(pushes[0].0.row.len(), Polynomial::default());
        let mut z = vec![[C64::ZERO; ORDERS]; self.natural.rates.len()];
        for (push, force) in pushes {
            rest.pushed.iter_mut().zip(&push.row).for_each(|(sum, row)| *sum = *sum + *row * *force);
            for (z, (rate, load)) in z.iter_mut().zip(self.natural.rates.iter().zip(&push.natural)) {
                // The excitation is no part of it.
                if *load != C64::ZERO {
                    let more = response_to_push(*rate, *load, force, length_s);
                    z.iter_mut().zip(more).for_each(|(z, more)| *z += more);
                }
            }
        }
        let mut eta = vec![0.0; self.coordinate_count()];
        let mut derivatives: Vec<[f64; ORDERS]> = rest.eta.iter().map(Polynomial::derivatives).collect();
        for order in 0..ORDERS {
            eta.fill(0.0);
            self.natural.add(|n| z[n][order], &mut eta);
            derivatives.iter_mut().zip(&eta).for_each(|(derivatives, eta)| derivatives[order] += eta);
        }
        rest.eta.iter_mut().zip(derivatives).for_each(|(to, of)| *to = Polynomial::of(of));
    }

    /// The natural motions of a state, with their roundings. What is only the rounding of larger terms counts as zero, so that what is at rest
    /// stays so.
    pub fn enter(&self, rest: &Rest, q: &[f64], v: &[f64], wave: C64, to: (&mut Vec<C64>, &mut Vec<f64>)) {
        let projected = self.basis.as_ref().map(|basis| {
            let [prescribed, prescribed_rate] = [0, 1].map(|order| basis.prescribed(&rest.kappa, order));
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
                (0..self.coordinate_count()).map(of).collect::<Vec<Sum>>()
            };
            let eta = project(&|i| [q[i], prescribed[i], basis.moved[i] * wave.im]);
            (eta, project(&|i| [v[i], prescribed_rate[i], basis.moved[i] * self.turning * wave.re]))
        });
        let of = |i: usize| {
            let (mut eta, mut rate) = match &projected {
                Some((eta, rate)) => (eta[i], rate[i]),
                None => (Sum::of(q[i]), Sum::of(v[i])),
            };
            let forced = self.forced[i] * wave;
            let forced_rate = (I * self.turning * forced).re;
            let Polynomial { value, slope, .. } = rest.eta[i];
            eta.add(-value, value.abs());
            rate.add(-slope, slope.abs());
            eta.add(-forced.re, forced.re.abs());
            rate.add(-forced_rate, forced_rate.abs());
            (eta, rate)
        };
        self.natural.enter(self.coordinate_count(), of, wave, to);
    }

    /// The state of natural motions.
    pub fn leave(&self, rest: &Rest, z: &[C64], q: &mut [f64], v: &mut [f64]) {
        let Some(basis) = &self.basis else { return self.coordinates(rest, z, q, v) };
        let n = self.coordinate_count();
        let (mut eta, mut rate) = (DVector::zeros(n), DVector::zeros(n));
        self.coordinates(rest, z, eta.as_mut_slice(), rate.as_mut_slice());
        let wave = z[self.natural.wave];
        let [prescribed, prescribed_rate] = [0, 1].map(|order| basis.prescribed(&rest.kappa, order));
        let (free, free_rate) = (&basis.shapes * eta, &basis.shapes * rate);
        for i in 0..q.len() {
            q[i] = free[i] + prescribed[i] + basis.moved[i] * wave.im;
            v[i] = free_rate[i] + prescribed_rate[i] + basis.moved[i] * self.turning * wave.re;
        }
    }

    /// η and η′ of natural motions.
    fn coordinates(&self, rest: &Rest, z: &[C64], eta: &mut [f64], rate: &mut [f64]) {
        let wave = z[self.natural.wave];
        for (i, (eta, rate)) in eta.iter_mut().zip(rate.iter_mut()).enumerate() {
            let forced = self.forced[i] * wave;
            let Polynomial { value, slope, .. } = rest.eta[i];
            (*eta, *rate) = (value + forced.re, slope + (I * self.turning * forced).re);
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

    /// The force of the `which`-th constraint along its row: `Dᵀ (M q″ + C q′ + K q − f)`; its polynomial is
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

    /// The polynomial of that force under the constant `force`, the base's cubic and forces that change.
    pub fn holding_rest(
        &self,
        bodies: &Bodies,
        which: usize,
        rest: &Rest,
        (force, base): (&[f64], Polynomial),
    ) -> Polynomial {
        let Some(basis) = &self.basis else { return Polynomial::default() };
        let q = |order| {
            let free = &basis.shapes
                * DVector::from_iterator(rest.eta.len(), rest.eta.iter().map(|eta| eta.derivative(order)));
            free + basis.prescribed(&rest.kappa, order)
        };
        let row = basis.held.column(which);
        let mut derivatives = [0.0; ORDERS];
        for (order, of) in derivatives.iter_mut().enumerate().take(rest.orders) {
            let forces = reaction(bodies, order..rest.orders, q).into_iter().zip(external(bodies, force, base, order));
            *of = row.iter().zip(forces).map(|(row, (reaction, external))| row * (reaction - external)).sum();
            *of -= row.iter().zip(&rest.pushed).map(|(row, pushed)| row * pushed.derivative(order)).sum::<f64>();
        }
        Polynomial::of(derivatives)
    }
}

impl Signal {
    /// The polynomial.
    pub fn polynomial(&self, rest: &Rest) -> Polynomial {
        if !rest.drifts() {
            let on = |row: &[f64], of: &[Polynomial]| row.iter().zip(of).map(|(row, of)| row * of.value).sum::<f64>();
            return Polynomial::constant(on(&self.on, &rest.eta) + on(&self.held, &rest.kappa));
        }
        let on = |row: &[f64], of: &[Polynomial]| {
            row.iter().zip(of).fold(Polynomial::default(), |sum, (row, of)| sum + *row * *of)
        };
        on(&self.on, &rest.eta) + on(&self.held, &rest.kappa)
    }
}

/// A derivative of the forces on the bodies, N per sᵏ: `force` is constant, and the base's cubic accelerates them.
fn external(bodies: &Bodies, force: &[f64], base: Polynomial, order: usize) -> Vec<f64> {
    let (share, acceleration) = match order {
        0 => (1.0, base.bend),
        1 => (0.0, base.jerk),
        _ => (0.0, 0.0),
    };
    force.iter().zip(&bodies.inertia).map(|(force, inertia)| share * force - inertia * acceleration).collect()
}

/// A derivative of M q″ + C q′ + K q: that of the first of these orders; those after the last are zero. `q` gives a derivative of q.
fn reaction(bodies: &Bodies, mut orders: Range<usize>, q: impl Fn(usize) -> DVector<f64>) -> Vec<f64> {
    let mut next = || orders.next().map(&q);
    let mut forces = next().map_or_else(Vec::new, |q| bodies.springs(q.as_slice()));
    let mut add = |more: &mut dyn Iterator<Item = f64>| forces.iter_mut().zip(more).for_each(|(f, more)| *f += more);
    if let Some(rate) = next() {
        add(&mut bodies.dashpots(rate.as_slice()).into_iter());
    }
    if let Some(acceleration) = next() {
        add(&mut acceleration.iter().zip(&bodies.mass).map(|(a, mass)| a * mass));
    }
    forces
}

/// How many derivatives of a motion are not zero while the base follows a cubic, with the value.
fn orders(base: Polynomial) -> usize {
    if base.is_constant() { 1 } else { 4 }
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
fn response(
    square: &[f64],
    damping: &DMatrix<f64>,
    circuits: &Circuits,
    turning: f64,
    load: &[C64],
) -> Result<Vec<C64>, Refused> {
    let n = square.len();
    if load.iter().all(|f| f.norm() == 0.0) {
        return Ok(vec![C64::ZERO; load.len()]);
    }
    let undamped = (0..n).find(|&i| {
        damping.row(i).amax() == 0.0 && circuits.are_not_fed_by(i) && load[i].norm() > 0.0 && {
            (square[i] - turning * turning).abs() <= RESONANT * square[i]
        }
    });
    if undamped.is_some() {
        return Err(Refused::Resonance);
    }
    let mut matrix = DMatrix::from_fn(n, n, |i, j| {
        let elastic = if i == j { square[i] - turning * turning } else { 0.0 };
        C64::new(elastic, turning * damping[(i, j)])
    });
    // τ = per_load · load + per_eta · Hη acts back as Hᵀ τ.
    let (mut own, of_circuits) = (DVector::from_column_slice(&load[..n]), &load[n..]);
    for (k, load) in of_circuits.iter().enumerate() {
        let (per_load, per_eta) = circuits.per_load_and_feed(k, I * turning);
        let feed = circuits.feed.row(k);
        for i in 0..n {
            own[i] -= per_load * load * feed[i];
            for j in 0..n {
                matrix[(i, j)] += per_eta * (feed[i] * feed[j]);
            }
        }
    }
    let mut solved: Vec<C64> = match n {
        0 => Vec::new(),
        _ => matrix.lu().solve(&own).ok_or(Refused::Resonance)?.iter().copied().collect(),
    };
    for (k, load) in of_circuits.iter().enumerate() {
        let (per_load, per_eta) = circuits.per_load_and_feed(k, I * turning);
        let fed: C64 = circuits.feed.row(k).iter().zip(&solved[..n]).map(|(feed, eta)| eta * *feed).sum();
        solved.push(per_load * load + per_eta * fed);
    }
    Ok(solved)
}
