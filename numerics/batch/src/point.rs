//! A parameter point, its outcome, and the point computed by core's exact engine alone.

use std::f64::consts::{PI, TAU};

use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Exact, Excitation, Observer};
use damprig_core::io::{Invalid, require};
use damprig_core::model::{Initial, SetUp};

use crate::stop::Stop;

/// A parameter point: a set-up under an excitation, from a starting state, over a whole number of cycles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// The set-up.
    pub set_up: SetUp,
    /// The excitation in closed form.
    pub excitation: Excitation,
    /// The state at t = 0.
    pub initial: Initial,
    /// Cycles to simulate; 1 or more. A cycle is the period of a sine; otherwise the structure's natural period,
    /// 2π√(M/k).
    pub cycles: u64,
    /// First cycle of the steady state, counted from 0.
    pub steady_from_cycle: u64,
}

/// What a point gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Mean over the steady cycles of their largest |x|, m; `None` without a steady cycle.
    pub steady_mean_m: Option<f64>,
    /// Largest |x| of the steady cycles, m.
    pub steady_max_m: Option<f64>,
    /// Largest |x| of the last cycle, m.
    pub last_cycle_max_m: f64,
    /// Largest |x| of the run, m.
    pub max_abs_x_m: f64,
    /// √(1/T ∫x² dt) over the run, m.
    pub rms_x_m: f64,
    /// Number of impacts, without those of the tails that accumulations sum.
    pub impacts: u64,
    /// Number of chatters that ended with the particle at rest on a wall.
    pub accumulations: u64,
    /// Steps that were computed in lanes.
    pub lane_steps: u64,
    /// Steps that were left to the exact engine; all the time of a point without lanes counts as one.
    pub exact_steps: u64,
    /// How often the event search was given up because too many events fell on one instant.
    pub unresolved: u32,
}

impl Point {
    /// Length of a cycle, s.
    #[must_use]
    pub fn cycle_s(&self) -> f64 {
        match self.excitation {
            Excitation::Sine { angular_frequency_rad_per_s, .. }
            | Excitation::ForceSine { angular_frequency_rad_per_s, .. } => TAU / angular_frequency_rad_per_s,
            _ => {
                let structure = &self.set_up.structure;
                2.0 * PI * libm::sqrt(structure.mass_kg / structure.stiffness_n_per_m)
            }
        }
    }

    /// Checks that every value is physical.
    ///
    /// # Errors
    /// Names the first value that is not.
    pub fn validate(&self) -> Result<(), Invalid> {
        require(self.cycles >= 1, "cycles", self.cycles as f64, "1 or more")?;
        Exact::validate(&self.set_up, &self.excitation, &self.initial)
    }

    /// The motion at its start.
    pub(crate) fn motion(&self) -> Result<Exact, Invalid> {
        Exact::new(&self.set_up, &self.excitation, &self.initial)
    }

    /// The outcome by the exact engine alone.
    ///
    /// # Errors
    /// Names the first value that is not physical.
    pub fn by_exact_engine(&self) -> Result<Outcome, Invalid> {
        self.validate()?;
        Ok(self.run(self.motion()?, &mut ()))
    }

    /// The same of a point that is valid; `None` if `go_on` says no.
    pub(crate) fn while_going_on(&self, go_on: &dyn Fn() -> bool) -> Option<Outcome> {
        let mut stop = Stop::unless(go_on);
        let outcome = self.run(self.motion().ok()?, &mut stop);
        (!stop.is_stopped()).then_some(outcome)
    }

    fn run(&self, mut motion: Exact, watch: &mut impl Observer) -> Outcome {
        let cycle_s = self.cycle_s();
        let end_s = self.cycles as f64 * cycle_s;
        let mut response = Response::new(Wanted {
            cycle_s: Some(cycle_s),
            steady_from_cycle: Some(self.steady_from_cycle),
            whole_run: true,
        });
        motion.run(end_s, &mut (&mut response, watch));
        response.finish(end_s);
        let steady = response.steady_m();
        Outcome {
            steady_mean_m: steady.map(|steady| steady.1),
            steady_max_m: steady.map(|steady| steady.0),
            last_cycle_max_m: response.last_cycle_max_m().unwrap_or(0.0),
            max_abs_x_m: response.max_abs_x_m(),
            rms_x_m: response.rms_x_m(),
            impacts: response.impact_count(),
            accumulations: response.accumulation_count(),
            lane_steps: 0,
            exact_steps: 1,
            unresolved: motion.unresolved(),
        }
    }
}
