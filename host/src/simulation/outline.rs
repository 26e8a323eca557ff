//! The outline of a motion for a picture: of every column of the picture the first, lowest, highest and last value, so
//! that nothing that can be seen is lost however long the run is. Memory is that of the columns.
//!
//! The columns begin narrow and are joined in pairs as the run goes on, so that a run that is stopped early is outlined as
//! well as one that comes to its end.

use super::motion::{ImpactRecord, Instant, Piece, Viewer};

/// What a quantity did within a column; each a time (s) and a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Its first value.
    pub first: (f64, f64),
    /// Its lowest.
    pub low: (f64, f64),
    /// Its highest.
    pub high: (f64, f64),
    /// Its last.
    pub last: (f64, f64),
}

impl Stretch {
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

    /// The four in the order of their times.
    #[must_use]
    pub fn in_order(&self) -> [(f64, f64); 4] {
        let inner = if self.low.0 < self.high.0 { [self.low, self.high] } else { [self.high, self.low] };
        [self.first, inner[0], inner[1], self.last]
    }
}

/// A column of the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Column {
    /// x, m.
    pub x_m: Option<Stretch>,
    /// y, m.
    pub y_m: Option<Stretch>,
    /// z, m.
    pub z_m: Option<Stretch>,
    /// The first impact on the walls at −d and +d: t (s) and y (m).
    pub impacts: [Option<(f64, f64)>; 2],
}

impl Column {
    fn join(this: Self, next: Self) -> Self {
        Self {
            x_m: Stretch::join(this.x_m, next.x_m),
            y_m: Stretch::join(this.y_m, next.y_m),
            z_m: Stretch::join(this.z_m, next.z_m),
            impacts: [this.impacts[0].or(next.impacts[0]), this.impacts[1].or(next.impacts[1])],
        }
    }
}

/// Halvings of the window with which the columns begin, at most: 2³⁰ is more than any run is interrupted at.
const HALVINGS: i32 = 30;

/// Evaluations of a piece at least: an arc is at most 0.8 rad long, so what lies between two of them is within 0.2 % of
/// the amplitude.
const LEAST: f64 = 8.0;

/// Gathers the outline of a window of the run.
#[derive(Clone, Debug)]
pub struct Outline {
    from_s: f64,
    to_s: f64,
    /// What the columns hold now, s: the window halved a whole number of times.
    held_s: f64,
    reached_s: f64,
    columns: Vec<Column>,
    impacts: u64,
    relative: bool,
    /// The base at the last instant seen, m.
    z_m: f64,
}

impl Outline {
    /// Of the time from `from_s` to `to_s` in `count` columns, rounded up to an even number.
    #[must_use]
    pub fn new(from_s: f64, to_s: f64, count: usize) -> Self {
        Self {
            from_s,
            to_s,
            held_s: (to_s - from_s) * 0.5_f64.powi(HALVINGS),
            reached_s: from_s,
            columns: vec![Column::default(); count.max(2).next_multiple_of(2)],
            impacts: 0,
            relative: false,
            z_m: 0.0,
        }
    }

    /// The same seen from the base: x − z and y − z, z left out. For a base that drifts.
    #[must_use]
    pub fn relative_to_base(mut self) -> Self {
        self.relative = true;
        self
    }

    /// Whether it is seen from the base.
    #[must_use]
    pub fn is_relative(&self) -> bool {
        self.relative
    }

    /// The window as far as the run has come, s.
    #[must_use]
    pub fn window_s(&self) -> (f64, f64) {
        (self.from_s, self.reached_s)
    }

    /// The columns from left to right.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Impacts within the window.
    #[must_use]
    pub fn impacts(&self) -> u64 {
        self.impacts
    }

    /// Whether anything was seen.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.columns.iter().all(|c| c.x_m.is_none())
    }

    fn width_s(&self) -> f64 {
        self.held_s / self.columns.len() as f64
    }

    /// Joins columns until they hold the time up to `t_s`.
    fn hold(&mut self, t_s: f64) {
        let whole_s = self.to_s - self.from_s;
        while t_s - self.from_s > self.held_s && self.held_s < whole_s {
            let half = self.columns.len() / 2;
            for n in 0..half {
                self.columns[n] = Column::join(self.columns[2 * n], self.columns[2 * n + 1]);
            }
            self.columns[half..].fill(Column::default());
            self.held_s *= 2.0;
        }
    }

    fn column(&mut self, t_s: f64) -> &mut Column {
        let place = ((t_s - self.from_s) / self.width_s()).max(0.0) as usize;
        let last = self.columns.len() - 1;
        &mut self.columns[place.min(last)]
    }

    fn take(&mut self, at: &Instant) {
        self.z_m = at.z_m;
        let (t_s, from_m) = (at.t_s, if self.relative { at.z_m } else { 0.0 });
        let column = self.column(t_s);
        Stretch::take(&mut column.x_m, t_s, at.state.x_m - from_m);
        Stretch::take(&mut column.y_m, t_s, at.state.y_m() - from_m);
        Stretch::take(&mut column.z_m, t_s, at.z_m - from_m);
    }
}

impl Viewer for Outline {
    fn piece(&mut self, piece: &impl Piece) {
        let start_s = piece.start_s();
        let from_s = (self.from_s - start_s).max(0.0);
        let to_s = (self.to_s - start_s).min(piece.length_s());
        if from_s > to_s {
            return;
        }
        self.reached_s = start_s + to_s;
        self.hold(self.reached_s);
        let step_s = (piece.length_s() / LEAST).min(0.5 * self.width_s());
        let count = ((to_s - from_s) / step_s).ceil().max(1.0) as u64;
        for n in 0..=count {
            self.take(&piece.at(from_s + (to_s - from_s) * (n as f64 / count as f64)));
        }
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        if !(self.from_s..=self.to_s).contains(&impact.t_s) {
            return;
        }
        self.impacts += 1;
        self.hold(impact.t_s);
        let side = usize::from(impact.side > 0);
        // Pieces end at impacts, so the last instant seen is this one.
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

        fn at(&self, after_s: f64) -> Instant {
            let t_s = self.start_s + after_s;
            let state = ExactState { x_m: (t_s / 10.0).powi(3) - 1.0, ..ExactState::default() };
            Instant { t_s, state, z_m: 5.0, ..Instant::default() }
        }

        fn phase(&self) -> Phase {
            Phase { mode: Mode { grip: Grip::Absent, contact: Contact::Absent }, pressing: false }
        }
    }

    fn seen(mut outline: Outline) -> Outline {
        // Pieces of very different lengths.
        let mut start_s = 0.0;
        for n in 0..1_000 {
            let length_s = if n % 10 == 0 { 0.0181 } else { 0.0091 };
            outline.piece(&Cubic { start_s, length_s });
            start_s += length_s;
        }
        outline
    }

    #[test]
    fn every_column_is_filled_and_no_extreme_is_lost_whatever_the_pieces() {
        for count in [4, 40, 5_000] {
            let outline = seen(Outline::new(0.0, 10.0, count));
            let stretches: Vec<Stretch> = outline.columns().iter().map(|c| c.x_m.expect("a value")).collect();
            assert!((stretches[0].low.1 + 1.0).abs() < 1e-12, "{count}");
            assert!(stretches[count - 1].high.1.abs() < 1e-12, "{count}");
            for pair in stretches.windows(2) {
                assert!(pair[1].low.1 >= pair[0].high.1, "rising through {count} columns");
            }
        }
    }

    #[test]
    fn a_run_that_is_stopped_early_still_fills_half_of_the_columns() {
        let outline = seen(Outline::new(0.0, 1e9, 100));
        let filled = outline.columns().iter().filter(|c| c.x_m.is_some()).count();
        assert!((50..=100).contains(&filled), "{filled}");
        assert!((outline.window_s().1 - 10.0).abs() < 1e-9);
        let high = outline.columns().iter().filter_map(|c| c.x_m).fold(-1.0, |high: f64, s| high.max(s.high.1));
        assert!(high.abs() < 1e-12, "the highest is kept: {high}");
    }

    #[test]
    fn a_window_takes_what_is_in_it() {
        let outline = seen(Outline::new(4.0, 5.0, 10));
        let x = |column: usize| outline.columns()[column].x_m.unwrap();
        assert!((x(0).first.1 - (0.064 - 1.0)).abs() < 1e-12 && (x(9).last.1 - (0.125 - 1.0)).abs() < 1e-12);
    }

    #[test]
    fn a_drifting_base_is_taken_out() {
        let outline = seen(Outline::new(0.0, 10.0, 10).relative_to_base());
        assert!((outline.columns()[0].x_m.unwrap().first.1 + 6.0).abs() < 1e-12);
        assert_eq!(outline.columns()[0].z_m.unwrap().high.1, 0.0);
    }

    #[test]
    fn of_many_impacts_in_a_column_the_first_is_drawn_and_all_are_counted() {
        let mut outline = Outline::new(0.0, 10.0, 10);
        for n in 0..100 {
            let t_s = 0.2 * f64::from(n);
            outline.impact(&ImpactRecord { t_s, side: 1, approach_speed_m_per_s: 1.0, y_m: t_s });
        }
        assert_eq!(outline.impacts(), 51);
        assert_eq!(outline.columns()[3].impacts, [None, Some((3.0, 3.0))]);
    }
}
