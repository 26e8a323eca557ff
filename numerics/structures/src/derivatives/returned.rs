//! A motion as a map of its start: what a small change of the start becomes.

use std::collections::BTreeMap;

use nalgebra::{Complex, DMatrix, DVector, Schur};

use super::follow::{Follower, Purpose, follow};
use super::{MotionCase, NoDerivatives, Varied};
use crate::contacts::Event;

/// Steps of the search for eigenvalues.
const MAX_ITERATIONS: usize = 10_000;

/// How a motion over whole periods of its sine returns, with exact derivatives through every event.
#[derive(Clone, Debug)]
pub struct Returned {
    /// Displacements (m·√kg of a mode, m of a tuned mass or a particle) and velocities of all bodies relative to the base, at the start.
    pub start: DVector<f64>,
    /// Disturbances of the start, a column each: orthonormal in units in which bodies of one energy have one size. Those that friction does not let
    /// begin are left out.
    pub along: DMatrix<f64>,
    /// What these disturbances are at the end, in the units of `start`.
    pub becomes: DMatrix<f64>,
    /// What they become, in themselves: the derivative of the map of the start.
    pub map: DMatrix<f64>,
    /// Displacements and velocities at the end.
    pub end: DVector<f64>,
    /// What makes displacements and velocities comparable: factors of `start`.
    scale: DVector<f64>,
    /// How far from its start the motion returns, in these disturbances.
    pub missed: DVector<f64>,
    /// The derivative of where it returns by each quantity at the same start, in these disturbances.
    pub by: DMatrix<f64>,
    /// Size of the motion in the same units.
    pub size: f64,
    /// When the first event is, and how long before the end the last one; the whole length without events, s.
    pub clear_s: [f64; 2],
    /// How often each kind of event happens, up to [`MANY`](Returned::MANY) times: chatter has as many impacts as rounding lets it have.
    pub events: BTreeMap<String, u32>,
    /// Approach speeds of its impacts, m/s.
    pub approach_speeds_m_per_s: Vec<f64>,
}

impl MotionCase {
    /// How this motion returns, by some quantities too.
    ///
    /// # Errors
    /// It has no derivatives, with the reason.
    pub fn returned(&self, varied: &[Varied]) -> Result<Returned, NoDerivatives> {
        let aligned = self.all_aligned(varied)?;
        let (follower, _) = follow(self, &aligned, Purpose::Map, &mut |_| true)?;
        let mut returned = follower.returned();
        for (mut by, varied) in returned.by.column_iter_mut().zip(varied) {
            by /= varied.value;
        }
        Ok(returned)
    }
}

impl Returned {
    /// So many events or more are not counted further.
    pub const MANY: u32 = 10;

    /// A disturbance of the start in those of `along`.
    #[must_use]
    pub fn coordinates(&self, of: &DVector<f64>) -> DVector<f64> {
        self.along.tr_mul(&of.component_mul(&self.scale).component_mul(&self.scale))
    }

    /// Size of a disturbance.
    #[must_use]
    pub fn size_of(&self, of: &DVector<f64>) -> f64 {
        of.component_mul(&self.scale).norm()
    }

    /// Floquet multipliers, the largest first; none if they are not known. Those of bodies that friction holds at the start are left out: they are 0.
    #[must_use]
    pub fn multipliers(&self) -> Vec<Complex<f64>> {
        // Without a bound the iteration may not end, as for some matrices with several zeros.
        let schur = Schur::try_new(self.map.clone(), f64::EPSILON, MAX_ITERATIONS);
        let mut multipliers: Vec<Complex<f64>> =
            schur.map(|schur| schur.complex_eigenvalues().iter().copied().collect()).unwrap_or_default();
        multipliers.sort_by(|a, b| b.norm_sqr().total_cmp(&a.norm_sqr()));
        multipliers
    }
}

impl Follower<'_> {
    /// How the motion returns; per relative change of the quantities.
    pub(super) fn returned(&self) -> Returned {
        let (bodies, quantities) = (self.bodies(), self.others.len());
        let scaled = |of: &DMatrix<f64>, from: usize, count: usize| {
            DMatrix::from_fn(2 * bodies, count, |i, j| self.scale(i) * of[(i, from + j)])
        };
        let starts = scaled(&self.start, quantities, 2 * bodies);
        // Directions that friction does not let begin have no part in it.
        let free: Vec<usize> = (0..2 * bodies).filter(|&j| starts.column(j).norm() > 0.0).collect();
        let along = starts.select_columns(&free);
        let in_these = |of: DMatrix<f64>| along.tr_mul(&of);
        let missed = DMatrix::from_fn(2 * bodies, 1, |i, _| self.scale(i) * (self.w[i] - self.start_w[i]));
        let moved = scaled(&self.s, 0, quantities) - scaled(&self.start, 0, quantities);
        let length_s = self.time.value;
        let mut events = BTreeMap::new();
        for (_, event) in &self.events {
            let count: &mut u32 = events.entry(self.named(*event)).or_default();
            *count = (*count + 1).min(Returned::MANY);
        }
        Returned {
            start: self.start_w.rows(0, 2 * bodies).clone_owned(),
            end: self.w.rows(0, 2 * bodies).clone_owned(),
            scale: DVector::from_fn(2 * bodies, |i, _| self.scale(i)),
            becomes: self.s.view((0, quantities), (2 * bodies, 2 * bodies)).select_columns(&free),
            map: in_these(scaled(&self.s, quantities, 2 * bodies)).select_columns(&free),
            missed: in_these(missed).column(0).clone_owned(),
            by: in_these(moved),
            size: self.sizes[0],
            clear_s: [
                self.events.first().map_or(length_s, |(at_s, _)| *at_s),
                self.events.last().map_or(length_s, |(at_s, _)| length_s - at_s),
            ],
            events,
            approach_speeds_m_per_s: self.impacts.iter().map(|(.., speed)| speed.value).collect(),
            along: DMatrix::from_fn(2 * bodies, free.len(), |i, j| along[(i, j)] / self.scale(i)),
        }
    }

    /// An event in words.
    fn named(&self, event: Event) -> String {
        let mount = &self.nominal.mount;
        let joint = |joint: usize| match mount.particle_of(joint) {
            Some(particle) => format!("particle {}", particle + 1),
            None => format!("friction damper {}", joint + 1),
        };
        let wall = |side| if side > 0 { "+" } else { "−" };
        match event {
            Event::Stops(of) => format!("stops of {}", joint(of)),
            Event::Breaks(of, _) => format!("starts of {} to slide", joint(of)),
            Event::Wall(of, side) => format!("impacts of particle {} on its {} wall", of + 1, wall(side)),
            Event::Releases(of, side) => format!("releases of particle {} by its {} wall", of + 1, wall(side)),
            Event::Inside(of, side) => format!("returns of particle {} from its {} wall", of + 1, wall(side)),
        }
    }
}
