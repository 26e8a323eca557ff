//! The `damprig` command; see [`damprig::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    damprig::cli::main()
}
