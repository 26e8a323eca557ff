//! The exact driver: excitation in closed form, `f64`, every event certified.
//!
//! Between events a set-up in one mode ([`crate::integrator::modes`]) is a linear system with constant coefficients.
//! Its motion over an *arc* of at most 0.8 rad of the fastest rate is its own power series to the last bit
//! ([`flow`]); the excitation is one rotating pair ([`excitation`]), so no sine or cosine is taken in the loop.
//! An event is a *guard* (gap, relative velocity, force within its limit) that stops being positive.
//!
//! # No event is missed
//! Arcs (τ = 0 … 1) follow each other without gaps, and each is left only by one of two ways.
//!
//! **By its ends** (`quick`), where the structure (with or without a particle held to it) is one oscillator. Let
//! `Mₙ ≥ max |x⁽ⁿ⁾|` over the arc: the sum of the series' coefficient magnitudes, so it holds all along it. A function
//! lies within `max |f″|/8` of its chord.
//! 1. *Moves one way.* If the particle's relative velocity has one sign at both ends and is larger there than `M₃/8`, it
//!    has that sign all along: it neither stops nor turns. The gap behind it grows, the gap ahead falls: where that is
//!    positive at the end nothing happens, where it is not there is exactly one root.
//! 2. *Pressed.* If the gap's acceleration is below `−M₄/8` at both ends, the gap is concave. It starts at zero or
//!    above and ends below: exactly one root (besides the one it starts from). A concave function lies below its first
//!    tangent, which keeps the other wall out of reach.
//! 3. *Clear.* With the cubic `H` that shares value and slope with a gap `g` at both ends, `|g − H| ≤ τ²(1−τ)² M₄/24`
//!    (Hermite's remainder). In Bernstein form `H = b₀(1−τ)³ + 3b₁τ(1−τ)² + 3b₂τ²(1−τ) + b₃τ³`, so
//!    `g ≥ b₀(1−τ)³ + b₃τ³ + τ(1−τ)[3b₁(1−τ) + 3b₂τ − τ(1−τ)M₄/24]`, and the bracket is at least
//!    `3 min(b₁, b₂) − M₄/96`. With `b₀ ≥ 0`, `b₃ > 0` and `min(b₁, b₂) > M₄/288` the gap is positive inside the arc,
//!    also when it starts from contact (`b₀ = 0`).
//! 4. *Held.* Where the structure's acceleration stays within the limits by more than `M₄/8` at both ends, a held
//!    particle stays held. Slip on the friction damper is tested as in 1, the base's share with its own bound.
//!
//! The one root of 1 and 2 is found by Newton's method inside a bracket; from within 10⁻³ of an arc five derivatives
//! carry it to the last bits (`near`).
//!
//! **By the walk** ([`series::first_failure`]), where the proof stands; it takes what the ends do not prove.
//!
//! Remainders left out: the series beyond its 18 terms, 3·10⁻¹⁸ of the amplitude, and rounding. So what is certified
//! is: an event deeper than some ten roundings of the amplitude is never passed. A touch more grazing than that
//! cannot be told from a miss in this arithmetic.
//!
//! # Accumulating impacts
//! A particle that bounces ever lower comes to rest after infinitely many impacts in finite time. When the pressing
//! acceleration A is sure to last, the impacts still to come are summed: momentum is kept by all of them, and while
//! the particle is off the wall the spring sees the structure displaced by m/(M+m) times the gap, which changes the
//! common velocity by `k m/(M+m)²·⅔ V³/(A²(1−e³))` in all. The sum is taken when what it leaves out is below rounding and
//! the impacts in it are slower than 10⁻⁴ of the run's fastest; [`Observer::accumulation`] reports it.
//!
//! What sees a run is in [`observe`], what is computed from it in [`response`].

mod driver;
mod events;
pub mod excitation;
pub mod flow;
mod guards;
mod near;
pub mod observe;
mod quick;
pub mod response;
pub mod series;
pub mod time;

pub use driver::{Exact, Touch, Work};
pub use excitation::Excitation;
pub use flow::ExactState;
pub use observe::{Accumulation, Arc, ContactEnd, Impact, Observer};
