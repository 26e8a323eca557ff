//! Energy of a motion: what the base and forces put in, what each mechanism takes, and what is stored.
//!
//! The book is kept in coordinates relative to the base, in which the base's acceleration is a load on every mass, and is then stated for
//! absolute velocities: the difference of both is a function of the state. Every term is an integral in closed form over the pieces of the
//! motion, computed apart from the others, so that what does not balance shows ([`Balance::residual_j`]).

use damprig_core::analysis::energy::Balance;
use damprig_core::integrator::modes::signed;

use crate::contacts::{Slide, Touch};
use crate::course::Course;
use crate::linear::C64;
use crate::motion::Motion;
use crate::mount::WallLaw;
use crate::observe::{Impact, Observer, Parts, Piece};
use crate::polynomial::Polynomial;
use crate::squeeze::Squeeze;

/// The energy book of a motion.
#[derive(Clone, Debug)]
pub struct EnergyBook {
    /// Work on the masses in coordinates relative to the base, J.
    relative_input_j: f64,
    balance: Balance,
    at_start: Stored,
    /// z′ at the end of the last piece, m/s.
    base_rate_m_per_s: f64,
    /// What the particles touched in the last piece.
    touches: Vec<Touch>,
}

/// Energy in motion, in springs and in weights.
#[derive(Clone, Copy, Debug, Default)]
struct Stored {
    /// With velocities relative to the base, J.
    relative_j: f64,
    /// With absolute velocities, J.
    absolute_j: f64,
}

impl Stored {
    fn of(motion: &Motion) -> Self {
        let (q, v) = motion.bodies();
        let (mount, (z, rate)) = (&motion.mount, motion.base());
        let bodies = &mount.bodies;
        let square = |values: &[f64], factors: &[f64]| -> f64 {
            0.5 * values.iter().zip(factors).map(|(value, factor)| factor * value * value).sum::<f64>()
        };
        let along = |row: &[f64]| row.iter().zip(&q).map(|(row, q)| row * q).sum::<f64>();
        let mut springs = square(&q, &bodies.stiffness);
        springs += bodies.links.iter().map(|link| 0.5 * link.stiffness * along(&link.row).powi(2)).sum::<f64>();
        let (mut of_weights, mut of_base) = (0.0, 0.0);
        for (n, cavity) in mount.cavities.iter().enumerate() {
            of_weights += cavity.weight_n * q[mount.permanent + n];
            of_base += cavity.weight_n * cavity.influence * z;
            let Touch::Pressing(side) = motion.contacts.touches[n] else { continue };
            let penetration_m = signed(side, along(mount.offset_row(n)) - cavity.wall_at(side));
            springs += match *cavity.wall(side) {
                WallLaw::Hard(_) => 0.0,
                WallLaw::Hertz(_) => {
                    motion.squeezes[n].as_ref().map_or(0.0, |squeeze| squeeze.elastic_j(penetration_m))
                }
                WallLaw::Soft { stiffness, .. } => 0.5 * stiffness * penetration_m.powi(2),
                WallLaw::Piezoelectric(wall) => wall.pressed_energy_j(penetration_m, q[wall.charge]),
            };
        }
        let relative_j = square(&v, &bodies.mass) + springs + of_weights;
        let momentum: f64 = bodies.inertia.iter().zip(&v).map(|(inertia, v)| inertia * v).sum();
        let of_motion = rate * momentum + 0.5 * motion.moving_mass_kg() * rate * rate;
        Self { relative_j, absolute_j: relative_j + of_motion + of_base }
    }
}

impl EnergyBook {
    /// An empty book of a motion that is observed from now on; `None` where a friction damper acts against a base that moves it otherwise than its
    /// place, whose work while it sticks is not in the book.
    #[must_use]
    pub fn new(motion: &Motion) -> Option<Self> {
        let mount = &motion.mount;
        let dampers = &mount.joints[..mount.joint_of(0)];
        dampers.iter().all(|joint| joint.influence == 0.0).then(|| Self {
            relative_input_j: 0.0,
            balance: Balance::default(),
            at_start: Stored::of(motion),
            base_rate_m_per_s: motion.base().1,
            touches: motion.contacts.touches.clone(),
        })
    }

    /// The balance up to where the motion is now. `link_damping_j` is that of soft and Hertz walls, tuned masses and the loads of piezoelectric walls; what
    /// these store is stored.
    #[must_use]
    pub fn balance(&self, motion: &Motion) -> Balance {
        let (now, start) = (Stored::of(motion), self.at_start);
        let stored_change_j = now.absolute_j - start.absolute_j;
        let of_base = stored_change_j - (now.relative_j - start.relative_j);
        let input_j = self.relative_input_j + of_base;
        let residual_j = input_j - self.balance.dissipated_j() - stored_change_j;
        Balance { input_j, stored_change_j, residual_j, ..self.balance }
    }
}

/// What a piece moves, along rows over all bodies.
struct Rows<'p> {
    parts: Parts<'p>,
    piece: &'p Piece<'p>,
}

impl Rows<'_> {
    /// The rate of `row · q`, q relative to the base.
    fn rate(&self, row: &[f64]) -> Course {
        let Parts { mount, system, rest, free, .. } = self.parts;
        let own: Vec<f64> = system.members.iter().map(|&i| row[i]).collect();
        let signal = system.linear.displacement(&own);
        let mut rate = self.piece.course(&signal.coefficients, signal.polynomial(rest)).rate();
        for (&n, flight) in system.free.iter().zip(free) {
            let (share, influence) = (row[mount.permanent + n], mount.cavities[n].influence);
            if share != 0.0 {
                let flown = Course::new(std::iter::empty(), share * flight.polynomial().rate(), self.piece.length_s);
                let of_base = self.piece.base().rate().with_rate(share * influence, 0.0, 0.0);
                rate = rate.minus(&flown.with_rate(-1.0, 0.0, 0.0)).minus(&of_base);
            }
        }
        rate
    }

    /// Force of the Hertz wall that a particle presses into, N, and the penetration, m.
    fn squeezed(&self, particle: usize) -> Option<(&Squeeze, Course, Course)> {
        let squeeze = self.parts.squeezes[particle].as_ref()?;
        let side = self.piece.pressed_side(particle)?;
        let offset = self.piece.particle(particle).minus(&self.piece.place_of_cavity(particle));
        let depth = offset.with_rate(f64::from(side), 0.0, -self.parts.mount.cavities[particle].end(side));
        Some((squeeze, self.piece.wall_force_n(particle)?, depth))
    }

    /// Change of `row · q` over the piece, of a row without influence.
    fn change(&self, row: &[f64]) -> f64 {
        let Parts { mount, system, rest, free, .. } = self.parts;
        let own: Vec<f64> = system.members.iter().map(|&i| row[i]).collect();
        let signal = system.linear.displacement(&own);
        let moved = self.piece.course(&signal.coefficients, signal.polynomial(rest));
        let over = |course: &Course| course.at(self.piece.length_s).0 - course.at(0.0).0;
        let flown = system.free.iter().zip(free).map(|(&n, flight)| {
            let influence = mount.cavities[n].influence;
            let flown = Course::new(std::iter::empty(), flight.polynomial(), self.piece.length_s);
            row[mount.permanent + n] * (over(&flown) - influence * over(&self.piece.base()))
        });
        over(&moved) + flown.sum::<f64>()
    }
}

impl Observer for EnergyBook {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        let parts = piece.parts;
        let Parts { mount, system, z, end, base, .. } = parts;
        let rows = Rows { parts, piece };
        let bodies = &mount.bodies;
        let relative_momentum = rows.rate(&bodies.inertia);
        // Where the base's velocity jumps, absolute velocities go on.
        let base_rate = piece.base().rate();
        let jump = base_rate.at(0.0).0 - self.base_rate_m_per_s;
        if jump != 0.0 {
            let whole_kg: f64 =
                bodies.inertia.iter().zip(bodies.divisors()).map(|(inertia, mass)| inertia * inertia / mass).sum();
            self.relative_input_j -= jump * (relative_momentum.at(0.0).0 + 0.5 * jump * whole_kg);
        }
        self.base_rate_m_per_s = base_rate.at(piece.length_s).0;
        // Loads Re(F̂ W) of the wave, and of the base's cubic.
        let wave = system.linear.natural.wave;
        if z[wave] != C64::ZERO {
            let of = |part: C64| {
                let term = (part * z[wave], part * end[wave], system.linear.natural.rates[wave]);
                Course::new(std::iter::once(term), Polynomial::default(), piece.length_s)
            };
            let real: Vec<f64> = mount.force.iter().map(|force| force.re).collect();
            let imaginary: Vec<f64> = mount.force.iter().map(|force| -force.im).collect();
            for (row, part) in [(real, C64::ONE), (imaginary, C64::new(0.0, -1.0))] {
                if row.iter().any(|force| *force != 0.0) {
                    self.relative_input_j += rows.rate(&row).product_m2_s(&of(part));
                }
            }
        }
        if !base.is_constant() {
            let acceleration = Course::new(std::iter::empty(), base.rate().rate(), piece.length_s);
            self.relative_input_j -= relative_momentum.product_m2_s(&acceleration);
        }
        self.take_dashpots(&rows);
        self.take_friction(&rows);
    }

    fn impact(&mut self, impact: &Impact) {
        self.balance.impacts_j += impact.lost_j;
    }
}

impl EnergyBook {
    fn take_dashpots(&mut self, rows: &Rows) {
        let Parts { mount, system, .. } = rows.parts;
        let bodies = &mount.bodies;
        let unit = |i: usize| -> Vec<f64> { (0..bodies.len()).map(|k| f64::from(u8::from(k == i))).collect() };
        let rates: Vec<Course> = (0..mount.modes).map(|i| rows.rate(&unit(i))).collect();
        for (i, rate) in rates.iter().enumerate() {
            self.balance.structure_damping_j += bodies.damping[i] * rate.square_m2_s();
            if !bodies.coupling.is_empty() {
                for (k, other) in rates.iter().enumerate() {
                    let coupling = bodies.coupling[i * mount.modes + k];
                    if coupling != 0.0 {
                        self.balance.structure_damping_j += coupling * rate.product_m2_s(other);
                    }
                }
            }
        }
        for link in &bodies.links {
            self.balance.link_damping_j += link.damping * rows.rate(&link.row).square_m2_s();
        }
        for (.., wall) in mount.piezoelectric_walls() {
            self.balance.link_damping_j += bodies.damping[wall.charge] * rows.rate(&unit(wall.charge)).square_m2_s();
        }
        for (n, touch) in system.contacts.touches.iter().enumerate() {
            if let Touch::Pressing(side) = *touch
                && let WallLaw::Soft { damping, .. } = *mount.cavities[n].wall(side)
            {
                self.balance.link_damping_j += damping * rows.rate(mount.offset_row(n)).square_m2_s();
            }
            if let Some((squeeze, force, depth)) = rows.squeezed(n) {
                // The work on the wall, less what it stores.
                let stored_j = [0.0, rows.piece.length_s].map(|at_s| squeeze.elastic_j(depth.at(at_s).0));
                self.balance.link_damping_j += depth.rate().product_m2_s(&force) + stored_j[0] - stored_j[1];
            }
            // A wall that lets go before it is back takes what its spring has left.
            if let (Touch::Pressing(before), Touch::Leaving(side)) = (self.touches[n], *touch)
                && let WallLaw::Soft { stiffness, .. } = *mount.cavities[n].wall(before)
            {
                let offset = rows.piece.particle(n).at(0.0).0 - rows.piece.place_of_cavity(n).at(0.0).0;
                let pressed = signed(side, offset) - mount.cavities[n].end(side);
                self.balance.link_damping_j += 0.5 * stiffness * pressed * pressed;
            }
        }
        self.touches.clone_from(&system.contacts.touches);
    }

    fn take_friction(&mut self, rows: &Rows) {
        let Parts { mount, system, .. } = rows.parts;
        for (number, joint) in mount.joints.iter().enumerate() {
            if matches!(system.contacts.slides[number], Slide::Free(direction) if direction != 0) {
                let lost_j = joint.friction_n * rows.change(&joint.row).abs();
                match mount.particle_of(number) {
                    Some(_) => self.balance.internal_friction_j += lost_j,
                    None => self.balance.friction_damper_j += lost_j,
                }
            }
        }
    }
}
