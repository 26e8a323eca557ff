//! What the loads of piezoelectric walls take.

use damprig_core::integrator::modes::Sign;

use crate::motion::Motion;
use crate::observe::{Observer, Piece};

/// What the load of a piezoelectric wall takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harvested {
    /// Number of the impact damper.
    pub damper: usize,
    /// +1 for the wall on the positive side, −1 for the other.
    pub side: Sign,
    /// ∫RI² dt, J.
    pub energy_j: f64,
    /// Largest magnitude of the voltage, V.
    pub largest_abs_v: f64,
    /// The voltage now, V.
    pub voltage_v: f64,
}

/// What the loads of all piezoelectric walls take of a motion that is observed from now on. The integrals are in closed form, and the largest voltages are those
/// between the steps too.
#[derive(Clone, Debug)]
pub struct Harvest {
    walls: Vec<Harvested>,
}

impl Harvest {
    /// From now on.
    #[must_use]
    pub fn new(motion: &Motion) -> Self {
        let (_, rates) = motion.bodies();
        let walls = motion.mount.piezoelectric_walls().map(|(damper, side, wall)| {
            let voltage_v = motion.mount.bodies.damping[wall.charge] * rates[wall.charge];
            Harvested { damper, side, energy_j: 0.0, largest_abs_v: voltage_v.abs(), voltage_v }
        });
        Self { walls: walls.collect() }
    }

    /// Every piezoelectric wall, in the order of [`State::charges_c`](crate::State::charges_c).
    #[must_use]
    pub fn walls(&self) -> &[Harvested] {
        &self.walls
    }
}

impl Observer for Harvest {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        for wall in &mut self.walls {
            if let (Some(voltage), Some(load_ohm)) =
                (piece.voltage_v(wall.damper, wall.side), piece.load_ohm(wall.damper, wall.side))
            {
                wall.voltage_v = voltage.at(piece.length_s).0;
                wall.energy_j += voltage.square_m2_s() / load_ohm;
                // A wall that nothing presses only discharges.
                wall.largest_abs_v = match piece.pressed_side(wall.damper) {
                    Some(side) if side == wall.side => voltage.largest_abs((0.0, piece.length_s), wall.largest_abs_v),
                    _ => wall.largest_abs_v.max(voltage.at(0.0).0.abs()),
                };
            }
        }
    }
}
