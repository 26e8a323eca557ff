//! The colours and dashes of the figures: a colour belongs to a set-up, a dash to its run.

use super::svg::{Colour, Style};

/// Text, axes and frames.
pub const INK: Colour = Colour(0x22, 0x22, 0x22);
/// Grid lines.
pub const PALE: Colour = Colour(0xdd, 0xdd, 0xdd);
/// Captions and secondary text.
pub const GREY: Colour = Colour(0x66, 0x66, 0x66);
/// Walls, and the pads on them.
pub const WALL: Colour = Colour(0xaa, 0xaa, 0xaa);
/// The background.
pub const WHITE: Colour = Colour(0xff, 0xff, 0xff);
/// Impacts, the best point, and what must be seen.
pub const MARKED: Colour = colour(5);

/// Number of distinct colours.
pub const COLOURS: usize = 12;

/// Colours that are distinct for colour-blind readers and in print: eight of Okabe & Ito, then four of Tol's muted scheme; repeated
/// after twelve.
#[must_use]
pub const fn colour(index: usize) -> Colour {
    const ALL: [Colour; COLOURS] = [
        Colour(0x00, 0x00, 0x00),
        Colour(0xe6, 0x9f, 0x00),
        Colour(0x56, 0xb4, 0xe9),
        Colour(0x00, 0x72, 0xb2),
        Colour(0xcc, 0x79, 0xa7),
        Colour(0xd5, 0x5e, 0x00),
        Colour(0x00, 0x9e, 0x73),
        Colour(0x99, 0x99, 0x33),
        Colour(0x88, 0x22, 0x55),
        Colour(0x33, 0x22, 0x88),
        Colour(0x44, 0xaa, 0x99),
        Colour(0xaa, 0xaa, 0xaa),
    ];
    ALL[index % COLOURS]
}

/// How a set-up looks in every figure of a page: `set_up` is its place among the set-ups, which gives the colour and the marker; `run`
/// the place of the curve among those of the set-up, which gives the dash.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Look {
    /// Place among the set-ups.
    pub set_up: usize,
    /// Place among the curves of the set-up.
    pub run: usize,
}

impl Look {
    /// The colour of the set-up.
    #[must_use]
    pub const fn colour(self) -> Colour {
        colour(self.set_up)
    }

    /// A line of this width, points. The live page has the same dashes.
    #[must_use]
    pub const fn line(self, width: f64) -> Style {
        const DASHES: [&str; 6] = ["", "6 4", "6 6", "6 8", "6 10", "6 12"];
        self.colour().stroke(width).dashed(DASHES[self.run % DASHES.len()])
    }
}

/// A colour of a scale from dark blue over green to yellow (viridis of matplotlib); `share` from 0 to 1.
#[must_use]
pub fn viridis(share: f64) -> Colour {
    const STOPS: [[u8; 3]; 8] = [
        [68, 1, 84],
        [70, 50, 127],
        [54, 92, 141],
        [39, 127, 143],
        [31, 162, 136],
        [74, 194, 110],
        [160, 219, 57],
        [254, 232, 37],
    ];
    let place = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let low = (place as usize).min(STOPS.len() - 2);
    let part = place - low as f64;
    let mixed =
        |n: usize| (f64::from(STOPS[low][n]) * (1.0 - part) + f64::from(STOPS[low + 1][n]) * part).round() as u8;
    Colour(mixed(0), mixed(1), mixed(2))
}
