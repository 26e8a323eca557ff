//! A point has the same bits whatever else is computed with it, and with which instructions.

use damprig_batch::{InstructionSet, Outcome, Point, simulate, simulate_on};

use crate::points::drawn;

/// The bits of an outcome.
fn bits(outcome: &Outcome) -> [u64; 9] {
    let Outcome { steady_mean_m, steady_max_m, last_cycle_max_m, max_abs_x_m, rms_x_m, .. } = *outcome;
    [
        steady_mean_m.map_or(0, f64::to_bits),
        steady_max_m.map_or(0, f64::to_bits),
        last_cycle_max_m.to_bits(),
        max_abs_x_m.to_bits(),
        rms_x_m.to_bits(),
        outcome.impacts,
        outcome.accumulations,
        outcome.lane_steps,
        outcome.exact_steps,
    ]
}

/// Points whose chaos would turn a difference in the last bit into a different outcome.
fn points() -> Vec<Point> {
    let mut points = drawn(7, 60, 120);
    // Different lengths, so that lanes get their next points at different times.
    for (n, point) in points.iter_mut().enumerate() {
        point.cycles -= n as u64 % 7;
        point.steady_from_cycle = n as u64 % 50;
    }
    points
}

fn on(points: &[Point], set: InstructionSet) -> Vec<[u64; 9]> {
    simulate_on(points, 1, set).expect("physical points").iter().map(bits).collect()
}

#[test]
fn every_instruction_set_and_number_of_lanes_gives_the_same_bits() {
    let points = points();
    let scalar = on(&points, InstructionSet::Scalar);
    for set in InstructionSet::available() {
        assert_eq!(on(&points, set), scalar, "{set:?}");
    }
    assert!(InstructionSet::available().len() >= 4, "widths 1, 2, 4 and 8 need no special instructions");
}

#[test]
fn order_and_grouping_do_not_change_a_bit() {
    let points = points();
    let set = InstructionSet::fastest();
    let together = on(&points, set);
    // 37 has no common factor with 60.
    let shuffled: Vec<usize> = (0..points.len()).map(|n| n * 37 % points.len()).collect();
    let in_other_order = on(&shuffled.iter().map(|n| points[*n]).collect::<Vec<_>>(), set);
    for (place, n) in shuffled.iter().enumerate() {
        assert_eq!(in_other_order[place], together[*n], "point {n}");
    }
    for size in [1, 3, 11] {
        let grouped: Vec<_> = points.chunks(size).flat_map(|group| on(group, set)).collect();
        assert_eq!(grouped, together, "groups of {size}");
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let points = points();
    let one = on(&points, InstructionSet::fastest());
    for threads in [0, 2, 5, 1000] {
        let outcomes = simulate(&points, threads).expect("physical points");
        assert_eq!(outcomes.iter().map(bits).collect::<Vec<_>>(), one, "{threads} threads");
    }
}
