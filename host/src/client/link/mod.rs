//! Byte links to a rig: in-process, TCP and serial.

mod real_time;
mod serial;
mod tcp;
mod virtual_rig;

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use crate::settings::read_board;
use real_time::RealTimeRig;
pub use real_time::{Cable, Speed, cable};
pub use virtual_rig::VirtualRig;

/// A two-way stream of bytes.
pub trait Link: Send {
    /// Sends all bytes.
    ///
    /// # Errors
    /// When the link is broken.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Appends what has arrived; waits for at most `wait` when there is nothing.
    ///
    /// # Errors
    /// When the link is broken. Nothing within `wait` is no error.
    fn receive(&mut self, into: &mut Vec<u8>, wait: Duration) -> io::Result<()>;
}

/// A closed link: its port is free for other users.
#[derive(Clone, Copy, Debug)]
pub struct Closed;

impl Link for Closed {
    fn send(&mut self, _: &[u8]) -> io::Result<()> {
        Err(io::ErrorKind::NotConnected.into())
    }

    fn receive(&mut self, _: &mut Vec<u8>, _: Duration) -> io::Result<()> {
        Err(io::ErrorKind::NotConnected.into())
    }
}

/// Where a rig is: the value of `--rig`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// In this process, simulated in double or single precision.
    Virtual {
        /// `f32`, to compare with a board bit for bit.
        single: bool,
        /// File of the board's settings, as `damprig settings export` writes it; default settings without one.
        board: Option<PathBuf>,
    },
    /// In this process, simulated at the pace of the wall clock: a board with its own clock.
    RealTime {
        /// `f32`.
        single: bool,
        /// File of the board's settings; default settings without one.
        board: Option<PathBuf>,
        /// Rig seconds per second. It has an option of its own and is no part of the text of the address.
        speed: Speed,
    },
    /// `HOST:PORT`.
    Tcp(String),
    /// A serial port.
    Serial(PathBuf),
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Virtual { single, board } => {
                f.write_str(if *single { "virtual:f32" } else { "virtual" })?;
                let Some(board) = board else { return Ok(()) };
                write!(f, "{}{}", if *single { "," } else { ":" }, board.display())
            }
            Self::RealTime { single, board, .. } => {
                f.write_str(if *single { "virtual:realtime,f32" } else { "virtual:realtime" })?;
                board.iter().try_for_each(|board| write!(f, ",{}", board.display()))
            }
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::Serial(path) => write!(f, "serial:{}", path.display()),
        }
    }
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "virtual" => Ok(Self::VIRTUAL),
            Some(("virtual", "realtime")) => Ok(Self::REAL_TIME),
            Some(("virtual", rest)) => match rest.strip_prefix("realtime,") {
                Some(rest) => {
                    virtual_board(rest).map(|(single, board)| Self::RealTime { single, board, speed: Speed::REAL_TIME })
                }
                None => virtual_board(rest).map(|(single, board)| Self::Virtual { single, board }),
            },
            Some(("tcp", address)) => match address.rsplit_once(':') {
                Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok_and(|p| p > 0) => {
                    Ok(Self::Tcp(address.to_string()))
                }
                _ => Err("write tcp:HOST:PORT with a port from 1 to 65535".into()),
            },
            Some(("serial", path)) if !path.is_empty() => Ok(Self::Serial(path.into())),
            _ => Err(ALLOWED.into()),
        }
    }
}

const ALLOWED: &str = "must be virtual, virtual:f32, virtual:BOARD.toml, virtual:f32,BOARD.toml, virtual:realtime (also with ,f32 and \
     ,BOARD.toml), tcp:HOST:PORT or serial:PATH";

/// `f32`, `BOARD.toml`, or both with a comma between them: whether it is in single precision, and the file.
fn virtual_board(text: &str) -> Result<(bool, Option<PathBuf>), String> {
    let (precision, board) = match text.split_once(',') {
        Some((precision, board)) => (Some(precision), Some(board)),
        None if matches!(text, "f32" | "f64") => (Some(text), None),
        None => (None, Some(text)),
    };
    let is_file = |name: &str| Path::new(name).extension().is_some_and(|extension| extension == "toml");
    if precision.is_some_and(|word| !matches!(word, "f32" | "f64")) || board.is_some_and(|name| !is_file(name)) {
        return Err(ALLOWED.into());
    }
    Ok((precision == Some("f32"), board.map(PathBuf::from)))
}

impl Address {
    /// The virtual rig in double precision with default settings.
    pub const VIRTUAL: Self = Self::Virtual { single: false, board: None };

    /// The virtual rig at wall-clock pace, in double precision with default settings.
    pub const REAL_TIME: Self = Self::RealTime { single: false, board: None, speed: Speed::REAL_TIME };

    /// The settings file of a virtual board.
    #[must_use]
    pub fn board(&self) -> Option<&Path> {
        match self {
            Self::Virtual { board, .. } | Self::RealTime { board, .. } => board.as_deref(),
            Self::Tcp(_) | Self::Serial(_) => None,
        }
    }

    /// Rig seconds per second of the wall clock, for a rig with its own clock.
    #[must_use]
    pub fn speed(&self) -> Speed {
        if let Self::RealTime { speed, .. } = self { *speed } else { Speed::REAL_TIME }
    }
}

/// A link that cannot be opened.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot reach the rig at {address}: {message}")]
pub struct Unreachable {
    address: String,
    message: String,
}

/// Opens the link to a rig.
///
/// # Errors
/// Names the address, the cause, and what to check.
pub fn open(address: &Address) -> Result<Box<dyn Link>, Unreachable> {
    let failed = |message: String| Unreachable { address: address.to_string(), message };
    let settings = address.board().map(read_board).transpose().map_err(|refusal| failed(refusal.to_string()))?;
    Ok(match address {
        Address::Virtual { single, .. } => Box::new(VirtualRig::new(*single, settings.as_ref())),
        Address::RealTime { single, speed, .. } => {
            Box::new(RealTimeRig::connect(address, *single, *speed, settings.as_ref()).map_err(failed)?)
        }
        Address::Tcp(place) => Box::new(tcp::Tcp::connect(place).map_err(failed)?),
        Address::Serial(path) => Box::new(serial::Serial::open(path).map_err(failed)?),
    })
}

/// Whether an error only means that nothing arrived in time.
fn is_quiet(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_read_back_as_written() {
        let boards = ["virtual:board.toml", "virtual:f32,my/board.toml"];
        for text in boards.into_iter().chain([
            "virtual",
            "virtual:f32",
            "virtual:realtime",
            "virtual:realtime,f32",
            "virtual:realtime,board.toml",
            "virtual:realtime,f32,my/board.toml",
            "tcp:127.0.0.1:4000",
            "tcp:[::1]:4000",
            "serial:/dev/ttyACM0",
        ]) {
            assert_eq!(text.parse::<Address>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn a_wrong_address_is_refused_with_what_is_allowed() {
        for text in [
            "",
            "usb",
            "tcp:nowhere",
            "tcp::1",
            "tcp:host:0",
            "tcp:host:99999",
            "serial:",
            "virtual:f16",
            "virtual:f16,a.toml",
            "virtual:realtime,",
            "virtual:realtime,f16",
            "virtual:realtimef32",
            "virtual:f32,realtime",
        ] {
            let answer = text.parse::<Address>().unwrap_err();
            assert!(answer.contains("tcp:HOST:PORT"), "{text}: {answer}");
        }
    }
}
