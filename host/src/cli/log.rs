//! `damprig log`: shows the log of the running firmware.
//!
//! The `probe-rs` command decodes the log. Its library is not linked, because it enables `serde_json/arbitrary_precision`,
//! which would break reading the journals of runs.

use std::process::Command;

use clap::Args as ClapArgs;

use super::flash::ImageAndProbe;
use super::outcome::{Failure, Outcome};
use crate::board::CHIP;

/// Shows the log of the controller's firmware until Ctrl-C: level, source line and device time.
///
/// Attaches without a reset, so a run continues. Needs the command `probe-rs` (`cargo install probe-rs-tools`).
#[derive(Debug, ClapArgs)]
pub struct Args {
    #[command(flatten)]
    target: ImageAndProbe,
}

/// Runs the subcommand.
///
/// # Errors
/// An invalid image, or another than the board runs; no probe, several probes, no chip; no `probe-rs`.
pub fn run(args: &Args) -> Outcome {
    let image = args.target.image()?;
    let (probe, mut attached) = args.target.attach()?;
    if !attached.holds(&image).map_err(Failure::Failed)? {
        return Err(Failure::Input(format!(
            "the board runs another image than {}, which cannot decode its log; give the image that the board runs, or flash this one with `damprig flash`",
            image.path.display()
        )));
    }
    drop(attached);
    let status = Command::new("probe-rs")
        .args(["attach", "--chip", CHIP, "--probe", &probe.selector.to_string()])
        .arg(&image.path)
        .status()
        .map_err(|e| {
            Failure::Failed(format!("cannot start probe-rs: {e}; install it with `cargo install probe-rs-tools`"))
        })?;
    if status.success() { Ok(()) } else { Err(Failure::Failed(format!("probe-rs attach ended with {status}"))) }
}
