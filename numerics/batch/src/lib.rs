//! Simulates many parameter points at once, one in each lane of the processor's vector registers.
//!
//! A point is a set-up under an excitation in closed form ([`Point`]); [`simulate`] gives the outcome of each.
//!
//! # What the lanes compute
//! A particle that flies without friction between hard walls, on a structure without other dampers, under a sine. A cycle
//! is divided into equal steps of at most 0.8 rad of the fastest rate. Over a step the structure's motion is a power series
//! in its state, exact to the last bits, as in core's exact engine ([`damprig_core::integrator::exact`]); the excitation at
//! the steps is tabulated once. An impact adds to the rest of its step the motion that its push alone would cause.
//!
//! Everything else is left to the exact engine: a point with other dampers, soft walls or friction as a whole; of the others
//! each step that the lanes cannot decide, and a few at a time after it until the particle flies freely again.
//!
//! # No impact is missed
//! A lane takes a step only after one of the end-point proofs of the exact engine (see its documentation) for the whole
//! step: the particle moves one way and the wall ahead is out of reach at the end; or the gaps stay clear. It locates an
//! impact only where the particle moves one way and ends beyond the wall, so that there is exactly one; and only if after it
//! the particle is proven to move away one way to the end of the step. Any other step is undecided and goes to the exact
//! engine, which certifies its events by the walk. The guarantee is therefore the same: an event deeper than about ten
//! roundings of the amplitude is never passed. Likewise, the largest |x| of a step is taken from its ends and its turning
//! point only where the structure is proven to have at most one.
//!
//! # Error
//! Series and roots have the errors of the exact engine, a few roundings a step; both follow the same motion and differ by
//! these roundings and what the motion makes of them. On a motion that forgets its past at the rate ρ per cycle the
//! difference stays below (roundings per cycle)/(1 − ρ), some 10⁻¹³ of the amplitude; on a chaotic motion it grows until the
//! two are different samples of the same motion, as two runs of one engine from neighbouring states are.
//!
//! # The same bits everywhere
//! A point gives the same bits for every number of lanes, instruction set, grouping, order and number of threads. Each
//! operation acts on one lane alone, is rounded as IEEE 754 says, and is never fused; what a lane does next depends on its own
//! state alone; sines are core's `libm`.
//!
//! ```
//! use damprig_batch::{Point, simulate};
//! use damprig_core::integrator::exact::Excitation;
//! use damprig_core::model::{Initial, Particle, SetUp, Structure, Wall};
//!
//! let particle = |clearance_m: f64| Particle {
//!     mass_kg: 0.16,
//!     clearance_m,
//!     friction_coefficient: 0.0,
//!     wall: Wall::Restitution { coefficient: 0.5 },
//! };
//! let structure = Structure::from_modal(1.6, 2.5, 0.0038);
//! let points: Vec<Point> = (20..40)
//!     .map(|mm| Point {
//!         set_up: SetUp { particle: Some(particle(f64::from(mm) / 1e3)), ..SetUp::bare(structure) },
//!         excitation: Excitation::Sine {
//!             amplitude_m: 0.003,
//!             angular_frequency_rad_per_s: structure.angular_frequency_rad_per_s(),
//!             phase_rad: 0.0,
//!         },
//!         initial: Initial::default(),
//!         cycles: 200,
//!         steady_from_cycle: 100,
//!     })
//!     .collect();
//! let outcomes = simulate(&points, 1)?;
//! assert!(outcomes.iter().all(|o| o.impacts > 0 && o.steady_mean_m < Some(0.03)));
//! # Ok::<(), damprig_batch::InvalidPoint>(())
//! ```

mod engine;
mod motion;
mod point;
mod stop;
mod study;
mod table;
mod tops;
mod vector;

pub use point::{Outcome, Point};
pub use stop::Stop;
pub use study::{InstructionSet, InvalidPoint, simulate, simulate_on, simulate_while};
