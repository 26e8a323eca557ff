//! A motion at evenly spaced instants: the frames of an animation.

use super::Case;
use super::motion::{Piece, Viewer};

/// Cycles that are kept, and instants in each.
const CYCLES: f64 = 6.0;
const PER_CYCLE: f64 = 40.0;

/// Where everything is at an instant, m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// The base.
    pub z_m: f64,
    /// The places; of one degree of freedom the structure.
    pub places_m: Vec<f64>,
    /// The particles.
    pub particles_m: Vec<f64>,
    /// The tuned masses.
    pub tuned_masses_m: Vec<f64>,
}

/// Frames of a case: its last cycles under a sine, else its first ones.
#[derive(Clone, Debug)]
pub struct Frames {
    from_s: f64,
    step_s: f64,
    count: usize,
    /// Places, particles and tuned masses; `None` for one degree of freedom.
    several: Option<[usize; 3]>,
    has_particle: bool,
    has_tuned_mass: bool,
    frames: Vec<Frame>,
}

impl Frames {
    /// None yet.
    #[must_use]
    pub fn of(case: &Case) -> Self {
        let (cycle_s, duration_s) = (case.cycle_s(), case.run.duration_s);
        let length_s = (CYCLES * cycle_s).min(duration_s);
        let step_s = cycle_s / PER_CYCLE;
        let several = case
            .multi_degree
            .as_ref()
            .map(|of| [of.places.len(), of.set_up.impact_dampers.len(), of.set_up.tuned_masses.len()]);
        Self {
            from_s: if case.is_under_a_sine() { duration_s - length_s } else { 0.0 },
            step_s,
            count: (length_s / step_s).floor().max(1.0) as usize,
            several,
            has_particle: case.set_up.particle.is_some(),
            has_tuned_mass: case.set_up.tmd.is_some(),
            frames: Vec::new(),
        }
    }

    /// When they begin, s.
    #[must_use]
    pub fn from_s(&self) -> f64 {
        self.from_s
    }

    /// Time between two of them, s.
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The frames so far.
    #[must_use]
    pub fn all(&self) -> &[Frame] {
        &self.frames
    }

    fn frame(&self, piece: &dyn Piece, after_s: f64) -> Frame {
        let at = piece.at(after_s);
        let Some([places, particles, _]) = self.several else {
            let second = |is_there: bool| if is_there { vec![at.state.y_m()] } else { Vec::new() };
            return Frame {
                z_m: at.z_m,
                places_m: vec![at.state.x_m],
                particles_m: second(self.has_particle),
                tuned_masses_m: second(self.has_tuned_mass),
            };
        };
        let mut values = Vec::new();
        piece.places_at(after_s, &mut values);
        // Displacement and acceleration of each place come first.
        let (of_places, bodies) = values.split_at((2 * places).min(values.len()));
        let (of_particles, tuned) = bodies.split_at(particles.min(bodies.len()));
        Frame {
            z_m: at.z_m,
            places_m: of_places.iter().step_by(2).copied().collect(),
            particles_m: of_particles.to_vec(),
            tuned_masses_m: tuned.to_vec(),
        }
    }
}

impl Viewer for Frames {
    fn pieces_from_s(&self) -> f64 {
        self.from_s
    }

    fn piece(&mut self, piece: &dyn Piece) {
        while self.frames.len() < self.count {
            let t_s = self.from_s + self.frames.len() as f64 * self.step_s;
            let (after_s, length_s) = (t_s - piece.start_s(), piece.length_s());
            if after_s > length_s + 4.0 * f64::EPSILON * t_s {
                return;
            }
            let frame = self.frame(piece, after_s.clamp(0.0, length_s));
            self.frames.push(frame);
        }
    }
}
