//! Contacts with Hertz walls: F = k δ^1.5 (1 + β δ′) ≥ 0 over time, numerically with a controlled error beside motions in closed form.
//!
//! Over a piece the force is a cubic in time, under which everything moves in closed form ([`crate::push`]): the particle flies under it, the structure takes
//! its reaction, and guards are certified for this motion. The cubic has the law's force at Gauss's four instants of the piece ([`crate::collocation`]). So
//! what a piece gives to the bodies is off by the order h⁹ at its end, and within it, or where an event cuts it short, by the order h⁵. The law's force
//! at both ends and in the middle tells the error within. The lengths of the pieces follow from it: they become short where δ^1.5 is not smooth, near
//! δ = 0, and where the force has a kink, as the wall starts to lag behind. An event of another joint ends a piece, and the next one has a new force. A
//! particle that friction holds has a constant force.
//!
//! No auxiliary spring stands for the wall: a response to cubics by polynomials and exponentials apart would lose (ωT)⁴ of the digits of modes that are slow
//! beside a contact of duration T, and the particle needs no spring to fly.
//!
//! Stated error: 10⁻⁹ of the contact's own depth, speed, force and duration. Measured: 2·10⁻¹⁰ against the closed forms of free impacts (both laws, 1 mm/s to
//! 10 m/s), 10⁻¹⁰ of a contact against the core's engine of one degree of freedom under a base, friction and weight. A contact takes about 60 pieces; a
//! particle at rest on a wall of steel some 200 a second.

use damprig_core::integrator::exact::time::Time;
use damprig_core::integrator::modes::{Sign, signed};
use damprig_core::model::Hertz;

use crate::collocation::{BEGIN, Depth, Powers, Sliding};
use crate::contacts::{Slide, Touch};
use crate::events::Few;
use crate::linear::C64;
use crate::motion::Motion;
use crate::mount::WallLaw;
use crate::observe::HertzContact;
use crate::polynomial::Polynomial;
use crate::stepping::Now;
use crate::system::{Pushed, System};

/// Largest error of the force in a piece, times the length of the piece, relative to the momentum of the contact.
const TOLERANCE: f64 = 1e-8;

/// Length of the first piece of a contact relative to the duration of an elastic one.
const FIRST: f64 = 1e-3;

/// Shortest piece, relative to the same: a kink may lie in it.
const LEAST: f64 = 1e-6;

/// Roundings of a displacement that a penetration may have: those of y and x, and of the sums that x is.
const ROUNDINGS: f64 = 16.0 * f64::EPSILON;

/// Slowest approach, m/s, that errors are relative to, and that β is taken from: a particle that lies at its wall while the structure begins to move from
/// rest has hardly any, and Lankarani and Nikravesh's β of it would be a dashpot that nothing presses in.
const SLOWEST_M_PER_S: f64 = 1e-5;

/// Highest power of time by which a contact from rest may begin that its scale is computed from.
const MAX_ORDER: usize = 6;

/// A contact with a Hertz wall.
#[derive(Clone, Debug)]
pub(crate) struct Squeeze {
    law: Hertz,
    side: Sign,
    /// β, s/m.
    rate_s_per_m: f64,
    /// Whether it has just begun, and its scales may be others yet.
    is_new: bool,
    /// The largest speed so far, m/s.
    speed_m_per_s: f64,
    /// mM/(m + M) of particle and structure when it began, kg, and the duration of an elastic contact, s.
    reduced_kg: f64,
    duration_s: f64,
    touch: Time,
    contact: HertzContact,
    /// The force from the present instant on, inwards, N.
    pub force: Polynomial,
}

/// The piece that the forces of Hertz walls are cubics in.
#[derive(Clone, Debug)]
pub(crate) struct SqueezedPiece {
    pub length_s: f64,
    /// What is left of it, s; infinite where no force changes.
    pub left_s: f64,
    next_s: f64,
    /// It is not to be longer than this, s: what is cut off from a piece costs it the order of its end.
    most_s: f64,
    pub tolerance: f64,
}

impl Default for SqueezedPiece {
    fn default() -> Self {
        let [length_s, left_s, next_s, most_s] = [f64::INFINITY; 4];
        Self { length_s, left_s, next_s, most_s, tolerance: TOLERANCE }
    }
}

impl SqueezedPiece {
    /// Whether another one is to begin, of a run that ends after a time, s: where this one ends, or where it has just begun and is longer.
    pub fn is_over(&mut self, to_limit_s: f64) -> bool {
        self.most_s = to_limit_s;
        let is_too_long = self.left_s == self.length_s && self.left_s.is_finite() && self.left_s > to_limit_s;
        self.left_s <= 0.0 || is_too_long
    }
}

impl Squeeze {
    /// The force from the present instant on, along y − x, N.
    pub fn inwards(&self) -> Polynomial {
        -f64::from(self.side) * self.force
    }

    /// The elastic energy at a penetration, J.
    pub fn elastic_j(&self, depth_m: f64) -> f64 {
        0.4 * self.law.stiffness_n_per_m15 * depth_m.max(0.0).powf(2.5)
    }

    /// The force at a penetration and its rate, N, and its derivatives by both.
    pub fn law(&self, [depth_m, rate_m_per_s]: Depth) -> (f64, [f64; 2]) {
        let share = 1.0 + self.rate_s_per_m * rate_m_per_s;
        if depth_m <= 0.0 || share <= 0.0 {
            return (0.0, [0.0; 2]);
        }
        let root = self.law.stiffness_n_per_m15 * depth_m.sqrt();
        (root * depth_m * share, [1.5 * root * share, root * depth_m * self.rate_s_per_m])
    }

    /// Whether nothing has pressed it so far that is more than an error may be, since it began from rest. It then has no force: the error of a cubic
    /// would part the bodies while they hardly touch.
    pub fn is_faint(&self, tolerance: f64) -> bool {
        let contact = &self.contact;
        contact.approach_speed_m_per_s == 0.0 && contact.peak_force_n * self.duration_s <= self.allowed_n_s(tolerance)
    }

    /// What an error of the force may be over a piece, N·s.
    pub fn allowed_n_s(&self, tolerance: f64) -> f64 {
        tolerance * self.reduced_kg * self.speed_m_per_s
    }
}

impl Motion {
    /// A particle begins to press into a wall. The speed that it approaches with: of a Hertz wall 0 where it begins from rest.
    pub(crate) fn begin_pressing(&mut self, damper: usize, side: Sign, approach_speed_m_per_s: f64) -> f64 {
        self.contacts.touches[damper] = Touch::Pressing(side);
        let WallLaw::Hertz(law) = *self.mount.cavities[damper].wall(side) else { return approach_speed_m_per_s };
        let (touch_s, none) = (self.time.seconds(), 0.0);
        // One that is slower begins from rest: its speed may be rounding.
        let approach_speed_m_per_s =
            if approach_speed_m_per_s < SLOWEST_M_PER_S { none } else { approach_speed_m_per_s };
        let contact = HertzContact {
            touch_s,
            damper,
            side,
            approach_speed_m_per_s,
            separation_speed_m_per_s: none,
            duration_s: none,
            peak_force_n: none,
        };
        self.squeezes[damper] = Some(Squeeze {
            law,
            side,
            rate_s_per_m: 0.0,
            is_new: true,
            speed_m_per_s: 0.0,
            reduced_kg: 0.0,
            duration_s: 0.0,
            touch: self.time,
            contact,
            force: Polynomial::default(),
        });
        approach_speed_m_per_s
    }

    /// The contact of a particle with a Hertz wall, which ends now; `None` of another wall, and where nothing has pressed.
    pub(crate) fn end_contact(&mut self, damper: usize) -> Option<HertzContact> {
        let squeeze = self.squeezes[damper].take()?;
        if squeeze.is_faint(self.piece.tolerance) {
            return None;
        }
        let Squeeze { side, touch, contact, .. } = squeeze;
        let separation_speed_m_per_s = -signed(side, self.offset(damper).1);
        Some(HertzContact { duration_s: self.time.since(touch), separation_speed_m_per_s, ..contact })
    }

    /// The contacts with Hertz walls that last now, with their durations and largest forces so far; without a speed of separation.
    pub fn hertz_contacts(&self) -> impl Iterator<Item = HertzContact> {
        let of = |squeeze: &Squeeze| HertzContact {
            duration_s: self.time.since(squeeze.touch),
            peak_force_n: squeeze.contact.peak_force_n.max(squeeze.force.value),
            ..squeeze.contact
        };
        self.squeezes.iter().flatten().map(of)
    }

    /// The force on a particle in a Hertz wall in the present state, along y − x, N.
    pub(crate) fn squeezed_n(&self, particle: usize) -> f64 {
        let Some(squeeze) = &self.squeezes[particle] else { return 0.0 };
        let (offset, slide) = self.offset(particle);
        let end = self.mount.cavities[particle].end(squeeze.side);
        let depth = [signed(squeeze.side, offset) - end, signed(squeeze.side, slide)];
        -signed(squeeze.side, squeeze.law(depth).0)
    }

    /// Forces as a piece begins, before those that change are found: 0, and constant ones of particles that friction holds. Whether any changes.
    pub(crate) fn hold_forces(&mut self) -> bool {
        let mut changes = false;
        for particle in 0..self.squeezes.len() {
            let force_n = self.squeezed_n(particle).abs();
            let is_stuck = self.contacts.slides[self.mount.joint_of(particle)] == Slide::Stuck;
            if let Some(squeeze) = &mut self.squeezes[particle] {
                changes |= !is_stuck;
                squeeze.contact.peak_force_n = squeeze.contact.peak_force_n.max(force_n);
                squeeze.force = Polynomial::constant(if is_stuck { force_n } else { 0.0 });
            }
        }
        (self.piece.length_s, self.piece.left_s) = (f64::INFINITY, f64::INFINITY);
        changes
    }

    /// The next piece: its length, and its forces. The natural motions are those without them.
    pub(crate) fn squeeze(&mut self) {
        self.scale_contacts();
        let system = &self.systems[self.system];
        let sliding: Few<Sliding> = system.pushes.iter().filter_map(|pushed| self.sliding(system, pushed)).collect();
        let scaled = |share: f64| sliding.iter().map(|of| share * of.squeeze.duration_s).fold(f64::INFINITY, f64::min);
        let least_s = scaled(LEAST);
        let first_s = if sliding.iter().any(|of| of.squeeze.is_new) { scaled(FIRST) } else { f64::INFINITY };
        let wanted_s = self.piece.next_s.min(system.length_s(0)).min(first_s).max(least_s);
        let mut length_s = wanted_s.min(self.piece.most_s);
        let (found, next_s) = loop {
            let moved = self.moved(system, &sliding, length_s);
            let found = self.forces(&sliding, &moved, length_s);
            // The length at which the error is the largest one that is allowed; it grows with its fifth power.
            let fits = |(powers, error): &(Vec<Powers>, f64)| {
                let share = 0.9 * error.powf(-0.2);
                (*error <= 1.0 || length_s <= least_s).then(|| (powers.clone(), length_s * share.clamp(0.2, 3.0)))
            };
            if let Some(found) = found.as_ref().and_then(fits) {
                break found;
            }
            if length_s <= least_s {
                // Without a solution the forces of the start.
                let now = sliding.iter().zip(&moved.alone).map(|(of, depths)| of.squeeze.law(depths[BEGIN]).0);
                break (now.map(|force| [force, 0.0, 0.0, 0.0]).collect(), length_s);
            }
            let share = found.map_or(0.25, |(_, error)| (0.9 * error.powf(-0.2)).clamp(0.1, 0.7));
            length_s = (share * length_s).max(least_s);
        };
        let starts: Few<(usize, f64)> = sliding.iter().map(|of| (of.particle, self.depth(of, 0.0)[1])).collect();
        drop(sliding);
        for ((particle, rate_m_per_s), powers) in starts.into_iter().zip(found) {
            if let Some(squeeze) = &mut self.squeezes[particle] {
                squeeze.speed_m_per_s = squeeze.speed_m_per_s.max(rate_m_per_s.abs());
                let [c0, c1, c2, c3] = powers;
                squeeze.force =
                    Polynomial::of_powers([c0, c1 / length_s, c2 / length_s.powi(2), c3 / length_s.powi(3)]);
            }
        }
        // One that the end of the run made shorter tells little of the next.
        let next_s = if length_s == self.piece.most_s { next_s.max(wanted_s) } else { next_s };
        (self.piece.length_s, self.piece.left_s, self.piece.next_s) = (length_s, length_s, next_s);
    }

    fn sliding<'a>(&'a self, system: &'a System, pushed: &'a Pushed) -> Option<Sliding<'a>> {
        let squeeze = self.squeezes[pushed.particle].as_ref()?;
        let guard = &system.guards[pushed.guard?];
        let own = guard.polynomial(system, &self.rest, self.base_cubic);
        Some(Sliding {
            particle: pushed.particle,
            mass_kg: self.mount.cavities[pushed.particle].mass,
            guard,
            natural: &pushed.push.natural,
            squeeze,
            is_faint: squeeze.is_faint(self.piece.tolerance),
            polynomial: guard.with_flight(&self.free, own),
            rounding_m: ROUNDINGS * guard.scale(&self.free),
        })
    }

    /// δ and δ′ under the present natural motions.
    fn depth(&self, of: &Sliding, after_s: f64) -> Depth {
        let rates = &self.systems[self.system].linear.natural.rates;
        let z: Few<C64> = self.z.iter().zip(rates).map(|(z, rate)| z * (rate * after_s).exp()).collect();
        let here = of.guard.guard.at(&z, z.len(), of.polynomial.at(after_s));
        [here.value, here.slope]
    }

    /// The scales of contacts that begin, and their β; of a contact that nothing has pressed yet, anew.
    ///
    /// The approach speed of the law of dissipation is at least the speed that the other forces alone give the particle within the
    /// duration of a contact: a particle that is laid on its wall has no approach speed of its own.
    fn scale_contacts(&mut self) {
        let system = &self.systems[self.system];
        let now = Now { z: &self.z, rates: &system.linear.natural.rates, roundings: &self.roundings };
        let mut scales: Few<(usize, f64, f64)> = Few::new();
        for pushed in &system.pushes {
            // What presses it may begin to move later than it lies at its wall.
            let has_no_scale = |of: &Sliding| of.squeeze.is_new || of.squeeze.speed_m_per_s <= SLOWEST_M_PER_S;
            let Some(of) = self.sliding(system, pushed).filter(has_no_scale) else { continue };
            let reduced = 1.0 / (1.0 / of.mass_kg + pushed.push.compliance);
            let mut factorial = 1.0;
            // δ = d tⁿ reaches k √δ t² = m at t = (m/(k √d))^(2/(n + 4)), and has there the speed d tⁿ⁻¹.
            let mut speed = |order: usize| {
                factorial *= order as f64;
                let d = of.guard.derivative(&now, of.polynomial, order).value.abs() / factorial;
                if d == 0.0 {
                    return 0.0;
                }
                let ratio = reduced / (of.squeeze.law.stiffness_n_per_m15 * d.sqrt());
                d * ratio.powf(2.0 * (order - 1) as f64 / (order + 4) as f64)
            };
            let approach = self.depth(&of, 0.0)[1].max(0.0);
            let speed = (2..=MAX_ORDER).map(&mut speed).fold(approach, f64::max);
            scales.push((of.particle, speed.max(SLOWEST_M_PER_S), reduced));
        }
        for (particle, speed, reduced) in scales {
            if let Some(squeeze) = &mut self.squeezes[particle] {
                squeeze.rate_s_per_m = squeeze.law.rate_s_per_m(speed);
                (squeeze.speed_m_per_s, squeeze.reduced_kg) = (speed, reduced);
                squeeze.duration_s = squeeze.law.elastic_duration_s(reduced, speed);
            }
        }
    }

    /// Takes the forces of a step of this length, which is judged: their largest values, and their courses from its end on.
    pub(crate) fn pass_forces(&mut self, length_s: f64) {
        let system = &self.systems[self.system];
        if system.pushes.is_empty() {
            return;
        }
        self.piece.left_s -= length_s;
        let mut largest: Few<(usize, f64)> = Few::new();
        for pushed in &system.pushes {
            let Some(of) = self.sliding(system, pushed) else { continue };
            let Polynomial { slope, bend, jerk, .. } = of.squeeze.force;
            // Where the cubic is largest: 0 = slope + bend t + jerk t²/2.
            let root = (bend * bend - 2.0 * jerk * slope).max(0.0).sqrt();
            let t = 2.0 * slope / (root - bend);
            let near = 0.999 * of.squeeze.contact.peak_force_n;
            if t > 0.0 && t < length_s && of.squeeze.force.at(t).value > near {
                largest.push((of.particle, of.squeeze.law(self.depth(&of, t)).0));
            }
        }
        for (particle, force_n) in largest {
            if let Some(squeeze) = &mut self.squeezes[particle] {
                squeeze.contact.peak_force_n = squeeze.contact.peak_force_n.max(force_n);
            }
        }
        for squeeze in self.squeezes.iter_mut().flatten() {
            // Events of one instant follow each other until all joints have their directions.
            squeeze.is_new &= length_s <= LEAST * squeeze.duration_s;
            squeeze.force = squeeze.force.after(length_s);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ImpactDamper, Mode, Modes, Observer, SetUp, State};
    use damprig_core::integrator::exact::Excitation;
    use damprig_core::model::{Cavity, Dissipation, Particle, Wall};

    #[derive(Default)]
    struct Count(u32);

    impl Observer for Count {
        fn contact(&mut self, _: &HertzContact) {
            self.0 += 1;
        }
    }

    /// The state after some ten contacts in half a second, and how many.
    fn run(tolerance: f64, law: Dissipation) -> (State, u32) {
        let mode = |omega: f64, shape: [f64; 2]| Mode {
            angular_frequency_rad_per_s: omega,
            damping_ratio: 0.01,
            shape: shape.to_vec(),
            participation: 1.0,
        };
        let structure = Modes {
            modes: vec![mode(16.0, [0.8, 0.3]), mode(120.0, [0.4, -0.6])],
            influence: vec![1.0; 2],
            coupling_per_s: Vec::new(),
        };
        let wall = Wall::Hertz(Hertz { stiffness_n_per_m15: 3e6, dissipation: law });
        let cavity = Cavity::default();
        let particle = Particle { mass_kg: 0.16, clearance_m: 3e-3, friction_coefficient: 0.02, wall, cavity };
        let dampers = [0, 1].map(|place| ImpactDamper::new(place, particle)).to_vec();
        let set_up = SetUp { impact_dampers: dampers, ..SetUp::bare(structure) };
        let sine = Excitation::Sine { amplitude_m: 3e-3, angular_frequency_rad_per_s: 15.0, phase_rad: 0.3 };
        let mut motion = Motion::new(&set_up, &sine, &set_up.at_rest(crate::base_at_start(&sine))).expect("it starts");
        motion.piece.tolerance = tolerance;
        let mut count = Count::default();
        motion.run(0.5, &mut count).expect("it goes on");
        (motion.state(), count.0)
    }

    #[test]
    fn tighter_limits_change_the_motion_by_less_than_the_stated_error() {
        for law in [
            Dissipation::HuntCrossley { coefficient_s_per_m: 0.8 },
            Dissipation::LankaraniNikravesh { coefficient: 0.7 },
        ] {
            let apart = |(a, b): (&State, &State)| {
                let modal = a.modal.iter().zip(&b.modal).map(|(a, b)| a - b);
                let bodies = a.particles.iter().zip(&b.particles).map(|(a, b)| a.y_m - b.y_m);
                modal.chain(bodies).fold(0.0, |most: f64, off| most.max(off.abs()))
            };
            let (stated, contacts) = run(TOLERANCE, law);
            let (tighter, looser) = (run(0.01 * TOLERANCE, law).0, run(1e4 * TOLERANCE, law).0);
            let off = apart((&stated, &tighter));
            // Each contact carries on what those before are off by, here at most tenfold.
            assert!(contacts >= 4 && off < 1e-9 * 3e-3 * 10.0 * f64::from(contacts), "{contacts} contacts, {off:e}");
            assert!(apart((&stated, &looser)) > 100.0 * off, "the limit acts");
        }
    }
}
