//! Observers of a motion: smooth pieces and impacts.

use damprig_core::integrator::modes::Sign;

use crate::linear::{C64, Rest};
use crate::mount::Mount;
use crate::system::System;

/// A particle meets a wall at a speed greater than zero: an impact on a hard wall, the first touch of a soft wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// Time, s.
    pub time_s: f64,
    /// Number of the impact damper.
    pub damper: usize,
    /// +1 at the wall on the positive side, −1 at the other.
    pub side: Sign,
    /// |y′ − x′| just before, m/s.
    pub approach_speed_m_per_s: f64,
}

/// What a piece is made of.
#[derive(Clone, Copy)]
pub(crate) struct Parts<'a> {
    pub mount: &'a Mount,
    pub system: &'a System,
    pub rest: &'a Rest,
    pub z: &'a [C64],
    pub offset_m: f64,
}

/// A piece of motion without an event inside.
pub struct Piece<'a> {
    parts: Parts<'a>,
    /// Start time, s.
    pub start_s: f64,
    /// Duration, s.
    pub length_s: f64,
}

impl<'a> Piece<'a> {
    pub(crate) fn new(parts: Parts<'a>, start_s: f64, length_s: f64) -> Self {
        Self { parts, start_s, length_s }
    }

    /// Displacement of a place from its shape (per modal coordinate) and its influence, m, and its velocity, m/s, at time
    /// `after_s` after the start.
    #[must_use]
    pub fn place(&self, shape: &[f64], influence: f64, after_s: f64) -> (f64, f64) {
        let Parts { mount, system, rest, z, offset_m } = self.parts;
        let influence = mount.share * influence;
        let signal = system.place(shape, influence);
        let mut here = (signal.constant(rest) + influence * offset_m, 0.0);
        for ((c, z), rate) in signal.coefficients.iter().zip(z).zip(&system.linear.natural.rates) {
            let term = c * z * (rate * after_s).exp();
            here.0 += term.re;
            here.1 += (rate * term).re;
        }
        here
    }
}

/// Receives a motion while it is computed.
pub trait Observer {
    /// Whether pieces are wanted.
    const PIECES: bool = false;

    /// A piece of motion without an event inside.
    fn piece(&mut self, _piece: &Piece) {}

    /// An impact.
    fn impact(&mut self, _impact: &Impact) {}

    /// Whether the motion goes on from time `time_s`.
    fn goes_on(&mut self, _time_s: f64) -> bool {
        true
    }
}

impl Observer for () {}
