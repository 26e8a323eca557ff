//! `damprig simulate`: simulates a case and writes its summary, time history and figure.

use std::path::{Path, PathBuf};

use clap::Args;
use damprig_core::integrator::exact::Observer;

use super::arguments::{ForceArg, JsonArg, SetArg, not_negative, positive};
use super::ctrl_c::CtrlC;
use super::examples;
use super::output::print_json;
use super::progress::SimulationBar;
use crate::failure::{Failure, Outcome};
use crate::file_keys::FileKind;
use crate::input::Source;
use crate::report::case_files::{CaseAsSimulated, SimulationJson};
use crate::report::figures::animation;
use crate::report::figures::simulated_motion::{self, COLUMNS, envelope, usual_envelopes};
use crate::report::numbers::significant;
use crate::report::terminal;
use crate::simulation::analysis::{Analysis, WrittenCase};
use crate::simulation::envelope::Envelope;
use crate::simulation::frames::Frames;
use crate::simulation::time_history::{TablePath, TimeHistory};
use crate::simulation::{Case, RunOptions, SetValues, cost, simulate};

/// Simulates cases exactly: locates every impact, stick and slip.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct SimulateArgs {
    /// Case files (TOML or JSON), or names of shipped ones (`damprig examples`)
    #[arg(value_name = "CASE", required = true)]
    cases: Vec<PathBuf>,

    #[command(flatten)]
    set: SetArg,

    #[command(flatten)]
    json: JsonArg,

    /// Also print the energy balance, the steady state, the periodic orbit, its Floquet multipliers and how its largest |x|, RMS and impact
    /// speed follow each quantity; of a motion that is not periodic the Lyapunov exponent; without an orbit how the run follows each number of its
    /// case
    #[arg(long)]
    analyse: bool,

    /// Write the time history to FILE (.parquet, .csv or .mat), impacts and accumulations to FILE.impacts.… and FILE.accumulations.…
    #[arg(long, value_name = "FILE")]
    out: Option<TablePath>,

    /// Rows per second of the time history [default: 200 per drive or natural period, whichever is shorter; with a record at
    /// least its sample rate]
    #[arg(long, value_name = "HZ", requires = "out", value_parser = positive)]
    rate: Option<f64>,

    /// Draw displacements, walls and impacts to FILE (.svg or .png)
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    /// Draw the motion itself to FILE (.svg), which a browser plays: the last six cycles under a sine, else the first six
    #[arg(long, value_name = "FILE", value_parser = animation)]
    animate: Option<PathBuf>,

    #[command(flatten)]
    force: ForceArg,

    /// Start of the drawn time [default: 0; a long run also shows its last ten cycles]
    #[arg(long, value_name = "SECONDS", requires = "plot", value_parser = not_negative)]
    plot_from: Option<f64>,

    /// End of the drawn time [default: end of the run]
    #[arg(long, value_name = "SECONDS", requires = "plot", value_parser = positive)]
    plot_to: Option<f64>,
}

const AFTER_HELP: &str = "\
Examples:
  damprig simulate spid
  damprig simulate spid --plot spid.png
  damprig simulate frame --animate frame.svg
  damprig simulate soft-wall --out soft.parquet --rate 1000
  damprig simulate record --json
  damprig simulate spid --analyse
  damprig simulate spid --set particle.clearance_ratio=15 --set base.frequency_ratio=0.98
  damprig simulate spid tmd

A displacement record that starts with a velocity reaches it smoothly over its first interval, which
changes the first moments of the motion; the summary and the JSON state the velocity.

The first Ctrl-C stops the run; the files and figures are complete up to there. The second ends the program at once.

Exit codes:
  0    success
  1    a file could not be written
  2    the command line or the case is wrong; nothing was written
  130  interrupted (Ctrl-C, SIGTERM or SIGHUP); the results so far are kept";

/// Parses the file of a figure.
pub(super) fn picture(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).as_deref() {
        Some("svg" | "png") => Ok(path),
        Some(other) => Err(format!("the extension .{other} is not supported; use .svg or .png")),
        None => Err("the file needs an extension: .svg or .png".into()),
    }
}

/// Parses the file of an animation.
fn animation(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).as_deref() {
        Some("svg") => Ok(path),
        Some(other) => Err(format!("the extension .{other} is not supported; use .svg, which a browser plays")),
        None => Err("the file needs the extension .svg".into()),
    }
}

/// Runs the subcommand.
///
/// # Errors
/// Bad input, an unwritable file, an interrupted run.
pub fn run(args: &SimulateArgs) -> Outcome {
    if let ([_, second, ..], Some(flag)) = (&args.cases[..], args.out_file()) {
        return Err(Failure::Input(format!(
            "{flag} is for one case, and {} is a second one\n  simulate them one by one",
            second.display()
        )));
    }
    let values = args.set.values()?;
    let paths = args.cases.iter().map(|path| examples::find(FileKind::Case, path)).collect::<Result<Vec<_>, _>>()?;
    let read = |path: &PathBuf| Case::read_changed(path, &values);
    let cases = paths.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let ctrl_c = CtrlC::watch()?;
    for (place, (path, (case, unusual))) in paths.iter().zip(cases).enumerate() {
        if place > 0 {
            say!("");
        }
        simulate_one(args, path, (&case, &unusual), &values, &ctrl_c)?;
    }
    Ok(())
}

impl SimulateArgs {
    /// The flag of an output file, if one is given.
    fn out_file(&self) -> Option<&'static str> {
        let of = |file: &Option<PathBuf>, flag| file.as_ref().map(|_| flag);
        self.out.as_ref().map(|_| "--out").or(of(&self.plot, "--plot")).or(of(&self.animate, "--animate"))
    }
}

fn simulate_one(
    args: &SimulateArgs,
    path: &Path,
    (case, unusual): (&Case, &[String]),
    values: &SetValues,
    ctrl_c: &CtrlC,
) -> Outcome {
    if args.analyse {
        let source = Source::read(path)?;
        let text = (source.name(), source.text());
        case.refuse_other_engines(text, values, "--analyse", true)?;
    }
    let pictures = [("--plot", args.plot.as_deref()), ("--animate", args.animate.as_deref())];
    super::output_paths::check(path, case, args.out.as_ref(), pictures, args.force)?;
    let rate_hz = args.out.as_ref().map(|_| args.rate.unwrap_or_else(|| case.usual_rate_hz()));
    let envelopes = envelopes(args, case)?;
    let cost = cost::estimate(case)?;
    let longest_part_s = cost::longest_part_s(case, rate_hz)?;
    unusual.iter().for_each(|warning| warn!("warning: {warning}"));
    for warning in terminal::simulation::warnings(case, &cost, args.out.as_ref().zip(rate_hz)) {
        warn!("warning: {warning}");
    }
    let mut history = match (&args.out, rate_hz) {
        (Some(path), Some(rate_hz)) => Some(TimeHistory::create(path, rate_hz, case)?),
        _ => None,
    };
    let frames = args.animate.as_ref().map(|_| Frames::of(case));
    let mut viewer = (&mut history, (envelopes, frames));
    let mut bar = SimulationBar::new(&case.name, case.run.duration_s);
    let mut go_on = |t_s: f64| {
        bar.reach(t_s);
        !ctrl_c.is_pressed()
    };
    let options = RunOptions { keep: args.json.is_given(), longest_part_s, go_on: &mut go_on };
    let result = simulate(case, &mut viewer, options);
    bar.end();
    let result = result?;
    let ((whole, last), frames) = viewer.1;
    let rows = history.as_ref().map(TimeHistory::rows);
    let written = history.map_or(Ok(()), TimeHistory::finish);
    let drawn = args
        .plot
        .as_ref()
        .map_or(Ok(()), |path| simulated_motion::of_case(case, whole.as_ref(), last.as_ref())?.save(path));
    let animated = args.animate.as_ref().zip(frames.as_ref());
    // Of a run that was stopped before its last cycles there is none.
    let animated = animated.filter(|(_, frames)| result.stopped_at_s.is_none() || frames.all().len() > 1);
    let drawn_motion = animated.map_or(Ok(()), |(path, frames)| animation::draw(case, frames)?.save(path));
    let analysis =
        if args.analyse && result.stopped_at_s.is_none() { Some(analysis(path, case, values, ctrl_c)?) } else { None };
    if args.json.is_given() {
        if result.summary.impact_count > result.impacts.len() as u64 {
            let (kept, all) = (result.impacts.len(), result.summary.impact_count);
            warn!("warning: the result lists the first {kept} of {all} impacts; --out writes them all");
        }
        let answer = SimulationJson {
            case: CaseAsSimulated::of(case, &values.lines),
            result: &result,
            analysis,
            cycle_max_m: None,
        };
        print_json(&answer)?;
    } else {
        say!("{}", terminal::simulation::summary(case, &result));
        if let Some(analysis) = &analysis {
            say!("\n{}", terminal::analysis::text(analysis));
        }
    }
    written?;
    drawn?;
    drawn_motion?;
    if let (Some(path), Some(rows), Some(rate_hz)) = (&args.out, rows, rate_hz) {
        say!("Time history: {} ({rows} rows at {} Hz)", path.path().display(), significant(rate_hz, 6));
    }
    if let Some(path) = &args.plot {
        say!("Figure: {}", path.display());
    }
    if let Some((path, _)) = animated {
        say!("Animation: {} (open it in a browser)", path.display());
    }
    match result.stopped_at_s {
        Some(t_s) => Err(Failure::Interrupted(format!(
            "interrupted at {} s of {} s; the results up to there are kept",
            significant(t_s, 9),
            significant(case.run.duration_s, 9)
        ))),
        None => Ok(()),
    }
}

/// Shows how far the sensitivities of a run are, and ends them at Ctrl-C.
struct SensitivityWatch<'a>(SimulationBar, &'a CtrlC);

impl Observer for SensitivityWatch<'_> {
    const ARCS: bool = false;

    fn goes_on(&mut self, time_s: f64) -> bool {
        self.0.reach(time_s);
        !self.1.is_pressed()
    }
}

/// The analysis of a case in a file, with some of its values set.
fn analysis(path: &Path, case: &Case, values: &SetValues, ctrl_c: &CtrlC) -> Result<Analysis, Failure> {
    let source = Source::read(path)?;
    let written = WrittenCase { name: source.name(), text: source.text(), values };
    let mut watch = SensitivityWatch(SimulationBar::new("analysis", case.run.duration_s), ctrl_c);
    let analysis = Analysis::complete(case, &written, &mut watch);
    watch.0.end();
    Ok(analysis)
}

/// The windows to draw: the requested one, or the whole run and its last cycles.
fn envelopes(args: &SimulateArgs, case: &Case) -> Result<(Option<Envelope>, Option<Envelope>), Failure> {
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
    let is_requested = args.plot_from.is_some() || args.plot_to.is_some();
    Ok(if is_requested { (Some(envelope(case, from_s, to_s, COLUMNS)), None) } else { usual_envelopes(case) })
}
