//! Finds boards: the serial ports of this machine, their USB devices, and which of them answer.
//!
//! Only ports of USB devices are queried by default: unexpected bytes may have any effect on another device.

use std::time::Duration;

use damprig_protocol::Counters;
use serialport::{SerialPortType, UsbPortInfo};

use crate::client::board_check;
use crate::client::controller::Controller;
use crate::client::link::Address;
use crate::client::session::{Session, SessionError};

/// A serial port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// Its path, as `/dev/ttyACM0`.
    pub path: String,
    /// The USB device behind it, if it is one.
    pub usb: Option<Usb>,
}

/// Identification of a USB device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Usb {
    /// Vendor's number.
    pub vendor: u16,
    /// The vendor's number of the product.
    pub product: u16,
    /// Manufacturer and product in words.
    pub name: String,
    /// Serial number; empty when it has none.
    pub serial_number: String,
}

/// What a port answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortAnswer {
    /// A device of ours.
    Device {
        /// Its board.
        board: String,
        /// Its firmware's version.
        firmware: String,
        /// Where its settings come from, and its limits.
        settings: String,
        /// What ended an earlier run of its firmware.
        last_crash: Option<String>,
        /// Its non-zero error counts since its start, in words.
        complaints: Vec<String>,
        /// Names of the sensors without a signal: not connected or not supplied; empty for none.
        lost_sensors: String,
        /// Wrong option bytes and a wrong supply, in words.
        warnings: Vec<String>,
    },
    /// No device of ours: the error, in words.
    None(String),
    /// It was not queried: no USB device.
    NotAsked,
}

/// A port and what it answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AnsweringPort {
    /// The port.
    pub port: Port,
    /// What it answered.
    pub answer: PortAnswer,
}

/// The serial ports of this machine, by name.
///
/// # Errors
/// The system's error when it does not list them.
pub fn ports() -> Result<Vec<Port>, String> {
    let all = serialport::available_ports().map_err(|e| format!("the system cannot list its serial ports: {e}"))?;
    let mut ports: Vec<Port> = all
        .into_iter()
        .map(|port| Port {
            path: port.port_name,
            usb: if let SerialPortType::UsbPort(usb) = port.port_type { Some(identity(usb)) } else { None },
        })
        .collect();
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(ports)
}

fn identity(usb: UsbPortInfo) -> Usb {
    let name = [usb.manufacturer, usb.product].into_iter().flatten().collect::<Vec<_>>().join(" ");
    Usb { vendor: usb.vid, product: usb.pid, name, serial_number: usb.serial_number.unwrap_or_default() }
}

/// What the device at an address answers.
///
/// # Errors
/// It cannot be reached, is silent, or has another protocol.
pub fn ask(address: &Address, timeout: Duration) -> Result<PortAnswer, SessionError> {
    let mut session = Session::open(address, timeout)?;
    let status = session.status();
    Ok(PortAnswer::Device {
        lost_sensors: status.as_ref().map_or(String::new(), |(status, _)| status.sensors.lost.to_string()),
        complaints: status.map_or_else(|e| vec![e.to_string()], |(_, now)| complaints(&now)),
        board: session.identity.board.to_string(),
        firmware: session.identity.firmware.to_string(),
        settings: session.settings_text(),
        last_crash: session.description.last_crash.map(|crash| crash.to_string()),
        warnings: board_check::warnings(&session),
    })
}

/// Queries ports, each for at most `timeout`: all of them, or only those of USB devices.
#[must_use]
pub fn query(ports: Vec<Port>, all: bool, timeout: Duration) -> Vec<AnsweringPort> {
    let one = |port: Port| {
        if port.usb.is_none() && !all {
            return AnsweringPort { port, answer: PortAnswer::NotAsked };
        }
        let asked = ask(&Address::Serial((&port.path).into()), timeout);
        let answer = asked.unwrap_or_else(|error| PortAnswer::None(error.to_string()));
        AnsweringPort { port, answer }
    };
    ports.into_iter().map(one).collect()
}

/// A board's non-zero error counts since its start, in words.
#[must_use]
pub fn complaints(counters: &Counters) -> Vec<String> {
    Controller::between(&Counters::default(), counters).complaints()
}

/// The only device that answered.
///
/// # Errors
/// None or several: lists them, and what to write.
pub fn only(found: &[AnsweringPort]) -> Result<Address, String> {
    let devices: Vec<(&AnsweringPort, &str)> = found
        .iter()
        .filter_map(|f| if let PortAnswer::Device { board, .. } = &f.answer { Some((f, board.as_str())) } else { None })
        .collect();
    match devices[..] {
        [(only, _)] => Ok(Address::Serial((&only.port.path).into())),
        [] => {
            let silent: Vec<String> = found
                .iter()
                .filter_map(|f| match &f.answer {
                    PortAnswer::None(why) => Some(format!("\n  {}: {why}", f.port.path)),
                    _ => None,
                })
                .collect();
            let hint = if silent.is_empty() { "; is the board plugged in?" } else { "" };
            Err(format!(
                "--rig auto: no board answers at a USB serial port{hint}{}\n  `damprig devices` lists what is there; without a board: --rig virtual",
                silent.concat()
            ))
        }
        _ => {
            let list: Vec<String> = devices
                .iter()
                .map(|(f, board)| {
                    let number = f.port.usb.as_ref().map_or("", |usb| usb.serial_number.as_str());
                    format!("\n  --rig serial:{}   {board} {number}", f.port.path)
                })
                .collect();
            Err(format!("--rig auto: {} boards answer; say which:{}", devices.len(), list.concat()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(path: &str, answer: PortAnswer) -> AnsweringPort {
        let usb = Usb {
            vendor: 0x0483,
            product: 0x374e,
            name: "STMicroelectronics STLINK-V3".into(),
            serial_number: path.into(),
        };
        AnsweringPort { port: Port { path: path.into(), usb: Some(usb) }, answer }
    }

    fn device(path: &str) -> AnsweringPort {
        found(
            path,
            PortAnswer::Device {
                board: "nucleo".into(),
                firmware: "0.1.0".into(),
                settings: String::new(),
                last_crash: None,
                complaints: vec![],
                lost_sensors: String::new(),
                warnings: vec![],
            },
        )
    }

    #[test]
    fn the_only_board_is_taken_whatever_else_is_plugged_in() {
        let all = [found("/dev/ttyUSB0", PortAnswer::None("silent".into())), device("/dev/ttyACM0")];
        assert_eq!(only(&all).unwrap().to_string(), "serial:/dev/ttyACM0");
    }

    #[test]
    fn several_boards_are_listed_as_they_are_to_be_written() {
        let text = only(&[device("/dev/ttyACM0"), device("/dev/ttyACM1")]).unwrap_err();
        assert!(text.contains("2 boards answer") && text.contains("--rig serial:/dev/ttyACM1   nucleo"), "{text}");
    }

    #[test]
    fn without_a_board_each_port_says_why() {
        let text = only(&[found("/dev/ttyUSB0", PortAnswer::None("it is in use".into()))]).unwrap_err();
        assert!(text.contains("/dev/ttyUSB0: it is in use") && text.contains("damprig devices"), "{text}");
        assert!(only(&[]).unwrap_err().contains("is the board plugged in?"));
    }
}
