//! The `damprig-thesis` command; see [`damprig_thesis::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    damprig::cli::start(|args| damprig_thesis::cli::run(&args))
}
