//! Exact event-driven integrator: closed-form excitation, power-series arcs in `f64`, certified event location.
//!
//! Between events a set-up in one mode ([`crate::integrator::modes`]) is a linear system with constant coefficients.
//! The motion is computed in *arcs* of at most 0.8 rad of the fastest rate. Over an arc it is a power series, exact to
//! the last bit ([`flow`]). The excitation is one rotating pair ([`excitation`]), so the loop evaluates no sine or
//! cosine. Each *guard* (gap, relative velocity, force within its limit) is a function that is positive while its mode
//! lasts; an event is the instant at which a guard stops being positive.
//!
//! # No event is missed
//! Arcs (τ = 0 … 1) follow each other without gaps. The driver completes an arc only after one of two proofs about its
//! events.
//!
//! **End-point proof** (`endpoint_proof`), where the structure (with or without a particle held to it) is one oscillator. Let
//! `Mₙ ≥ max |x⁽ⁿ⁾|` over the arc: it is the sum of the series' coefficient magnitudes, so it holds for the whole arc.
//! A function lies within `max |f″|/8` of its chord.
//! 1. *Moves one way.* If the particle's relative velocity has the same sign at both ends and its magnitude there
//!    exceeds `M₃/8`, it keeps that sign over the whole arc: the particle neither stops nor turns. The gap behind it
//!    grows and the gap ahead shrinks. If the gap ahead is positive at the end, there is no event; otherwise there is
//!    exactly one root.
//! 2. *Pressed.* If the gap's acceleration is below `−M₄/8` at both ends, the gap is concave. If it starts at zero or
//!    above and ends below zero, it has exactly one root (besides the one it starts from). A concave function lies
//!    below its first tangent, which keeps the other wall out of reach.
//! 3. *Clear.* Let the cubic `H` have the value and slope of a gap `g` at both ends; then `|g − H| ≤ τ²(1−τ)² M₄/24`
//!    (Hermite's remainder). In Bernstein form `H = b₀(1−τ)³ + 3b₁τ(1−τ)² + 3b₂τ²(1−τ) + b₃τ³`, so
//!    `g ≥ b₀(1−τ)³ + b₃τ³ + τ(1−τ)[3b₁(1−τ) + 3b₂τ − τ(1−τ)M₄/24]`, and the bracket is at least
//!    `3 min(b₁, b₂) − M₄/96`. With `b₀ ≥ 0`, `b₃ > 0` and `min(b₁, b₂) > M₄/288` the gap is positive inside the arc,
//!    also when it starts from contact (`b₀ = 0`).
//! 4. *Held.* Where the structure's acceleration stays within the limits by more than `M₄/8` at both ends, a held
//!    particle stays held. Slip on the friction damper is tested as in 1, with an additional bound for the base's
//!    velocity.
//!
//! Newton's method inside a bracket finds the single root of cases 1 and 2. Once within 10⁻³ of an arc of it, five
//! derivatives give the root to the last bits (`arc_roots`).
//!
//! **Walk** ([`series::first_failure`], which contains the proof). It handles every arc that the end-point proof does
//! not decide.
//!
//! Two remainders are neglected: the series beyond its 18 terms, 3·10⁻¹⁸ of the amplitude, and rounding. The certified
//! statement is therefore: an event deeper than about ten roundings of the amplitude is never passed. This arithmetic
//! cannot tell a shallower touch from a miss.
//!
//! # Accumulating impacts
//! A particle that bounces ever lower comes to rest after infinitely many impacts in finite time (chatter). Once the
//! pressing acceleration A is certain to last, the remaining impacts are summed. Each of them conserves momentum. While
//! the particle is off the wall, the spring sees the structure displaced by m/(M+m) times the gap; in total this
//! changes the common velocity by `k m/(M+m)²·⅔ V³/(A²(1−e³))`. The sum is taken when its neglected terms are below
//! rounding and its impacts are slower than 10⁻⁴ of the fastest impact of the run; [`Observer::accumulation`] reports
//! it.
//!
//! # Hertz walls
//! A contact with a Hertz wall is not linear. `squeeze` integrates it in pieces with a stated error, which the walk takes as
//! arcs; the wall's force at zero penetration is zero, so that no other arc depends on it.
//!
//! [`observe`] defines the observers of a run; [`response`] computes results from what they receive.

mod arc_roots;
mod driver;
mod endpoint_proof;
mod events;
pub mod excitation;
pub mod flow;
mod guards;
mod motion;
pub mod observe;
mod oscillator;
pub mod response;
pub mod series;
mod squeeze;
pub mod time;

pub use excitation::Excitation;
pub use flow::ExactState;
pub use motion::{Exact, Touch, Work};
pub use observe::{Accumulation, Arc, ContactEnd, HertzContact, Impact, Observer};
