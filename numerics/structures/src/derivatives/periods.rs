//! A motion over whole periods of its sine: where it begins, when it repeats, and what it is from another start.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use damprig_core::integrator::exact::time::Time;

use super::{Drive, MotionCase, NoDerivatives};
use crate::State;
use crate::contacts::{Slide, Touch};
use crate::motion::Motion;
use crate::mount::Mount;

/// Two states are the same if they differ by less than this share of the motion.
pub(super) const REPEATS: f64 = 1e-6;

/// Sections of a period that are tried.
const SECTIONS: u32 = 16;

/// Where an orbit under a sine begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Drive periods after which it repeats.
    pub periods: u32,
    /// How far the sine has turned there since t = 0 of its case, rad.
    pub advance_rad: f64,
}

/// An instant of a motion: its state, what it touches, and how far the events before and after it are.
struct Instant {
    state: State,
    at_s: f64,
    /// A particle touches a wall: it has no room for disturbances, or its contact is no part of a state.
    touches: bool,
    sticking: usize,
    clear_s: f64,
}

/// Runs a case to where its last `periods` periods begin, at a section away from events: when, and the state there.
fn section(case: &MotionCase, periods: u32) -> Result<(f64, State), NoDerivatives> {
    let Drive::ClosedForm(excitation) = &case.drive else { return Err(NoDerivatives::NotPeriodic) };
    let turning = excitation.angular_frequency_rad_per_s();
    if excitation.next_break_s(0.0).is_finite() || turning == 0.0 {
        return Err(NoDerivatives::NotPeriodic);
    }
    let period_s = TAU / turning;
    let whole = (case.duration_s / period_s * (1.0 + 1e-12)).floor();
    let from = whole - f64::from(periods) - 1.0;
    if from < 0.0 {
        return Err(NoDerivatives::NotPeriodic);
    }
    let mut motion = Motion::new(&case.set_up, excitation, &case.start)?;
    motion.run(from * period_s, &mut ())?;
    let mut sections: Vec<Instant> = Vec::new();
    let mut last_event_s = f64::NEG_INFINITY;
    // The last one is followed by an event too.
    for n in 1..=SECTIONS + 1 {
        let at_s = (from + f64::from(n) / f64::from(SECTIONS)) * period_s;
        while motion.time.until(at_s) > 0.0 {
            motion.advance(at_s, &mut ())?;
            if motion.handled.is_some() {
                last_event_s = motion.time_s();
                if let Some(last) = sections.last_mut() {
                    last.clear_s = last.clear_s.min(last_event_s - last.at_s);
                }
            }
        }
        if n > SECTIONS {
            break;
        }
        let contacts = &motion.contacts;
        sections.push(Instant {
            state: motion.state(),
            at_s,
            touches: contacts.touches.iter().any(|touch| *touch != Touch::None),
            sticking: contacts.slides.iter().filter(|slide| **slide == Slide::Stuck).count(),
            clear_s: at_s - last_event_s,
        });
    }
    let better = |a: &Instant, b: &Instant| b.sticking.cmp(&a.sticking).then(a.clear_s.total_cmp(&b.clear_s));
    let best = sections.into_iter().filter(|section| !section.touches).max_by(better);
    best.map(|section| (section.at_s, section.state)).ok_or(NoDerivatives::NotIsolated)
}

/// After how many of the `most` periods of a case its state is that of its start.
fn repeats_after(case: &MotionCase, most: u32) -> Result<u32, NoDerivatives> {
    let mut motion = Motion::new(&case.set_up, &case.excitation(), &case.start)?;
    let (mut size_m, (start, start_rate)) = (0.0_f64, motion.bodies());
    let mass: Vec<f64> = motion.mount.bodies.mass.iter().map(|mass| mass.sqrt()).collect();
    let norm =
        |of: &mut dyn Iterator<Item = f64>| of.zip(&mass).map(|(of, root)| (of * root).abs()).fold(0.0, f64::max);
    let mut speed_m_per_s = 0.0_f64;
    for period in 1..=most {
        for part in 1..=SECTIONS {
            let share = (f64::from(period - 1) + f64::from(part) / f64::from(SECTIONS)) / f64::from(most);
            motion.run(share * case.duration_s, &mut ())?;
            let (q, v) = motion.bodies();
            size_m = size_m.max(norm(&mut q.into_iter()));
            speed_m_per_s = speed_m_per_s.max(norm(&mut v.into_iter()));
        }
        let (q, v) = motion.bodies();
        let apart_m = norm(&mut q.iter().zip(&start).map(|(a, b)| a - b));
        let apart_m_per_s = norm(&mut v.iter().zip(&start_rate).map(|(a, b)| a - b));
        if apart_m <= REPEATS * size_m && apart_m_per_s <= REPEATS * speed_m_per_s {
            return Ok(period);
        }
    }
    Err(NoDerivatives::NotPeriodic)
}

impl MotionCase {
    /// The periodic motion that this one is on at its end, from a section away from events.
    ///
    /// # Errors
    /// It does not repeat to 10⁻⁶ of its size after at most `most_periods` periods, or is no motion under a sine.
    pub fn settled(&self, most_periods: u32) -> Result<(Self, Section), NoDerivatives> {
        self.repeating(most_periods).map(|(_, case, section)| (case, section))
    }

    /// The same, with when it begins, s.
    pub(super) fn repeating(&self, most_periods: u32) -> Result<(f64, Self, Section), NoDerivatives> {
        self.refuse_walls()?;
        let (at_s, state) = section(self, most_periods)?;
        let advance_rad = self.advance_rad(at_s);
        let periods = repeats_after(&self.of_periods(most_periods, &state, advance_rad), most_periods)?;
        Ok((at_s, self.of_periods(periods, &state, advance_rad), Section { periods, advance_rad }))
    }

    /// Whole periods of its sine in its length; 0 without one.
    #[must_use]
    pub fn periods(&self) -> u32 {
        let turning = self.excitation().angular_frequency_rad_per_s();
        (self.duration_s * turning / TAU * (1.0 + 1e-12)).floor() as u32
    }

    /// The motion over so many periods of its sine.
    #[must_use]
    pub fn over_periods(&self, periods: u32) -> Self {
        self.of_periods(periods, &self.start, 0.0)
    }

    /// How far its sine turns in a time, rad.
    pub(super) fn advance_rad(&self, after_s: f64) -> f64 {
        Time::at(after_s).phase_rad(self.excitation().angular_frequency_rad_per_s())
    }

    /// Displacements and velocities of all bodies relative to the base after a time, as in [`Returned::start`](super::Returned::start).
    ///
    /// # Errors
    /// The motion is refused.
    pub fn bodies_after(&self, after_s: f64) -> Result<Vec<f64>, NoDerivatives> {
        self.refuse_walls()?;
        let mut motion = Motion::new(&self.set_up, &self.excitation(), &self.start)?;
        motion.run(after_s, &mut ())?;
        let (mut q, v) = motion.bodies();
        q.extend(v);
        Ok(q)
    }

    /// When a section of its first period of several is that is away from events, s.
    ///
    /// # Errors
    /// The motion is refused, or a particle is at a wall all the time.
    pub fn clear_section_s(&self, periods: u32) -> Result<f64, NoDerivatives> {
        let more_s = self.duration_s / f64::from(periods);
        section(&Self { duration_s: self.duration_s + more_s, ..self.clone() }, periods).map(|(at_s, _)| at_s)
    }

    /// This set-up from a section of an orbit on, with these displacements and velocities of the bodies, as in
    /// [`Returned::start`](super::Returned::start). The signs of its modes are those of `like`.
    ///
    /// # Errors
    /// It has other places or modes than `like`.
    pub fn at_section(&self, like: &Self, section: Section, bodies: &[f64]) -> Result<Self, NoDerivatives> {
        self.refuse_walls()?;
        let aligned = self.aligned(like)?;
        let mut case = aligned.of_periods(section.periods, &aligned.start, section.advance_rad);
        let excitation = case.excitation();
        let (wave, mount) = (excitation.wave(Time::default()), Mount::new(&case.set_up, &excitation)?);
        let rate = excitation.angular_frequency_rad_per_s() * wave.cosine;
        let count = mount.bodies.len();
        let base = (mount.share * (wave.offset + wave.sine), mount.share * rate);
        case.start = mount.state_of(&bodies[..count], &bodies[count..], base);
        Ok(case)
    }

    /// The motion over `periods` periods of its sine from `state`, with the phase of the sine `advance_rad` later than at the start.
    pub(super) fn of_periods(&self, periods: u32, state: &State, advance_rad: f64) -> Self {
        let mut case = self.clone();
        case.start = state.clone();
        if let Drive::ClosedForm(
            Excitation::Sine { phase_rad, angular_frequency_rad_per_s, .. }
            | Excitation::ForceSine { phase_rad, angular_frequency_rad_per_s, .. },
        ) = &mut case.drive
        {
            *phase_rad += advance_rad;
            case.duration_s = f64::from(periods) * TAU / *angular_frequency_rad_per_s;
        }
        if let Some(beside) = &mut case.set_up.force_beside_base {
            beside.phase_rad += advance_rad;
        }
        case
    }
}
