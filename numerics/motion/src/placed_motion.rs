//! The dampers of a set-up on a structure with several places, moved by its base step by step as the sampled engine moves one degree of freedom.
//!
//! The motion is that of [`damprig_structures`]. Observers of the sampled engine see it as flights: Taylor's polynomials of x over parts of a step so
//! short that what they leave out is below [`NEGLECTED`] of the motion.

use std::sync::Arc;

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::modes::{Sign, signed};
use damprig_core::integrator::polynomial::{COEFFICIENTS, Polynomial, derivative};
use damprig_core::integrator::sampled::{self, Flight};
use damprig_core::io::{Invalid, require};
use damprig_core::model::{Initial, SetUp as OneDegree};
use damprig_structures::{
    Course, FrictionJoint, Impact, ImpactDamper, Modes, Motion, Observer, Piece, Refused, SetUp, State, TunedMass,
};

/// Share of the motion that a flight's polynomial may leave out.
const NEGLECTED: f64 = 1e-11;

/// Parts of a piece, at most.
const MAX_PARTS: u32 = 4096;

/// A structure with several places on a rig, and where the dampers of its set-ups are.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedStructure {
    /// Its modes at the places.
    pub structure: Modes,
    /// Number of the place whose displacement is x: where the sensor of x is, and where the structure is held before a release.
    pub observed: usize,
    /// Of the place of the impact damper.
    pub particle: usize,
    /// Of the place of the friction damper, and of its other end; `None`: the base.
    pub friction_damper: (usize, Option<usize>),
    /// Of the place of the tuned mass.
    pub tmd: usize,
}

impl PlacedStructure {
    /// The structure with the dampers of a set-up.
    #[must_use]
    pub fn with_dampers_of(&self, one: &OneDegree) -> SetUp {
        let (place, other) = self.friction_damper;
        let joint = |damper| FrictionJoint { place, other, damper };
        let particle = |particle| ImpactDamper::new(self.particle, particle);
        SetUp {
            impact_dampers: one.particle.map(particle).into_iter().collect(),
            // Without a force there is no damper.
            friction_dampers: one.friction_damper.filter(|it| it.force_n > 0.0).map(joint).into_iter().collect(),
            tuned_masses: one.tmd.map(|tmd| TunedMass { place: self.tmd, tmd }).into_iter().collect(),
            gravity_m_per_s2: one.gravity_m_per_s2,
            ..SetUp::bare(self.structure.clone())
        }
    }

    /// Everything at rest in the laboratory while the base has this displacement and velocity, m and m/s, but held at the observed place so that x is that of `initial`: the
    /// static deflection under a force there. The particle has its y − x.
    fn start(&self, set_up: &SetUp, initial: &Initial, base: (f64, f64)) -> State {
        let mut state = set_up.at_rest(base);
        let modes = &self.structure.modes;
        let of_force =
            |place: usize| modes.iter().map(move |mode| mode.shape[place] / (mode.angular_frequency_rad_per_s).powi(2));
        let per_force: f64 =
            modes.iter().zip(of_force(self.observed)).map(|(mode, q)| mode.shape[self.observed] * q).sum();
        if per_force > 0.0 {
            for (q, share) in state.modal.iter_mut().zip(of_force(self.observed)) {
                *q += initial.x_m * share / per_force;
            }
        }
        let [at_particle, at_tmd] = [self.particle, self.tmd].map(|place| set_up.place(&state, place, base).y_m);
        state.particles.iter_mut().for_each(|body| body.y_m = at_particle + initial.y_m - initial.x_m);
        state.tuned_masses.iter_mut().for_each(|body| body.y_m = at_tmd);
        state
    }
}

/// A set-up's dampers on a structure with several places, in motion.
#[derive(Clone, Debug)]
pub struct PlacedMotion {
    placed: Arc<PlacedStructure>,
    set_up: SetUp,
    step_s: f64,
    /// M of the set-up's structure of one degree of freedom, which forces and momenta are counted in.
    mass_kg: f64,
    initial: Initial,
    /// Force of the friction damper, N, if it was set.
    friction_n: Option<f64>,
    /// `None` before the first step: the base's first velocity is part of the start.
    motion: Option<Motion>,
    /// Whether the base's velocity may jump before the next step.
    jumps: bool,
    soft_walls: [Option<PlacedSoftWall>; 2],
    pressing: Option<Sign>,
    x_m: f64,
    refused: Option<Refused>,
}

impl PlacedMotion {
    /// `set_up` with its dampers on `placed`, in steps of `step_s` from `initial`.
    ///
    /// # Errors
    /// Names a value that cannot be simulated, or a force in place of a moving base.
    pub fn new(
        placed: &Arc<PlacedStructure>,
        set_up: &OneDegree,
        step_s: f64,
        initial: &Initial,
    ) -> Result<Self, Invalid> {
        let force = "left out: a structure with several places stands on a moving base";
        require(!set_up.is_force_driven, "force_amplitude_n", f64::NAN, force)?;
        let mut motion = Self {
            set_up: placed.with_dampers_of(set_up),
            placed: Arc::clone(placed),
            step_s,
            mass_kg: set_up.structure.mass_kg,
            initial: *initial,
            friction_n: None,
            motion: None,
            jumps: false,
            soft_walls: [-1, 1].map(|side| PlacedSoftWall::of(placed, set_up, side)),
            pressing: None,
            x_m: initial.x_m,
            refused: None,
        };
        // What is refused is refused now.
        motion.begin(&BaseSegment::at_rest(0.0))?;
        motion.restart(initial);
        Ok(motion)
    }

    /// Starts again, from `initial`.
    pub fn restart(&mut self, initial: &Initial) {
        (self.initial, self.x_m) = (*initial, initial.x_m);
        (self.motion, self.pressing, self.jumps, self.refused) = (None, None, false, None);
    }

    /// The same motion in steps of another length, s. The base's velocity may jump before the first one.
    pub fn set_step_s(&mut self, step_s: f64) {
        (self.step_s, self.jumps) = (step_s, true);
    }

    /// Sets the largest force of the friction damper, N, if there is one.
    pub fn set_friction_n(&mut self, force_n: f64) {
        if self.set_up.friction_dampers.is_empty() || self.friction_n == Some(force_n) {
            return;
        }
        self.friction_n = Some(force_n);
        if let Some(motion) = &mut self.motion {
            self.refused = self.refused.or(motion.set_friction_n(0, force_n).err());
        }
    }

    /// Displacement of the observed place, m.
    #[must_use]
    pub fn x_m(&self) -> f64 {
        self.x_m
    }

    /// Steps that were taken without the guards of a contact.
    #[must_use]
    pub fn unresolved(&self) -> u32 {
        self.motion.as_ref().map_or(0, Motion::unresolved)
    }

    /// Why the motion stands still since some step: its contacts led to one without a closed form.
    #[must_use]
    pub fn refused(&self) -> Option<Invalid> {
        self.refused.map(Invalid::from)
    }

    /// Mass of all that the base moves, per mass of the set-up's structure.
    #[must_use]
    pub fn mass(&self) -> f64 {
        self.motion.as_ref().map_or(1.0, |motion| motion.moving_mass_kg() / self.mass_kg)
    }

    /// Momentum of structure and dampers, per mass of the set-up's structure, in lengths per step.
    #[must_use]
    pub fn momentum(&self) -> f64 {
        self.motion.as_ref().map_or(0.0, |motion| self.counted(motion))
    }

    fn counted(&self, motion: &Motion) -> f64 {
        motion.momentum_kg_m_per_s() / self.mass_kg * self.step_s
    }

    /// The momentum after a step on this motion of the base, which is not made.
    pub fn momentum_after(&mut self, base: &BaseSegment<f64>) -> f64 {
        if self.refused.is_some() || self.begin(base).is_err() {
            return self.momentum();
        }
        let (powers, step_s) = (powers(base, self.step_s), self.step_s);
        let Some(mut motion) = self.motion.take() else { return 0.0 };
        let momentum = motion.tried(|motion| {
            let ran = motion.follow(powers).and_then(|()| motion.run(motion.time_s() + step_s, &mut ()));
            ran.map(|()| self.counted(motion))
        });
        self.motion = Some(motion);
        momentum.unwrap_or_else(|_| self.momentum())
    }

    /// Makes a step. A motion whose contacts lead to one without a closed form stands still ([`PlacedMotion::refused`]).
    pub fn step<O: sampled::SampledObserver<f64> + ?Sized>(&mut self, base: &BaseSegment<f64>, observer: &mut O) {
        if self.refused.is_none() {
            self.refused = self.try_step(base, observer).err();
        }
    }

    /// Puts the motion at its start, with the base where this step of it begins.
    fn begin(&mut self, base: &BaseSegment<f64>) -> Result<(), Refused> {
        if self.motion.is_none() {
            let powers = powers(base, self.step_s);
            let start = self.placed.start(&self.set_up, &self.initial, (powers[0], powers[1]));
            let mut motion = Motion::on_base(&self.set_up, powers, &start)?;
            if let Some(force_n) = self.friction_n {
                motion.set_friction_n(0, force_n)?;
            }
            self.motion = Some(motion);
        }
        Ok(())
    }

    fn try_step<O: sampled::SampledObserver<f64> + ?Sized>(
        &mut self,
        base: &BaseSegment<f64>,
        observer: &mut O,
    ) -> Result<(), Refused> {
        self.begin(base)?;
        let Some(motion) = &mut self.motion else { return Ok(()) };
        let powers = powers(base, self.step_s);
        if std::mem::take(&mut self.jumps) {
            motion.follow_jump(powers)?
        } else {
            motion.follow(powers)?
        }
        let start_s = motion.time_s();
        let mut relay = Relay {
            observer,
            placed: &self.placed,
            start_s,
            step_s: self.step_s,
            mass_kg: self.mass_kg,
            soft_walls: &self.soft_walls,
            pressing: &mut self.pressing,
            x_m: &mut self.x_m,
        };
        motion.run(start_s + self.step_s, &mut relay)
    }
}

/// A base segment over `step_s` as coefficients of the powers of time, m/sᵏ.
#[must_use]
pub fn powers(segment: &BaseSegment<f64>, step_s: f64) -> [f64; 4] {
    let [c0, c1, c2, c3] = segment.0;
    [c0, c1 / step_s, c2 / (step_s * step_s), c3 / (step_s * step_s * step_s)]
}

/// A soft wall.
#[derive(Clone, Copy, Debug)]
struct PlacedSoftWall {
    side: Sign,
    /// Distance from y = x towards its side, m.
    end_m: f64,
    stiffness_n_per_m: f64,
    damping_n_s_per_m: f64,
    /// A flight in contact is as long at most, s: observers take the force at its ends.
    longest_s: f64,
}

/// Radians of a contact with a soft wall in a flight, as in the sampled engine: its ends have the peak of the force within 3·10⁻⁴.
const RADIANS_IN_CONTACT: f64 = 0.05;

impl PlacedSoftWall {
    fn of(placed: &PlacedStructure, set_up: &OneDegree, side: Sign) -> Option<Self> {
        let (particle, wall) = (set_up.particle?, usize::from(side > 0));
        let (stiffness_n_per_m, damping_n_s_per_m) = particle.walls()[wall].spring_and_dashpot()?;
        let end_m = signed(side, particle.ends_m()[wall]);
        let modes = placed.structure.modes.iter();
        let per_mass = 1.0 / particle.mass_kg + modes.map(|mode| mode.shape[placed.particle].powi(2)).sum::<f64>();
        let longest_s = RADIANS_IN_CONTACT / (stiffness_n_per_m * per_mass).sqrt();
        Some(Self { side, end_m, stiffness_n_per_m, damping_n_s_per_m, longest_s })
    }

    /// Its force on the particle, N, inwards, while y − x is this polynomial in steps of `step_s`.
    fn force_n(&self, offset: &Polynomial<f64>, step_s: f64) -> Polynomial<f64> {
        let mut force = derivative(offset).map(|rate| signed(self.side, self.damping_n_s_per_m * rate / step_s));
        for (force, offset) in force.iter_mut().zip(offset) {
            *force += signed(self.side, self.stiffness_n_per_m * offset);
        }
        force[0] -= self.stiffness_n_per_m * self.end_m;
        force
    }
}

/// Passes a motion with several places to an observer of the sampled engine.
struct Relay<'a, O: ?Sized> {
    observer: &'a mut O,
    placed: &'a PlacedStructure,
    /// When the step began, s.
    start_s: f64,
    step_s: f64,
    mass_kg: f64,
    soft_walls: &'a [Option<PlacedSoftWall>; 2],
    pressing: &'a mut Option<Sign>,
    x_m: &'a mut f64,
}

impl<O: sampled::SampledObserver<f64> + ?Sized> Relay<'_, O> {
    /// Of a course from `after_s` on, in steps.
    fn polynomial(&self, course: &Course, after_s: f64) -> Polynomial<f64> {
        let mut power = 1.0;
        course.taylor::<COEFFICIENTS>(after_s).map(|of_time| {
            let of_steps = of_time * power;
            power *= self.step_s;
            of_steps
        })
    }

    /// Tells of a soft wall that the particle comes to press on, or leaves, where this piece begins.
    fn press(&mut self, piece: &Piece, at: f64) {
        let now = if piece.particle_count() > 0 { piece.pressed_side(0) } else { None };
        if *self.pressing == now {
            return;
        }
        if let Some(side) = std::mem::replace(self.pressing, now) {
            let speed = |course: &Course| course.at(0.0).1;
            let separation = speed(&piece.place(self.placed.particle)) - speed(&piece.particle(0));
            self.observer.contact_end(at, side, signed(side, separation * self.step_s));
        }
        if let Some(side) = now {
            self.observer.contact_start(at, side);
        }
    }
}

impl<O: sampled::SampledObserver<f64> + ?Sized> Observer for Relay<'_, O> {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        let start = (piece.start_s - self.start_s) / self.step_s;
        self.press(piece, start);
        let x = piece.place(self.placed.observed);
        let pressed = self.pressing.and_then(|side| self.soft_walls[usize::from(side > 0)].as_ref());
        let offset = pressed.map(|wall| (wall, piece.particle(0).minus(&piece.place(self.placed.particle))));
        let mut parts = 1;
        let is_short = |parts: u32| {
            let length_s = piece.length_s / f64::from(parts);
            let is_exact =
                |course: &Course| course.remainder_m(COEFFICIENTS as u32, length_s) <= NEGLECTED * course.size_m();
            is_exact(&x) && offset.as_ref().is_none_or(|(wall, offset)| length_s <= wall.longest_s && is_exact(offset))
        };
        while !is_short(parts) && parts < MAX_PARTS {
            parts *= 2;
        }
        let length_s = piece.length_s / f64::from(parts);
        let length = length_s / self.step_s;
        for part in 0..parts {
            let (after_s, start) = (f64::from(part) * length_s, start + f64::from(part) * length);
            let polynomial = self.polynomial(&x, after_s);
            let nothing = Polynomial::default();
            self.observer.flight(start, length, &Flight { x: polynomial, offset: nothing, stretch: nothing });
            if let Some((wall, offset)) = &offset {
                let per_mass = self.step_s * self.step_s / self.mass_kg;
                let force = wall.force_n(&self.polynomial(offset, after_s), self.step_s).map(|n| n * per_mass);
                self.observer.wall_force(start, length, wall.side, &force);
            }
        }
        *self.x_m = x.at(piece.length_s).0;
    }

    fn impact(&mut self, impact: &Impact) {
        self.observer.impact(&sampled::SampledImpact {
            at: (impact.time_s - self.start_s) / self.step_s,
            side: impact.side,
            approach: impact.approach_speed_m_per_s * self.step_s,
            kick: signed(impact.side, impact.impulse_n_s / self.mass_kg * self.step_s),
        });
    }
}
