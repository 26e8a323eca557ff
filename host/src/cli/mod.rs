//! The `damprig` command line: one file per subcommand, with its options, messages and exit codes.
//!
//! To add a subcommand: a file with its clap `Args` and a function that returns [`Outcome`], and a line in both `Command` and
//! [`main`]. The work itself belongs into the library.

/// Prints a line to standard output, as [`output`] says; what controls a terminal is spelled out.
macro_rules! say {
    ($($text:tt)*) => {
        $crate::cli::output::print(&format!($($text)*))
    };
}

/// Prints a line to standard error.
macro_rules! warn {
    ($($text:tt)*) => {
        $crate::cli::output::print_error(&format!($($text)*))
    };
}

mod arguments;
mod basins;
mod bifurcation;
mod calibrate;
mod calibrate_operator;
mod compare;
mod consent;
mod continue_;
pub mod ctrl_c;
mod devices;
mod documents;
mod examples;
mod flash;
#[cfg(feature = "probe")]
mod flash_probe;
mod groups;
mod help;
mod identify;
mod init;
mod inspect;
#[cfg(feature = "probe")]
mod log;
mod monitor;
mod optimise;
pub mod output;
mod output_paths;
pub mod progress;
mod run;
mod run_job;
mod run_progress;
mod runs;
mod settings;
mod simulate;
mod spectrum;
mod study;
mod study_figures;
mod study_work;
mod terminal_line;

#[cfg(not(feature = "probe"))]
mod without_probe;

use std::process::ExitCode;
use std::sync::Arc;

use clap::{CommandFactory, Parser, Subcommand};

use crate::failure::Outcome;

/// Runs, records, simulates and reports experiments on a vibration-damper rig, real or virtual.
#[derive(Debug, Parser)]
#[command(name = "damprig", version, propagate_version = true, after_help = AFTER_HELP, max_term_width = 100, disable_help_subcommand = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const AFTER_HELP: &str = "\
Examples:
  damprig examples                         list the shipped campaigns, cases and studies
  damprig run hybrid                       run the shipped campaign hybrid on the virtual rig
  damprig run my.toml --rig auto           run your campaign on the connected board
  damprig runs                             list the runs in runs/
  damprig simulate spid --plot spid.png    simulate one case exactly
  damprig study run clearance-and-restitution
                                           run a study, a table of many simulations
  damprig help run                         all options of a command
  damprig help calibrate the lasers        a page of the manual

Exit codes:
  0    success
  1    the rig, the link, the disk or standard output failed, or a run cannot be read; recorded data are kept
  2    the command line or a file is wrong; nothing has moved
  130  interrupted (Ctrl-C, SIGTERM or SIGHUP); the rig was stopped, recorded data are kept";

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a campaign and record it in a run folder
    Run(run::RunArgs),
    /// Show a rig or a run live, on a page in the browser
    Monitor(monitor::MonitorArgs),
    /// List serial ports and the boards connected to them
    Devices(devices::DevicesArgs),
    /// List, show, verify, report and export run folders
    Runs(runs::RunsArgs),
    /// Show, change, save and copy the settings of a board
    Settings(settings::SettingsArgs),
    /// Calibrate the sensors and the drive of a board, guided, or rehearse it
    Calibrate(Box<calibrate::CalibrateArgs>),
    /// Write a new campaign, case, study or optimisation, with comments
    Init(init::InitArgs),
    /// List the shipped campaigns, cases and studies, or copy one here
    Examples(examples::ExamplesArgs),
    /// Simulate cases exactly, event by event
    Simulate(simulate::SimulateArgs),
    /// Run a study: a case over many values of its keys; draw a bifurcation diagram
    Study(study::StudyArgs),
    /// Follow periodic orbits of a case over a parameter: stability, bifurcations, grazings
    Continue(continue_::ContinueArgs),
    /// Optimise keys of a case over a band: the best values, and how sure they are
    Optimise(optimise::OptimiseArgs),
    /// Identify parameters of the rig from runs and tables, with their uncertainty
    Identify(identify::IdentifyArgs),
    /// Say what is in a measured file: signals, units, sample rates, gaps
    Inspect(inspect::InspectArgs),
    /// Compute response spectra of an acceleration record over period and damping ratio
    Spectrum(spectrum::SpectrumArgs),
    /// Compare a run with simulations of its set-ups, with uncertainties
    Compare(compare::CompareArgs),
    /// Print the JSON Schema of a kind of file, for editors
    Schema(documents::Schema),
    /// Print the keys of all files
    Keys(documents::KeysArgs),
    /// Print the completions of a shell
    Completions(documents::Completions),
    /// Print the manual page of damprig or of one of its commands
    Man(documents::ManualPage),
    /// Print the help of a command or a page of the manual; without a topic, the list of all
    Help(help::HelpArgs),
    /// Flash the firmware of the controller board
    Flash(flash::FlashArgs),
    /// Show the firmware's log
    #[cfg(feature = "probe")]
    Log(log::LogArgs),
    /// Show the firmware's log (not in this build)
    #[cfg(not(feature = "probe"))]
    Log(without_probe::WithoutProbeArgs),
}

/// Parses the command line and runs the subcommand.
#[must_use]
pub fn main() -> ExitCode {
    start_as(groups::grouped(Cli::command()), |cli: Cli| run(cli.command))
}

/// Parses the command line of a program and runs it; gives its exit code.
#[must_use]
pub fn start<A: Parser>(run: impl FnOnce(A) -> Outcome) -> ExitCode {
    start_as(A::command(), run)
}

fn start_as<A: Parser>(mut command: clap::Command, run: impl FnOnce(A) -> Outcome) -> ExitCode {
    let matches = command.try_get_matches_from_mut(std::env::args_os());
    let parsed = matches
        .and_then(|mut matches| A::from_arg_matches_mut(&mut matches).map_err(|error| error.format(&mut command)));
    let arguments = match parsed {
        Ok(arguments) => arguments,
        Err(text) => return output::print_help(&groups::with_hint(text)),
    };
    // A file beyond `ulimit -f` then fails like a full disk: with a message, and the rig is stopped.
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    run(arguments).map_or_else(|failure| output::report(&failure), |()| output::finish())
}

fn run(command: Command) -> Outcome {
    match command {
        Command::Run(args) => run::run(&args),
        Command::Monitor(args) => monitor::run(&args),
        Command::Devices(args) => devices::run(&args),
        Command::Runs(args) => runs::run(&args),
        Command::Settings(args) => settings::run(&args),
        Command::Flash(args) => flash::run(&args),
        #[cfg(feature = "probe")]
        Command::Log(args) => log::run(&args),
        #[cfg(not(feature = "probe"))]
        Command::Log(args) => without_probe::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Init(args) => init::run(&args),
        Command::Examples(args) => examples::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Study(args) => study::run(&args),
        Command::Continue(args) => continue_::run(&args),
        Command::Optimise(args) => optimise::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Identify(args) => identify::run(&args),
        Command::Spectrum(args) => spectrum::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Schema(args) => documents::schema(&args),
        Command::Keys(args) => documents::keys(&args),
        Command::Completions(args) => documents::completions(&args, Cli::command()),
        Command::Man(args) => documents::manual_page(&args, Cli::command()),
        Command::Help(args) => help::run(&args, groups::grouped(Cli::command())),
    }
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    #[test]
    fn the_command_line_is_consistent() {
        super::Cli::command().debug_assert();
    }

    /// Commands in a text: in backticks or on lines of their own.
    fn commands(text: &str) -> Vec<&str> {
        let quoted = text.split('`').skip(1).step_by(2);
        let lines = text.lines().map(|line| line.split(" # ").next().unwrap_or(line));
        let lines = lines.map(|line| line.split("   ").find(|part| !part.is_empty()).unwrap_or(""));
        let all = quoted.filter(|span| !span.contains('\n')).chain(lines);
        // The output of a command may go to a file.
        let all = all.map(|line| line.split(" > ").next().unwrap_or(line).trim());
        // `a|b` stands for several commands.
        all.filter(|command| command.starts_with("damprig ") && !command.contains(['|', '…'])).collect()
    }

    #[test]
    fn every_command_in_the_documents_exists() {
        let top = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        for (document, least) in [("README.md", 5), ("firmware/README.md", 5), ("docs/RUN_FOLDER.md", 3)] {
            let text = std::fs::read_to_string(top.join(document)).expect("a document of the project");
            let commands = commands(&text);
            assert!(commands.len() >= least, "{document}: {commands:?}");
            for command in commands {
                let words: Vec<&str> = command.split_whitespace().collect();
                if let Err(error) = super::Cli::try_parse_from(&words)
                    && error.exit_code() != 0
                {
                    // A command may be mentioned without its arguments.
                    let cli = super::Cli::command();
                    let mentioned = words[1..].iter().try_fold(&cli, |at, word| at.find_subcommand(word));
                    assert!(mentioned.is_some(), "{document}: `{command}`: {error}");
                }
            }
        }
    }
}
