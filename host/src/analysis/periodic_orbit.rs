//! Newton's method on the map from one drive phase to the same phase k periods on, impacts and all, and the Floquet
//! multipliers of the orbit that it finds.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::{Exact, Excitation, State};
use damprig_core::model::{Initial, Invalid, SetUp};
use nalgebra::{Complex, DMatrix, DVector};

/// Newton steps before giving up.
const MOST_STEPS: u32 = 40;

/// A motion that repeats after a whole number of drive periods.
#[derive(Clone, Debug)]
pub struct PeriodicOrbit {
    /// The state at drive phase 0 (of z = Z sin Ωt).
    pub start: State,
    /// Drive periods after which it repeats.
    pub periods: u32,
    /// Floquet multipliers, largest magnitude first: two for a structure alone, four with a second mass. What is known
    /// of them is about 10⁻⁸ of the largest, from differences.
    pub multipliers: Vec<Complex<f64>>,
    /// How far from itself the state comes back, relative to the motion.
    pub residual: f64,
}

impl PeriodicOrbit {
    /// Whether small disturbances die out: every multiplier inside the unit circle.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.multipliers.iter().all(|m| m.norm() < 1.0)
    }

    /// The orbit near `guess` that repeats after `periods` periods of a base that moves with `amplitude_m` sin Ωt.
    ///
    /// # Errors
    /// An unphysical set-up, no convergence, or a particle that rests or sticks at the section, where the map cannot be
    /// differentiated in its direction.
    pub fn near(
        set_up: &SetUp,
        amplitude_m: f64,
        angular_frequency_rad_per_s: f64,
        guess: &State,
        periods: u32,
    ) -> Result<Self, NotFound> {
        let map = Map::new(set_up, amplitude_m, angular_frequency_rad_per_s, periods, guess)?;
        let mut at = map.vector(guess);
        let mut image = map.of(&at);
        let mut distance = (&image - &at).norm();
        for _ in 0..MOST_STEPS {
            let jacobian = map.jacobian(&at).ok_or(NotFound::Resting)?;
            // Rounding grows by the map's own magnification.
            let rounding = 1e-14 * (1.0 + jacobian.norm());
            if distance <= rounding {
                return Ok(map.orbit(&at, distance, jacobian));
            }
            let step = (&jacobian - DMatrix::identity(map.size, map.size))
                .lu()
                .solve(&(&at - &image))
                .ok_or(NotFound::NoConvergence { distance })?;
            // A step that leads away is shortened: across an impact the map is only piecewise smooth.
            let better = (0..12).map(|n| 0.5_f64.powi(n)).find_map(|share| {
                let next = map.inside(&(&at + share * &step));
                let image = map.of(&next);
                let distance_there = (&image - &next).norm();
                (distance_there < distance).then_some((next, image, distance_there))
            });
            match better {
                Some((next, image_there, distance_there)) => {
                    (at, image, distance) = (next, image_there, distance_there);
                }
                // As near as rounding lets it come.
                None if distance <= 1e3 * rounding => return Ok(map.orbit(&at, distance, jacobian)),
                None => return Err(NotFound::NoConvergence { distance }),
            }
        }
        Err(NotFound::NoConvergence { distance })
    }
}

/// Why there is no orbit to show.
#[derive(Clone, Debug, thiserror::Error)]
pub enum NotFound {
    /// The set-up itself is wrong.
    #[error("{0}")]
    Invalid(Invalid),
    /// Newton's method does not come nearer.
    #[error("no periodic orbit found: the state comes back no nearer than {distance:.1e} of the motion")]
    NoConvergence {
        /// How far from itself the state comes back, relative to the motion.
        distance: f64,
    },
    /// The particle rests on a wall or sticks at the section.
    #[error("the particle rests on a wall or sticks to the structure at drive phase 0: no multipliers there")]
    Resting,
}

impl From<Invalid> for NotFound {
    fn from(invalid: Invalid) -> Self {
        Self::Invalid(invalid)
    }
}

/// The map, in units of the motion: displacements over its size, velocities over size × Ω.
struct Map {
    motion: Exact,
    end_s: f64,
    scale: [f64; 4],
    size: usize,
    clearance_m: f64,
    periods: u32,
}

impl Map {
    fn new(
        set_up: &SetUp,
        amplitude_m: f64,
        angular_frequency_rad_per_s: f64,
        periods: u32,
        guess: &State,
    ) -> Result<Self, NotFound> {
        let sine = Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad: 0.0 };
        let motion = Exact::new(set_up, &sine, &Initial::default())?;
        let clearance_m = set_up.particle.map_or(f64::INFINITY, |p| p.clearance_m);
        let length = amplitude_m
            .max(guess.x_m.abs())
            .max(guess.v_m_per_s.abs() / angular_frequency_rad_per_s)
            .max(guess.offset_m.abs());
        let speed = length * angular_frequency_rad_per_s;
        let joined = set_up.particle.is_some() || set_up.tmd.is_some();
        Ok(Self {
            motion,
            end_s: f64::from(periods) * TAU / angular_frequency_rad_per_s,
            scale: [length, speed, length, speed],
            size: if joined { 4 } else { 2 },
            clearance_m,
            periods,
        })
    }

    fn vector(&self, s: &State) -> DVector<f64> {
        let all = [s.x_m, s.v_m_per_s, s.offset_m, s.slide_m_per_s];
        DVector::from_fn(self.size, |n, _| all[n] / self.scale[n])
    }

    fn state(&self, at: &DVector<f64>) -> State {
        let value = |n: usize| at.get(n).map_or(0.0, |v| v * self.scale[n]);
        State { x_m: value(0), v_m_per_s: value(1), offset_m: value(2), slide_m_per_s: value(3) }
    }

    /// The same with the particle inside its cavity.
    fn inside(&self, at: &DVector<f64>) -> DVector<f64> {
        let mut at = at.clone();
        if self.size == 4 {
            let most = self.clearance_m / self.scale[2];
            at[2] = at[2].clamp(-most, most);
        }
        at
    }

    fn of(&self, at: &DVector<f64>) -> DVector<f64> {
        let state = self.state(at);
        let initial =
            Initial { x_m: state.x_m, v_m_per_s: state.v_m_per_s, y_m: state.y_m(), u_m_per_s: state.u_m_per_s() };
        let mut motion = self.motion.clone();
        motion.reset(0.0, &initial);
        motion.run(self.end_s, &mut ());
        self.vector(motion.state())
    }

    /// Central differences; none where the particle has no room on both sides.
    fn jacobian(&self, at: &DVector<f64>) -> Option<DMatrix<f64>> {
        let step = f64::EPSILON.cbrt();
        let mut jacobian = DMatrix::zeros(self.size, self.size);
        for n in 0..self.size {
            let (mut below, mut above) = (at.clone(), at.clone());
            below[n] -= step;
            above[n] += step;
            if self.inside(&below) != below || self.inside(&above) != above {
                return None;
            }
            jacobian.set_column(n, &((self.of(&above) - self.of(&below)) / (2.0 * step)));
        }
        Some(jacobian)
    }

    fn orbit(&self, at: &DVector<f64>, residual: f64, jacobian: DMatrix<f64>) -> PeriodicOrbit {
        let mut multipliers: Vec<_> = jacobian.complex_eigenvalues().iter().copied().collect();
        multipliers.sort_by(|a, b| b.norm().total_cmp(&a.norm()));
        PeriodicOrbit { start: self.state(at), periods: self.periods, multipliers, residual }
    }
}

#[cfg(test)]
mod tests {
    use damprig_core::analysis::section::Section;
    use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
    use damprig_core::integrator::exact::{Impact, Observer};
    use damprig_core::model::{Particle, Structure, Wall};

    use super::*;

    const NATURAL: f64 = TAU * 2.5;

    fn damper(clearance_m: f64, coefficient: f64) -> SetUp {
        let particle =
            Particle { mass_kg: 0.1, clearance_m, friction_coefficient: 0.0, wall: Wall::Restitution { coefficient } };
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
        let orbit = PeriodicOrbit::near(&set_up, 1.0, turning, &State::default(), 1).expect("linear");
        let period_s = TAU / turning;
        let expected =
            Complex::from_polar((-zeta * NATURAL * period_s).exp(), NATURAL * (1.0 - zeta * zeta).sqrt() * period_s);
        let nearest = |m: &Complex<f64>| (m - expected).norm().min((m - expected.conj()).norm());
        assert!(orbit.multipliers.iter().all(|m| nearest(m) < 1e-8), "{:?} {expected}", orbit.multipliers);
        assert!(orbit.is_stable());
    }

    #[test]
    fn newton_finds_the_two_impact_orbit_of_the_closed_form_and_its_stability() {
        for (ratio, e, d, stable) in [(1.0, 0.5, 10.0, true), (1.1, 0.5, 5.0, true), (1.0, 0.5, 20.0, false)] {
            let (set_up, turning) = (damper(d, e), ratio * NATURAL);
            let formula = SymmetricOrbit::new(&set_up, 1.0, turning).expect("it exists");
            // The formula's orbit, taken on to the next drive phase 0.
            let sine = Excitation::Sine {
                amplitude_m: 1.0,
                angular_frequency_rad_per_s: turning,
                phase_rad: formula.drive_phase_rad,
            };
            let mut motion = Exact::new(&set_up, &sine, &formula.initial()).expect("physical");
            motion.run((TAU - formula.drive_phase_rad) / turning, &mut ());
            let orbit = PeriodicOrbit::near(&set_up, 1.0, turning, motion.state(), 1).expect("it is there");
            assert_eq!(orbit.is_stable(), stable, "{:?}", orbit.multipliers);
            let s = orbit.start;
            let initial = Initial { x_m: s.x_m, v_m_per_s: s.v_m_per_s, y_m: s.y_m(), u_m_per_s: s.u_m_per_s() };
            let sine = Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: turning, phase_rad: 0.0 };
            let motion = Exact::new(&set_up, &sine, &initial).expect("physical");
            let mut speed = Speed::default();
            Section::new(motion, TAU / turning).next(&mut speed);
            let error = speed.0 / formula.approach_speed_m_per_s - 1.0;
            assert!(error.abs() < 1e-10, "{ratio} {e} {d}: {error:e}");
        }
    }

    #[test]
    fn the_product_of_the_multipliers_is_what_damping_and_impacts_leave() {
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
        let product: Complex<f64> = orbit.multipliers.iter().product();
        let expected = (-2.0 * 0.0038 * NATURAL * TAU / NATURAL).exp() * 0.5_f64.powi(4);
        assert!(
            (product.re / expected - 1.0).abs() < 1e-5 && product.im.abs() < 1e-6 * expected,
            "{product} {expected}"
        );
    }
}
