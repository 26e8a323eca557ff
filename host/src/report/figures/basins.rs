//! Draws basins of attraction: a rectangle for each start, in the colour of its attractor.

use super::study_map::{MapAxis, drawn, runs};
use crate::report::numbers::significant;
use crate::report::plot::axis::PlotFrame;
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{COLOURS, GREY, INK, WALL, WHITE, colour};
use crate::report::plot::svg::{Bounds, Colour, Font, Svg};
use crate::report::plot::{Picture, SMALL, TITLE};
use crate::study::basins::{Attractor, Basins, Grid};

const BOUNDS: Bounds = (92.0, 44.0, 720.0, 540.0);
const SIZE: (f64, f64) = (1100.0, 620.0);

/// In place of an attractor: none, and a particle that has passed its wall.
const LOST: f64 = -1.0;
const PASSED: f64 = -2.0;

/// Colours of attractors: those of curves without black and without the grey of walls.
const TINTS: usize = COLOURS - 2;

fn tint(place: usize) -> Colour {
    colour(1 + place % TINTS)
}

/// Draws the basins. `labels`: quantity and unit of the keys.
#[must_use]
pub fn draw(basins: &Basins, grid: &Grid, labels: [String; 2], title: &str) -> Picture {
    let [across, up] = grid.axes.each_ref().map(|axis| drawn(axis.values.len()));
    let [x, y] = [(0, &across), (1, &up)].map(|(n, places)| MapAxis {
        label: labels[n].clone(),
        values: places.iter().map(|place| grid.axes[n].values[*place]).collect(),
        is_log: false,
    });
    let frame = PlotFrame { x: x.axis(), y: y.axis(), bounds: BOUNDS };
    let (columns, edges) = (grid.axes[0].values.len(), (x.borders(), y.borders()));
    let mut picture = Picture::new(SIZE.0, SIZE.1);
    for (row, place) in up.iter().enumerate() {
        let end = |start: usize| match basins.ends[start] {
            Some(end) => end as f64,
            None if basins.passed[start] => PASSED,
            None => LOST,
        };
        let ends = across.iter().map(|column| end(place * columns + column));
        let ends: Vec<f64> = ends.collect();
        for (from, to) in runs(&ends, |a, b| a == b) {
            let cell = frame.cell((edges.0[from], edges.1[row]), (edges.0[to], edges.1[row + 1]));
            let fill = match ends[from] {
                LOST => WHITE,
                PASSED => WALL,
                place => tint(place as usize),
            };
            picture.rectangle(cell, fill.fill());
        }
    }
    picture.add(&frame.ticks());
    picture.add(&frame.edges());
    picture.text(title, (BOUNDS.0, BOUNDS.1 - 20.0), Font::new(TITLE, INK));
    legend::column(&mut picture, (BOUNDS.2 + 24.0, BOUNDS.1 + 10.0), &entries(basins));
    if across.len() < columns || up.len() < grid.axes[1].values.len() {
        let words = "Every value of an axis is in the table; the figure has some of them.";
        picture.text(words, (BOUNDS.0, SIZE.1 - 16.0), Font::new(SMALL, GREY));
    }
    picture
}

fn entries(basins: &Basins) -> Vec<LegendEntry> {
    let share =
        |starts: usize| format!("{} % of the starts", significant(100.0 * starts as f64 / basins.ends.len() as f64, 3));
    let sample = |fill: Colour| {
        let mut svg = Svg::default();
        svg.rectangle((-9.0, -8.0, 9.0, 8.0), fill.fill().edged(INK, 0.6));
        svg
    };
    let entry = |(place, of): (usize, &Attractor)| {
        LegendEntry::mark(format!("{}: {}", place + 1, of.description()), &sample(tint(place)))
            .with_detail(share(of.starts))
    };
    let mut entries: Vec<LegendEntry> = basins.attractors.iter().take(TINTS).enumerate().map(entry).collect();
    let rest: usize = basins.attractors.iter().skip(TINTS).map(|of| of.starts).sum();
    if rest > 0 {
        let words = format!("{} more, in the same colours again", basins.attractors.len() - TINTS);
        entries.push(LegendEntry::mark(words, &Svg::default()).with_detail(share(rest)));
    }
    let [lost, passed] = basins.without_attractor();
    for (starts, fill, words) in
        [(lost, WHITE, "does not settle or repeat"), (passed, WALL, "particle passes its wall")]
    {
        if starts > 0 {
            entries.push(LegendEntry::mark(words, &sample(fill)).with_detail(share(starts)));
        }
    }
    entries
}
