//! The `damprig` command; everything in it is [`damprig::commands`].

use std::process::ExitCode;

fn main() -> ExitCode {
    damprig::commands::main()
}
