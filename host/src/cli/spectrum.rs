//! `damprig spectrum`: response spectra of an acceleration record.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::arguments::{ForceArg, JsonArg, StatedArgs, positive, table_file};
use super::simulate::picture;
use crate::failure::{Failure, Outcome};
use crate::input::Files;
use crate::motion_record::{RecordQuantity, Spec, Which, read};
use crate::report::figures;
use crate::report::numbers::significant;
use crate::report::terminal::table;
use crate::report::{branch_table, spectrum_table};
use crate::spectrum::{PeakMethod, SpectrumPoint, periods, spectra};

/// Response spectra of an acceleration record: the largest displacement, velocity and acceleration of a linear oscillator.
///
/// u″ + 2ζω u′ + ω² u = −z″ from rest. Sd = max|u| and Sv = max|u′| are relative to the ground, Sa = max|u″ + z″| is absolute; the pseudo values
/// are PSV = ω·Sd and PSA = ω²·Sd. The acceleration is linear between its samples, and the motion is exact.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct SpectrumArgs {
    /// Acceleration record: CSV, AT2 (PEER) or V2 (CSMIP)
    #[arg(value_name = "RECORD")]
    record: PathBuf,

    /// Damping ratios, 0 or more and below 1
    #[arg(long, value_name = "RATIO,…", value_delimiter = ',', value_parser = damping, default_value = "0.05")]
    damping: Vec<f64>,

    /// Periods in seconds: FROM:TO:COUNT in even ratios, or a list
    #[arg(long, value_name = "PERIODS", default_value = "0.02:10:200")]
    periods: Periods,

    /// How the largest values are found
    #[arg(long, value_enum, default_value_t = MethodArg::Exact)]
    method: MethodArg,

    #[command(flatten)]
    stated: StatedArgs,

    /// Column of the values, by name or place from 1 [default: the only one beside the time]
    #[arg(long, value_name = "COLUMN")]
    column: Option<String>,

    /// Time between the samples of a file without a column of times
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    time_step_s: Option<f64>,

    /// Write the spectra as a table, .csv or .parquet
    #[arg(long, value_name = "FILE", value_parser = table_file)]
    out: Option<PathBuf>,

    /// Draw the spectra, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    #[command(flatten)]
    json: JsonArg,

    #[command(flatten)]
    force: ForceArg,
}

const AFTER_HELP: &str = "\
Examples:
  damprig spectrum ELC180.AT2
  damprig spectrum CHAN001.V2 --damping 0,0.02,0.05,0.1,0.2 --method at-samples --out sd.csv
  damprig spectrum quake.csv --unit g --periods 0.1,0.2,0.5,1,2 --plot spectrum.svg

docs/SPECTRUM.md compares the values with published ones.

Exit codes:
  0    success
  1    a file could not be written
  2    the command line or the record is wrong; nothing was written";

/// How the largest values are found, as an argument.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MethodArg {
    /// Exact motion, maxima between the samples too
    Exact,
    /// Exact motion at the samples only, as strong-motion agencies publish it
    AtSamples,
    /// Newmark's average acceleration in half steps, as the FEMA P-695 values were computed; its error grows towards short periods
    Newmark,
}

impl MethodArg {
    fn method(self) -> PeakMethod {
        match self {
            Self::Exact => PeakMethod::Exact,
            Self::AtSamples => PeakMethod::AtSamples,
            Self::Newmark => PeakMethod::Newmark,
        }
    }
}

/// Most periods.
const MAX_PERIODS: usize = 10_000;

/// Rows of a damping ratio that the terminal shows, at most.
const SHOWN: usize = 20;

#[derive(Clone, Debug, PartialEq)]
struct Periods(Vec<f64>);

impl FromStr for Periods {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<&str> = text.split(':').collect();
        if let [from, to, count] = parts[..] {
            let (from, to) = (positive(from)?, positive(to)?);
            let count = count.parse().ok().filter(|count| (2..=MAX_PERIODS).contains(count));
            let count = count.ok_or_else(|| format!("the count must be a whole number from 2 to {MAX_PERIODS}"))?;
            return if from < to {
                Ok(Self(periods(from, to, count)))
            } else {
                Err(format!("{from} must be less than {to}"))
            };
        }
        if parts.len() != 1 {
            return Err("must be FROM:TO:COUNT, or periods with commas".into());
        }
        text.split(',').map(|period| positive(period.trim())).collect::<Result<_, _>>().map(Self)
    }
}

fn damping(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(ratio) if (0.0..1.0).contains(&ratio) => Ok(ratio),
        _ => Err("must be a number from 0 to below 1".into()),
    }
}

/// What `--json` prints.
#[derive(Serialize)]
struct SpectrumJson<'a> {
    record: String,
    damprig: &'static str,
    method: &'static str,
    time_step_s: f64,
    samples: usize,
    /// Estimated change by resampling of uneven times, RMS over that of the samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    resampling: Option<f64>,
    peak_m_per_s2: f64,
    spectra: &'a [SpectrumPoint],
}

/// Runs the subcommand.
///
/// # Errors
/// A record that cannot be used, an unwritable file.
pub fn run(args: &SpectrumArgs) -> Outcome {
    [&args.out, &args.plot].into_iter().flatten().try_for_each(|path| args.force.check(path))?;
    let which = |column: &String| column.parse().map_or_else(|_| Which::Name(column.clone()), Which::Place);
    let spec = Spec {
        quantity: Some(RecordQuantity::Acceleration),
        stated: args.stated.stated()?,
        scale: None,
        time_step_s: args.time_step_s,
        column: args.column.as_ref().map(which),
        time_column: None,
    };
    let record = read(&args.record, &spec, &Files::default()).map_err(|error| {
        Failure::Input(format!(
            "{error}\n  --unit, --sensitivity, --column and --time-step-s state what the file does not"
        ))
    })?;
    let method = args.method.method();
    let name = args.record.display().to_string();
    let points = spectra(&record, &args.damping, &args.periods.0, method)
        .map_err(|why| Failure::Input(format!("{name}: {why}")))?;
    if let Some(path) = &args.out {
        branch_table::write(&spectrum_table::table(&points, &name, method)?, &args.force.file(path))?;
    }
    if let Some(path) = &args.plot {
        figures::spectrum::draw(&points).and_then(|picture| picture.save(path))?;
    }
    if args.json.is_given() {
        let answer = SpectrumJson {
            record: name,
            damprig: crate::VERSION_LINE,
            method: method.text(),
            time_step_s: record.step_s,
            samples: record.samples.len(),
            resampling: record.resampling,
            peak_m_per_s2: record.peak(),
            spectra: &points,
        };
        say!("{}", serde_json::to_string(&answer)?);
        return Ok(());
    }
    say!(
        "{name}: {} samples, one each {} s, largest {} m/s²\n{}",
        record.samples.len(),
        significant(record.step_s, 6),
        significant(record.peak(), 5),
        method.text()
    );
    record.resampled_text().iter().for_each(|text| say!("{text}"));
    say!("{}", text_of(&points, args.periods.0.len()));
    for (what, path) in [("Table", &args.out), ("Figure", &args.plot)] {
        if let Some(path) = path {
            say!("{what}: {}", path.display());
        }
    }
    Ok(())
}

/// A table of the spectra, thinned to what a terminal shows.
fn text_of(points: &[SpectrumPoint], periods: usize) -> String {
    let mut rows = table(&["ζ", "T\n(s)", "Sd\n(m)", "Sv\n(m/s)", "Sa\n(m/s²)", "PSV\n(m/s)", "PSA\n(m/s²)"]);
    let every = periods.div_ceil(SHOWN);
    for of_ratio in points.chunks(periods) {
        for point in of_ratio.iter().step_by(every) {
            let values = [
                point.damping_ratio,
                point.period_s,
                point.sd_m,
                point.sv_m_per_s,
                point.sa_m_per_s2,
                point.psv_m_per_s,
                point.psa_m_per_s2,
            ];
            rows.add_row(values.map(|value| significant(value, 4)));
        }
    }
    let note =
        if every > 1 { format!("\nEach {every}th period; --out and --json have all {periods}") } else { String::new() };
    format!("{rows}{note}")
}
