//! How well the energy of a motion balances.

use damprig_core::analysis::energy::Balance;
use damprig_core::model::SetUp;

/// Share of the energy turned over that a balance misses, and that energy, J.
pub fn missed(set_up: &SetUp, balance: &Balance) -> (f64, f64) {
    let turned_over_j = balance.dissipated_j() + balance.input_j.abs() + balance.stored_change_j.abs();
    // The weight does much work that comes back.
    let weight_n = set_up.particle.map_or(0.0, |particle| particle.mass_kg * set_up.weight_m_per_s2().abs());
    let size_j = turned_over_j + weight_n * 0.1;
    (balance.residual_j.abs() / size_j, size_j)
}
