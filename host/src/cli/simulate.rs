//! `damprig simulate`: a case, from the file to the figures, the history and the picture.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args as ClapArgs;
use serde::Serialize;

use super::progress::Bar;
use super::{Failure, Outcome};
use crate::motion_record::Quantity;
use crate::report::figures::simulated_motion::COLUMNS;
use crate::report::terminal::simulation as report;
use crate::simulation::analysis::Analysis;
use crate::simulation::envelope::Outline;
use crate::simulation::time_history::{History, TablePath};
use crate::simulation::{Answer, Case, Request, cost, simulate};

/// Simulates a case exactly: every impact, stick and slip at its instant.
#[derive(Debug, ClapArgs)]
#[command(after_help = AFTER_HELP)]
pub struct Args {
    /// Case file (TOML or JSON); host/cases shows what can be said
    #[arg(value_name = "CASE")]
    case: PathBuf,

    /// Print the whole answer as one JSON object
    #[arg(long)]
    json: bool,

    /// Also say where the energy went, what the motion settles on and whether that is stable
    #[arg(long)]
    analyse: bool,

    /// Write the time history to FILE.parquet or FILE.csv, and impacts and accumulations to FILE.impacts.… and
    /// FILE.accumulations.… beside it
    #[arg(long, value_name = "FILE")]
    out: Option<TablePath>,

    /// Rows a second in the history [default: 200 per period of base or structure, whichever is shorter; a record's own]
    #[arg(long, value_name = "HZ", requires = "out", value_parser = positive)]
    rate: Option<f64>,

    /// Draw displacements, walls and impacts to FILE.svg or FILE.png
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    /// Start of the drawn time [default: 0, and the last ten cycles once more when the run is long]
    #[arg(long, value_name = "SECONDS", requires = "plot", value_parser = not_negative)]
    plot_from: Option<f64>,

    /// End of the drawn time [default: the end]
    #[arg(long, value_name = "SECONDS", requires = "plot", value_parser = positive)]
    plot_to: Option<f64>,
}

const AFTER_HELP: &str = "\
Examples:
  damprig simulate host/cases/spid.toml
  damprig simulate host/cases/spid.toml --plot spid.png
  damprig simulate host/cases/soft-wall.toml --out soft.parquet --rate 1000
  damprig simulate host/cases/record.toml --json
  damprig simulate host/cases/spid.toml --analyse

The first Ctrl-C ends the run where it is: files and figures up to there are complete. A second ends the program at once.

Exit codes:
  0    done
  1    a file could not be written
  2    the command line or the case is wrong; nothing was written
  130  interrupted (Ctrl-C); what was done is kept";

/// The answer, and the analysis under its own key where it was asked for.
#[derive(Serialize)]
struct WithAnalysis<'a> {
    #[serde(flatten)]
    answer: &'a Answer,
    #[serde(skip_serializing_if = "Option::is_none")]
    analysis: Option<Analysis>,
}

/// Rows of a history in a period, unless a rate is given.
const ROWS_A_PERIOD: f64 = 200.0;

/// Cycles from which on a picture shows the last ones by themselves.
const LONG_CYCLES: f64 = 30.0;

/// How many of them.
const LAST_CYCLES: f64 = 10.0;

fn number(text: &str, ok: impl Fn(f64) -> bool, allowed: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && ok(value) => Ok(value),
        _ => Err(format!("must be a number {allowed}")),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    number(text, |v| v > 0.0, "greater than 0")
}

fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |v| v >= 0.0, "0 or greater")
}

fn picture(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).as_deref() {
        Some("svg" | "png") => Ok(path),
        Some(other) => Err(format!("the extension .{other} is none of those allowed: .svg, .png")),
        None => Err("the file needs an extension: .svg or .png".into()),
    }
}

/// Runs the subcommand.
///
/// # Errors
/// Bad input, an unwritable file or an interrupted run.
pub fn run(args: &Args) -> Outcome {
    let input = |e: &dyn std::fmt::Display| Failure::Input(e.to_string());
    let failed = |e: &dyn std::fmt::Display| Failure::Failed(e.to_string());
    let case = Case::read(&args.case).map_err(|e| input(&e))?;
    super::output_paths::check(&args.case, &case, args.out.as_ref(), args.plot.as_deref())?;
    let rate_hz = args.out.as_ref().map(|_| args.rate.unwrap_or_else(|| usual_rate_hz(&case)));
    let outlines = outlines(args, &case)?;
    let cost = cost::estimate(&case).map_err(|e| input(&e))?;
    let longest_part_s = cost::longest_part_s(&case, rate_hz).map_err(|e| input(&e))?;
    let stop = Arc::new(AtomicBool::new(false));
    super::watch_for_ctrl_c(&stop)?;
    for warning in report::warnings(&case, &cost, args.out.as_ref().zip(rate_hz)) {
        eprintln!("warning: {warning}");
    }
    let mut history = match (&args.out, rate_hz) {
        (Some(path), Some(rate_hz)) => {
            Some(History::create(path, rate_hz, case.set_up.particle.is_some()).map_err(|e| failed(&e))?)
        }
        _ => None,
    };
    let mut seen = (&mut history, outlines);
    let mut bar = Bar::new(&case.name, case.run.duration_s);
    let mut go_on = |t_s: f64| {
        bar.reach(t_s);
        !stop.load(Ordering::Relaxed)
    };
    let request = Request { keep: args.json, longest_part_s, go_on: &mut go_on };
    let answer = simulate(&case, &mut seen, request).map_err(|e| input(&e));
    bar.end();
    let answer = answer?;
    let (whole, last) = seen.1;
    let rows = history.as_ref().map(History::rows);
    let written = history.map_or(Ok(()), History::finish);
    let drawn =
        args.plot.as_ref().map_or(Ok(()), |path| report::figure(&case, whole.as_ref(), last.as_ref())?.save(path));
    let analysis = if args.analyse && answer.stopped_at_s.is_none() { Analysis::of(&case) } else { None };
    if args.analyse && case.record.is_some() {
        eprintln!("warning: --analyse needs an excitation in closed form; this case plays a record");
    }
    if args.json {
        if answer.summary.impact_count > answer.impacts.len() as u64 {
            let (kept, all) = (answer.impacts.len(), answer.summary.impact_count);
            eprintln!("warning: the answer has the first {kept} of {all} impacts; --out writes them all");
        }
        let both = WithAnalysis { answer: &answer, analysis };
        println!("{}", serde_json::to_string(&both).map_err(|e| failed(&e))?);
    } else {
        println!("{}", report::summary(&case, &answer));
        if let Some(analysis) = &analysis {
            println!("\n{}", crate::report::terminal::analysis::text(analysis));
        }
    }
    written.map_err(|e| failed(&e))?;
    drawn.map_err(|e| failed(&e))?;
    if !args.json {
        if let (Some(path), Some(rows), Some(rate_hz)) = (&args.out, rows, rate_hz) {
            println!("History: {} ({rows} rows at {} Hz)", path.path().display(), report::digits(rate_hz, 6));
        }
        if let Some(path) = &args.plot {
            println!("Picture: {}", path.display());
        }
    }
    match answer.stopped_at_s {
        Some(t_s) => Err(Failure::Interrupted(format!(
            "interrupted at {} s of {} s; what was done up to there is kept",
            report::digits(t_s, 9),
            report::digits(case.run.duration_s, 9)
        ))),
        None => Ok(()),
    }
}

fn usual_rate_hz(case: &Case) -> f64 {
    match &case.record {
        Some(record) => (1.0 / record.step_s).max(ROWS_A_PERIOD / case.natural_period_s()),
        None => ROWS_A_PERIOD / case.cycle_s().min(case.natural_period_s()),
    }
}

/// The windows that will be drawn: the one asked for, or the whole run and its last cycles.
fn outlines(args: &Args, case: &Case) -> Result<(Option<Outline>, Option<Outline>), Failure> {
    if args.plot.is_none() {
        return Ok((None, None));
    }
    let duration_s = case.run.duration_s;
    let (from_s, to_s) = (args.plot_from.unwrap_or(0.0), args.plot_to.unwrap_or(duration_s).min(duration_s));
    if from_s >= to_s {
        return Err(Failure::Input(format!(
            "--plot-from {from_s} s is not before the end of the drawn time, {to_s} s (the run lasts {duration_s} s)"
        )));
    }
    // The base of an uncorrected acceleration drifts out of every picture.
    let drifts = case.record.as_ref().is_some_and(|r| r.quantity == Quantity::Acceleration);
    let outline = |from_s: f64, to_s: f64| {
        let outline = Outline::new(from_s, to_s, COLUMNS);
        if drifts { outline.relative_to_base() } else { outline }
    };
    let is_asked_for = args.plot_from.is_some() || args.plot_to.is_some();
    let is_long = !is_asked_for && !drifts && duration_s > LONG_CYCLES * case.cycle_s();
    let last = is_long.then(|| outline(duration_s - LAST_CYCLES * case.cycle_s(), duration_s));
    Ok((Some(outline(from_s, to_s)), last))
}
