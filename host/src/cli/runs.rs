//! `damprig runs`: what has been run, one run in human form and as a page, whether it is sound, and in other formats.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args as ClapArgs, Subcommand};
use comfy_table::Table as Shown;
use comfy_table::presets::UTF8_FULL_CONDENSED;

use super::{Failure, Outcome};
use crate::input::near;
use crate::report::exports::atomic_file::{to_failure, write_new};
use crate::report::exports::csv::Csv;
use crate::report::exports::mat::Mat;
use crate::report::exports::uff::Uff;
use crate::report::exports::{Exporter, Part, Table};
use crate::report::page::page;
use crate::run_folder::read::columns::{Value, column, numbers, texts};
use crate::run_folder::read::folder::{below, find, is_run};
use crate::run_folder::read::verify::{Finding, verify};
use crate::run_folder::{ReadError, RunFolder};

/// Lists, shows, reports, verifies and exports run folders. Nothing in them is ever changed.
#[derive(Debug, ClapArgs)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Args {
    /// Folder that holds runs
    #[arg(value_name = "DIR", default_value = "runs")]
    dir: PathBuf,
    #[command(subcommand)]
    action: Option<Action>,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// A run in human form: device, signals, losses, results
    Show {
        /// Folder of the run, its name, or the short id at the end of it
        run: PathBuf,
    },
    /// Check a run: checksums, gaps, row counts, completeness (exit code 1 when something is wrong)
    Verify {
        /// Folder of the run, its name, or the short id at the end of it
        run: PathBuf,
    },
    /// Write the report page of a run: one file for the browser and the printer
    #[command(after_help = REPORT_HELP)]
    Report {
        /// Folder of the run, its name, or the short id at the end of it
        run: PathBuf,
        /// The new file [default: <run>.html here]
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
    },
    /// Write a run in another format: CSV, MATLAB, UFF/UNV
    #[command(after_help = EXPORT_HELP)]
    Export(Export),
}

const REPORT_HELP: &str = "\
A run folder has its report.html since the run ended; this makes the page again, of a run that was killed or of an older one,
say. Nothing in the run folder is changed.

Examples:
  damprig runs report k3x9                               writes <run>.html here
  damprig runs report runs/20261121-041624-hybrid-k3x9 --out foam-1.html

Exit code 1 also when a part of the run cannot be read: the page names it.";

const EXPORT_HELP: &str = "\
What the formats hold:
  csv  one table, samples unless --what says otherwise; of any length
  mat  structs run, results, samples and units; columns are double vectors (at most 40 million numbers)
  uff  dataset 58: x/z as a frequency response, and a time history per signal, point and stretch without gaps

Examples:
  damprig runs export k3x9 --format mat                  writes <run>.mat here
  damprig runs export k3x9 --format uff --what results   the frequency responses only
  damprig runs export k3x9 --format csv --set-up hybrid --from-s 10 --to-s 20 --out hybrid.csv

Parquet needs no export: samples.parquet and results.parquet are in the run folder.
Exit code 1 also when a part of a damaged run is not in the file; each such part is named.";

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    /// Comma-separated values, RFC 4180
    Csv,
    /// MATLAB, version 7
    Mat,
    /// Universal file (UNV), dataset 58: for modal-analysis software
    #[value(alias = "unv")]
    Uff,
}

impl Format {
    fn exporter(self) -> &'static dyn Exporter {
        match self {
            Self::Csv => &Csv,
            Self::Mat => &Mat,
            Self::Uff => &Uff,
        }
    }
}

#[derive(Debug, ClapArgs)]
struct Export {
    /// Folder of the run, its name, or the short id at the end of it
    run: PathBuf,
    /// The format
    #[arg(long, value_enum)]
    format: Format,
    /// Only this table [default: samples for csv, both for the others]
    #[arg(long, value_enum)]
    what: Option<Table>,
    /// Only this set-up
    #[arg(long, value_name = "NAME")]
    set_up: Option<String>,
    /// The new file [default: <run>.<format> here, with the table in the name when it is one]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Samples from this time of their experiment on, s
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    from_s: f64,
    /// Samples before this time of their experiment, s
    #[arg(long, value_name = "SECONDS", default_value_t = f64::INFINITY)]
    to_s: f64,
}

/// Runs the subcommand.
///
/// # Errors
/// No such run, something wrong with it, or a file that cannot be written.
pub fn run(args: &Args) -> Outcome {
    match &args.action {
        None => list(&args.dir),
        Some(Action::Show { run }) => show(&open(run)?),
        Some(Action::Verify { run }) => check(run),
        Some(Action::Report { run, out }) => report(&open(run)?, out.as_deref()),
        Some(Action::Export(export)) => self::export(export),
    }
}

fn input(error: ReadError) -> Failure {
    Failure::Input(error.0)
}

fn failed(error: ReadError) -> Failure {
    Failure::Failed(error.0)
}

fn open(wanted: &Path) -> Result<RunFolder, Failure> {
    RunFolder::open(&find(wanted).map_err(input)?).map_err(failed)
}

fn table(header: &[&str]) -> Shown {
    let mut table = Shown::new();
    table.load_style(UTF8_FULL_CONDENSED).set_header(header.to_vec());
    table
}

fn list(dir: &Path) -> Outcome {
    if !dir.is_dir() {
        return Err(Failure::Input(format!("there is no folder {}; give the one that holds the runs", dir.display())));
    }
    let folders = if is_run(dir) { vec![dir.to_path_buf()] } else { below(dir) };
    let mut runs: Vec<(PathBuf, Result<RunFolder, ReadError>)> =
        folders.into_iter().map(|path| (path.clone(), RunFolder::open(&path))).collect();
    // The latest first; those of which nobody can tell come last.
    runs.sort_by_key(|(_, run)| std::cmp::Reverse(run.as_ref().ok().and_then(|r| r.manifest().started_at())));
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
                    error.0.clone(),
                ]);
            }
        }
    }
    println!("{table}\n{} runs in {}", runs.len(), dir.display());
    Ok(())
}

fn show(run: &RunFolder) -> Outcome {
    let m = run.manifest();
    println!("Run {} (campaign {}), started {}", run.id(), m.campaign, m.started);
    println!("State: {}; {} of {} points; {}", m.ending_text(), m.points_taken, m.points_planned, m.damprig);
    if let Some(d) = &m.device {
        println!(
            "Rig {}: {} (firmware {}), tick {} Hz, schema {}",
            d.link, d.board, d.firmware, d.tick_hz, d.protocol_schema
        );
    }
    println!("{:.1} s of rig time in {:.2} s", m.clock.rig_s, m.clock.wall_s);
    let c = m.counters;
    println!(
        "Lost: {} rows of samples ({} dropped by the device, {} by the host, {} messages missing on the way); bad frames: host {}, device {}",
        c.lost_rows, c.dropped_records, c.dropped_rows_host, c.missing_records, c.bad_frames_host, c.bad_frames_device
    );
    if m.resumed > 0 || c.interruptions > 0 {
        println!("Taken up again {} times; the link or the device was lost {} times", m.resumed, c.interruptions);
    }
    if let Some(controller) = &m.controller {
        println!("Controller: {}", controller.line());
        controller.complaints().iter().for_each(|what| println!("Controller: {what}"));
    }
    let signals: Vec<String> = m.signals.iter().map(|s| format!("{} ({})", s.name, s.unit)).collect();
    println!("Signals: {} at {} Hz, {} rows", signals.join(", "), m.telemetry_rate_hz, m.sample_rows);
    let mut table = table(&["set-up", "experiment", "f (Hz)", "X/Z", "Z (mm)", "phase (rad)", "steady"]);
    for batch in run.results().map_err(failed)? {
        let names = (texts(&batch, "set_up").map_err(failed)?, texts(&batch, "experiment").map_err(failed)?);
        let get = |name| column(&batch, name).map_err(failed);
        let (f, xz, z) = (get("frequency_hz")?, get("x_over_z")?, get("z_amplitude_m")?);
        let (phase, steady) = (get("phase_rad")?, get("steady")?);
        let number =
            |v: &Value, scale: f64, digits: usize| format!("{:.digits$}", v.number().unwrap_or(f64::NAN) * scale);
        for i in 0..batch.num_rows() {
            table.add_row([
                names.0[i].clone(),
                names.1[i].clone(),
                f[i].to_string(),
                number(&xz[i], 1.0, 3),
                number(&z[i], 1e3, 4),
                number(&phase[i], 1.0, 3),
                if steady[i] == Value::Bool(true) { "yes" } else { "no" }.into(),
            ]);
        }
    }
    if table.row_count() > 0 {
        println!("{table}");
    }
    events(run)
}

/// Records, pulses and free vibrations.
fn events(run: &RunFolder) -> Outcome {
    let mut table = table(&["set-up", "experiment", "kind", "max|x| (mm)", "RMS x (mm)", "impacts", "ζ", "f (Hz)"]);
    for batch in run.transients().map_err(failed)? {
        let text = |name| texts(&batch, name).map_err(failed);
        let number = |name| numbers(&batch, name).map_err(failed);
        let (set_ups, experiments, kinds) = (text("set_up")?, text("experiment")?, text("kind")?);
        let (peak, rms, impacts) = (number("x_peak_m")?, number("x_rms_m")?, number("impacts")?);
        let (zeta, frequency) = (number("damping_ratio")?, number("frequency_hz")?);
        let shown = |value: f64, digits: usize| if value.is_nan() { "–".into() } else { format!("{value:.digits$}") };
        for i in 0..batch.num_rows() {
            table.add_row([
                set_ups[i].clone(),
                experiments[i].clone(),
                kinds[i].clone(),
                shown(1e3 * peak[i], 3),
                shown(1e3 * rms[i], 3),
                shown(impacts[i], 0),
                shown(zeta[i], 5),
                shown(frequency[i], 4),
            ]);
        }
    }
    if table.row_count() > 0 {
        println!("{table}");
    }
    Ok(())
}

fn check(wanted: &Path) -> Outcome {
    let found = verify(wanted).map_err(failed)?;
    let mut wrong = 0;
    for finding in &found {
        match finding {
            Finding::Good(text) => println!("good   {text}"),
            Finding::Wrong(text) => {
                wrong += 1;
                println!("WRONG  {text}");
            }
        }
    }
    if wrong == 0 {
        return Ok(());
    }
    Err(Failure::Failed(format!("{wrong} things are wrong with {}; nothing was changed", wanted.display())))
}

fn report(run: &RunFolder, out: Option<&Path>) -> Outcome {
    let out = out.map_or_else(|| PathBuf::from(format!("{}.html", run.id())), Path::to_path_buf);
    let page = page(run);
    write_new(&out, |file| file.write_all(page.html.as_bytes()).map_err(|e| to_failure(&out)(&e))).map_err(failed)?;
    println!("Report: {}", out.display());
    if page.unreadable.is_empty() {
        return Ok(());
    }
    let missing = page.unreadable.join("\n  not on the page: ");
    let rest = format!("a part of the run cannot be read; the rest is in {}", out.display());
    Err(Failure::Failed(format!("{rest}\n  not on the page: {missing}")))
}

fn export(args: &Export) -> Outcome {
    let run = open(&args.run)?;
    let names = run.set_up_names();
    if let Some(wanted) = args.set_up.as_ref().filter(|s| !names.contains(*s)) {
        let likely = near(wanted, names.iter().map(String::as_str));
        let likely = if likely.is_empty() { String::new() } else { format!("; did you mean {}?", likely.join(", ")) };
        let all: Vec<&str> = names.iter().map(String::as_str).collect();
        return Err(Failure::Input(format!("--set-up {wanted:?}: the run has {}{likely}", all.join(", "))));
    }
    // A NaN is refused too.
    if args.from_s.is_nan() || args.to_s.is_nan() || args.from_s >= args.to_s {
        let message = format!("--from-s {} must be less than --to-s {}", args.from_s, args.to_s);
        return Err(Failure::Input(message));
    }
    let exporter = args.format.exporter();
    let tables = args.what.map_or_else(|| exporter.usual_tables().to_vec(), |table| vec![table]);
    if let Some((table, why)) = tables.iter().find_map(|table| Some((table, exporter.cannot_hold(*table)?))) {
        let format = exporter.extension();
        return Err(Failure::Input(format!("--format {format} --what {}: {why}", table.word())));
    }
    let out = args.out.clone().unwrap_or_else(|| {
        let one = if args.what.is_some() || exporter.holds_one_table() { tables.first() } else { None };
        let word = one.map_or(String::new(), |table| format!("-{}", table.word()));
        PathBuf::from(format!("{}{word}.{}", run.id(), exporter.extension()))
    });
    let words: Vec<&str> = tables.iter().map(|t| t.word()).collect();
    let part = Part { tables, set_up: args.set_up.clone(), from_s: args.from_s, to_s: args.to_s };
    let exported = exporter.export(&run, &part, &out).map_err(failed)?;
    println!("{} rows of {} in {}", exported.rows, words.join(" and "), out.display());
    exported.notes.iter().for_each(|note| println!("{note}"));
    if !run.manifest().is_complete() {
        println!("the run is not complete ({}); what there is of it was taken", run.manifest().ending_text());
    }
    if exported.missing.is_empty() {
        return Ok(());
    }
    let missing = exported.missing.join("\n  not in the file: ");
    let rest = format!("a part of the run cannot be read; the rest is in {}", out.display());
    Err(Failure::Failed(format!("{rest}\n  not in the file: {missing}")))
}
