//! `damprig identify`: identifies parameters of the rig and writes them as a set-up file.

mod response;
mod restitution;
mod sound;

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args as ClapArgs, Subcommand};

use super::arguments::positive;
use super::outcome::{Failure, Outcome};
use crate::identify::decay::{self, Model};
use crate::identify::table::{Table, X};
use crate::identify::wall::Pad;
use crate::identify::{
    CannotIdentify, Choice, Estimate, FreeVibration, Identification, Sensors, free_vibration, friction, set_up_file,
    wall,
};
use crate::input::Source;
use crate::report::numbers::significant;
use crate::report::terminal::plain_table;
use crate::run_folder::read::folder::find;
use crate::storage::out_file::{OutFile, to_failure, write_new};

/// Identifies parameters of the rig from runs and tables: each with its standard uncertainty and its 95 % interval.
///
/// docs/IDENTIFY.md describes the methods, the columns of the tables and the measured errors.
#[derive(Debug, ClapArgs)]
#[command(after_help = AFTER_HELP)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

const AFTER_HELP: &str = "\
Examples:
  damprig identify decay runs/20260601-101500-release-ab12 --out identified.toml
  damprig identify decay release.csv --mass-kg 1.6 --json
  damprig identify response sweep.csv
  damprig identify response noise --plot response.svg
  damprig identify restitution runs/20260601-101500-spid-ab12 --out identified.toml --update
  damprig identify restitution drops.csv --out identified.toml --update
  damprig identify friction incline.csv --out identified.toml --update
  damprig identify sound impacts.wav --calibration tone.wav --background quiet.wav
  damprig identify wall dma.csv --shape-factor-m 0.07 --frequency-hz 40 --out soft.toml

A campaign or a case reads the written file with set_up_file = \"identified.toml\" at its top.

Exit codes:
  0    success
  1    a file could not be written
  2    the command line or the record is wrong; nothing was written";

#[derive(Debug, Subcommand)]
enum What {
    /// Natural frequency, damping ratio and Coulomb friction from a free vibration
    Decay(DecayArgs),
    /// Natural frequency and damping ratio from a stepped sine, or from x and z over time
    Response(response::ResponseArgs),
    /// Coefficient of restitution, clearance and contact time from a run with impacts, from drop tests and force records
    Restitution(restitution::RestitutionArgs),
    /// Friction coefficient from an incline, or friction force per deflection of a spring
    Friction(FrictionArgs),
    /// Stiffness and loss factor of a soft wall from a DMA table
    Wall(WallArgs),
    /// Sound pressure levels of a recording
    Sound(sound::SoundArgs),
}

/// Natural frequency, damping ratio and Coulomb friction of the structure from a free vibration.
///
/// The motion after the release is fitted by least squares; the logarithmic decrement is given for comparison.
#[derive(Debug, ClapArgs)]
struct DecayArgs {
    /// Run with a free vibration, or CSV file with the columns t_s and x_m (or t_ms, x_mm, x_um)
    #[arg(value_name = "SOURCE")]
    source: PathBuf,

    #[command(flatten)]
    choice: ChoiceArgs,

    /// Mass of the structure, for the friction force [default: that of the run's set-up]
    #[arg(long, value_name = "KG", value_parser = positive)]
    mass_kg: Option<f64>,

    /// Fit viscous damping alone: all damping counts as viscous
    #[arg(long)]
    viscous: bool,

    #[command(flatten)]
    sensors: SensorArgs,

    #[command(flatten)]
    out: OutArgs,
}

/// Friction coefficient of the particle from an incline, or friction force per deflection of the damper's spring.
///
/// The columns say which test it is. Angle at which the particle just slides on: angle_deg. Slide from rest: angle_deg,
/// distance_m and duration_s. Spring: deflection_m and force_n.
#[derive(Debug, ClapArgs)]
struct FrictionArgs {
    /// CSV file
    #[arg(value_name = "FILE")]
    source: PathBuf,

    /// Acceleration of gravity
    #[arg(long, value_name = "M/S2", value_parser = positive, default_value_t = damprig_core::model::GRAVITY_M_PER_S2)]
    gravity: f64,

    #[command(flatten)]
    out: OutArgs,
}

/// Stiffness and loss factor of a soft wall from a table of dynamic mechanical analysis (DMA).
///
/// Columns: storage_modulus_pa (or kpa, mpa) with loss_modulus_pa or loss_factor, or stiffness_n_per_m with loss_factor; with
/// several frequencies also frequency_hz.
#[derive(Debug, ClapArgs)]
struct WallArgs {
    /// CSV file
    #[arg(value_name = "FILE")]
    source: PathBuf,

    /// Shape factor of the pad: stiffness over storage modulus
    #[arg(long, value_name = "M", value_parser = positive)]
    shape_factor_m: Option<f64>,

    /// Frequency of the contact [default: the middle of the table's]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    frequency_hz: Option<f64>,

    #[command(flatten)]
    out: OutArgs,
}

/// Which experiment of a run.
#[derive(Debug, ClapArgs)]
struct ChoiceArgs {
    /// Set-up of the run, if several have such an experiment
    #[arg(long, value_name = "NAME")]
    set_up: Option<String>,

    /// Experiment of the run, if there are several of this kind
    #[arg(long, value_name = "NAME")]
    experiment: Option<String>,
}

impl ChoiceArgs {
    fn choice(&self) -> Choice {
        Choice { set_up: self.set_up.clone(), experiment: self.experiment.clone() }
    }
}

/// Errors of the displacement sensors.
#[derive(Debug, ClapArgs)]
struct SensorArgs {
    /// Relative standard uncertainty of the displacement sensors' scale, from their calibration [default: from the simulated
    /// sensors of a run; else 0.15 %]
    #[arg(long, value_name = "SHARE", value_parser = positive)]
    scale_uncertainty: Option<f64>,

    /// The displacement sensors have no third-order error [default: that of their linearity]
    #[arg(long)]
    linear_sensor: bool,
}

impl SensorArgs {
    /// The sensors of a source, as far as no option states otherwise.
    fn applied(&self, sensors: Sensors) -> Sensors {
        let linearity = if self.linear_sensor { 0.0 } else { sensors.linearity };
        Sensors { linearity, ..sensors.stated(self.scale_uncertainty) }
    }

    /// The first option that is given.
    fn given(&self) -> Option<&'static str> {
        let all = [(self.scale_uncertainty.is_some(), "--scale-uncertainty"), (self.linear_sensor, "--linear-sensor")];
        all.iter().find(|(is_given, _)| *is_given).map(|(_, option)| *option)
    }
}

/// Where the results go.
#[derive(Debug, ClapArgs)]
struct OutArgs {
    /// Print the results as one JSON object
    #[arg(long)]
    json: bool,

    /// Write the values as a set-up file (TOML) for campaigns and cases
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Add the values to an existing file of --out; values of the same keys are replaced
    #[arg(long, requires = "out", conflicts_with = "force")]
    update: bool,

    /// Replace existing files
    #[arg(long)]
    force: bool,
}

/// Runs the subcommand.
///
/// # Errors
/// A record from which nothing can be identified, an unwritable file.
pub fn run(args: &Args) -> Outcome {
    match &args.what {
        What::Decay(args) => finish(&args.out, &args.source, decay(args).map_err(Failure::input)?),
        What::Response(args) => finish(&args.out, &args.source, response::identify(args)?),
        What::Restitution(args) => {
            finish(&args.out, &args.source, restitution::identify(args).map_err(Failure::input)?)
        }
        What::Friction(args) => {
            let identified = of_table(&args.source, |table| friction::identify(table, args.gravity));
            finish(&args.out, &args.source, identified.map_err(Failure::input)?)
        }
        What::Sound(args) => finish(&args.out, &args.source, sound::identify(args).map_err(Failure::input)?),
        What::Wall(args) => finish(&args.out, &args.source, wall(args).map_err(Failure::input)?),
    }
}

fn decay(args: &DecayArgs) -> Result<Identification, CannotIdentify> {
    let record = if args.source.is_file() {
        let table = Table::read(&args.source)?;
        let t_s = table.times()?;
        let (taken_from, x_m) = (table.file().into(), table.column(&X)?);
        FreeVibration { taken_from, x_m, t_s, mass_kg: None, sensors: Sensors::ASSUMED }
    } else {
        let run = find(&args.source).map_err(|e| CannotIdentify(e.to_string()))?;
        free_vibration(&run, &args.choice.choice())?
    };
    let sensors = args.sensors.applied(record.sensors);
    let model = Model { coulomb: !args.viscous, sensors };
    let decay = decay::identify(&record.t_s, &record.x_m, model)
        .map_err(|error| CannotIdentify(format!("{}: {error}", record.taken_from)))?;
    let mut identified = Identification::new(record.taken_from, decay.estimates(args.mass_kg.or(record.mass_kg)));
    identified.remarks = decay.remarks();
    identified.remarks.push(sensors.remark());
    Ok(identified)
}

/// Identifies from a table.
fn of_table(
    source: &Path,
    identify: impl FnOnce(&Table) -> Result<Vec<Estimate>, CannotIdentify>,
) -> Result<Identification, CannotIdentify> {
    let table = Table::read(source)?;
    Ok(Identification::new(table.file(), identify(&table)?))
}

fn wall(args: &WallArgs) -> Result<Identification, CannotIdentify> {
    let pad = Pad { shape_factor_m: args.shape_factor_m, frequency_hz: args.frequency_hz };
    let mut identified = of_table(&args.source, |table| wall::identify(table, pad))?;
    identified.words = vec![("particle.wall.kind", "voigt"), ("particle.wall.release", "zero_force")];
    if identified.estimates.iter().all(|estimate| estimate.key.is_none()) {
        let remark = "without --shape-factor-m there is no stiffness, and nothing that a set-up could use";
        identified.remarks = vec![remark.into()];
    }
    Ok(identified)
}

/// Prints the results and writes the set-up file.
fn finish(args: &OutArgs, source: &Path, identified: Identification) -> Outcome {
    let text = args.out.as_ref().map(|path| set_up_text(args, path, source, &identified)).transpose()?;
    if args.json {
        say!("{}", serde_json::to_string(&identified).map_err(Failure::failed)?);
    } else {
        say!("{}", text_of(&identified));
    }
    let (Some(path), Some(text)) = (&args.out, text) else { return Ok(()) };
    let out = OutFile { path: path.clone(), force: args.force || args.update };
    let failed = to_failure(path);
    write_new(&out, |file| file.write_all(text.as_bytes()).map_err(|e| failed(&e))).map_err(Failure::failed)?;
    if !args.json {
        say!(
            "\nWritten to {}: `set_up_file = {:?}` at the top of a campaign reads it.",
            path.display(),
            path.display().to_string()
        );
    }
    Ok(())
}

/// The text of the set-up file, with what an existing one has.
fn set_up_text(args: &OutArgs, path: &Path, source: &Path, identified: &Identification) -> Result<String, Failure> {
    let is_source = path.canonicalize().is_ok_and(|out| source.canonicalize().is_ok_and(|source| source == out));
    if is_source {
        let message = format!("--out would overwrite {}, the record\n  give another file name", path.display());
        return Err(Failure::Input(message));
    }
    let exists = path.symlink_metadata().is_ok();
    if exists && !args.update && !args.force {
        let message = format!(
            "--out: {} exists\n  add the values to it with --update, replace it with --force, or give another name",
            path.display()
        );
        return Err(Failure::Input(message));
    }
    if identified.estimates.iter().all(|estimate| estimate.key.is_none()) {
        let message = "--out: none of the results is a key of a set-up; print them, or use --json";
        return Err(Failure::Input(message.into()));
    }
    let earlier = if exists && args.update { Some(Source::read(path).map_err(Failure::input)?) } else { None };
    set_up_file::text(identified, earlier.as_ref().map(Source::text))
        .map_err(|error| Failure::Input(format!("{}: {error}", path.display())))
}

/// The results as a table.
fn text_of(identified: &Identification) -> String {
    let mut table = plain_table(&["quantity", "value", "standard uncertainty", "95 % interval", "unit", "method"]);
    for estimate in &identified.estimates {
        // Two digits of the uncertainty decide how many of the value are shown.
        let digits = digits_of(estimate.value, estimate.standard_uncertainty);
        let [low, high] = estimate.interval_95;
        table.add_row(vec![
            estimate.quantity.to_string(),
            significant(estimate.value, digits),
            significant(estimate.standard_uncertainty, 2),
            format!("{} to {}", significant(low, digits), significant(high, digits)),
            estimate.unit.to_string(),
            estimate.method.to_string(),
        ]);
    }
    let remarks: Vec<String> = identified.remarks.iter().map(|remark| format!("\n{remark}")).collect();
    format!("Taken from {}\n{table}{}", identified.taken_from, remarks.concat())
}

/// Significant digits that show a value down to the second digit of its uncertainty.
fn digits_of(value: f64, uncertainty: f64) -> usize {
    if !(uncertainty > 0.0 && value != 0.0) {
        return 6;
    }
    let digits = value.abs().log10().floor() - uncertainty.log10().floor() + 2.0;
    digits.clamp(2.0, 12.0) as usize
}
