//! Points that the simulated board measures, against closed forms and against an uninterrupted experiment.

use damprig_core::control::stepped_sine::SteppedSine;
use damprig_core::measure::point::PointResult;
use damprig_core::measure::steadiness::Steadiness;
use damprig_core::model::{Cavity, Particle, Wall};
use damprig_protocol::{Event, FromDevice, Reply, Request};
use damprig_simulator::messages::set_plant;

use super::{experiment, plant, ready};

#[test]
fn the_bare_structure_measures_its_transmissibility_within_the_sensors_resolution() {
    let mut host = ready();
    let long = SteppedSine {
        settle_s: 300.0,
        dwell_s: 40.0,
        amplitude_m: 1e-4,
        points: [2.5].into_iter().collect(),
        ..experiment()
    };
    assert_eq!(host.ask(Request::Configure(long)), Ok(Reply::Done));
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    let messages = host.grant(345_000);
    let result = messages.iter().find_map(|m| match m {
        FromDevice::Event { event: Event::Point(result), .. } => Some(*result),
        _ => None,
    });
    let result = result.expect("a result");
    let two_zeta: f64 = 2.0 * 0.0038;
    let exact = (1.0 + two_zeta * two_zeta).sqrt() / two_zeta * 1e-4;
    assert!((f64::from(result.x_amplitude_m) - exact).abs() < 1e-5, "{result:?}");
    // A reading is rounded by up to half of 10 µm after noise of up to 3.5 · 5 µm.
    assert!((f64::from(result.max_abs_x_m) - exact).abs() < 2.3e-5, "{result:?}");
    assert_eq!(result.steadiness, Steadiness::Steady);
}

/// A point's figures without its times.
fn figures(messages: &[FromDevice]) -> Vec<PointResult> {
    let point = |message: &FromDevice| match message {
        FromDevice::Event { event: Event::Point(result), .. } => {
            Some(PointResult { start_tick: 0, end_tick: 0, ..*result })
        }
        _ => None,
    };
    messages.iter().filter_map(point).collect()
}

#[test]
fn a_resumed_experiment_gives_the_results_of_an_uninterrupted_one() {
    let mut whole = ready();
    assert_eq!(whole.ask(Request::Start), Ok(Reply::Done));
    let whole = figures(&whole.grant(20_000));
    let mut rest = ready();
    let second = SteppedSine { first_index: 1, points: [3.0].into_iter().collect(), ..experiment() };
    assert_eq!(rest.ask(Request::Configure(second)), Ok(Reply::Done));
    assert_eq!(rest.ask(Request::Start), Ok(Reply::Done));
    assert_eq!(figures(&rest.grant(20_000)), whole[1..]);
}

/// d/Z = 10, e = 0.5, β = 0.1, f = fn: the symmetric orbit with two impacts a cycle has max|x| = 3.753385 Z
/// (Masri & Caughey 1966; `core/tests/integration/sampled.rs` has the formula).
#[test]
fn the_impact_damper_measures_its_closed_form_within_the_sensors_resolution() {
    let z_m = 1.5e-3;
    let mut host = ready();
    let mut config = plant();
    config.set_up.particle = Some(Particle {
        mass_kg: 0.16,
        clearance_m: 10.0 * f64::from(z_m),
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.5 },
        cavity: Cavity::default(),
    });
    assert_eq!(host.ask(set_plant(config)), Ok(Reply::Done));
    let long = SteppedSine {
        settle_s: 200.0,
        dwell_s: 40.0,
        amplitude_m: z_m,
        points: [2.5].into_iter().collect(),
        ..experiment()
    };
    assert_eq!(host.ask(Request::Configure(long)), Ok(Reply::Done));
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    let result = figures(&host.grant(245_000))[0];
    let exact = 3.753_385 * z_m;
    // A reading is rounded by up to half of 10 µm after noise of up to 3.5 · 5 µm.
    assert!((result.mean_cycle_max_m - exact).abs() < 2.3e-5, "{result:?}");
    assert_eq!(result.steadiness, Steadiness::Steady, "{result:?}");
}
