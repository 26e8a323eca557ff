//! `damprig simulate`: a case from a file, its motion, and what is kept of it.
//!
//! The motion is core's: [`damprig_core::integrator::exact`] when the excitation is known in closed form,
//! [`damprig_core::integrator::sampled`] on a record. Here are the file ([`case`]), the run and its
//! figures ([`result`]), and what may watch it ([`motion`]): a history in a file ([`time_history`]), an outline for a picture
//! ([`envelope`]).
//!
//! ```
//! use damprig::input::Source;
//! use damprig::simulation::{Case, Request, simulate};
//!
//! let text = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0 }
//!             initial = { x_m = 0.035 }
//!             run = { duration_s = 0.4, sample_times_s = [0.2, 0.4] }";
//! let case = Case::parse(&Source::new("case.toml", text), "case")?;
//! let request = Request { keep: true, longest_part_s: 1.0, go_on: &mut |_| true };
//! let answer = simulate(&case, &mut (), request)?;
//! assert!((answer.x_m[0] + 0.035).abs() < 1e-15);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod analysis;
pub mod case;
pub mod cost;
pub mod envelope;
mod excitation;
mod json_case;
mod keys;
pub mod motion;
pub mod result;
mod sampled_driver;
pub mod statistics;
pub mod time_history;

pub use case::Case;
pub use keys::TABLES;
pub use motion::{AccumulationRecord, ImpactRecord, Samples, Viewer};
pub use result::{Answer, Request, simulate};
