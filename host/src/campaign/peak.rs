//! The points that a stepped sine measures around its peak once its grid is measured: where they are and in which order.
//! The prediction uses this for its predicted peak, the runner for the measured one.

use serde::{Deserialize, Serialize};

use super::SteppedSine;
use super::stepped_sine::to_nine_places;

/// Relative difference of two steps that counts as rounding.
const ROUNDING: f64 = 1e-6;

/// How far a curve may rise above a local maximum of its points, as a share of the difference to the lower neighbour. A parabola through
/// equally spaced points rises by an eighth at most (its vertex lies between two equal points); this is twice that.
pub const RISE_BETWEEN_POINTS: f64 = 0.25;

/// The points around the peak of a grid.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AroundPeak {
    /// The highest point of the grid; none if no point has a valid X/Z.
    pub peak: Option<GridPeak>,
    /// Another local maximum, between whose neighbours X/Z may be higher than at `peak`; none in older runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second: Option<GridPeak>,
    /// Drive frequencies in the order they are run, Hz; none of them is in the grid.
    pub frequencies_hz: Vec<f64>,
}

/// A local maximum of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GridPeak {
    /// Its drive frequency, Hz.
    pub frequency_hz: f64,
    /// The grid's frequencies below and above it, Hz; at an end of the grid the peak itself is one of the two.
    pub between_hz: [f64; 2],
}

impl GridPeak {
    /// Whether it is an end of the grid, so that the peak may lie outside.
    #[must_use]
    pub fn is_at_end(&self) -> bool {
        self.between_hz.contains(&self.frequency_hz)
    }
}

impl SteppedSine {
    /// Points that are measured around the peak of the grid; 0 for none.
    #[must_use]
    pub fn peak_points(&self) -> usize {
        self.peak_order.len()
    }

    /// The points around the highest of `measured`, which holds frequency (Hz) and X/Z of the grid's points. An X/Z counts if it is
    /// finite and greater than 0.
    ///
    /// The points lie between the grid's neighbours of the highest point; those of a second local maximum get half of them if the peak may
    /// be there: if, with [`RISE_BETWEEN_POINTS`], it reaches higher than the highest point. Of several the one that reaches highest counts.
    /// An odd point more is at the highest. Each is added on that side of a maximum which has the wider step, so that with an even number
    /// on an even grid the steps are equal; an odd one is on the side of the higher neighbour. Frequencies that the controller, which
    /// counts them in `f32`, cannot tell apart are left out.
    #[must_use]
    pub fn around_peak(&self, measured: &[(f64, f64)]) -> AroundPeak {
        let mut grid = self.frequencies_hz.clone();
        grid.sort_by(f64::total_cmp);
        let ratio = |frequency_hz: f64| {
            let own = measured.iter().find(|(own, _)| *own == frequency_hz).map(|(_, ratio)| *ratio);
            own.filter(|ratio| ratio.is_finite() && *ratio > 0.0)
        };
        let ratios: Vec<Option<f64>> = grid.iter().map(|f| ratio(*f)).collect();
        let Some((highest, second)) = maxima(&ratios) else { return AroundPeak::default() };
        let neighbours = |place: usize| [place.saturating_sub(1), (place + 1).min(grid.len() - 1)];
        let peak =
            |place: usize| GridPeak { frequency_hz: grid[place], between_hz: neighbours(place).map(|n| grid[n]) };
        let around = |place: usize, count: usize| {
            let [below, above] = neighbours(place).map(|n| ratios[n]);
            between(&peak(place), count, above > below)
        };
        let count = self.peak_points();
        let shared = if second.is_some() { count / 2 } else { 0 };
        let mut all = around(highest, count - shared);
        all.extend(second.into_iter().flat_map(|place| around(place, shared)));
        all.sort_by(f64::total_cmp);
        let mut found: Vec<f64> = Vec::new();
        for frequency_hz in all {
            let is_other = |known: &f64| *known as f32 != frequency_hz as f32;
            if grid.iter().chain(&found).all(is_other) {
                found.push(frequency_hz);
            }
        }
        if self.frequencies_hz.first() > self.frequencies_hz.last() {
            found.reverse();
        }
        let frequencies_hz = self.peak_order.iter().filter_map(|place| found.get(*place)).copied().collect();
        AroundPeak { peak: Some(peak(highest)), second: second.map(peak), frequencies_hz }
    }
}

/// The places of the highest point and of another local maximum that may reach higher; `None` without a valid point.
fn maxima(ratios: &[Option<f64>]) -> Option<(usize, Option<usize>)> {
    let highest_ratio = ratios.iter().flatten().copied().reduce(f64::max)?;
    let highest = ratios.iter().position(|own| *own == Some(highest_ratio))?;
    let reach = |place: usize| {
        let own = ratios[place]?;
        let neighbours = &ratios[place.saturating_sub(1)..ratios.len().min(place + 2)];
        let lower = neighbours.iter().flatten().copied().fold(own, f64::min);
        let is_maximum = place.abs_diff(highest) > 1 && neighbours.iter().flatten().all(|other| *other <= own);
        let reach = own + RISE_BETWEEN_POINTS * (own - lower);
        (is_maximum && reach > highest_ratio).then_some((place, reach))
    };
    let second = (0..ratios.len()).filter_map(reach).max_by(|a, b| a.1.total_cmp(&b.1));
    Some((highest, second.map(|(place, _)| place)))
}

/// `count` frequencies on both sides of a maximum, rising.
fn between(peak: &GridPeak, count: usize, is_higher_above: bool) -> Vec<f64> {
    let [low, high] = peak.between_hz;
    let widths = [peak.frequency_hz - low, high - peak.frequency_hz];
    let mut counts = [0_usize; 2];
    for _ in 0..count {
        let [below, above] = [0, 1].map(|side: usize| widths[side] / (counts[side] + 1) as f64);
        let is_even = (below - above).abs() <= ROUNDING * below.max(above);
        counts[usize::from(if is_even { is_higher_above } else { above > below })] += 1;
    }
    let spread = |from: f64, width: f64, count: usize| {
        (1..=count).map(move |n| to_nine_places(from + width * n as f64 / (count + 1) as f64))
    };
    spread(low, widths[0], counts[0]).chain(spread(peak.frequency_hz, widths[1], counts[1])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Campaign;
    use crate::input::Source;

    /// A grid from 2 to 3 Hz or back, with points around its peak.
    fn sine(grid: &str, start: &str, plan: &str) -> SteppedSine {
        let text = format!(
            "name = \"t\"\n[plan]\n{plan}\n[structure]\nmass_kg = 1.6\nnatural_frequency_hz = 2.5\ndamping_ratio = 0.0038\n\
             [[set_up]]\nname = \"bare\"\nbase_amplitude_m = 0.0004\n\
             [[experiment]]\nkind = \"stepped_sine\"\nfrequencies_hz = {{ {grid} }}\nstart = \"{start}\"\ndwell_s = 40\n"
        );
        let campaign = Campaign::parse(Source::new("t.toml", text)).unwrap();
        campaign.experiments[0].stepped_sine().unwrap().clone()
    }

    const RISING: &str = "from_hz = 2.0, to_hz = 3.0, step_hz = 0.1";
    const FALLING: &str = "from_hz = 3.0, to_hz = 2.0, step_hz = -0.1";

    /// X/Z of a resonance at a frequency.
    fn resonance(sine: &SteppedSine, natural_hz: f64) -> Vec<(f64, f64)> {
        let ratio = |f: f64| 1.0 / ((1.0 - (f / natural_hz).powi(2)).powi(2) + 1e-3).sqrt();
        sine.frequencies_hz.iter().map(|f| (*f, ratio(*f))).collect()
    }

    #[test]
    fn an_even_number_of_points_makes_the_steps_around_the_peak_equal() {
        for (grid, falls) in [(RISING, false), (FALLING, true)] {
            let sine = sine(&format!("{grid}, peak_points = 4"), "carry_over", "");
            let around = sine.around_peak(&resonance(&sine, 2.42));
            assert_eq!(around.peak, Some(GridPeak { frequency_hz: 2.4, between_hz: [2.3, 2.5] }));
            let mut expected = vec![2.333_333_333, 2.366_666_667, 2.433_333_333, 2.466_666_667];
            if falls {
                expected.reverse();
            }
            assert_eq!(around.frequencies_hz, expected);
        }
    }

    #[test]
    fn the_odd_point_is_on_the_side_of_the_higher_neighbour() {
        let sine = sine(&format!("{RISING}, peak_points = 3"), "from_rest", "");
        assert_eq!(sine.around_peak(&resonance(&sine, 2.42)).frequencies_hz, [2.35, 2.433_333_333, 2.466_666_667]);
        assert_eq!(sine.around_peak(&resonance(&sine, 2.38)).frequencies_hz, [2.333_333_333, 2.366_666_667, 2.45]);
    }

    #[test]
    fn of_uneven_steps_the_wider_one_is_divided_first() {
        // Points over the half-power bandwidth: 2.4905, 2.49525, 2.5, 2.50475, 2.5095 Hz.
        let sine = sine(&format!("{RISING}, resonance_points = 5, peak_points = 2"), "from_rest", "");
        let around = sine.around_peak(&resonance(&sine, 2.49));
        assert_eq!(around.peak.unwrap().between_hz, [2.4, 2.49525]);
        assert_eq!(around.frequencies_hz, [2.430_166_667, 2.460_333_333]);
    }

    #[test]
    fn at_an_end_of_the_grid_all_points_are_on_the_inner_side() {
        let sine = sine(&format!("{RISING}, peak_points = 4"), "from_rest", "");
        let low = sine.around_peak(&resonance(&sine, 1.9));
        assert!(low.peak.unwrap().is_at_end());
        assert_eq!(low.frequencies_hz, [2.02, 2.04, 2.06, 2.08]);
        let high = sine.around_peak(&resonance(&sine, 3.1));
        assert!(high.peak.unwrap().is_at_end());
        assert_eq!(high.frequencies_hz, [2.92, 2.94, 2.96, 2.98]);
    }

    /// X/Z of the grid of eleven points, from 2 Hz.
    fn shared(plan: &str, ratios: [f64; 11]) -> AroundPeak {
        let sine = sine(&format!("{RISING}, {plan}"), "from_rest", "");
        sine.around_peak(&sine.frequencies_hz.iter().copied().zip(ratios).collect::<Vec<_>>())
    }

    #[test]
    fn two_maxima_share_the_points_if_the_second_may_be_higher() {
        // A quarter of the difference to 4 makes 9.2 of 8.
        let with =
            |highest: f64| shared("peak_points = 8", [1.0, 4.0, 8.0, 5.0, 3.0, 2.0, 3.0, 6.0, highest, 6.0, 2.0]);
        let around = with(8.9);
        assert_eq!(around.peak, Some(GridPeak { frequency_hz: 2.8, between_hz: [2.7, 2.9] }));
        assert_eq!(around.second, Some(GridPeak { frequency_hz: 2.2, between_hz: [2.1, 2.3] }));
        let expected = [
            2.133_333_333,
            2.166_666_667,
            2.233_333_333,
            2.266_666_667,
            2.733_333_333,
            2.766_666_667,
            2.833_333_333,
            2.866_666_667,
        ];
        assert_eq!(around.frequencies_hz, expected);
        let alone = with(9.1);
        assert_eq!(alone.second, None);
        assert!(alone.frequencies_hz.len() == 8 && alone.frequencies_hz.iter().all(|f| *f > 2.7), "{alone:?}");
    }

    #[test]
    fn of_several_maxima_the_one_that_reaches_highest_shares_the_points() {
        // 7 + 6/4 reaches 8.5, 8 + 1/4 reaches 8.25.
        let around = shared("peak_points = 2", [1.0, 7.0, 1.0, 2.0, 7.0, 8.0, 7.0, 2.0, 6.0, 8.2, 6.0]);
        assert_eq!(around.second.unwrap().frequency_hz, 2.1);
        assert_eq!(around.frequencies_hz, [2.05, 2.85]);
        // Of an odd number the highest point has one more.
        let around = shared("peak_points = 3", [1.0, 7.0, 1.0, 2.0, 7.0, 8.0, 7.0, 2.0, 6.0, 8.2, 6.0]);
        assert_eq!(around.frequencies_hz, [2.05, 2.85, 2.95]);
        assert_eq!(shared("peak_points = 2", [1.0; 11]).second, None, "a flat response");
    }

    #[test]
    fn points_without_a_valid_ratio_have_no_peak() {
        let sine = sine(&format!("{RISING}, peak_points = 4"), "from_rest", "");
        let invalid = [f64::NAN, f64::INFINITY, 0.0, -1.0];
        let mut measured: Vec<(f64, f64)> =
            sine.frequencies_hz.iter().zip(invalid.iter().cycle()).map(|(f, x)| (*f, *x)).collect();
        assert_eq!(sine.around_peak(&measured), AroundPeak::default());
        assert_eq!(sine.around_peak(&[]), AroundPeak::default());
        measured[7].1 = 0.5;
        assert_eq!(sine.around_peak(&measured).peak.unwrap().frequency_hz, 2.7);
    }

    #[test]
    fn frequencies_that_are_equal_on_the_controller_are_measured_once() {
        // The numbers of the controller are 2.4e-7 Hz apart here.
        let sine = sine("from_hz = 2.5, to_hz = 2.500002, step_hz = 0.000001, peak_points = 40", "from_rest", "");
        let around = sine.around_peak(&[(2.500001, 1.0)]);
        let mut all: Vec<f32> = sine.frequencies_hz.iter().chain(&around.frequencies_hz).map(|f| *f as f32).collect();
        let count = all.len();
        all.sort_by(f32::total_cmp);
        all.dedup();
        assert_eq!(all.len(), count);
        assert!((4..=8).contains(&around.frequencies_hz.len()), "{around:?}");
    }

    #[test]
    fn in_a_random_order_the_same_points_are_shuffled() {
        let written = sine(&format!("{RISING}, peak_points = 12"), "from_rest", "");
        let random = sine(&format!("{RISING}, peak_points = 12"), "from_rest", "order = \"random\"");
        let measured = resonance(&written, 2.42);
        let (in_order, mut shuffled) = (written.around_peak(&measured), random.around_peak(&measured));
        assert_ne!(shuffled.frequencies_hz, in_order.frequencies_hz);
        shuffled.frequencies_hz.sort_by(f64::total_cmp);
        assert_eq!(shuffled, in_order);
    }
}
