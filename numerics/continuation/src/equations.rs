//! The equations of motion of a system in each mode, with its guards and resets, without units.

use damprig_core::integrator::exact::Touch;
use damprig_core::integrator::modes::{Contact, Grip, Sign};
use damprig_core::model::Release;

use crate::dual::Real;
use crate::flow::place::{COSINE, OFFSET, ONE, PHASE, SINE, SLIDE, V, X};
use crate::flow::{N, STATE, Square, Vector, row_times};
use crate::sequence::{Guard, Phase};
use crate::wall_law::{WallLaw, of};

/// The equations of motion, guards and resets at one value of the parameters, without units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Equations<T> {
    pub(crate) stiffness: T,
    pub(crate) damping: T,
    pub(crate) mass: T,
    pub(crate) clearance: T,
    pub(crate) friction_acceleration: T,
    /// Acceleration of a free particle by its weight, along −y.
    pub(crate) weight: T,
    pub(crate) walls: [WallLaw<T>; 2],
    pub(crate) damper_force: T,
    pub(crate) base_amplitude: T,
    pub(crate) force_amplitude: T,
    pub(crate) turning: T,
    pub(crate) has_second_mass: bool,
    pub(crate) has_tmd: bool,
}

impl<T: Real> Equations<T> {
    fn signed(side: Sign, value: T) -> T {
        match side {
            1.. => value,
            0 => T::of(0.0),
            _ => -value,
        }
    }

    /// Force between structure and second mass by spring and dashpot, on the structure, as a row.
    fn joint(&self, phase: &Phase) -> Vector<T> {
        let mut row = [T::of(0.0); N];
        let (side, rest) = match phase.touch {
            _ if self.has_tmd => (-1, T::of(0.0)),
            Touch::Pressing(side) => (side, Self::signed(side, self.clearance)),
            Touch::Clear | Touch::Leaving(_) => return row,
        };
        let WallLaw { stiffness, damping, .. } = self.walls[of(side)];
        row[OFFSET] = stiffness;
        row[SLIDE] = damping;
        row[ONE] = -(stiffness * rest);
        row
    }

    fn is_held(phase: &Phase) -> bool {
        matches!(phase.contact, Contact::Held(_))
    }

    fn moving_mass(&self, phase: &Phase) -> T {
        if Self::is_held(phase) { T::of(1.0) + self.mass } else { T::of(1.0) }
    }

    /// Force of the sliding particle's friction on the structure, or of a held particle's weight.
    fn drag(&self, phase: &Phase) -> T {
        match phase.contact {
            Contact::Free(direction) => Self::signed(direction, self.mass * self.friction_acceleration),
            Contact::Held(_) => -(self.mass * self.weight),
            Contact::Absent => T::of(0.0),
        }
    }

    /// Every force on the structure but that of the friction damper, as a row.
    fn force(&self, phase: &Phase) -> Vector<T> {
        let mut row = [T::of(0.0); N];
        if !Self::is_held(phase) {
            row = self.joint(phase);
        }
        row[X] = row[X] - self.stiffness;
        row[V] = row[V] - self.damping;
        row[SINE] = self.stiffness * self.base_amplitude + self.force_amplitude;
        row[COSINE] = self.damping * self.turning * self.base_amplitude;
        row[ONE] = row[ONE] + self.drag(phase);
        row
    }

    /// x″ as a row.
    fn acceleration(&self, phase: &Phase) -> Vector<T> {
        let resistance = match phase.grip {
            Grip::Stuck => {
                let mut row = [T::of(0.0); N];
                row[SINE] = -(self.turning * self.turning * self.base_amplitude);
                return row;
            }
            Grip::Slip(direction) => Self::signed(direction, self.damper_force),
            Grip::Absent => T::of(0.0),
        };
        let mut row = self.force(phase);
        row[ONE] = row[ONE] - resistance;
        let mass = self.moving_mass(phase);
        row.map(|entry| entry / mass)
    }

    /// The matrix A of w′ = A w.
    pub(crate) fn matrix(&self, phase: &Phase) -> Square<T> {
        let (zero, one) = (T::of(0.0), T::of(1.0));
        let mut a = [[zero; N]; N];
        a[X][V] = one;
        a[V] = self.acceleration(phase);
        a[PHASE][ONE] = self.turning;
        a[SINE][COSINE] = self.turning;
        a[COSINE][SINE] = -self.turning;
        let slides = self.has_tmd || matches!(phase.contact, Contact::Free(_));
        if slides {
            a[OFFSET][SLIDE] = one;
            let joint = self.joint(phase);
            for n in 0..N {
                a[SLIDE][n] = -a[V][n] - joint[n] / self.mass;
            }
            if let Contact::Free(direction) = phase.contact {
                let friction = Self::signed(direction, self.friction_acceleration);
                a[SLIDE][ONE] = a[SLIDE][ONE] - friction - self.weight;
            }
        }
        a
    }

    /// A guard as a row: positive while its mode lasts, zero at its event.
    pub(crate) fn guard(&self, phase: &Phase, guard: Guard) -> Vector<T> {
        let (zero, one) = (T::of(0.0), T::of(1.0));
        let mut row = [zero; N];
        match guard {
            Guard::Wall(side) => {
                row[OFFSET] = -Self::signed(side, one);
                row[ONE] = self.clearance;
            }
            Guard::Inside(side) => {
                row[OFFSET] = Self::signed(side, one);
                row[ONE] = -self.clearance;
            }
            Guard::LetGo(side) => {
                row[OFFSET] = Self::signed(side, one);
                row[ONE] = -self.clearance;
                if self.walls[of(side)].release == Some(Release::ZeroForce) {
                    row = self.joint(phase).map(|entry| Self::signed(side, entry));
                }
            }
            Guard::SlideStops(direction) => row[SLIDE] = Self::signed(direction, one),
            Guard::SlipStops(direction) => {
                row[V] = Self::signed(direction, one);
                row[COSINE] = -Self::signed(direction, self.turning * self.base_amplitude);
            }
            Guard::HoldBreaks(direction) => {
                // The particle lags (−1) where x″ exceeds what friction and wall transmit; it leads (+1) where x″ is below.
                let acceleration = self.acceleration(phase);
                let joint = self.joint(phase);
                for n in 0..N {
                    row[n] = Self::signed(direction, acceleration[n] + joint[n] / self.mass);
                }
                row[ONE] = row[ONE] + Self::signed(direction, self.weight) + self.friction_acceleration;
            }
            Guard::GripBreaks(direction) => {
                // The damper must supply M z″ − the other forces.
                let force = self.force(phase);
                let inertia = self.moving_mass(phase) * self.turning * self.turning * self.base_amplitude;
                for n in 0..N {
                    row[n] = -Self::signed(direction, force[n]);
                }
                // While stuck, x′ − z′ is zero: without the dashpot's terms.
                (row[V], row[COSINE]) = (zero, zero);
                row[SINE] = row[SINE] - Self::signed(direction, inertia);
                row[ONE] = row[ONE] + self.damper_force;
            }
            Guard::Turn(turns) => {
                row[PHASE] = -one;
                row[ONE] = T::of(std::f64::consts::TAU * f64::from(turns));
            }
        }
        row
    }

    /// The state after the event `guard` at which `next` begins, from the completed state `before` it.
    /// The rows are linear about that state: they give its image and the derivative there.
    pub(crate) fn reset(&self, guard: Guard, next: &Phase, before: &Vector<T>) -> [Vector<T>; STATE] {
        let (zero, one) = (T::of(0.0), T::of(1.0));
        let mut rows = [[zero; N]; STATE];
        for (n, row) in rows.iter_mut().enumerate() {
            row[n] = one;
        }
        if !self.has_second_mass {
            (rows[OFFSET], rows[SLIDE]) = ([zero; N], [zero; N]);
        }
        match guard {
            Guard::Wall(side) if self.walls[of(side)].release.is_none() => {
                let (steep, falls) = self.walls[of(side)].restitution(before[SLIDE]);
                let rest = falls * before[SLIDE];
                let share = self.mass / (one + self.mass);
                (rows[V][SLIDE], rows[V][ONE]) = ((one + steep) * share, rest * share);
                (rows[SLIDE][SLIDE], rows[SLIDE][ONE]) = (-steep, -rest);
            }
            Guard::SlideStops(_) | Guard::HoldBreaks(_) => rows[SLIDE] = [zero; N],
            _ => {}
        }
        let wall = match (guard, next.contact) {
            (Guard::Wall(side) | Guard::Inside(side), _) | (_, Contact::Held(side)) if side != 0 => side,
            (Guard::LetGo(side), _) if self.walls[of(side)].release == Some(Release::ZeroPenetration) => side,
            _ => 0,
        };
        if wall != 0 {
            rows[OFFSET] = [zero; N];
            rows[OFFSET][ONE] = Self::signed(wall, self.clearance);
        }
        if matches!(next.contact, Contact::Held(_)) {
            rows[SLIDE] = [zero; N];
        }
        if next.grip == Grip::Stuck || matches!(guard, Guard::SlipStops(_) | Guard::GripBreaks(_)) {
            rows[V] = [zero; N];
            rows[V][COSINE] = self.turning * self.base_amplitude;
        }
        rows
    }

    /// The state after a chatter that ended, from the state at that instant: the particle rests on the wall, and the centre of mass
    /// of both bodies and their momentum are kept, but for the dashpot's impulse over the distance by which the structure moves. The
    /// impacts are ever slower, so that a shift of the end has no effect.
    pub(crate) fn rest(&self, next: &Phase) -> [Vector<T>; STATE] {
        let share = self.mass / (T::of(1.0) + self.mass);
        let mut rows = self.reset(Guard::Turn(0), next, &[T::of(0.0); N]);
        (rows[X][OFFSET], rows[V][SLIDE]) = (share, share);
        rows[V][OFFSET] = -(share * self.damping / (T::of(1.0) + self.mass));
        (rows[OFFSET], rows[SLIDE]) = ([T::of(0.0); N], [T::of(0.0); N]);
        rows
    }

    /// The state soon after a small disturbance in a mode: where friction holds bodies together, it does so again, with their
    /// momentum.
    pub(crate) fn regain(&self, phase: &Phase) -> [Vector<T>; STATE] {
        let mut rows = self.reset(Guard::Turn(0), phase, &[T::of(0.0); N]);
        if Self::is_held(phase) && phase.grip != Grip::Stuck {
            rows[V][SLIDE] = self.mass / (T::of(1.0) + self.mass);
        }
        rows
    }

    /// Derivative of a guard along the motion, as a row.
    pub(crate) fn rate(&self, row: &Vector<T>, phase: &Phase) -> Vector<T> {
        row_times(row, &self.matrix(phase))
    }
}
