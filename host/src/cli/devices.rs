//! `damprig devices`: the serial ports with what is plugged in, and which of them a board answers at.

use std::str::FromStr;
use std::time::Duration;

use clap::Args as ClapArgs;
use comfy_table::Table;
use comfy_table::presets::UTF8_FULL_CONDENSED;

use super::{Failure, Outcome};
use crate::client::devices::{Answer, Found, only, ports, query};
use crate::client::link::Address;
use crate::settings::read_board;

/// Lists the serial ports and the boards that answer at them.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// Ask at ports that are no USB devices too: whatever is there gets a byte 0 and a question
    #[arg(long)]
    all: bool,

    /// Seconds to wait for an answer at each port
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = super::run::seconds)]
    timeout: f64,
}

/// Runs the subcommand.
///
/// # Errors
/// When the system does not list its ports.
pub fn run(args: &Args) -> Outcome {
    let found = query(ports().map_err(Failure::Failed)?, args.all, Duration::from_secs_f64(args.timeout));
    if found.is_empty() {
        println!("This machine shows no serial port. Without a board: --rig virtual");
        return Ok(());
    }
    println!("{}", table(&found));
    Ok(())
}

fn table(found: &[Found]) -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED).set_header(["--rig", "USB device", "serial number", "who answers"]);
    for f in found {
        let usb = f.port.usb.as_ref();
        table.add_row([
            format!("serial:{}", f.port.path),
            usb.map_or("–".into(), |usb| format!("{:04x}:{:04x} {}", usb.vendor, usb.product, usb.name)),
            usb.map_or("–".into(), |usb| usb.serial_number.clone()),
            match &f.answer {
                Answer::Device { board, firmware, last_crash, complaints, lost_sensors } => {
                    let crash = last_crash.as_ref().map_or(String::new(), |crash| format!("\nlast crash: {crash}"));
                    let counted: String = complaints.iter().map(|what| format!("\nsince it started: {what}")).collect();
                    let lost = match lost_sensors.as_str() {
                        "" => String::new(),
                        names => format!("\nno signal from the sensors: {names}"),
                    };
                    format!("{board}, firmware {firmware}{crash}{counted}{lost}")
                }
                Answer::None(why) => why.clone(),
                Answer::NotAsked => "not asked (no USB device; --all asks)".into(),
            },
        ]);
    }
    table
}

/// The value of `--rig`: a place, or the only board that there is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Rig {
    /// `auto`.
    Auto,
    /// Anything else.
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
    /// Where it is.
    ///
    /// # Errors
    /// `auto`, and there is not exactly one board; a virtual board's settings that cannot be read.
    pub fn find(&self) -> Result<Address, Failure> {
        match self {
            Self::At(address) => {
                if let Address::Virtual { board: Some(board), .. } = address {
                    read_board(board).map_err(|e| Failure::Input(e.to_string()))?;
                }
                Ok(address.clone())
            }
            Self::Auto => {
                only(&query(ports().map_err(Failure::Failed)?, false, Duration::from_secs(1))).map_err(Failure::Input)
            }
        }
    }
}
