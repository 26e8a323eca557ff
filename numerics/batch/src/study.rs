//! Distributes the points of a study over lanes and threads.

use std::sync::atomic::{AtomicUsize, Ordering};

use damprig_core::io::Invalid;
use pulp::{Simd, WithSimd};

use crate::engine::Engine;
use crate::point::{Outcome, Point};
use crate::table::Prepared;

/// A point whose values are not physical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvalidPoint {
    /// Its place among the points, from 0.
    pub index: usize,
    /// The first such value.
    pub invalid: Invalid,
}

impl std::fmt::Display for InvalidPoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "point {}: {}", self.index, self.invalid)
    }
}

impl std::error::Error for InvalidPoint {}

/// Instructions that the lanes are computed with. The outcomes have the same bits with each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// Any processor, one lane.
    Scalar,
    /// Any processor, two lanes in plain arrays; likewise four and eight.
    TwoLanes,
    /// See [`InstructionSet::TwoLanes`].
    FourLanes,
    /// See [`InstructionSet::TwoLanes`].
    EightLanes,
    /// x86-64 with AVX2, four lanes.
    Avx2,
    /// x86-64 with AVX-512, eight lanes.
    Avx512,
}

impl InstructionSet {
    /// Those of this machine, the fastest last.
    #[must_use]
    pub fn available() -> Vec<Self> {
        let all = [Self::TwoLanes, Self::FourLanes, Self::EightLanes, Self::Scalar, Self::Avx2, Self::Avx512];
        all.into_iter().filter(|set| set.is_available()).collect()
    }

    /// The fastest of this machine.
    #[must_use]
    pub fn fastest() -> Self {
        Self::available().pop().unwrap_or(Self::Scalar)
    }

    #[cfg(target_arch = "x86_64")]
    fn is_available(self) -> bool {
        match self {
            Self::Avx2 => pulp::x86::V3::is_available(),
            Self::Avx512 => pulp::x86::V4::is_available(),
            _ => true,
        }
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn is_available(self) -> bool {
        !matches!(self, Self::Avx2 | Self::Avx512)
    }

    /// Runs with these instructions; one that the machine lacks is replaced by [`InstructionSet::Scalar`].
    fn dispatch<W: WithSimd>(self, work: W) -> W::Output {
        #[cfg(target_arch = "x86_64")]
        {
            if self == Self::Avx512
                && let Some(simd) = pulp::x86::V4::try_new()
            {
                return Simd::vectorize(simd, work);
            }
            if self == Self::Avx2
                && let Some(simd) = pulp::x86::V3::try_new()
            {
                return Simd::vectorize(simd, work);
            }
        }
        match self {
            Self::TwoLanes => Simd::vectorize(pulp::Scalar128b, work),
            Self::FourLanes => Simd::vectorize(pulp::Scalar256b, work),
            Self::EightLanes => Simd::vectorize(pulp::Scalar512b, work),
            _ => Simd::vectorize(pulp::Scalar, work),
        }
    }
}

/// Simulates every point, on that many threads (at least one), and gives the outcomes in the points' order.
///
/// # Errors
/// Names the first point with a value that is not physical; nothing is simulated then.
pub fn simulate(points: &[Point], threads: usize) -> Result<Vec<Outcome>, InvalidPoint> {
    simulate_on(points, threads, InstructionSet::fastest())
}

/// The same with given instructions; a set that the machine lacks is replaced by [`InstructionSet::Scalar`].
///
/// # Errors
/// As [`simulate`].
pub fn simulate_on(
    points: &[Point],
    threads: usize,
    instructions: InstructionSet,
) -> Result<Vec<Outcome>, InvalidPoint> {
    validate(points)?;
    let next = AtomicUsize::new(0);
    let work = || instructions.dispatch(Share { points, next: &next, go_on: &|| true });
    let mut all: Vec<(usize, Outcome)> = std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads.clamp(1, points.len().max(1))).map(|_| scope.spawn(work)).collect();
        let mut all = work();
        for other in others {
            match other.join() {
                Ok(outcomes) => all.extend(outcomes),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        all
    });
    all.sort_unstable_by_key(|(index, _)| *index);
    Ok(all.into_iter().map(|(_, outcome)| outcome).collect())
}

/// Simulates every point on this thread; `None` if `go_on`, which is asked about every millisecond, says no.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_while(points: &[Point], go_on: &dyn Fn() -> bool) -> Result<Option<Vec<Outcome>>, InvalidPoint> {
    validate(points)?;
    let next = AtomicUsize::new(0);
    let mut all = InstructionSet::fastest().dispatch(Share { points, next: &next, go_on });
    if all.len() < points.len() {
        return Ok(None);
    }
    all.sort_unstable_by_key(|(index, _)| *index);
    Ok(Some(all.into_iter().map(|(_, outcome)| outcome).collect()))
}

fn validate(points: &[Point]) -> Result<(), InvalidPoint> {
    for (index, point) in points.iter().enumerate() {
        point.validate().map_err(|invalid| InvalidPoint { index, invalid })?;
    }
    Ok(())
}

/// What one thread does: takes points until there is none.
struct Share<'a> {
    points: &'a [Point],
    next: &'a AtomicUsize,
    go_on: &'a dyn Fn() -> bool,
}

impl WithSimd for Share<'_> {
    type Output = Vec<(usize, Outcome)>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let mut outcomes = Vec::new();
        let mut scalar = Vec::new();
        let next = || self.next_for_lane(&mut scalar);
        Engine::new(simd).run(self.points, next, |index, outcome| outcomes.push((index, outcome)), self.go_on);
        outcomes.extend(scalar);
        outcomes
    }
}

impl Share<'_> {
    /// The next point for a lane. Computes those that lanes cannot.
    #[inline(never)]
    fn next_for_lane(&self, scalar: &mut Vec<(usize, Outcome)>) -> Option<(usize, Prepared)> {
        loop {
            let index = self.next.fetch_add(1, Ordering::Relaxed);
            let point = self.points.get(index)?;
            let motion = point.motion().ok()?;
            match Prepared::new(point, &motion) {
                Some(prepared) => return Some((index, prepared)),
                None => scalar.push((index, point.while_going_on(self.go_on)?)),
            }
        }
    }
}
