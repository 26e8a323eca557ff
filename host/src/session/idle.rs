//! Getting a rig to rest: before a run it must be idle, after one its drive must be off.

use std::time::{Duration, Instant};

use damprig_core::control::safety::SafeStage;
use damprig_core::rig::State;
use damprig_protocol::Request;

use super::{Session, SessionError, TURN};

/// Ticks that a simulated board is given before it is asked again.
const WAITED_TICKS: u32 = 100;

/// How long a tripped rig may need to come to rest, s: 80 mm fall to 1 mm in 73 s at 2.5 Hz and ζ = 0.0038.
const LONGEST_REST: Duration = Duration::from_secs(300);

impl Session {
    /// Ends whatever runs, waits until the drive is silent and clears a fault, which a rig allows only when its structure has
    /// come to rest: `told` hears the device's advice when that takes longer.
    ///
    /// # Errors
    /// The link; a drive that does not become silent within the timeout; a rig that is not safe after five minutes.
    pub fn bring_to_idle(&mut self, mut told: impl FnMut(&str)) -> Result<(), SessionError> {
        let begun = Instant::now();
        let mut advised = None;
        loop {
            let (status, _) = self.status()?;
            let rings = status.state == State::Faulted && status.safe != SafeStage::Fading;
            let longest = if rings || advised.is_some() { LONGEST_REST } else { self.timeout };
            match status.state {
                State::Idle => return Ok(()),
                State::Running(_) => self.tell("stop", Request::Stop)?,
                // Refused while the drive still fades out or the structure rings: asked again on the next turn.
                State::Faulted => match self.tell("clear the fault", Request::ClearFault) {
                    Ok(()) => {}
                    Err(SessionError::Refused { why, .. }) => {
                        if begun.elapsed() > self.timeout && advised.as_ref() != Some(&why) {
                            told(&format!("the rig is not safe to go on with yet: {why}"));
                            advised = Some(why);
                        }
                    }
                    Err(error) => return Err(error),
                },
                State::Stopping => {}
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

    /// Ends whatever runs and waits until the drive is silent; a fault stays latched.
    ///
    /// # Errors
    /// The link, or a drive that does not become silent within the timeout.
    pub fn silence_the_drive(&mut self) -> Result<(), SessionError> {
        let begun = Instant::now();
        loop {
            let (status, _) = self.status()?;
            match (status.state, status.safe) {
                (State::Idle, _) | (State::Faulted, SafeStage::Ringing | SafeStage::Safe) => return Ok(()),
                (State::Running(_), _) => self.tell("stop", Request::Stop)?,
                (State::Faulted | State::Stopping, _) => {}
            }
            self.wait_a_turn(status.tick)?;
            if begun.elapsed() >= self.timeout {
                return Err(self.silent());
            }
        }
    }

    fn wait_a_turn(&mut self, tick: u32) -> Result<(), SessionError> {
        if self.is_granted() {
            self.grant(tick.saturating_add(WAITED_TICKS))?;
        }
        self.listen(TURN)
    }
}
