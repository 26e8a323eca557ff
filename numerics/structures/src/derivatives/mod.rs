//! Exact derivatives of a motion by whatever its set-up, excitation and start depend on, through every event.
//!
//! A motion is a chain of intervals in which `w′ = A w` ([`equations`]). A small change δw of w follows `δw′ = A δw + δA w`; at an
//! event its time moves by −δg/g′ of the guard g, and an impact changes δw as it changes w (saltation). Both are summed as power series in
//! time, over steps so short that the terms left out are below rounding.
//!
//! What the coefficients A, the guards and the start are for another value of a quantity comes from set-ups with that value: their change is
//! the central difference of sixth order over ±0.3 % of it, whose error is 10⁻¹³ of it. No motion is differenced.

mod equations;
mod follow;
mod growth;
mod happen;
mod margins;
mod orbit;
mod periods;
mod record;
mod result;
mod returned;
mod series;
mod setting;
mod stencil;

use std::sync::Arc;

use damprig_core::integrator::exact::Excitation;
use follow::Purpose;

pub use periods::Section;
pub use result::GRAZING;
pub use returned::Returned;

use crate::bodies::dot;
use crate::{Mode, Refused, SetUp, State};

/// What moves the base or the structure.
#[derive(Clone, Debug)]
pub enum Drive {
    /// An excitation in closed form.
    ClosedForm(Excitation),
    /// A base that follows samples.
    Samples {
        /// Length of a sample interval, s; greater than 0.
        step_s: f64,
        /// Of each sample interval z = Σ cₖ tᵏ from its start, the cₖ in m/sᵏ; z and z′ go on from one to the next.
        powers: Arc<[[f64; 4]]>,
    },
}

/// A motion to be differentiated.
#[derive(Clone, Debug)]
pub struct MotionCase {
    /// Structure and dampers.
    pub set_up: SetUp,
    /// What drives it.
    pub drive: Drive,
    /// State at t = 0.
    pub start: State,
    /// Length of the motion, s; greater than 0.
    pub duration_s: f64,
}

/// How a motion depends on a quantity.
#[derive(Clone, Debug)]
pub struct Varied {
    /// The quantity's value, not 0.
    pub value: f64,
    /// The motion at [`Varied::AT`] times this value.
    pub cases: [MotionCase; 6],
}

/// A value with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    /// The value.
    pub value: f64,
    /// Its derivatives by the quantities.
    pub by: Vec<f64>,
}

/// The largest of several values.
#[derive(Clone, Debug, PartialEq)]
pub struct Largest {
    /// It, with its derivatives.
    pub of: Derived,
    /// Whether another one is as large, to within 10⁻⁹, with other derivatives: those here are of one of them.
    pub is_tie: bool,
}

/// An impact on a hard wall, or the touch of a soft one.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivedImpact {
    /// Number of the impact damper.
    pub damper: usize,
    /// Time, s.
    pub time_s: Derived,
    /// Approach speed, m/s.
    pub approach_speed_m_per_s: Derived,
}

/// What a motion is, with derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivatives {
    /// Displacements of all modes (m·√kg), tuned masses and particles relative to the base, then their velocities, at the end.
    pub end: Vec<Derived>,
    /// The impacts, in the order of time.
    pub impacts: Vec<DerivedImpact>,
    /// Largest absolute displacement of each place, m.
    pub largest_abs_m: Vec<Largest>,
    /// Root of the mean square of the absolute displacement of each place, m.
    pub rms_m: Vec<Derived>,
    /// Approach speed of the fastest impact, m/s; `None` without impacts.
    pub fastest_impact_m_per_s: Option<Largest>,
    /// Largest growth of a small disturbance of the start, by the norm of the kinetic energy of displacements at the lowest natural frequency and of
    /// velocities.
    pub growth: f64,
    /// Of each quantity the relative change within which, to first order, the sequence of events stays; infinite if no change ends it. Below [`GRAZING`]
    /// the derivatives by that quantity say nothing.
    pub holds_within: Vec<f64>,
}

/// A periodic motion with derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Orbit {
    /// Drive periods after which it repeats.
    pub periods: u32,
    /// When the period begins that the derivatives are of, s.
    pub at_s: f64,
    /// Floquet multipliers, real and imaginary part, the largest first: a small disturbance has so many times its size after these periods. Those of
    /// bodies that friction holds at the section are left out: they are 0.
    pub multipliers: Vec<[f64; 2]>,
    /// Its derivatives; the start moves with the quantities so that it repeats.
    pub derivatives: Derivatives,
}

/// Why a motion has no derivatives.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoDerivatives {
    /// The motion itself is refused.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// The charge of a piezoelectric wall, whose equation is of first order.
    #[error("no derivatives: a piezoelectric wall has none, as its charge has no inertia")]
    Charge,
    /// An event is not certain.
    #[error("no derivatives: the event search was given up")]
    UnresolvedEvent,
    /// A mode is another one at another value of a quantity.
    #[error(
        "no derivatives: mode {mode} changes its shape within 0.3 % of a parameter, as modes of nearly equal frequencies do"
    )]
    Shape {
        /// Its number, from 1.
        mode: usize,
    },
    /// The motion does not repeat.
    #[error("no derivatives: the motion does not repeat after its drive periods")]
    NotPeriodic,
    /// The orbit is not isolated, or does not depend smoothly on the quantities: it is at a bifurcation.
    #[error(
        "no derivatives: the orbit is not alone (a particle that meets no wall may be anywhere, and so may what friction holds all the time), or at a bifurcation"
    )]
    NotIsolated,
    /// There is no case at a value of the quantity.
    #[error("no derivatives: the set-up is refused at this value, or within 0.3 % of it")]
    NoCase,
    /// They were stopped.
    #[error("no derivatives: they were stopped")]
    Stopped,
    /// They would take too long.
    #[error(
        "no derivatives: they would take minutes, for the number of events or the fastest mode; shorten the run, or leave out fast modes"
    )]
    Long,
    /// Several contacts act at one instant.
    #[error(
        "no derivatives: several contacts act on each other at one instant, or the motion starts in contact, t = {time_s} s"
    )]
    Together {
        /// The instant, s.
        time_s: f64,
    },
    /// An impact at a speed at which its wall's e over the speed has a kink.
    #[error(
        "no derivatives: the impact at t = {time_s} s is within 0.3 % of where e of its wall over the speed has a kink"
    )]
    Kink {
        /// Its time, s.
        time_s: f64,
    },
    /// The case has other places or samples at another value of a quantity.
    #[error("no derivatives: the number of {what} changes within 0.3 % of a parameter")]
    OtherCase {
        /// What there is more or less of.
        what: &'static str,
    },
    /// A small change of any of the quantities removes an event or adds one.
    #[error(
        "no derivatives: a relative change of {change:.0e} of any parameter changes the sequence of events (grazing)"
    )]
    Grazing {
        /// The largest of the relative changes that do so.
        change: f64,
    },
    /// Small disturbances grow so much that rounding is no longer small.
    #[error(
        "no derivatives: disturbances grow {growth:.0e} times over the motion, which is chaotic, or passes through chaos"
    )]
    Growth {
        /// The growth.
        growth: f64,
    },
}

impl Varied {
    /// Factors of the value at which its motions are.
    pub const AT: [f64; 6] = [0.997, 0.998, 0.999, 1.001, 1.002, 1.003];
}

impl MotionCase {
    /// Derivatives of this motion by some quantities, while `goes_on` is true, which sees the time that is reached, s, now and then.
    ///
    /// # Errors
    /// The motion has none, with the reason.
    pub fn derivatives(
        &self,
        varied: &[Varied],
        goes_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Derivatives, NoDerivatives> {
        let aligned = self.all_aligned(varied)?;
        let (follower, growth) = follow::follow(self, &aligned, Purpose::Motion, goes_on)?;
        follower.result(growth, varied)
    }

    /// Derivatives of the periodic motion that this one is on at its end, after at most `most_periods` drive periods; the times of its impacts count from
    /// its section.
    ///
    /// # Errors
    /// The motion has none, or does not repeat to 10⁻⁶ of its size.
    pub fn orbit_derivatives(
        &self,
        most_periods: u32,
        varied: &[Varied],
        goes_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Orbit, NoDerivatives> {
        self.refuse_walls()?;
        let aligned = self.all_aligned(varied)?;
        let (at_s, case, section) = self.repeating(most_periods)?;
        let aligned = orbit::varied_at(&aligned, section.periods, &case.start, section.advance_rad);
        let (mut follower, growth) = follow::follow(&case, &aligned, Purpose::Orbit, goes_on)?;
        let multipliers = follower.close_orbit()?.iter().map(|of| [of.re, of.im]).collect();
        Ok(Orbit { periods: section.periods, at_s, multipliers, derivatives: follower.result(growth, varied)? })
    }

    /// The equations here are linear, and those of bodies with masses.
    fn refuse_walls(&self) -> Result<(), NoDerivatives> {
        if self.set_up.has_hertz_walls() {
            return Err(Refused::Hertz.into());
        }
        if self.set_up.piezoelectric_walls().next().is_some() { Err(NoDerivatives::Charge) } else { Ok(()) }
    }

    fn all_aligned(&self, varied: &[Varied]) -> Result<Vec<Varied>, NoDerivatives> {
        let aligned = varied.iter().map(|varied| {
            let [a, b, c, d, e, f] = varied.cases.each_ref().map(|case| case.aligned(self));
            Ok(Varied { value: varied.value, cases: [a?, b?, c?, d?, e?, f?] })
        });
        aligned.collect()
    }

    /// The same with the modes' signs as those of `nominal`: a shape from a decomposition has either sign.
    fn aligned(&self, nominal: &Self) -> Result<Self, NoDerivatives> {
        let modes = &nominal.set_up.structure.modes;
        if self.set_up.structure.influence.len() != nominal.set_up.structure.influence.len() {
            return Err(NoDerivatives::OtherCase { what: "places" });
        }
        if let (Drive::Samples { powers: own, .. }, Drive::Samples { powers, .. }) = (&self.drive, &nominal.drive)
            && own.len() != powers.len()
        {
            return Err(NoDerivatives::OtherCase { what: "samples" });
        }
        let mut case = self.clone();
        let structure = &mut case.set_up.structure;
        let count = structure.modes.len();
        let largest = modes.iter().map(|mode| mode.shape.iter().fold(0.0, |most: f64, of| most.max(of.abs())));
        let rounding = ALIKE_ROUNDING * largest.fold(0.0, f64::max);
        for (i, (mode, as_in)) in structure.modes.iter_mut().zip(modes).enumerate() {
            let numbers = |mode: &Mode| mode.shape.iter().copied().chain([mode.participation]).collect::<Vec<f64>>();
            let is_rounding = |all: &[f64]| all.iter().all(|of| of.abs() <= rounding);
            let (own, other) = (numbers(mode), numbers(as_in));
            let product = dot(&own, &other);
            if !is_rounding(&other) && product.abs() < ALIKE * (dot(&own, &own) * dot(&other, &other)).sqrt() {
                return Err(NoDerivatives::Shape { mode: i + 1 });
            }
            if product < 0.0 {
                mode.shape.iter_mut().for_each(|shape| *shape = -*shape);
                mode.participation = -mode.participation;
                let coupled = if structure.coupling_per_s.is_empty() { 0 } else { count };
                for j in 0..coupled {
                    structure.coupling_per_s[i * count + j] *= -1.0;
                    structure.coupling_per_s[j * count + i] *= -1.0;
                }
                (case.start.modal[i], case.start.modal_rate[i]) = (-case.start.modal[i], -case.start.modal_rate[i]);
            }
        }
        Ok(case)
    }
}

/// A mode that moves no place by more than this share of the largest shape moves none: what it has is rounding.
const ALIKE_ROUNDING: f64 = 1e-9;

/// The shapes of one mode at two values of a quantity are parallel to this share.
const ALIKE: f64 = 0.99;
