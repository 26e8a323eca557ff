//! `damprig log` in a build without the feature `probe`: says how to get it.

use clap::Args;

use crate::failure::{Failure, Outcome};

/// Needs a program built with the feature `probe`.
#[derive(Debug, Args)]
pub struct WithoutProbeArgs {
    /// Ignored arguments
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    rest: Vec<String>,
}

/// Explains which build is needed.
///
/// # Errors
/// Always.
pub fn run(_: &WithoutProbeArgs) -> Outcome {
    Err(Failure::Input(
        "this damprig was built without debug-probe support, which `damprig log` needs: install it with `cargo install --path host --features probe`; or read the log with probe-rs by `cargo run --release --features board-nucleo-g474re` in firmware/"
            .into(),
    ))
}
