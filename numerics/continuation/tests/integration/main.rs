//! Claims about branches of periodic orbits, against closed forms and simulations.

mod common;
mod derivatives;
mod every_damper;
mod return_map;
mod shooting;
mod special_points;
mod two_impacts;
