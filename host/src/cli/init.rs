//! `damprig init`: writes a new campaign, case, study or optimisation with comments, from flags or from a few questions.

use std::io::{BufRead, IsTerminal, Write, stdin};
use std::path::{Path, PathBuf};

use clap::{Args as ClapArgs, ValueEnum};

use damprig_core::model::Material;

use super::arguments::{not_negative, positive};
use super::outcome::{Failure, Outcome};
use crate::campaign::Campaign;
use crate::file_keys::fit;
use crate::file_keys::new_file::{self, Damper, Excitation, Fitted, RecordFile, Sensors, Values};
use crate::file_keys::new_study;
use crate::input::Source;
use crate::optimise::Optimisation;
use crate::simulation::Case;
use crate::storage::out_file::{EXISTS, OutFile, to_failure, write_new};
use crate::study::Study;
use crate::study::bifurcation::SweepAxis;

/// Writes a new campaign, case, study or optimisation: a commented file to edit.
///
/// Without options, on a terminal, it asks. Values that are not given are those of the rig of the source document.
#[derive(Debug, ClapArgs)]
#[command(after_help = AFTER_HELP)]
pub struct Args {
    /// File to write [default: campaign.toml, case.toml, study.toml or optimisation.toml]
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,

    /// Write a case for damprig simulate instead of a campaign
    #[arg(long)]
    case: bool,

    /// Write a study of this case, for damprig study run
    #[arg(long, value_name = "CASE", conflicts_with_all = ["case", "damper", "experiment", "record", "ValueArgs"])]
    study: Option<PathBuf>,

    /// An axis of the study, may be repeated [default: what the case's damper is designed by]
    #[arg(long, value_name = "KEY=FROM:TO:COUNT", requires = "study")]
    axis: Vec<SweepAxis>,

    /// Write an optimisation of this case, for damprig optimise
    #[arg(long, value_name = "CASE", conflicts_with_all = ["case", "study", "damper", "experiment", "record", "ValueArgs"])]
    optimise: Option<PathBuf>,

    /// A variable of the optimisation, may be repeated [default: what the case's damper is designed by]
    #[arg(long, value_name = "KEY=FROM:TO", requires = "optimise", value_parser = variable)]
    variable: Vec<SweepAxis>,

    /// Dampers, a set-up each; a case has one [default: bare,spid; of a case: spid]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    damper: Vec<DamperArg>,

    /// Experiments, or the excitation of a case [default: stepped-sine]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    experiment: Vec<ExperimentArg>,

    /// Add a playback of this recorded motion (CSV, AT2, V2, UFF …); of a case: its excitation
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,

    /// Quantity of a CSV record's values: acceleration or displacement
    #[arg(long, value_name = "WORD", requires = "record")]
    record_quantity: Option<String>,

    /// Unit of a CSV record's values, as g or mm
    #[arg(long, value_name = "UNIT", requires = "record")]
    record_unit: Option<String>,

    #[command(flatten)]
    values: ValueArgs,

    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

const AFTER_HELP: &str = "\
Examples:
  damprig init
  damprig init my.toml --damper bare,spid,hybrid --experiment stepped-sine,free-vibration
  damprig init --case --damper tmd --natural-frequency-hz 4
  damprig init soft.toml --damper bare,hybrid --wall pu-foam --friction-spring --experiment noise
  damprig init quake.toml --record quake.AT2
  damprig init steel.toml --damper spid --wall steel --clearance-m 0.0075 --sensors data-sheet
  damprig init --study case.toml --axis particle.clearance_ratio=4:24:41
  damprig init --optimise case.toml --variable particle.clearance_ratio=4:24
  damprig run my.toml --dry-run

A set-up that a sweep with --base-amplitude-m would move beyond two thirds of the displacement limit, as the prediction has
it, gets a smaller Z; the command says so, and so does a comment in the file. A record is not scaled.

Exit codes:
  0    success
  1    the file could not be written
  2    the command line is wrong, the values are not allowed, or the file exists; nothing was written";

/// Dampers, as arguments.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
enum DamperArg {
    /// No damper
    Bare,
    /// Single-particle impact damper
    Spid,
    /// Friction damper
    Fd,
    /// Impact and friction damper
    Hybrid,
    /// Tuned mass damper
    Tmd,
}

impl From<DamperArg> for Damper {
    fn from(argument: DamperArg) -> Self {
        match argument {
            DamperArg::Bare => Self::Bare,
            DamperArg::Spid => Self::Spid,
            DamperArg::Fd => Self::Fd,
            DamperArg::Hybrid => Self::Hybrid,
            DamperArg::Tmd => Self::Tmd,
        }
    }
}

/// Experiments, as arguments.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
enum ExperimentArg {
    /// One frequency after another; in a case a sine at resonance
    SteppedSine,
    /// The structure is released
    FreeVibration,
    /// A pulse of the base
    Impulse,
    /// Band-limited noise of the base
    Noise,
}

/// Materials of walls, as arguments.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
enum WallArg {
    /// Steel on aluminium
    Steel,
    /// Rubber
    Rubber,
    /// Anti-vibration pad
    AntiVibrationPad,
    /// Acrylic foam
    AcrylicFoam,
    /// Polyurethane foam
    PuFoam,
}

/// e of steel on aluminium: table 3-2 of the source document.
const STEEL: f64 = 0.82;

impl WallArg {
    /// The material of a soft wall.
    fn soft(self) -> Option<Material> {
        match self {
            Self::Steel => None,
            Self::Rubber => Some(Material::Rubber),
            Self::AntiVibrationPad => Some(Material::AntiVibrationPad),
            Self::AcrylicFoam => Some(Material::AcrylicFoam),
            Self::PuFoam => Some(Material::PuFoam),
        }
    }
}

/// Simulated sensors, as arguments.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
enum SensorsArg {
    /// No errors
    Ideal,
    /// The errors of a data sheet, and noise
    DataSheet,
}

impl From<ExperimentArg> for Excitation {
    fn from(argument: ExperimentArg) -> Self {
        match argument {
            ExperimentArg::SteppedSine => Self::SteppedSine,
            ExperimentArg::FreeVibration => Self::FreeVibration,
            ExperimentArg::Impulse => Self::Impulse,
            ExperimentArg::Noise => Self::Noise,
        }
    }
}

/// Values of structure and dampers.
#[derive(Clone, Debug, Default, PartialEq, ClapArgs)]
struct ValueArgs {
    /// M, the structure's mass [default: 1.6]
    #[arg(long, value_name = "KG", value_parser = positive)]
    mass_kg: Option<f64>,

    /// fn, the natural frequency [default: 2.5]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    natural_frequency_hz: Option<f64>,

    /// ζ, the damping ratio [default: 0.0038]
    #[arg(long, value_name = "RATIO", value_parser = not_negative)]
    damping_ratio: Option<f64>,

    /// Z, the base amplitude [default: 0.0015]
    #[arg(long, value_name = "M", value_parser = positive)]
    base_amplitude_m: Option<f64>,

    /// m/M of particle and tuned mass [default: 0.1]
    #[arg(long, value_name = "RATIO", value_parser = positive)]
    mass_ratio: Option<f64>,

    /// d/Z of the particle [default: 5]
    #[arg(long, value_name = "RATIO", value_parser = positive)]
    clearance_ratio: Option<f64>,

    /// d of the particle, half of its free travel
    #[arg(long, value_name = "M", value_parser = positive, conflicts_with = "clearance_ratio")]
    clearance_m: Option<f64>,

    /// e, the coefficient of restitution of the walls [default: 0.47]
    #[arg(long, value_name = "E", value_parser = not_negative)]
    restitution: Option<f64>,

    /// Walls of this material: steel is hard with e = 0.82, the others are soft
    #[arg(long, value_name = "MATERIAL", conflicts_with = "restitution")]
    wall: Option<WallArg>,

    /// γF of the friction damper [default: 0.6]
    #[arg(long, value_name = "RATIO", value_parser = not_negative)]
    friction_ratio: Option<f64>,

    /// Friction dampers whose spring the rig adjusts to γF
    #[arg(long, conflicts_with = "case")]
    friction_spring: bool,

    /// Errors of a campaign's simulated sensors [default: steps of 10 µm and noise]
    #[arg(long, value_name = "KIND", conflicts_with = "case")]
    sensors: Option<SensorsArg>,
}

impl ValueArgs {
    fn values(&self) -> Values {
        let default = Values::default();
        Values {
            mass_kg: self.mass_kg.unwrap_or(default.mass_kg),
            natural_frequency_hz: self.natural_frequency_hz.unwrap_or(default.natural_frequency_hz),
            damping_ratio: self.damping_ratio.unwrap_or(default.damping_ratio),
            base_amplitude_m: self.base_amplitude_m.unwrap_or(default.base_amplitude_m),
            fitted: default.fitted,
            mass_ratio: self.mass_ratio.unwrap_or(default.mass_ratio),
            clearance_ratio: self.clearance_ratio.unwrap_or(default.clearance_ratio),
            clearance_m: self.clearance_m,
            restitution: match self.wall {
                Some(WallArg::Steel) => STEEL,
                _ => self.restitution.unwrap_or(default.restitution),
            },
            wall: self.wall.and_then(WallArg::soft),
            friction_ratio: self.friction_ratio.unwrap_or(default.friction_ratio),
            has_spring: self.friction_spring,
            sensors: match self.sensors {
                None => default.sensors,
                Some(SensorsArg::Ideal) => Sensors::Ideal,
                Some(SensorsArg::DataSheet) => Sensors::DataSheet,
            },
            record: default.record,
        }
    }
}

/// What to write.
struct Wanted {
    is_case: bool,
    dampers: Vec<DamperArg>,
    experiments: Vec<ExperimentArg>,
    has_record: bool,
    values: Values,
}

/// Runs the subcommand.
///
/// # Errors
/// The file exists or cannot be written; values that a campaign or a case may not have.
pub fn run(args: &Args) -> Outcome {
    if let Some(case) = &args.study {
        return study_of(case, args);
    }
    if let Some(case) = &args.optimise {
        return optimisation_of(case, args);
    }
    let is_asked = stdin().is_terminal()
        && !args.case
        && args.damper.is_empty()
        && args.experiment.is_empty()
        && args.record.is_none()
        && args.values == ValueArgs::default();
    // Before the questions, so that nobody answers them in vain.
    if let Some(file) = &args.file {
        refuse_existing(file, args.force)?;
    }
    let mut wanted = if is_asked { ask()? } else { from(args) };
    let default = if wanted.is_case { "case.toml" } else { "campaign.toml" };
    let path = args.file.clone().unwrap_or_else(|| default.into());
    if let Some(record) = &args.record {
        wanted.values.record = record_of(args, record, &path)?;
    }
    refuse_existing(&path, args.force)?;
    let text = fitting_text(&mut wanted, &path)?;
    write(&path, &text, args.force)?;
    let shown = path.display();
    for Fitted { damper, base_amplitude_m, max_x_m } in &wanted.values.fitted {
        say!(
            "Set-up {:?}: base_amplitude_m = {base_amplitude_m:?} in place of {:?}, with which the predicted largest |x| is {:.0} mm.",
            damper.names().0,
            wanted.values.base_amplitude_m,
            max_x_m * 1e3
        );
    }
    if wanted.is_case {
        say!("Written to {shown}. Next: damprig simulate {shown}");
    } else {
        say!("Written to {shown}. Next: damprig run {shown} --dry-run");
    }
    Ok(())
}

/// Writes a study of a case.
fn study_of(case_path: &Path, args: &Args) -> Outcome {
    let path = args.file.clone().unwrap_or_else(|| "study.toml".into());
    refuse_existing(&path, args.force)?;
    let case = Case::read(case_path).map_err(Failure::input)?;
    let named = beside_or_whole("--study", case_path, &path)?;
    let axes = if args.axis.is_empty() { new_study::usual_axes(&case) } else { args.axis.clone() };
    let text = new_study::study(&name_of(&path), &named, &case, &axes);
    let source = Source::new(path.with_file_name("new file").display().to_string(), text.as_str());
    Study::parse(&source, &path, None)
        .map_err(|refusal| Failure::Input(format!("{refusal}\n  nothing was written")))?;
    write(&path, &text, args.force)?;
    let shown = path.display();
    say!("Written to {shown}. Next: damprig study run {shown} --dry-run");
    Ok(())
}

/// Writes an optimisation of a case.
fn optimisation_of(case_path: &Path, args: &Args) -> Outcome {
    let path = args.file.clone().unwrap_or_else(|| "optimisation.toml".into());
    refuse_existing(&path, args.force)?;
    let case = Case::read(case_path).map_err(Failure::input)?;
    let has_usual = case.set_up.particle.is_some() || case.set_up.friction_damper.is_some();
    if args.variable.is_empty() && !has_usual {
        return Err(Failure::Input(format!(
            "--optimise {}: the case has no particle and no friction damper, whose clearance, restitution and force are usual variables\n  \
             name what may change: --variable KEY=FROM:TO, for example --variable tmd.frequency_ratio=0.8:1.1",
            case_path.display()
        )));
    }
    let named = beside_or_whole("--optimise", case_path, &path)?;
    let variables = if args.variable.is_empty() { new_study::usual_axes(&case) } else { args.variable.clone() };
    let text = new_study::optimisation(&name_of(&path), &named, &case, &variables);
    let source = Source::new(path.with_file_name("new file").display().to_string(), text.as_str());
    Optimisation::parse(&source, &path, None)
        .map_err(|refusal| Failure::Input(format!("{refusal}\n  nothing was written")))?;
    write(&path, &text, args.force)?;
    let shown = path.display();
    say!("Written to {shown}. Next: damprig optimise {shown} --dry-run");
    Ok(())
}

/// A variable and its range, as an axis from end to end.
fn variable(text: &str) -> Result<SweepAxis, String> {
    let is_range = text.split_once('=').is_some_and(|(_, range)| range.split(':').count() == 2);
    if !is_range {
        return Err("write KEY=FROM:TO, for example particle.clearance_ratio=4:24".into());
    }
    format!("{text}:2").parse()
}

fn write(path: &Path, text: &str, force: bool) -> Outcome {
    let failed = to_failure(path);
    let out = OutFile { path: path.into(), force };
    write_new(&out, |file| file.write_all(text.as_bytes()).map_err(|e| failed(&e))).map_err(Failure::failed)
}

fn refuse_existing(path: &Path, force: bool) -> Outcome {
    if !force && path.symlink_metadata().is_ok() {
        return Err(Failure::Input(format!("cannot write {}: {EXISTS}", path.display())));
    }
    Ok(())
}

fn from(args: &Args) -> Wanted {
    let or = |dampers: &[DamperArg], default: &[DamperArg]| if dampers.is_empty() { default } else { dampers }.to_vec();
    let default: &[DamperArg] = if args.case { &[DamperArg::Spid] } else { &[DamperArg::Bare, DamperArg::Spid] };
    let has_record = args.record.is_some();
    let experiments = match args.experiment[..] {
        [] if has_record => vec![],
        [] => vec![ExperimentArg::SteppedSine],
        _ => args.experiment.clone(),
    };
    let (dampers, values) = (or(&args.damper, default), args.values.values());
    Wanted { is_case: args.case, dampers, experiments, has_record, values }
}

/// The record as a file at `path` names it.
fn record_of(args: &Args, record: &Path, path: &Path) -> Result<RecordFile, Failure> {
    let (quantity, unit) = (args.record_quantity.clone(), args.record_unit.clone());
    Ok(RecordFile { file: beside_or_whole("--record", record, path)?, quantity, unit })
}

/// A file as another at `path` names it: as it was typed if both are in the same folder, else by its whole path.
fn beside_or_whole(option: &str, named: &Path, path: &Path) -> Result<String, Failure> {
    let whole =
        named.canonicalize().map_err(|error| Failure::Input(format!("{option} {}: {error}", named.display())))?;
    let is_beside = path.parent().is_none_or(|folder| folder.as_os_str().is_empty());
    let file = if is_beside { named } else { &whole };
    let text = file.to_str().map(str::to_string);
    text.ok_or_else(|| {
        Failure::Input(format!("{option} {}: its path is not UTF-8\n  give it another name", file.display()))
    })
}

/// A name that a campaign may have, from the file's.
fn name_of(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let fits = |c: char| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '-' };
    let name: String = stem.chars().map(fits).take(60).collect();
    if name.is_empty() { "campaign".into() } else { name }
}

fn text_of(wanted: &Wanted, name: &str) -> Result<String, Failure> {
    for (option, names) in [("--damper", names(&wanted.dampers)), ("--experiment", names(&wanted.experiments))] {
        if let Some(twice) = names.iter().enumerate().find_map(|(n, name)| names[..n].contains(name).then_some(name)) {
            return Err(Failure::Input(format!("{option}: {twice} is named twice")));
        }
        if wanted.is_case && names.len() > 1 {
            let message = format!("{option}: a case has one, not {}; write a case for each", names.join(" and "));
            return Err(Failure::Input(message));
        }
    }
    let dampers: Vec<Damper> = wanted.dampers.iter().map(|damper| (*damper).into()).collect();
    let mut experiments: Vec<Excitation> = wanted.experiments.iter().map(|experiment| (*experiment).into()).collect();
    experiments.extend(wanted.has_record.then_some(Excitation::Record));
    if wanted.is_case && experiments.len() > 1 {
        let message = "--record: a case has one excitation; leave out --experiment, or write a case for each";
        return Err(Failure::Input(message.into()));
    }
    Ok(if wanted.is_case {
        new_file::case(name, dampers[0], experiments[0], &wanted.values)
    } else {
        new_file::campaign(name, &dampers, &experiments, &wanted.values)
    })
}

/// The words of arguments.
fn names<T: ValueEnum>(arguments: &[T]) -> Vec<String> {
    arguments.iter().filter_map(|argument| Some(argument.to_possible_value()?.get_name().to_string())).collect()
}

/// Times that an amplitude is fitted: once, or more with soft walls.
const FITS: usize = 4;

/// The text, with smaller amplitudes where the prediction is too large.
fn fitting_text(wanted: &mut Wanted, path: &Path) -> Result<String, Failure> {
    let dampers: Vec<Damper> = wanted.dampers.iter().map(|damper| (*damper).into()).collect();
    let mut text = text_of(wanted, &name_of(path))?;
    let mut campaign = check(wanted, path, &text)?;
    for _ in 0..FITS {
        let Some(parsed) = campaign.filter(|_| wanted.experiments.contains(&ExperimentArg::SteppedSine)) else { break };
        let too_large = fit::too_large(&parsed, &dampers).map_err(Failure::input)?;
        if too_large.is_empty() {
            break;
        }
        for one in too_large {
            match wanted.values.fitted.iter_mut().find(|known| known.damper == one.damper) {
                // What the first amplitude does stays.
                Some(known) => known.base_amplitude_m = one.base_amplitude_m,
                None => wanted.values.fitted.push(one),
            }
        }
        text = text_of(wanted, &name_of(path))?;
        campaign = check(wanted, path, &text)?;
    }
    Ok(text)
}

/// Values that are out of range are reported with their keys before anything is written. Gives the campaign; none of a case.
fn check(wanted: &Wanted, path: &Path, text: &str) -> Result<Option<Campaign>, Failure> {
    // Records are named relative to the file.
    let source = Source::new(path.with_file_name("new file").display().to_string(), text);
    if wanted.is_case { Case::parse(&source, "case").map(|_| None) } else { Campaign::parse(source).map(Some) }
        .map_err(|refusal| Failure::Input(format!("{refusal}\n  nothing was written")))
}

/// Asks what to write.
fn ask() -> Result<Wanted, Failure> {
    say!("Enter takes the default in brackets.");
    let is_case = answer("Campaign for the rig, or case to simulate", "campaign", |text| match text {
        "campaign" => Ok(false),
        "case" => Ok(true),
        _ => Err("write campaign or case".into()),
    })?;
    let dampers = if is_case {
        answer("Damper: bare, spid, fd, hybrid or tmd", "spid", one::<DamperArg>)?
    } else {
        answer("Dampers, of bare, spid, fd, hybrid, tmd", "bare,spid", several::<DamperArg>)?
    };
    let experiments = if is_case {
        answer("Excitation: stepped-sine, free-vibration, impulse or noise", "stepped-sine", one::<ExperimentArg>)?
    } else {
        answer(
            "Experiments, of stepped-sine, free-vibration, impulse, noise",
            "stepped-sine",
            several::<ExperimentArg>,
        )?
    };
    let default = Values::default();
    let number = |question: &str, default: f64, parse: fn(&str) -> Result<f64, String>| {
        answer(question, &default.to_string(), parse)
    };
    let values = Values {
        mass_kg: number("Mass of the structure, kg", default.mass_kg, positive)?,
        natural_frequency_hz: number("Natural frequency, Hz", default.natural_frequency_hz, positive)?,
        damping_ratio: number("Damping ratio", default.damping_ratio, not_negative)?,
        base_amplitude_m: number("Base amplitude Z, m", default.base_amplitude_m, positive)?,
        ..default
    };
    Ok(Wanted { is_case, dampers, experiments, has_record: false, values })
}

/// Asks until the answer can be read.
fn answer<T>(question: &str, default: &str, read: impl Fn(&str) -> Result<T, String>) -> Result<T, Failure> {
    loop {
        super::output::prompt(&format!("{question} [{default}]: "));
        let mut line = String::new();
        let length = stdin().lock().read_line(&mut line).map_err(Failure::failed)?;
        if length == 0 {
            return Err(Failure::Input("the answers ended; nothing was written".into()));
        }
        let text = if line.trim().is_empty() { default } else { line.trim() };
        match read(text) {
            Ok(value) => return Ok(value),
            Err(why) => say!("{text:?}: {why}"),
        }
    }
}

fn one<T: ValueEnum>(text: &str) -> Result<Vec<T>, String> {
    T::from_str(text, true).map(|value| vec![value]).map_err(|_| "is none of these".into())
}

fn several<T: ValueEnum + PartialEq>(text: &str) -> Result<Vec<T>, String> {
    let values: Vec<T> =
        text.split(',').map(|word| one(word.trim())).collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    let is_twice = values.iter().enumerate().any(|(n, value)| values[..n].contains(value));
    if is_twice { Err("names one twice".into()) } else { Ok(values) }
}
