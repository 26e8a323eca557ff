//! Serial line of the emulated board as a TCP port; a client takes the place of the host on the debugger's cable.
//!
//! Device time and host time are separate clocks. The board runs in steps of [`STEP`] and exchanges bytes between them.
//! It sleeps whenever device time exceeds `pace` times the host time since the start, so that time-outs on both sides
//! keep their meaning. A board that cannot keep up falls behind and does not catch up later. Bytes arrive and leave at
//! the line's baud rate in device time. A host that does not read stops the board, as flow control would. Without a
//! host, sent bytes are lost.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::board::{Board, Failure};
use crate::time::Time;

/// Device time between two exchanges of bytes.
pub const STEP: Time = Time::from_ms(1);

/// A delay longer than this is dropped from the pace.
const MAX_BEHIND: Duration = Duration::from_millis(100);

/// Reason why the service ended.
#[derive(Debug, thiserror::Error)]
pub enum Ended {
    /// The program did something that is not modelled or not allowed.
    #[error(transparent)]
    Failed(#[from] Failure),
    /// An error of the TCP port.
    #[error("the board's port: {0}")]
    Port(#[from] io::Error),
}

/// Runs the board behind a TCP port, at most `pace` device seconds per second, until `stop` is set. `each_step` is
/// called with the board after every step, for example to press a switch or to observe it.
///
/// # Errors
/// The board failed, or the port did.
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

/// Limits the speed of device time relative to host time.
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
        } else if passed - due > MAX_BEHIND {
            *self = Self::new(self.pace, now);
        }
    }
}
