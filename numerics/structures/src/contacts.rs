//! States of the contacts, and the events that end one.

use damprig_core::integrator::modes::{Sign, signed};

use crate::bodies::{Link, add};
use crate::complementarity::Limits;
use crate::mount::{Mount, WallLaw};

/// Whether the two sides of a joint move against each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Slide {
    /// In this direction; 0 without friction.
    Free(Sign),
    /// They move together.
    Stuck,
}

/// What a particle touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Touch {
    None,
    /// It rests at the hard wall of that side.
    Wall(Sign),
    /// It presses into the soft, piezoelectric or Hertz wall of that side.
    Pressing(Sign),
    /// That soft wall does not push it; it is not yet back inside the clearance.
    Leaving(Sign),
}

/// The state of all contacts.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Contacts {
    /// Of each joint.
    pub slides: Vec<Slide>,
    /// Of each particle.
    pub touches: Vec<Touch>,
}

impl Contacts {
    /// Force of a sliding joint along its row, N; 0 of one that sticks.
    pub fn sliding_force(&self, mount: &Mount, joint: usize) -> f64 {
        match self.slides[joint] {
            Slide::Free(direction) => -signed(direction, mount.joints[joint].friction_n),
            Slide::Stuck => 0.0,
        }
    }

    /// The constant forces on all bodies, N, but for joints that stick, and the soft walls that are pressed as links.
    pub fn loads(&self, mount: &Mount) -> (Vec<f64>, Vec<Link>) {
        let (mut constant, mut pressed) = (vec![0.0; mount.bodies.len()], Vec::new());
        for (number, joint) in mount.joints.iter().enumerate() {
            add(&mut constant, self.sliding_force(mount, number), &joint.row);
        }
        for (particle, (cavity, touch)) in mount.cavities.iter().zip(&self.touches).enumerate() {
            constant[mount.permanent + particle] -= cavity.weight_n;
            let Touch::Pressing(side) = *touch else { continue };
            let row = mount.offset_row(particle);
            match *cavity.wall(side) {
                // The force of a Hertz wall changes within a piece.
                WallLaw::Hard(_) | WallLaw::Hertz(_) => {}
                WallLaw::Soft { stiffness, damping, .. } => {
                    pressed.push(Link { row: row.to_vec(), stiffness, damping });
                    add(&mut constant, stiffness * cavity.wall_at(side), row);
                }
                WallLaw::Piezoelectric(wall) => {
                    let row: Vec<f64> = row.iter().map(|of| signed(side, *of)).collect();
                    for (link, from) in wall.pressed(&row, cavity.end(side)) {
                        add(&mut constant, link.stiffness * from, &link.row);
                        pressed.push(link);
                    }
                }
            }
        }
        (constant, pressed)
    }

    /// Limits of a joint's force along its row at zero relative velocity, N. A hard wall pushes without limit.
    pub fn limits(&self, mount: &Mount, joint: usize) -> Limits {
        let friction = mount.joints[joint].friction_n;
        let (low, high) = match mount.particle_of(joint).map(|particle| self.touches[particle]) {
            Some(Touch::Wall(1)) => (f64::NEG_INFINITY, friction),
            Some(Touch::Wall(_)) => (-friction, f64::INFINITY),
            _ => (-friction, friction),
        };
        Limits { low, high }
    }

    /// Whether a joint can stick: friction or a wall acts in it.
    pub fn may_stick(&self, mount: &Mount, joint: usize) -> bool {
        let limits = self.limits(mount, joint);
        limits.low < limits.high
    }
}

/// What ends a state of the contacts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// The relative velocity of a joint becomes zero.
    Stops(usize),
    /// The force of a joint that sticks reaches a limit; it will slide in that direction.
    Breaks(usize, Sign),
    /// A particle reaches a wall.
    Wall(usize, Sign),
    /// A soft, piezoelectric or Hertz wall releases a particle.
    Releases(usize, Sign),
    /// A released particle is back inside the clearance.
    Inside(usize, Sign),
}
