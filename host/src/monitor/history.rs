//! Rows of telemetry in memory: the recent ones, bounded, and reduced for display so that extremes are kept.

use std::collections::BTreeMap;

use super::message::TimeRows;

/// Rows of telemetry, values row after row. A gap is a row of NaN.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TelemetryHistory {
    width: usize,
    t_s: Vec<f64>,
    values: Vec<f32>,
}

impl TelemetryHistory {
    /// An empty history of rows with this many values.
    #[must_use]
    pub fn new(width: usize) -> Self {
        Self { width: width.max(1), t_s: Vec::new(), values: Vec::new() }
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.t_s.len()
    }

    /// Time of the last row, s.
    #[must_use]
    pub fn last_s(&self) -> Option<f64> {
        self.t_s.last().copied()
    }

    /// Adds a row; missing values become NaN.
    pub fn push(&mut self, t_s: f64, row: &[f32]) {
        self.t_s.push(t_s);
        let own = row.iter().copied().chain(std::iter::repeat(f32::NAN));
        self.values.extend(own.take(self.width));
    }

    /// Adds a gap before the next row.
    pub fn push_gap(&mut self, t_s: f64) {
        self.push(t_s, &[]);
    }

    /// Mean of a column over the rows since a time, s; none without a value.
    #[must_use]
    pub fn mean_since(&self, column: usize, from_s: f64) -> Option<f32> {
        let (sum, count) =
            self.since(column, from_s).fold((0.0, 0u32), |(sum, count), value| (sum + f64::from(value), count + 1));
        (count > 0).then(|| (sum / f64::from(count)) as f32)
    }

    /// Largest absolute value of a column over the rows since a time, s; none without a value.
    #[must_use]
    pub fn largest_since(&self, column: usize, from_s: f64) -> Option<f32> {
        self.since(column, from_s).map(f32::abs).reduce(f32::max)
    }

    /// The known values of a column in the rows since a time, s.
    fn since(&self, column: usize, from_s: f64) -> impl Iterator<Item = f32> {
        let start = self.t_s.partition_point(|t_s| *t_s < from_s);
        let own = if column < self.width { &self.values[start * self.width..] } else { &[] };
        own.iter().skip(column).step_by(self.width).copied().filter(|value| value.is_finite())
    }

    /// The newest values of a column without a gap, oldest first, and the time from row to row, s.
    #[must_use]
    pub fn unbroken(&self, column: usize) -> (Vec<f32>, f64) {
        let values: Vec<f32> = self.values.iter().skip(column).step_by(self.width).copied().collect();
        let from = values.iter().rposition(|value| !value.is_finite()).map_or(0, |gap| gap + 1);
        let count = self.rows().saturating_sub(from);
        let step_s = if count > 1 { (self.t_s[self.rows() - 1] - self.t_s[from]) / (count - 1) as f64 } else { 0.0 };
        (values[from..].to_vec(), step_s)
    }

    /// Removes all rows.
    pub fn clear(&mut self) {
        self.t_s.clear();
        self.values.clear();
    }

    /// Removes the oldest rows when there are more than one and a half times `most`.
    pub fn bound(&mut self, most: usize) {
        if self.rows() > most + most / 2 {
            let surplus = self.rows() - most;
            self.t_s.drain(..surplus);
            self.values.drain(..surplus * self.width);
        }
    }

    /// The rows as columns. More than `most` rows are reduced to about `most` entries: two for each bucket of rows, the smallest
    /// and the largest value of each column in the order in which they occurred, and a gap if the bucket has one. The last
    /// `tail` rows are kept as they are.
    #[must_use]
    pub fn columns(&self, names: &[String], most: usize, tail: usize) -> TimeRows {
        let reduced_rows = if self.rows() > most { self.rows() - tail.min(most / 2) } else { 0 };
        let buckets = (most.saturating_sub(tail) / 2).max(1);
        let size = reduced_rows.div_ceil(buckets).max(1);
        let mut t_s = Vec::new();
        let mut columns = vec![Vec::new(); self.width];
        let mut start = 0;
        while start < reduced_rows {
            let end = (start + size).min(reduced_rows);
            self.reduce(start, end, &mut t_s, &mut columns);
            start = end;
        }
        for row in reduced_rows..self.rows() {
            t_s.push(self.t_s[row]);
            let values = &self.values[row * self.width..][..self.width];
            columns.iter_mut().zip(values).for_each(|(column, value)| column.push(known(*value)));
        }
        let values: BTreeMap<String, Vec<Option<f32>>> = names.iter().cloned().zip(columns).collect();
        TimeRows { t_s, values }
    }

    fn reduce(&self, start: usize, end: usize, t_s: &mut Vec<f64>, columns: &mut [Vec<Option<f32>>]) {
        let (first, last) = (self.t_s[start], self.t_s[end - 1]);
        t_s.extend([first, last]);
        let mut gap = false;
        for (index, column) in columns.iter_mut().enumerate() {
            let mut least: Option<(usize, f32)> = None;
            let mut most: Option<(usize, f32)> = None;
            for row in start..end {
                let value = self.values[row * self.width + index];
                if value.is_nan() {
                    gap |= self.values[row * self.width..][..self.width].iter().all(|v| v.is_nan());
                    continue;
                }
                if least.is_none_or(|(_, least)| value < least) {
                    least = Some((row, value));
                }
                if most.is_none_or(|(_, most)| value > most) {
                    most = Some((row, value));
                }
            }
            let ordered = match (least, most) {
                (Some(least), Some(most)) if least.0 <= most.0 => [Some(least.1), Some(most.1)],
                (Some(least), Some(most)) => [Some(most.1), Some(least.1)],
                _ => [None, None],
            };
            column.extend(ordered.map(|value| value.and_then(known)));
        }
        if gap {
            t_s.push(last);
            columns.iter_mut().for_each(|column| column.push(None));
        }
    }
}

/// A value that JSON can carry.
fn known(value: f32) -> Option<f32> {
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names() -> Vec<String> {
        vec!["x".into(), "z".into()]
    }

    fn sine(rows: u32) -> TelemetryHistory {
        let mut history = TelemetryHistory::new(2);
        for i in 0..rows {
            let x = (f64::from(i) * 0.1).sin() as f32;
            history.push(f64::from(i) * 1e-3, &[x, -x]);
        }
        history
    }

    #[test]
    fn few_rows_stay_as_they_are() {
        let rows = sine(100).columns(&names(), 100, 10);
        assert_eq!(rows.t_s.len(), 100);
        assert_eq!(rows.values["z"][99], Some(-(9.9f64.sin() as f32)));
    }

    #[test]
    fn a_reduction_keeps_extremes_and_the_newest_rows() {
        let mut history = sine(50_000);
        // One outlier in fifty thousand rows.
        history.values[2 * 31_337] = 7.0;
        let rows = history.columns(&names(), 400, 100);
        assert!(rows.t_s.len() <= 400 && rows.t_s.len() > 300, "{}", rows.t_s.len());
        assert!(rows.values["x"].contains(&Some(7.0)));
        assert!(rows.t_s.is_sorted());
        let tail = &rows.values["x"][rows.t_s.len() - 100..];
        assert_eq!(tail[99], Some((4999.9f64.sin()) as f32));
        assert_eq!(rows.values["x"].len(), rows.values["z"].len());
    }

    #[test]
    fn a_gap_survives_the_reduction() {
        let mut history = sine(1000);
        history.push_gap(1.0);
        (1500..3000).for_each(|i| history.push(f64::from(i) * 1e-3, &[0.0, 0.0]));
        let rows = history.columns(&names(), 100, 10);
        let gaps = rows.values["x"].iter().filter(|v| v.is_none()).count();
        assert_eq!(gaps, 1);
    }

    #[test]
    fn a_mean_is_of_the_newest_rows_of_its_column() {
        let mut history = TelemetryHistory::new(2);
        (0..2000u16).for_each(|i| history.push(f64::from(i) * 1e-3, &[f32::from(i / 1000), 7.0]));
        history.push_gap(2.0);
        assert_eq!((history.mean_since(0, 1.0), history.mean_since(1, 0.0)), (Some(1.0), Some(7.0)));
        assert_eq!((history.mean_since(0, 2.0), history.mean_since(2, 0.0)), (None, None));
        history.push(2.5, &[-9.0, 0.0]);
        assert_eq!((history.largest_since(0, 1.0), history.largest_since(1, 0.0)), (Some(9.0), Some(7.0)));
        assert_eq!((history.largest_since(0, 3.0), history.largest_since(2, 0.0)), (None, None));
    }

    #[test]
    fn the_newest_values_without_a_gap_have_an_even_spacing() {
        let mut history = sine(1000);
        history.push_gap(1.0);
        (0..500u16).for_each(|i| history.push(1.5 + f64::from(i) * 2e-3, &[f32::from(i), 0.0]));
        let (values, step_s) = history.unbroken(0);
        assert_eq!((values.len(), values[499]), (500, 499.0));
        assert!((step_s - 2e-3).abs() < 1e-12);
        history.push_gap(3.0);
        assert_eq!(history.unbroken(0), (Vec::new(), 0.0));
    }

    #[test]
    fn memory_is_bounded() {
        let mut history = TelemetryHistory::new(2);
        for i in 0..100_000 {
            history.push(f64::from(i), &[1.0]);
            history.bound(1000);
        }
        assert!(history.rows() <= 1500 && history.values.len() <= 3000);
        assert_eq!(history.last_s(), Some(99_999.0));
    }
}
