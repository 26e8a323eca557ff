//! The figures, drawn with [`super::plot`]. Each kind is a file of its own ([`frequency_response`], [`time_histories`],
//! [`peak_motion`], [`simulated_motion`]); [`campaign`] supplies the data of a run.

pub mod animation;
pub mod backbone;
pub mod basins;
pub mod bifurcation;
pub mod branches;
pub mod campaign;
pub mod case_overlay;
pub mod comparison;
pub mod curves;
#[cfg(test)]
mod extremes;
pub mod force_surface;
pub mod frequency_response;
pub mod modal_response;
pub mod modes_response;
pub mod next_points;
pub mod peak_motion;
pub mod resonance;
pub mod restitution;
pub mod sensitivity;
pub mod set_ups;
pub mod signals;
pub mod simulated_motion;
pub mod spectrum;
pub mod study;
pub mod study_curves;
mod study_labels;
mod study_map;
pub mod symbols;
pub mod time_histories;
pub mod transfer_function;
