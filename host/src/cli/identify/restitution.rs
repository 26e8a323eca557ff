//! `damprig identify restitution`: from the impacts of a run, or from a table of a drop test or a force record.

use std::path::PathBuf;

use clap::Args as ClapArgs;

use super::{ChoiceArgs, OutArgs, SensorArgs, of_table};
use crate::cli::arguments::{not_negative, positive};
use crate::identify::flights::{self, Known};
use crate::identify::restitution::Approach;
use crate::identify::{CannotIdentify, Identification, particle_run, restitution};
use crate::run_folder::read::folder::find;

/// Coefficient of restitution, clearance and contact time.
///
/// Of a run: from the impacts of a particle between hard walls and from x, recorded at 1000 Hz. Of a table the columns say which test
/// it is. Impact times: t_s, with several drops also drop (their number). Heights: drop_height_m and rebound_height_m. Force on the
/// wall: t_s and force_n.
#[derive(Debug, ClapArgs)]
pub(super) struct RestitutionArgs {
    /// Run with impacts, or CSV file
    #[arg(value_name = "SOURCE")]
    pub(super) source: PathBuf,

    #[command(flatten)]
    choice: ChoiceArgs,

    /// Of a run: take the clearance as given instead of fitting it
    #[arg(long, value_name = "M", value_parser = positive)]
    clearance_m: Option<f64>,

    /// Of a run: take the friction coefficient of the particle as given instead of fitting it
    #[arg(long, value_name = "MU", value_parser = not_negative)]
    friction_coefficient: Option<f64>,

    /// Of a run: mass of the particle over that of the structure [default: that of the run's set-up]
    #[arg(long, value_name = "RATIO", value_parser = positive)]
    mass_ratio: Option<f64>,

    /// Of a run: relative standard uncertainty of the mass ratio; it acts on the clearance
    #[arg(long, value_name = "SHARE", value_parser = positive)]
    mass_ratio_uncertainty: Option<f64>,

    #[command(flatten)]
    sensors: SensorArgs,

    /// Of a force: mass of the body that hits the sensor
    #[arg(long, value_name = "KG", value_parser = positive, requires = "approach_m_per_s")]
    mass_kg: Option<f64>,

    /// Of a force: velocity of the body before each impact
    #[arg(long, value_name = "M/S", value_parser = positive, requires = "mass_kg")]
    approach_m_per_s: Option<f64>,

    #[command(flatten)]
    pub(super) out: OutArgs,
}

/// Identifies from the source.
///
/// # Errors
/// A source from which nothing can be identified.
pub(super) fn identify(args: &RestitutionArgs) -> Result<Identification, CannotIdentify> {
    let mut identified = if args.source.is_file() { restitution_of_table(args)? } else { restitution_of_run(args)? };
    identified.words = vec![("particle.wall.kind", "restitution")];
    Ok(identified)
}

fn restitution_of_run(args: &RestitutionArgs) -> Result<Identification, CannotIdentify> {
    let path = find(&args.source).map_err(|e| CannotIdentify(e.to_string()))?;
    if args.mass_kg.is_some() {
        let help = "leave them out: the impacts of a run give the velocities themselves";
        return Err(CannotIdentify(format!("--mass-kg and --approach-m-per-s are for a table with a force\n  {help}")));
    }
    let run = particle_run(&path, &args.choice.choice())?;
    let located = |error: CannotIdentify| CannotIdentify(format!("{}: {error}", run.taken_from));
    let stated = Known::of(&run.set_up).map_err(located)?;
    let gravity = run.set_up.gravity_m_per_s2;
    let known = Known {
        mass_ratio: args.mass_ratio.unwrap_or(stated.mass_ratio),
        friction_m_per_s2: args.friction_coefficient.map_or(stated.friction_m_per_s2, |mu| mu * gravity),
        is_friction_held: args.friction_coefficient.is_some(),
        clearance_m: args.clearance_m.unwrap_or(stated.clearance_m),
        is_clearance_held: args.clearance_m.is_some(),
        sensors: args.sensors.applied(run.sensors),
        mass_ratio_uncertainty: args.mass_ratio_uncertainty.unwrap_or(0.0),
        ..stated
    };
    let flights = flights::identify(&run.records, &known).map_err(located)?;
    let mut identified = Identification::new(run.taken_from.clone(), flights.estimates(gravity));
    identified.remarks = flights.remarks(stated.clearance_m, known.is_clearance_held);
    identified.remarks.push(known.sensors.remark());
    Ok(identified)
}

fn restitution_of_table(args: &RestitutionArgs) -> Result<Identification, CannotIdentify> {
    let of_run = [
        (args.clearance_m.is_some(), "--clearance-m"),
        (args.friction_coefficient.is_some(), "--friction-coefficient"),
        (args.mass_ratio.is_some(), "--mass-ratio"),
        (args.mass_ratio_uncertainty.is_some(), "--mass-ratio-uncertainty"),
        (args.choice.set_up.is_some(), "--set-up"),
        (args.choice.experiment.is_some(), "--experiment"),
    ];
    let given = of_run.iter().find(|(is_given, _)| *is_given).map(|(_, option)| *option);
    if let Some(option) = given.or(args.sensors.given()) {
        let text = format!("{option} is for a run, and {} is a file\n  leave it out", args.source.display());
        return Err(CannotIdentify(text));
    }
    let approach = args.mass_kg.zip(args.approach_m_per_s);
    let approach = approach.map(|(mass_kg, velocity_m_per_s)| Approach { mass_kg, velocity_m_per_s });
    let mut identified = of_table(&args.source, |table| restitution::identify(table, approach))?;
    identified.remarks = vec!["restitution depends on the approach velocity: test at that of the experiment".into()];
    Ok(identified)
}
