//! Periodic orbits by Newton's method on the Poincaré map (k drive periods, impacts included), and their Floquet multipliers:
//! the eigenvalues of the map's exact derivative ([`damprig_continuation::ReturnMap`]).

use std::f64::consts::TAU;

use damprig_continuation::{Derivatives, NoDerivatives, Parameter, ReturnMap, UnresolvedEvent, Variation, eigenvalues};
use damprig_core::integrator::exact::{Exact, ExactState, Excitation};
use damprig_core::io::Invalid;
use damprig_core::model::{Initial, SetUp};
use nalgebra::{Complex, DMatrix, DVector};

/// Most Newton steps.
const MAX_STEPS: u32 = 40;

/// Most sections tried.
const MAX_SECTIONS: usize = 6;

/// An orbit grazes a wall if a disturbance of this size, relative to the motion, removes an impact. Chosen, near the square root of a
/// double's rounding: the derivative would hold for smaller disturbances only.
const GRAZING: f64 = 6e-9;

/// Points checked between a multiplier and the unit circle, so that two separate eigenvalues are not merged.
const WAYPOINTS: u32 = 16;

/// Rounding error of the map, relative to the motion and the map's norm.
const ROUNDING: f64 = 1e-14;

/// A motion that repeats after a whole number of drive periods.
#[derive(Clone, Debug)]
pub struct PeriodicOrbit {
    /// The state at the section.
    pub start: ExactState,
    /// Drive phase Ωt (of z = Z sin Ωt) of the section, rad, 0 to 2π, far from impacts.
    pub section_phase_rad: f64,
    /// Drive periods after which it repeats.
    pub periods: u32,
    /// Floquet multipliers, largest magnitude first: two for a structure alone, four with a second mass.
    pub multipliers: Vec<Multiplier>,
    /// Error of the map's derivative, whose eigenvalues these are, as a norm: rounding.
    pub derivative_error: f64,
    /// Distance between the state and its image, relative to the motion.
    pub residual: f64,
    /// Distance between the state from which the search started, advanced to the section, and the orbit, relative to the size
    /// of the motion: small if that motion is on the orbit.
    pub distance: f64,
}

/// A Floquet multiplier: the growth of a small disturbance in one period of the orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Multiplier {
    /// Its value.
    pub value: Complex<f64>,
    /// Its magnitude is 1 within the error: some map within [`PeriodicOrbit::derivative_error`] has such a multiplier.
    pub is_neutral: bool,
}

/// Stability of an orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stability {
    /// Small disturbances decay: every multiplier is inside the unit circle.
    Stable,
    /// Some disturbances persist (a particle that never hits a wall stays where it is put), none grows.
    Neutral,
    /// A disturbance grows.
    Unstable,
}

impl Stability {
    /// Name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::Neutral => "neutral",
            Self::Unstable => "unstable",
        }
    }
}

impl PeriodicOrbit {
    /// The stability.
    #[must_use]
    pub fn stability(&self) -> Stability {
        if self.multipliers.iter().any(|m| !m.is_neutral && m.value.norm() > 1.0) {
            Stability::Unstable
        } else if self.multipliers.iter().any(|m| m.is_neutral) {
            Stability::Neutral
        } else {
            Stability::Stable
        }
    }

    /// Derivatives by parameters; `map` is that over its periods from its section.
    ///
    /// # Errors
    /// The orbit has none, with the reason.
    pub fn derivatives(&self, map: &ReturnMap, parameters: &[Parameter]) -> Result<Derivatives, NoDerivatives> {
        if self.multipliers.iter().any(|multiplier| multiplier.is_neutral) {
            return Err(NoDerivatives::NotIsolated);
        }
        map.orbit_derivatives(&initial(&self.start), parameters)
    }

    /// Finds the orbit near `guess`, a state at drive phase 0, that repeats after `periods` periods of the base motion
    /// `amplitude_m` sin Ωt.
    ///
    /// # Errors
    /// An unphysical set-up, no convergence, a particle that never leaves the walls, or an orbit that grazes a wall, where the
    /// map has no derivative.
    pub fn near(
        set_up: &SetUp,
        amplitude_m: f64,
        angular_frequency_rad_per_s: f64,
        guess: &ExactState,
        periods: u32,
    ) -> Result<Self, OrbitError> {
        let sine = Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad: 0.0 };
        let guess = initial(guess);
        let parts_s = ReturnMap::new(set_up, &sine, periods)?.quiet_parts_s(&guess)?;
        let at = |share: f64| parts_s.iter().map(move |(from_s, to_s)| from_s + share * (to_s - from_s));
        let mut motion = Exact::new(set_up, &sine, &guess)?;
        let mut not_found = OrbitError::Resting;
        // Newton's method may find an orbit from one section and not from another.
        for at_s in at(0.5).take(3).chain(at(0.25)).chain(at(0.75)).take(MAX_SECTIONS) {
            motion.reset(0.0, &guess);
            motion.run(at_s, &mut ());
            let phase_rad = (angular_frequency_rad_per_s * at_s).rem_euclid(TAU);
            let base = (amplitude_m, angular_frequency_rad_per_s, phase_rad);
            match PoincareMap::new(set_up, base, periods, motion.state())?.orbit_near(motion.state()) {
                Ok(orbit) => return Ok(orbit),
                Err(why) => not_found = why,
            }
        }
        Err(not_found)
    }
}

pub(super) fn initial(state: &ExactState) -> Initial {
    Initial { x_m: state.x_m, v_m_per_s: state.v_m_per_s, y_m: state.y_m(), u_m_per_s: state.u_m_per_s() }
}

/// Why no orbit was found.
#[derive(Clone, Debug, thiserror::Error)]
pub enum OrbitError {
    /// The set-up is not physical.
    #[error("{0}")]
    Invalid(Invalid),
    /// Newton's method does not converge.
    #[error("no periodic orbit found: Newton's method stopped at a relative residual of {distance:.1e}")]
    NoConvergence {
        /// Distance between the state and its image, relative to the motion.
        distance: f64,
    },
    /// The particle never leaves the walls.
    #[error("no multipliers: the particle is always at rest on a wall, or in it")]
    Resting,
    /// An impact is so slow that small disturbances remove it: the multipliers are without bound there.
    #[error("no multipliers: the orbit grazes a wall (a relative disturbance of {size:.0e} removes an impact)")]
    Grazing {
        /// The smallest such disturbance, relative to the motion.
        size: f64,
    },
    /// The motion has an event whose kind is not certain.
    #[error("no periodic orbit found: {0}")]
    UnresolvedEvent(#[from] UnresolvedEvent),
}

impl From<Invalid> for OrbitError {
    fn from(invalid: Invalid) -> Self {
        Self::Invalid(invalid)
    }
}

/// The Poincaré map, scaled: displacements by the size of the motion, velocities by size × Ω.
struct PoincareMap {
    map: ReturnMap,
    scale: [f64; 4],
    size: usize,
    /// y − x at the walls, m.
    ends_m: [f64; 2],
    /// Amplitude of the base per size of the motion.
    amplitude: f64,
    periods: u32,
    phase_rad: f64,
}

impl PoincareMap {
    /// The map from a phase of the base, for motions of the size of `guess`.
    fn new(
        set_up: &SetUp,
        (amplitude_m, angular_frequency_rad_per_s, phase_rad): (f64, f64, f64),
        periods: u32,
        guess: &ExactState,
    ) -> Result<Self, Invalid> {
        let length = amplitude_m
            .max(guess.x_m.abs())
            .max(guess.v_m_per_s.abs() / angular_frequency_rad_per_s)
            .max(guess.offset_m.abs());
        let speed = length * angular_frequency_rad_per_s;
        Ok(Self {
            map: ReturnMap::new(
                set_up,
                &Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad },
                periods,
            )?,
            scale: [length, speed, length, speed],
            size: if set_up.particle.is_some() || set_up.tmd.is_some() { 4 } else { 2 },
            ends_m: set_up.particle.map_or([-f64::INFINITY, f64::INFINITY], |p| p.ends_m()),
            amplitude: amplitude_m / length,
            periods,
            phase_rad,
        })
    }

    fn orbit_near(&self, guess: &ExactState) -> Result<PeriodicOrbit, OrbitError> {
        let mut at = self.vector(guess);
        let mut image = self.of(&at);
        let mut distance = (&image - &at).norm();
        for _ in 0..MAX_STEPS {
            let derivative = self.derivative(&at)?;
            // The map magnifies rounding by its norm.
            let magnification = 1.0 + derivative.matrix.norm();
            let rounding = ROUNDING * magnification;
            if distance <= rounding {
                return self.orbit(&at, &derivative, distance, guess);
            }
            // Neutral directions have singular values of the size of rounding, which are left out.
            let newton = (&derivative.matrix - DMatrix::identity(self.size, self.size))
                .svd(true, true)
                .solve(&(&at - &image), derivative.error)
                .map_err(|_| OrbitError::NoConvergence { distance })?;
            // The map is only piecewise smooth, so a step that increases the residual is shortened.
            let better = (0..12).map(|n| 0.5_f64.powi(n)).find_map(|share| {
                let next = self.inside(&(&at + share * &newton));
                let image = self.of(&next);
                let distance_there = (&image - &next).norm();
                (distance_there < distance).then_some((next, image, distance_there))
            });
            match better {
                Some((next, image_there, distance_there)) => {
                    (at, image, distance) = (next, image_there, distance_there);
                }
                // The residual is as small as rounding allows.
                None if distance <= 1e3 * rounding => return self.orbit(&at, &derivative, distance, guess),
                None => return Err(OrbitError::NoConvergence { distance }),
            }
        }
        Err(OrbitError::NoConvergence { distance })
    }

    fn vector(&self, s: &ExactState) -> DVector<f64> {
        let all = [s.x_m, s.v_m_per_s, s.offset_m, s.slide_m_per_s];
        DVector::from_fn(self.size, |n, _| all[n] / self.scale[n])
    }

    fn state(&self, at: &DVector<f64>) -> ExactState {
        let value = |n: usize| at.get(n).map_or(0.0, |v| v * self.scale[n]);
        ExactState { x_m: value(0), v_m_per_s: value(1), offset_m: value(2), slide_m_per_s: value(3) }
    }

    /// The vector with the particle moved inside its cavity.
    fn inside(&self, at: &DVector<f64>) -> DVector<f64> {
        let mut at = at.clone();
        if self.size == 4 {
            let [low, high] = self.ends_m.map(|end_m| end_m / self.scale[2]);
            at[2] = at[2].clamp(low, high);
        }
        at
    }

    fn of(&self, at: &DVector<f64>) -> DVector<f64> {
        self.vector(&self.map.image(&initial(&self.state(at))))
    }

    /// The derivative, which is the same in units of the motion.
    fn derivative(&self, at: &DVector<f64>) -> Result<Variation, OrbitError> {
        let variation = self.map.variation(&initial(&self.state(at)))?;
        let is_finite = variation.error.is_finite() && variation.matrix.iter().all(|entry| entry.is_finite());
        if is_finite { Ok(variation) } else { Err(OrbitError::Grazing { size: 0.0 }) }
    }

    /// The orbit through `at`.
    fn orbit(
        &self,
        at: &DVector<f64>,
        derivative: &Variation,
        residual: f64,
        guess: &ExactState,
    ) -> Result<PeriodicOrbit, OrbitError> {
        let size = derivative.smallest_grazing * self.amplitude;
        if size < GRAZING {
            return Err(OrbitError::Grazing { size });
        }
        Ok(PeriodicOrbit {
            start: self.state(at),
            section_phase_rad: self.phase_rad,
            periods: self.periods,
            multipliers: multipliers(&derivative.matrix, derivative.error),
            derivative_error: derivative.error,
            residual,
            distance: (self.vector(guess) - at).norm(),
        })
    }
}

/// Eigenvalues of a matrix known within `error` (a norm), largest magnitude first.
///
/// A point is an eigenvalue of some matrix within that error if and only if the smallest singular value of
/// `matrix − point` is at most the error. An eigenvalue is neutral if this holds for all points from it to the nearest point
/// of the unit circle. The criterion also holds for defective eigenvalues, which an error ε moves by √ε (a particle in free
/// flight).
fn multipliers(matrix: &DMatrix<f64>, error: f64) -> Vec<Multiplier> {
    let size = matrix.nrows();
    let complex = matrix.map(|value| Complex::new(value, 0.0));
    let mut multipliers: Vec<_> = eigenvalues(matrix)
        .into_iter()
        .map(|value| {
            let magnitude = value.norm();
            let may_be_at = |point: Complex<f64>| {
                let shifted = &complex - DMatrix::from_diagonal_element(size, size, point);
                shifted.singular_values().min() <= error
            };
            let way = if magnitude > 0.0 { value / magnitude - value } else { -value };
            let is_neutral = magnitude > 0.0
                && magnitude.is_finite()
                && (1..=WAYPOINTS).all(|n| may_be_at(value + way * (f64::from(n) / f64::from(WAYPOINTS))));
            Multiplier { value, is_neutral }
        })
        .collect();
    multipliers.sort_by(|a, b| b.value.norm().total_cmp(&a.value.norm()));
    multipliers
}

#[cfg(test)]
mod tests {
    use damprig_core::analysis::section::Section;
    use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
    use damprig_core::integrator::exact::{Impact, Observer};
    use damprig_core::model::{Cavity, Particle, Structure, Wall};

    use super::*;

    const NATURAL: f64 = TAU * 2.5;

    fn damper(clearance_m: f64, coefficient: f64) -> SetUp {
        let particle = Particle {
            mass_kg: 0.1,
            clearance_m,
            friction_coefficient: 0.0,
            wall: Wall::Restitution { coefficient },
            cavity: Cavity::default(),
        };
        SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.0, 2.5, 0.0038)) }
    }

    #[derive(Default)]
    struct Speed(f64);

    impl Observer for Speed {
        const ARCS: bool = false;

        fn impact(&mut self, impact: &Impact) {
            self.0 = impact.approach_speed_m_per_s;
        }
    }

    #[test]
    fn a_bare_structure_has_the_multipliers_of_its_own_decay() {
        let (zeta, turning) = (0.05, 0.8 * NATURAL);
        let set_up = SetUp::bare(Structure::from_modal(1.0, 2.5, zeta));
        let orbit = PeriodicOrbit::near(&set_up, 1.0, turning, &ExactState::default(), 1).expect("linear");
        let period_s = TAU / turning;
        let expected =
            Complex::from_polar((-zeta * NATURAL * period_s).exp(), NATURAL * (1.0 - zeta * zeta).sqrt() * period_s);
        let nearest = |m: &Complex<f64>| (m - expected).norm().min((m - expected.conj()).norm());
        assert!(orbit.multipliers.iter().all(|m| nearest(&m.value) < 1e-8), "{:?} {expected}", orbit.multipliers);
        assert_eq!(orbit.stability(), Stability::Stable);
    }

    #[test]
    fn newton_finds_the_two_impact_orbit_of_the_closed_form_and_its_stability() {
        for (ratio, e, d, stable) in [(1.0, 0.5, 10.0, true), (1.1, 0.5, 5.0, true), (1.0, 0.5, 20.0, false)] {
            let (set_up, turning) = (damper(d, e), ratio * NATURAL);
            let formula = SymmetricOrbit::new(&set_up, 1.0, turning).expect("it exists");
            // The formula's orbit, advanced to the next drive phase 0.
            let sine = Excitation::Sine {
                amplitude_m: 1.0,
                angular_frequency_rad_per_s: turning,
                phase_rad: formula.drive_phase_rad,
            };
            let mut motion = Exact::new(&set_up, &sine, &formula.initial()).expect("physical");
            motion.run((TAU - formula.drive_phase_rad) / turning, &mut ());
            let orbit = PeriodicOrbit::near(&set_up, 1.0, turning, motion.state(), 1).expect("it is there");
            let expected = if stable { Stability::Stable } else { Stability::Unstable };
            assert_eq!(orbit.stability(), expected, "{:?}", orbit.multipliers);
            let sine = Excitation::Sine {
                amplitude_m: 1.0,
                angular_frequency_rad_per_s: turning,
                phase_rad: orbit.section_phase_rad,
            };
            let motion = Exact::new(&set_up, &sine, &initial(&orbit.start)).expect("physical");
            let mut speed = Speed::default();
            Section::new(motion, TAU / turning).next(&mut speed);
            let error = speed.0 / formula.approach_speed_m_per_s - 1.0;
            assert!(error.abs() < 1e-10, "{ratio} {e} {d}: {error:e}");
        }
    }

    #[test]
    fn the_product_of_the_multipliers_follows_from_damping_and_impacts() {
        // Phase volume: e^{−2ζωT} by the dashpot, e² by each of the two impacts (Liouville).
        let set_up = damper(10.0, 0.5);
        let mut motion = Exact::new(
            &set_up,
            &Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: NATURAL, phase_rad: 0.0 },
            &Initial::default(),
        )
        .expect("physical");
        motion.run(2000.0 * TAU / NATURAL, &mut ());
        let orbit = PeriodicOrbit::near(&set_up, 1.0, NATURAL, motion.state(), 1).expect("the run ends on it");
        let product: Complex<f64> = orbit.multipliers.iter().map(|m| m.value).product();
        let expected = (-2.0 * 0.0038 * NATURAL * TAU / NATURAL).exp() * 0.5_f64.powi(4);
        assert!(
            (product.re / expected - 1.0).abs() < 1e-11 && product.im.abs() < 1e-11 * expected,
            "{product} {expected}"
        );
    }
}
