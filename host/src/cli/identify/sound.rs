//! `damprig identify sound`: sound pressure levels of a recording.

use std::path::PathBuf;

use clap::Args;

use super::OutArgs;
use crate::cli::arguments::{not_negative, positive};
use crate::failure::Failure;
use crate::identify::Identification;
use crate::identify::sound::calibration::calibrated;
use crate::identify::sound::recording::SoundRecording;
use crate::identify::sound::weighting::Weighting;
use crate::identify::sound::{Evaluation, estimates, levels, remarks};

/// Sound pressure levels of a recording, in dB relative to 20 µPa.
///
/// Equivalent level (Leq), largest levels with the time weightings F and S, and peak; with --background also the level of the source
/// alone. The recording is calibrated by that of a sound calibrator on the same channel with the same gain, or by a number.
#[derive(Debug, Args)]
pub(super) struct SoundArgs {
    /// WAV file, another file with a sound (`damprig inspect`), or CSV file with t_s and sound_v, sound_pa or sound; FILE#2 is the
    /// second signal of several
    #[arg(value_name = "FILE")]
    pub(super) source: PathBuf,

    /// Recording of a sound calibrator
    #[arg(long, value_name = "FILE", conflicts_with = "pascal_per_unit")]
    calibration: Option<PathBuf>,

    /// Level of the calibrator [default: 94]
    #[arg(long, value_name = "DB", value_parser = positive, requires = "calibration")]
    calibration_level_db: Option<f64>,

    /// Pressure of one unit of the recording, in pascal; the unit of a WAV file is full scale
    #[arg(long, value_name = "PA", value_parser = positive)]
    pascal_per_unit: Option<f64>,

    /// Standard uncertainty of the calibration; 0.15 dB is that of a class 1 calibrator (±0.25 dB)
    #[arg(long, value_name = "DB", value_parser = not_negative, default_value_t = 0.15)]
    calibration_uncertainty_db: f64,

    /// Frequency weighting
    #[arg(long, value_name = "LETTER", value_enum, default_value = "A")]
    weighting: Weighting,

    /// Length of a window of the level over time
    #[arg(long, value_name = "SECONDS", value_parser = positive, default_value_t = 1.0)]
    window_s: f64,

    /// Recording of the background, with the source off: its energy is subtracted
    #[arg(long, value_name = "FILE")]
    background: Option<PathBuf>,

    /// Channel of WAV files with several, counted from 1
    #[arg(long, value_name = "N")]
    channel: Option<u16>,

    #[command(flatten)]
    pub(super) out: OutArgs,
}

/// Evaluates the recording.
///
/// # Errors
/// A recording, a calibration or a background that cannot be used.
pub(super) fn identify(args: &SoundArgs) -> Result<Identification, Failure> {
    let recording = SoundRecording::read(&args.source, args.channel)?;
    let background = args.background.as_ref().map(|path| SoundRecording::read(path, args.channel)).transpose()?;
    if let Some(other) = background.as_ref().filter(|other| other.is_pascal != recording.is_pascal) {
        return Err(
            other.refuse(format!("it is not in the unit of {}\n  give both in pascal, or neither", recording.file))
        );
    }
    let (pascal_per_unit, calibrated) = calibration(args, &recording)?;
    let evaluation = Evaluation {
        pascal_per_unit,
        calibration_uncertainty_db: args.calibration_uncertainty_db,
        weighting: args.weighting,
        window_s: args.window_s,
    };
    let of_recording = levels(&recording, &evaluation)?;
    let of_background = background.as_ref().map(|background| levels(background, &evaluation)).transpose()?;
    let mut identified =
        Identification::new(recording.file.clone(), estimates(&of_recording, of_background.as_ref(), &evaluation));
    identified.remarks = remarks(&of_recording, of_background.as_ref(), &evaluation);
    identified.remarks.extend(calibrated);
    Ok(identified)
}

/// The pressure of a unit of the recording, Pa, and how it was found, in words.
fn calibration(args: &SoundArgs, recording: &SoundRecording) -> Result<(f64, Option<String>), Failure> {
    match (&args.calibration, args.pascal_per_unit) {
        (None, None) if recording.is_pascal => Ok((1.0, None)),
        (None, None) => Err(recording.refuse(
            "its calibration is not known\n  record a sound calibrator on the same channel and gain and give --calibration FILE, or give \
             --pascal-per-unit",
        )),
        (Some(_), _) | (_, Some(_)) if recording.is_pascal => {
            Err(recording.refuse("it is in pascal already: leave out --calibration and --pascal-per-unit"))
        }
        (Some(path), _) => {
            let level_db = args.calibration_level_db.unwrap_or(94.0);
            let (frequency_hz, pascal_per_unit) = calibrated(&SoundRecording::read(path, args.channel)?, level_db)?;
            let words = format!(
                "calibrated by a tone of {frequency_hz:.1} Hz with {level_db} dB: full scale is {pascal_per_unit:.3} Pa"
            );
            Ok((pascal_per_unit, Some(words)))
        }
        (None, Some(pascal_per_unit)) => Ok((pascal_per_unit, None)),
    }
}
