//! Lines that a person types at the terminal, without waiting for them longer than the program goes on.

use std::io;
use std::time::Duration;

/// Forgets what was typed before a question: it is no answer, and an answer may start the drive.
#[cfg(unix)]
pub(super) fn forget_typed() {
    let _ = rustix::termios::tcflush(io::stdin(), rustix::termios::QueueSelector::IFlush);
}

#[cfg(not(unix))]
pub(super) fn forget_typed() {}

/// A typed line with its end; empty at the end of input; none once `goes_on` says no. Byte by byte, so that nothing that follows
/// is kept for the next question.
#[cfg(unix)]
pub(super) fn typed_line(goes_on: impl Fn() -> bool) -> io::Result<Option<String>> {
    let (mut line, mut byte) = (Vec::new(), [0]);
    while line.last() != Some(&b'\n') {
        if !goes_on() {
            return Ok(None);
        }
        if !is_readable(TURN) {
            continue;
        }
        match rustix::io::read(io::stdin(), &mut byte) {
            Ok(0) => break,
            Ok(_) => line.push(byte[0]),
            Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(Some(String::from_utf8_lossy(&line).into_owned()))
}

#[cfg(not(unix))]
pub(super) fn typed_line(goes_on: impl Fn() -> bool) -> io::Result<Option<String>> {
    let mut line = String::new();
    io::stdin().read_line(&mut line)?;
    Ok(goes_on().then_some(line))
}

/// Whether a line was typed at a terminal within `time`; waits for as long as that.
#[cfg(unix)]
pub(super) fn has_typed_line(time: Duration) -> bool {
    use std::io::IsTerminal;
    if !io::stdin().is_terminal() {
        std::thread::sleep(time);
        return false;
    }
    is_readable(time) && typed_line(|| true).is_ok()
}

#[cfg(not(unix))]
pub(super) fn has_typed_line(time: Duration) -> bool {
    std::thread::sleep(time);
    false
}

/// Time between two looks whether the program goes on.
#[cfg(unix)]
const TURN: Duration = Duration::from_millis(50);

/// Whether there is input, or its end; waits for `time` at most.
#[cfg(unix)]
fn is_readable(time: Duration) -> bool {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let stdin = io::stdin();
    let mut all = [PollFd::new(&stdin, PollFlags::IN)];
    let time = Timespec { tv_sec: time.as_secs() as i64, tv_nsec: i64::from(time.subsec_nanos()) };
    matches!(poll(&mut all, Some(&time)), Ok(count) if count > 0)
}
