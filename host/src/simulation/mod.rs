//! Simulates one case from a file, as `damprig simulate` does.
//!
//! The integrators are core's: [`damprig_core::integrator::exact`] for an excitation in closed form,
//! [`damprig_core::integrator::sampled`] for a recorded base motion; spheres in a box are followed by [`damprig_particles`]. This module reads the case file ([`case`]), runs it
//! ([`simulate()`]) and collects the result ([`result`]). A [`Viewer`] sees the motion: the time history in a file
//! ([`time_history`]), the envelope for a figure ([`envelope`]). [`analysis`] examines the steady state and its stability.
//!
//! ```
//! use damprig::input::Source;
//! use damprig::simulation::{Case, RunOptions, simulate};
//!
//! let text = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0 }
//!             initial = { x_m = 0.035 }
//!             run = { duration_s = 0.4, sample_times_s = [0.2, 0.4] }";
//! let case = Case::parse(&Source::new("case.toml", text), "case")?;
//! let options = RunOptions { keep: true, longest_part_s: 1.0, go_on: &mut |_| true };
//! let result = simulate(&case, &mut (), options)?;
//! assert!((result.x_m[0] + 0.035).abs() < 1e-15);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod analysis;
pub mod case;
pub mod collector;
pub mod cost;
pub mod envelope;
mod exact_driver;
mod excitation;
pub mod frames;
mod json_case;
mod keys;
pub mod many_particles;
pub mod multi_degree;
pub mod parameters;
mod read_case;
mod refusals;
pub mod result;
mod sampled_driver;
pub mod set_values;
pub mod settling;
mod simulate;
pub mod time_history;
pub mod wall_force;

pub use damprig_motion::{self as motion, cycle_maxima, statistics};

pub use case::Case;
pub use collector::RunOptions;
pub use keys::TABLES;
pub(crate) use keys::initial;
pub use motion::{AccumulationRecord, ImpactRecord, StateSamples, Viewer};
pub use result::SimulationResult;
pub use set_values::{SetValues, fixed_parameters};
pub use simulate::simulate;
