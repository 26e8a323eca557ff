//! `damprig init`: writes a new campaign, case, study or optimisation with comments, from flags or from a few questions.

mod ask;
mod of_case;
mod structure;
mod values;

use std::io::{IsTerminal, Write, stdin};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use self::structure::StructureArg;
use self::values::{DamperArg, ExperimentArg, ValueArgs};
use super::arguments::ForceArg;
use crate::campaign::Campaign;
use crate::failure::{Failure, Outcome};
use crate::file_keys::fit;
use crate::file_keys::new_file::{self, CaseValues, Excitation, Fitted, MountedDamper, RecordFile};
use crate::input::Source;
use crate::simulation::Case;
use crate::storage::out_file::{to_failure, write_new};
use crate::study::bifurcation::SweepAxis;

/// Writes a new campaign, case, study or optimisation: a commented file to edit.
///
/// Without options, on a terminal, it asks. Values that are not given are those of the rig of the source document.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct InitArgs {
    /// File to write [default: campaign.toml, case.toml, study.toml or optimisation.toml]
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,

    /// Write a case for damprig simulate instead of a campaign
    #[arg(long)]
    case: bool,

    /// Write a case of a structure with several places, with dampers: the shipped example of its kind
    #[arg(long, value_name = "KIND", conflicts_with_all = ["damper", "experiment", "record", "ValueArgs"])]
    structure: Option<StructureArg>,

    /// Write a case with the modes of this modal test: a universal file (UFF 55), or a CSV file with the columns frequency_hz, damping_ratio
    /// and one for each place
    #[arg(long, value_name = "FILE", conflicts_with_all = ["structure", "damper", "experiment", "record", "ValueArgs"])]
    modal_test: Option<PathBuf>,

    /// A place of the modal test and its degree of freedom, may be repeated: tip=12:z, or tip=-12:z against the node's direction
    /// [default: all of them]
    #[arg(long, value_name = "NAME=FREEDOM", requires = "modal_test", value_parser = structure::place)]
    place: Vec<structure::TestedPlace>,

    /// Write a study of this case, for damprig study run
    #[arg(long, value_name = "CASE", conflicts_with_all = ["case", "structure", "modal_test", "damper", "experiment", "record", "ValueArgs"])]
    study: Option<PathBuf>,

    /// An axis of the study, may be repeated [default: what the case's damper is designed by]
    #[arg(long, value_name = "KEY=FROM:TO:COUNT", requires = "study")]
    axis: Vec<SweepAxis>,

    /// Write an optimisation of this case, for damprig optimise
    #[arg(long, value_name = "CASE", conflicts_with_all = ["case", "structure", "modal_test", "study", "damper", "experiment", "record", "ValueArgs"])]
    optimise: Option<PathBuf>,

    /// A variable of the optimisation, may be repeated [default: what the case's damper is designed by]
    #[arg(long, value_name = "KEY=FROM:TO", requires = "optimise", value_parser = of_case::variable)]
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

    #[command(flatten)]
    force: ForceArg,
}

const AFTER_HELP: &str = "\
Examples:
  damprig init
  damprig init my.toml --damper bare,spid,hybrid --experiment stepped-sine,free-vibration
  damprig init --case --damper tmd --natural-frequency-hz 4
  damprig init soft.toml --damper bare,hybrid --wall pu-foam --friction-spring --experiment noise
  damprig init quake.toml --record quake.AT2
  damprig init steel.toml --damper spid --wall steel --clearance-m 0.0075 --sensors data-sheet
  damprig init bar.toml --structure beam
  damprig init part.toml --modal-test test.uff --place tip=12:z --place middle=7:z
  damprig init --study case.toml --axis particle.clearance_ratio=4:24:41
  damprig init --optimise case.toml --variable particle.clearance_ratio=4:24
  damprig run my.toml --dry-run

A set-up that a sweep with --base-amplitude-m would move beyond two thirds of the displacement limit, as the prediction has
it, gets a smaller Z; the command says so, and so does a comment in the file. A record is not scaled.

Exit codes:
  0    success
  1    the file could not be written
  2    the command line is wrong, the values are not allowed, or the file exists; nothing was written";

/// What to write.
struct NewFileRequest {
    is_case: bool,
    dampers: Vec<DamperArg>,
    experiments: Vec<ExperimentArg>,
    has_record: bool,
    values: CaseValues,
}

/// Runs the subcommand.
///
/// # Errors
/// The file exists or cannot be written; values that a campaign or a case may not have.
pub fn run(args: &InitArgs) -> Outcome {
    if let Some(structure) = args.structure {
        return structure.write(args);
    }
    if let Some(file) = &args.modal_test {
        return structure::of_modal_test(file, args);
    }
    if let Some(case) = &args.study {
        return of_case::study(case, args);
    }
    if let Some(case) = &args.optimise {
        return of_case::optimisation(case, args);
    }
    let is_asked = stdin().is_terminal()
        && !args.case
        && args.damper.is_empty()
        && args.experiment.is_empty()
        && args.record.is_none()
        && args.values == ValueArgs::default();
    // Before the questions, so that nobody answers them in vain.
    if let Some(file) = &args.file {
        args.force.check(file)?;
    }
    let mut wanted = if is_asked { ask::ask()? } else { from(args) };
    let default = if wanted.is_case { "case.toml" } else { "campaign.toml" };
    let path = args.file.clone().unwrap_or_else(|| default.into());
    if let Some(record) = &args.record {
        wanted.values.record = record_of(args, record, &path)?;
    }
    args.force.check(&path)?;
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

fn write(path: &Path, text: &str, force: ForceArg) -> Outcome {
    let failed = to_failure(path);
    write_new(&force.file(path), |file| file.write_all(text.as_bytes()).map_err(|e| failed(&e)))
}

fn from(args: &InitArgs) -> NewFileRequest {
    let or = |dampers: &[DamperArg], default: &[DamperArg]| if dampers.is_empty() { default } else { dampers }.to_vec();
    let default: &[DamperArg] = if args.case { &[DamperArg::Spid] } else { &[DamperArg::Bare, DamperArg::Spid] };
    let has_record = args.record.is_some();
    let experiments = match args.experiment[..] {
        [] if has_record => vec![],
        [] => vec![ExperimentArg::SteppedSine],
        _ => args.experiment.clone(),
    };
    let (dampers, values) = (or(&args.damper, default), args.values.values());
    NewFileRequest { is_case: args.case, dampers, experiments, has_record, values }
}

/// The record as a file at `path` names it.
fn record_of(args: &InitArgs, record: &Path, path: &Path) -> Result<RecordFile, Failure> {
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

fn text_of(wanted: &NewFileRequest, name: &str) -> Result<String, Failure> {
    for (option, names) in [("--damper", names(&wanted.dampers)), ("--experiment", names(&wanted.experiments))] {
        if let Some(twice) = names.iter().enumerate().find_map(|(n, name)| names[..n].contains(name).then_some(name)) {
            return Err(Failure::Input(format!("{option}: {twice} is named twice")));
        }
        if wanted.is_case && names.len() > 1 {
            let message = format!("{option}: a case has one, not {}; write a case for each", names.join(" and "));
            return Err(Failure::Input(message));
        }
    }
    let dampers: Vec<MountedDamper> = wanted.dampers.iter().map(|damper| (*damper).into()).collect();
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
fn fitting_text(wanted: &mut NewFileRequest, path: &Path) -> Result<String, Failure> {
    let dampers: Vec<MountedDamper> = wanted.dampers.iter().map(|damper| (*damper).into()).collect();
    let mut text = text_of(wanted, &name_of(path))?;
    let mut campaign = check(wanted, path, &text)?;
    for _ in 0..FITS {
        let Some(parsed) = campaign.filter(|_| wanted.experiments.contains(&ExperimentArg::SteppedSine)) else { break };
        let too_large = fit::too_large(&parsed, &dampers)?;
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
fn check(wanted: &NewFileRequest, path: &Path, text: &str) -> Result<Option<Campaign>, Failure> {
    // Records are named relative to the file.
    let source = Source::new(path.with_file_name("new file").display().to_string(), text);
    if wanted.is_case { Case::parse(&source, "case").map(|_| None) } else { Campaign::parse(source).map(Some) }
        .map_err(|refusal| Failure::Input(format!("{refusal}\n  nothing was written")))
}
