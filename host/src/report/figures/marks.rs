//! Curves, points with their intervals and bands within a frame, as elements of SVG.

use super::FAMILY;
use super::axis::Frame;

/// Columns of points of the figure into which a band gathers its values.
const COLUMN: f64 = 1.0;

/// A clip path of the frame, by this name; what is drawn within it is cut at its borders.
pub(super) fn clip(frame: &Frame, name: &str) -> String {
    let (left, top, right, bottom) = frame.bounds;
    format!(
        "<defs><clipPath id=\"{name}\"><rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\"/></clipPath></defs>\n",
        right - left,
        bottom - top
    )
}

/// A curve through the points that can be drawn.
pub(super) fn curve(
    frame: &Frame,
    clip: &str,
    points: impl Iterator<Item = (f64, f64)>,
    stroke: &str,
    dash: &str,
) -> String {
    let drawn = points.filter(|(x, y)| frame.draws(*x, *y));
    let places: Vec<String> = drawn
        .map(|(x, y)| {
            let (x, y) = frame.exact_point(x, y);
            format!("{x:.1},{y:.1}")
        })
        .collect();
    format!(
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"1.8\" stroke-linejoin=\"round\" stroke-dasharray=\"{dash}\" \
         clip-path=\"url(#{clip})\"/>\n",
        places.join(" ")
    )
}

/// A point with its interval.
pub(super) fn point(frame: &Frame, clip: &str, (x, y): (f64, f64), [low, high]: [f64; 2], fill: &str) -> String {
    if !(frame.draws(x, y) && frame.draws(x, low) && frame.draws(x, high)) {
        return String::new();
    }
    let ((across, up), (_, lower), (_, upper)) =
        (frame.exact_point(x, y), frame.exact_point(x, low), frame.exact_point(x, high));
    format!(
        "<g clip-path=\"url(#{clip})\"><line x1=\"{across:.1}\" y1=\"{lower:.1}\" x2=\"{across:.1}\" y2=\"{upper:.1}\" stroke=\"{fill}\" \
         stroke-width=\"1.5\"/><circle cx=\"{across:.1}\" cy=\"{up:.1}\" r=\"3.2\" fill=\"{fill}\"/></g>\n"
    )
}

/// The lowest and highest of many values over each point of the abscissa, as a filled band.
pub(super) fn band(frame: &Frame, clip: &str, points: impl Iterator<Item = (f64, f64)>, fill: &str) -> String {
    let mut columns = std::collections::BTreeMap::<i64, (f64, f64)>::new();
    for (x, y) in points.filter(|(x, y)| frame.draws(*x, *y)) {
        let (across, up) = frame.exact_point(x, y);
        let column = columns.entry((across / COLUMN).round() as i64).or_insert((up, up));
        *column = (column.0.min(up), column.1.max(up));
    }
    let place = |(column, up): (&i64, f64)| format!("{:.1},{up:.1}", *column as f64 * COLUMN);
    let upper = columns.iter().map(|(column, (low, _))| place((column, *low)));
    let lower = columns.iter().rev().map(|(column, (_, high))| place((column, *high)));
    format!(
        "<polygon points=\"{}\" fill=\"{fill}\" stroke=\"{fill}\" stroke-width=\"0.8\" clip-path=\"url(#{clip})\"/>\n",
        upper.chain(lower).collect::<Vec<_>>().join(" ")
    )
}

/// A text that begins at this place. `words` are of the program and need no escapes.
pub(super) fn words((left, base): (i32, i32), size: f64, fill: &str, words: &str) -> String {
    format!(
        "<text x=\"{left}\" y=\"{base}\" font-family=\"{FAMILY}\" font-size=\"{size}\" fill=\"{fill}\">{words}</text>\n"
    )
}

/// An entry of a legend: a stroke, and words behind it.
pub(super) fn entry((left, base): (i32, i32), stroke: &str, dash: &str, text: &str) -> String {
    let y = base - 4;
    format!(
        "<line x1=\"{left}\" y1=\"{y}\" x2=\"{}\" y2=\"{y}\" stroke=\"{stroke}\" stroke-width=\"2.2\" stroke-dasharray=\"{dash}\"/>\n{}",
        left + 26,
        words((left + 32, base), 12.0, "#444444", text)
    )
}
