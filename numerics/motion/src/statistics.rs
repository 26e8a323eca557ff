//! Statistics of a motion: its [`Response`] (extrema, mean square, cycle maxima) from the pieces of any driver, and its last cycles. Memory is
//! constant.

use damprig_core::integrator::exact::response::{NODES, Response};
use serde::Serialize;

use super::{AccumulationRecord, Displacement, ImpactRecord, Piece, Viewer};

/// The largest magnitude of a displacement between two times of a piece, if above `least_m`. The piece is divided into `parts`
/// intervals with at most one extremum each, where the rate changes its sign.
pub(crate) fn largest_abs_m<P: Piece + ?Sized>(
    piece: &P,
    of: Displacement,
    (from_s, to_s): (f64, f64),
    parts: u32,
    least_m: f64,
) -> f64 {
    let at = |after_s: f64| of.of(&piece.at(after_s));
    let mut largest = least_m;
    let mut last = (from_s, at(from_s));
    for part in 1..=parts {
        let end_s = from_s + (to_s - from_s) * f64::from(part) / f64::from(parts);
        let end = (end_s, at(end_s));
        largest = largest.max(last.1.0.abs()).max(end.1.0.abs());
        if last.1.1 * end.1.1 < 0.0 {
            largest = largest.max(turning_point(at, (last.0, last.1.1), (end.0, end.1.1)));
        }
        last = end;
    }
    largest
}

/// ∫ of a displacement's square over a piece, m²·s, by eight-point quadrature.
pub(crate) fn square_m2_s<P: Piece + ?Sized>(piece: &P, of: Displacement) -> f64 {
    let half_s = 0.5 * piece.length_s();
    let square = |at_s: f64| of.of(&piece.at(at_s)).0.powi(2);
    let pairs =
        NODES.iter().map(|(node, weight)| weight * (square(half_s * (1.0 - node)) + square(half_s * (1.0 + node))));
    half_s * pairs.sum::<f64>()
}

/// |value| where the rate is zero between two times, by bracketed secant steps (Illinois).
fn turning_point(at: impl Fn(f64) -> (f64, f64), mut low: (f64, f64), mut high: (f64, f64)) -> f64 {
    let mut largest = 0.0_f64;
    for _ in 0..40 {
        let at_s = low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1);
        let (value, rate) = at(at_s);
        largest = largest.max(value.abs());
        // A further step would change the value by less than rounding.
        if rate == 0.0 || (rate * (high.0 - low.0)).abs() <= 1e-16 * value.abs() {
            break;
        }
        if rate * high.1 < 0.0 {
            low = high;
        } else {
            low.1 *= 0.5;
        }
        high = (at_s, rate);
    }
    largest
}

/// The exact engine shows its arcs to a response as an observer, which is faster because arcs are skipped by their bounds.
impl Viewer for Response {
    fn piece(&mut self, piece: &dyn Piece) {
        let (start_s, length_s) = (piece.start_s(), piece.length_s());
        let largest = |from_s, to_s, least_m| piece.largest_abs_m(Displacement::X, (from_s, to_s), 1, least_m);
        self.take_x([start_s, start_s + length_s], length_s, |after_s| after_s, largest);
        let add_squares = |square_m2_s: &mut f64, relative_square_m2_s: &mut f64| {
            *square_m2_s += piece.square_m2_s(Displacement::X);
            *relative_square_m2_s += piece.square_m2_s(Displacement::XMinusZ);
        };
        self.take_whole(length_s, add_squares, |least_m| {
            piece.largest_abs_m(Displacement::XMinusZ, (0.0, length_s), 1, least_m)
        });
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        self.take_impact(impact.t_s, impact.side, impact.approach_speed_m_per_s);
    }

    fn accumulation(&mut self, _: &AccumulationRecord) {
        self.take_accumulation();
    }
}

/// Largest relative difference that counts as none: of the last cycles' maxima from their mean, between the states of a
/// periodic motion, between a motion and its orbit.
pub const STEADY: f64 = 1e-3;

/// Cycles averaged at the end of a run; twice as many must agree for a steady motion.
const COMPARED: usize = 10;

/// Measures the last cycles of a run: their maxima and impacts.
#[derive(Clone, Debug)]
pub struct LastCyclesMeter {
    cycle_s: f64,
    from_s: f64,
    maxima_m: [f64; 2 * COMPARED],
    impacts: u64,
}

/// The last cycles of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LastCycles {
    /// Mean of the last ten cycles' largest |x|, m.
    pub mean_cycle_max_m: f64,
    /// Largest relative departure from that mean among the last twenty.
    pub spread: f64,
    /// Impacts per cycle in the last ten.
    pub impacts_per_cycle: f64,
}

impl LastCycles {
    /// Whether the largest |x| of a cycle is steady.
    #[must_use]
    pub fn is_steady(&self) -> bool {
        self.spread < STEADY
    }
}

impl LastCyclesMeter {
    /// For a run of `duration_s`; `None` if it is shorter than twenty cycles.
    #[must_use]
    pub fn new(cycle_s: f64, duration_s: f64) -> Option<Self> {
        let from_s = duration_s - 2.0 * COMPARED as f64 * cycle_s;
        (from_s >= -1e-9 * duration_s).then_some(Self { cycle_s, from_s, maxima_m: [0.0; 2 * COMPARED], impacts: 0 })
    }

    /// The result; `None` before the end of the run.
    #[must_use]
    pub fn last_cycles(&self) -> Option<LastCycles> {
        let last = &self.maxima_m[COMPARED..];
        let mean = last.iter().sum::<f64>() / COMPARED as f64;
        if *self.maxima_m.last()? == 0.0 {
            return None;
        }
        let spread = self.maxima_m.iter().fold(0.0_f64, |most, m| most.max((m / mean - 1.0).abs()));
        Some(LastCycles { mean_cycle_max_m: mean, spread, impacts_per_cycle: self.impacts as f64 / COMPARED as f64 })
    }
}

impl Viewer for LastCyclesMeter {
    fn pieces_from_s(&self) -> f64 {
        self.from_s
    }

    fn piece(&mut self, piece: &dyn Piece) {
        let (start_s, length_s) = (piece.start_s(), piece.length_s());
        let mut at_s = (self.from_s - start_s).max(0.0);
        while at_s < length_s {
            let cycle = (((start_s + at_s - self.from_s) / self.cycle_s + 1e-9) as usize).min(2 * COMPARED - 1);
            let boundary_s = self.from_s + (cycle + 1) as f64 * self.cycle_s - start_s;
            let is_last = cycle == 2 * COMPARED - 1 || boundary_s <= at_s;
            let to_s = if is_last { length_s } else { boundary_s.min(length_s) };
            self.maxima_m[cycle] = piece.largest_abs_m(Displacement::X, (at_s, to_s), 4, self.maxima_m[cycle]);
            at_s = to_s;
        }
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        if impact.t_s >= self.from_s + COMPARED as f64 * self.cycle_s {
            self.impacts += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MotionState, Phase};
    use damprig_core::integrator::exact::flow::ExactState;
    use damprig_core::integrator::exact::response::Wanted;
    use damprig_core::integrator::modes::{Contact, Grip, Mode};

    /// x = 2 cos(3t + 0.4), z = 0.5 cos(3t).
    struct Cosine {
        start_s: f64,
        length_s: f64,
    }

    impl Piece for Cosine {
        fn start_s(&self) -> f64 {
            self.start_s
        }

        fn length_s(&self) -> f64 {
            self.length_s
        }

        fn at(&self, after_s: f64) -> MotionState {
            let t_s = self.start_s + after_s;
            let (sine, cosine) = (3.0 * t_s + 0.4).sin_cos();
            let state = ExactState { x_m: 2.0 * cosine, v_m_per_s: -6.0 * sine, ..ExactState::default() };
            let (sine, cosine) = (3.0 * t_s).sin_cos();
            MotionState { t_s, state, z_m: 0.5 * cosine, base_velocity_m_per_s: -1.5 * sine }
        }

        fn phase(&self) -> Phase {
            Phase { mode: Mode { grip: Grip::Absent, contact: Contact::Absent }, pressing: false }
        }
    }

    fn show(viewer: &mut impl Viewer, pieces: u32) {
        let length_s = 20.0 * std::f64::consts::TAU / 3.0 / f64::from(pieces);
        for n in 0..pieces {
            viewer.piece(&Cosine { start_s: f64::from(n) * length_s, length_s });
        }
    }

    #[test]
    fn extrema_and_mean_square_of_a_cosine_are_its_own() {
        let cycle_s = Some(std::f64::consts::TAU / 3.0);
        let mut figures = Response::new(Wanted { cycle_s, steady_from_cycle: Some(5), whole_run: true });
        show(&mut figures, 1_237);
        figures.finish(20.0 * std::f64::consts::TAU / 3.0);
        assert!((figures.max_abs_x_m() - 2.0).abs() < 1e-14);
        assert!((figures.rms_x_m() - 2.0_f64.sqrt()).abs() < 1e-13);
        // |2 e^{0.4i} − 0.5|
        let relative = (4.0 + 0.25 - 2.0 * 0.4_f64.cos()).sqrt();
        assert!((figures.max_abs_x_minus_z_m() - relative).abs() < 1e-14);
        assert!((figures.rms_x_minus_z_m() - relative / 2.0_f64.sqrt()).abs() < 1e-13);
        let (max, mean) = figures.steady_m().expect("fifteen cycles");
        assert!((max - 2.0).abs() < 1e-14 && (mean - 2.0).abs() < 1e-14);
    }

    #[test]
    fn a_steady_end_is_called_steady_and_needs_twenty_cycles() {
        let cycle_s = std::f64::consts::TAU / 3.0;
        assert!(LastCyclesMeter::new(cycle_s, 19.0 * cycle_s).is_none());
        let mut trend = LastCyclesMeter::new(cycle_s, 20.0 * cycle_s).expect("twenty");
        assert!(trend.last_cycles().is_none(), "before the first piece");
        show(&mut trend, 237);
        let last_cycles = trend.last_cycles().expect("after the last piece");
        assert!((last_cycles.mean_cycle_max_m - 2.0).abs() < 1e-12 && last_cycles.spread < 1e-12, "{last_cycles:?}");
    }
}
