//! `damprig identify restitution`: from the impacts of a run, or from tracked films, tables of drop tests and force records.

use std::path::PathBuf;

use clap::Args;
use damprig_identification::Refused;

use super::{ChoiceArgs, OutArgs, SensorArgs, finish_if_consistent};
use crate::cli::arguments::{not_negative, positive, table_file};
use crate::cli::simulate::picture;
use crate::failure::{Failure, Outcome};
use crate::identify::flights::{self, KnownSetUp};
use crate::identify::restitution::{self, Approach, FilmAxis, Restitution, RestitutionOptions};
use crate::identify::{Identification, particle_run};
use crate::report::figures::restitution as figure;
use crate::report::{branch_table, restitution_table};
use crate::run_folder::read::folder::find;

/// Coefficient of restitution, as one value and over the approach speed; clearance and contact time.
///
/// Of a run: from the impacts of a particle between hard walls and from x, recorded at 1000 Hz. Of files of drop tests, one or several
/// together, the columns say which test it is. Tracked film: frame (or t_s), x and y of the ball in pixels (or x_mm, y_mm). Impact times: t_s,
/// with several drops also drop (their number), and drop_height_m if known. Heights: drop_height_m and rebound_height_m. Force on the wall:
/// t_s and force_n. The first line of the answer says whether one coefficient is enough.
#[derive(Debug, Args)]
pub(super) struct RestitutionArgs {
    /// Run with impacts, or files of drop tests
    #[arg(value_name = "SOURCE", required = true)]
    sources: Vec<PathBuf>,

    /// Of a film with frame numbers: frames per second of the recording, not of a slow-motion replay
    #[arg(long, value_name = "HZ", value_parser = positive)]
    frame_rate_hz: Option<f64>,

    /// Of a film in pixels: scale at the floor [default: by gravity, from the flights]
    #[arg(long, value_name = "M", value_parser = positive)]
    m_per_pixel: Option<f64>,

    /// Of a film: axis along which the ball falls [default: that on which it does]
    #[arg(long, value_name = "AXIS", value_enum)]
    vertical: Option<FilmAxis>,

    /// Of a film with several tracks: number of the ball's, or numbers of its parts, separated by commas
    #[arg(long, value_name = "N", value_delimiter = ',')]
    track: Vec<u32>,

    /// Of drop tests: acceleration of gravity
    #[arg(long, value_name = "M/S2", value_parser = positive)]
    gravity: Option<f64>,

    /// Of impact times: height of every drop; gives the first impact too
    #[arg(long, value_name = "M", value_parser = positive)]
    drop_height_m: Option<f64>,

    /// Of impact times: standard uncertainty of a time [default: from the scatter]
    #[arg(long, value_name = "S", value_parser = positive)]
    time_uncertainty_s: Option<f64>,

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

    /// Draw e over the approach speed, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,

    /// Write the impacts as a table, .csv or .parquet
    #[arg(long, value_name = "FILE", value_parser = table_file)]
    table: Option<PathBuf>,

    /// Let --out write one coefficient where the impacts show that e depends on the speed
    #[arg(long, requires = "out")]
    despite_misfit: bool,

    #[command(flatten)]
    out: OutArgs,
}

/// Identifies from the sources, prints the results and writes the files.
///
/// # Errors
/// Sources from which nothing can be identified, one coefficient that the impacts contradict and --out, an unwritable file.
pub(super) fn run(args: &RestitutionArgs) -> Outcome {
    args.out.check(&args.sources, &[&args.plot, &args.table])?;
    let is_file = args.sources.iter().all(|source| source.is_file());
    let found = if is_file { restitution_of_files(args) } else { restitution_of_run(args) };
    let Restitution { law, mut identified } = found?;
    identified.words = vec![("particle.wall.kind", "restitution")];
    for (option, path) in [("--plot", &args.plot), ("--table", &args.table)] {
        let Some(path) = path else { continue };
        let Some((law, over)) = law.as_ref().zip(identified.over_speed.as_ref()) else {
            let message =
                format!("{option}: the source has no impacts with a speed each\n  it is for drop tests; leave it out");
            return Err(Failure::Input(message));
        };
        if option == "--plot" {
            figure::draw(law, &over.impacts).and_then(|picture| picture.save(path))?;
        } else {
            let table = restitution_table::table(&over.impacts, &identified.taken_from)?;
            branch_table::write(&table, &args.out.force.file(path))?;
        }
    }
    let help = "test at the speeds of the experiment, or write the coefficient of all impacts";
    finish_if_consistent(&args.out, identified, args.despite_misfit, help)
}

fn restitution_of_run(args: &RestitutionArgs) -> Result<Restitution, Failure> {
    let [source] = &args.sources[..] else {
        // A file that is missing is named as one.
        if let Some(missing) = args.sources.iter().find(|source| !source.exists()) {
            return Err(Failure::Input(format!("cannot read {}: there is no such file", missing.display())));
        }
        let text = "a run is identified by itself\n  give several sources only where all are files of drop tests";
        return Err(Failure::Input(text.into()));
    };
    if let Some((option, _)) = args.of_files().into_iter().find(|(_, is_given)| *is_given) {
        let text = format!("{option} is for files of drop tests, and {} is none\n  leave it out", source.display());
        return Err(Failure::Input(text));
    }
    let path = find(source)?;
    if args.mass_kg.is_some() {
        let help = "leave them out: the impacts of a run give the velocities themselves";
        return Err(Failure::Input(format!("--mass-kg and --approach-m-per-s are for a table with a force\n  {help}")));
    }
    let run = particle_run(&path, &args.choice.choice())?;
    let located = |error: Refused| Failure::Input(format!("{}: {error}", run.taken_from));
    let stated = KnownSetUp::of(&run.set_up).map_err(located)?;
    let gravity = run.set_up.gravity_m_per_s2;
    let known = KnownSetUp {
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
    if let Some(law) = &flights.law {
        restitution::judge(&mut identified, law, Vec::new());
    }
    identified.remarks.push(known.sensors.remark());
    Ok(Restitution { law: None, identified })
}

impl RestitutionArgs {
    /// The options of drop tests, and whether they are given.
    fn of_files(&self) -> [(&'static str, bool); 7] {
        [
            ("--frame-rate-hz", self.frame_rate_hz.is_some()),
            ("--m-per-pixel", self.m_per_pixel.is_some()),
            ("--vertical", self.vertical.is_some()),
            ("--track", !self.track.is_empty()),
            ("--gravity", self.gravity.is_some()),
            ("--drop-height-m", self.drop_height_m.is_some()),
            ("--time-uncertainty-s", self.time_uncertainty_s.is_some()),
        ]
    }
}

fn restitution_of_files(args: &RestitutionArgs) -> Result<Restitution, Failure> {
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
        let text = format!("{option} is for a run, and {} is a file\n  leave it out", args.sources[0].display());
        return Err(Failure::Input(text));
    }
    let approach = args.mass_kg.zip(args.approach_m_per_s);
    let options = RestitutionOptions {
        gravity_m_per_s2: args.gravity.unwrap_or(damprig_core::model::GRAVITY_M_PER_S2),
        frame_rate_hz: args.frame_rate_hz,
        m_per_pixel: args.m_per_pixel,
        vertical: args.vertical,
        tracks: args.track.clone(),
        drop_height_m: args.drop_height_m,
        time_uncertainty_s: args.time_uncertainty_s,
        approach: approach.map(|(mass_kg, velocity_m_per_s)| Approach { mass_kg, velocity_m_per_s }),
    };
    restitution::identify(&args.sources, &options)
}
