//! A motion as the intervals between events and the instants at which the excitation's form changes.

use damprig_core::integrator::exact::Excitation;
use damprig_core::integrator::exact::time::Time;

use super::{Drive, MotionCase, NoDerivatives};
use crate::contacts::{Contacts, Event};
use crate::motion::Motion;
use crate::{Refused, SetUp};

/// What ends an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum End {
    Event(Event),
    /// The end of a pulse.
    Break,
    /// The base goes on with the sample interval of this number.
    Sample(usize),
    /// The end of the motion.
    Motion,
}

/// A motion between two of these, with its state at the start.
#[derive(Clone, Debug)]
pub(super) struct StateInterval {
    pub contacts: Contacts,
    pub length_s: f64,
    /// w at the start.
    pub start: Vec<f64>,
    pub end: End,
}

/// Most intervals: some 100 MB.
const MAX_INTERVALS: usize = 300_000;

/// The intervals of a motion, and w at its end.
pub(super) fn intervals(case: &MotionCase) -> Result<(Vec<StateInterval>, Vec<f64>), NoDerivatives> {
    let mut motion = case.motion()?;
    let mut intervals = Vec::new();
    let mut open = Open::of(&motion);
    for (until_s, end) in instants(case) {
        while motion.time.until(until_s) > 0.0 {
            motion.advance(until_s, &mut ())?;
            if motion.unresolved() > 0 {
                return Err(NoDerivatives::UnresolvedEvent);
            }
            if intervals.len() >= MAX_INTERVALS {
                return Err(NoDerivatives::Long);
            }
            if let Some(event) = motion.handled {
                intervals.push(open.ended(End::Event(event), &motion));
                open = Open::of(&motion);
            }
        }
        // The state before what happens now.
        let interval = open.ended(end, &motion);
        match end {
            End::Break => motion.pass_break()?,
            End::Sample(which) => motion.follow(case.powers(which))?,
            End::Event(_) | End::Motion => {}
        }
        intervals.push(interval);
        open = Open::of(&motion);
    }
    Ok((intervals, open.start))
}

/// The instants that are no events, in order.
fn instants(case: &MotionCase) -> Vec<(f64, End)> {
    let mut instants = match &case.drive {
        Drive::ClosedForm(excitation) => vec![(excitation.next_break_s(0.0), End::Break)],
        Drive::Samples { step_s, powers } => {
            (1..powers.len()).map(|which| (which as f64 * step_s, End::Sample(which))).collect()
        }
    };
    instants.push((case.duration_s, End::Motion));
    instants.retain(|(at_s, end)| *at_s < case.duration_s || *end == End::Motion);
    instants.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    instants
}

/// An interval that has begun.
struct Open {
    contacts: Contacts,
    from: Time,
    start: Vec<f64>,
}

impl Open {
    fn of(motion: &Motion) -> Self {
        let (mut start, v) = motion.bodies();
        start.extend(v);
        start.extend([motion.wave.sine, motion.wave.cosine]);
        start.extend(&motion.base_cubic.derivatives()[..4]);
        start.push(1.0);
        Self { contacts: motion.contacts.clone(), from: motion.time, start }
    }

    fn ended(&self, end: End, motion: &Motion) -> StateInterval {
        let length_s = motion.time.since(self.from);
        StateInterval { contacts: self.contacts.clone(), length_s, start: self.start.clone(), end }
    }
}

impl MotionCase {
    /// The motion at its start.
    fn motion(&self) -> Result<Motion, Refused> {
        match &self.drive {
            Drive::ClosedForm(excitation) => Motion::new(&self.set_up, excitation, &self.start),
            Drive::Samples { .. } => Motion::on_base(&self.set_up, self.powers(0), &self.start),
        }
    }

    /// The base's cubic in a sample interval.
    pub(super) fn powers(&self, which: usize) -> [f64; 4] {
        match &self.drive {
            Drive::ClosedForm(_) => [0.0; 4],
            Drive::Samples { powers, .. } => powers.get(which).copied().unwrap_or_default(),
        }
    }

    /// The excitation beside samples.
    pub(super) fn excitation(&self) -> Excitation {
        if let Drive::ClosedForm(excitation) = &self.drive { *excitation } else { Excitation::Fixed }
    }

    pub(super) fn set_up(&self) -> &SetUp {
        &self.set_up
    }
}
