//! `damprig log`: shows the log of the running firmware.
//!
//! The `probe-rs` command decodes the log. Its library is not linked, because it enables `serde_json/arbitrary_precision`,
//! which would break reading the journals of runs.
//!
//! Neither step halts the controller, because a halt of a few milliseconds ends an experiment. A session of probe-rs halts the
//! core when it is closed, to clear its breakpoints. So the image is checked by a process of its own that ends without closing
//! its session, and the decoder is killed.

use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;

use super::ctrl_c::CtrlC;
use super::flash_probe::ImageAndProbe;
use crate::board::CHIP;
use crate::failure::{Failure, Outcome};

/// Shows the log of the controller's firmware until Ctrl-C: level, source line and device time.
///
/// Attaches without a reset or a halt, so a run continues. Needs the command `probe-rs` (`cargo install probe-rs-tools`).
#[derive(Debug, Args)]
pub struct LogArgs {
    #[command(flatten)]
    target: ImageAndProbe,

    /// Only compare the image with the board's flash
    #[arg(long, hide = true)]
    check: bool,
}

/// Runs the subcommand.
///
/// # Errors
/// An invalid image, or another than the board runs; no probe, several probes, no chip; no `probe-rs`.
pub fn run(args: &LogArgs) -> Outcome {
    let image = args.target.image()?;
    if args.check {
        let (_, mut attached) = args.target.attach()?;
        let holds = attached.holds(&image).map_err(Failure::Failed)?;
        // Dropping it would halt the core.
        std::mem::forget(attached);
        return if holds {
            Ok(())
        } else {
            Err(Failure::Input(format!(
                "the board runs another image than {}, which cannot decode its log; give the image that the board runs, or flash this one with `damprig flash`",
                image.path.display()
            )))
        };
    }
    let probe = args.target.choose()?.selector.to_string();
    let own = std::env::current_exe().map_err(|e| Failure::Failed(format!("cannot find this program: {e}")))?;
    let check = Command::new(own).args(["log", "--check", "--probe", &probe]).arg(&image.path).status();
    let check = check.map_err(|e| Failure::Failed(format!("cannot start this program again: {e}")))?;
    if !check.success() {
        // It has printed why.
        std::process::exit(check.code().unwrap_or(1));
    }
    let ctrl_c = CtrlC::watch()?;
    let decoder = decoder(&probe, &image.path).spawn().map_err(|e| {
        Failure::Failed(format!("cannot start probe-rs: {e}; install it with `cargo install probe-rs-tools`"))
    })?;
    match wait(decoder, ctrl_c.flag()).map_err(|e| Failure::Failed(format!("cannot wait for probe-rs: {e}")))? {
        None => Err(Failure::Interrupted("the log has ended; the board was not halted".into())),
        Some(status) if status.success() => Ok(()),
        Some(status) => Err(Failure::Failed(format!("probe-rs attach ended with {status}"))),
    }
}

/// The command that shows the log of the running board. By default it would halt the core to catch resets and hard faults, and
/// leave a board that has one halted.
fn decoder(probe: &str, image: &Path) -> Command {
    let mut command = Command::new("probe-rs");
    command.args(["attach", "--chip", CHIP, "--probe", probe, "--no-catch-reset", "--no-catch-hardfault"]).arg(image);
    command.stdin(Stdio::null());
    // Ctrl-C must not reach it: it would close its session, which halts the core.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
}

/// Waits until the command ends, or kills it when `stop` is set. Returns its status if it has ended by itself.
fn wait(mut command: Child, stop: &AtomicBool) -> std::io::Result<Option<ExitStatus>> {
    loop {
        if let Some(status) = command.try_wait()? {
            return Ok(Some(status));
        }
        if stop.load(Ordering::Relaxed) {
            command.kill()?;
            command.wait()?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_decoder_attaches_without_catching_resets_or_hard_faults() {
        let command = decoder("0483:374e:0025A", Path::new("image.elf"));
        let arguments: Vec<&str> = command.get_args().filter_map(|argument| argument.to_str()).collect();
        let wanted = [
            "attach",
            "--chip",
            "STM32G474RETx",
            "--probe",
            "0483:374e:0025A",
            "--no-catch-reset",
            "--no-catch-hardfault",
            "image.elf",
        ];
        assert_eq!((command.get_program().to_str(), &arguments[..]), (Some("probe-rs"), &wanted[..]));
    }

    #[cfg(unix)]
    #[test]
    fn the_decoder_is_killed_when_the_command_is_stopped() {
        let stop = AtomicBool::new(true);
        // It would ignore an interrupt.
        let child = Command::new("sh").args(["-c", "trap '' INT TERM; sleep 60"]).spawn().unwrap();
        let begun = std::time::Instant::now();
        assert!(wait(child, &stop).unwrap().is_none());
        assert!(begun.elapsed() < Duration::from_secs(30));
        let child = Command::new("true").spawn().unwrap();
        assert!(wait(child, &AtomicBool::new(false)).unwrap().is_some_and(|status| status.success()));
    }
}
