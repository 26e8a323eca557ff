//! The `damprig` command line: one subcommand a file.
//!
//! To add one: a file with its clap `Args` and a function that returns [`Outcome`], and a line each in
//! `Command` and [`main`]. What the subcommands do is the library's; here are flags, words and exit codes.

/// Prints a line. When nobody reads any more (`| head`), what runs goes on all the same: it has a rig to stop.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}

/// As `say!`, where errors go.
macro_rules! warn {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

mod devices;
#[cfg(feature = "probe")]
mod flash;
#[cfg(feature = "probe")]
mod log;
mod output_paths;
mod progress;
mod run;
mod runs;
mod settings;
mod simulate;

#[cfg(not(feature = "probe"))]
mod without_probe;

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{Parser, Subcommand};

/// Runs, records and reports experiments on a vibration-damper rig, real or virtual.
#[derive(Debug, Parser)]
#[command(name = "damprig", version, propagate_version = true, after_help = AFTER_HELP, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const AFTER_HELP: &str = "\
Examples:
  damprig run host/campaigns/hybrid.toml                     on the virtual rig
  damprig run host/campaigns/short.toml --rig tcp:127.0.0.1:4000
  damprig runs                                           what has been run
  damprig simulate host/cases/spid.toml --plot spid.png
  damprig help run

Exit codes:
  0    done
  1    it could not be done: the rig, the link or the disk; what was taken is kept
  2    the command line or a file is wrong; nothing has moved
  130  interrupted (Ctrl-C, or asked to terminate); the rig was stopped, what was taken is kept";

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a campaign and record it in a run folder
    Run(run::Args),
    /// List the serial ports and the boards that answer
    Devices(devices::Args),
    /// List, show, verify and export run folders
    Runs(runs::Args),
    /// Show, change, save and copy a board's settings
    Settings(settings::Args),
    /// Simulate a case exactly
    Simulate(simulate::Args),
    /// Put an image on the controller board
    #[cfg(feature = "probe")]
    Flash(flash::Args),
    /// Show what the controller's firmware says
    #[cfg(feature = "probe")]
    Log(log::Args),
    /// Put an image on the controller board (not in this build)
    #[cfg(not(feature = "probe"))]
    #[command(hide = true)]
    Flash(without_probe::Args),
    /// Show what the controller's firmware says (not in this build)
    #[cfg(not(feature = "probe"))]
    #[command(hide = true)]
    Log(without_probe::Args),
}

/// Why a subcommand did not succeed: the words, and the exit code that goes with them.
#[derive(Debug)]
pub enum Failure {
    /// The command line or a file is wrong (exit code 2).
    Input(String),
    /// It could not be done (exit code 1).
    Failed(String),
    /// Ctrl-C (exit code 130).
    Interrupted(String),
}

/// How a subcommand ends.
pub type Outcome = Result<(), Failure>;

/// Parses the command line and does what it says.
#[must_use]
pub fn main() -> ExitCode {
    let command = Cli::parse().command;
    // A file beyond the limit of the system (`ulimit -f`) then fails as on a full disk: with words, and the rig is stopped.
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    if !matches!(command, Command::Run(_)) {
        // `damprig runs show … | head` ends quietly. A run must not: it has a rig to stop.
        sigpipe::reset();
    }
    let outcome = match command {
        Command::Run(args) => run::run(&args),
        Command::Devices(args) => devices::run(&args),
        Command::Runs(args) => runs::run(&args),
        Command::Settings(args) => settings::run(&args),
        #[cfg(feature = "probe")]
        Command::Flash(args) => flash::run(&args),
        #[cfg(feature = "probe")]
        Command::Log(args) => log::run(&args),
        #[cfg(not(feature = "probe"))]
        Command::Flash(args) => without_probe::run("flash", &args),
        #[cfg(not(feature = "probe"))]
        Command::Log(args) => without_probe::run("log", &args),
        Command::Simulate(args) => simulate::run(&args),
    };
    let (code, message) = match outcome {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Failed(message)) => (1, message),
        Err(Failure::Input(message)) => (2, message),
        Err(Failure::Interrupted(message)) => (130, message),
    };
    warn!("error: {message}");
    ExitCode::from(code)
}

/// The first Ctrl-C (or, on Unix, request to terminate) asks for an orderly end, the second ends the program at once.
fn watch_for_ctrl_c(stop: &Arc<AtomicBool>) -> Outcome {
    #[cfg(unix)]
    watch_other_signals(stop).map_err(|e| Failure::Failed(format!("cannot watch for signals: {e}")))?;
    let stop = Arc::clone(stop);
    let handler = move || {
        if stop.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    };
    ctrlc::set_handler(handler).map_err(|e| Failure::Failed(format!("cannot watch for Ctrl-C: {e}")))
}

#[cfg(unix)]
fn watch_other_signals(stop: &Arc<AtomicBool>) -> std::io::Result<()> {
    use signal_hook::consts::SIGTERM;
    use signal_hook::flag::{register, register_conditional_shutdown};
    register_conditional_shutdown(SIGTERM, 130, Arc::clone(stop))?;
    register(SIGTERM, Arc::clone(stop))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    #[test]
    fn the_command_line_is_sound() {
        super::Cli::command().debug_assert();
    }

    /// Commands in a text: in backticks, or on lines of their own.
    fn commands(text: &str) -> Vec<&str> {
        let quoted = text.split('`').skip(1).step_by(2);
        let lines = text.lines().map(|line| line.split(" # ").next().unwrap_or(line));
        let lines = lines.map(|line| line.split("   ").find(|part| !part.is_empty()).unwrap_or(""));
        let all = quoted.filter(|span| !span.contains('\n')).chain(lines).map(str::trim);
        // `a|b` stands for several.
        all.filter(|command| command.starts_with("damprig ") && !command.contains(['|', '…'])).collect()
    }

    #[test]
    fn every_command_of_the_documents_is_one_that_there_is() {
        let top = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        for (document, least) in [("README.md", 5), ("firmware/README.md", 5), ("host/RUN_FOLDER.md", 3)] {
            let text = std::fs::read_to_string(top.join(document)).expect("a document of the project");
            let commands = commands(&text);
            assert!(commands.len() >= least, "{document}: {commands:?}");
            for command in commands {
                // The command without its arguments is spoken of, too.
                let words: Vec<&str> = command.split_whitespace().collect();
                if words[1..].iter().all(|word| !word.contains(['.', ':', '-', '=']) && *word == word.to_lowercase()) {
                    let cli = super::Cli::command();
                    let known = words[1..].iter().try_fold(&cli, |at, word| at.find_subcommand(word));
                    assert!(known.is_some(), "{document}: `{command}`");
                } else if let Err(error) = super::Cli::try_parse_from(&words)
                    && error.exit_code() != 0
                {
                    panic!("{document}: `{command}`: {error}");
                }
            }
        }
    }
}
