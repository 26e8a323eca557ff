//! `damprig study basins`: follows every start of a grid and draws which motion it ends on.

use std::path::PathBuf;

use clap::Args;

use super::arguments::{ForceArg, QuietArg, SetArg};
use super::ctrl_c::CtrlC;
use super::examples;
use super::output::print_place;
use super::progress::StudyBar;
use crate::failure::{Failure, Outcome};
use crate::file_keys::FileKind;
use crate::input::Source;
use crate::report::basins_files;
use crate::report::numbers::significant;
use crate::simulation::case::default_name;
use crate::simulation::{Case, SetValues};
use crate::storage::create_folder;
use crate::study::basins::{self, Grid, MAX_PERIODS, MIN_CYCLES};
use crate::study::bifurcation::SweepAxis;

/// Draws basins of attraction: which motion each start of a grid ends on.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct BasinsArgs {
    /// Case file (TOML or JSON) with a sine, or the name of a shipped one (`damprig examples`)
    #[arg(value_name = "CASE")]
    case: PathBuf,

    /// A key of `initial`, its first and last value, and the number of values; given twice
    #[arg(long, value_name = "KEY=FROM:TO:COUNT", required = true)]
    axis: Vec<SweepAxis>,

    /// Most cycles of a start; a motion that has not settled by then has no attractor
    #[arg(long, value_name = "N", default_value_t = 3000, value_parser = clap::value_parser!(u32).range(i64::from(MIN_CYCLES)..=1_000_000))]
    cycles: u32,

    #[command(flatten)]
    set: SetArg,

    /// Folder of the results
    #[arg(long, value_name = "FOLDER", default_value = "basins")]
    out: PathBuf,

    #[command(flatten)]
    force: ForceArg,

    #[command(flatten)]
    quiet: QuietArg,
}

const AFTER_HELP: &str = "\
Examples:
  damprig study basins spid --axis initial.x_m=-0.05:0.05:101 --axis initial.v_m_per_s=-0.8:0.8:101
  damprig study basins spid --axis initial.x_m=-0.05:0.05:51 --axis initial.y_m=-0.02:0.02:51 --set base.frequency_hz=2.7

A motion has an attractor if it settles and repeats within 16 cycles. The folder gets basins.svg, .png, basins.parquet with the attractor of each
start and its last state (at drive phase 0), and attractors.parquet with a state of each attractor.

Exit codes:
  0    success
  1    a file could not be written
  2    the command line or the case is wrong; nothing was written
  130  interrupted (Ctrl-C, SIGTERM or SIGHUP); nothing was written";

/// Most attractors that are told one by one.
const TOLD: usize = 12;

/// Runs the subcommand.
///
/// # Errors
/// Bad input, an unwritable file, an interrupted run.
pub fn run(args: &BasinsArgs) -> Outcome {
    args.quiet.apply();
    let Ok(axes) = <[SweepAxis; 2]>::try_from(args.axis.clone()) else {
        let words = format!("--axis is given {} times: a map has two axes", args.axis.len());
        return Err(Failure::Input(words));
    };
    let grid = Grid { axes, most_cycles: args.cycles };
    let set = SetValues { origin: "--axis and --set".into(), ..args.set.values()? };
    let file = examples::find(FileKind::Case, &args.case)?;
    let source = Source::read(&file)?;
    let name = default_name(&file);
    let case = Case::parse_changed(&source, &name, &set)?;
    let table = args.out.join(basins_files::STARTS);
    args.force.check(&table)?;
    let ctrl_c = CtrlC::watch()?;
    let bar = StudyBar::new(&name, grid.starts() as u64);
    let go_on = |done: u64| {
        bar.reach(done, None);
        !ctrl_c.is_pressed()
    };
    let found = basins::run((source.name(), source.text(), &name), &grid, &set, &go_on);
    bar.end();
    let Some(found) = found? else {
        return Err(Failure::Interrupted("interrupted; nothing was written".into()));
    };
    create_folder(&args.out)?;
    basins_files::write(&args.out, &case, &found, &grid)?;
    let all = found.ends.len();
    let share = |starts: usize| format!("{} %", significant(100.0 * starts as f64 / all as f64, 3));
    for (number, of) in (1..).zip(found.attractors.iter().take(TOLD)) {
        say!("Attractor {number}: {} of the starts; {}", share(of.starts), of.description());
    }
    if let Some(more) = found.attractors.get(TOLD..).filter(|more| !more.is_empty()) {
        say!("{} more: {} of the starts", more.len(), share(more.iter().map(|of| of.starts).sum()));
    }
    let [lost, passed] = found.without_attractor();
    if lost > 0 {
        say!(
            "{} of the starts have not settled on a motion that repeats within {MAX_PERIODS} cycles by cycle {}",
            share(lost),
            args.cycles
        );
    }
    if passed > 0 {
        say!("{} of the starts: the particle passes its soft wall (docs/WALLS.md)", share(passed));
    }
    if found.unresolved > 0 {
        warn!(
            "warning: {} of {all} motions have instants with too many events, which were not resolved",
            found.unresolved
        );
    }
    say!("Figure: {}", args.out.join("basins.svg").display());
    print_place(&format!("Table:  {} ({all} rows)", table.display()));
    Ok(())
}
