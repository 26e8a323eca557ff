//! `damprig bifurcation`: sweeps a key of a case up and down and draws the sampled cycles.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray};
use arrow_schema::{DataType, Schema};
use clap::{Args as ClapArgs, ValueEnum};

use super::outcome::{Failure, Outcome};
use super::progress::StudyBar;
use crate::input::Source;
use crate::report::figures::bifurcation as figure;
use crate::report::numbers::significant;
use crate::run_folder::own_files;
use crate::run_folder::schema::table::field;
use crate::simulation::SetValues;
use crate::simulation::case::default_name;
use crate::study::bifurcation::{self, Direction, Sample, Sweep};
use crate::study::data_set::table_bytes;

/// Draws a bifurcation diagram: sweeps a key of a case up and down.
#[derive(Debug, ClapArgs)]
#[command(after_help = AFTER_HELP)]
pub struct Args {
    /// Case file (TOML or JSON) with a sine
    #[arg(value_name = "CASE")]
    case: PathBuf,

    /// The key, its first and last value, and the number of values
    #[arg(long, value_name = "KEY=FROM:TO:COUNT")]
    axis: AxisArg,

    /// Directions of the sweep
    #[arg(long, value_enum, default_value_t = DirectionArg::Both)]
    direction: DirectionArg,

    /// Cycles at each value before sampling
    #[arg(long, value_name = "N", default_value_t = 200)]
    settle_cycles: u32,

    /// Sampled cycles at each value
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    cycles: u32,

    /// Set another key in place of the file's value; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,

    /// Also draw the Poincaré section (x, x′) at the value nearest to this one
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    section: Option<f64>,

    /// Folder of the results
    #[arg(long, value_name = "FOLDER", default_value = "bifurcation")]
    out: PathBuf,

    /// Replace existing files
    #[arg(long)]
    force: bool,
}

const AFTER_HELP: &str = "\
Examples:
  damprig bifurcation host/cases/spid.toml --axis particle.clearance_ratio=10:16:301
  damprig bifurcation host/cases/spid.toml --axis particle.wall.coefficient=0.2:0.9:201 --set particle.clearance_ratio=12
  damprig bifurcation host/cases/spid.toml --axis particle.clearance_ratio=10:16:301 --section 15 --cycles 500

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

/// `KEY=FROM:TO:COUNT`.
#[derive(Clone, Debug, PartialEq)]
struct AxisArg {
    key: String,
    values: Vec<f64>,
}

impl FromStr for AxisArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "write KEY=FROM:TO:COUNT, for example particle.clearance_ratio=10:16:301";
        let (key, range) = text.split_once('=').ok_or_else(|| format!("there is no `=`; {form}"))?;
        let parts: Vec<&str> = range.split(':').collect();
        let [from, to, count] = parts[..] else { return Err(format!("{range:?} is not FROM:TO:COUNT; {form}")) };
        let number = |text: &str| {
            let number: f64 = text.trim().parse().map_err(|_| format!("{text:?} is not a number; {form}"))?;
            if number.is_finite() { Ok(number) } else { Err(format!("{text:?} is not finite; {form}")) }
        };
        let (from, to) = (number(from)?, number(to)?);
        let count: u32 = count.trim().parse().map_err(|_| format!("{count:?} is not a whole number; {form}"))?;
        if to <= from {
            return Err(format!(
                "the last value {to} must be greater than the first, {from}; --direction selects up or down"
            ));
        }
        if !(2..=1_000_000).contains(&count) {
            return Err(format!("the number of values is {count}; it must be from 2 to 1000000"));
        }
        let last = f64::from(count - 1);
        let value = |n: u32| if n + 1 == count { to } else { from + (to - from) * (f64::from(n) / last) };
        Ok(Self { key: key.trim().into(), values: (0..count).map(value).collect() })
    }
}

/// Runs the subcommand.
///
/// # Errors
/// Bad input, an unwritable file, an interrupted run.
pub fn run(args: &Args) -> Outcome {
    let sweep = Sweep {
        key: args.axis.key.clone(),
        values: args.axis.values.clone(),
        settle_cycles: args.settle_cycles,
        cycles: args.cycles,
    };
    let set = SetValues::from_arguments(&args.set).map_err(Failure::input)?;
    let source = Source::read(&args.case).map_err(Failure::input)?;
    let name = default_name(&args.case);
    let cases = bifurcation::cases(source.name(), source.text(), &name, &sweep, &set).map_err(Failure::input)?;
    let table = args.out.join("bifurcation.parquet");
    if !args.force && table.exists() {
        let message =
            format!("{} exists\n  give another --out, or --force to replace it; nothing was written", table.display());
        return Err(Failure::Input(message));
    }
    std::fs::create_dir_all(&args.out)
        .map_err(|e| Failure::Failed(format!("cannot create {}: {e}", args.out.display())))?;
    let stop = Arc::new(AtomicBool::new(false));
    super::watch_for_ctrl_c(&stop)?;
    let directions: &[Direction] = match args.direction {
        DirectionArg::Both => &[Direction::Up, Direction::Down],
        DirectionArg::Up => &[Direction::Up],
        DirectionArg::Down => &[Direction::Down],
    };
    let steps = (cases.len() * directions.len()) as u64;
    let (bar, done) = (StudyBar::new(&name, steps), AtomicU64::new(0));
    let swept = |direction: Direction| {
        let mut go_on = |_: usize| {
            bar.reach(done.fetch_add(1, Ordering::Relaxed), None);
            !stop.load(Ordering::Relaxed)
        };
        bifurcation::run(&cases, &sweep, direction, &mut go_on)
    };
    let (first, second) = match directions {
        [one] => (swept(*one), Ok(Vec::new())),
        _ => rayon::join(|| swept(Direction::Up), || swept(Direction::Down)),
    };
    bar.end();
    let samples = [first.map_err(Failure::input)?, second.map_err(Failure::input)?].concat();
    let bytes = table_bytes(&batch(&samples, &sweep.key).map_err(Failure::failed)?).map_err(Failure::failed)?;
    own_files::replace(&table, &bytes).map_err(Failure::failed)?;
    let title = format!("{name}: {} sampled cycles at each value", sweep.cycles);
    let picture = figure::diagram(&samples, &sweep.key, &title).map_err(Failure::failed)?;
    picture.write(&args.out, "bifurcation").map_err(Failure::failed)?;
    say!("Figure: {}", args.out.join("bifurcation.svg").display());
    if let Some(wanted) = args.section {
        write_section(&samples, &sweep, wanted, &args.out)?;
    }
    say!("Table:  {} ({} rows)", table.display(), samples.len());
    if stop.load(Ordering::Relaxed) {
        return Err(Failure::Interrupted("interrupted; the values so far are written".into()));
    }
    Ok(())
}

fn write_section(samples: &[Sample], sweep: &Sweep, wanted: f64, out: &Path) -> Outcome {
    let distance = |sample: &Sample| (sample.value - wanted).abs();
    let Some(nearest) = samples.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|s| s.value) else {
        return Ok(());
    };
    let there: Vec<Sample> = samples.iter().filter(|sample| sample.value == nearest).copied().collect();
    let title = format!("{} = {}", sweep.key, significant(nearest, 6));
    figure::section(&there, &title).map_err(Failure::failed)?.write(out, "section").map_err(Failure::failed)?;
    say!("Section: {} ({title})", out.join("section.svg").display());
    Ok(())
}

fn batch(samples: &[Sample], key: &str) -> Result<RecordBatch, arrow_schema::ArrowError> {
    let unit = crate::input::key::Unit::of(key).map_or("1", |unit| unit.symbol);
    let numbers = |of: fn(&Sample) -> f64| Arc::new(samples.iter().map(of).collect::<Float64Array>()) as ArrayRef;
    let directions = samples.iter().map(|sample| sample.direction.name());
    let columns: [(&str, &str, ArrayRef); 6] = [
        (key, if unit.is_empty() { "1" } else { unit }, numbers(|s| s.value)),
        ("x_m", "m", numbers(|s| s.x_m)),
        ("v_m_per_s", "m/s", numbers(|s| s.v_m_per_s)),
        ("y_minus_x_m", "m", numbers(|s| s.offset_m)),
        ("u_minus_v_m_per_s", "m/s", numbers(|s| s.slide_m_per_s)),
        ("cycle_max_m", "m", numbers(|s| s.cycle_max_m)),
    ];
    let mut fields = vec![field("direction", DataType::Utf8, "")];
    let mut arrays: Vec<ArrayRef> = vec![Arc::new(StringArray::from_iter_values(directions))];
    for (name, unit, array) in columns {
        fields.push(field(name, DataType::Float64, unit));
        arrays.push(array);
    }
    let metadata = [("damprig.version".to_string(), crate::VERSION_LINE.to_string())];
    RecordBatch::try_new(Arc::new(Schema::new_with_metadata(fields, std::collections::HashMap::from(metadata))), arrays)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_has_both_its_ends_and_a_wrong_one_says_what_to_write() {
        let axis: AxisArg = "a.b=1:2:3".parse().expect("it is sound");
        assert_eq!((axis.key.as_str(), &axis.values[..]), ("a.b", &[1.0, 1.5, 2.0][..]));
        for wrong in ["a.b", "a.b=1:2", "a.b=1:x:3", "a.b=2:1:3", "a.b=1:2:1", "a.b=1:inf:5"] {
            assert!(wrong.parse::<AxisArg>().is_err(), "{wrong}");
        }
    }
}
