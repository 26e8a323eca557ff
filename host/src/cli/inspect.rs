//! `damprig inspect`: what is in a measured file.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};

use super::arguments::{ForceArg, JsonArg};
use super::simulate::picture;
use crate::failure::Outcome;
use crate::file_keys::FileKind;
use crate::input::regular;
use crate::report::figures;
use crate::report::numbers::significant;
use crate::run_folder::RunFolder;
use crate::signal_file::overview::{self, Overview, OverviewAxis, SignalOverview};
use crate::signal_file::unit::UnitKind;

/// Say what is in a measured file: its signals, units, sample rates and gaps, and what could be done with it.
///
/// The kind of the file follows from its content. A unit that the content does not state is not guessed.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct InspectArgs {
    /// CSV, UFF/UNV, AT2, CSMIP V2, COSMOS, WAV, MATLAB 5 or 7.3, HDF5 or Parquet file
    #[arg(value_name = "FILE")]
    file: PathBuf,

    /// Draw the signals, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    #[command(flatten)]
    json: JsonArg,

    #[command(flatten)]
    force: ForceArg,
}

const AFTER_HELP: &str = "\
Examples:
  damprig inspect decay.csv
  damprig inspect analyser.uff --plot analyser.png

Where a command takes a signal, FILE#3 is the third one of a file, FILE#name the one of that name.";

/// Inspects the file.
///
/// # Errors
/// A file that cannot be read, a picture that exists or cannot be written.
pub fn run(args: &InspectArgs) -> Outcome {
    if let Some(path) = &args.plot {
        args.force.check(path)?;
    }
    if let Some(own) = own(&args.file) {
        say!("{}: {own}", args.file.display());
        return Ok(());
    }
    let overview = overview::read(&args.file)?;
    if let Some(path) = &args.plot {
        figures::signals::draw(&overview).and_then(|picture| picture.save(path))?;
    }
    if args.json.is_given() {
        say!("{:#}", as_json(&overview));
        return Ok(());
    }
    let file = args.file.display();
    let count = match overview.signals.len() {
        0 => "no signal".to_string(),
        1 => "1 signal".to_string(),
        several => format!("{several} signals"),
    };
    say!("{file}: {}, {count}", overview.kind);
    for (n, signal) in overview.signals.iter().enumerate() {
        say!("");
        for line in lines(n + 1, signal) {
            say!("{line}");
        }
    }
    if !overview.remarks.is_empty() {
        say!("");
        overview.remarks.iter().for_each(|remark| say!("{remark}"));
    }
    args.plot.iter().for_each(|path| say!("Figure: {}", path.display()));
    Ok(())
}

/// What a file or folder of damprig itself is, and which command takes it.
fn own(path: &Path) -> Option<String> {
    if path.is_dir() {
        return Some(match RunFolder::open(path) {
            Ok(_) => format!("a run; `damprig runs show {}` shows it", path.display()),
            Err(_) => "a folder; name a file in it".into(),
        });
    }
    if path.extension().is_none_or(|extension| extension != "toml") {
        return None;
    }
    let text = regular::read_input(path).ok().and_then(|bytes| String::from_utf8(bytes).ok())?;
    FileKind::of(&text).map(|kind| kind.title().to_string())
}

fn lines(number: usize, signal: &SignalOverview) -> Vec<String> {
    let number_text = |value: f64| significant(value, 5);
    let quantity = match (signal.unit.map(|unit| unit.kind), signal.unit_text.as_str()) {
        (Some(kind), unit) => format!("{} in {unit}", kind.text()),
        (None, "") => "the file states no unit".into(),
        (None, unit) => format!("unit {unit:?}"),
    };
    let complex = if signal.is_complex { ", complex (magnitudes below)" } else { "" };
    let mut lines = vec![format!("#{number} {}: {quantity}{complex}", signal.name)];
    let missing = if signal.missing > 0 { format!(", {} missing", signal.missing) } else { String::new() };
    lines.push(match &signal.places {
        OverviewAxis::Time { first_s, last_s, step_s, is_even } => {
            let even = if *is_even { "" } else { " on average" };
            format!(
                "   {} values{missing} from {} s to {} s, {} Hz{even}",
                signal.count,
                number_text(*first_s),
                number_text(*last_s),
                number_text(1.0 / step_s)
            )
        }
        OverviewAxis::Frequency { first_hz, last_hz } => {
            format!(
                "   {} values{missing} from {} Hz to {} Hz",
                signal.count,
                number_text(*first_hz),
                number_text(*last_hz)
            )
        }
        OverviewAxis::Unknown(why) => format!("   {} values{missing}; {why}", signal.count),
    });
    lines.push(format!(
        "   from {} to {}, mean {}, RMS about it {} {}",
        number_text(signal.min),
        number_text(signal.max),
        number_text(signal.mean),
        number_text(signal.rms),
        signal.unit_text
    ));
    lines.extend(signal.remark.iter().map(|remark| format!("   {remark}")));
    lines.extend(signal.uses().into_iter().map(|usage| format!("   can be used as: {usage}")));
    lines
}

fn as_json(overview: &Overview) -> Value {
    let signals: Vec<Value> = overview.signals.iter().map(signal_json).collect();
    json!({ "kind": overview.kind, "signals": signals, "remarks": overview.remarks })
}

fn signal_json(signal: &SignalOverview) -> Value {
    let places = match &signal.places {
        OverviewAxis::Time { first_s, last_s, step_s, is_even } => {
            json!({ "first_s": first_s, "last_s": last_s, "step_s": step_s, "is_even": is_even })
        }
        OverviewAxis::Frequency { first_hz, last_hz } => json!({ "first_hz": first_hz, "last_hz": last_hz }),
        OverviewAxis::Unknown(why) => json!({ "unknown": why }),
    };
    json!({
        "name": signal.name,
        "unit": signal.unit_text,
        "quantity": signal.unit.map(|unit| unit.kind).map(UnitKind::text),
        "si_per_unit": signal.unit.map(|unit| unit.si),
        "places": places,
        "count": signal.count,
        "missing": signal.missing,
        "is_complex": signal.is_complex,
        "min": signal.min,
        "max": signal.max,
        "mean": signal.mean,
        "rms": signal.rms,
        "remark": signal.remark,
    })
}
