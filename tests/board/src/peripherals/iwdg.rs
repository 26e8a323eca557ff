//! Independent watchdog (RM0440, section 42), without its window.

use crate::register::{Access, only, refuse, rule, unknown};
use crate::time::{At, Time};

const KR: u32 = 0x00;
const PR: u32 = 0x04;
const RLR: u32 = 0x08;
const SR: u32 = 0x0c;
const WINR: u32 = 0x10;

const KEY_RELOAD: u32 = 0xaaaa;
const KEY_ENABLE: u32 = 0x5555;
const KEY_START: u32 = 0xcccc;

/// A new value takes effect after five cycles of the watchdog's oscillator.
const UPDATE_CYCLES: u64 = 5;

/// The watchdog.
#[derive(Clone, Debug)]
pub struct Iwdg {
    pr: u32,
    rlr: u32,
    is_unlocked: bool,
    pr_taken: Time,
    rlr_taken: Time,
    /// Time at which it resets the chip; [`Time::NEVER`] until it is started.
    expires: Time,
}

impl Default for Iwdg {
    fn default() -> Self {
        Self { pr: 0, rlr: 0xfff, is_unlocked: false, pr_taken: Time(0), rlr_taken: Time(0), expires: Time::NEVER }
    }
}

impl Iwdg {
    /// Time at which it resets the chip.
    #[must_use]
    pub fn expires(&self) -> Time {
        self.expires
    }

    /// Postpones the expiry by the time during which the watchdog was frozen.
    pub fn postpone(&mut self, time: Time) {
        if self.expires != Time::NEVER {
            self.expires += time;
        }
    }

    fn runs_for(&self, reload: u32, at: &At) -> Time {
        at.clocks.lsi * (4 << self.pr.min(6)) * u64::from(reload + 1)
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The register is not modelled.
    pub fn read(&self, offset: u32, at: &At) -> Access<u32> {
        Ok(match offset {
            KR => 0,
            PR => self.pr,
            RLR => self.rlr,
            SR => u32::from(at.now < self.pr_taken) | u32::from(at.now < self.rlr_taken) << 1,
            WINR => return unknown("IWDG", offset),
            _ => return unknown("IWDG", offset),
        })
    }

    /// Writes a register. Returns whether the write started the watchdog.
    ///
    /// # Errors
    /// The register is not modelled or is locked, or a previous value has not taken effect yet.
    pub fn write(&mut self, offset: u32, value: u32, at: &At) -> Access<bool> {
        let taken = at.now + at.clocks.lsi * UPDATE_CYCLES;
        match offset {
            KR => {
                self.is_unlocked = false;
                match value {
                    KEY_ENABLE => self.is_unlocked = true,
                    KEY_RELOAD if self.expires != Time::NEVER => self.expires = at.now + self.runs_for(self.rlr, at),
                    KEY_RELOAD => {}
                    KEY_START => {
                        // The counter starts at 0xfff regardless of RLR.
                        self.expires = at.now + self.runs_for(0xfff, at);
                        return Ok(true);
                    }
                    _ => return refuse!("IWDG_KR: {value:#06x} is no key"),
                }
            }
            PR => {
                rule(self.is_unlocked, "IWDG_PR is written without its key")?;
                rule(at.now >= self.pr_taken, "IWDG_PR is written while PVU is set")?;
                only("IWDG_PR", value, 7)?;
                (self.pr, self.pr_taken) = (value, taken);
            }
            RLR => {
                rule(self.is_unlocked, "IWDG_RLR is written without its key")?;
                rule(at.now >= self.rlr_taken, "IWDG_RLR is written while RVU is set")?;
                only("IWDG_RLR", value, 0xfff)?;
                (self.rlr, self.rlr_taken) = (value, taken);
            }
            _ => return unknown("IWDG", offset),
        }
        Ok(false)
    }
}
