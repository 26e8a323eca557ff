//! The largest Lyapunov exponent of a motion under a sine, from the exact derivative of its return map (saltation included).

use damprig_continuation::{ReturnMap, UnresolvedEvent};
use damprig_core::integrator::exact::ExactState;
use damprig_structures::{MotionCase, NoDerivatives, Section};
use nalgebra::DVector;
use serde::Serialize;

use super::periodic_orbit::initial;

/// Drive periods before: the motion may leave a transient, and the disturbance turns into the direction that grows most.
const BEFORE: u32 = 1_000;

/// Drive periods over which its growth is taken, in blocks whose scatter gives the error.
const BLOCKS: u32 = 40;
const PERIODS_PER_BLOCK: u32 = 50;

/// Exponents up to this are those of a motion whose disturbances stay, as without damping: rounding.
const LEAST: f64 = 1e-9;

/// An exponent is told from zero beyond so many errors.
const SURE: f64 = 3.0;

/// How fast small disturbances grow or decay along a motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lyapunov {
    /// Mean of ln(growth) in a drive period.
    pub per_period: f64,
    /// Its standard error, from the scatter between blocks of periods.
    pub error: f64,
    /// Drive periods over which it was taken.
    pub periods: u32,
}

impl Lyapunov {
    /// Of the motion that goes on from `start`; `map` is that of one drive period. `None` where every disturbance is gone after a period.
    ///
    /// # Errors
    /// An event that is not resolved.
    pub fn of(map: &ReturnMap, start: &ExactState) -> Result<Option<Self>, UnresolvedEvent> {
        let size = map.system().size();
        let mut state = *start;
        let mut disturbance = DVector::from_element(size, 1.0 / (size as f64).sqrt());
        Self::of_periods(|| {
            let here = initial(&state);
            disturbance = map.variation(&here)?.matrix * &disturbance;
            let growth = disturbance.norm();
            disturbance /= growth;
            state = map.image(&here);
            Ok(growth)
        })
    }

    /// Of a motion of a structure under a sine that goes on from the end of a run, while `goes_on` is true. `None` as for [`Lyapunov::of`].
    ///
    /// # Errors
    /// The motion has no derivatives in one of the periods, or it was stopped.
    pub fn of_structure(run: &MotionCase, goes_on: &mut dyn FnMut() -> bool) -> Result<Option<Self>, NoDerivatives> {
        let whole = run.over_periods(run.periods());
        let bodies = whole.bodies_after(whole.duration_s)?;
        let section = Section { periods: 1, advance_rad: 0.0 };
        let mut period = run.at_section(run, section, &bodies)?;
        let mut disturbance = None;
        Self::of_periods(|| {
            if !goes_on() {
                return Err(NoDerivatives::Stopped);
            }
            let returned = period.returned(&[])?;
            let here = disturbance.take().unwrap_or_else(|| returned.along.column_sum());
            let mut there = &returned.becomes * returned.coordinates(&here);
            let growth = returned.size_of(&there) / returned.size_of(&here);
            there /= returned.size_of(&there);
            disturbance = Some(there);
            period = period.at_section(&period, section, returned.end.as_slice())?;
            Ok(growth)
        })
    }

    /// From the growth of a disturbance in one drive period after another.
    fn of_periods<E>(mut growth: impl FnMut() -> Result<f64, E>) -> Result<Option<Self>, E> {
        let mut grow = |periods: u32| {
            let mut sum = 0.0;
            for _ in 0..periods {
                let growth = growth()?;
                if growth == 0.0 || !growth.is_finite() {
                    return Ok(None);
                }
                sum += growth.ln();
            }
            Ok(Some(sum))
        };
        if grow(BEFORE)?.is_none() {
            return Ok(None);
        }
        let mut blocks = Vec::new();
        for _ in 0..BLOCKS {
            let Some(sum) = grow(PERIODS_PER_BLOCK)? else { return Ok(None) };
            blocks.push(sum / f64::from(PERIODS_PER_BLOCK));
        }
        let count = f64::from(BLOCKS);
        let per_period = blocks.iter().sum::<f64>() / count;
        let square: f64 = blocks.iter().map(|block| (block - per_period).powi(2)).sum();
        let error = (square / (count - 1.0) / count).sqrt();
        Ok(Some(Self { per_period, error, periods: BLOCKS * PERIODS_PER_BLOCK }))
    }

    /// Whether disturbances grow, beyond doubt: a motion that stays bounded is then chaotic, at least as long as this.
    #[must_use]
    pub fn is_chaotic(&self) -> bool {
        self.per_period > (SURE * self.error).max(LEAST)
    }

    /// Whether they decay, beyond doubt: the motion settles.
    #[must_use]
    pub fn is_settling(&self) -> bool {
        self.per_period < -(SURE * self.error).max(LEAST)
    }
}
