//! Brings a rig to idle before a run, and turns its drive off after one.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use damprig_core::control::safety::SafeStage;
use damprig_core::rig::RigState;
use damprig_protocol::Request;

use super::{Session, SessionError, TURN};

/// Ticks granted to a simulated board between two status requests.
const WAITED_TICKS: u32 = 100;

/// Time limit for a faulted rig to come to rest: 80 mm decay to 1 mm in 73 s at 2.5 Hz and ζ = 0.0038.
const LONGEST_REST: Duration = Duration::from_secs(300);

impl Session {
    /// Stops the experiment, waits until the drive is off and clears a fault, which a rig allows only when its structure has
    /// come to rest. `notify` gets the device's reason when that takes longer than the timeout.
    ///
    /// # Errors
    /// The link; a drive that is not off within the timeout; a rig that is not safe after five minutes; `stop` was set.
    pub fn bring_to_idle(&mut self, mut notify: impl FnMut(&str), stop: &AtomicBool) -> Result<(), SessionError> {
        let begun = Instant::now();
        let mut advised = None;
        loop {
            if stop.load(Ordering::Relaxed) {
                return Err(SessionError::Interrupted);
            }
            let (status, _) = self.status()?;
            let rings = status.state == RigState::Faulted && status.safe != SafeStage::Fading;
            let longest = if rings || advised.is_some() { LONGEST_REST } else { self.timeout };
            match status.state {
                RigState::Idle => return Ok(()),
                RigState::Running(_) => self.execute("stop", Request::Stop)?,
                // Rejected while the drive fades out or the structure rings: repeated on the next turn.
                RigState::Faulted => match self.execute("clear the fault", Request::ClearFault) {
                    Ok(()) => {}
                    Err(SessionError::Refused { why, .. }) => {
                        if begun.elapsed() > self.timeout && advised.as_ref() != Some(&why) {
                            notify(&format!("the rig is not safe yet: {why}"));
                            advised = Some(why);
                        }
                    }
                    Err(error) => return Err(error),
                },
                RigState::Stopping => {}
            }
            self.wait_a_turn(status.tick)?;
            if begun.elapsed() >= longest {
                return Err(match advised {
                    Some(why) => SessionError::Refused { what: "clear the fault", why },
                    None => self.silent(),
                });
            }
        }
    }

    /// Stops the experiment and waits until the drive is off; a fault stays latched.
    ///
    /// # Errors
    /// The link, or a drive that is not off within the timeout.
    pub fn stop_drive(&mut self) -> Result<(), SessionError> {
        let begun = Instant::now();
        loop {
            let (status, _) = self.status()?;
            match (status.state, status.safe) {
                (RigState::Idle, _) | (RigState::Faulted, SafeStage::Ringing | SafeStage::Safe) => return Ok(()),
                (RigState::Running(_), _) => self.execute("stop", Request::Stop)?,
                (RigState::Faulted | RigState::Stopping, _) => {}
            }
            self.wait_a_turn(status.tick)?;
            if begun.elapsed() >= self.timeout {
                return Err(self.silent());
            }
        }
    }

    /// Waits for a moment on an idle rig and keeps the link alive; what it reports is dropped.
    ///
    /// # Errors
    /// The device is silent, or the link breaks.
    pub fn idle_turn(&mut self) -> Result<(), SessionError> {
        if self.is_granted() {
            // Its clock stands.
            std::thread::sleep(TURN);
            return Ok(());
        }
        self.listen(TURN)?;
        self.watch()?;
        while self.report_at_hand().is_some() {}
        Ok(())
    }

    fn wait_a_turn(&mut self, tick: u32) -> Result<(), SessionError> {
        if self.is_granted() {
            self.grant(tick.saturating_add(WAITED_TICKS))?;
        }
        self.listen(TURN)
    }
}
