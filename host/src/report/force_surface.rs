//! The harmonic force surface: the base amplitude Z that keeps the response at an amplitude, over frequency and amplitude, from the
//! points of a run. A cut at constant Z is the whole response curve, its unstable parts included; where the cut turns back in frequency the
//! response at that Z jumps.

use damprig_core::control::response_loop::KeptQuantity;

use super::plot::contour;
use super::plot::svg::PicturePlace;
use crate::campaign::{Campaign, CampaignSetUp, Experiment};
use crate::prediction::loops::is_within;
use crate::run_folder::ResultRow;

/// The sheets of one `[[experiment]]` on a set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceSurface {
    /// Position of the set-up in the campaign.
    pub set_up: usize,
    /// Name of the experiment as written, without the amplitude.
    pub experiment: String,
    /// The quantity that was kept, with its unit.
    pub kept: KeptSurface,
    /// Kept amplitudes, in its unit, rising.
    pub amplitudes: Vec<f64>,
    /// Drive frequencies, Hz, rising.
    pub frequencies_hz: Vec<f64>,
    /// Z, m, a row for each amplitude; not a number where no point was measured or the amplitude was not held.
    pub z_m: Vec<f64>,
}

/// What was kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeptSurface {
    /// Its name.
    pub name: &'static str,
    /// Unit of its amplitudes.
    pub unit: &'static str,
}

/// A point at which a cut turns back in frequency: the response jumps there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fold {
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// The kept amplitude, in its unit.
    pub amplitude: f64,
    /// The cut has lower frequencies on both sides.
    pub is_highest: bool,
}

impl ForceSurface {
    /// The surfaces of a run, for each set-up those of its experiments that have points.
    #[must_use]
    pub fn of(campaign: &Campaign, rows: &[ResultRow]) -> Vec<Self> {
        let mut all = Vec::new();
        for (place, set_up) in campaign.set_ups.iter().enumerate() {
            let own = || campaign.experiments.iter().filter(|e| e.set_ups.contains(&place));
            let mut numbers: Vec<usize> =
                own().filter(|e| e.response_controlled().is_some()).map(|experiment| experiment.number).collect();
            numbers.dedup();
            for number in numbers {
                let sheets: Vec<&Experiment> = own().filter(|e| e.number == number).collect();
                all.extend(Self::of_sheets((place, set_up), &sheets, rows));
            }
        }
        all
    }

    fn of_sheets((place, set_up): (usize, &CampaignSetUp), sheets: &[&Experiment], rows: &[ResultRow]) -> Option<Self> {
        let first = sheets.first()?;
        let (kept, per) = match first.response_controlled()?.response_loop()?.response {
            KeptQuantity::Displacement { .. } => (KeptSurface { name: "x", unit: "mm" }, 1e3),
            KeptQuantity::Velocity { .. } => (KeptSurface { name: "velocity", unit: "m/s" }, 1.0),
            KeptQuantity::Relative { .. } => (KeptSurface { name: "x − z", unit: "mm" }, 1e3),
        };
        let amplitude = |sheet: &Experiment| Some(sheet.response_controlled()?.kept.as_ref()?.amplitude.value * per);
        let sorted = |values: &mut Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values.dedup();
        };
        let mut amplitudes: Vec<f64> = sheets.iter().filter_map(|sheet| amplitude(sheet)).collect();
        let mut frequencies_hz: Vec<f64> = first.frequencies_hz().to_vec();
        sorted(&mut amplitudes);
        sorted(&mut frequencies_hz);
        let cell = |level: f64, frequency_hz: f64| {
            let repeats = sheets.iter().filter(|sheet| amplitude(sheet) == Some(level));
            let held = repeats.filter_map(|sheet| {
                let parameters = sheet.response_controlled()?.response_loop()?;
                let is_own = |row: &&ResultRow| {
                    row.set_up == set_up.name && row.experiment == sheet.name && row.frequency_hz == frequency_hz
                };
                let row = rows.iter().find(is_own)?;
                let amplitudes = [row.x_amplitude_m, row.z_amplitude_m, row.phase_rad];
                let is_held = is_within(parameters, row.frequency_hz as f32, amplitudes);
                is_held.then_some(f64::from(row.z_amplitude_m))
            });
            let held: Vec<f64> = held.collect();
            if held.is_empty() { f64::NAN } else { held.iter().sum::<f64>() / held.len() as f64 }
        };
        let z_m = amplitudes.iter().flat_map(|level| frequencies_hz.iter().map(move |f| (*level, *f)));
        let z_m: Vec<f64> = z_m.map(|(level, f)| cell(level, f)).collect();
        let experiment = first.written.clone();
        let is_measured = z_m.iter().any(|z_m| z_m.is_finite());
        is_measured.then_some(Self { set_up: place, experiment, kept, amplitudes, frequencies_hz, z_m })
    }

    /// The cut at a base amplitude, m: lines of frequency (Hz) and kept amplitude.
    ///
    /// Z² is nearly a parabola over frequency, where Z has a kink at resonance; it is interpolated linearly within a cell of the grid.
    #[must_use]
    pub fn cut(&self, z_m: f64) -> Vec<Vec<(f64, f64)>> {
        let squares: Vec<f64> = self.z_m.iter().map(|z_m| z_m * z_m).collect();
        let segments = contour::segments(&squares, self.frequencies_hz.len(), z_m * z_m);
        let point =
            |(column, row): PicturePlace| (between(&self.frequencies_hz, column), between(&self.amplitudes, row));
        contour::joined(segments).into_iter().map(|line| line.into_iter().map(point).collect()).collect()
    }

    /// Where the cut at a base amplitude (m) turns back in frequency. Each is the vertex of the parabola through the three neighbouring
    /// points of the cut at measured amplitudes.
    #[must_use]
    pub fn folds(&self, z_m: f64) -> Vec<Fold> {
        let mut all = Vec::new();
        for line in self.cut(z_m) {
            let is_measured = |point: &&(f64, f64)| self.amplitudes.contains(&point.1);
            let mut points: Vec<(f64, f64)> = line.iter().filter(is_measured).copied().collect();
            points.dedup();
            if line.len() > 2 && is_same(line[0], line[line.len() - 1]) {
                // A closed line may turn back where it was begun.
                points.dedup_by(|later, earlier| is_same(*later, *earlier));
                points.extend_from_within(..points.len().min(2));
                points.dedup_by(|later, earlier| is_same(*later, *earlier));
            }
            for three in points.windows(3) {
                let [a, b, c] = [three[0], three[1], three[2]];
                // Not where the cut turns back in amplitude.
                let rises = (b.1 - a.1) * (c.1 - b.1) > 0.0;
                if rises && (b.0 - a.0) * (c.0 - b.0) < 0.0 {
                    let (amplitude, frequency_hz) = vertex([a, b, c]);
                    all.push(Fold { frequency_hz, amplitude, is_highest: b.0 > a.0 });
                }
            }
        }
        all
    }
}

/// Whether two points of a cut are the same but for rounding.
fn is_same(a: (f64, f64), b: (f64, f64)) -> bool {
    (a.0 - b.0).abs() < 1e-9 * a.0.abs() && (a.1 - b.1).abs() < 1e-9 * a.1.abs()
}

/// The value at a place between those of a list: 0 is the first.
fn between(values: &[f64], place: f64) -> f64 {
    let low = (place.floor() as usize).min(values.len() - 2);
    let share = place - low as f64;
    if share == 0.0 {
        values[low]
    } else if share == 1.0 {
        values[low + 1]
    } else {
        values[low] + share * (values[low + 1] - values[low])
    }
}

/// The vertex of the parabola of frequency over amplitude through three points of frequency and amplitude: amplitude and frequency.
fn vertex([a, b, c]: [(f64, f64); 3]) -> (f64, f64) {
    let (before, after) = ((b.0 - a.0) / (b.1 - a.1), (c.0 - b.0) / (c.1 - b.1));
    let bend = (after - before) / (c.1 - a.1);
    // Newton's form about b: f = b + slope·(A − Ab) + bend·(A − Ab)².
    let slope = before + bend * (b.1 - a.1);
    let step = -slope / (2.0 * bend);
    (b.1 + step, b.0 + slope * step + bend * step * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// f(A) at constant Z is a parabola in A, which turns at A = 3.
    #[test]
    fn the_fold_of_a_known_surface_is_found_at_its_vertex() {
        // Z = 1 along f = 3 − 0.02 (A − 3)², and Z² rises linearly with f beside it.
        let amplitudes: Vec<f64> = (0..9).map(|n| 1.1 + 0.5 * f64::from(n)).collect();
        let frequencies_hz: Vec<f64> = (0..21).map(|n| 2.8 + 0.02 * f64::from(n)).collect();
        let z_m = amplitudes.iter().flat_map(|a| {
            let own_hz = 3.0 - 0.02 * (a - 3.0) * (a - 3.0);
            frequencies_hz.iter().map(move |f| (1.0 + 2.0 * (f - own_hz)).sqrt())
        });
        let surface = ForceSurface {
            set_up: 0,
            experiment: "sheets".into(),
            kept: KeptSurface { name: "x", unit: "mm" },
            z_m: z_m.collect(),
            amplitudes,
            frequencies_hz,
        };
        let [cut] = &surface.cut(1.0)[..] else { panic!("{:?}", surface.cut(1.0)) };
        assert!(cut.len() > 9);
        let [fold] = surface.folds(1.0)[..] else { panic!("{:?}", surface.folds(1.0)) };
        assert!(fold.is_highest);
        assert!((fold.frequency_hz - 3.0).abs() < 1e-12 && (fold.amplitude - 3.0).abs() < 1e-9, "{fold:?}");
    }

    /// Z² = 1 on an ellipse: it turns back in frequency at both of its ends, wherever its line begins.
    #[test]
    fn both_folds_of_a_closed_cut_are_found() {
        let amplitudes: Vec<f64> = (0..9).map(|n| 1.05 + 0.5 * f64::from(n)).collect();
        let frequencies_hz: Vec<f64> = (0..21).map(|n| 2.8 + 0.02 * f64::from(n)).collect();
        let z_m = amplitudes.iter().flat_map(|a| {
            let across = move |f: &f64| ((f - 3.001) / 0.15).powi(2) + ((a - 3.0) / 1.6).powi(2);
            frequencies_hz.iter().map(move |f| across(f).sqrt())
        });
        let (experiment, kept) = ("sheets".into(), KeptSurface { name: "x", unit: "mm" });
        let surface = ForceSurface { set_up: 0, experiment, kept, z_m: z_m.collect(), amplitudes, frequencies_hz };
        let folds = surface.folds(1.0);
        assert_eq!(folds.iter().filter(|fold| fold.is_highest).count(), 1, "{folds:?}");
        assert_eq!(folds.len(), 2, "{folds:?}");
        // Z² is a parabola in a cell of 0.02 Hz, which a straight line misses by at most an eighth of its bend, 0.02²/0.15²/4.
        for (fold, at_hz) in folds.iter().map(|fold| (fold, if fold.is_highest { 3.151 } else { 2.851 })) {
            assert!((fold.frequency_hz - at_hz).abs() < 5e-3 && (fold.amplitude - 3.0).abs() < 0.1, "{fold:?}");
        }
    }
}
