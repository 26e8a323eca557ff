//! Measures the largest |x| of every cycle of a run.

use super::{Displacement, Piece, Viewer};

/// Intervals of a piece in which an extremum is looked for: an arc has at most one, an interval of a record a few.
const INTERVALS: u32 = 4;

/// Largest |x| of each cycle. Memory grows with the number of cycles.
#[derive(Clone, Debug)]
pub struct CycleMaxima {
    cycle_s: f64,
    reached_s: f64,
    maxima_m: Vec<f64>,
}

impl CycleMaxima {
    /// For cycles of this length, s, from time 0.
    #[must_use]
    pub fn new(cycle_s: f64) -> Self {
        Self { cycle_s, reached_s: 0.0, maxima_m: Vec::new() }
    }

    /// The whole cycles so far, m.
    #[must_use]
    pub fn whole_m(&self) -> &[f64] {
        let whole = (self.reached_s / self.cycle_s * (1.0 + 1e-12)).floor() as usize;
        &self.maxima_m[..whole.min(self.maxima_m.len())]
    }
}

impl Viewer for CycleMaxima {
    fn piece(&mut self, piece: &dyn Piece) {
        let (start_s, length_s) = (piece.start_s(), piece.length_s());
        let mut from_s = 0.0;
        loop {
            // A boundary that rounding puts at the start of the piece has been passed.
            let cycle = ((start_s + from_s) / self.cycle_s + 1e-9) as usize;
            let boundary_s = (cycle + 1) as f64 * self.cycle_s - start_s;
            let to_s = boundary_s.clamp(from_s, length_s);
            if cycle >= self.maxima_m.len() {
                self.maxima_m.resize(cycle + 1, 0.0);
            }
            self.maxima_m[cycle] =
                piece.largest_abs_m(Displacement::X, (from_s, to_s), INTERVALS, self.maxima_m[cycle]);
            if to_s >= length_s {
                break;
            }
            from_s = to_s;
        }
        self.reached_s = start_s + length_s;
    }
}

#[cfg(test)]
mod tests {
    use damprig_core::integrator::exact::{Exact, Excitation};
    use damprig_core::model::{Initial, SetUp, Structure};

    use crate::ExactObserver;

    use super::*;

    #[test]
    fn the_maxima_of_a_decay_fall_by_its_decrement_and_a_broken_cycle_is_left_out() {
        let set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.01));
        let initial = Initial { x_m: 0.035, ..Initial::default() };
        let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("a physical set-up");
        // Cycles of the damped period begin at maxima of |x|.
        let damped_s = 0.4 / (1.0_f64 - 1e-4).sqrt();
        let mut maxima = CycleMaxima::new(damped_s);
        motion.run(4.3, &mut ExactObserver::new(&mut maxima));
        let maxima_m = maxima.whole_m();
        assert_eq!(maxima_m.len(), 10);
        let decrement = (-0.01 * std::f64::consts::TAU / (1.0_f64 - 1e-4).sqrt()).exp();
        for (cycle, pair) in maxima_m.windows(2).enumerate() {
            assert!((pair[1] / pair[0] - decrement).abs() < 1e-9, "cycle {cycle}: {pair:?}");
        }
        assert!((maxima_m[0] - 0.035).abs() < 1e-12);
    }
}
