//! `damprig study bifurcation`: sweeps a key of a case up and down and draws the sampled cycles.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::arguments::{ForceArg, QuietArg, SetArg};
use super::ctrl_c::CtrlC;
use super::examples;
use super::output::print_place;
use super::progress::StudyBar;
use crate::failure::{Failure, Outcome};
use crate::file_keys::FileKind;
use crate::input::Source;
use crate::report::bifurcation_files;
use crate::simulation::SetValues;
use crate::simulation::case::default_name;
use crate::storage::create_folder;
use crate::study::bifurcation::{self, Direction, Sweep, SweepAxis};

/// Draws a bifurcation diagram: sweeps a key of a case up and down.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct BifurcationArgs {
    /// Case file (TOML or JSON) with a sine, or the name of a shipped one (`damprig examples`)
    #[arg(value_name = "CASE")]
    case: PathBuf,

    /// The key, its first and last value, and the number of values
    #[arg(long, value_name = "KEY=FROM:TO:COUNT")]
    axis: SweepAxis,

    /// Directions of the sweep
    #[arg(long, value_enum, default_value_t = DirectionArg::Both)]
    direction: DirectionArg,

    /// Cycles at each value before sampling
    #[arg(long, value_name = "N", default_value_t = 200)]
    settle_cycles: u32,

    /// Sampled cycles at each value
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    cycles: u32,

    #[command(flatten)]
    set: SetArg,

    /// Also draw the Poincaré section (x, x′) at the value nearest to this one
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    section: Option<f64>,

    /// Folder of the results
    #[arg(long, value_name = "FOLDER", default_value = "bifurcation")]
    out: PathBuf,

    #[command(flatten)]
    force: ForceArg,

    #[command(flatten)]
    quiet: QuietArg,
}

const AFTER_HELP: &str = "\
Examples:
  damprig study bifurcation spid --axis particle.clearance_ratio=10:16:301
  damprig study bifurcation spid --axis particle.wall.coefficient=0.2:0.9:201 --set particle.clearance_ratio=12
  damprig study bifurcation spid --axis particle.clearance_ratio=10:16:301 --section 15 --cycles 500

The motion goes on from value to value, so up and down may follow different motions; a particle that a smaller cavity has no
room for is put at its wall. The folder gets bifurcation.svg, .png and bifurcation.parquet with the state at the end of each sampled
cycle (drive phase 0) and the cycle's largest |x|.

Exit codes:
  0    success
  1    a file could not be written
  2    the command line or the case is wrong; nothing was written
  130  interrupted (Ctrl-C, SIGTERM or SIGHUP); the values so far are written";

/// Directions, as an argument.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum DirectionArg {
    /// Up and down
    Both,
    /// From the first value to the last
    Up,
    /// From the last value to the first
    Down,
}

/// Runs the subcommand.
///
/// # Errors
/// Bad input, an unwritable file, an interrupted run.
pub fn run(args: &BifurcationArgs) -> Outcome {
    args.quiet.apply();
    let sweep = Sweep {
        key: args.axis.key.clone(),
        values: args.axis.values.clone(),
        settle_cycles: args.settle_cycles,
        cycles: args.cycles,
    };
    let set = SetValues { origin: "--axis and --set".into(), ..args.set.values()? };
    let file = examples::find(FileKind::Case, &args.case)?;
    let source = Source::read(&file)?;
    let name = default_name(&file);
    let cases = bifurcation::cases(source.name(), source.text(), &name, &sweep, &set)?;
    let table = args.out.join(bifurcation_files::TABLE);
    args.force.check(&table)?;
    create_folder(&args.out)?;
    let ctrl_c = CtrlC::watch()?;
    let directions: &[Direction] = match args.direction {
        DirectionArg::Both => &[Direction::Up, Direction::Down],
        DirectionArg::Up => &[Direction::Up],
        DirectionArg::Down => &[Direction::Down],
    };
    let bar = StudyBar::new(&name, (cases.len() * directions.len()) as u64);
    let go_on = |done: u64| {
        bar.reach(done, None);
        !ctrl_c.is_pressed()
    };
    let samples = bifurcation::run_all(&cases, &sweep, directions, &go_on);
    bar.end();
    let samples = samples?;
    let section = bifurcation_files::write(&args.out, &cases[0], &samples, &sweep, args.section)?;
    say!("Figure: {}", args.out.join("bifurcation.svg").display());
    if let Some(title) = section {
        say!("Section: {} ({title})", args.out.join("section.svg").display());
    }
    print_place(&format!("Table:  {} ({} rows)", table.display(), samples.len()));
    if ctrl_c.is_pressed() {
        return Err(Failure::Interrupted("interrupted; the values so far are written".into()));
    }
    Ok(())
}
