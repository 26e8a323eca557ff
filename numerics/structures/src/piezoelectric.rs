//! A piezoelectric wall as springs between the particle, its place and the charge that its load has taken.

use crate::bodies::Link;

/// The equations of a piezoelectric wall; its load is the damping of a body without mass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piezoelectric {
    /// k at short circuit, N/m.
    pub stiffness: f64,
    /// C, F.
    pub capacitance: f64,
    /// θ, N/V.
    pub coupling: f64,
    /// Number of the charge among the bodies.
    pub charge: usize,
}

impl Piezoelectric {
    /// C + θ²/k of the wall that nothing touches, F.
    fn free_capacitance(&self) -> f64 {
        self.capacitance + self.coupling * self.coupling / self.stiffness
    }

    /// Stiffness of the charge of the wall that nothing touches, V/C.
    pub fn free_stiffness(&self) -> f64 {
        1.0 / self.free_capacitance()
    }

    /// Where the surface stands per charge while nothing touches it, m/C.
    pub fn stands_m_per_c(&self) -> f64 {
        self.coupling / (self.stiffness * self.free_capacitance())
    }

    /// Stiffness at open circuit, N/m.
    pub fn open_stiffness(&self) -> f64 {
        self.stiffness + self.coupling * self.coupling / self.capacitance
    }

    /// The wall under a particle whose displacement towards its side is `row · q`, with `end` of it before the wall: what is added to the bodies, and
    /// how far each spring is from its rest where q is 0, m or C.
    pub fn pressed(&self, row: &[f64], end: f64) -> [(Link, f64); 3] {
        let spring = |row: Vec<f64>, stiffness: f64| Link { row, stiffness, damping: 0.0 };
        let mut charge = vec![0.0; row.len()];
        charge[self.charge] = 1.0;
        let between = row.iter().zip(&charge).map(|(row, charge)| self.coupling * row - charge).collect();
        [
            (spring(row.to_vec(), self.stiffness), end),
            (spring(between, 1.0 / self.capacitance), self.coupling * end),
            (spring(charge, -self.free_stiffness()), 0.0),
        ]
    }

    /// Energy of the wall at a penetration and a charge, less that of the charge in the wall that nothing touches, J.
    pub fn pressed_energy_j(&self, penetration_m: f64, charge_c: f64) -> f64 {
        let on_electrodes = self.coupling * penetration_m - charge_c;
        0.5 * (self.stiffness * penetration_m * penetration_m + on_electrodes * on_electrodes / self.capacitance
            - self.free_stiffness() * charge_c * charge_c)
    }
}
