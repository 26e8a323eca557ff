//! What happens at the end of an interval, to a motion and its changes.

use damprig_core::integrator::modes::Sign;
use damprig_core::model::ImpactLaw;
use nalgebra::DVector;

use super::equations::{HardImpact, MORE};
use super::follow::Follower;
use super::record::{End, StateInterval};
use super::setting::{Known, Setting, all_or_none};
use super::stencil::{has_kink, relative};
use super::{NoDerivatives, Varied};
use crate::contacts::{Contacts, Event, Slide, Touch};
use crate::mount::WallLaw;

/// Two states differ if they do by more than this share of the motion: another law than that of one contact was at work. Far above the rounding of an
/// interval of thousands of cycles.
const OTHER_STATE: f64 = 1e-7;

impl Follower<'_> {
    /// What happens at the end of an interval, to the state and its changes.
    pub(super) fn happen(
        &mut self,
        interval: &StateInterval,
        (known, next): (&Known, &[f64]),
        after: Option<&Contacts>,
    ) -> Result<(), NoDerivatives> {
        let more = 2 * self.bodies();
        match interval.end {
            End::Event(Event::Wall(particle, side)) => self.meet_wall((particle, side), &interval.contacts, after)?,
            End::Event(_) | End::Motion => {}
            End::Break | End::Sample(_) => {
                let base_rate = known.row_of(|equations| equations.base_rate.clone());
                let before = self.sloped(&base_rate.0, &base_rate.1);
                let which = if let End::Sample(which) = interval.end { which } else { 0 };
                let driven = |setting: &Setting| setting.driven(which, setting.time_s(interval.end));
                self.w.rows_mut(more, MORE).copy_from_slice(&next[more..]);
                self.s.rows_mut(more, MORE).fill(0.0);
                for (column, change) in self.changes(driven).iter().enumerate() {
                    self.s.view_mut((more, column), (MORE, 1)).copy_from(change);
                }
                let after = self.sloped(&base_rate.0, &base_rate.1);
                let (jump, slopes) = (after.value - before.value, after.slopes - before.slopes);
                for i in 0..self.bodies() {
                    let row = self.bodies() + i;
                    let inertia = known.equations.inertia[i];
                    self.w[row] -= inertia * jump;
                    for column in 0..self.s.ncols() {
                        let change = known.changes.get(column).map_or(0.0, |change| change.inertia[i]);
                        self.s[(row, column)] -= inertia * slopes[column] + change * jump;
                    }
                }
            }
        }
        // Nothing happens at the end.
        if interval.end == End::Motion { Ok(()) } else { self.check_state(next) }
    }

    /// A particle meets a wall.
    fn meet_wall(
        &mut self,
        (particle, side): (usize, Sign),
        before: &Contacts,
        after: Option<&Contacts>,
    ) -> Result<(), NoDerivatives> {
        let together = NoDerivatives::Together { time_s: self.time.value };
        let closed = HardImpact::closed(&self.nominal.mount, before, (particle, side)).ok_or(together.clone())?;
        let of = |setting: &Setting| HardImpact::new(&setting.mount, &closed);
        let impact = of(&self.nominal).ok_or(together.clone())?;
        let mut changes = Vec::new();
        for six in &self.others {
            let six = all_or_none(six.each_ref().map(of)).ok_or(together.clone())?;
            let approach = relative(six.each_ref().map(|impact| impact.approach.clone()));
            changes.push(HardImpact { approach, push: relative(six.each_ref().map(|impact| impact.push.clone())) });
        }
        let approaches: Vec<DVector<f64>> = changes.iter().map(|change| change.approach.clone()).collect();
        let approach = self.sloped(&impact.approach, &approaches);
        if approach.value > 0.0 {
            self.impacts.push((particle, self.time.clone(), approach.clone()));
        }
        let WallLaw::Hard(law) = self.nominal.mount.cavities[particle].wall(side) else { return Ok(()) };
        let speed = approach.value;
        let joint = self.nominal.mount.joint_of(particle);
        let rests = after
            .is_some_and(|after| after.touches[particle] == Touch::Wall(side) && after.slides[joint] == Slide::Stuck);
        // A bounce lower than rounding is none.
        let (e, by_speed, by_quantity) =
            if rests { (0.0, 0.0, vec![0.0; self.others.len()]) } else { self.rebound(law, (particle, side), speed)? };
        let change = (1.0 + e) * speed;
        let mut slopes = (1.0 + e + by_speed * speed) * &approach.slopes;
        slopes.iter_mut().zip(by_quantity).for_each(|(slope, by)| *slope += by * speed);
        self.w += change * &impact.push;
        self.s += &impact.push * slopes.transpose();
        for (column, by) in changes.iter().enumerate() {
            let mut own = self.s.column_mut(column);
            own += change * &by.push;
        }
        Ok(())
    }

    /// e of a wall at a speed, and its derivatives by the speed and per relative change of the quantities.
    fn rebound(
        &self,
        law: &ImpactLaw<f64>,
        (particle, side): (usize, Sign),
        speed: f64,
    ) -> Result<(f64, f64, Vec<f64>), NoDerivatives> {
        let with_speed = Varied::AT.map(|factor| law.at(factor * speed));
        let with_quantities = self.others.iter().map(|six| {
            six.each_ref().map(|setting| match setting.mount.cavities[particle].wall(side) {
                WallLaw::Hard(law) => law.at(speed),
                WallLaw::Soft { .. } | WallLaw::Hertz(_) | WallLaw::Piezoelectric(_) => f64::NAN,
            })
        });
        let with_quantities: Vec<[f64; 6]> = with_quantities.collect();
        if with_quantities.iter().chain([&with_speed]).any(|at| has_kink(*at)) {
            return Err(NoDerivatives::Kink { time_s: self.time.value });
        }
        let by_quantity = with_quantities.into_iter().map(relative).collect();
        Ok((law.at(speed), relative(with_speed) / speed, by_quantity))
    }

    /// The engine's state must be the one that follows from the event alone.
    pub(super) fn check_state(&self, next: &[f64]) -> Result<(), NoDerivatives> {
        let bodies = self.bodies();
        let apart = |from: usize| {
            let of = |i: usize| (self.size_of(i) * (self.w[i] - next[i])).abs();
            (from..from + bodies).map(of).fold(0.0, f64::max)
        };
        let [size_m, size_m_per_s] = self.sizes;
        if apart(0) <= OTHER_STATE * size_m && apart(bodies) <= OTHER_STATE * size_m_per_s {
            return Ok(());
        }
        Err(NoDerivatives::Together { time_s: self.time.value })
    }
}
