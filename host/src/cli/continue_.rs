//! `damprig continue`: follows periodic orbits of a case over a parameter.

use std::path::{Path, PathBuf};

use clap::Args;

use super::arguments::{ForceArg, JsonArg};
use super::ctrl_c::CtrlC;
use super::examples;
use super::progress::spinner;
use super::simulate::picture;
use crate::continuation::{Continuation, FoundBranches};
use crate::failure::{Failure, Outcome};
use crate::file_keys::FileKind;
use crate::optimise::table::check_folder;
use crate::report::branch_table;
use crate::report::figures::{branches, curves};
use crate::report::numbers::significant;
use crate::report::terminal;
use crate::storage::create_folder;
use crate::storage::out_file::OutFile;

/// Follows periodic orbits of a case over a parameter, stable or not, and locates folds, period doublings, Neimark-Sacker points and
/// grazings.
///
/// docs/CONTINUE.md describes the file, the method, its errors and limits.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct ContinueArgs {
    /// Continuation file (TOML), or the name of a shipped one (`damprig examples`)
    #[arg(value_name = "FILE")]
    file: PathBuf,

    #[command(flatten)]
    json: JsonArg,

    /// Write the orbits to a file (.csv or .parquet), or orbits, curves and their figures to a new folder
    #[arg(long, value_name = "PLACE", value_parser = branch_table::place)]
    out: Option<PathBuf>,

    /// Draw the largest |x| over the parameter to FILE (.svg or .png)
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    /// Draw the curves in both parameters of a file with [second] to FILE (.svg or .png)
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot_curves: Option<PathBuf>,

    #[command(flatten)]
    force: ForceArg,
}

const AFTER_HELP: &str = "\
Examples:
  damprig continue clearance
  damprig continue clearance --plot branches.svg --out branches.csv
  damprig continue clearance --json
  damprig continue grazing-curve --out curves

A folder gets orbits.parquet, orbits.csv and branches.svg, .png; of a file with [second] also curves.parquet, curves.csv and
curves.svg, .png.

Exit codes:
  0    success
  1    a file could not be written
  2    the command line or a file is wrong, or there is no periodic orbit to start from; nothing was written";

/// Runs the subcommand.
///
/// # Errors
/// Bad input, no orbit to start from, an unwritable file.
pub fn run(args: &ContinueArgs) -> Outcome {
    let input = examples::find(FileKind::Continuation, &args.file)?;
    let continuation = Continuation::read(&input)?;
    if args.plot_curves.is_some() && continuation.keys().1.is_none() {
        let file = input.display();
        return Err(Failure::Input(format!(
            "--plot-curves: {file} has one parameter\n  add a table [second] to it; nothing was computed"
        )));
    }
    let folder = args.out.as_deref().filter(|path| path.extension().is_none());
    if let Some(folder) = folder.filter(|_| !args.force.is_given()) {
        check_folder(folder)?;
    }
    let table = args.out.clone().filter(|_| folder.is_none());
    let outputs = [("--out", &table), ("--plot", &args.plot), ("--plot-curves", &args.plot_curves)];
    for (role, file) in outputs {
        if let Some(file) = file {
            args.force.check(file)?;
        }
        let same = |read: &PathBuf| file.as_ref().is_some_and(|f| f.canonicalize().ok() == read.canonicalize().ok());
        if file.as_ref().is_some_and(|f| f.exists()) && (same(&input) || same(&continuation.case_file)) {
            return Err(Failure::Input(format!(
                "{role} would overwrite an input file\n  give another file name; nothing was written"
            )));
        }
    }
    let (ctrl_c, spinner) = (CtrlC::watch()?, spinner());
    let found = continuation.follow(&|value| {
        spinner.set_message(format!("{} = {}", continuation.keys().0, significant(value, 6)));
        !ctrl_c.is_pressed()
    });
    spinner.finish_and_clear();
    let found = found.map_err(|failure| match failure {
        Failure::Interrupted(_) => Failure::Interrupted("interrupted; nothing was written".into()),
        other => other,
    })?;
    args.json.print(&found)?;
    say!("{}", terminal::continuation::text(&found));
    if let Some(path) = &table {
        let rows = branch_table::write(&branch_table::orbits(&found)?, &args.force.file(path))?;
        say!("Table: {} ({rows} orbits)", path.display());
    }
    let branches = args.plot.as_ref().map(|path| (path, branches::draw(&found)));
    let curves = args.plot_curves.as_ref().map(|path| (path, curves::draw(&found)));
    for (path, picture) in branches.into_iter().chain(curves) {
        picture.and_then(|picture| picture.save(path))?;
        say!("Figure: {}", path.display());
    }
    if let Some(folder) = folder {
        write_all(&found, folder)?;
        say!("Written to {}", folder.display());
    }
    Ok(())
}

/// Writes all tables and figures to a folder.
fn write_all(found: &FoundBranches, folder: &Path) -> Outcome {
    create_folder(folder)?;
    let has_curves = found.second_parameter.is_some();
    for extension in ["parquet", "csv"] {
        let file = |stem: &str| OutFile { path: folder.join(format!("{stem}.{extension}")), force: true };
        branch_table::write(&branch_table::orbits(found)?, &file("orbits"))?;
        if has_curves {
            branch_table::write(&branch_table::curves(found)?, &file("curves"))?;
        }
    }
    branches::draw(found)?.write(folder, "branches")?;
    if has_curves {
        curves::draw(found)?.write(folder, "curves")?;
    }
    Ok(())
}
