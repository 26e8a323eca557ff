//! `damprig calibrate`: calibrates a channel of a board, guided, from a file, or as a rehearsal.

use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use damprig_core::settings::Settings;
use damprig_protocol::{PlantKind, Request};

use super::arguments::{ForceArg, JsonArg, Rig, not_negative, seconds};
use super::calibrate_operator::Person;
use super::consent::ConsentArg;
use super::ctrl_c::CtrlC;
use crate::calibrate::fit::MIN_POINTS;
use crate::calibrate::guide::{self, CalibrationPlan, Operator};
use crate::calibrate::readings::{self, KeptFile};
use crate::calibrate::record::{CalibrationRecord, Validity};
use crate::calibrate::rehearsal::{SimulatedOperator, Truth};
use crate::calibrate::rig::CalibratedRig;
use crate::calibrate::solve::solve;
use crate::calibrate::{CalibrationPoint, Channel};
use crate::client::link::Address;
use crate::client::session::Session;
use crate::failure::{Failure, Outcome};
use crate::host_time;
use crate::report::terminal::calibration;
use crate::settings::read_board;
use crate::storage::out_file::{to_failure, write_new};

/// Calibrates a channel of a board: leads through known references, fits the scale with its uncertainty, compares it with the
/// old one.
///
/// Nothing on the board changes without --save. Every reading is kept in a file at once; Ctrl-C leaves the board as it was.
/// docs/LAB_GUIDE.md has the sequence of all channels.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct CalibrateArgs {
    /// x, z (displacement sensors), match (x and z on one target), spring (force sensor), walls, drive, or friction-spring
    /// (stiffness)
    #[arg(value_name = "CHANNEL")]
    channel: Channel,

    /// Rig, as for damprig settings [default: auto; with --rehearse virtual]
    #[arg(long, value_name = "RIG")]
    rig: Option<Rig>,

    /// References, with units (-60mm,0mm,60mm; 0N,10N,20N): positions, forces up and down, or deflections of friction-spring.
    /// Without a unit they are SI [default: seven over four fifths of the usable span]
    #[arg(long, value_name = "LIST", value_delimiter = ',', allow_hyphen_values = true)]
    at: Vec<String>,

    /// Time of a reading at rest, and of a sine's dwell
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0, value_parser = seconds)]
    measure_s: f64,

    /// Blows on each wall
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(3..=1000))]
    blows: u16,

    /// Largest base amplitude of match and drive [default: 0.002 for match, 0.0005 for drive]
    #[arg(long, value_name = "M", value_parser = super::arguments::positive)]
    amplitude_m: Option<f64>,

    /// Frequencies of match and drive [default: 1,2,4 for match, 2.5 for drive]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = super::arguments::positive)]
    frequency_hz: Vec<f64>,

    /// Take the points from a CSV file (columns reference_… and reading_… with units) instead of a rig
    #[arg(long, value_name = "FILE", conflicts_with_all = ["rehearse", "at", "keep"])]
    readings: Option<PathBuf>,

    /// Settings under which the readings of --readings were taken, as written by damprig settings export [default: those of
    /// --rig, or as delivered]
    #[arg(long, value_name = "BOARD.toml", requires = "readings", conflicts_with = "rig")]
    settings: Option<PathBuf>,

    /// Rehearse on the virtual rig: this seed draws the true scale and the errors of a simulated operator
    #[arg(long, value_name = "SEED")]
    rehearse: Option<u64>,

    /// File that keeps every reading [default: calibrate-CHANNEL-DATE-TIME.csv]
    #[arg(long, value_name = "FILE")]
    keep: Option<PathBuf>,

    /// Days for which the calibration is valid; 0 for ever
    #[arg(long, value_name = "DAYS", default_value_t = 365.0, value_parser = not_negative)]
    valid_days: f64,

    /// Date of the calibration [default: today]
    #[arg(long, value_name = "YYYY-MM-DD")]
    date: Option<jiff::civil::Date>,

    /// The sensor or the drive is meant to have the reversed direction
    #[arg(long)]
    reversed: bool,

    /// Save although points do not belong to the others
    #[arg(long, requires = "save")]
    accept_outliers: bool,

    #[command(flatten)]
    json: JsonArg,

    /// Write the new settings of the channel and the record of the calibration as a file for damprig settings import
    #[arg(long, value_name = "FILE.toml")]
    out: Option<PathBuf>,

    #[command(flatten)]
    force: ForceArg,

    /// Use the new settings on the board and save them, then measure once more to check
    #[arg(long)]
    save: bool,

    #[command(flatten)]
    consent: ConsentArg,

    /// Time without a message after which the link counts as lost
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = seconds)]
    timeout: f64,
}

const AFTER_HELP: &str = "\
Examples:
  damprig calibrate x --rehearse 1                        try it on the virtual rig
  damprig calibrate x --rig auto --save
  damprig calibrate spring --at 0N,10N,20N,40N,20N,10N,0N --rig auto
  damprig calibrate walls --blows 10 --rig auto --out walls.toml
  damprig calibrate z --readings z.csv --settings board.toml --out z.toml

Exit codes:
  0    success
  1    the rig, the link or the disk failed, or what was measured is no calibration; the readings are kept
  2    the command line or a file is wrong; nothing has moved
  130  interrupted; the board has its settings of before, the readings are kept";

/// Runs the subcommand.
///
/// # Errors
/// Wrong input, a failed rig, readings that give no scale.
pub fn run(args: &CalibrateArgs) -> Outcome {
    if args.rehearse.is_some() && !matches!(args.rig, None | Some(Rig::At(Address::Virtual { .. }))) {
        let message = "--rehearse: it needs --rig virtual or virtual:BOARD.toml; leave out --rig";
        return Err(Failure::Input(message.into()));
    }
    if let Some(out) = &args.out {
        args.force.check(out)?;
    }
    match &args.readings {
        Some(file) => from_file(args, file),
        None => guided(args),
    }
}

impl CalibrateArgs {
    fn validity(&self) -> Validity {
        let date_days = self.date.map_or_else(host_time::today_days, host_time::days);
        Validity { date_days, valid_days: self.valid_days as f32 }
    }

    fn session(&self) -> Result<Session, Failure> {
        let virtual_rig = Rig::At(Address::VIRTUAL);
        let given = self.rig.as_ref();
        let rig = given.unwrap_or(if self.rehearse.is_some() { &virtual_rig } else { &Rig::Auto });
        let mut session = Session::open(&rig.find()?, Duration::from_secs_f64(self.timeout))?;
        warn!("{}", session.settings_line());
        // The other settings would be saved with those of the channel.
        let drives = matches!(self.channel, Channel::Match | Channel::Drive | Channel::FrictionSpring);
        if self.save || drives && self.readings.is_none() {
            self.consent.check(&mut session, "this calibration is refused")?;
        }
        Ok(session)
    }

    /// The record of points, printed and written.
    fn record(
        &self,
        taken_from: String,
        points: Vec<CalibrationPoint>,
        old: &Settings,
    ) -> Result<CalibrationRecord, Failure> {
        let solved = solve(self.channel, &points, old, self.reversed)?;
        CalibrationRecord::new(self.channel, taken_from, points, solved, old, self.validity())
    }

    /// The references of the command line.
    fn references(&self, settings: &Settings) -> Result<Vec<f64>, Failure> {
        if self.at.is_empty() {
            return Ok(self.channel.default_references(settings));
        }
        if !matches!(self.channel, Channel::X | Channel::Z | Channel::Spring | Channel::FrictionSpring) {
            let message = format!("--at: {} has no references; they are those of the hammer or of z", self.channel);
            return Err(Failure::Input(message));
        }
        if self.at.len() < MIN_POINTS {
            let message = format!("--at: {} references; at least {MIN_POINTS} are needed", self.at.len());
            return Err(Failure::Input(message));
        }
        let one = |text: &String| {
            let value = self.channel.parse(text)?;
            guide::allowed(self.channel, value, settings).map(|()| value)
        };
        self.at.iter().map(|text| one(text).map_err(|why| Failure::Input(format!("--at {text}: {why}")))).collect()
    }
}

/// Fits the points of a file.
fn from_file(args: &CalibrateArgs, file: &std::path::Path) -> Outcome {
    let mut session = (args.rig.is_some() || args.save).then(|| args.session()).transpose()?;
    let settings = match (&session, &args.settings) {
        (Some(session), _) => session.settings,
        (None, Some(board)) => read_board(board)?,
        (None, None) => Settings::default(),
    };
    let points = readings::read(file, args.channel, &settings)?;
    let record = args
        .record(file.display().to_string(), points, &settings)
        .map_err(|error| Failure::Input(format!("{}: {error}", file.display())))?;
    write(args, &record)?;
    if let (true, Some(session)) = (args.save, &mut session) {
        may_save(args, &record)?;
        save(session, &record)?;
    }
    print(args, &record)
}

/// Measures on a rig and fits what was measured.
fn guided(args: &CalibrateArgs) -> Outcome {
    let mut session = args.session()?;
    if session.description.plant != PlantKind::Real && args.rehearse.is_none() {
        let message = format!(
            "the rig {} is simulated: its sensors need no calibration\n  rehearse one with --rehearse SEED, or give values with \
             --readings",
            session.name()
        );
        return Err(Failure::Input(message));
    }
    let plan = CalibrationPlan {
        channel: args.channel,
        references: args.references(&session.settings)?,
        measure_s: args.measure_s,
        blows: usize::from(args.blows),
        amplitude_m: args.amplitude_m.unwrap_or(if args.channel == Channel::Drive { 5e-4 } else { 2e-3 }),
        frequencies_hz: args.frequency_hz.clone(),
    };
    on_the_rig(args, &plan, &mut session)
}

/// Calibrates the rig of an open session.
fn on_the_rig(args: &CalibrateArgs, plan: &CalibrationPlan, session: &mut Session) -> Outcome {
    let settings = session.settings;
    let ctrl_c = CtrlC::watch()?;
    let stamp = host_time::now().strftime("%Y%m%d-%H%M%S");
    let kept = match &args.keep {
        Some(path) => KeptFile::create(path.clone(), args.channel).map_err(Failure::input)?,
        None => KeptFile::create_new(&format!("calibrate-{}-{stamp}", args.channel), args.channel)?,
    };
    let name = session.name().to_string();
    let mut rig = CalibratedRig::new(session, ctrl_c.flag())?;
    let mut operator: Box<dyn Operator> = match args.rehearse {
        Some(seed) => {
            let truth = Truth::draw(args.channel, seed, &settings);
            Box::new(SimulatedOperator::new(truth, &mut rig, |line| warn!("{line}"))?)
        }
        None => Box::new(Person::new(args.channel)),
    };
    let taken_from = args.rehearse.map_or(name.clone(), |seed| format!("{name}, rehearsal {seed}"));
    let measured = guide::measure(plan, &mut rig, operator.as_mut(), &kept);
    let record = measured.and_then(|points| args.record(taken_from, points, &settings));
    let mut record = record.map_err(|error| with_kept(error, args.channel, &kept))?;
    warn!("readings kept in {}", kept.path().display());
    write(args, &record)?;
    if args.save {
        may_save(args, &record)?;
        save(rig.session, &record)?;
        rig.session.settings = *record.settings();
        warn!("once more with the new settings:");
        record.checked = guide::check(plan, &mut rig, operator.as_mut())?;
    }
    print(args, &record)
}

fn print(args: &CalibrateArgs, record: &CalibrationRecord) -> Outcome {
    args.json.print(record)?;
    say!("{}", calibration::text(record));
    if !args.save {
        say!(
            "Nothing on the board has changed{}.",
            if args.readings.is_none() { "; --save uses and saves the new settings" } else { "" }
        );
    }
    Ok(())
}

fn write(args: &CalibrateArgs, record: &CalibrationRecord) -> Outcome {
    let Some(path) = &args.out else { return Ok(()) };
    let failed = to_failure(path);
    write_new(&args.force.file(path), |file| file.write_all(record.to_toml().as_bytes()).map_err(|e| failed(&e)))
}

/// Refuses to save points that do not belong together, and shows them.
fn may_save(args: &CalibrateArgs, record: &CalibrationRecord) -> Outcome {
    if record.outliers.is_empty() || args.accept_outliers {
        return Ok(());
    }
    print(args, record)?;
    let list: Vec<String> = record.outliers.iter().map(|point| (point + 1).to_string()).collect();
    let message = format!(
        "not saved: point {} does not belong to the others\n  measure again, or save it as it is with --accept-outliers",
        list.join(", ")
    );
    Err(if args.readings.is_some() { Failure::Input(message) } else { Failure::Failed(message) })
}

/// Uses the new settings and saves them.
fn save(session: &mut Session, record: &CalibrationRecord) -> Outcome {
    session.execute("use the settings", Request::SetSettings(*record.settings()))?;
    session.execute("save its settings", Request::SaveSettings)?;
    warn!("saved on {}", session.name());
    if session.name().starts_with("virtual") {
        warn!("note: the virtual rig ends with this command; --out FILE.toml keeps the settings");
    }
    Ok(())
}

/// The failure with where the readings are. Readings of the rig that cannot be used are a failure of the rig.
fn with_kept(error: Failure, channel: Channel, kept: &KeptFile) -> Failure {
    let error = match error {
        Failure::Input(text) => Failure::Failed(text),
        Failure::Interrupted(text) => Failure::Interrupted(format!("{text}\n  the board has its settings of before")),
        error => error,
    };
    let is_empty = std::fs::read_to_string(kept.path()).is_ok_and(|text| text.lines().count() < 2);
    if is_empty {
        kept.remove();
        return error;
    }
    let path = kept.path().display();
    error.with(|error| {
        format!("{error}\n  the readings are kept in {path}; `damprig calibrate {channel} --readings {path}` fits them")
    })
}
