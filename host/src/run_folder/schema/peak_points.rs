//! The journal's record of the points around a measured peak.

use serde::{Deserialize, Serialize};

use crate::campaign::AroundPeak;

/// The points that an experiment measures around its peak on a set-up. They follow from the results of its grid, once.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PeakPoints {
    /// Name of the set-up.
    pub set_up: String,
    /// Name of the experiment.
    pub experiment: String,
    /// The points.
    #[serde(flatten)]
    pub around: AroundPeak,
    /// Host time with its zone.
    pub at: String,
}

impl PeakPoints {
    /// Whether its frequencies can be run: it may have been damaged.
    #[must_use]
    pub fn is_consistent(&self) -> bool {
        self.around.frequencies_hz.iter().all(|f| f.is_finite() && *f > 0.0)
    }

    /// Whether they are not what was asked for: all of them between two neighbours of the peak.
    #[must_use]
    pub fn is_notable(&self) -> bool {
        self.around.frequencies_hz.is_empty() || self.around.peak.is_none_or(|peak| peak.is_at_end())
    }

    /// What is measured, and why, in words.
    #[must_use]
    pub fn text(&self) -> String {
        let place = format!("set-up {:?}, experiment {:?}", self.set_up, self.experiment);
        let count = self.around.frequencies_hz.len();
        let Some(peak) = self.around.peak else {
            return format!("{place}: no point has a valid X/Z, so that no points around its peak are measured");
        };
        let (peak_hz, [low, high]) = (peak.frequency_hz, peak.between_hz);
        let highest = format!("the highest X/Z (cycle maxima), at {peak_hz} Hz");
        if count == 0 {
            return format!("{place}: the frequencies beside {highest}, are too close for points between them");
        }
        let plural = if count == 1 { "" } else { "s" };
        let further = format!("{place}: {count} further point{plural} from {low} to {high} Hz");
        let second = self.around.second.map_or_else(String::new, |second| {
            let (second_hz, [low, high]) = (second.frequency_hz, second.between_hz);
            format!(", and from {low} to {high} Hz, around a second maximum at {second_hz} Hz that may be higher")
        });
        if peak.is_at_end() {
            let end = "that is the end of the grid, and the peak may lie outside";
            return format!("{further}, on the inner side of {highest}{second}: {end}");
        }
        format!("{further}, around {highest}{second}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::GridPeak;

    #[test]
    fn a_second_maximum_a_peak_at_an_end_and_none_are_said() {
        let with = |peak: Option<GridPeak>, frequencies_hz: &[f64]| PeakPoints {
            set_up: "bare".into(),
            experiment: "sweep".into(),
            around: AroundPeak { peak, second: None, frequencies_hz: frequencies_hz.to_vec() },
            at: String::new(),
        };
        let inside = GridPeak { frequency_hz: 2.5, between_hz: [2.4, 2.6] };
        let end = GridPeak { frequency_hz: 2.6, between_hz: [2.5, 2.6] };
        let usual = with(Some(inside), &[2.45, 2.55]);
        assert!(!usual.is_notable());
        assert_eq!(
            usual.text(),
            "set-up \"bare\", experiment \"sweep\": 2 further points from 2.4 to 2.6 Hz, around the highest X/Z (cycle maxima), at 2.5 Hz"
        );
        let second = Some(GridPeak { frequency_hz: 2.2, between_hz: [2.1, 2.3] });
        let shared = PeakPoints { around: AroundPeak { second, ..usual.around.clone() }, ..usual };
        let said = ", at 2.5 Hz, and from 2.1 to 2.3 Hz, around a second maximum at 2.2 Hz that may be higher";
        assert!(!shared.is_notable() && shared.text().ends_with(said), "{}", shared.text());
        for (points, said) in [
            (with(Some(end), &[2.55]), "1 further point from 2.5 to 2.6 Hz, on the inner side"),
            (with(Some(inside), &[]), "too close"),
            (with(None, &[]), "no point has a valid X/Z"),
        ] {
            assert!(points.is_notable() && points.text().contains(said), "{}", points.text());
        }
    }
}
