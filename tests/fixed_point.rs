//! Fixed-point sampled integrator on a controller without floating point: the same bits as on the host, and close to
//! `f64`.

use damprig_core::fixed_point::Fixed;
use damprig_core::fixed_point::reference::{CASES, Case, ReferenceMotion, STEPS};
use damprig_core::integrator::sampled::SampledState;
use damprig_core::scalar::Scalar;
use damprig_tests::support::emulator::run_counting;
use damprig_tests::support::images::find;

/// The bits of x, x′, y − x and (y′ − x′).
type Bits = [i64; 4];

/// The states of every case as printed by the board.
fn printed_states(printed: &str) -> Vec<Vec<Bits>> {
    let mut cases: Vec<Vec<Bits>> = vec![];
    for line in printed.lines() {
        if line.starts_with("case ") {
            cases.push(vec![]);
        } else if let Some(states) = cases.last_mut()
            && !line.contains(" = ")
        {
            let numbers = line.split(' ').map(|number| {
                u64::from_str_radix(number, 16).unwrap_or_else(|error| panic!("{line}: {error}")).cast_signed()
            });
            let numbers: Vec<_> = numbers.collect();
            states.push(numbers.try_into().unwrap_or_else(|numbers| panic!("not four numbers: {numbers:?}")));
        }
    }
    cases
}

fn states<S: Scalar>(case: &Case) -> Vec<SampledState<S>> {
    let mut motion = ReferenceMotion::<S>::new(case).unwrap();
    let step = |step| {
        motion.step(case.base_counts(step), &mut ());
        *motion.state()
    };
    (0..STEPS).map(step).collect()
}

#[test]
fn a_controller_without_floating_point_gives_the_hosts_bits_and_stays_within_1e_4_of_f64() {
    let Some(image) = find("mps2-an385") else { return };
    let cases = printed_states(&run_counting("mps2-an385", &image));
    assert_eq!(cases.len(), CASES.len());
    for (case, board) in CASES.iter().zip(&cases) {
        assert_eq!(board.len(), STEPS as usize, "{}", case.name);
        let per_omega = 1.0 / (case.set_up().structure.angular_frequency_rad_per_s() * case.units().step_s);
        let mut largest: f64 = 0.0;
        let both = states::<Fixed>(case).into_iter().zip(states::<f64>(case));
        for (step, ((here, exact), there)) in both.zip(board).enumerate() {
            let bits = [here.x, here.v, here.offset, here.slide].map(Fixed::to_bits);
            assert_eq!(bits, *there, "{} at step {step}", case.name);
            // The bits are equal, so the host's values are the board's.
            let error = [
                here.x.to_f64() - exact.x,
                (here.v.to_f64() - exact.v) * per_omega,
                here.offset.to_f64() - exact.offset,
                (here.slide.to_f64() - exact.slide) * per_omega,
            ];
            largest = error.iter().fold(largest, |most, error| most.max(error.abs()));
        }
        println!("{}: {STEPS} states, every bit the same; off f64 by {largest:.1e} at most", case.name);
        assert!(largest <= 1e-4, "{}: {largest}", case.name);
    }
}
