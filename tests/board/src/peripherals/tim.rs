//! Up-counting timers (RM0440, sections 29 to 31): TIM3 and TIM4 as triggers, TIM7 with its interrupt, TIM16 with one
//! PWM channel, one-pulse mode and the repetition counter.
//!
//! A timer is not stepped. While it counts, its counter and the times of its overflows are computed from the time at
//! which the counter was 0.

use crate::register::{Access, bit, field, only, refuse, rule, unknown};
use crate::time::Time;

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SMCR: u32 = 0x08;
const DIER: u32 = 0x0c;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2c;
const RCR: u32 = 0x30;
const CCR1: u32 = 0x34;
const BDTR: u32 = 0x44;

const CEN: u32 = 1 << 0;
const URS: u32 = 1 << 2;
const OPM: u32 = 1 << 3;
const ARPE: u32 = 1 << 7;
const UIF: u32 = 1 << 0;
const UIE: u32 = 1 << 0;
const UG: u32 = 1 << 0;
const MOE: u32 = 1 << 15;

/// Kind of timer; it determines the available features.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// TIM3, TIM4: triggers.
    General,
    /// TIM6, TIM7: no channel.
    Basic,
    /// TIM16, TIM17: one channel, a repetition counter.
    OneChannel,
}

/// A timer.
#[derive(Clone, Debug)]
pub struct Tim {
    name: &'static str,
    kind: Kind,
    /// The period of its clock.
    clock: Time,
    cr1: u32,
    cr2: u32,
    smcr: u32,
    dier: u32,
    sr: u32,
    ccmr1: u32,
    ccer: u32,
    bdtr: u32,
    psc: u32,
    arr: u32,
    rcr: u32,
    ccr1: u32,
    /// The active prescaler, reload value and repetitions: the preloaded values at the last update event.
    active_psc: u32,
    active_arr: u32,
    repetitions_left: u32,
    /// The counter value while the timer is stopped.
    cnt: u32,
    /// While the timer counts: the time at which the counter was 0, and the number of processed overflows since then.
    origin: Time,
    overflows: u64,
    /// The counter is above the reload value and counts to the end of its 16 bits.
    is_beyond: bool,
}

impl Tim {
    /// The state after a reset.
    #[must_use]
    pub fn new(name: &'static str, kind: Kind, clock: Time) -> Self {
        Self {
            name,
            kind,
            clock,
            cr1: 0,
            cr2: 0,
            smcr: 0,
            dier: 0,
            sr: 0,
            ccmr1: 0,
            ccer: 0,
            bdtr: 0,
            psc: 0,
            arr: 0xffff,
            rcr: 0,
            ccr1: 0,
            active_psc: 0,
            active_arr: 0xffff,
            repetitions_left: 0,
            cnt: 0,
            origin: Time(0),
            overflows: 0,
            is_beyond: false,
        }
    }

    /// The state after a reset.
    pub fn reset(&mut self) {
        *self = Self::new(self.name, self.kind, self.clock);
    }

    fn is_counting(&self) -> bool {
        self.cr1 & CEN != 0
    }

    /// Duration of one count.
    fn count(&self) -> Time {
        self.clock * u64::from(self.active_psc + 1)
    }

    /// Time from one overflow to the next.
    fn cycle(&self) -> Time {
        self.count() * u64::from(self.active_arr + 1)
    }

    fn counter(&self, now: Time) -> u32 {
        if !self.is_counting() {
            return self.cnt;
        }
        let since = now.since(self.origin).0;
        let since = if self.is_beyond { since } else { since % self.cycle().0 };
        (since / self.count().0) as u32
    }

    /// Continues to count from `counter` at the active rate.
    fn count_from(&mut self, counter: u32, now: Time) {
        self.cnt = counter;
        self.origin = now.since(self.count() * u64::from(counter));
        self.overflows = 0;
        self.is_beyond = self.is_counting() && counter > self.active_arr;
    }

    /// Changes the clock; the present count stays.
    pub fn set_clock(&mut self, clock: Time, now: Time) {
        if clock != self.clock {
            self.sync(now);
            let counter = self.counter(now);
            self.clock = clock;
            self.count_from(counter, now);
        }
    }

    /// Processes the overflows up to `now`.
    pub fn sync(&mut self, now: Time) {
        while self.is_counting() && !self.is_beyond {
            let due = now.since(self.origin).0 / self.cycle().0;
            if due <= self.overflows {
                return;
            }
            let is_plain =
                self.repetitions_left == 0 && self.rcr == 0 && self.cr1 & OPM == 0 && self.psc == self.active_psc;
            if is_plain {
                // All remaining overflows have the same effect.
                self.overflows = due;
                self.sr |= UIF;
                return;
            }
            self.overflows += 1;
            if self.repetitions_left > 0 {
                self.repetitions_left -= 1;
                continue;
            }
            let at = self.origin + self.cycle() * self.overflows;
            self.sr |= UIF;
            if self.cr1 & OPM != 0 {
                self.cr1 &= !CEN;
                self.cnt = 0;
            }
            self.load(at);
        }
    }

    /// An update event: loads the preloaded values and sets the counter to 0.
    fn load(&mut self, now: Time) {
        self.active_psc = self.psc;
        self.active_arr = self.arr;
        self.repetitions_left = self.rcr;
        self.count_from(0, now);
    }

    /// The first update event after `time`, for a timer that has counted without interruption since before that time.
    /// `None` if it does not count or does not output its update events as TRGO.
    #[must_use]
    pub fn trigger_after(&self, time: Time) -> Option<Time> {
        let is_periodic = self.is_counting() && self.rcr == 0 && self.cr1 & OPM == 0 && !self.is_beyond;
        if !is_periodic || field(self.cr2, 4, 3) != 2 {
            return None;
        }
        let cycle = self.cycle();
        Some(self.origin + cycle * (time.since(self.origin).0 / cycle.0 + 1))
    }

    /// The time between two triggers.
    #[must_use]
    pub fn trigger_period(&self) -> Time {
        self.cycle()
    }

    /// Whether the interrupt is requested.
    #[must_use]
    pub fn interrupt(&self) -> bool {
        self.sr & self.dier & UIF != 0
    }

    /// The level of channel 1's output; low while it is off.
    #[must_use]
    pub fn output1(&self, now: Time) -> bool {
        if !bit(self.ccer, 0) || self.bdtr & MOE == 0 {
            return false;
        }
        let below = self.counter(now) < self.ccr1;
        match field(self.ccmr1, 4, 3) {
            6 => below,
            7 => !below,
            _ => false,
        }
    }

    /// Time of the next spontaneous event: an update with its interrupt enabled, or an edge of channel 1.
    #[must_use]
    pub fn next_event(&self, now: Time) -> Time {
        if !self.is_counting() || self.is_beyond {
            return Time::NEVER;
        }
        let overflow = self.origin + self.cycle() * (self.overflows + 1);
        if !bit(self.ccer, 0) {
            return if self.dier & UIE != 0 { overflow } else { Time::NEVER };
        }
        let start = self.origin + self.cycle() * self.overflows;
        let compare = start + self.count() * u64::from(self.ccr1);
        if compare > now && self.ccr1 <= self.active_arr { compare } else { overflow }
    }

    /// Reads a register.
    ///
    /// # Errors
    /// This timer has no such register, or the register is not modelled.
    pub fn read(&mut self, offset: u32, now: Time) -> Access<u32> {
        self.sync(now);
        let with_channel = self.kind == Kind::OneChannel;
        Ok(match offset {
            CR1 => self.cr1,
            CR2 => self.cr2,
            SMCR if self.kind == Kind::General => self.smcr,
            DIER => self.dier,
            SR => self.sr,
            EGR => 0,
            CCMR1 if with_channel => self.ccmr1,
            CCER if with_channel => self.ccer,
            CNT => self.counter(now),
            PSC => self.psc,
            ARR => self.arr,
            RCR if with_channel => self.rcr,
            CCR1 if with_channel => self.ccr1,
            BDTR if with_channel => self.bdtr,
            _ => return unknown(self.name, offset),
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// This timer has no such register, or the register or a bit is not modelled.
    pub fn write(&mut self, offset: u32, value: u32, now: Time) -> Access<()> {
        self.sync(now);
        let with_channel = self.kind == Kind::OneChannel;
        let name = |register: &str| format!("{}_{register}", self.name);
        match offset {
            CR1 => {
                only(&name("CR1"), value, CEN | URS | OPM | ARPE)?;
                let counter = self.counter(now);
                self.cr1 = value;
                self.count_from(counter, now);
            }
            CR2 => {
                only(&name("CR2"), value, 0x70)?;
                let mms = field(value, 4, 3);
                rule(mms == 0 || mms == 2, "TIM_CR2: only MMS = update is modelled")?;
                self.cr2 = value;
            }
            SMCR if self.kind == Kind::General => {
                only(&name("SMCR"), value, 0)?;
                self.smcr = value;
            }
            DIER => {
                only(&name("DIER"), value, UIE)?;
                self.dier = value;
            }
            SR => self.sr &= value,
            EGR => {
                only(&name("EGR"), value, UG)?;
                if value & UG != 0 {
                    if self.cr1 & URS == 0 {
                        self.sr |= UIF;
                    }
                    self.load(now);
                }
            }
            CCMR1 if with_channel => {
                only(&name("CCMR1"), value, 0x70)?;
                let mode = field(value, 4, 3);
                rule(matches!(mode, 0 | 6 | 7), "TIM_CCMR1: only frozen, PWM mode 1 and PWM mode 2 are modelled")?;
                self.ccmr1 = value;
            }
            CCER if with_channel => {
                only(&name("CCER"), value, 1)?;
                self.ccer = value;
            }
            CNT => {
                only(&name("CNT"), value, 0xffff)?;
                self.count_from(value, now);
            }
            PSC => {
                only(&name("PSC"), value, 0xffff)?;
                self.psc = value;
            }
            ARR => {
                only(&name("ARR"), value, 0xffff)?;
                if value == 0 {
                    return refuse!("{}_ARR = 0: the counter would be blocked", self.name);
                }
                let counter = self.counter(now);
                self.arr = value;
                if self.cr1 & ARPE == 0 {
                    self.active_arr = value;
                    self.count_from(counter, now);
                }
            }
            RCR if with_channel => {
                only(&name("RCR"), value, 0xff)?;
                self.rcr = value;
            }
            CCR1 if with_channel => {
                only(&name("CCR1"), value, 0xffff)?;
                self.ccr1 = value;
            }
            BDTR if with_channel => {
                only(&name("BDTR"), value, MOE)?;
                self.bdtr = value;
            }
            _ => return unknown(self.name, offset),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clock of 170 MHz.
    const CLOCK: Time = Time(24);

    fn us(us: u64) -> Time {
        Time::from_us(us)
    }

    #[test]
    fn triggers_occur_every_period_from_the_start() {
        let mut tim = Tim::new("TIM3", Kind::General, CLOCK);
        tim.write(ARR, 17_000 - 1, us(0)).unwrap();
        tim.write(CR2, 2 << 4, us(0)).unwrap();
        assert_eq!(tim.trigger_after(us(5)), None);
        tim.write(CR1, CEN, us(10)).unwrap();
        assert_eq!(tim.trigger_after(us(10)), Some(us(110)));
        assert_eq!(tim.trigger_after(us(110)), Some(us(210)));
        assert_eq!(tim.trigger_after(us(1_234)), Some(us(1_310)));
    }

    #[test]
    fn one_pulse_mode_stops_after_the_repetitions() {
        let mut tim = Tim::new("TIM16", Kind::OneChannel, CLOCK);
        for (offset, value) in [(PSC, 169), (CR1, OPM), (CCMR1, 7 << 4), (CCER, 1), (BDTR, MOE)] {
            tim.write(offset, value, us(0)).unwrap();
        }
        // Three pulses of 5 µs in 990 µs.
        for (offset, value) in [(ARR, 329), (CCR1, 325), (RCR, 2), (EGR, UG), (CR1, OPM | CEN)] {
            tim.write(offset, value, us(1_000)).unwrap();
        }
        let mut edges = Vec::new();
        let (mut now, mut level) = (us(1_000), tim.output1(us(1_000)));
        while tim.next_event(now) != Time::NEVER {
            now = tim.next_event(now);
            tim.sync(now);
            if tim.output1(now) != level {
                level = !level;
                edges.push(((now - us(1_000)).us(), level));
            }
        }
        let expected = [(325.0, true), (330.0, false), (655.0, true), (660.0, false), (985.0, true), (990.0, false)];
        assert_eq!(edges, expected);
    }
}
