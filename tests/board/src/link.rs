//! The board's serial line as a TCP port: what connects is what is plugged in at the other end of the debugger's cable.
//!
//! Device time and the host's time are two clocks. The board runs ahead in steps of [`STEP`], exchanges bytes, and sleeps
//! whenever its clock is further than `pace` times the time that has passed on the host's clock since it was started, so
//! that the time-outs on both sides mean what they say; a board that cannot keep up is late and does not hurry afterwards.
//! Bytes arrive and leave at the line's baud rate in device time. A host that does not read holds the board up, as flow
//! control would; without a host what is sent is lost.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::board::{Board, Failure};
use crate::time::Time;

/// Device time between two exchanges of bytes.
pub const STEP: Time = Time::from_ms(1);

/// How far behind its pace the board may fall before the delay is forgotten.
const MOST_BEHIND: Duration = Duration::from_millis(100);

/// What ended the service.
#[derive(Debug, thiserror::Error)]
pub enum Ended {
    /// The program did something that is not modelled or not allowed.
    #[error(transparent)]
    Failed(#[from] Failure),
    /// The port.
    #[error("the board's port: {0}")]
    Port(#[from] io::Error),
}

/// Runs the board behind a port, `pace` device seconds a second at most, until `stop` is set. `each_step` sees the board after
/// every step: to press a switch, to watch.
///
/// # Errors
/// The board's failure, or the port's.
pub fn serve(
    board: &mut Board,
    listener: &TcpListener,
    pace: f64,
    stop: &AtomicBool,
    mut each_step: impl FnMut(&mut Board),
) -> Result<(), Ended> {
    listener.set_nonblocking(true)?;
    let mut host: Option<TcpStream> = None;
    let mut clock = Pace::new(pace, board.now());
    let mut bytes = [0; 4096];
    while !stop.load(Ordering::Relaxed) {
        if host.is_none()
            && let Ok((stream, _)) = listener.accept()
        {
            stream.set_nodelay(true)?;
            stream.set_nonblocking(true)?;
            host = Some(stream);
        }
        if let Some(stream) = &mut host {
            match stream.read(&mut bytes) {
                Ok(0) => host = None,
                Ok(count) => board.chip_mut().host_sends(&bytes[..count]),
                Err(error) if is_quiet(&error) => {}
                Err(_) => host = None,
            }
        }
        board.run_until(board.now() + STEP)?;
        each_step(board);
        let sent = board.chip_mut().take_sent();
        if let Some(stream) = &mut host
            && !sent.is_empty()
        {
            stream.set_nonblocking(false)?;
            if stream.write_all(&sent).is_err() {
                host = None;
            } else {
                stream.set_nonblocking(true)?;
            }
        }
        clock.keep(board.now());
    }
    Ok(())
}

fn is_quiet(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}

/// Keeps device time from running away from the host's.
struct Pace {
    pace: f64,
    device: Time,
    host: Instant,
}

impl Pace {
    fn new(pace: f64, device: Time) -> Self {
        Self { pace, device, host: Instant::now() }
    }

    fn keep(&mut self, now: Time) {
        let due = Duration::from_secs_f64(now.since(self.device).s() / self.pace);
        let passed = self.host.elapsed();
        if due > passed {
            std::thread::sleep(due - passed);
        } else if passed - due > MOST_BEHIND {
            *self = Self::new(self.pace, now);
        }
    }
}
