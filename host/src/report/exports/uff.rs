//! Exports to universal files (UFF, UNV), dataset 58, for modal-analysis software: time histories and frequency responses.
//! `uff_dataset` writes the records.
//!
//! - A **time response** per signal and evenly spaced stretch: one set-up, experiment, segment and point, split where rows are
//!   missing or a value is not finite. Values have single precision (12 digits are printed).
//! - A **frequency response** x/z per set-up and experiment, from the results: X/Z (lock-in) and the phase of x relative
//!   to z, as complex numbers with the abscissa. A sweep is split where its direction changes; a falling branch is written in
//!   rising order and marked.
//! - **Degrees of freedom**: structure (x) node 1, base (z) node 2, other signals from node 11 in the order of the manifest,
//!   all +X. Signals that are neither motion nor force have direction 0.
//! - **ID lines**: function; run; date and time; set-up, experiment and frequency; segment, point and exact ticks (the format
//!   has only six digits for the abscissa). The z axis has the drive frequency, Hz.

use std::io::{BufWriter, Write};

use arrow_array::RecordBatch;

use super::uff_dataset::{AxisRecord, Dof, FunctionRecord, OrdinateData, header, real, si_units};
use super::{ExportSelection, ExportSummary, Exporter, RunTable, write_export};
use crate::failure::Failure;
use crate::host_time;
use crate::run_folder::RunFolder;
use crate::run_folder::read::campaign_copy;
use crate::run_folder::schema::samples::SampleColumn;
use crate::storage::out_file::{OutFile, to_failure};
use crate::table::values::{numbers, texts};

/// The UFF exporter. Memory holds the samples of one point.
#[derive(Clone, Copy, Debug)]
pub struct Uff;

impl Exporter for Uff {
    fn usual_tables(&self) -> &'static [RunTable] {
        &[RunTable::Results, RunTable::Samples]
    }

    fn extension(&self) -> &'static str {
        "uff"
    }

    fn cannot_hold(&self, table: RunTable) -> Option<&'static str> {
        match table {
            RunTable::Results | RunTable::Samples => None,
            RunTable::Transients => {
                Some("the format has no place for results of playbacks and free vibrations; use csv, mat or h5")
            }
            RunTable::Impacts => Some("the format has no place for impacts; use csv, mat or h5"),
        }
    }

    fn export(&self, run: &RunFolder, part: &ExportSelection, out: &OutFile) -> Result<ExportSummary, Failure> {
        let failed = to_failure(&out.path);
        write_export(out, |file| {
            let mut exported = ExportSummary::default();
            let mut file = BufWriter::new(file.as_file_mut());
            let m = run.manifest();
            header(&mut file, &m.campaign, "damper rig: time and frequency responses", &m.damprig, &date_time(run))
                .and_then(|()| si_units(&mut file))
                .map_err(|e| failed(&e))?;
            let mut writer = UffWriter { run, file, functions: 0, rounded: 0, left_out: 0 };
            if part.tables.contains(&RunTable::Results) {
                let mut batches = Vec::new();
                part.each(run, RunTable::Results, &mut exported, |batch| {
                    batches.push(batch);
                    Ok(())
                })?;
                let mut points = points(&batches)?;
                sort_shuffled(run, &mut points);
                writer.responses(points).map_err(|e| failed(&e))?;
            }
            if part.tables.contains(&RunTable::Samples) {
                let mut stretch = None;
                part.each(run, RunTable::Samples, &mut exported, |batch| {
                    writer.samples(&batch, &mut stretch, &failed)
                })?;
                if let Some(last) = stretch {
                    writer.histories(&last).map_err(|e| failed(&e))?;
                }
            }
            writer.file.flush().map_err(|e| failed(&e))?;
            exported.notes.push(format!("{} functions (dataset 58)", writer.functions));
            if writer.rounded > 0 {
                let text = "have a rounded abscissa (the format has six digits); the exact ticks are in ID line 5";
                exported.notes.push(format!("{} functions {text}", writer.rounded));
            }
            if writer.left_out > 0 {
                let text = "values are not finite; they are left out and the histories split there";
                exported.notes.push(format!("{} {text}", writer.left_out));
            }
            Ok(exported)
        })
    }
}

/// Start of the run in the format's notation; empty if the manifest's time cannot be read.
fn date_time(run: &RunFolder) -> String {
    let started = host_time::parse(&run.manifest().started);
    started.map_or_else(String::new, |t| t.strftime("%d-%b-%y %H:%M:%S").to_string())
}

/// A point of a frequency response.
#[derive(Clone, Debug, PartialEq)]
struct FrfPoint {
    set_up: String,
    experiment: String,
    frequency_hz: f64,
    real: f64,
    imaginary: f64,
}

fn points(batches: &[RecordBatch]) -> Result<Vec<FrfPoint>, Failure> {
    let mut points = Vec::new();
    for batch in batches {
        let (set_ups, experiments) = (texts(batch, "set_up")?, texts(batch, "experiment")?);
        let get = |name| numbers(batch, name);
        let (f, x, z, phase) = (get("frequency_hz")?, get("x_amplitude_m")?, get("z_amplitude_m")?, get("phase_rad")?);
        for (i, (set_up, experiment)) in set_ups.into_iter().zip(experiments).enumerate() {
            let (sine, cosine) = phase[i].sin_cos();
            let ratio = x[i] / z[i];
            let (real, imaginary) = (ratio * cosine, ratio * sine);
            points.push(FrfPoint { set_up, experiment, frequency_hz: f[i], real, imaginary });
        }
    }
    Ok(points)
}

/// Sorts the points of experiments whose frequencies were run in random order. A motion that is carried over keeps its order.
fn sort_shuffled(run: &RunFolder, points: &mut [FrfPoint]) {
    if run.manifest().plan.order_seed.is_none() {
        return;
    }
    let Ok(campaign) = campaign_copy::campaign(run.path()) else { return };
    for own in points.chunk_by_mut(|a, b| (&a.set_up, &a.experiment) == (&b.set_up, &b.experiment)) {
        let experiment = campaign.experiments.iter().find(|e| e.name == own[0].experiment);
        if experiment.is_some_and(|e| !e.carries_over()) {
            own.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        }
    }
}

/// Splits points into branches of one set-up and experiment with rising or falling (`true`) frequency. Falling branches are
/// reversed.
fn branches(points: Vec<FrfPoint>) -> Vec<(Vec<FrfPoint>, bool)> {
    let mut all: Vec<(Vec<FrfPoint>, bool)> = Vec::new();
    for point in points {
        if let Some((branch, is_falling)) = all.last_mut()
            && let Some(before) = branch.last()
            && (&before.set_up, &before.experiment) == (&point.set_up, &point.experiment)
            && before.frequency_hz != point.frequency_hz
        {
            let falls = point.frequency_hz < before.frequency_hz;
            if branch.len() == 1 || falls == *is_falling {
                *is_falling = falls;
                branch.push(point);
                continue;
            }
        }
        all.push((vec![point], false));
    }
    for (branch, _) in all.iter_mut().filter(|(_, is_falling)| *is_falling) {
        branch.reverse();
    }
    all
}

/// What all rows of a stretch share.
#[derive(Clone, Debug, PartialEq)]
struct StretchLabel {
    set_up: String,
    experiment: String,
    segment: u32,
    point_index: u32,
    frequency_hz: f64,
}

/// Evenly spaced rows.
#[derive(Clone, Debug)]
struct EvenStretch {
    label: StretchLabel,
    first_tick: f64,
    first_t_s: f64,
    last_tick: f64,
    last_t_s: f64,
    /// Ticks between rows.
    every: f64,
    /// Values per signal.
    values: Vec<Vec<f32>>,
}

struct UffWriter<'r, W: Write> {
    run: &'r RunFolder,
    file: W,
    functions: usize,
    rounded: usize,
    left_out: usize,
}

/// Whether six digits change the value.
fn is_rounded(value: f64) -> bool {
    real(value, 13, 5).trim().parse::<f64>().is_ok_and(|read| read != value)
}

impl<W: Write> UffWriter<'_, W> {
    fn id(&self, function: String, load_case: String, detail: String) -> [String; 5] {
        let run = format!("run {}, campaign {}", self.run.id(), self.run.manifest().campaign);
        [function, run, date_time(self.run), load_case, detail]
    }

    fn responses(&mut self, points: Vec<FrfPoint>) -> std::io::Result<()> {
        let all = points.len();
        let mut points = points;
        points.retain(|p| p.real.is_finite() && p.imaginary.is_finite() && p.frequency_hz.is_finite());
        self.left_out += all - points.len();
        for (branch, is_falling) in branches(points) {
            let Some(first) = branch.first() else { continue };
            let values: Vec<(f64, f64, f64)> = branch.iter().map(|p| (p.frequency_hz, p.real, p.imaginary)).collect();
            let direction = if is_falling { ", frequency falling" } else { "" };
            let detail = format!("{} points{direction}; X/Z (lock-in): amplitudes and phase", values.len());
            // With a force drive z is the force over k.
            let record = self.run.manifest().set_ups.iter().find(|s| s.name == first.set_up);
            let forced = record.and_then(|s| s.model()).filter(|model| model.is_force_driven);
            let (name, denominator, values) = match forced {
                Some(model) => {
                    let k = model.structure.stiffness_n_per_m;
                    ("x/P", AxisRecord::new(9, "P", "N"), values.iter().map(|v| (v.0, v.1 / k, v.2 / k)).collect())
                }
                None => ("x/z", AxisRecord::new(8, "z", "m"), values),
            };
            let id = self.id(name.into(), format!("{}, {}", first.set_up, first.experiment), detail);
            self.functions += 1;
            self.rounded += usize::from(values.iter().any(|v| is_rounded(v.0)));
            let function = FunctionRecord {
                id,
                kind: 4,
                number: self.functions,
                version: 0,
                response: Dof { node: 1, direction: 1 },
                reference: Dof { node: 2, direction: 1 },
                ordinate: OrdinateData::Uneven(&values),
                abscissa: AxisRecord::new(18, "frequency", "Hz"),
                numerator: AxisRecord::new(8, "x", "m"),
                denominator,
                z_axis: (AxisRecord::none(), 0.0),
            };
            function.write(&mut self.file)?;
        }
        Ok(())
    }

    /// Adds rows to the current stretch; writes it when another begins.
    fn samples(
        &mut self,
        batch: &RecordBatch,
        stretch: &mut Option<EvenStretch>,
        failed: &impl Fn(&dyn std::fmt::Display) -> Failure,
    ) -> Result<(), Failure> {
        let count = batch.num_rows();
        let (set_ups, experiments) = (texts(batch, "set_up")?, texts(batch, "experiment")?);
        // The earliest runs lack these columns.
        let or_zero = |name: &str| match batch.column_by_name(name) {
            Some(_) => numbers(batch, name),
            None => Ok(vec![0.0; count]),
        };
        let (segments, point_indices) = (or_zero("segment")?, or_zero("point_index")?);
        let (frequencies, ticks, times) =
            (or_zero("point_frequency_hz")?, numbers(batch, "tick")?, numbers(batch, "t_s")?);
        let signals = &self.run.manifest().signals;
        let columns = signals.iter().map(|s| numbers(batch, &s.name)).collect::<Result<Vec<_>, _>>()?;
        let every = self.run.manifest().every_ticks().map_or(1.0, |every| every as f64);
        for row in 0..count {
            let label = StretchLabel {
                set_up: set_ups[row].clone(),
                experiment: experiments[row].clone(),
                segment: segments[row] as u32,
                point_index: point_indices[row] as u32,
                frequency_hz: frequencies[row],
            };
            let goes_on = stretch.as_ref().is_some_and(|s| s.label == label && ticks[row] - s.last_tick == s.every);
            if !goes_on && let Some(whole) = stretch.take() {
                self.histories(&whole).map_err(|e| failed(&e))?;
            }
            let stretch = stretch.get_or_insert_with(|| EvenStretch {
                label,
                first_tick: ticks[row],
                first_t_s: times[row],
                last_tick: ticks[row],
                last_t_s: times[row],
                every,
                values: vec![Vec::new(); columns.len()],
            });
            (stretch.last_tick, stretch.last_t_s) = (ticks[row], times[row]);
            for (values, column) in stretch.values.iter_mut().zip(&columns) {
                values.push(column[row] as f32);
            }
        }
        Ok(())
    }

    /// Writes the time histories of all signals.
    fn histories(&mut self, stretch: &EvenStretch) -> std::io::Result<()> {
        let signals = &self.run.manifest().signals;
        for (place, (signal, values)) in signals.iter().zip(&stretch.values).enumerate() {
            let mut begin = 0;
            for numbers in values.split(|v| !v.is_finite()) {
                if !numbers.is_empty() {
                    self.history(stretch, (place, signal), begin, numbers)?;
                }
                begin += numbers.len() + 1;
            }
            self.left_out += values.iter().filter(|v| !v.is_finite()).count();
        }
        Ok(())
    }

    fn history(
        &mut self,
        stretch: &EvenStretch,
        (place, signal): (usize, &SampleColumn),
        begin: usize,
        values: &[f32],
    ) -> std::io::Result<()> {
        let label = &stretch.label;
        let tick_hz = self.run.manifest().device.as_ref().map(|d| d.tick_hz);
        let first_tick = stretch.first_tick + begin as f64 * stretch.every;
        // Without a device in the manifest the time step follows from the rows.
        let rows = stretch.values.first().map_or(0, Vec::len);
        let step = match tick_hz {
            Some(hz) => stretch.every / hz,
            None if rows > 1 => (stretch.last_t_s - stretch.first_t_s) / (rows - 1) as f64,
            None => 0.0,
        };
        let start = tick_hz.map_or(stretch.first_t_s + begin as f64 * step, |hz| first_tick / hz);
        let clock = tick_hz.map_or(String::new(), |hz| format!(" of {hz} Hz"));
        let detail = format!(
            "segment {}, point {}, ticks from {first_tick} by {}{clock}",
            label.segment, label.point_index, stretch.every
        );
        let load_case = format!("{}, {}, {} Hz", label.set_up, label.experiment, label.frequency_hz);
        let id = self.id(signal.name.clone(), load_case, detail);
        self.functions += 1;
        self.rounded += usize::from(is_rounded(start) || is_rounded(step));
        let function = FunctionRecord {
            id,
            kind: 1,
            number: self.functions,
            version: label.segment,
            response: degree_of_freedom(place, signal),
            reference: Dof { node: 0, direction: 0 },
            ordinate: OrdinateData::Even { start, step, values },
            abscissa: AxisRecord::new(17, "time", "s"),
            numerator: AxisRecord::new(quantity(&signal.unit), &signal.name, &signal.unit),
            denominator: AxisRecord::none(),
            z_axis: (AxisRecord::new(18, "drive frequency", "Hz"), label.frequency_hz),
        };
        function.write(&mut self.file)
    }
}

/// Specific data type of a unit; 0 for unknown.
fn quantity(unit: &str) -> u8 {
    match unit {
        "m" => 8,
        "N" => 9,
        "m/s" => 11,
        "m/s2" | "m/s²" | "m/s^2" => 12,
        _ => 0,
    }
}

fn degree_of_freedom(place: usize, signal: &SampleColumn) -> Dof {
    let node = match signal.name.as_str() {
        "x_m" => 1,
        "z_m" => 2,
        _ => 11 + place,
    };
    Dof { node, direction: u8::from(quantity(&signal.unit) != 0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(frequencies_hz: &[f64]) -> Vec<(Vec<f64>, bool)> {
        let point = |f: &f64| FrfPoint {
            set_up: "a".into(),
            experiment: "e".into(),
            frequency_hz: *f,
            real: 1.0,
            imaginary: 0.0,
        };
        let all = branches(frequencies_hz.iter().map(point).collect());
        all.into_iter().map(|(b, falls)| (b.iter().map(|p| p.frequency_hz).collect(), falls)).collect()
    }

    #[test]
    fn a_sweep_is_split_at_its_reversals_into_rising_branches() {
        assert_eq!(sweep(&[1.0, 2.0, 3.0]), [(vec![1.0, 2.0, 3.0], false)]);
        assert_eq!(sweep(&[1.0, 2.0, 1.5, 1.0]), [(vec![1.0, 2.0], false), (vec![1.0, 1.5], true)]);
        assert_eq!(sweep(&[2.0, 2.0]), [(vec![2.0], false), (vec![2.0], false)]);
        assert_eq!(sweep(&[]), []);
    }

    #[test]
    fn an_abscissa_of_more_than_six_digits_is_detected() {
        assert!(!is_rounded(0.001) && !is_rounded(2.45) && !is_rounded(0.0));
        assert!(is_rounded(1.0 / 3.0) && is_rounded(2.400_001));
    }
}
