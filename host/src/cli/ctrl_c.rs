//! Ctrl-C, SIGTERM and SIGHUP: a command that works asks whether it is to end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::failure::Failure;

/// Whether someone wants the command to end.
#[derive(Clone, Debug)]
pub struct CtrlC(Arc<AtomicBool>);

impl CtrlC {
    /// Watches for the first Ctrl-C, SIGTERM or SIGHUP. A second Ctrl-C or SIGTERM ends the program at once; a terminal that closes may
    /// send SIGHUP several times.
    ///
    /// # Errors
    /// When signals cannot be watched.
    pub fn watch() -> Result<Self, Failure> {
        let is_pressed = Arc::new(AtomicBool::new(false));
        #[cfg(unix)]
        watch_other_signals(&is_pressed).map_err(|e| Failure::Failed(format!("cannot watch for signals: {e}")))?;
        let set = Arc::clone(&is_pressed);
        let handler = move || {
            if set.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        };
        ctrlc::set_handler(handler).map_err(|e| Failure::Failed(format!("cannot watch for Ctrl-C: {e}")))?;
        Ok(Self(is_pressed))
    }

    /// Whether it was pressed.
    #[must_use]
    pub fn is_pressed(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// The same, for a thread that has no command line.
    #[must_use]
    pub fn flag(&self) -> &Arc<AtomicBool> {
        &self.0
    }
}

#[cfg(unix)]
fn watch_other_signals(stop: &Arc<AtomicBool>) -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGTERM};
    use signal_hook::flag::{register, register_conditional_shutdown};
    register_conditional_shutdown(SIGTERM, 130, Arc::clone(stop))?;
    register(SIGTERM, Arc::clone(stop))?;
    if !is_hangup_ignored() {
        register(SIGHUP, Arc::clone(stop))?;
    }
    Ok(())
}

/// Whether the program was started to outlive its terminal (`nohup`).
#[cfg(unix)]
fn is_hangup_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).map(str::trim);
    let mask = mask.and_then(|mask| u64::from_str_radix(mask, 16).ok()).unwrap_or(0);
    mask >> (signal_hook::consts::SIGHUP - 1) & 1 == 1
}
