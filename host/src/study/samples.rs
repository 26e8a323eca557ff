//! Values of the axes that stand for all points of a study or a search: with them the case is checked before it begins, and what is set
//! in the model is compared with what is read.

use super::axis::{AxisValue, AxisValues, StudyAxis};
use super::distribution::Distribution;
use super::points::StudyPoints;

/// Most corners of a grid.
const MAX_CORNERS: u32 = 64;

/// Most values of one axis.
const MAX_VALUES: usize = 1_000;

/// Given points, besides those with extreme values.
const GIVEN: usize = 32;

/// The corners of the grid; of given points some, in place of the ends of their axes.
pub(super) fn of(axes: &[StudyAxis], points: &StudyPoints) -> Vec<Vec<AxisValue>> {
    let Some(rows) = points.given().map(given) else { return corners(axes) };
    let grid: Vec<StudyAxis> = axes.iter().filter(|axis| !is_given(axis)).cloned().collect();
    let ends = corners(&grid);
    // The given axes come first.
    let with = |row: &[f64], end: &[AxisValue]| {
        row.iter().copied().map(AxisValue::Number).chain(end.iter().cloned()).collect()
    };
    // All corners with one point, and one corner with each.
    let of_first = ends.iter().map(|end| with(rows[0], end));
    of_first.chain(rows.iter().zip(ends.iter().cycle()).map(|(row, end)| with(row, end))).collect()
}

/// Points with the least and the largest value of each key, and some between.
fn given(rows: &[Vec<f64>]) -> Vec<&[f64]> {
    let mut places: Vec<usize> = (0..GIVEN).map(|n| n * rows.len() / GIVEN).collect();
    for key in 0..rows[0].len() {
        let by_value = |a: &usize, b: &usize| rows[*a][key].total_cmp(&rows[*b][key]);
        places.extend((0..rows.len()).min_by(by_value));
        places.extend((0..rows.len()).max_by(by_value));
    }
    places.sort_unstable();
    places.dedup();
    places.into_iter().map(|place| rows[place].as_slice()).collect()
}

fn is_given(axis: &StudyAxis) -> bool {
    matches!(axis.values, AxisValues::Given { .. })
}

/// The corners of the grid of some axes, or the first of them.
pub(crate) fn corners(axes: &[StudyAxis]) -> Vec<Vec<AxisValue>> {
    let ends: Vec<[AxisValue; 2]> = axes.iter().filter_map(ends).collect();
    let corners = 1u32.checked_shl(ends.len() as u32).map_or(MAX_CORNERS, |all| all.min(MAX_CORNERS));
    let corner = |corner: u32| {
        let end = |(place, ends): (usize, &[AxisValue; 2])| ends[(corner >> place.min(31) & 1) as usize].clone();
        ends.iter().enumerate().map(end).collect()
    };
    (0..corners).map(corner).collect()
}

/// Both ends of an axis.
fn ends(axis: &StudyAxis) -> Option<[AxisValue; 2]> {
    let mut values = axis.checked_values();
    let last = values.pop()?;
    let first = values.into_iter().next().unwrap_or_else(|| last.clone());
    Some([first, last])
}

/// Each value of each axis with the `first` ones of the others. Values of given points have no such place.
pub(crate) fn each_alone(axes: &[StudyAxis], first: &[AxisValue]) -> Vec<Vec<AxisValue>> {
    let values = |axis: &StudyAxis| if is_given(axis) { Vec::new() } else { axis.checked_values() };
    alone(axes, first, |axis| values(axis).into_iter().take(MAX_VALUES).collect())
}

/// The least, a middle and the largest number of each axis with the `first` values of the others.
pub(super) fn ends_and_middles(axes: &[StudyAxis], first: &[AxisValue]) -> Vec<Vec<AxisValue>> {
    let values = |axis: &StudyAxis| {
        let (mut numbers, is_list) = match &axis.values {
            AxisValues::Numbers(numbers) => (numbers.clone(), true),
            AxisValues::Drawn(Distribution { from, to, .. }) | AxisValues::Given { from, to } => {
                (vec![*from, *to], false)
            }
            AxisValues::Words(_) => return Vec::new(),
        };
        numbers.sort_by(f64::total_cmp);
        let (least, largest) = (numbers[0], numbers[numbers.len() - 1]);
        let middle = if is_list { numbers[numbers.len() / 2] } else { 0.5 * (least + largest) };
        [least, middle, largest].map(AxisValue::Number).into()
    };
    alone(axes, first, values)
}

fn alone(
    axes: &[StudyAxis],
    first: &[AxisValue],
    values: impl Fn(&StudyAxis) -> Vec<AxisValue>,
) -> Vec<Vec<AxisValue>> {
    let of = |(place, axis): (usize, &StudyAxis)| {
        let with = |value: AxisValue| {
            let mut alone = first.to_vec();
            alone[place] = value;
            alone
        };
        values(axis).into_iter().map(with).collect::<Vec<_>>()
    };
    axes.iter().enumerate().flat_map(of).collect()
}

/// Whether [`each_alone`] has every value of an axis, or values between which it lies.
pub(super) fn are_all_checked(axis: &StudyAxis) -> bool {
    match &axis.values {
        AxisValues::Numbers(numbers) => numbers.len() <= MAX_VALUES || numbers.is_sorted(),
        AxisValues::Words(_) | AxisValues::Drawn(_) | AxisValues::Given { .. } => true,
    }
}

/// The `first` values of all axes, with every combination of words.
pub(super) fn combinations_of_words(axes: &[StudyAxis], first: &[AxisValue]) -> Vec<Vec<AxisValue>> {
    let mut all: Vec<Vec<AxisValue>> = vec![Vec::new()];
    for (axis, own) in axes.iter().zip(first) {
        let values =
            if matches!(axis.values, AxisValues::Words(_)) { axis.checked_values() } else { vec![own.clone()] };
        let with = |before: &Vec<AxisValue>| -> Vec<Vec<AxisValue>> {
            values.iter().map(|value| before.iter().cloned().chain([value.clone()]).collect()).collect()
        };
        all = all.iter().flat_map(with).collect();
    }
    all
}
