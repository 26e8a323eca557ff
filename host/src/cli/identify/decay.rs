//! `damprig identify decay`: from a free vibration.

use std::path::PathBuf;
use std::slice::from_ref;

use clap::Args;

use super::{ChoiceArgs, OutArgs, SensorArgs, finish_if_consistent};
use crate::cli::arguments::{StatedArgs, positive, table_file};
use crate::cli::simulate::picture;
use crate::failure::{Failure, Outcome};
use crate::identify::backbone::Backbone;
use crate::identify::decay::{self, Decay, DecayModel};
use crate::identify::decay_file::DecayFile;
use crate::identify::{Identification, Sensors, free_vibration};
use crate::report::figures::backbone;
use crate::report::plot::Picture;
use crate::report::{backbone_table, branch_table};
use crate::run_folder::read::folder::find;
use crate::signal_file::Selector;

/// Natural frequency, damping ratio and Coulomb friction of the structure from a free vibration.
///
/// The motion after the release is fitted by least squares; the logarithmic decrement is given for comparison. Fits of few cycles each
/// give damping ratio and frequency over the amplitude, and test whether the model holds: what does not fit is the first line of the result.
#[derive(Debug, Args)]
pub(super) struct DecayArgs {
    /// Run with a free vibration, or file with a displacement, velocity or acceleration (`damprig inspect`): CSV with the columns t_s and
    /// x_m, x_mm, a_g …, UFF, MAT and others; FILE#name is one of several signals
    #[arg(value_name = "SOURCE")]
    source: PathBuf,

    #[command(flatten)]
    choice: ChoiceArgs,

    #[command(flatten)]
    stated: StatedArgs,

    /// Mass of the structure, for the friction force [default: that of the run's set-up]
    #[arg(long, value_name = "KG", value_parser = positive)]
    mass_kg: Option<f64>,

    /// Fit viscous damping alone: all damping counts as viscous
    #[arg(long)]
    viscous: bool,

    #[command(flatten)]
    sensors: SensorArgs,

    /// Draw damping ratio and frequency over the amplitude, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    /// Draw what the fit leaves over time and over the amplitude, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot_residuals: Option<PathBuf>,

    /// Write damping ratio and frequency over the amplitude as a table, .csv or .parquet
    #[arg(long, value_name = "FILE", value_parser = table_file)]
    table: Option<PathBuf>,

    /// Let --out write values that another method of this command contradicts
    #[arg(long, requires = "out")]
    despite_misfit: bool,

    #[command(flatten)]
    out: OutArgs,
}

/// Identifies from the source, prints the results and writes the files.
///
/// # Errors
/// A source from which nothing can be identified, values that another method contradicts and --out, an unwritable file.
pub(super) fn run(args: &DecayArgs) -> Outcome {
    args.out.check(from_ref(&args.source), &[&args.plot, &args.plot_residuals, &args.table])?;
    let (decay, identified) = identify(args)?;
    draw(args, &decay, &identified)?;
    let help = "cut the record to the amplitudes that matter, or write the values of the fit";
    finish_if_consistent(&args.out, identified, args.despite_misfit, help)
}

fn identify(args: &DecayArgs) -> Result<(Decay, Identification), Failure> {
    let model = |sensors| DecayModel { coulomb: !args.viscous, sensors };
    let (taken_from, decay, remarks, sensors, mass_kg) = if Selector::of(&args.source).path.is_file() {
        let record = DecayFile::read(&args.source, &args.stated.stated()?)?;
        let sensors = args.sensors.applied(Sensors::ASSUMED);
        let (decay, remarks) = record.identify(model(sensors))?;
        (record.taken_from, decay, remarks, sensors, None)
    } else {
        if args.stated.is_given() {
            let text = "--unit, --sensitivity and --calibration are for a file; a run has displacements in m";
            return Err(Failure::Input(text.into()));
        }
        let run = find(&args.source)?;
        let record = free_vibration(&run, &args.choice.choice())?;
        let sensors = args.sensors.applied(record.sensors);
        let decay = decay::identify(&record.t_s, &record.x_m, model(sensors))
            .map_err(|error| Failure::Input(format!("{}: {error}", record.taken_from)))?;
        (record.taken_from, decay, Vec::new(), sensors, record.mass_kg)
    };
    let mut identified = Identification::new(taken_from, decay.estimates(args.mass_kg.or(mass_kg)));
    identified.lack_of_fit = decay.misfits();
    identified.over_amplitude = decay.backbone.as_ref().map(Backbone::rows).unwrap_or_default();
    identified.contradiction = decay.contradiction();
    identified.remarks = decay.remarks();
    identified.remarks.extend(remarks);
    if decay.lack_of_fit.is_some() && args.plot_residuals.is_none() {
        identified
            .remarks
            .push("--plot-residuals FILE draws what the fit leaves over time and over the amplitude".into());
    }
    identified.remarks.push(sensors.remark());
    Ok((decay, identified))
}

/// Writes the pictures and the table.
fn draw(args: &DecayArgs, decay: &Decay, identified: &Identification) -> Outcome {
    let draw = |path: &Option<PathBuf>, draw: fn(&Decay) -> Result<Picture, Failure>| {
        let Some(path) = path else { return Ok(()) };
        draw(decay).and_then(|picture| picture.save(path))
    };
    draw(&args.plot, backbone::draw)?;
    draw(&args.plot_residuals, backbone::residuals)?;
    let Some(path) = &args.table else { return Ok(()) };
    if identified.over_amplitude.is_empty() {
        return Err(Failure::Input(
            "--table: the record has too few cycles for a table over the amplitude\n  record longer".into(),
        ));
    }
    let table = backbone_table::table(&identified.over_amplitude, &identified.taken_from)?;
    branch_table::write(&table, &args.out.force.file(path))?;
    Ok(())
}
