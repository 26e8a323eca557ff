//! The box, and the places of the spheres in it at the start.

use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::vector::Vector;

/// Inner lengths of the box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cavity {
    /// Along the motion, m; greater than 0.
    pub length_m: f64,
    /// Across it, horizontal, m; greater than 0.
    pub width_m: f64,
    /// Upwards, m; greater than 0.
    pub height_m: f64,
}

/// Relative margin for lengths written as a multiple of the diameter.
const ROUNDING: f64 = 1e-9;

impl Cavity {
    /// Its lengths along the motion, across it and upwards, m.
    #[must_use]
    pub fn sides_m(&self) -> [f64; 3] {
        [self.length_m, self.width_m, self.height_m]
    }

    /// Sites of a cubic lattice of this spacing along each side.
    #[must_use]
    pub fn sites(&self, diameter_m: f64) -> [usize; 3] {
        self.sides_m().map(|side_m| (side_m / diameter_m * (1.0 + ROUNDING)) as usize)
    }

    /// Spheres that it holds in a cubic packing.
    #[must_use]
    pub fn capacity(&self, diameter_m: f64) -> usize {
        self.sites(diameter_m).into_iter().fold(1, usize::saturating_mul)
    }

    /// Shortest length, m, that holds `count` spheres in layers of a cubic packing: what they take of the length.
    /// `None` if not even one fits between the sides.
    #[must_use]
    pub fn taken_length_m(&self, count: usize, diameter_m: f64) -> Option<f64> {
        let [_, across, up] = self.sites(diameter_m);
        let layer = across.checked_mul(up).filter(|layer| *layer > 0)?;
        Some(count.div_ceil(layer) as f64 * diameter_m)
    }
}

/// A layer with fewer places than this is not made coarser.
const FEW_PLACES: usize = 1 << 16;

/// Places of a layer along the length and the width. A wide box has far more of them than spheres: larger ones, still at least as many as
/// spheres, keep the list of places short.
fn layer_sites(cavity: &Cavity, count: usize, diameter_m: f64) -> [usize; 2] {
    let [mut along, mut across, _] = cavity.sites(diameter_m);
    let most = count.saturating_mul(4).max(FEW_PLACES);
    while along.saturating_mul(across) > most {
        let longer = if along >= across { &mut along } else { &mut across };
        *longer /= 2;
    }
    [along, across]
}

/// Draws the centres of spheres at the start, m, from the middle of the box and its floor: horizontal layers of a square lattice from
/// the floor upwards, spread over the length and the width, each sphere shifted at random within its place; the highest layer has its
/// spheres at random places. `None` if the box does not hold them ([`Cavity::capacity`]).
#[must_use]
pub fn packing(cavity: &Cavity, count: usize, diameter_m: f64, seed: u64) -> Option<Vec<Vector>> {
    if count > cavity.capacity(diameter_m) {
        return None;
    }
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut share = || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let [along, across] = layer_sites(cavity, count, diameter_m);
    let spacing_m = [cavity.length_m / along as f64, cavity.width_m / across as f64];
    let place = |site: usize, side: usize, share: f64| {
        let corner_m = -0.5 * cavity.sides_m()[side] + (site as f64 + 0.5) * spacing_m[side];
        corner_m + (share - 0.5) * (spacing_m[side] - diameter_m).max(0.0)
    };
    let mut centres = Vec::with_capacity(count);
    let mut layer = 0;
    while centres.len() < count {
        let mut sites: Vec<usize> = (0..along * across).collect();
        // Fisher and Yates.
        for last in (1..sites.len()).rev() {
            sites.swap(last, ((share() * (last + 1) as f64) as usize).min(last));
        }
        sites.truncate(count - centres.len());
        sites.sort_unstable();
        for site in sites {
            let (x_m, y_m) = (place(site % along, 0, share()), place(site / along, 1, share()));
            centres.push([x_m, y_m, (layer as f64 + 0.5) * diameter_m]);
        }
        layer += 1;
    }
    Some(centres)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{length, minus};

    #[test]
    fn packed_spheres_neither_overlap_nor_leave_the_box_and_follow_the_seed() {
        let cavity = Cavity { length_m: 0.0405, width_m: 0.02, height_m: 0.013 };
        let diameter_m = 0.004;
        assert_eq!(cavity.capacity(diameter_m), 10 * 5 * 3);
        let centres = packing(&cavity, 120, diameter_m, 3).expect("they fit");
        for (place, centre) in centres.iter().enumerate() {
            for other in &centres[..place] {
                assert!(length(&minus(centre, other)) >= diameter_m * (1.0 - 1e-12));
            }
            for (side, low_m) in [(0, -0.02025), (1, -0.01), (2, 0.0)] {
                let from_wall_m = (centre[side] - low_m).min(low_m + cavity.sides_m()[side] - centre[side]);
                assert!(from_wall_m >= 0.5 * diameter_m * (1.0 - 1e-9), "{centre:?}");
            }
        }
        assert_eq!(Some(centres.clone()), packing(&cavity, 120, diameter_m, 3));
        assert_ne!(Some(centres), packing(&cavity, 120, diameter_m, 4));
        assert_eq!(packing(&cavity, 151, diameter_m, 3), None);
    }

    #[test]
    fn a_wide_box_of_tiny_spheres_is_packed_with_no_more_places_than_spheres_need() {
        for (length_m, width_m, count) in [(100.0, 100.0, 5_000), (100.0, 1e-9, 100_000), (1e-9, 1.0, 7)] {
            let cavity = Cavity { length_m, width_m, height_m: 1e-9 };
            let [along, across] = layer_sites(&cavity, count, 1e-9);
            assert!((count..=4 * count + FEW_PLACES).contains(&(along * across)), "{along} × {across}");
            let mut centres = packing(&cavity, count, 1e-9, 1).expect("they fit");
            assert_eq!(centres.len(), count);
            assert!(centres.iter().all(|[x, y, z]| {
                x.abs() <= 0.5 * length_m && y.abs() <= 0.5 * width_m && (z - 0.5e-9).abs() < 1e-12
            }));
            // No two are nearer than a diameter: neighbours along a row lie in different places.
            centres.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
            for pair in centres.windows(2) {
                assert!(length(&minus(&pair[0], &pair[1])) > 0.99e-9, "{pair:?}");
            }
        }
    }
}
