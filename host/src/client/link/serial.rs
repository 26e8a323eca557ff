//! A board at a serial port (the debugger's virtual port of a Nucleo).

use std::io::{self, Read, Write};
use std::path::Path;
use std::time::Duration;

use serialport::{ClearBuffer, SerialPort};

use super::{Link, is_quiet};
pub(super) struct Serial(Box<dyn SerialPort>);

impl Serial {
    pub(super) fn open(path: &Path) -> Result<Self, String> {
        let name = path.to_string_lossy();
        let port = serialport::new(name.as_ref(), damprig_device::outbox::BAUD)
            .timeout(Duration::from_millis(50))
            .open()
            .map_err(|e| format!("{e}{}", candidates(&name)))?;
        // Bytes in transit belong to an earlier session.
        port.clear(ClearBuffer::Input).map_err(|e| e.to_string())?;
        Ok(Self(port))
    }
}

/// The serial ports of this machine, as a hint.
fn candidates(wanted: &str) -> String {
    let ports: Vec<String> =
        serialport::available_ports().unwrap_or_default().into_iter().map(|p| p.port_name).collect();
    if ports.is_empty() {
        return "; this machine shows no serial port: is the board plugged in?".into();
    }
    if ports.iter().any(|port| port == wanted) {
        return "; is it in use, and may you open it (group dialout)?".into();
    }
    format!("; the ports here are {}", ports.join(", "))
}

impl Link for Serial {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }

    fn receive(&mut self, into: &mut Vec<u8>, wait: Duration) -> io::Result<()> {
        self.0.set_timeout(wait).map_err(io::Error::from)?;
        let mut buffer = [0; 4096];
        match self.0.read(&mut buffer) {
            Ok(count) => {
                into.extend_from_slice(&buffer[..count]);
                Ok(())
            }
            Err(error) if is_quiet(&error) => Ok(()),
            Err(error) => Err(error),
        }
    }
}
