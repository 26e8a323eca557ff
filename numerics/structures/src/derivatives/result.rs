//! What a motion is, with its derivatives.

use nalgebra::DVector;

use super::follow::{Follower, Purpose};
use super::setting::{Known, Sloped};
use super::{Derivatives, Derived, DerivedImpact, Largest, NoDerivatives, Varied};

/// A motion changes its events within this relative change of a quantity: it is said to graze. Chosen: a derivative that holds for less says nothing
/// about a design.
pub const GRAZING: f64 = 1e-6;

/// Two values are equally large within this share of them.
const TIE: f64 = 1e-9;

/// Derivatives of two equally large values differ if they do by this share of them.
const DIFFERENT: f64 = 1e-6;

impl Follower<'_> {
    /// Sees all places now.
    pub(super) fn see_places(&mut self, known: &Known) {
        let count = if self.purpose == Purpose::Map { 0 } else { self.peaks.len() };
        for place in 0..count {
            self.see(place, known.place(place, &self.w, &self.s));
        }
    }

    /// Keeps a displacement that may be the largest.
    pub(super) fn see(&mut self, place: usize, x: Sloped) {
        let (peaks, x) = (&mut self.peaks[place], x.absolute());
        let largest = peaks.iter().map(|peak| peak.value).fold(0.0, f64::max);
        if x.value >= largest * (1.0 - TIE) {
            if x.value > largest {
                peaks.retain(|peak| peak.value >= x.value * (1.0 - TIE));
            }
            peaks.push(x);
        }
    }

    pub(super) fn result(self, growth: f64, varied: &[Varied]) -> Result<Derivatives, NoDerivatives> {
        let holds_within = self.holds_within();
        let change = holds_within.iter().copied().fold(0.0, f64::max);
        if !holds_within.is_empty() && change < GRAZING {
            return Err(NoDerivatives::Grazing { change });
        }
        let derived = |of: &Sloped| {
            let by = of.slopes.iter().zip(varied).map(|(slope, varied)| slope / varied.value);
            Derived { value: of.value, by: by.collect() }
        };
        let largest = |all: &[Sloped]| {
            let most = all.iter().max_by(|a, b| a.value.total_cmp(&b.value))?;
            let is_as_large = |other: &&Sloped| other.value >= most.value * (1.0 - TIE);
            let differs = |other: &Sloped| {
                let pairs = other.slopes.iter().zip(most.slopes.iter()).take(varied.len());
                pairs.into_iter().any(|(a, b)| (a - b).abs() > DIFFERENT * most.value)
            };
            Some(Largest { of: derived(most), is_tie: all.iter().filter(is_as_large).any(differs) })
        };
        let length_s = self.time.value;
        let rms = |square: &Sloped| {
            let mean = square.value / length_s;
            let root = mean.sqrt();
            let slopes = if root > 0.0 {
                (&square.slopes - mean * &self.time.slopes) / (2.0 * root * length_s)
            } else {
                DVector::zeros(square.slopes.len())
            };
            derived(&Sloped { value: root, slopes })
        };
        let bodies = self.bodies();
        let state = (0..2 * bodies).map(|i| Sloped { value: self.w[i], slopes: self.s.row(i).transpose() });
        let speeds: Vec<Sloped> = self.impacts.iter().map(|(.., speed)| speed.clone()).collect();
        let impacts = self.impacts.iter().map(|(damper, time, speed)| DerivedImpact {
            damper: *damper,
            time_s: derived(time),
            approach_speed_m_per_s: derived(speed),
        });
        let none = || Largest { of: Derived { value: 0.0, by: vec![0.0; varied.len()] }, is_tie: false };
        Ok(Derivatives {
            end: state.map(|of| derived(&of)).collect(),
            impacts: impacts.collect(),
            largest_abs_m: self.peaks.iter().map(|peaks| largest(peaks).unwrap_or_else(none)).collect(),
            rms_m: self.squares.iter().map(rms).collect(),
            fastest_impact_m_per_s: largest(&speeds),
            growth,
            holds_within,
        })
    }
}
