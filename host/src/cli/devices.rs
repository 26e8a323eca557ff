//! `damprig devices`: lists serial ports and the boards connected to them.

use std::time::Duration;

use clap::Args as ClapArgs;
use comfy_table::Table;

use super::outcome::{Failure, Outcome};
use crate::client::devices::{Answer, Found, ports, query};
use crate::report::terminal::plain_table;

/// Lists the serial ports and the boards connected to them.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// Also query ports that are not USB devices: sends a zero byte and a request to whatever is connected
    #[arg(long)]
    all: bool,

    /// Time to wait for a reply at each port
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = super::arguments::seconds)]
    timeout: f64,
}

/// Runs the subcommand.
///
/// # Errors
/// The system cannot list its ports.
pub fn run(args: &Args) -> Outcome {
    let found = query(ports().map_err(Failure::Failed)?, args.all, Duration::from_secs_f64(args.timeout));
    if found.is_empty() {
        say!("No serial ports found. To run without a board, use --rig virtual");
        return Ok(());
    }
    say!("{}", table(&found));
    Ok(())
}

fn table(found: &[Found]) -> Table {
    let mut table = plain_table(&["--rig", "USB device", "serial number", "board"]);
    for f in found {
        let usb = f.port.usb.as_ref();
        table.add_row([
            format!("serial:{}", f.port.path),
            usb.map_or("–".into(), |usb| format!("{:04x}:{:04x} {}", usb.vendor, usb.product, usb.name)),
            usb.map_or("–".into(), |usb| usb.serial_number.clone()),
            match &f.answer {
                Answer::Device { board, firmware, last_crash, complaints, lost_sensors, warnings } => {
                    let crash = last_crash.as_ref().map_or(String::new(), |crash| format!("\nlast crash: {crash}"));
                    let counted: String = complaints.iter().map(|what| format!("\nsince its start: {what}")).collect();
                    let lost = match lost_sensors.as_str() {
                        "" => String::new(),
                        names => format!("\nsensors without signal: {names}"),
                    };
                    let warnings: String = warnings.iter().map(|what| format!("\nwarning: {what}")).collect();
                    format!("{board}, firmware {firmware}{crash}{counted}{lost}{warnings}")
                }
                Answer::None(why) => why.clone(),
                Answer::NotAsked => "not queried (not a USB device; use --all)".into(),
            },
        ]);
    }
    table
}
