//! Checks of the engine for structures of several degrees of freedom.

mod one_degree;
