//! `damprig devices`: lists serial ports and the boards connected to them, or the board at one address.

use std::time::Duration;

use clap::Args;
use comfy_table::Table;
use serde_json::{Value, json};

use super::arguments::{JsonArg, Rig};
use crate::client::devices::{PortAnswer, Usb, ask, ports, query};
use crate::client::link::Address;
use crate::failure::{Failure, Outcome};
use crate::report::terminal::plain_table;

/// Lists the serial ports and the boards connected to them, or the board at one address.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct DevicesArgs {
    /// Query this rig alone: serial:PATH, tcp:HOST:PORT, auto (the only connected board), virtual or virtual:BOARD.toml. Nothing
    /// moves
    #[arg(long, value_name = "RIG", conflicts_with = "all")]
    rig: Option<Rig>,

    /// Also query ports that are not USB devices: sends a zero byte and a request to whatever is connected
    #[arg(long)]
    all: bool,

    /// Time to wait for a reply at each port
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = super::arguments::seconds)]
    timeout: f64,

    #[command(flatten)]
    json: JsonArg,
}

const AFTER_HELP: &str = "\
Examples:
  damprig devices
  damprig devices --rig tcp:rig-pc:4000
  damprig devices --rig serial:/dev/ttyACM0 --timeout 5
  damprig devices --json                      a list, an object for each port

Of a board it says which settings act: where they come from, and the board's limits. If saved
settings do not act (damaged, of another layout), the board drives only with
`damprig run --accept-settings`.

Exit codes:
  0    the ports were listed, whether a board answers or not; with --rig: the board answers
  1    the ports cannot be listed; with --rig: no board answers there
  2    the command line is wrong";

/// Runs the subcommand.
///
/// # Errors
/// The system cannot list its ports; nothing answers at the address of `--rig`.
pub fn run(args: &DevicesArgs) -> Outcome {
    let timeout = Duration::from_secs_f64(args.timeout);
    let found: Vec<(Address, Option<Usb>, PortAnswer)> = if let Some(rig) = &args.rig {
        let address = rig.find()?;
        let answer = ask(&address, timeout)?;
        let usb = usb_behind(&address);
        vec![(address, usb, answer)]
    } else {
        let found = query(ports().map_err(Failure::Failed)?, args.all, timeout);
        found.into_iter().map(|f| (Address::Serial(f.port.path.into()), f.port.usb, f.answer)).collect()
    };
    if args.json.is_given() {
        let all: Vec<Value> =
            found.iter().map(|(address, usb, answer)| as_json(address, usb.as_ref(), answer)).collect();
        say!("{}", Value::Array(all));
        return Ok(());
    }
    if found.is_empty() {
        say!("No serial ports found. To run without a board, use --rig virtual");
        return Ok(());
    }
    let mut table = plain_table(&["--rig", "USB device", "serial number", "board"]);
    found.iter().for_each(|(address, usb, answer)| add(&mut table, address, usb.as_ref(), answer));
    say!("{table}");
    Ok(())
}

/// A port for programs. Of a port where no board answers, `board` is null and `why` says why.
fn as_json(address: &Address, usb: Option<&Usb>, answer: &PortAnswer) -> Value {
    let usb = usb.map(|usb| {
        json!({ "vendor": usb.vendor, "product": usb.product, "name": usb.name, "serial_number": usb.serial_number })
    });
    let (board, why) = match answer {
        PortAnswer::Device { board, firmware, settings, last_crash, complaints, lost_sensors, warnings } => {
            let board = json!({
                "name": board,
                "firmware": firmware,
                "settings": settings,
                "last_crash": last_crash,
                "since_its_start": complaints,
                "sensors_without_signal": lost_sensors,
                "warnings": warnings,
            });
            (Some(board), None)
        }
        PortAnswer::None(why) => (None, Some(why.as_str())),
        PortAnswer::NotAsked => (None, Some(NOT_ASKED)),
    };
    json!({ "rig": address.to_string(), "usb": usb, "board": board, "why": why })
}

/// Why a port was not asked.
const NOT_ASKED: &str = "not queried (not a USB device; use --all)";

/// The USB device of a serial port of this machine.
fn usb_behind(address: &Address) -> Option<Usb> {
    let Address::Serial(path) = address else { return None };
    ports().ok()?.into_iter().find(|port| path.as_os_str() == port.path.as_str())?.usb
}

fn add(table: &mut Table, address: &Address, usb: Option<&Usb>, answer: &PortAnswer) {
    table.add_row([
        address.to_string(),
        usb.map_or("–".into(), |usb| format!("{:04x}:{:04x} {}", usb.vendor, usb.product, usb.name)),
        usb.map_or("–".into(), |usb| usb.serial_number.clone()),
        match answer {
            PortAnswer::Device { board, firmware, settings, last_crash, complaints, lost_sensors, warnings } => {
                let crash = last_crash.as_ref().map_or(String::new(), |crash| format!("\nlast crash: {crash}"));
                let counted: String = complaints.iter().map(|what| format!("\nsince its start: {what}")).collect();
                let lost = match lost_sensors.as_str() {
                    "" => String::new(),
                    names => format!("\nsensors without signal: {names}"),
                };
                let warnings: String = warnings.iter().map(|what| format!("\nwarning: {what}")).collect();
                format!("{board}, firmware {firmware}\nsettings {settings}{crash}{counted}{lost}{warnings}")
            }
            PortAnswer::None(why) => why.clone(),
            PortAnswer::NotAsked => NOT_ASKED.into(),
        },
    ]);
}
