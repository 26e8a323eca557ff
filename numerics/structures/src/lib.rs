//! Linear structures of several degrees of freedom with impact, friction and tuned mass dampers: exact motion from event to event.
//!
//! Every state of the contacts (each particle free, held or in a soft, piezoelectric or Hertz wall, each friction damper sticking or slipping in a
//! direction) is a linear system with constant coefficients. Its motion is a sum of exponentials and, on a base that follows samples or in a Hertz wall,
//! of polynomials in time (`linear`); events are the first roots of linear functions of the motion (`guard`); forces at rest and impulses follow from convex problems
//! (`complementarity`).
//!
//! # No event is missed
//! A step is taken only when each guard is proved to stay positive over it, or to fall through zero once. The proofs use values
//! and slopes at both ends and bounds that hold for the whole step: amplitudes of natural motions never grow. A step that
//! is not decided is halved; `Motion::unresolved` counts the steps that do without the proof of guards at zero, at the smallest length first. Rounding
//! is neglected: of the motion, whose parts near a resonance are many times larger than their sum.
//!
//! Impacts within 1e-12 of the displacements from each other, and forces within rounding of their limits, count as one instant.
//!
//! # Laws of contact
//! - Coulomb friction with a constant limit: at zero relative velocity the accelerations solve a convex problem and are unique, whatever
//!   number of joints sticks at once.
//! - Impacts at one instant are solved together (Moreau): each contact separates at least at e times its approach, and at
//!   exactly that if it has an impulse. Resting contacts take part with an approach of zero. For several impacts at one instant this is a choice:
//!   bodies that are hit one after the other would separate otherwise. No such impact gains energy, as each impulse acts against the mean of
//!   approach and separation.
//! - An instantaneous impact acts on the mass of all modes at its place, however stiff they are: e is that of the contact alone, and the
//!   energy that goes into fast modes looks like a lower one.
//! - A particle whose bounces are lower than rounding rests on its wall.
//! - A piezoelectric wall pushes while its force is positive. Its charge has no inertia: an equation of first order beside those of the bodies (`circuits`).
//!   The surface that nothing touches stands elsewhere with the charge, and the next contact begins there.
//! - A Hertz wall pushes with k δ^1.5 (1 + β δ′) ≥ 0 from δ = 0 to δ = 0. Over short pieces this is a cubic in time with a stated error, beside motions in
//!   closed form (`squeeze`). Derivatives of a motion are not known with such a wall, and are refused.

mod basis;
mod bodies;
mod circuits;
mod collocation;
mod complementarity;
mod contacts;
mod course;
mod derivatives;
mod describe;
mod energy;
mod events;
mod flight;
mod guard;
mod guided;
mod harvest;
mod integrals;
mod linear;
mod motion;
mod mount;
mod natural_motions;
mod observe;
mod piezoelectric;
mod polynomial;
mod push;
mod refused;
mod set_up;
mod squeeze;
mod state;
mod stepping;
mod sum;
mod system;

pub use course::Course;
pub use derivatives::{
    Derivatives, Derived, DerivedImpact, Drive, GRAZING, Largest, MotionCase, NoDerivatives, Orbit, Returned, Section,
    Varied,
};
pub use describe::{Beam, Damping, MAX_MODES, Storey, Support};
pub use energy::EnergyBook;
pub use harvest::{Harvest, Harvested};
pub use motion::Motion;
pub use observe::{HertzContact, Impact, Observer, Piece};
pub use refused::Refused;
pub use set_up::{
    FrictionJoint, HarmonicForce, ImpactDamper, Mode, Modes, PiezoelectricWall, SetUp, TunedMass, base_at_start,
};
pub use state::{Body, State};
