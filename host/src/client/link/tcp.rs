//! A rig behind a TCP port: the emulated board, or one on another machine.

use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use super::{Link, is_quiet};

const CONNECT_WAIT: Duration = Duration::from_secs(5);

pub(super) struct Tcp(TcpStream);

impl Tcp {
    pub(super) fn connect(place: &str) -> Result<Self, String> {
        let addresses = place.to_socket_addrs().map_err(|e| format!("{e}; is the host's name right?"))?;
        let mut message = "the name has no address".to_string();
        for address in addresses {
            match TcpStream::connect_timeout(&address, CONNECT_WAIT) {
                Ok(stream) => {
                    // Requests are small and their replies are waited for, so they must not be delayed to be sent together.
                    stream.set_nodelay(true).map_err(|e| e.to_string())?;
                    return Ok(Self(stream));
                }
                Err(error) => message = format!("{error}; is the rig (or the emulator) running and listening there?"),
            }
        }
        Err(message)
    }
}

impl Link for Tcp {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }

    fn receive(&mut self, into: &mut Vec<u8>, wait: Duration) -> io::Result<()> {
        self.0.set_read_timeout(Some(wait.max(Duration::from_millis(1))))?;
        let mut buffer = [0; 65_536];
        match self.0.read(&mut buffer) {
            Ok(0) => Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the other side closed the connection")),
            Ok(count) => {
                into.extend_from_slice(&buffer[..count]);
                Ok(())
            }
            Err(error) if is_quiet(&error) => Ok(()),
            Err(error) => Err(error),
        }
    }
}
