//! Poincaré section of a motion at the drive phase, and detection of its period.

use crate::integrator::exact::{Exact, ExactState, Observer};

/// Takes the state once a period of the drive.
///
/// ```
/// use damprig_core::analysis::section::{Section, period};
/// use damprig_core::integrator::exact::{Exact, Excitation};
/// use damprig_core::model::{Initial, SetUp, Structure};
///
/// let set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.1));
/// let drive = Excitation::Sine { amplitude_m: 1e-3, angular_frequency_rad_per_s: 15.0, phase_rad: 0.0 };
/// let motion = Exact::new(&set_up, &drive, &Initial::default())?;
/// let mut section = Section::new(motion, core::f64::consts::TAU / 15.0);
/// let mut states = [Default::default(); 8];
/// section.skip(60);
/// states.fill_with(|| section.next(&mut ()));
/// assert_eq!(period(&states, 1e-9), Some(1));
/// # Ok::<(), damprig_core::io::Invalid>(())
/// ```
#[derive(Clone, Debug)]
pub struct Section {
    motion: Exact,
    start_s: f64,
    period_s: f64,
    taken: u64,
}

impl Section {
    /// A section of `motion` every `period_s` seconds from its present time.
    #[must_use]
    pub fn new(motion: Exact, period_s: f64) -> Self {
        Self { start_s: motion.time_s(), motion, period_s, taken: 0 }
    }

    /// Advances by `periods` periods without sampling.
    pub fn skip(&mut self, periods: u64) {
        self.taken += periods;
        self.motion.run(self.instant_s(), &mut ());
    }

    /// Advances by one period and returns the state.
    pub fn next<O: Observer>(&mut self, observer: &mut O) -> ExactState {
        self.taken += 1;
        self.motion.run(self.instant_s(), observer);
        *self.motion.state()
    }

    /// The motion, at the section.
    #[must_use]
    pub fn motion(&self) -> &Exact {
        &self.motion
    }

    /// Returns the motion, at the section.
    #[must_use]
    pub fn into_motion(self) -> Exact {
        self.motion
    }

    // Computed from the count of periods, not accumulated, so that the phase does not drift.
    fn instant_s(&self) -> f64 {
        self.start_s + self.taken as f64 * self.period_s
    }
}

/// The smallest k, at most half the number of states, such that the states repeat after k of them, each component
/// within `tolerance` of its own largest magnitude; `None` if they do not repeat.
#[must_use]
pub fn period(states: &[ExactState], tolerance: f64) -> Option<usize> {
    let components = |s: &ExactState| [s.x_m, s.v_m_per_s, s.offset_m, s.slide_m_per_s];
    let mut most = [0.0_f64; 4];
    for state in states {
        for (most, value) in most.iter_mut().zip(components(state)) {
            *most = most.max(value.abs());
        }
    }
    (1..=states.len() / 2).find(|&k| {
        states.iter().zip(&states[k..]).all(|(early, late)| {
            let (early, late) = (components(early), components(late));
            (0..4).all(|n| (early[n] - late[n]).abs() <= tolerance * most[n])
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_pattern_shows_its_shortest_period() {
        let at = |x_m: f64| ExactState { x_m, ..ExactState::default() };
        let three = [1.0, 2.0, 5.0, 1.0, 2.0, 5.0, 1.0, 2.0].map(at);
        assert_eq!(period(&three, 1e-9), Some(3));
        assert_eq!(period(&[at(1.0); 4], 1e-9), Some(1));
        assert_eq!(period(&[1.0, 2.0, 4.0, 8.0].map(at), 1e-9), None);
        assert_eq!(period(&[], 1e-9), None);
    }
}
