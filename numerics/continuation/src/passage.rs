//! What a segment and the event at its end do to small disturbances: its transition matrix, corrected for the shift of the
//! event (saltation).

use nalgebra::{DMatrix, RowDVector};

use crate::flow::{STATE, Square, Vector, by_state, dot, exponential, times};

/// The derivative of a segment with its event, without units.
pub(crate) struct Passage {
    /// Derivative of the state after the event by the state at the start of the segment.
    pub matrix: DMatrix<f64>,
    /// Derivative of the duration of the segment by the same.
    pub delay: RowDVector<f64>,
    /// Size of the state before the event.
    pub size: f64,
    /// Size of the rates that a shift of the event multiplies.
    pub rate: f64,
    /// First derivative by time of the guard at the event.
    pub speed: f64,
    /// Second one.
    pub bend: f64,
}

impl Passage {
    /// A segment from the completed state `start` in the mode with the matrix `a`, to the event at which the row `guard` is
    /// zero. `reset` gives the rows of the state after it from the completed state before it.
    pub fn new(
        a: &Square<f64>,
        start: &Vector<f64>,
        duration: f64,
        guard: &Vector<f64>,
        reset: impl FnOnce(&Vector<f64>) -> [Vector<f64>; STATE],
    ) -> Self {
        let flow = exponential(a, duration);
        let end = times(&flow, start);
        let reset = reset(&end);
        let rate = times(a, &end);
        let by_state = by_state(&flow, start);
        let speed = dot(guard, &rate);
        let moved = |row: &Vector<f64>, k: usize| row.iter().zip(&by_state).map(|(r, by)| r * by[k]).sum::<f64>();
        // A disturbance shifts the event by −(∂g/∂q)/g′.
        let delay = RowDVector::from_fn(STATE, |_, k| -moved(guard, k) / speed);
        let rates = reset.each_ref().map(|row| dot(row, &rate));
        Self {
            matrix: DMatrix::from_fn(STATE, STATE, |row, k| moved(&reset[row], k) + rates[row] * delay[k]),
            size: dot(&end, &end).sqrt(),
            rate: rates.iter().map(|rate| rate * rate).sum::<f64>().sqrt(),
            bend: dot(guard, &times(a, &rate)),
            delay,
            speed,
        }
    }
}
