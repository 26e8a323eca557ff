//! The energy balance closes only for a correct motion: injected errors appear in the residual.

use damprig_core::analysis::energy::EnergyMeter;
use damprig_core::integrator::exact::{Accumulation, Arc, Exact, ExactState, Excitation, Impact, Observer};
use damprig_core::model::{Cavity, Initial, Particle, SetUp, Structure, Wall};

const DRIVE: Excitation = Excitation::Sine { amplitude_m: 3e-3, angular_frequency_rad_per_s: 15.0, phase_rad: 0.4 };

fn damper(coefficient: f64) -> SetUp {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 0.03,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient },
        cavity: Cavity::default(),
    };
    SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)) }
}

fn start() -> Initial {
    Initial { x_m: 0.0, v_m_per_s: -0.01, y_m: 0.03, u_m_per_s: 1.0 }
}

fn from(state: &ExactState) -> Initial {
    Initial { x_m: state.x_m, v_m_per_s: state.v_m_per_s, y_m: state.y_m(), u_m_per_s: state.u_m_per_s() }
}

/// Passes selected events of a motion to the meter, with impacts changed by `tamper`.
struct Part<'a, F> {
    meter: &'a mut EnergyMeter,
    starts: bool,
    arcs: bool,
    tamper: F,
}

impl<F: FnMut(&mut Impact)> Observer for Part<'_, F> {
    fn start(&mut self, time_s: f64, state: &ExactState) {
        if self.starts {
            self.meter.start(time_s, state);
        }
    }

    fn arc(&mut self, arc: &Arc<'_>) {
        if self.arcs {
            self.meter.arc(arc);
        }
    }

    fn impact(&mut self, impact: &Impact) {
        let mut impact = *impact;
        (self.tamper)(&mut impact);
        self.meter.impact(&impact);
    }

    fn accumulation(&mut self, accumulation: &Accumulation) {
        self.meter.accumulation(accumulation);
    }
}

/// The meter gets the start events of a correct run, then the arcs of a run with another velocity after the first
/// impact.
#[test]
fn a_velocity_lost_at_the_first_instant_shows_in_the_residual() {
    let set_up = damper(0.5);
    for (factor, shows) in [(1.0, false), (1.0 + 1e-9, true), (0.0, true), (-1.0, true)] {
        let mut meter = EnergyMeter::new(&set_up);
        let mut truth = Exact::new(&set_up, &Excitation::Fixed, &start()).expect("physical");
        truth.run(1e-300, &mut Part { meter: &mut meter, starts: true, arcs: false, tamper: |_: &mut Impact| {} });
        let after = *truth.state();
        let u = after.u_m_per_s();
        let faulty = Initial { v_m_per_s: factor * after.v_m_per_s, u_m_per_s: u, ..from(&after) };
        let mut motion = Exact::new(&set_up, &Excitation::Fixed, &faulty).expect("physical");
        motion.run(0.1, &mut Part { meter: &mut meter, starts: false, arcs: true, tamper: |_: &mut Impact| {} });
        let moved_j = 0.5 * 1.6 * after.v_m_per_s * after.v_m_per_s * (1.0 + f64::abs(factor)) * f64::abs(factor - 1.0);
        let balance = meter.balance();
        let residual_j = balance.residual_j.abs();
        if shows {
            assert!(residual_j >= 0.99 * moved_j && moved_j > 0.0, "factor {factor}: {residual_j:e} of {moved_j:e} J");
        } else {
            assert!(residual_j <= 1e-15, "{residual_j:e}");
        }
    }
}

#[test]
fn a_jump_in_the_middle_of_a_run_shows_even_if_it_keeps_the_energy() {
    let set_up = damper(0.5);
    let jump = |change: fn(&mut ExactState)| {
        let mut meter = EnergyMeter::new(&set_up);
        let mut motion = Exact::new(&set_up, &DRIVE, &start()).expect("physical");
        motion.run(1.0, &mut meter);
        let mut state = *motion.state();
        change(&mut state);
        motion.reset(1.0, &from(&state));
        motion.run(2.0, &mut meter);
        meter.balance().residual_j.abs()
    };
    // Only rounding, from the conversion of relative coordinates in `Initial`.
    assert!(jump(|_| {}) < 1e-15, "{:e}", jump(|_| {}));
    let changes: [fn(&mut ExactState); 5] = [
        |s| (s.v_m_per_s, s.slide_m_per_s) = (-s.v_m_per_s, s.slide_m_per_s + 2.0 * s.v_m_per_s),
        |s| s.slide_m_per_s = -s.slide_m_per_s - 2.0 * s.v_m_per_s,
        |s| s.v_m_per_s *= 1.0 + 1e-8,
        |s| s.offset_m += 1e-5,
        |s| s.x_m *= 1.0 + 1e-8,
    ];
    for (n, change) in changes.into_iter().enumerate() {
        assert!(jump(change) > 1e-12, "change {n} leaves {:e} J", jump(change));
    }
}

#[test]
fn an_impact_that_breaks_its_law_shows_in_the_residual() {
    let set_up = damper(0.5);
    let residual_j = |tamper: fn(&mut Impact)| {
        let mut meter = EnergyMeter::new(&set_up);
        let mut motion = Exact::new(&set_up, &DRIVE, &start()).expect("physical");
        motion.run(3.0, &mut Part { meter: &mut meter, starts: true, arcs: true, tamper });
        meter.balance().residual_j.abs()
    };
    assert!(residual_j(|_| {}) < 1e-14, "{:e}", residual_j(|_| {}));
    assert!(residual_j(|i| i.after.slide_m_per_s *= 1.0 + 1e-7) > 1e-10, "another restitution");
    assert!(residual_j(|i| i.after.v_m_per_s += 1e-7) > 1e-10, "momentum is not conserved");
    assert!(residual_j(|i| i.before.v_m_per_s += 1e-7) > 1e-10, "the impact does not begin with the motion's state");
}

/// The energy of summed impacts is included in the balance.
#[test]
fn the_balance_closes_with_summed_chatters() {
    struct Count(usize);
    impl Observer for Count {
        const ARCS: bool = false;
        fn accumulation(&mut self, accumulation: &Accumulation) {
            assert!(accumulation.ended_s >= accumulation.time_s);
            self.0 += 1;
        }
    }
    let mut ends = 0;
    for e in [0.1, 0.3, 0.5, 0.7] {
        let mut set_up = damper(e);
        if let Some(particle) = &mut set_up.particle {
            particle.clearance_m = 0.06;
        }
        let resonance = Excitation::Sine {
            amplitude_m: 3e-3,
            angular_frequency_rad_per_s: 5.0 * core::f64::consts::PI,
            phase_rad: 0.0,
        };
        let mut motion = Exact::new(&set_up, &resonance, &Initial::default()).expect("physical");
        let mut seen = (EnergyMeter::new(&set_up), Count(0));
        motion.run(40.0, &mut seen);
        let balance = seen.0.balance();
        let through_j = balance.input_j.abs() + balance.dissipated_j();
        assert!(balance.residual_j.abs() <= 1e-12 * through_j, "e {e}: {balance:?}");
        ends += seen.1.0;
    }
    assert!(ends > 10, "only {ends} chatters ended");
}
