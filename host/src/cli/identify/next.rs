//! `damprig identify next`: the points that narrow the identified parameters most.

use std::path::PathBuf;

use clap::Args;

use super::digits_of;
use crate::cli::arguments::{ForceArg, JsonArg, positive};
use crate::cli::simulate::picture;
use crate::failure::Outcome;
use crate::identify::next::{self, NextOptions, NextPoints};
use crate::report::figures::next_points;
use crate::report::numbers::significant;
use crate::report::terminal::{plain_table, table};
use crate::run_folder::read::folder::find;

/// The points of a stepped sine to measure next: which frequency on which set-up narrows the identified parameters most.
///
/// Of every frequency on every set-up of the run's campaign, X/Z and its exact derivatives by the parameters are computed for the motion from rest. Points are
/// chosen one after another; each narrows all parameters together, or one with --for, as much as one point can.
#[derive(Debug, Args)]
pub(super) struct NextArgs {
    /// Run with a stepped sine
    #[arg(value_name = "RUN")]
    run: PathBuf,

    /// Set-up file that `damprig identify … --out` wrote, with the values and their uncertainties [default: that of the run's campaign]
    #[arg(long, value_name = "FILE")]
    set_up_file: Option<PathBuf>,

    /// Narrow the parameter of this key, as particle.wall.coefficient [default: all together]
    #[arg(long = "for", value_name = "KEY")]
    key: Option<String>,

    /// Number of points
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=100), default_value_t = 5)]
    points: u8,

    /// Lowest frequency [default: that of the run]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    from_hz: Option<f64>,

    /// Highest frequency [default: that of the run]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    to_hz: Option<f64>,

    /// Step of the frequencies that are looked at [default: a 200th of the band]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    step_hz: Option<f64>,

    /// Draw what one point at each frequency does, and the chosen ones, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    #[command(flatten)]
    json: JsonArg,

    #[command(flatten)]
    force: ForceArg,
}

/// Chooses the points, prints them and writes the picture.
///
/// # Errors
/// A run without settled points or identified values, an option that does not go with it, an unwritable file.
pub(super) fn run(args: &NextArgs) -> Outcome {
    args.plot.iter().try_for_each(|path| args.force.check(path))?;
    let options = NextOptions {
        points: args.points.into(),
        key: args.key.clone(),
        from_hz: args.from_hz,
        to_hz: args.to_hz,
        step_hz: args.step_hz,
    };
    let found = next::identify(&find(&args.run)?, args.set_up_file.as_deref(), &options)?;
    if let Some(path) = &args.plot {
        next_points::draw(&found)?.save(path)?;
    }
    args.json.print(&found)?;
    say!("{}", text_of(&found));
    Ok(())
}

/// The parameters, the points, and what was left out.
fn text_of(found: &NextPoints) -> String {
    let mut parameters = plain_table(&["key", "value", "standard uncertainty", "after the points", "set-ups"]);
    let last = found.points.last().map_or(&[][..], |point| &point.standard_uncertainties);
    for (parameter, after) in found.parameters.iter().zip(last) {
        let digits = digits_of(parameter.value, *after);
        parameters.add_row([
            parameter.key.clone(),
            significant(parameter.value, digits),
            significant(parameter.standard_uncertainty, 2),
            significant(*after, 2),
            parameter.set_ups.join(", "),
        ]);
    }
    let head = ["point", "set-up", "Z\n(mm)", "frequency\n(Hz)", "X/Z"].map(String::from);
    // The name of a key in its table is enough to know it.
    let keys = found.parameters.iter().map(|parameter| parameter.key.rsplit('.').take(2).collect::<Vec<_>>());
    let keys = keys.map(|parts| parts.into_iter().rev().collect::<Vec<_>>().join(".\n"));
    let mut points = table(&head.into_iter().chain(keys).collect::<Vec<_>>());
    for (n, point) in found.points.iter().enumerate() {
        let first = [
            (n + 1).to_string(),
            point.set_up.clone(),
            significant(1e3 * point.base_amplitude_m, 4),
            significant(point.frequency_hz, 6),
            significant(point.x_over_z, 4),
        ];
        points
            .add_row(first.into_iter().chain(point.standard_uncertainties.iter().map(|after| significant(*after, 2))));
    }
    let what = found.key.as_ref().map_or("all parameters together".into(), |key| format!("`{key}`"));
    let left_out: String = found.left_out.iter().map(|left| format!("\n{left}")).collect();
    let remarks: String = found.remarks.iter().map(|remark| format!("\n{remark}")).collect();
    format!(
        "Identified values of {}, before and after {} more points\n{parameters}\nPoints that narrow {what} most, with the standard uncertainties \
         after each\n{points}\nChosen from {} points on the set-ups of {}{left_out}{remarks}",
        found.values_from,
        found.points.len(),
        found.looked_at,
        found.run,
    )
}
