//! Continuation of periodic orbits with impacts and friction.
//!
//! The systems are those of [`damprig_core::model`] under a sine of the base or of a force. Between events each mode is linear with
//! constant coefficients, so its motion is in closed form. A periodic orbit is a sequence of segments; Newton's method
//! finds it with exact derivatives, and pseudo-arclength steps follow it over a parameter through folds, whether it is stable or not.
//! The Floquet multipliers are eigenvalues of the product of the segments' transition matrices, each corrected for the shift
//! of its event (saltation).
//!
//! Structures of several degrees of freedom have their branches from the map of an orbit's start ([`Family`]).
//!
//! A motion that core simulates has the same exact derivatives, by its start and by parameters ([`ReturnMap`], [`Derivatives`]).

mod boundary_problem;
mod branch;
mod checks;
mod curve;
mod defining;
mod derivatives;
mod dual;
mod equations;
mod explore;
mod flow;
mod follower;
mod newton;
mod orbit;
mod parameter;
mod passage;
mod return_map;
mod sequence;
mod shooting;
mod special;
mod start;
mod system;
mod wall_law;

pub use boundary_problem::{Condition, When, eigenvalues};
pub use branch::{BranchEnd, Steps};
pub use curve::Curve;
pub use derivatives::{Derivatives, Derived, DerivedImpact, Largest, NoDerivatives};
pub use explore::{Branch, Diagram, Origin, Task};
pub use orbit::Orbit;
pub use parameter::{Parameter, Ties};
pub use return_map::{ReturnMap, UnresolvedEvent, Variation};
pub use sequence::{Guard, Phase, Segment, Sequence};
pub use shooting::{Family, StructureBranch, StructureDiagram, StructureOrbit, StructureSpecial, StructureTask};
pub use special::{Special, SpecialKind};
pub use start::NoStart;
pub use system::System;
