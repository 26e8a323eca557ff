//! The exact driver: excitation in closed form, `f64`, every event certified.
//!
//! Between events a set-up in one mode ([`crate::integrator::modes`]) is a linear system with constant coefficients.
//! Its motion over an *arc* of at most 0.8 rad of the fastest rate is its own power series to the last bit
//! ([`flow`]); the excitation is one rotating pair ([`excitation`]), so no sine or cosine is taken in the loop.
//! An event is a *guard* (gap, relative velocity, force within its limit) that stops being positive.
//!
//! # No event is missed
//! Arcs follow each other without gaps, and each is left only by one of two ways:
//! 1. **The quick test** (`Exact::quick`). With the cubic `H` that shares value and slope with a gap `g` at both ends
//!    of an arc (τ = 0 … 1), `|g − H| ≤ τ²(1−τ)² M₄/24`, `M₄ ≥ max |g⁗|` (Hermite's remainder). In Bernstein form
//!    `H = b₀(1−τ)³ + 3b₁τ(1−τ)² + 3b₂τ²(1−τ) + b₃τ³`, so
//!    `g ≥ b₀(1−τ)³ + b₃τ³ + τ(1−τ)[3b₁(1−τ) + 3b₂τ − τ(1−τ)M₄/24]`, and the bracket is at least
//!    `3 min(b₁, b₂) − M₄/96`. With `b₀ ≥ 0`, `b₃ > 0` and `min(b₁, b₂) > M₄/288` the gap is positive inside the arc, also
//!    when it starts from contact (`b₀ = 0`). `M₄` is the sum of the series' coefficient magnitudes, so it
//!    holds all along the arc. Relative velocities are tested against their chord, error at most `max |p″|/8`.
//! 2. **The walk** ([`series::first_failure`]), where the proof stands.
//!
//! Remainders left out: the series beyond its 18 terms, 3·10⁻¹⁸ of the amplitude, and rounding. So what is certified
//! is: an event deeper than some ten roundings of the amplitude is never passed. A touch more grazing than that
//! cannot be told from a miss in this arithmetic.
//!
//! # Accumulating impacts
//! A particle that bounces ever lower comes to rest after infinitely many impacts in finite time. When the pressing
//! acceleration A is sure to last, the impacts still to come are summed: momentum is kept by all of them, and while
//! the particle is off the wall the spring sees the structure displaced by m/(M+m) times the gap, which changes the
//! common velocity by `k m/(M+m)²·⅔ V³/(A²(1−e³))` in all. The sum is taken when what it leaves out is below rounding.
//!
//! What sees a run is in [`observe`], what is computed from it in [`response`].

mod driver;
mod events;
pub mod excitation;
pub mod flow;
mod guards;
pub mod observe;
pub mod response;
pub mod series;
pub mod time;

pub use driver::{Exact, Touch};
pub use excitation::Excitation;
pub use flow::State;
pub use observe::{Arc, ContactEnd, Impact, Observer};
