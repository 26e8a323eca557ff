//! `damprig identify`: identifies parameters of the rig and writes them as a set-up file.

mod contact;
mod decay;
mod modes;
mod next;
mod response;
mod restitution;
mod sound;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::slice::from_ref;

use clap::{Args, Subcommand};

use super::arguments::{ForceArg, JsonArg, positive};
use crate::failure::{Failure, Outcome};
use crate::identify::backbone::Row;
use crate::identify::modal::Wish;
use crate::identify::restitution::OverSpeed;
use crate::identify::table::NumberTable;
use crate::identify::wall::Pad;
use crate::identify::{Estimate, ExperimentChoice, Identification, Sensors, friction, set_up_file, wall};
use crate::input::Source;
use crate::report::numbers::significant;
use crate::report::terminal::{plain_table, table};
use crate::signal_file::Selector;
use crate::storage::out_file::{OutFile, to_failure, write_new};

/// Identifies parameters of the rig from runs and tables: each with its standard uncertainty and its 95 % interval.
///
/// docs/IDENTIFY.md describes the methods, the columns of the tables and the measured errors.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct IdentifyArgs {
    #[command(subcommand)]
    what: IdentifyCommand,
}

const AFTER_HELP: &str = "\
Examples:
  damprig identify decay runs/20260601-101500-release-ab12 --out identified.toml
  damprig identify decay release.csv --mass-kg 1.6 --json
  damprig identify decay beam.csv --plot backbone.svg --plot-residuals residuals.svg --table backbone.csv
  damprig identify response sweep.csv
  damprig identify response noise --plot response.svg
  damprig identify response analyser.uff#3 --from-hz 30 --to-hz 40 --plot mode.svg
  damprig identify response case1.mat#Hf_chan_2 --frequencies-hz Freq_domain --coherence Hf_coh_chan_2 --unit g/N
  damprig identify response impact.mat#acceleration --drive force
  damprig identify modes tip=test.uff#1 middle=test.uff#2 --driven tip --to-hz 800 --out part.toml
  damprig identify restitution runs/20260601-101500-spid-ab12 --out identified.toml --update
  damprig identify restitution drops.csv --out identified.toml --update
  damprig identify restitution film.csv --frame-rate-hz 240 --table impacts.csv --plot impacts.svg
  damprig identify restitution film.csv times.csv --frame-rate-hz 240 --drop-height-m 0.2
  damprig identify contact runs/20260601-101500-spid-ab12 --out identified.toml --update
  damprig identify contact pulse1.csv pulse2.csv --reduced-mass-kg 0.145
  damprig identify friction incline.csv --out identified.toml --update
  damprig identify sound impacts.wav --calibration tone.wav --background quiet.wav
  damprig identify wall dma.csv --shape-factor-m 0.07 --frequency-hz 40 --out soft.toml
  damprig identify next runs/20260601-101500-sweep-ab12 --set-up-file identified.toml --plot next.svg

A campaign or a case reads the written file with set_up_file = \"identified.toml\" at its top.

Exit codes:
  0    success
  1    a file could not be written
  2    the command line or the record is wrong; nothing was written";

#[derive(Debug, Subcommand)]
enum IdentifyCommand {
    /// Natural frequency, damping ratio and Coulomb friction from a free vibration
    Decay(decay::DecayArgs),
    /// Natural frequency and damping ratio from a stepped sine, from a frequency response of a file, or from motion and excitation over time
    Response(response::ResponseArgs),
    /// Natural frequencies, damping ratios and shapes from frequency responses at several places
    Modes(modes::ModesArgs),
    /// Coefficient of restitution, and over the approach speed, from a run with impacts, from films and tables of drop tests; clearance, contact time
    Restitution(restitution::RestitutionArgs),
    /// Contact time and stiffness of a hard wall from a run or from force records
    Contact(contact::ContactArgs),
    /// Friction coefficient from an incline, or friction force per deflection of a spring
    Friction(FrictionArgs),
    /// Stiffness and loss factor of a soft wall from a DMA table
    Wall(WallArgs),
    /// Sound pressure levels of a recording
    Sound(sound::SoundArgs),
    /// Points to measure next: the frequency and the set-up that narrow the identified values of a run most
    #[command(long_flag = "next")]
    Next(next::NextArgs),
}

/// Friction coefficient of the particle from an incline, or friction force per deflection of the damper's spring.
///
/// The columns say which test it is. Angle at which the particle just slides on: angle_deg. Slide from rest: angle_deg,
/// distance_m and duration_s. Spring: deflection_m and force_n.
#[derive(Debug, Args)]
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
#[derive(Debug, Args)]
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
#[derive(Debug, Args)]
struct ChoiceArgs {
    /// Set-up of the run, if several have such an experiment
    #[arg(long, value_name = "NAME")]
    set_up: Option<String>,

    /// Experiment of the run, if there are several of this kind
    #[arg(long, value_name = "NAME")]
    experiment: Option<String>,
}

impl ChoiceArgs {
    fn choice(&self) -> ExperimentChoice {
        ExperimentChoice { set_up: self.set_up.clone(), experiment: self.experiment.clone() }
    }
}

/// Errors of the displacement sensors.
#[derive(Debug, Args)]
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
#[derive(Clone, Debug, Args)]
struct OutArgs {
    #[command(flatten)]
    json: JsonArg,

    /// Write the values as a set-up file (TOML) for campaigns and cases
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Add the values to an existing file of --out; values of the same keys are replaced
    #[arg(long, requires = "out", conflicts_with = "force")]
    update: bool,

    #[command(flatten)]
    force: ForceArg,
}

impl OutArgs {
    /// Rejects an --out that is one of the sources, and files that exist: that of --out and the given ones of other options.
    fn check(&self, sources: &[PathBuf], others: &[&Option<PathBuf>]) -> Outcome {
        if let Some(path) = &self.out {
            let is_same = |source: &PathBuf, out: &PathBuf| {
                Selector::of(source).path.canonicalize().is_ok_and(|source| source == *out)
            };
            if path.canonicalize().is_ok_and(|out| sources.iter().any(|source| is_same(source, &out))) {
                let message = format!("--out would overwrite {}, the record\n  give another file name", path.display());
                return Err(Failure::Input(message));
            }
            if !self.update && !self.force.is_given() && path.symlink_metadata().is_ok() {
                let message = format!(
                    "--out: {} exists\n  add the values to it with --update, replace it with --force, or give another name",
                    path.display()
                );
                return Err(Failure::Input(message));
            }
        }
        others.iter().copied().flatten().try_for_each(|path| self.force.check(path))
    }
}

/// Runs the subcommand.
///
/// # Errors
/// A record from which nothing can be identified, an unwritable file.
pub fn run(args: &IdentifyArgs) -> Outcome {
    match &args.what {
        IdentifyCommand::Decay(args) => decay::run(args),
        IdentifyCommand::Response(args) => response::run(args),
        IdentifyCommand::Modes(args) => modes::run(args),
        IdentifyCommand::Restitution(args) => restitution::run(args),
        IdentifyCommand::Contact(args) => contact::run(args),
        IdentifyCommand::Friction(args) => {
            args.out.check(from_ref(&args.source), &[])?;
            let identified = of_table(&args.source, |table| friction::identify(table, args.gravity));
            finish(&args.out, identified?)
        }
        IdentifyCommand::Sound(args) => {
            args.out.check(from_ref(&args.source), &[])?;
            finish(&args.out, sound::identify(args)?)
        }
        IdentifyCommand::Next(args) => next::run(args),
        IdentifyCommand::Wall(args) => {
            args.out.check(from_ref(&args.source), &[])?;
            finish(&args.out, wall(args)?)
        }
    }
}

/// Identifies from a table.
fn of_table(
    source: &Path,
    identify: impl FnOnce(&NumberTable) -> Result<Vec<Estimate>, Failure>,
) -> Result<Identification, Failure> {
    let table = NumberTable::read(source)?;
    Ok(Identification::new(table.file(), identify(&table)?))
}

fn wall(args: &WallArgs) -> Result<Identification, Failure> {
    let pad = Pad { shape_factor_m: args.shape_factor_m, frequency_hz: args.frequency_hz };
    let mut identified = of_table(&args.source, |table| wall::identify(table, pad))?;
    identified.words = vec![("particle.wall.kind", "voigt"), ("particle.wall.release", "zero_force")];
    if identified.estimates.iter().all(|estimate| estimate.key.is_none()) {
        let remark = "without --shape-factor-m there is no stiffness, and nothing that a set-up could use";
        identified.remarks = vec![remark.into()];
    }
    Ok(identified)
}

/// Refuses a band without width.
fn check_band(band: Wish) -> Result<(), Failure> {
    match (band.from_hz, band.to_hz) {
        (Some(from), Some(to)) if from >= to => {
            Err(Failure::Input(format!("--from-hz {from} must be less than --to-hz {to}")))
        }
        _ => Ok(()),
    }
}

/// Prints the results, and writes the set-up file unless something contradicts them; `help` says what to do then.
fn finish_if_consistent(args: &OutArgs, identified: Identification, despite_misfit: bool, help: &str) -> Outcome {
    let contradiction = identified.contradiction.clone().filter(|_| !despite_misfit);
    let Some((path, contradiction)) = args.out.as_ref().zip(contradiction) else {
        return finish(args, identified);
    };
    finish(&OutArgs { out: None, update: false, ..args.clone() }, identified)?;
    let path = path.display();
    Err(Failure::Input(format!("--out: {path} is not written: {contradiction}\n  {help} with --despite-misfit")))
}

/// Prints the results and writes the set-up file.
fn finish(args: &OutArgs, identified: Identification) -> Outcome {
    let text = args.out.as_ref().map(|path| set_up_text(args, path, &identified)).transpose()?;
    args.json.print(&identified)?;
    say!("{}", text_of(&identified));
    let (Some(path), Some(text)) = (&args.out, text) else { return Ok(()) };
    let out = OutFile { path: path.clone(), force: args.force.is_given() || args.update };
    let failed = to_failure(path);
    write_new(&out, |file| file.write_all(text.as_bytes()).map_err(|e| failed(&e)))?;
    say!(
        "\nWritten to {}: `set_up_file = {:?}` at the top of a campaign reads it.",
        path.display(),
        path.display().to_string()
    );
    Ok(())
}

/// The text of the set-up file, with what an existing one has.
fn set_up_text(args: &OutArgs, path: &Path, identified: &Identification) -> Result<String, Failure> {
    let exists = path.symlink_metadata().is_ok();
    if identified.estimates.iter().all(|estimate| estimate.key.is_none()) {
        let message = "--out: none of the results is a key of a set-up; print them, or use --json";
        return Err(Failure::Input(message.into()));
    }
    let earlier = if exists && args.update { Some(Source::read(path)?) } else { None };
    set_up_file::text(identified, earlier.as_ref().map(Source::text))
        .map_err(|error| Failure::Input(format!("{}: {error}", path.display())))
}

/// The results as tables; what does not fit is the first line.
fn text_of(identified: &Identification) -> String {
    let mut table = plain_table(&["quantity", "value", "standard uncertainty", "95 % interval", "unit", "method"]);
    for estimate in &identified.estimates {
        let [value, uncertainty, interval] = shown(estimate.value, estimate.standard_uncertainty, estimate.interval_95);
        table.add_row(vec![
            estimate.quantity.to_string(),
            value,
            uncertainty,
            interval,
            estimate.unit.to_string(),
            estimate.method.to_string(),
        ]);
    }
    let misfits = identified.lack_of_fit.iter().flatten();
    let misfits: String = misfits.map(|misfit| format!("Lack of fit: {misfit}\n")).collect();
    let over_amplitude = match &identified.over_amplitude[..] {
        [] => String::new(),
        rows => format!("\nOver the amplitude\n{}", over_amplitude(rows)),
    };
    // The impacts of a run are many, and in its own table.
    let drop_tests = identified.over_speed.as_ref().filter(|over| !over.impacts.is_empty());
    let over_speed = drop_tests.map(|over| format!("\nOver the approach speed\n{}", over_speed(over)));
    let answer = identified.answer.iter().map(|answer| format!("Answer: {answer}\n")).collect::<String>();
    let remarks: Vec<String> = identified.remarks.iter().map(|remark| format!("\n{remark}")).collect();
    format!(
        "{answer}{misfits}Taken from {}\n{table}{over_amplitude}{}{}",
        identified.taken_from,
        over_speed.unwrap_or_default(),
        remarks.concat()
    )
}

/// Impacts that are printed; the table of --table has all.
const PRINTED: usize = 30;

/// Restitution over the approach speed.
fn over_speed(over: &OverSpeed) -> String {
    let mut rows = table(&[
        "drop",
        "impact",
        "time\n(s)",
        "speed\n(m/s)",
        "e",
        "standard\nuncertainty",
        "e by\ntimes",
        "e by\nheights",
    ]);
    let optional = |value: Option<f64>| value.map_or(String::new(), |value| significant(value, 4));
    for impact in over.impacts.iter().take(PRINTED) {
        let uncertainty = impact.coefficient_standard_uncertainty;
        rows.add_row([
            impact.drop.to_string(),
            impact.number.to_string(),
            optional(impact.time_s),
            significant(impact.speed_m_per_s, 4),
            significant(impact.coefficient, 4),
            if uncertainty > 0.0 { significant(uncertainty, 2) } else { String::new() },
            optional(impact.coefficient_by_times),
            optional(impact.coefficient_by_heights),
        ]);
    }
    let more = over.impacts.len().saturating_sub(PRINTED);
    if more > 0 { format!("{rows}\nand {more} more impacts: --table FILE.csv has all") } else { rows.to_string() }
}

/// Damping ratio and frequency over the amplitude.
fn over_amplitude(rows: &[Row]) -> String {
    let mut shown_rows = table(&[
        "time\n(s)",
        "amplitude\n(mm)",
        "damping ratio",
        "95 % interval",
        "frequency\n(Hz)",
        "95 % interval\n(Hz)",
    ]);
    for row in rows {
        let (zeta, zeta_u) = (row.damping_ratio, row.damping_ratio_standard_uncertainty);
        let (hertz, hertz_u) = (row.natural_frequency_hz, row.natural_frequency_standard_uncertainty_hz);
        let [zeta, _, zeta_interval] = shown(zeta, zeta_u, row.damping_ratio_interval_95);
        let [hertz, _, hertz_interval] = shown(hertz, hertz_u, row.natural_frequency_interval_95_hz);
        let time = format!("{:.3} to {:.3}", row.from_s, row.to_s);
        shown_rows.add_row([time, significant(row.amplitude_m * 1e3, 4), zeta, zeta_interval, hertz, hertz_interval]);
    }
    shown_rows.to_string()
}

/// Value, standard uncertainty and interval; two digits of the uncertainty decide how many of the value are shown.
fn shown(value: f64, uncertainty: f64, [low, high]: [f64; 2]) -> [String; 3] {
    let digits = digits_of(value, uncertainty);
    [
        significant(value, digits),
        significant(uncertainty, 2),
        format!("{} to {}", significant(low, digits), significant(high, digits)),
    ]
}

/// Significant digits that show a value down to the second digit of its uncertainty.
fn digits_of(value: f64, uncertainty: f64) -> usize {
    if !(uncertainty > 0.0 && value != 0.0) {
        return 6;
    }
    let digits = value.abs().log10().floor() - uncertainty.log10().floor() + 2.0;
    digits.clamp(2.0, 12.0) as usize
}
