//! Envelope of a motion for a figure: first, lowest, highest and last value per column of pixels.
//!
//! No visible extremum is lost, however long the run is. Memory is that of the columns. Columns begin narrow and are merged
//! in pairs as the run goes on, so the envelope of a run that is stopped early is as detailed.

use super::motion::{ImpactRecord, MotionState, Piece, Viewer};

/// First, lowest, highest and last value of a quantity in a column, each with its time (s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueRange {
    /// First value.
    pub first: (f64, f64),
    /// Lowest value.
    pub low: (f64, f64),
    /// Highest value.
    pub high: (f64, f64),
    /// Last value.
    pub last: (f64, f64),
}

impl ValueRange {
    fn take(stretch: &mut Option<Self>, t_s: f64, value: f64) {
        let at = (t_s, value);
        match stretch {
            None => *stretch = Some(Self { first: at, low: at, high: at, last: at }),
            Some(s) => {
                if value < s.low.1 {
                    s.low = at;
                }
                if value > s.high.1 {
                    s.high = at;
                }
                s.last = at;
            }
        }
    }

    fn join(this: Option<Self>, next: Option<Self>) -> Option<Self> {
        let (Some(a), Some(b)) = (this, next) else { return this.or(next) };
        let low = if b.low.1 < a.low.1 { b.low } else { a.low };
        let high = if b.high.1 > a.high.1 { b.high } else { a.high };
        Some(Self { first: a.first, low, high, last: b.last })
    }

    /// The four values in order of time.
    #[must_use]
    pub fn in_order(&self) -> [(f64, f64); 4] {
        let inner = if self.low.0 < self.high.0 { [self.low, self.high] } else { [self.high, self.low] };
        [self.first, inner[0], inner[1], self.last]
    }
}

/// A column of the envelope.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnvelopeColumn {
    /// x, m.
    pub x_m: Option<ValueRange>,
    /// y, m.
    pub y_m: Option<ValueRange>,
    /// z, m.
    pub z_m: Option<ValueRange>,
    /// First impact on the walls at −d and +d: t (s) and y (m).
    pub impacts: [Option<(f64, f64)>; 2],
}

impl EnvelopeColumn {
    fn join(this: Self, next: Self) -> Self {
        Self {
            x_m: ValueRange::join(this.x_m, next.x_m),
            y_m: ValueRange::join(this.y_m, next.y_m),
            z_m: ValueRange::join(this.z_m, next.z_m),
            impacts: [this.impacts[0].or(next.impacts[0]), this.impacts[1].or(next.impacts[1])],
        }
    }
}

/// Columns begin with the window halved this many times: 2³⁰ is finer than any run needs.
const HALVINGS: i32 = 30;

/// Fewest evaluations per piece. An arc is at most 0.8 rad long, so the error between two evaluations is below 0.2 % of the
/// amplitude.
const MIN: f64 = 8.0;

/// Envelope of a window of the run.
#[derive(Clone, Debug)]
pub struct Envelope {
    from_s: f64,
    to_s: f64,
    /// Time that the columns cover now, s: the window halved a whole number of times.
    held_s: f64,
    reached_s: f64,
    columns: Vec<EnvelopeColumn>,
    impacts: u64,
    relative: bool,
    /// Last base displacement, m.
    z_m: f64,
}

impl Envelope {
    /// For the time from `from_s` to `to_s` in `count` columns, rounded up to an even number.
    #[must_use]
    pub fn new(from_s: f64, to_s: f64, count: usize) -> Self {
        Self {
            from_s,
            to_s,
            held_s: (to_s - from_s) * 0.5_f64.powi(HALVINGS),
            reached_s: from_s,
            columns: vec![EnvelopeColumn::default(); count.max(2).next_multiple_of(2)],
            impacts: 0,
            relative: false,
            z_m: 0.0,
        }
    }

    /// Uses x − z and y − z and leaves z out, for a base that drifts.
    #[must_use]
    pub fn relative_to_base(mut self) -> Self {
        self.relative = true;
        self
    }

    /// Whether displacements are relative to the base.
    #[must_use]
    pub fn is_relative(&self) -> bool {
        self.relative
    }

    /// Window up to the time reached, s.
    #[must_use]
    pub fn window_s(&self) -> (f64, f64) {
        (self.from_s, self.reached_s)
    }

    /// The columns from left to right.
    #[must_use]
    pub fn columns(&self) -> &[EnvelopeColumn] {
        &self.columns
    }

    /// Impacts within the window.
    #[must_use]
    pub fn impacts(&self) -> u64 {
        self.impacts
    }

    /// Whether no motion was seen.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.columns.iter().all(|c| c.x_m.is_none())
    }

    fn width_s(&self) -> f64 {
        self.held_s / self.columns.len() as f64
    }

    /// Merges columns until they cover the time up to `t_s`.
    fn hold(&mut self, t_s: f64) {
        let whole_s = self.to_s - self.from_s;
        while t_s - self.from_s > self.held_s && self.held_s < whole_s {
            let half = self.columns.len() / 2;
            for n in 0..half {
                self.columns[n] = EnvelopeColumn::join(self.columns[2 * n], self.columns[2 * n + 1]);
            }
            self.columns[half..].fill(EnvelopeColumn::default());
            self.held_s *= 2.0;
        }
    }

    fn column(&mut self, t_s: f64) -> &mut EnvelopeColumn {
        let place = ((t_s - self.from_s) / self.width_s()).max(0.0) as usize;
        let last = self.columns.len() - 1;
        &mut self.columns[place.min(last)]
    }

    fn take(&mut self, at: &MotionState) {
        self.z_m = at.z_m;
        let (t_s, from_m) = (at.t_s, if self.relative { at.z_m } else { 0.0 });
        let column = self.column(t_s);
        ValueRange::take(&mut column.x_m, t_s, at.state.x_m - from_m);
        ValueRange::take(&mut column.y_m, t_s, at.state.y_m() - from_m);
        ValueRange::take(&mut column.z_m, t_s, at.z_m - from_m);
    }
}

impl Viewer for Envelope {
    fn piece(&mut self, piece: &dyn Piece) {
        let start_s = piece.start_s();
        let from_s = (self.from_s - start_s).max(0.0);
        let to_s = (self.to_s - start_s).min(piece.length_s());
        if from_s > to_s {
            return;
        }
        self.reached_s = start_s + to_s;
        self.hold(self.reached_s);
        let step_s = (piece.length_s() / MIN).min(0.5 * self.width_s());
        let count = ((to_s - from_s) / step_s).ceil().max(1.0) as u64;
        for n in 0..=count {
            self.take(&piece.at(from_s + (to_s - from_s) * (n as f64 / count as f64)));
        }
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        if impact.y_m.is_nan() || !(self.from_s..=self.to_s).contains(&impact.t_s) {
            return;
        }
        self.impacts += 1;
        self.hold(impact.t_s);
        let side = usize::from(impact.side > 0);
        // Pieces end at impacts, so the last base displacement is that of the impact.
        let from_m = if self.relative { self.z_m } else { 0.0 };
        self.column(impact.t_s).impacts[side].get_or_insert((impact.t_s, impact.y_m - from_m));
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion::Phase;
    use super::*;
    use damprig_core::integrator::exact::flow::ExactState;
    use damprig_core::integrator::modes::{Contact, Grip, Mode};

    /// x = (t/10)³ − 1, the base at 5 m, from `start_s` on for `length_s`.
    struct Cubic {
        start_s: f64,
        length_s: f64,
    }

    impl Piece for Cubic {
        fn start_s(&self) -> f64 {
            self.start_s
        }

        fn length_s(&self) -> f64 {
            self.length_s
        }

        fn at(&self, after_s: f64) -> MotionState {
            let t_s = self.start_s + after_s;
            let state = ExactState { x_m: (t_s / 10.0).powi(3) - 1.0, ..ExactState::default() };
            MotionState { t_s, state, z_m: 5.0, ..MotionState::default() }
        }

        fn phase(&self) -> Phase {
            Phase { mode: Mode { grip: Grip::Absent, contact: Contact::Absent }, pressing: false }
        }
    }

    fn seen(mut envelope: Envelope) -> Envelope {
        // Pieces of different lengths.
        let mut start_s = 0.0;
        for n in 0..1_000 {
            let length_s = if n % 10 == 0 { 0.0181 } else { 0.0091 };
            envelope.piece(&Cubic { start_s, length_s });
            start_s += length_s;
        }
        envelope
    }

    #[test]
    fn every_column_is_filled_and_no_extremum_is_lost() {
        for count in [4, 40, 5_000] {
            let envelope = seen(Envelope::new(0.0, 10.0, count));
            let stretches: Vec<ValueRange> = envelope.columns().iter().map(|c| c.x_m.expect("a value")).collect();
            assert!((stretches[0].low.1 + 1.0).abs() < 1e-12, "{count}");
            assert!(stretches[count - 1].high.1.abs() < 1e-12, "{count}");
            for pair in stretches.windows(2) {
                assert!(pair[1].low.1 >= pair[0].high.1, "rising through {count} columns");
            }
        }
    }

    #[test]
    fn a_run_that_is_stopped_early_fills_at_least_half_of_the_columns() {
        let envelope = seen(Envelope::new(0.0, 1e9, 100));
        let filled = envelope.columns().iter().filter(|c| c.x_m.is_some()).count();
        assert!((50..=100).contains(&filled), "{filled}");
        assert!((envelope.window_s().1 - 10.0).abs() < 1e-9);
        let high = envelope.columns().iter().filter_map(|c| c.x_m).fold(-1.0, |high: f64, s| high.max(s.high.1));
        assert!(high.abs() < 1e-12, "the highest is kept: {high}");
    }

    #[test]
    fn a_window_keeps_only_its_own_time() {
        let envelope = seen(Envelope::new(4.0, 5.0, 10));
        let x = |column: usize| envelope.columns()[column].x_m.unwrap();
        assert!((x(0).first.1 - (0.064 - 1.0)).abs() < 1e-12 && (x(9).last.1 - (0.125 - 1.0)).abs() < 1e-12);
    }

    #[test]
    fn a_drifting_base_is_subtracted() {
        let envelope = seen(Envelope::new(0.0, 10.0, 10).relative_to_base());
        assert!((envelope.columns()[0].x_m.unwrap().first.1 + 6.0).abs() < 1e-12);
        assert_eq!(envelope.columns()[0].z_m.unwrap().high.1, 0.0);
    }

    #[test]
    fn a_column_keeps_its_first_impact_and_counts_all() {
        let mut envelope = Envelope::new(0.0, 10.0, 10);
        for n in 0..100 {
            let t_s = 0.2 * f64::from(n);
            envelope.impact(&ImpactRecord { t_s, side: 1, approach_speed_m_per_s: 1.0, y_m: t_s, damper: None });
        }
        assert_eq!(envelope.impacts(), 51);
        assert_eq!(envelope.columns()[3].impacts, [None, Some((3.0, 3.0))]);
    }
}
