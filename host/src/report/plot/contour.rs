//! Lines of equal value on a grid.

use super::svg::PicturePlace;

/// The line along which values on a grid are `level`, as segments in places of the grid: 0, 0 is the first value, 1, 0 the next one of
/// its row. A cell with a corner that is not a number has no line.
#[must_use]
pub fn segments(values: &[f64], columns: usize, level: f64) -> Vec<[PicturePlace; 2]> {
    let mut found = Vec::new();
    let rows = values.len() / columns;
    for (row, column) in (1..rows).flat_map(|row| (1..columns).map(move |column| (row - 1, column - 1))) {
        let corners = [(column, row), (column + 1, row), (column + 1, row + 1), (column, row + 1)];
        let at = corners.map(|(column, row)| values[row * columns + column]);
        if at.iter().any(|value| value.is_nan()) {
            continue;
        }
        // Where each edge, from its corner to the next one, has the level.
        let crossing = |edge: usize| {
            let next = (edge + 1) % 4;
            let share =
                ((at[edge] < level) != (at[next] < level)).then(|| (level - at[edge]) / (at[next] - at[edge]))?;
            let between = |from: usize, to: usize| from as f64 + share * (to as f64 - from as f64);
            Some((between(corners[edge].0, corners[next].0), between(corners[edge].1, corners[next].1)))
        };
        let crossings: Vec<PicturePlace> = (0..4).filter_map(crossing).collect();
        match crossings[..] {
            [a, b] => found.push([a, b]),
            // A saddle: its middle decides which of the corners are apart.
            [a, b, c, d] if (at.iter().sum::<f64>() / 4.0 < level) == (at[0] < level) => found.extend([[a, b], [c, d]]),
            [a, b, c, d] => found.extend([[d, a], [b, c]]),
            _ => {}
        }
    }
    found
}

/// Segments that meet at their ends, as lines.
#[must_use]
pub fn joined(segments: Vec<[PicturePlace; 2]>) -> Vec<Vec<PicturePlace>> {
    let mut rest = segments;
    let mut lines = Vec::new();
    while let Some([from, to]) = rest.pop() {
        let mut line = std::collections::VecDeque::from([from, to]);
        while let Some((n, next)) = following(&rest, line[line.len() - 1]) {
            rest.swap_remove(n);
            line.push_back(next);
        }
        while let Some((n, before)) = following(&rest, line[0]) {
            rest.swap_remove(n);
            line.push_front(before);
        }
        lines.push(line.into());
    }
    lines
}

/// The segment that has this end, and its other end. Neighbouring cells cross their common edge at the same place but for rounding.
fn following(rest: &[[PicturePlace; 2]], end: PicturePlace) -> Option<(usize, PicturePlace)> {
    let is_there = |at: &PicturePlace| (at.0 - end.0).abs() + (at.1 - end.1).abs() < 1e-9;
    let of = |(n, [a, b]): (usize, &[PicturePlace; 2])| match (is_there(a), is_there(b)) {
        (true, _) => Some((n, *b)),
        (_, true) => Some((n, *a)),
        _ => None,
    };
    rest.iter().enumerate().find_map(of)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_segments_of_a_circle_are_one_closed_line() {
        let values: Vec<f64> = (0..121).map(|n| f64::hypot(f64::from(n % 11) - 5.0, f64::from(n / 11) - 5.0)).collect();
        let lines = joined(segments(&values, 11, 3.3));
        assert_eq!(lines.len(), 1);
        let (first, last) = (lines[0][0], lines[0][lines[0].len() - 1]);
        assert!((first.0 - last.0).abs() + (first.1 - last.1).abs() < 1e-9 && lines[0].len() > 20, "{lines:?}");
    }

    #[test]
    fn the_lines_of_a_plane_are_straight_and_reach_from_border_to_border() {
        let values: Vec<f64> = (0..12).map(|n| f64::from(n % 4) + 2.0 * f64::from(n / 4)).collect();
        let lines = segments(&values, 4, 2.5);
        assert!(lines.iter().flatten().all(|(x, y)| (x + 2.0 * y - 2.5).abs() < 1e-12), "{lines:?}");
        let has = |place: PicturePlace| lines.iter().flatten().any(|at| *at == place);
        assert!(has((2.5, 0.0)) && has((0.0, 1.25)), "{lines:?}");
    }

    #[test]
    fn a_saddle_has_two_lines_and_a_missing_corner_none() {
        for (middle, apart) in [(1.0, [(1.0, 0.0), (0.0, 1.0)]), (9.0, [(0.0, 0.0), (1.0, 1.0)])] {
            let lines = segments(&[0.0, middle, middle, 0.0], 2, 0.6 * middle.min(5.0));
            assert_eq!(lines.len(), 2);
            for [a, b] in &lines {
                // Each line runs around one corner.
                let is_near = |(x, y): &PicturePlace| [a, b].iter().all(|at| (at.0 - x).abs() + (at.1 - y).abs() < 1.0);
                assert!(apart.iter().any(is_near), "{middle}: {lines:?}");
            }
        }
        assert!(segments(&[0.0, 1.0, f64::NAN, 0.0], 2, 0.5).is_empty());
    }
}
