//! `damprig identify modes`: natural modes and shapes from frequency responses.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::{check_band, digits_of, shown};
use crate::cli::arguments::{ForceArg, JsonArg, positive};
use crate::cli::simulate::picture;
use crate::failure::{Failure, Outcome};
use crate::file_keys::modal_case::{self, WrittenMode};
use crate::identify::modal::Wish;
use crate::identify::modes::{IdentifiedMode, IdentifiedModes, IdentifiedValue, ModesOptions, PlaceFile, of_files};
use crate::report::figures::modes_response;
use crate::report::numbers::significant;
use crate::report::terminal::{plain_table, table};
use crate::storage::out_file::{to_failure, write_new};

/// Natural frequencies, damping ratios and mass-normalised shapes from frequency responses: one force, motions at several places.
///
/// All modes of a band are fitted to all places together; each value has its standard uncertainty and its 95 % interval. The response where the
/// force acts gives the scale of the shapes. --out writes a case with these modes.
#[derive(Debug, Args)]
pub(super) struct ModesArgs {
    /// A place and the frequency response of its motion per force: tip=test.uff#1 middle=test.uff#2 (UFF, MAT, HDF5, Parquet or CSV with complex
    /// values; `damprig inspect` names the signals); with a minus, tip=-test.uff#1, where the motion counts against the wanted direction
    #[arg(value_name = "PLACE=FILE", required = true, value_parser = place)]
    places: Vec<PlaceFile>,

    /// The place where the force acts, in the direction of the motion there [default: the first]
    #[arg(long, value_name = "PLACE")]
    driven: Option<String>,

    /// About where the modes are [default: the peaks of all places together]
    #[arg(long, value_name = "HZ,…", value_delimiter = ',', value_parser = positive)]
    near_hz: Vec<f64>,

    /// Lowest frequency of the fit
    #[arg(long, value_name = "HZ", value_parser = positive)]
    from_hz: Option<f64>,

    /// Highest frequency of the fit
    #[arg(long, value_name = "HZ", value_parser = positive)]
    to_hz: Option<f64>,

    /// Unit that the files do not state, motion per force: m/N, m/s/N, m/s2/N, g/N
    #[arg(long, value_name = "UNIT")]
    unit: Option<String>,

    /// Signal of the frequencies in Hz that the files do not state
    #[arg(long, value_name = "SIGNAL")]
    frequencies_hz: Option<String>,

    /// Draw |H| of every place and the fit over frequency, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    /// Write a case with the modes (TOML), for damprig simulate
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    #[command(flatten)]
    force: ForceArg,

    #[command(flatten)]
    json: JsonArg,
}

/// Reads `PLACE=FILE`.
fn place(text: &str) -> Result<PlaceFile, String> {
    match text.split_once('=') {
        Some((name, file)) if !name.is_empty() && !file.is_empty() => {
            let (is_reversed, file) = file.strip_prefix('-').map_or((false, file), |file| (true, file));
            Ok(PlaceFile { name: name.into(), file: file.into(), is_reversed })
        }
        _ => Err("must be PLACE=FILE, as tip=test.uff#1".into()),
    }
}

/// Identifies, prints the modes and writes the files.
///
/// # Errors
/// Responses from which nothing can be identified; a file that cannot be written.
pub(super) fn run(args: &ModesArgs) -> Outcome {
    for path in [&args.out, &args.plot].into_iter().flatten() {
        args.force.check(path)?;
    }
    for (n, place) in args.places.iter().enumerate() {
        if args.places[..n].iter().any(|other| other.name == place.name) {
            return Err(Failure::Input(format!("two places have the name {:?}; give each one of its own", place.name)));
        }
    }
    let band = Wish { from_hz: args.from_hz, to_hz: args.to_hz };
    check_band(band)?;
    let found = of_files(&ModesOptions {
        places: &args.places,
        driven: args.driven.as_deref().unwrap_or(&args.places[0].name),
        near_hz: &args.near_hz,
        band,
        unit: args.unit.as_deref(),
        frequencies_hz: args.frequencies_hz.as_deref(),
    })?;
    if let Some(path) = &args.plot {
        modes_response::draw(&found)?.save(path)?;
    }
    args.json.print(&found)?;
    say!("{}", text_of(&found));
    let Some(path) = &args.out else { return Ok(()) };
    let modes: Vec<WrittenMode> = found.modes.iter().map(written).collect();
    let text = modal_case::text(&found.taken_from[0], &found.places, &modes);
    let failed = to_failure(path);
    write_new(&args.force.file(path), |file| file.write_all(text.as_bytes()).map_err(|e| failed(&e)))?;
    say!("Written to {0}. Next: damprig simulate {0}", path.display());
    Ok(())
}

fn written(mode: &IdentifiedMode) -> WrittenMode {
    WrittenMode {
        frequency_hz: mode.natural_frequency_hz.value,
        damping_ratio: mode.damping_ratio.value,
        shape_per_root_kg: mode.shape_per_root_kg.iter().map(|phi| phi.value).collect(),
        participation_root_kg: None,
    }
}

/// The modes, and their shapes.
fn text_of(found: &IdentifiedModes) -> String {
    let mut modes = plain_table(&["mode", "fn (Hz)", "95 % interval", "damping ratio", "95 % interval"]);
    let of = |found: &IdentifiedValue| shown(found.value, found.standard_uncertainty, found.interval_95);
    for (n, mode) in found.modes.iter().enumerate() {
        let ([hertz, _, hertz_interval], [zeta, _, zeta_interval]) =
            (of(&mode.natural_frequency_hz), of(&mode.damping_ratio));
        modes.add_row([(n + 1).to_string(), hertz, hertz_interval, zeta, zeta_interval]);
    }
    let head: Vec<String> = ["place".to_string()]
        .into_iter()
        .chain(found.modes.iter().map(|mode| format!("{} Hz", significant(mode.natural_frequency_hz.value, 5))))
        .collect();
    let mut shapes = table(&head);
    for (place, name) in found.places.iter().enumerate() {
        let phi = |mode: &IdentifiedMode| {
            let IdentifiedValue { value, standard_uncertainty, .. } = mode.shape_per_root_kg[place];
            let value = significant(value, digits_of(value, standard_uncertainty));
            format!("{value} ± {}", significant(2.0 * standard_uncertainty, 2))
        };
        shapes.add_row([name.clone()].into_iter().chain(found.modes.iter().map(phi)));
    }
    let remarks: Vec<String> = found.remarks.iter().map(|remark| format!("\n{remark}")).collect();
    format!(
        "Taken from {}\n{modes}\nShapes for a modal mass of 1 kg (1/√kg, k = 2), force at {}\n{shapes}{}",
        found.taken_from.join(", "),
        found.driven,
        remarks.concat()
    )
}
