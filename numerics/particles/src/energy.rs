//! The energy book of a motion.

/// Energies of a motion now, and what has been lost and put in since its start. The book closes: what is
/// held plus what is lost is what was held at the start plus the work, within the error of the step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energies {
    /// Kinetic energy of the structure, J.
    pub structure_kinetic_j: f64,
    /// Of its spring, J.
    pub spring_j: f64,
    /// Kinetic energy of the spheres, rotation included, J.
    pub spheres_kinetic_j: f64,
    /// Of the spheres' weight above the floor, J.
    pub weight_j: f64,
    /// Stored in contacts, J.
    pub contacts_j: f64,
    /// Lost along the lines of centres of contacts since the start, J.
    pub lost_in_impacts_j: f64,
    /// Lost across them, J.
    pub lost_in_friction_j: f64,
    /// Lost in the structure's viscous damping, J.
    pub lost_in_structure_j: f64,
    /// Work of base and force since the start, J.
    pub work_j: f64,
}

impl Energies {
    /// Energy in motion, springs and weight, J.
    #[must_use]
    pub fn held_j(&self) -> f64 {
        self.structure_kinetic_j + self.spring_j + self.spheres_kinetic_j + self.weight_j + self.contacts_j
    }

    /// Lost in the contacts since the start, J.
    #[must_use]
    pub fn lost_in_contacts_j(&self) -> f64 {
        self.lost_in_impacts_j + self.lost_in_friction_j
    }

    /// Held plus lost less work, J: constant in an exact motion.
    #[must_use]
    pub fn book_j(&self) -> f64 {
        self.held_j() + self.lost_in_contacts_j() + self.lost_in_structure_j - self.work_j
    }
}
