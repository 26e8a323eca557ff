//! `damprig identify response`: from points of a frequency response, from a frequency response of a file, or from signals over time.

use std::path::PathBuf;
use std::slice::from_ref;

use clap::Args;

use super::{ChoiceArgs, OutArgs, SensorArgs, check_band, finish, finish_if_consistent};
use crate::cli::arguments::{not_negative, positive};
use crate::cli::simulate::picture;
use crate::failure::{Failure, Outcome};
use crate::identify::modal::h1::{ChannelPair, Channels};
use crate::identify::modal::read::{ModalSource, has_one};
use crate::identify::modal::{self, FrequencyResponse, Modal, Wish};
use crate::identify::response::{DrivenBy, Response};
use crate::identify::table::{NumberTable, TIME, X, Z};
use crate::identify::time_response::{self, Motion, Wanted};
use crate::identify::{Identification, OfRun, response, response_file, response_of_run};
use crate::report::figures::{modal_response, transfer_function};
use crate::report::plot::Picture;
use crate::run_folder::read::folder::find;
use crate::signal_file::{self, Selector};

/// Natural frequency and damping ratio of the bare structure from its response to the base, or to a force.
///
/// Of a stepped sine: the response is fitted to the points; under a force that of X/P, which also gives the mass. Of a frequency response in a
/// file: one mode with residual terms is fitted to the lines of a band. Of x and z over time (a playback of noise or another broadband motion): x is
/// simulated from z and fitted; H1 and coherence by Welch's method show whether x follows z.
#[derive(Debug, Args)]
pub(super) struct ResponseArgs {
    /// Run with a stepped sine or a playback, or a file. CSV columns of points: frequency_hz, x_m, z_m or force_n (amplitudes) and phase_rad
    /// or phase_deg if known; of a motion: t_s, x_m, z_m. Of a frequency response: UFF, MAT, HDF5, Parquet or CSV with complex values
    /// (`damprig inspect`); FILE#name is one of several signals
    #[arg(value_name = "SOURCE")]
    source: PathBuf,

    #[command(flatten)]
    choice: ChoiceArgs,

    #[command(flatten)]
    file: FileArgs,

    /// Of signals over time: length of a segment of Welch's method [default: four lines in the half-power width, at most a fifth of the record]
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    segment_s: Option<f64>,

    /// Of signals over time: overlap of the segments, 0 to 0.9 [default: 0.5]
    #[arg(long, value_name = "SHARE", value_parser = overlap)]
    overlap: Option<f64>,

    /// Draw |H|, phase, coherence and the fit over frequency, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    /// Let --out write values that another method of this command, or the points themselves, contradict
    #[arg(long, requires = "out")]
    despite_misfit: bool,

    #[command(flatten)]
    sensors: SensorArgs,

    #[command(flatten)]
    out: OutArgs,
}

/// What a file with a frequency response, or with its signals over time, does not state.
#[derive(Debug, Args)]
#[command(next_help_heading = "Frequency response of a file")]
struct FileArgs {
    /// Lowest frequency of the fit [default: about the highest peak]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    from_hz: Option<f64>,

    /// Highest frequency of the fit [default: about the highest peak]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    to_hz: Option<f64>,

    /// Unit that the file does not state, motion per excitation: m/N, m/s/N, m/s2/N, g/N, also N/m, N/(m/s), N/(m/s2), and m/m for x/z
    #[arg(long, value_name = "UNIT")]
    unit: Option<String>,

    /// Signal of the coherence, of the same file or FILE#name: weights the lines
    #[arg(long, value_name = "SIGNAL")]
    coherence: Option<String>,

    /// Independent averages of the coherence: the intervals are then not narrower than it makes them
    #[arg(long, value_name = "COUNT", value_parser = averages)]
    averages: Option<f64>,

    /// Signal of the frequencies in Hz that the file does not state
    #[arg(long, value_name = "SIGNAL")]
    frequencies_hz: Option<String>,

    /// Force and motion are at one place in one direction: gives the modal mass there
    #[arg(long)]
    drive_point: bool,

    /// SOURCE is a motion over time, and this the signal of the force or of the base's motion: H1 and coherence are estimated
    #[arg(long, value_name = "SIGNAL")]
    drive: Option<String>,

    /// Signal of the times in s that the file does not state
    #[arg(long, value_name = "SIGNAL", requires = "drive")]
    times_s: Option<String>,
}

impl FileArgs {
    fn band(&self) -> Wish {
        Wish { from_hz: self.from_hz, to_hz: self.to_hz }
    }

    /// The first option that is given, and whether it is for a stored frequency response only.
    fn given(&self) -> Option<(&'static str, bool)> {
        let all = [
            (self.coherence.is_some(), "--coherence", true),
            (self.averages.is_some(), "--averages", true),
            (self.frequencies_hz.is_some(), "--frequencies-hz", true),
            (self.from_hz.is_some(), "--from-hz", false),
            (self.to_hz.is_some(), "--to-hz", false),
            (self.unit.is_some(), "--unit", false),
            (self.drive_point, "--drive-point", false),
            (self.drive.is_some(), "--drive", false),
        ];
        all.into_iter().find(|(is_given, ..)| *is_given).map(|(_, option, is_stored)| (option, is_stored))
    }
}

/// Parses an overlap.
fn overlap(text: &str) -> Result<f64, String> {
    match not_negative(text) {
        Ok(share) if share <= 0.9 => Ok(share),
        _ => Err("must be a number from 0 to 0.9".into()),
    }
}

/// Parses a number of averages.
fn averages(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(count) if (2.0..=1e9).contains(&count) => Ok(count),
        _ => Err("must be a number from 2 to 1e9: one average has the coherence 1 whatever the motion".into()),
    }
}

/// What the source is.
enum GivenSource {
    Points(Response),
    Motion(Motion),
    Lines(FrequencyResponse),
    Channels(modal::h1::MotionAndExcitation),
}

/// Identifies from the source, prints the results and writes the files.
///
/// # Errors
/// A source from which nothing can be identified; an option that does not go with it; values that another method contradicts and --out; a file that
/// cannot be written.
pub(super) fn run(args: &ResponseArgs) -> Outcome {
    check_band(args.file.band())?;
    args.out.check(from_ref(&args.source), &[&args.plot])?;
    let from = from_source(args)?;
    check_options(args, &from)?;
    match from {
        GivenSource::Points(points) => {
            let help = "mount the sensor where Γφ is 1, or write the values of one degree of freedom";
            finish_if_consistent(&args.out, of_points(args, points)?, args.despite_misfit, help)
        }
        GivenSource::Motion(motion) => finish(&args.out, of_motion(args, &motion)?),
        GivenSource::Lines(lines) => {
            let found = modal::identify(&lines, args.file.band())?;
            of_mode(args, &lines, &found)
        }
        GivenSource::Channels(recorded) => {
            let wanted = Wanted { segment_s: args.segment_s, overlap: args.overlap };
            let (lines, found) = recorded.identify(wanted, args.file.band())?;
            of_mode(args, &lines, &found)
        }
    }
}

fn from_source(args: &ResponseArgs) -> Result<GivenSource, Failure> {
    let selector = Selector::of(&args.source);
    if !selector.path.is_file() {
        let run = find(&args.source)?;
        let of_run = response_of_run(&run, &args.choice.choice())?;
        return Ok(match of_run {
            OfRun::Points(points) => GivenSource::Points(points),
            OfRun::Motion(motion) => GivenSource::Motion(motion),
        });
    }
    let file = &args.file;
    if let Some(drive) = &file.drive {
        let (times_s, unit) = (file.times_s.as_deref(), file.unit.as_deref());
        let channels = Channels { file: &args.source, drive, times_s, unit };
        return Ok(match channels.read()? {
            ChannelPair::Displacements(motion) => GivenSource::Motion(motion),
            ChannelPair::Other(recorded) => GivenSource::Channels(recorded),
        });
    }
    if selector.which.is_none() {
        let table = NumberTable::read(&selector.path);
        if let Ok(table) = &table
            && table.has(&X)
        {
            return of_table(table);
        }
        let is_text = std::fs::read(&selector.path).is_ok_and(|bytes| signal_file::is_plain_table(&bytes));
        let contents = signal_file::read(&selector.path);
        if is_text && !contents.as_ref().is_ok_and(has_one) {
            // A table of points names its columns; of another one the reader of signals says what is wrong.
            if let (Err(error), Ok(table)) = (contents, &table)
                && !table.has(&Z)
            {
                return Err(Failure::input(error));
            }
            return table.and_then(|table| of_table(&table));
        }
    }
    let source = ModalSource {
        file: &args.source,
        unit: file.unit.as_deref(),
        frequencies_hz: file.frequencies_hz.as_deref(),
        coherence: file.coherence.as_deref(),
        averages: file.averages,
        band: file.band(),
    };
    source.read().map(GivenSource::Lines)
}

/// Points or a motion, by the columns of a table.
fn of_table(table: &NumberTable) -> Result<GivenSource, Failure> {
    if !table.has(&TIME) {
        return response_file::points(table).map(GivenSource::Points);
    }
    let t_s = table.times()?;
    let step_s = (t_s[t_s.len() - 1] - t_s[0]) / (t_s.len() - 1).max(1) as f64;
    let (x_m, z_m) = (table.column(&X)?, table.column(&Z)?);
    Ok(GivenSource::Motion(Motion { taken_from: table.file().into(), step_s, x_m, z_m }))
}

/// Refuses an option that the source gives no meaning.
fn check_options(args: &ResponseArgs, from: &GivenSource) -> Result<(), Failure> {
    let refuse = |text: String| Err(Failure::Input(format!("{text}\n  leave it out")));
    let over_time = [
        (args.segment_s.is_some(), "--segment-s"),
        (args.overlap.is_some(), "--overlap"),
        (args.plot.is_some(), "--plot"),
    ];
    let over_time =
        |count: usize| over_time.iter().take(count).find(|(is_given, _)| *is_given).map(|(_, option)| *option);
    let of_file = args.file.given();
    match from {
        GivenSource::Points(Response { taken_from, .. }) => {
            if let Some(option) = over_time(3) {
                return refuse(format!(
                    "{option} is for x and z over time; {taken_from} has points of a frequency response"
                ));
            }
            if let Some((option, _)) = of_file {
                return refuse(format!(
                    "{option} is for a complex frequency response of a file; {taken_from} has points"
                ));
            }
        }
        GivenSource::Motion(Motion { taken_from, .. }) => {
            if let Some(option) = args.sensors.given() {
                return refuse(format!("{option} is for points; the fit of x and z over time has a scale of its own"));
            }
            if let Some((option, _)) = of_file.filter(|(option, _)| *option != "--drive") {
                return refuse(format!(
                    "{option} is for a frequency response of a file; {taken_from} has x and z over time, which are fitted over time"
                ));
            }
        }
        GivenSource::Lines(lines) => {
            if let Some(option) = over_time(2) {
                return refuse(format!(
                    "{option} is for signals over time; {} has a frequency response",
                    lines.taken_from
                ));
            }
            if let Some(option) = args.sensors.given() {
                return refuse(format!(
                    "{option} is for points; a scale does not change fn and ζ of a frequency response"
                ));
            }
        }
        GivenSource::Channels(_) => {
            if let Some((option, _)) = of_file.filter(|(_, is_stored)| *is_stored) {
                return refuse(format!(
                    "{option} is for a stored frequency response; with --drive it is estimated from signals over time"
                ));
            }
            if let Some(option) = args.sensors.given() {
                return refuse(format!(
                    "{option} is for points; a scale does not change fn and ζ of a frequency response"
                ));
            }
        }
    }
    Ok(())
}

fn of_points(args: &ResponseArgs, found: Response) -> Result<Identification, Failure> {
    let Response { taken_from, driven_by, points, sensors, mut remarks } = found;
    let sensors = args.sensors.applied(sensors);
    let estimates = response::identify(&points, driven_by, &sensors)
        .map_err(|error| Failure::input(format!("{taken_from}: {error}")))?;
    remarks.extend([response::REPORT.into(), sensors.remark()]);
    let contradiction = response::contradiction(&points, &sensors, &estimates).filter(|_| driven_by == DrivenBy::Base);
    let lack_of_fit = contradiction.clone().map(|sentence| vec![sentence]);
    Ok(Identification { remarks, lack_of_fit, contradiction, ..Identification::new(taken_from, estimates) })
}

fn of_motion(args: &ResponseArgs, motion: &Motion) -> Result<Identification, Failure> {
    let wanted = Wanted { segment_s: args.segment_s, overlap: args.overlap };
    let found = time_response::identify(motion, wanted)
        .map_err(|error| Failure::input(format!("{}: {error}", motion.taken_from)))?;
    plot(args, || transfer_function::draw(&found))?;
    let mut identified = Identification::new(motion.taken_from.clone(), found.estimates());
    identified.remarks = found.remarks();
    Ok(identified)
}

fn of_mode(args: &ResponseArgs, lines: &FrequencyResponse, found: &Modal) -> Outcome {
    let is_drive_point = args.file.drive_point;
    if is_drive_point && !found.quantity.is_per_force() {
        return Err(Failure::Input(
            "--drive-point is for a motion per force; a transmissibility has no modal mass\n  leave it out".into(),
        ));
    }
    plot(args, || modal_response::draw(found))?;
    let mut identified = Identification::new(lines.taken_from.clone(), found.estimates(is_drive_point));
    identified.lack_of_fit = Some(found.sentences());
    identified.contradiction = found.contradiction();
    identified.remarks = [found.remarks(is_drive_point), lines.remarks.clone(), vec![response::REPORT.into()]].concat();
    let help = "choose another band with --from-hz and --to-hz, or write the values of the fit";
    finish_if_consistent(&args.out, identified, args.despite_misfit, help)
}

/// Draws the picture, if it is wished.
fn plot(args: &ResponseArgs, draw: impl FnOnce() -> Result<Picture, Failure>) -> Outcome {
    let Some(path) = &args.plot else { return Ok(()) };
    draw().and_then(|picture| picture.save(path))
}
