//! `damprig flash` and `damprig log` in a program that was built without the feature `probe`: how to come by them.

use clap::Args as ClapArgs;

use super::{Failure, Outcome};

/// Needs a program built with the feature `probe`.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// What the subcommand would take
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    rest: Vec<String>,
}

/// Says what is missing.
///
/// # Errors
/// Always.
pub fn run(name: &str, _: &Args) -> Outcome {
    Err(Failure::Input(format!(
        "this damprig was built without its debug probe: `damprig {name}` needs `cargo install --path host --features probe` (no system library); `cargo run --release --features board-nucleo-g474re` in firmware/ flashes and shows the log with probe-rs's own command"
    )))
}
