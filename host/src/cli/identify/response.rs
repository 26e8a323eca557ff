//! `damprig identify response`: from points of a frequency response, or from x and z over time.

use std::path::{Path, PathBuf};

use clap::Args as ClapArgs;

use super::{ChoiceArgs, OutArgs, SensorArgs};
use crate::cli::arguments::{not_negative, positive};
use crate::cli::outcome::Failure;
use crate::cli::simulate::picture;
use crate::identify::response::Response;
use crate::identify::table::{TIME, Table, X, Z};
use crate::identify::time_response::{self, Motion, TimeResponse, Wanted};
use crate::identify::{CannotIdentify, Identification, OfRun, response, response_of_run};
use crate::report::figures::transfer_function;
use crate::run_folder::read::folder::find;

/// Natural frequency and damping ratio of the bare structure from its response to the base, or to a force.
///
/// Of a stepped sine: the response is fitted to the points; under a force that of X/P, which also gives the mass. Of x and z over time (a playback of noise or another broadband motion): x is
/// simulated from z and fitted; H1 and coherence by Welch's method show whether x follows z.
#[derive(Debug, ClapArgs)]
pub(super) struct ResponseArgs {
    /// Run with a stepped sine or a playback, or CSV file. Columns of points: frequency_hz, x_m, z_m or force_n (amplitudes) and phase_rad
    /// or phase_deg if known; of a motion: t_s, x_m, z_m
    #[arg(value_name = "SOURCE")]
    pub(super) source: PathBuf,

    #[command(flatten)]
    choice: ChoiceArgs,

    /// Of a motion: length of a segment of Welch's method [default: four lines in the half-power width, at most a fifth of the record]
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    segment_s: Option<f64>,

    /// Of a motion: overlap of the segments, 0 to 0.9 [default: 0.5]
    #[arg(long, value_name = "SHARE", value_parser = overlap)]
    overlap: Option<f64>,

    /// Of a motion: draw |H|, phase and coherence over frequency, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    #[command(flatten)]
    sensors: SensorArgs,

    #[command(flatten)]
    pub(super) out: OutArgs,
}

impl ResponseArgs {
    /// The first option that goes with a motion only, if one is given.
    fn option_of_a_motion(&self) -> Option<&'static str> {
        let given = [
            (self.segment_s.is_some(), "--segment-s"),
            (self.overlap.is_some(), "--overlap"),
            (self.plot.is_some(), "--plot"),
        ];
        given.iter().find(|(is_given, _)| *is_given).map(|(_, option)| *option)
    }
}

/// Parses an overlap.
fn overlap(text: &str) -> Result<f64, String> {
    match not_negative(text) {
        Ok(share) if share <= 0.9 => Ok(share),
        _ => Err("must be a number from 0 to 0.9".into()),
    }
}

/// Identifies from the source.
///
/// # Errors
/// A source from which nothing can be identified; a picture that cannot be written.
pub(super) fn identify(args: &ResponseArgs) -> Result<Identification, Failure> {
    let from = if args.source.is_file() {
        let table = Table::read(&args.source).map_err(Failure::input)?;
        response_of_table(&table).map_err(Failure::input)?
    } else {
        let run = find(&args.source).map_err(Failure::input)?;
        response_of_run(&run, &args.choice.choice()).map_err(Failure::input)?
    };
    match from {
        OfRun::Points(Response { taken_from, driven_by, points, sensors, mut remarks }) => {
            if let Some(option) = args.option_of_a_motion() {
                let text = format!(
                    "{option} is for x and z over time; {taken_from} has points of a frequency response\n  leave it out"
                );
                return Err(Failure::Input(text));
            }
            let sensors = args.sensors.applied(sensors);
            let estimates = response::identify(&points, driven_by, &sensors)
                .map_err(|error| Failure::input(format!("{taken_from}: {error}")))?;
            remarks.extend([response::REPORT.into(), sensors.remark()]);
            Ok(Identification { remarks, ..Identification::new(taken_from, estimates) })
        }
        OfRun::Motion(motion) => {
            if let Some(option) = args.sensors.given() {
                let text = format!(
                    "{option} is for points; the fit of x and z over time has a scale of its own\n  leave it out"
                );
                return Err(Failure::Input(text));
            }
            let wanted = Wanted { segment_s: args.segment_s, overlap: args.overlap };
            let found = time_response::identify(&motion, wanted)
                .map_err(|error| Failure::input(format!("{}: {error}", motion.taken_from)))?;
            if let Some(path) = &args.plot {
                plot(&found, path, args.out.force)?;
            }
            let mut identified = Identification::new(motion.taken_from.clone(), found.estimates());
            identified.remarks = found.remarks();
            Ok(identified)
        }
    }
}

/// Points or a motion, by the columns of a table.
fn response_of_table(table: &Table) -> Result<OfRun, CannotIdentify> {
    if !table.has(&TIME) {
        return response::points(table).map(OfRun::Points);
    }
    let t_s = table.times()?;
    let step_s = (t_s[t_s.len() - 1] - t_s[0]) / (t_s.len() - 1).max(1) as f64;
    let (x_m, z_m) = (table.column(&X)?, table.column(&Z)?);
    Ok(OfRun::Motion(Motion { taken_from: table.file().into(), step_s, x_m, z_m }))
}

/// Draws |H|, phase and coherence.
fn plot(found: &TimeResponse, path: &Path, force: bool) -> Result<(), Failure> {
    if !force && path.symlink_metadata().is_ok() {
        return Err(Failure::Input(format!(
            "--plot: {} exists\n  give another name, or replace it with --force",
            path.display()
        )));
    }
    transfer_function::draw(found).and_then(|picture| picture.save(path)).map_err(Failure::failed)
}
