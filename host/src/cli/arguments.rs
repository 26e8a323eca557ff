//! Command-line options that several subcommands share (`--rig`, `--speed`, `--set`, `--json`, `--force`, `--quiet`), and values of others.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use super::output::{be_quiet, print_json};
use crate::client::devices::{PortAnswer, only, ports, query};
use crate::client::link::{Address, Speed};
use crate::failure::{Failure, Outcome};
use crate::settings::read_board;
use crate::signal_file::unit::Unit;
use crate::signal_file::{Calibration, Selector, SensorSensitivity, StatedSignal};
use crate::simulation::SetValues;
use crate::storage::out_file::{EXISTS, OutFile};

/// The value of `--rig`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Rig {
    /// `auto`: the only connected board.
    Auto,
    /// An address.
    At(Address),
}

impl FromStr for Rig {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        text.parse().map(Self::At).map_err(|e: String| e.replace("must be virtual,", "must be auto, virtual,"))
    }
}

impl Rig {
    /// The address of the rig. Reads the settings file of a virtual board to check it.
    ///
    /// # Errors
    /// `auto` without exactly one board; unreadable settings of a virtual board.
    pub fn find(&self) -> Result<Address, Failure> {
        match self {
            Self::At(address) => {
                if let Some(board) = address.board() {
                    read_board(board)?;
                }
                Ok(address.clone())
            }
            Self::Auto => {
                let found = query(ports().map_err(Failure::Failed)?, false, Duration::from_secs(1));
                let boards = found.iter().filter(|f| matches!(f.answer, PortAnswer::Device { .. })).count();
                // Several boards are a question of the command line; without one there is no rig to reach.
                only(&found).map_err(if boards > 1 { Failure::Input } else { Failure::Failed })
            }
        }
    }
}

/// The option `--json`.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(super) struct JsonArg {
    /// Print JSON in place of text
    #[arg(long)]
    json: bool,
}

impl JsonArg {
    /// Whether JSON is printed.
    pub(super) fn is_given(self) -> bool {
        self.json
    }

    /// Prints the answer in place of all lines that follow, if it is given.
    ///
    /// # Errors
    /// A defect of the answer.
    pub(super) fn print(self, answer: &impl serde::Serialize) -> Outcome {
        if self.json { print_json(answer) } else { Ok(()) }
    }
}

/// The option `--set`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SetArg {
    /// Set a key in place of the file's value, with its tables: particle.wall.coefficient=0.5; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl SetArg {
    /// What is set.
    ///
    /// # Errors
    /// What is no key and value, or no TOML.
    pub(super) fn values(&self) -> Result<SetValues, Failure> {
        SetValues::from_arguments(&self.set)
    }
}

/// The option `--force`, and what is refused without it.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(super) struct ForceArg {
    /// Replace existing files
    #[arg(long)]
    force: bool,
}

impl ForceArg {
    /// Whether existing files are replaced.
    pub(super) fn is_given(self) -> bool {
        self.force
    }

    /// A file to write.
    pub(super) fn file(self, path: &Path) -> OutFile {
        OutFile { path: path.to_path_buf(), force: self.force }
    }

    /// Rejects a file that exists. Called before anything is computed: another name is a matter of the command line.
    ///
    /// # Errors
    /// Names the file.
    pub(super) fn check(self, path: &Path) -> Outcome {
        if !self.force && path.symlink_metadata().is_ok() {
            return Err(Failure::Input(format!("cannot write {}: {EXISTS}\n  nothing was written", path.display())));
        }
        Ok(())
    }
}

/// The option `--quiet`.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(super) struct QuietArg {
    /// Print only warnings, errors and the place of the results
    #[arg(long)]
    quiet: bool,
}

impl QuietArg {
    /// Leaves out other lines and bars from now on, if it is given.
    pub(super) fn apply(self) {
        if self.quiet {
            be_quiet();
        }
    }
}

/// What a file of signals does not state.
#[derive(Clone, Debug, clap::Args)]
pub struct StatedArgs {
    /// Unit of the values, if the file does not state it: m/s2, g, mm/s2, m/s, mm/s, m, mm, V, mV …
    #[arg(long, value_name = "UNIT")]
    unit: Option<Unit>,

    /// Sensitivity of the sensor, if the values are its voltage: "100 mV/g", "10.2 mV/(m/s2)", "2.5 V/mm"
    #[arg(long, value_name = "VOLTAGE/UNIT")]
    sensitivity: Option<SensorSensitivity>,

    /// Recording of a calibrator on the same channel and gain, if the values are shares of full scale (WAV) or a voltage
    #[arg(long, value_name = "FILE", requires = "calibration_rms", conflicts_with_all = ["unit", "sensitivity"])]
    calibration: Option<PathBuf>,

    /// RMS of the calibrator: "10 m/s2"
    #[arg(long, value_name = "RMS", requires = "calibration")]
    calibration_rms: Option<String>,
}

impl StatedArgs {
    /// Whether anything is stated.
    pub(super) fn is_given(&self) -> bool {
        self.unit.is_some() || self.sensitivity.is_some() || self.calibration.is_some()
    }

    /// As the readers of signals take it.
    ///
    /// # Errors
    /// A recording of a calibrator that cannot be used.
    pub(super) fn stated(&self) -> Result<StatedSignal, Failure> {
        let given = self.calibration.as_ref().zip(self.calibration_rms.as_ref());
        let calibration = given.map(|(file, rms)| Calibration::of(&Selector::of(file), rms)).transpose()?;
        Ok(StatedSignal { unit: self.unit, sensitivity: self.sensitivity, calibration })
    }
}

/// The option `--speed`.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct SpeedArg {
    /// Rig seconds per second, 0.5 to 20; only with --rig virtual:realtime [default: 1]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) speed: Option<f64>,
}

impl SpeedArg {
    /// The address of the rig at this speed.
    ///
    /// # Errors
    /// A speed out of range, or with a rig that has none.
    pub fn apply(self, rig: Address) -> Result<Address, Failure> {
        let Some(number) = self.speed else { return Ok(rig) };
        let Address::RealTime { single, board, .. } = rig else {
            let message =
                format!("--speed {number}: the rig {rig} has its own pace; only --rig virtual:realtime has a speed");
            return Err(Failure::Input(message));
        };
        let speed = Speed::new(number).map_err(|allowed| Failure::Input(format!("--speed {number}: {allowed}")))?;
        Ok(Address::RealTime { single, board, speed })
    }
}

/// Parses a timeout of at least 0.1 s.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    number(text, |s| (0.1..=86_400.0).contains(&s), "of seconds from 0.1 to 86400")
}

/// Parses a duration that may be 0.
pub(super) fn seconds_or_zero(text: &str) -> Result<f64, String> {
    number(text, |s| (0.0..=864_000.0).contains(&s), "of seconds from 0 to 864000")
}

/// Parses a number greater than 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    number(text, |v| v > 0.0, "greater than 0")
}

/// Parses the file of a table.
pub(super) fn table_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).as_deref() {
        Some("csv" | "parquet") => Ok(path),
        Some(other) => Err(format!("the extension .{other} is not supported; use .csv or .parquet")),
        None => Err("the file needs an extension: .csv or .parquet".into()),
    }
}

/// Parses a number of at least 0.
pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |v| v >= 0.0, "0 or greater")
}

fn number(text: &str, is_allowed: impl Fn(f64) -> bool, allowed: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && is_allowed(value) => Ok(value),
        _ => Err(format!("must be a number {allowed}")),
    }
}
