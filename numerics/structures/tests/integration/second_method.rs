//! A second method for the motion of a structure with dampers: a Runge–Kutta method of order 8 in small steps, events by changes of
//! sign, states of joints by enumeration. It shares no code with the crate but the data of a set-up.
//!
//! Its tests compare it with closed forms and, with one degree of freedom, with the exact integrator of the core.

mod closed_forms;
mod convex;
mod equations;
mod one_degree_of_freedom;
mod reference;
mod runge_kutta;

pub use reference::{Counts, Reference};
