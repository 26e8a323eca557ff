//! Pairs of spheres that are near enough to touch soon, found with a grid of cells.
//!
//! A pair is near when its gap is below the skin. The list holds until some sphere has moved half a skin in the box.

use crate::cavity::Cavity;
use crate::contact::History;
use crate::vector::{Vector, dot, minus};

/// Gap up to which two spheres are a pair, over their diameter.
const SKIN: f64 = 0.25;

/// Most cells of a box, for each sphere in it.
const MAX_CELLS: usize = 8;

/// The pairs, sorted, with the histories of their contacts.
#[derive(Clone, Debug)]
pub struct Neighbours {
    diameter_m: f64,
    /// Low corner of the box from its middle and floor, m.
    corner_m: Vector,
    cells: [usize; 3],
    cell_m: Vector,
    pub pairs: Vec<[u32; 2]>,
    pub histories: Vec<History>,
    /// Centres in the box when the pairs were found, m.
    found_at_m: Vec<Vector>,
    /// Places in `members` at which the cells start.
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Neighbours {
    /// For `count` spheres. A large box has larger cells than its spheres need: pairs are found all the same.
    pub fn new(cavity: &Cavity, count: usize, diameter_m: f64) -> Self {
        let near_m = diameter_m * (1.0 + SKIN);
        let sides_m = cavity.sides_m();
        let mut cells = sides_m.map(|side_m| ((side_m / near_m) as usize).max(1));
        while cells.into_iter().fold(1, usize::saturating_mul) > count.max(1).saturating_mul(MAX_CELLS) {
            let longest = if cells[0] >= cells[1].max(cells[2]) { 0 } else { 1 + usize::from(cells[2] > cells[1]) };
            cells[longest] = cells[longest].div_ceil(2);
        }
        let cell_m = [0, 1, 2].map(|side| sides_m[side] / cells[side] as f64);
        Self {
            diameter_m,
            corner_m: [-0.5 * cavity.length_m, -0.5 * cavity.width_m, 0.0],
            cells,
            cell_m,
            pairs: Vec::new(),
            histories: Vec::new(),
            found_at_m: Vec::new(),
            starts: Vec::new(),
            members: Vec::new(),
        }
    }

    /// Finds the pairs again if a sphere has moved too far since. `box_m`: place of the box along the motion.
    pub fn update(&mut self, centres_m: &[Vector], box_m: f64) {
        let most_m = 0.5 * SKIN * self.diameter_m;
        let has_moved = |(now, then): (&Vector, &Vector)| {
            let moved = minus(&[now[0] - box_m, now[1], now[2]], then);
            dot(&moved, &moved) > most_m * most_m
        };
        if self.found_at_m.len() != centres_m.len() || centres_m.iter().zip(&self.found_at_m).any(has_moved) {
            self.found_at_m = centres_m.iter().map(|centre| [centre[0] - box_m, centre[1], centre[2]]).collect();
            self.find();
        }
    }

    /// Cell of a place along a side.
    fn cell(&self, centre: &Vector, side: usize) -> usize {
        let cell = ((centre[side] - self.corner_m[side]) / self.cell_m[side]).max(0.0) as usize;
        cell.min(self.cells[side] - 1)
    }

    fn number(&self, cell: [usize; 3]) -> usize {
        (cell[2] * self.cells[1] + cell[1]) * self.cells[0] + cell[0]
    }

    fn sort_into_cells(&mut self) {
        let numbers: Vec<usize> =
            self.found_at_m.iter().map(|centre| self.number([0, 1, 2].map(|side| self.cell(centre, side)))).collect();
        self.starts = vec![0; self.cells.iter().product::<usize>() + 1];
        for number in &numbers {
            self.starts[number + 1] += 1;
        }
        for cell in 1..self.starts.len() {
            self.starts[cell] += self.starts[cell - 1];
        }
        let mut next = self.starts.clone();
        self.members = vec![0; numbers.len()];
        for (sphere, number) in (0u32..).zip(&numbers) {
            self.members[next[*number] as usize] = sphere;
            next[*number] += 1;
        }
    }

    fn find(&mut self) {
        self.sort_into_cells();
        let (pairs, histories) = (std::mem::take(&mut self.pairs), std::mem::take(&mut self.histories));
        let touching: Vec<([u32; 2], History)> =
            pairs.into_iter().zip(histories).filter(|(_, history)| history.touches).collect();
        let near_m = self.diameter_m * (1.0 + SKIN);
        let mut others = Vec::new();
        for (sphere, centre) in (0u32..).zip(&self.found_at_m) {
            others.clear();
            let range = |side: usize| {
                let cell = self.cell(centre, side);
                cell.saturating_sub(1)..=(cell + 1).min(self.cells[side] - 1)
            };
            for up in range(2) {
                for across in range(1) {
                    // The cells along a row follow each other.
                    let (first, last) = (*range(0).start(), *range(0).end());
                    let from = self.starts[self.number([first, across, up])] as usize;
                    let to = self.starts[self.number([last, across, up]) + 1] as usize;
                    others.extend(self.members[from..to].iter().copied().filter(|other| {
                        let apart = minus(centre, &self.found_at_m[*other as usize]);
                        *other > sphere && dot(&apart, &apart) < near_m * near_m
                    }));
                }
            }
            others.sort_unstable();
            for other in &others {
                let pair = [sphere, *other];
                let known = touching.binary_search_by_key(&pair, |(pair, _)| *pair);
                self.pairs.push(pair);
                self.histories.push(known.map_or(History::default(), |place| touching[place].1));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cavity::packing;
    use crate::vector::length;

    fn near_each_other(centres: &[Vector], near_m: f64) -> Vec<[u32; 2]> {
        let mut expected = Vec::new();
        for (i, a) in (0u32..).zip(centres) {
            for (j, b) in (0u32..).zip(centres) {
                if i < j && length(&minus(a, b)) < near_m {
                    expected.push([i, j]);
                }
            }
        }
        expected
    }

    #[test]
    fn the_pairs_are_all_those_near_each_other() {
        let cavity = Cavity { length_m: 0.09, width_m: 0.033, height_m: 0.021 };
        let centres = packing(&cavity, 150, 0.004, 5).expect("they fit");
        let mut neighbours = Neighbours::new(&cavity, centres.len(), 0.004);
        neighbours.update(&centres, 0.0);
        assert!(neighbours.pairs.len() > 100);
        assert_eq!(neighbours.pairs, near_each_other(&centres, 0.005));
    }

    #[test]
    fn a_large_box_has_no_more_cells_than_its_spheres_need_and_the_same_pairs() {
        let diameter_m = 1e-5;
        // A heap in a corner of a box of 100 m.
        let heap = Cavity { length_m: 1e-4, width_m: 8e-5, height_m: 1e-4 };
        let cavity = Cavity { length_m: 100.0, width_m: 100.0, height_m: 100.0 };
        let mut centres = packing(&heap, 300, diameter_m, 5).expect("they fit");
        for centre in &mut centres {
            *centre = [centre[0] - 49.9999, centre[1] + 49.9999, centre[2]];
        }
        let mut neighbours = Neighbours::new(&cavity, centres.len(), diameter_m);
        let cells: usize = neighbours.cells.iter().product();
        assert!((centres.len()..=MAX_CELLS * centres.len()).contains(&cells), "{:?}", neighbours.cells);
        neighbours.update(&centres, 0.0);
        assert!(neighbours.pairs.len() > 300);
        assert_eq!(neighbours.pairs, near_each_other(&centres, diameter_m * (1.0 + SKIN)));
    }
}
