//! The `damprig` command; everything in it is [`damprig::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    damprig::cli::main()
}
