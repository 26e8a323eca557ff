//! `damprig log`: what the controller's firmware says, while it runs on.
//!
//! probe-rs's own command decodes it. The decoder's library is not linked here: it changes how every number of this program's
//! JSON is read (`serde_json/arbitrary_precision`), and the journals of runs would not be read any more.

use std::process::Command;

use clap::Args as ClapArgs;

use super::flash::At;
use super::{Failure, Outcome};
use crate::board::CHIP;

/// Shows the log of the controller's firmware until Ctrl-C: level, source line, and the board's time, which is that of the
/// samples.
///
/// Attaches without a reset: the rig goes on. Needs the command `probe-rs` (`cargo install probe-rs-tools`).
#[derive(Debug, ClapArgs)]
pub struct Args {
    #[command(flatten)]
    at: At,
}

/// Runs the subcommand.
///
/// # Errors
/// A wrong image, or one that the board does not run; no probe, several, or no chip; no `probe-rs`.
pub fn run(args: &Args) -> Outcome {
    let image = args.at.image()?;
    let (probe, mut attached) = args.at.attach()?;
    if !attached.holds(&image).map_err(Failure::Failed)? {
        return Err(Failure::Input(format!(
            "the board runs another image than {}: its log would read as nonsense; name the image that it runs, or `damprig flash` this one",
            image.path.display()
        )));
    }
    drop(attached);
    let status = Command::new("probe-rs")
        .args(["attach", "--chip", CHIP, "--probe", &probe.selector.to_string()])
        .arg(&image.path)
        .status()
        .map_err(|e| {
            Failure::Failed(format!("cannot start probe-rs: {e}; `cargo install probe-rs-tools` brings it"))
        })?;
    if status.success() { Ok(()) } else { Err(Failure::Failed(format!("probe-rs attach ended with {status}"))) }
}
