//! The record of a free vibration in a file: displacement, velocity or acceleration, of any kind of file that `damprig inspect` knows.

use std::f64::consts::TAU;
use std::path::Path;

use damprig_identification::Refused;

use super::decay::{Decay, DecayModel, identify};
use super::table::{NumberTable, TIME, X};
use crate::failure::Failure;
use crate::input::regular;
use crate::signal_file::unit::UnitKind;
use crate::signal_file::{EvenSignal, Selector, Signal, StatedSignal, UnknownQuantity, is_plain_table};

/// A record of a file.
#[derive(Clone, Debug)]
pub struct DecayFile {
    /// The file, and the signal of it.
    pub taken_from: String,
    /// Times of the values, s.
    t_s: Vec<f64>,
    /// In SI units.
    values: Vec<f64>,
    kind: UnitKind,
    /// What was done with the values, for people.
    remarks: Vec<String>,
}

/// Whether a file is a text that states nothing of itself but its columns.
fn is_text(path: &Path) -> bool {
    regular::read_input(path).is_ok_and(|bytes| is_plain_table(&bytes))
}

impl DecayFile {
    /// Reads a record.
    ///
    /// # Errors
    /// A file that cannot be read, or has no displacement, velocity or acceleration over time in a known unit; several of them without a
    /// choice (`FILE#name`).
    pub fn read(path: &Path, stated: &StatedSignal) -> Result<Self, Failure> {
        let selector = Selector::of(path);
        let table = (selector.which.is_none() && *stated == StatedSignal::default()).then(|| NumberTable::read(path));
        if let Some(Ok(table)) = &table
            && table.has(&X)
            && table.has(&TIME)
        {
            let (t_s, values) = (table.times()?, table.column(&X)?);
            let taken_from = table.file().into();
            return Ok(Self { taken_from, t_s, values, kind: UnitKind::Displacement, remarks: Vec::new() });
        }
        match selector.read() {
            Ok(signal) => Self::of_signal(path, &signal, stated),
            // What is wrong with a table of t_s and x_m is said of those.
            Err(error) => Err(match table {
                Some(Err(own)) if is_text(path) => own,
                _ => error,
            }),
        }
    }

    fn of_signal(path: &Path, signal: &Signal, stated: &StatedSignal) -> Result<Self, Failure> {
        let taken_from = path.display().to_string();
        let refuse = |why: String| Failure::Input(format!("{taken_from}: {why}"));
        let name = &signal.name;
        let unit = signal.measured(stated).map_err(|why| match why {
            UnknownQuantity::Contradiction(why) => refuse(why),
            UnknownQuantity::SensitivityMissing => refuse(format!(
                "{name:?} is a voltage: a decay is a displacement, velocity or acceleration\n  state the sensor's with --sensitivity \"100 mV/g\""
            )),
            UnknownQuantity::UnitMissing => refuse(format!(
                "the unit of {name:?} is not known: a decay is a displacement, velocity or acceleration\n  state it with --unit, or in the \
                 column's name, for example x_mm or a_g"
            )),
        })?;
        if !matches!(unit.kind, UnitKind::Displacement | UnitKind::Velocity | UnitKind::Acceleration) {
            let other = unit.kind.text();
            return Err(refuse(format!("{name:?} is a {other}: a decay is a displacement, velocity or acceleration")));
        }
        let EvenSignal { start_s, step_s, values, rms_error } = signal.evenly().map_err(refuse)?;
        let mut remarks = Vec::new();
        if rms_error > 0.0 {
            remarks.push(format!(
                "the times are uneven: resampled by cubics at {:.1} Hz, with an estimated RMS error of {rms_error:.2e} {}",
                1.0 / step_s,
                signal.unit_text
            ));
        }
        Ok(Self {
            t_s: (0..values.len()).map(|n| start_s + n as f64 * step_s).collect(),
            values: values.iter().map(|value| value * unit.si).collect(),
            kind: unit.kind,
            remarks,
            taken_from,
        })
    }

    /// Identifies the free vibration. Velocity and acceleration of a viscous decay are decays of the same frequency and damping ratio, ω and
    /// ω² times as large: they are divided by the fitted ω, which filters nothing and integrates nothing. Dry friction lets the
    /// acceleration jump, so that it is fitted to displacements only.
    ///
    /// # Errors
    /// As [`identify`].
    pub fn identify(&self, model: DecayModel) -> Result<(Decay, Vec<String>), Failure> {
        let named = |error: Refused| Failure::Input(format!("{}: {error}", self.taken_from));
        let power = match self.kind {
            UnitKind::Velocity => 1,
            UnitKind::Acceleration => 2,
            _ => return Ok((identify(&self.t_s, &self.values, model).map_err(named)?, self.remarks.clone())),
        };
        let model = DecayModel { coulomb: false, ..model };
        let as_measured = identify(&self.t_s, &self.values, model).map_err(named)?;
        let frequency_hz = as_measured.fitted.natural_frequency_hz.value;
        let factor = (TAU * frequency_hz).powi(power).recip();
        let x_m: Vec<f64> = self.values.iter().map(|value| factor * value).collect();
        let mut remarks = self.remarks.clone();
        remarks.push(format!(
            "the {} is divided by (2π·{frequency_hz:.5} Hz){}, which gives the displacement's amplitude; friction is not fitted to it",
            self.kind.text(),
            if power == 2 { "²" } else { "" }
        ));
        Ok((identify(&self.t_s, &x_m, model).map_err(named)?, remarks))
    }
}
