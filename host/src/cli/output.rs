//! Standard output and standard error of the command.
//!
//! Output never decides whether work is done: an error of standard output is kept in mind until the work is over. A full one
//! then gives the exit code; a reader that wanted no more is no failure. `damprig … | head` saves, stops the rig and completes
//! its files like any other call.

use std::io::{Error, ErrorKind, Write, stderr, stdout};
use std::process::ExitCode;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

use crate::failure::{Failure, Outcome};
use crate::input::shown;

/// The first error of standard output.
static FAILED: OnceLock<Error> = OnceLock::new();

/// What is printed to standard output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OutputLines {
    /// All.
    All,
    /// The places of results: `--quiet`.
    Places,
    /// One answer for programs: `--json`.
    Json,
}

static LINES: AtomicU8 = AtomicU8::new(OutputLines::All as u8);

fn is(lines: OutputLines) -> bool {
    LINES.load(Ordering::Relaxed) == lines as u8
}

/// Leaves out all lines from now on, but the places of results.
pub(super) fn be_quiet() {
    LINES.store(OutputLines::Places as u8, Ordering::Relaxed);
}

/// Whether [`be_quiet`] was called.
pub(super) fn is_quiet() -> bool {
    is(OutputLines::Places)
}

/// Prints a line to standard output, what controls a terminal spelled out, unless the command is to be quiet or prints JSON; nothing more
/// after an error.
pub fn print(line: &str) {
    if is(OutputLines::All) {
        write_line(line);
    }
}

/// Prints where a result is, with `--quiet` too; not beside JSON.
pub(super) fn print_place(line: &str) {
    if !is(OutputLines::Json) {
        write_line(line);
    }
}

/// Prints an answer as JSON, and no line from now on.
///
/// # Errors
/// A defect of the answer.
pub(super) fn print_json(answer: &impl serde::Serialize) -> Outcome {
    LINES.store(OutputLines::Json as u8, Ordering::Relaxed);
    write_line(&serde_json::to_string(answer)?);
    Ok(())
}

fn write_line(line: &str) {
    if FAILED.get().is_none()
        && let Err(error) = writeln!(stdout(), "{}", shown(line))
    {
        let _ = FAILED.set(error);
    }
}

/// Prints a question, without ending the line.
pub(super) fn prompt(question: &str) {
    // Nobody can answer what is not seen; the reader of the answer notices the closed terminal.
    let _ = write!(stdout(), "{}", shown(question)).and_then(|()| stdout().flush());
}

/// Prints a help text, the version, or what is wrong with the command line; gives the exit code.
pub(super) fn print_help(text: &clap::Error) -> ExitCode {
    print_text(text);
    if text.use_stderr() { ExitCode::from(2) } else { finish() }
}

/// Prints a help text, the version, or what is wrong with the command line.
pub(super) fn print_text(text: &clap::Error) {
    if let Err(error) = text.print()
        && !text.use_stderr()
    {
        let _ = FAILED.set(error);
    }
}

/// Prints a line to standard error, as [`print()`] does. Nobody can be told when that fails.
pub fn print_error(line: &str) {
    let _ = writeln!(stderr(), "{}", shown(line));
}

/// The exit code of a command whose work has succeeded: that of a failure when its output could not be written.
pub(super) fn finish() -> ExitCode {
    if FAILED.get().is_none()
        && let Err(error) = stdout().flush()
    {
        let _ = FAILED.set(error);
    }
    match FAILED.get() {
        None => ExitCode::SUCCESS,
        // The reader wanted no more, as `head` does.
        Some(error) if error.kind() == ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Some(error) => {
            report(&Failure::Failed(format!("the work is done, but standard output could not be written: {error}")))
        }
    }
}

/// Prints the message of a failure to standard error and gives its exit code.
pub(super) fn report(failure: &Failure) -> ExitCode {
    warn!("error: {failure}");
    ExitCode::from(failure.exit_code())
}
