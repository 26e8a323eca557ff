//! `damprig runs`: lists, shows, verifies, reports and exports run folders.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::{Args, Subcommand};
use serde_json::{Value, json};

use super::arguments::{ForceArg, JsonArg};
use super::progress::bar;
use crate::failure::{Failure, Outcome};
use crate::input::{near, shown_in_line};
use crate::report::exports::csv::Csv;
use crate::report::exports::hdf5::Hdf5;
use crate::report::exports::mat::Mat;
use crate::report::exports::uff::Uff;
use crate::report::exports::{ExportSelection, ExportSummary, Exporter, RunTable};
use crate::report::page::{page, page_of_runs};
use crate::report::terminal::campaign::unresolved_peaks;
use crate::report::terminal::plain_table as table;
use crate::run_folder::RunFolder;
use crate::run_folder::read::campaign_copy;
use crate::run_folder::read::folder::{below, find, is_run};
use crate::run_folder::read::verify::{Finding, verify};
use crate::run_folder::schema::results::steadiness_text;
use crate::storage::out_file::{OutFile, to_failure, write_new};

/// Lists, shows, verifies, reports and exports run folders. Never changes a run folder.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct RunsArgs {
    /// Folder with run folders
    #[arg(value_name = "FOLDER", default_value = "runs")]
    dir: PathBuf,
    #[command(flatten)]
    json: JsonArg,
    #[command(subcommand)]
    action: Option<RunsAction>,
}

#[derive(Debug, Subcommand)]
enum RunsAction {
    /// Show a run: rig, signals, losses, results
    Show {
        /// Run folder, its name, or the short id at the end of the name
        run: PathBuf,
        #[command(flatten)]
        json: JsonArg,
    },
    /// Verify a run: checksums, gaps, row counts, completeness (exit code 1 if a check fails)
    Verify {
        /// Run folder, its name, or the short id at the end of the name
        run: PathBuf,
        #[command(flatten)]
        json: JsonArg,
    },
    /// Write the report page of one or several runs: one HTML file
    #[command(after_help = REPORT_HELP)]
    Report {
        /// Run folders, their names, or the short ids at the end of the names
        #[arg(required = true, value_name = "RUN")]
        runs: Vec<PathBuf>,
        /// New file [default: <run>.html in the current folder; runs.html for several]
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
        #[command(flatten)]
        force: ForceArg,
    },
    /// Export a run to CSV, MATLAB, HDF5 or UFF/UNV
    #[command(after_help = EXPORT_HELP)]
    Export(Export),
}

const REPORT_HELP: &str = "\
Every finished run has report.html in its folder. This command makes the page again, for example
of a run that was killed or of an older run.

Examples:
  damprig runs report k3x9                               writes <run>.html
  damprig runs report runs/20261121-041624-hybrid-k3x9 --out foam-1.html
  damprig runs report k3x9 p07m --out walls.html         two runs, their responses in one figure

The exit code is 1 if a part of the run cannot be read; the page names it.";

const EXPORT_HELP: &str = "\
Formats:
  csv  one table (samples unless --what selects another), any length
  mat  structs run, results, samples, impacts, units; double column vectors; at most 2 GiB per table
  h5   HDF5: a group per table, a dataset per column with its unit; any length
  uff  dataset 58: frequency responses x/z (lock-in); a time history per signal, point and gap-free stretch

Examples:
  damprig runs export k3x9 --format mat                  writes <run>.mat
  damprig runs export k3x9 --format csv --what impacts   one row per impact
  damprig runs export k3x9 --format uff --what results   frequency responses only
  damprig runs export k3x9 --format csv --set-up hybrid --from-s 10 --to-s 20 --out hybrid.csv

For Parquet use samples.parquet and results.parquet in the run folder.
The exit code is 1 if a part of a damaged run is missing in the export; each missing part is named.";

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum RunsFormat {
    /// Comma-separated values, RFC 4180
    Csv,
    /// MATLAB, version 7
    Mat,
    /// HDF5: for h5py, Julia, MATLAB's h5read
    #[value(alias = "hdf5")]
    H5,
    /// Universal file (UNV), dataset 58: for modal-analysis software
    #[value(alias = "unv")]
    Uff,
}

impl RunsFormat {
    fn exporter(self) -> &'static dyn Exporter {
        match self {
            Self::Csv => &Csv,
            Self::Mat => &Mat,
            Self::H5 => &Hdf5,
            Self::Uff => &Uff,
        }
    }
}

#[derive(Debug, Args)]
struct Export {
    /// Run folder, its name, or the short id at the end of the name
    run: PathBuf,
    /// Format of the file
    #[arg(long, value_enum)]
    format: RunsFormat,
    /// Export only this table [default: csv samples; uff results and samples; mat and h5 all]
    #[arg(long, value_enum)]
    what: Option<RunTable>,
    /// Export only this set-up
    #[arg(long, value_name = "NAME")]
    set_up: Option<String>,
    /// New file [default: <run>.<format> in the current folder; <run>-<table>.<format> for a single table]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: ForceArg,
    /// Export samples and impacts from this time of their experiment, s
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    from_s: f64,
    /// Export samples and impacts before this time of their experiment, s
    #[arg(long, value_name = "SECONDS", default_value_t = f64::INFINITY)]
    to_s: f64,
}

/// Runs the subcommand.
///
/// # Errors
/// No such run, a damaged run, or a file that cannot be written.
pub fn run(args: &RunsArgs) -> Outcome {
    match &args.action {
        None => list(&args.dir, args.json),
        Some(RunsAction::Show { run, json }) if json.is_given() => show_json(&open(run)?),
        Some(RunsAction::Show { run, .. }) => show(&open(run)?),
        Some(RunsAction::Verify { run, json }) => check(run, *json),
        Some(RunsAction::Report { runs, out, force }) => {
            let runs: Vec<RunFolder> = runs.iter().map(|run| open(run)).collect::<Result<_, _>>()?;
            if let Some(twice) =
                runs.iter().enumerate().find(|(n, run)| runs[..*n].iter().any(|r| r.path() == run.path()))
            {
                return Err(Failure::Input(format!("run {} is given twice", twice.1.id())));
            }
            report(&runs, out.as_deref(), *force)
        }
        Some(RunsAction::Export(export)) => self::export(export),
    }
}

fn open(wanted: &Path) -> Result<RunFolder, Failure> {
    RunFolder::open(&find(wanted)?)
}

fn list(dir: &Path, json: JsonArg) -> Outcome {
    if !dir.is_dir() {
        return Err(Failure::Input(format!(
            "there is no folder {}; give the folder with the run folders",
            dir.display()
        )));
    }
    let folders = if is_run(dir) { vec![dir.to_path_buf()] } else { below(dir) };
    let mut runs: Vec<(PathBuf, Result<RunFolder, Failure>)> =
        folders.into_iter().map(|path| (path.clone(), RunFolder::open(&path))).collect();
    // Latest first; runs without a readable start last.
    runs.sort_by_key(|(_, run)| std::cmp::Reverse(run.as_ref().ok().and_then(|r| r.manifest().started_at())));
    if json.is_given() {
        say!("{}", runs.iter().map(|(path, run)| listed(path, run)).collect::<Value>());
        return Ok(());
    }
    let mut table = table(&["run", "campaign", "started", "rig", "set-ups", "points", "state", "size (MB)"]);
    for (path, run) in &runs {
        let name = path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned());
        match run {
            Ok(run) => {
                let m = run.manifest();
                table.add_row([
                    name,
                    m.campaign.clone(),
                    m.started.chars().take(19).collect(),
                    m.device.as_ref().map_or("–".into(), |d| d.link.clone()),
                    m.set_ups.len().to_string(),
                    format!("{}/{}", m.points_taken, m.points_planned),
                    m.ending_text(),
                    format!("{:.2}", run.bytes() as f64 / 1e6),
                ]);
            }
            Err(error) => {
                table.add_row([
                    name,
                    String::new(),
                    String::new(),
                    String::new(),
                    String::new(),
                    String::new(),
                    error.to_string(),
                ]);
            }
        }
    }
    say!("{table}\n{} runs in {}", runs.len(), dir.display());
    Ok(())
}

/// A run of the list, for programs; of one that cannot be read, `error` says why.
fn listed(path: &Path, run: &Result<RunFolder, Failure>) -> Value {
    let run = match run {
        Ok(run) => run,
        Err(error) => return json!({ "folder": path.display().to_string(), "error": error.to_string() }),
    };
    let m = run.manifest();
    json!({
        "folder": path.display().to_string(),
        "campaign": m.campaign,
        "started": m.started,
        "rig": m.device.as_ref().map(|device| &device.link),
        "set_ups": m.set_ups.len(),
        "points_taken": m.points_taken,
        "points_planned": m.points_planned,
        "state": m.ending_text(),
        "bytes": run.bytes(),
    })
}

/// Prints the manifest and the results for programs.
fn show_json(run: &RunFolder) -> Outcome {
    let results = run.result_rows()?;
    let transients = run.transient_rows()?;
    let all = json!({
        "folder": run.path().display().to_string(),
        "state": run.manifest().ending_text(),
        "manifest": run.manifest(),
        "results": results,
        "transients": transients,
    });
    say!("{all}");
    Ok(())
}

fn show(run: &RunFolder) -> Outcome {
    let m = run.manifest();
    say!("Run {} (campaign {}), started {}", run.id(), m.campaign, m.started);
    say!("State: {}; {} of {} points; {}", m.ending_text(), m.points_taken, m.points_planned, m.damprig);
    m.plan.texts().for_each(|(name, text)| say!("{name}: {}", shown_in_line(text)));
    m.plan.order_seed.iter().for_each(|seed| say!("random order, seed {seed}"));
    if let Some(d) = &m.device {
        say!(
            "Rig {}: {} (firmware {}), tick {} Hz, schema {}",
            d.link,
            d.board,
            d.firmware,
            d.tick_hz,
            d.protocol_schema
        );
    }
    if m.is_running() {
        say!("{:.1} s of rig time up to the last point", m.clock.rig_s);
    } else {
        say!("{:.1} s of rig time in {:.2} s", m.clock.rig_s, m.clock.wall_s);
    }
    let c = m.counters;
    say!(
        "Lost: {} rows of samples ({} dropped by the device, {} by the host, {} messages lost on the link); bad frames: host {}, device {}",
        c.lost_rows,
        c.dropped_records,
        c.dropped_rows_host,
        c.missing_records,
        c.bad_frames_host,
        c.bad_frames_device
    );
    if m.resumed > 0 || c.interruptions > 0 {
        say!("Resumed {} times; the link or the device was lost {} times", m.resumed, c.interruptions);
    }
    if let Some(controller) = &m.controller {
        say!("Controller: {}", controller.line());
        controller.complaints().iter().for_each(|what| say!("Controller: {what}"));
    }
    let signals: Vec<String> = m.signals.iter().map(|s| format!("{} ({})", s.name, s.unit)).collect();
    say!("Signals: {} at {} Hz, {} rows", signals.join(", "), m.telemetry_rate_hz, m.sample_rows);
    let mut table = table(&[
        "set-up",
        "experiment",
        "f (Hz)",
        "X/Z\n(cycle maxima)",
        "X/Z\n(lock-in)",
        "Z (mm)",
        "phase (rad)",
        "steadiness",
    ]);
    let rows = run.result_rows()?;
    for row in &rows {
        table.add_row([
            row.set_up.clone(),
            row.experiment.clone(),
            row.frequency_hz.to_string(),
            format!("{:.3}", row.x_over_z()),
            format!("{:.3}", row.x_over_z_lock_in()),
            format!("{:.4}", f64::from(row.z_amplitude_m) * 1e3),
            format!("{:.3}", f64::from(row.phase_rad)),
            steadiness_text(row.steadiness).into(),
        ]);
    }
    if table.row_count() > 0 {
        say!("{table}");
    }
    // A campaign that cannot be read is a matter of `runs verify`.
    if let Ok(campaign) = campaign_copy::campaign(run.path()) {
        unresolved_peaks(&campaign, &rows).iter().for_each(|note| say!("{note}"));
    }
    show_transients(run)
}

/// Prints the table of playbacks, impulses and free vibrations.
fn show_transients(run: &RunFolder) -> Outcome {
    let mut table =
        table(&["set-up", "experiment", "kind", "largest |x|\n(mm)", "RMS of x\n(mm)", "impacts", "ζ", "f (Hz)"]);
    let shown = |value: f64, digits: usize| if value.is_nan() { "–".into() } else { format!("{value:.digits$}") };
    for row in run.transient_rows()? {
        table.add_row([
            row.set_up,
            row.experiment,
            row.kind,
            shown(1e3 * f64::from(row.max_abs_x_m), 3),
            shown(1e3 * f64::from(row.rms_x_m), 3),
            row.impacts.to_string(),
            shown(row.damping_ratio, 5),
            shown(row.frequency_hz, 4),
        ]);
    }
    if table.row_count() > 0 {
        say!("{table}");
    }
    Ok(())
}

fn check(wanted: &Path, json: JsonArg) -> Outcome {
    let folder = find(wanted)?;
    let found = verify(&folder)?;
    let checks = found.iter().map(|finding| match finding {
        Finding::Good(text) => (true, text),
        Finding::Wrong(text) => (false, text),
    });
    if json.is_given() {
        let checks: Value = checks.clone().map(|(is_good, what)| json!({ "is_good": is_good, "what": what })).collect();
        say!("{}", json!({ "folder": folder.display().to_string(), "checks": checks }));
    } else {
        checks.clone().for_each(|(is_good, what)| say!("{}  {what}", if is_good { "ok    " } else { "FAILED" }));
    }
    let failed = checks.filter(|(is_good, _)| !is_good).count();
    if failed == 0 {
        return Ok(());
    }
    Err(Failure::Failed(format!("{failed} checks of {} failed; nothing was changed", wanted.display())))
}

fn report(runs: &[RunFolder], out: Option<&Path>, force: ForceArg) -> Outcome {
    let name = if let [run] = runs { run.id() } else { "runs".into() };
    let out = out.map_or_else(|| PathBuf::from(format!("{name}.html")), Path::to_path_buf);
    force.check(&out)?;
    let page = if let [run] = runs { page(run) } else { page_of_runs(runs) };
    write_new(&force.file(&out), |file| file.write_all(page.html.as_bytes()).map_err(|e| to_failure(&out)(&e)))?;
    say!("Report: {}", out.display());
    if page.unreadable.is_empty() {
        return Ok(());
    }
    let missing = page.unreadable.join("\n  not on the page: ");
    let rest = format!("a part of the run cannot be read; the rest is in {}", out.display());
    Err(Failure::Failed(format!("{rest}\n  not on the page: {missing}")))
}

/// Exports with a bar over the samples that are read.
fn exported_with_a_bar(
    exporter: &dyn Exporter,
    run: &RunFolder,
    selection: &ExportSelection,
    file: &OutFile,
) -> Result<ExportSummary, Failure> {
    if !selection.tables.contains(&RunTable::Samples) {
        return exporter.export(run, selection, file);
    }
    let bar = bar(run.manifest().sample_rows);
    bar.set_message("samples");
    let exported = std::thread::scope(|scope| {
        let work = scope.spawn(|| exporter.export(run, selection, file));
        while !work.is_finished() {
            bar.set_position(selection.samples_read.load(Ordering::Relaxed));
            std::thread::sleep(Duration::from_millis(20));
        }
        work.join()
    });
    bar.finish_and_clear();
    exported.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

fn export(args: &Export) -> Outcome {
    let run = open(&args.run)?;
    let set_ups = run.set_up_names();
    if let Some(wanted) = args.set_up.as_ref().filter(|s| !set_ups.contains(*s)) {
        let likely = near(wanted, set_ups.iter().map(String::as_str));
        let likely = if likely.is_empty() { String::new() } else { format!("; did you mean {}?", likely.join(", ")) };
        let all: Vec<&str> = set_ups.iter().map(String::as_str).collect();
        return Err(Failure::Input(format!("--set-up {wanted:?}: the run has {}{likely}", all.join(", "))));
    }
    // Rejects NaN too.
    if args.from_s.is_nan() || args.to_s.is_nan() || args.from_s >= args.to_s {
        let message = format!("--from-s {} must be less than --to-s {}", args.from_s, args.to_s);
        return Err(Failure::Input(message));
    }
    let exporter = args.format.exporter();
    let usual = || exporter.usual_tables().iter().copied().filter(|table| table.is_usual(&run)).collect();
    let tables: Vec<RunTable> = args.what.map_or_else(usual, |table| vec![table]);
    if let Some((table, why)) = tables.iter().find_map(|table| Some((table, exporter.cannot_hold(*table)?))) {
        let format = exporter.extension();
        return Err(Failure::Input(format!("--format {format} --what {}: {why}", table.name())));
    }
    let out = args.out.clone().unwrap_or_else(|| {
        let one = if args.what.is_some() || exporter.holds_one_table() { tables.first() } else { None };
        let name = one.map_or(String::new(), |table| format!("-{}", table.name()));
        PathBuf::from(format!("{}{name}.{}", run.id(), exporter.extension()))
    });
    args.force.check(&out)?;
    let names: Vec<&str> = tables.iter().map(|t| t.name()).collect();
    let (set_up, samples_read) = (args.set_up.clone(), Arc::default());
    let selection = ExportSelection { tables, set_up, from_s: args.from_s, to_s: args.to_s, samples_read };
    let exported = exported_with_a_bar(exporter, &run, &selection, &args.force.file(&out))?;
    say!("{} rows of {} in {}", exported.rows, names.join(" and "), out.display());
    exported.notes.iter().for_each(|note| say!("{note}"));
    if !run.manifest().is_complete() {
        say!("the run is not complete ({}); the export has what was recorded", run.manifest().ending_text());
    }
    if exported.missing.is_empty() {
        return Ok(());
    }
    let missing = exported.missing.join("\n  not in the file: ");
    let rest = if run.manifest().is_recording == Some(true) {
        format!("the run went on while it was exported to {}; export it again, best when it has ended", out.display())
    } else {
        format!("a part of the run cannot be read; the rest is in {}", out.display())
    };
    Err(Failure::Failed(format!("{rest}\n  not in the file: {missing}")))
}
