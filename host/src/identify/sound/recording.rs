//! Reads sound recordings: CSV tables with `t_s` and the microphone's signal, and signals of WAV, UFF and other files.

use std::path::Path;

use crate::failure::Failure;
use crate::identify::table::{NumberTable, TableQuantity};
use crate::signal_file::unit::UnitKind;
use crate::signal_file::{Selector, SignalAxis};

/// Columns that a table may have for the microphone's signal: in volt, in pascal, or without a unit.
const SIGNALS: [TableQuantity; 3] = [
    TableQuantity { stem: "sound", units: &[("v", 1.0), ("mv", 1e-3)], about: "voltage of the microphone", most: 1e3 },
    TableQuantity { stem: "sound", units: &[("pa", 1.0)], about: "sound pressure", most: 1e4 },
    TableQuantity { stem: "sound", units: &[("", 1.0)], about: "signal of the microphone", most: 1e12 },
];

/// A sound recording of one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct SoundRecording {
    /// Its file.
    pub file: String,
    /// Whether its samples are pascals: it needs no calibration.
    pub is_pascal: bool,
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// Samples in Pa or V; of a WAV file as shares of full scale.
    pub samples: Vec<f64>,
}

/// Lowest sample rate at which sound can be evaluated, Hz.
const MIN_RATE_HZ: f64 = 8000.0;

/// Samples at the end of the span in a row that count as clipped, and as the span of a converter.
const CLIPPED_RUN: usize = 3;

/// Share of full scale from which a sample is at the end of the span.
const FULL_SCALE: f64 = 0.9999;

impl SoundRecording {
    /// Reads a file; `channel`, counted from 1, chooses one of several.
    ///
    /// # Errors
    /// An unreadable file; several channels without a choice; an unknown sample format; clipped samples; a low sample rate.
    pub fn read(path: &Path, channel: Option<u16>) -> Result<Self, Failure> {
        let is_table = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
        let recording = if is_table { Self::of_table(path, channel) } else { Self::of_signal(path, channel) }?;
        if recording.sample_rate_hz < MIN_RATE_HZ {
            return Err(recording.refuse(format!(
                "{} samples per second are too few for sound: at least {MIN_RATE_HZ}\n  record with 44100 Hz or 48000 Hz",
                recording.sample_rate_hz
            )));
        }
        if let Some(at) = recording.clipped_at(!is_table) {
            return Err(recording.refuse(format!(
                "it is clipped: {CLIPPED_RUN} samples in a row are at the end of the span, first at {:.4} s\n  record again with a lower \
                 gain",
                at as f64 / recording.sample_rate_hz
            )));
        }
        Ok(recording)
    }

    fn of_table(path: &Path, channel: Option<u16>) -> Result<Self, Failure> {
        let table = NumberTable::read(path)?;
        if channel.is_some_and(|channel| channel != 1) {
            return Err(table.refuse("--channel is for a WAV file; a table has one column sound_v, sound_pa or sound"));
        }
        let t_s = table.times()?;
        let signal = SIGNALS.iter().find(|signal| table.has(signal)).unwrap_or(&SIGNALS[0]);
        let samples = table.column(signal)?;
        if t_s.len() < 2 {
            return Err(table.refuse("one sample is no sound"));
        }
        let sample_rate_hz = (t_s.len() - 1) as f64 / (t_s[t_s.len() - 1] - t_s[0]);
        let is_pascal = *signal == SIGNALS[1];
        Ok(Self { file: table.file().into(), is_pascal, sample_rate_hz, samples })
    }

    fn of_signal(path: &Path, channel: Option<u16>) -> Result<Self, Failure> {
        let mut selector = Selector::of(path);
        if let Some(channel) = channel {
            selector.which = Some(channel.to_string());
        }
        let file = selector.path.display().to_string();
        let refuse = |text: String| Failure::Input(format!("{file}: {text}"));
        let signal = selector.read()?;
        let is_pascal = signal.kind() == Some(UnitKind::Pressure);
        let si = match signal.unit {
            None => 1.0,
            Some(unit) if matches!(unit.kind, UnitKind::Pressure | UnitKind::Voltage) => unit.si,
            Some(unit) => return Err(refuse(format!("{:?} is a {}, no sound", signal.name, unit.kind.text()))),
        };
        let SignalAxis::Time { step_s, .. } = signal.axis else {
            return Err(refuse(format!("{:?} has no evenly spaced times", signal.name)));
        };
        let samples = signal.values.iter().map(|value| value * si).collect();
        Ok(Self { file, is_pascal, sample_rate_hz: 1.0 / step_s, samples })
    }

    /// Place of the first clipped sample. The span of a table's converter is not known: there the largest magnitude counts as its end.
    fn clipped_at(&self, is_share: bool) -> Option<usize> {
        let largest = self.samples.iter().fold(0.0f64, |most, sample| most.max(sample.abs()));
        let end = if is_share { FULL_SCALE } else { largest };
        // A silent recording is not clipped.
        if largest < end || largest == 0.0 {
            return None;
        }
        let is_at_end =
            |run: &[f64]| run.iter().all(|sample| sample.abs() >= end && sample.signum() == run[0].signum());
        self.samples.windows(CLIPPED_RUN).position(is_at_end)
    }

    /// Whether all samples are the same.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.samples.windows(2).all(|pair| pair[0] == pair[1])
    }

    /// Length, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.samples.len() as f64 / self.sample_rate_hz
    }

    /// An error of this file.
    #[must_use]
    pub fn refuse(&self, text: impl std::fmt::Display) -> Failure {
        Failure::Input(format!("{}: {text}", self.file))
    }
}
