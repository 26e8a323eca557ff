//! Checks of the engine for structures of several degrees of freedom.

mod closed_forms;
mod derivatives;
mod energy;
mod guided;
mod hertz;
mod laws;
mod one_degree;
mod one_mode;
mod orbit_derivatives;
mod piezoelectric;
mod piezoelectric_second_method;
mod piezoelectric_walls;
mod random_set_ups;
mod refusals;
mod second_method;
