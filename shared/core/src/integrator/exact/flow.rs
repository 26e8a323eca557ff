//! Power series of the motion within one mode, from tables computed once per set-up and excitation.
//!
//! In every mode the system is linear with constant coefficients. The series over an arc is therefore a fixed matrix
//! times the state at its start (displacement, velocity, constant acceleration, rotating pair). The tables store that
//! matrix by columns, so the loop needs only multiplications and additions.

use super::excitation::{Excitation, Wave};
use super::oscillator::{Coupled, Oscillator, Rates, wave_series};
use super::series::{Series, TERMS};
use crate::integrator::modes::Sign;
use crate::model::SetUp;

pub use super::oscillator::Link;

/// Length of a full arc times the fastest rate of its mode, rad.
pub const LARGEST_ARC_RAD: f64 = 0.8;

/// State: displacements and velocities. The particle (or the tuned mass) is relative to the structure, so that wall
/// positions and a held particle are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExactState {
    /// x, m.
    pub x_m: f64,
    /// x′, m/s.
    pub v_m_per_s: f64,
    /// y − x, m.
    pub offset_m: f64,
    /// y′ − x′, m/s.
    pub slide_m_per_s: f64,
}

impl ExactState {
    /// y, m.
    #[must_use]
    pub fn y_m(&self) -> f64 {
        self.x_m + self.offset_m
    }

    /// y′, m/s.
    #[must_use]
    pub fn u_m_per_s(&self) -> f64 {
        self.v_m_per_s + self.slide_m_per_s
    }
}

/// The motions in which a link joins structure and second mass.
#[derive(Clone, Debug)]
struct JoinedMotions {
    link: Link,
    coupled: Coupled,
    /// The second mass on the link, on a structure that is stuck to the base.
    carried: Oscillator,
}

/// Selects the equations of motion of the structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Path {
    /// The structure moves alone.
    Alone,
    /// The structure moves with the held particle as one body.
    Together,
    /// The link joins the structure and the second mass.
    Coupled,
    /// The structure is stuck to the base.
    Carried,
    /// The structure is stuck to the base, and the second mass moves on the link.
    CarriedCoupled,
    /// The particle presses into a Hertz wall.
    Squeezed,
    /// The structure is stuck to the base, and the particle presses into a Hertz wall.
    CarriedSqueezed,
}

/// The equations of motion of the present mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    pub path: Path,
    /// Whether the particle moves relative to the structure (otherwise the offset is constant).
    pub sliding: bool,
    /// Constant acceleration of the structure, m/s².
    pub structure_acceleration: f64,
    /// Constant acceleration of the particle, m/s².
    pub particle_acceleration: f64,
    /// Side of the soft wall that is compressed, 0 if none is.
    pub pressed: Sign,
    /// Offset at which the link is unloaded, m.
    pub rest_offset: f64,
    /// Length of a full arc, s.
    pub step_s: f64,
}

/// The motions of structure, second mass and base over one arc.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// x, m, over τ = 0 … 1.
    pub x: Series,
    /// y − x, m.
    pub offset: Series,
    /// z, m.
    pub base: Series,
    /// Time that τ = 1 stands for, s.
    pub step_s: f64,
}

/// The tables of one set-up under one excitation.
#[derive(Clone, Debug)]
pub struct Flows {
    pub(super) alone: Oscillator,
    together: Option<Oscillator>,
    /// The same two for the displacement relative to the moving base, x − z.
    relative_alone: Oscillator,
    relative_together: Option<Oscillator>,
    /// With a tuned mass the first; with soft walls that of the negative and that of the positive side, the latter only where it
    /// differs.
    joined: [Option<JoinedMotions>; 2],
    pub(super) turning: f64,
    pub(super) base_share: f64,
}

impl Flows {
    /// The tables of a validated set-up.
    pub(super) fn new(set_up: &SetUp, excitation: &Excitation) -> Self {
        let turning = excitation.angular_frequency_rad_per_s();
        let base_share = if excitation.moves_base() { 1.0 } else { 0.0 };
        let structure = &set_up.structure;
        let rates = |mass: f64| Rates::of(structure, mass, excitation);
        // (x − z)″ has −z″ in place of the base's spring and dashpot force.
        let relative = |mass: f64| Rates {
            sine: if base_share > 0.0 { turning * turning } else { 1.0 / mass },
            cosine: 0.0,
            ..rates(mass)
        };
        let mass = structure.mass_kg;
        let alone = Oscillator::new(rates(mass), turning).with_means();
        let joint = |(second, stiffness, damping): (f64, f64, f64)| {
            let link = Link { stiffness, damping, mass_ratio: mass / second };
            let carried = Rates {
                stiffness: stiffness / second,
                damping: damping / second,
                sine: base_share * turning * turning,
                cosine: 0.0,
            };
            JoinedMotions {
                link,
                coupled: Coupled::new(rates(mass), link, mass, turning),
                carried: Oscillator::new(carried, turning),
            }
        };
        let soft = set_up.particle.map_or([None; 2], |p| {
            let springs = p.walls().map(|wall| wall.spring_and_dashpot());
            let positive = springs[1].filter(|_| springs[0] != springs[1]);
            [springs[0], positive].map(|spring| spring.map(|(stiffness, damping)| (p.mass_kg, stiffness, damping)))
        });
        let tuned = set_up.tmd.map(|t| (t.mass_kg, t.stiffness_n_per_m, t.damping_n_s_per_m));
        Self {
            together: set_up.particle.map(|p| Oscillator::new(rates(mass + p.mass_kg), turning).with_means()),
            relative_alone: Oscillator::new(relative(mass), turning),
            relative_together: set_up.particle.map(|p| Oscillator::new(relative(mass + p.mass_kg), turning)),
            joined: [soft[0].or(tuned).map(joint), soft[1].map(joint)],
            turning,
            base_share,
            alone,
        }
    }

    /// What joins structure and second mass: a tuned mass, or the pressed soft wall of that side.
    #[inline]
    fn joined(&self, pressed: Sign) -> Option<&JoinedMotions> {
        let [first, positive] = &self.joined;
        positive.as_ref().filter(|_| pressed > 0).or(first.as_ref())
    }

    /// The link of a tuned mass, or of the soft wall of that side.
    #[inline]
    pub(super) fn link(&self, pressed: Sign) -> Link {
        self.joined(pressed).map_or(Link::default(), |joined| joined.link)
    }

    /// The oscillator of the structure on `path`; `None` on the other paths.
    #[inline]
    pub(super) fn oscillator(&self, path: Path) -> Option<&Oscillator> {
        match path {
            Path::Alone => Some(&self.alone),
            Path::Together => self.together.as_ref(),
            _ => None,
        }
    }

    /// The oscillator of x − z on `path`; its constant acceleration is that of the structure on the resting base.
    #[inline]
    pub(super) fn relative_oscillator(&self, path: Path) -> Option<&Oscillator> {
        match path {
            Path::Alone => Some(&self.relative_alone),
            Path::Together => self.relative_together.as_ref(),
            _ => None,
        }
    }

    /// Length of a full arc on `path`, s, while the soft wall of side `pressed` is compressed.
    pub(super) fn step_s(&self, path: Path, pressed: Sign) -> f64 {
        let joined = self.joined(pressed);
        match path {
            Path::Coupled => joined.map_or(self.alone.step_s, |joined| joined.coupled.step_s),
            Path::CarriedCoupled => joined.map_or(self.alone.step_s, |joined| joined.carried.step_s),
            Path::Together => self.together.as_ref().map_or(self.alone.step_s, |together| together.step_s),
            Path::Alone | Path::Carried | Path::Squeezed | Path::CarriedSqueezed => self.alone.step_s,
        }
    }

    /// Sum of the magnitudes of the terms in each coefficient of x in [`Flows::span`], for rounding bounds; `None`
    /// where the second mass and the structure are joined.
    pub(super) fn sizes(&self, leg: &Leg, state: &ExactState, wave: &Wave) -> Option<Series> {
        let unit = [state.x_m, state.v_m_per_s, leg.structure_acceleration, wave.sine, wave.cosine].map(f64::abs);
        match leg.path {
            Path::Alone | Path::Together => self.oscillator(leg.path).map(|table| {
                core::array::from_fn(|n| (0..5).map(|which| table.columns[which][n].abs() * unit[which]).sum())
            }),
            Path::Carried => {
                let angle = self.turning * leg.step_s;
                let turned = wave_series(self.base_share * unit[3], self.base_share * unit[4], angle);
                Some(turned.map(f64::abs))
            }
            _ => None,
        }
    }

    /// The series of the arc that starts from `state`; those in a Hertz wall are in [`super::squeeze`].
    #[inline]
    pub(super) fn span(&self, leg: &Leg, state: &ExactState, wave: &Wave) -> Span {
        let h = leg.step_s;
        let mut base = wave_series(self.base_share * wave.sine, self.base_share * wave.cosine, self.turning * h);
        base[0] += wave.offset;
        let velocity = state.v_m_per_s * h;
        let unit = [state.x_m, state.v_m_per_s, leg.structure_acceleration, wave.sine, wave.cosine];
        let mut offset = [0.0; TERMS];
        offset[0] = state.offset_m;
        let mut x = base;
        match (leg.path, self.joined(leg.pressed), &self.together) {
            (Path::Coupled, Some(JoinedMotions { coupled, .. }), _) => {
                let unit = [
                    state.x_m,
                    velocity,
                    state.offset_m - leg.rest_offset,
                    state.slide_m_per_s * h,
                    leg.structure_acceleration,
                    leg.particle_acceleration,
                    wave.sine,
                    wave.cosine,
                ];
                (x, offset) = coupled.series(&unit);
                offset[0] = state.offset_m;
                return Span { x, offset, base, step_s: h };
            }
            (Path::CarriedCoupled, Some(JoinedMotions { carried, .. }), _) => {
                let from_rest = state.offset_m - leg.rest_offset;
                let sliding = state.slide_m_per_s;
                offset = carried.series(&[from_rest, sliding, leg.particle_acceleration, wave.sine, wave.cosine]);
                offset[0] = state.offset_m;
                x[0] = state.x_m;
                return Span { x, offset, base, step_s: h };
            }
            (Path::Together, _, Some(together)) => x = together.series(&unit),
            (Path::Carried, _, _) => x[0] = state.x_m,
            _ => x = self.alone.series(&unit),
        }
        if leg.sliding {
            offset[1] = state.slide_m_per_s * h;
            offset[2] = 0.5 * leg.particle_acceleration * h * h - x[2];
            for n in 3..TERMS {
                offset[n] = -x[n];
            }
        }
        Span { x, offset, base, step_s: h }
    }
}
