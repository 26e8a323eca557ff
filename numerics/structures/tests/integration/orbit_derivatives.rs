//! Derivatives of periodic motions: of settled motions against those beside them.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use damprig_structures::{Impact, Motion, MotionCase, Observer, Piece, State, Varied};
use fastrand::Rng;

use crate::derivatives::{Measured, QUANTITIES, changed, motion_case};
use crate::random_set_ups::{Case, Draw};

/// Of settled motions with impacts, friction and a tuned mass: RMS and fastest impact of the orbit by every quantity, against those of settled motions
/// beside it; all of them with `DAMPRIG_FULL`, else every fourth. (The largest displacement has nearly equal peaks on both sides, between which differences choose.)
#[test]
fn derivatives_of_an_orbit_are_those_between_settled_motions() {
    /// Of a period: the mean square of the first place, and the fastest impact.
    #[derive(Default)]
    struct OfPeriod(Measured, f64);
    impl Observer for OfPeriod {
        const PIECES: bool = true;
        fn piece(&mut self, piece: &Piece) {
            self.0.piece(piece);
        }
        fn impact(&mut self, impact: &Impact) {
            self.1 = self.1.max(impact.approach_speed_m_per_s);
        }
    }
    // The slowest mode decays by e⁻³⁰, and its part in a derivative, which grows with time, to 10⁻⁹.
    let settle = 1000.0;
    let (mut compared, mut impacts) = (0, 0);
    let (count, every) = if std::env::var_os("DAMPRIG_FULL").is_some() { (120, 1) } else { (80, 4) };
    for number in 0..count {
        let case = Draw(Rng::with_seed(number)).case(number as usize);
        let settled = |case: &Case, period_s: f64| {
            let duration_s = settle * period_s;
            MotionCase { duration_s, ..motion_case(case) }
        };
        if !matches!(case.excitation, Excitation::Sine { .. } | Excitation::ForceSine { .. }) {
            continue;
        }
        let own: Vec<_> =
            QUANTITIES.iter().filter(|(name, change)| *name != "start" && change(&mut case.clone(), 1.0)).collect();
        let varied: Vec<Varied> = own
            .iter()
            .map(|(_, change)| {
                let at = |by: f64| settled(&changed(&case, *change, by), case.cycle_s);
                Varied { value: 1.0, cases: Varied::AT.map(at) }
            })
            .collect();
        let Ok(found) = settled(&case, case.cycle_s).orbit_derivatives(1, &varied, &mut |_| true) else { continue };
        let on_orbit = {
            let mut motion = Motion::new(&case.set_up, &case.excitation, &case.start).expect("it starts");
            motion.run(settle * case.cycle_s, &mut ()).expect("it goes on");
            motion.state()
        };
        let measured = |case: &Case| {
            let turning = case.excitation.angular_frequency_rad_per_s();
            let periods = f64::from(found.periods);
            // From the orbit, as the same set-up may have another; a particle that presses its wall there starts as the case does.
            let start = |start: &State| Motion::new(&case.set_up, &case.excitation, start);
            let mut motion = start(&on_orbit).or_else(|_| start(&case.start)).expect("it starts");
            motion.run(settle * TAU / turning, &mut ()).expect("it goes on");
            let mut of = OfPeriod::default();
            motion.run((settle + periods) * TAU / turning, &mut of).expect("it goes on");
            [(of.0.squares[0] / (periods * TAU / turning)).sqrt(), of.1]
        };
        let fastest = found.derivatives.fastest_impact_m_per_s.as_ref();
        let exact = |which: usize| {
            let alone = fastest.filter(|fastest| !fastest.is_tie);
            [Some(&found.derivatives.rms_m[0]), alone.map(|it| &it.of)].map(|of| of.map(|of| (of.value, of.by[which])))
        };
        for (which, (name, change)) in own.iter().enumerate().step_by(every) {
            let h = (0.05 * found.derivatives.holds_within[which]).min(1e-3);
            if h < 1e-5 {
                continue;
            }
            let central = |h: f64| {
                let [low, high] = [1.0 - h, 1.0 + h].map(|by| measured(&changed(&case, *change, by)));
                [0, 1].map(|n| (high[n] - low[n]) / (2.0 * h))
            };
            let (coarse, fine) = (central(h), central(0.5 * h));
            for (n, exact) in exact(which).into_iter().enumerate() {
                let Some((value, by)) = exact else { continue };
                let difference = (4.0 * fine[n] - coarse[n]) / 3.0;
                // What is left of the transient is below 10⁻⁶, of the motion and, by the bend of the results, of the derivatives.
                let allowed = (fine[n] - coarse[n]).abs() + 1e-5 * (by.abs() + value) + 1e-9 * value / h;
                let apart = (by - difference).abs();
                assert!(apart <= allowed, "{number}, {name}, {n}: {by}, {difference}, {allowed:.1e} allowed");
                compared += 1;
            }
        }
        impacts += usize::from(fastest.is_some());
    }
    println!("{compared} compared, {impacts} orbits with impacts");
    assert!(compared > 20 && impacts >= 4, "{compared} {impacts}");
}
