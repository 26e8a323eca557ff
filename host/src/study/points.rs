//! The points of a study: a grid of the axes, or points drawn from their ranges or from outside times the grid of the others.

use std::sync::Arc;

use super::axis::{AxisValue, StudyAxis};
use super::given_points::GivenPoints;
use super::sampling::Sampling;

/// Points that are no grid.
#[derive(Clone, Debug, PartialEq)]
pub enum Scattered {
    /// Drawn from the ranges of some axes.
    Drawn(Sampling),
    /// From outside.
    Given(GivenPoints),
}

/// The points of a study. A row of the table is a point of the axes that are kept; the points of reduced axes become one.
#[derive(Clone, Debug)]
pub struct StudyPoints {
    kept: Vec<usize>,
    reduced: Vec<usize>,
    scattered: Vec<usize>,
    rows: Option<ScatteredValues>,
}

/// What each scattered point has for each scattered axis.
#[derive(Clone, Debug)]
enum ScatteredValues {
    Shares(Vec<Vec<f64>>),
    Values(Arc<Vec<Vec<f64>>>),
}

impl StudyPoints {
    /// Of axes, some of which may be scattered.
    #[must_use]
    pub fn new(axes: &[StudyAxis], scattered: Option<Scattered>) -> Self {
        let places = |of: &dyn Fn(&StudyAxis) -> bool| {
            axes.iter().enumerate().filter(|(_, axis)| of(axis)).map(|(place, _)| place).collect::<Vec<_>>()
        };
        let places_scattered = places(&StudyAxis::is_scattered);
        let rows = scattered.map(|scattered| match scattered {
            Scattered::Drawn(sampling) => ScatteredValues::Shares(sampling.shares(places_scattered.len())),
            Scattered::Given(given) => ScatteredValues::Values(given.rows),
        });
        Self {
            kept: places(&|axis| axis.reduce.is_none()),
            reduced: places(&|axis| axis.reduce.is_some()),
            scattered: places_scattered,
            rows,
        }
    }

    /// Places of the axes that are columns of the table.
    #[must_use]
    pub fn kept(&self) -> &[usize] {
        &self.kept
    }

    /// Places of the axes whose points become one.
    #[must_use]
    pub fn reduced(&self) -> &[usize] {
        &self.reduced
    }

    /// Points from outside.
    #[must_use]
    pub fn given(&self) -> Option<&[Vec<f64>]> {
        if let Some(ScatteredValues::Values(rows)) = &self.rows { Some(rows) } else { None }
    }

    /// Shares of the ranges that the scattered points have; none of points from outside.
    #[must_use]
    pub fn shares(&self) -> &[Vec<f64>] {
        if let Some(ScatteredValues::Shares(rows)) = &self.rows { rows } else { &[] }
    }

    /// Rows of the table; `None` if there are more than a program can count.
    #[must_use]
    pub fn rows(&self, axes: &[StudyAxis]) -> Option<u64> {
        let scattered = match &self.rows {
            None => 1,
            Some(ScatteredValues::Shares(rows)) => rows.len() as u64,
            Some(ScatteredValues::Values(rows)) => rows.len() as u64,
        };
        self.kept.iter().try_fold(scattered, |rows, &place| rows.checked_mul(axes[place].count() as u64))
    }

    /// Simulations behind a row, without several starts; `None` if there are more than a program can count.
    #[must_use]
    pub fn points_per_row(&self, axes: &[StudyAxis]) -> Option<u64> {
        self.reduced.iter().try_fold(1u64, |points, &place| points.checked_mul(axes[place].count() as u64))
    }

    /// The values of all axes at a point: the first axis varies slowest, a scattered point slower than any.
    #[must_use]
    pub fn values(&self, axes: &[StudyAxis], row: u64, point: u64) -> Vec<AxisValue> {
        let mut places = vec![0usize; axes.len()];
        let rest = unravel(row, &self.kept, axes, &mut places);
        unravel(point, &self.reduced, axes, &mut places);
        let value = |(place, axis): (usize, &StudyAxis)| {
            let dimension = self.scattered.iter().position(|scattered| *scattered == place);
            match (&self.rows, dimension) {
                (Some(ScatteredValues::Shares(rows)), Some(dimension)) => axis.value(0, rows[rest as usize][dimension]),
                (Some(ScatteredValues::Values(rows)), Some(dimension)) => {
                    AxisValue::Number(rows[rest as usize][dimension])
                }
                _ => axis.value(places[place], 0.0),
            }
        };
        axes.iter().enumerate().map(value).collect()
    }
}

/// Writes the place along each of the `chosen` axes; returns what is left of the number.
fn unravel(number: u64, chosen: &[usize], axes: &[StudyAxis], places: &mut [usize]) -> u64 {
    chosen.iter().rev().fold(number, |rest, &axis| {
        let count = axes[axis].count() as u64;
        places[axis] = (rest % count) as usize;
        rest / count
    })
}

#[cfg(test)]
mod tests {
    use super::super::axis::{AxisValues, Reduction};
    use super::super::distribution::Distribution;
    use super::*;
    use crate::study::sampling::SamplingMethod;

    fn axis(key: &str, values: AxisValues, reduce: Option<Reduction>) -> StudyAxis {
        StudyAxis { key: key.into(), values, is_log: false, reduce, span: 0..0, value_spans: Vec::new() }
    }

    #[test]
    fn rows_run_through_the_kept_axes_and_points_through_the_reduced_ones() {
        let number = AxisValues::Numbers;
        let axes = [
            axis("a", number(vec![1.0, 2.0]), None),
            axis("f", number(vec![7.0, 8.0, 9.0]), Some(Reduction::Maximum)),
            axis("b", number(vec![0.1, 0.2, 0.3]), None),
        ];
        let points = StudyPoints::new(&axes, None);
        assert_eq!((points.rows(&axes), points.points_per_row(&axes)), (Some(6), Some(3)));
        let at = |row, point| {
            let values = points.values(&axes, row, point);
            values.iter().map(|value| if let AxisValue::Number(n) = value { *n } else { f64::NAN }).collect::<Vec<_>>()
        };
        assert_eq!(at(0, 0), [1.0, 7.0, 0.1]);
        assert_eq!(at(1, 2), [1.0, 9.0, 0.2]);
        assert_eq!(at(5, 1), [2.0, 8.0, 0.3]);
    }

    #[test]
    fn draws_are_multiplied_by_the_grid_of_the_other_axes() {
        let axes = [
            axis("a", AxisValues::Drawn(Distribution::uniform(10.0, 20.0, false)), None),
            axis("w", AxisValues::Words(vec!["x".into(), "y".into()]), None),
        ];
        let points = StudyPoints::new(
            &axes,
            Some(Scattered::Drawn(Sampling { method: SamplingMethod::Sobol, count: 4, seed: 1 })),
        );
        assert_eq!(points.rows(&axes), Some(8));
        assert_eq!(points.values(&axes, 5, 0), [AxisValue::Number(17.5), AxisValue::Word("y".into())]);
    }
}
