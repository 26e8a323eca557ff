//! Walls as they are: restitution that falls with the speed of the impact.

use damprig_core::analysis::energy::EnergyMeter;
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::exact::{Accumulation, Exact, Excitation, Impact, Observer};
use damprig_core::integrator::sampled::{self, Sampled, SampledState};
use damprig_core::integrator::units::Units;
use damprig_core::model::{Cavity, Initial, Particle, Restitution, SetUp, Structure, Wall};
use damprig_core::scalar::Scalar;

use crate::draw::Draw;

impl Draw {
    fn law(&mut self) -> Restitution {
        Restitution {
            coefficient: self.between(0.1, 0.9),
            reference_speed_m_per_s: 10.0_f64.powf(self.between(-3.0, 1.0)),
            exponent: if self.coin() { self.between(0.0, 1.0) } else { 10.0_f64.powf(self.between(-6.0, 0.0)) },
            maximum: self.between(0.3, 0.95),
        }
    }
}

#[test]
fn restitution_falls_with_speed_from_its_maximum_and_the_rebound_never_does() {
    let measured = Restitution { coefficient: 0.6, reference_speed_m_per_s: 0.5, exponent: 0.25, maximum: 0.9 };
    assert!((measured.at(0.5) - 0.6).abs() < 1e-16);
    // A sixteenth of the speed gives twice the coefficient, but for the maximum.
    assert!((measured.at(8.0) - 0.3).abs() < 1e-16);
    assert!((measured.at(0.5 / 16.0) - 0.9).abs() < 1e-16);
    let mut draw = Draw::new(1);
    for _ in 0..1000 {
        let law = draw.law();
        let mut before = (0.0, 1.0);
        for n in -120..=40 {
            let v = 10.0_f64.powf(f64::from(n) / 10.0);
            let e = law.at(v);
            assert!((0.0..=law.maximum).contains(&e) && e <= before.1, "e({v}) = {e} of {law:?}");
            assert!(v * e >= before.0 * (1.0 - 4.0 * f64::EPSILON), "the rebound falls at {v} m/s with {law:?}");
            // The board computes in single precision.
            let single = law.law::<f32>(1.0).at(v as f32);
            assert!((f64::from(single) / e - 1.0).abs() < 3e-6, "{single} instead of {e}");
            before = (v * e, e);
        }
    }
}

#[test]
fn values_of_the_law_outside_their_ranges_are_named() {
    let good = Restitution { coefficient: 0.6, reference_speed_m_per_s: 0.5, exponent: 0.25, maximum: 0.9 };
    let refused = |law: Restitution| {
        let set_up = Draw::new(2).set_up(|_| Wall::SpeedRestitution(law));
        set_up.validate().expect_err("the value is out of range").parameter
    };
    assert_eq!(refused(Restitution { coefficient: 1.1, ..good }), "particle.wall.coefficient");
    assert_eq!(refused(Restitution { coefficient: f64::NAN, ..good }), "particle.wall.coefficient");
    assert_eq!(refused(Restitution { reference_speed_m_per_s: 0.0, ..good }), "particle.wall.reference_speed_m_per_s");
    assert_eq!(refused(Restitution { exponent: -0.1, ..good }), "particle.wall.exponent");
    assert_eq!(refused(Restitution { exponent: 1.1, ..good }), "particle.wall.exponent");
    assert_eq!(refused(Restitution { maximum: 1.0, ..good }), "particle.wall.maximum");
    let elastic = Restitution { exponent: 0.0, maximum: 1.0, ..good };
    assert!(Draw::new(2).set_up(|_| Wall::SpeedRestitution(elastic)).validate().is_ok());
}

/// Checks every impact against the law, and counts impacts and ends of chatters.
struct Impacts {
    law: Restitution,
    impacts: usize,
    ends: usize,
    slowest: f64,
}

impl Impacts {
    fn of(law: Restitution) -> Self {
        Self { law, impacts: 0, ends: 0, slowest: f64::INFINITY }
    }
}

impl Observer for Impacts {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        let e = self.law.at(impact.approach_speed_m_per_s);
        assert_eq!(impact.after.slide_m_per_s, -e * impact.before.slide_m_per_s);
        self.impacts += 1;
        self.slowest = self.slowest.min(impact.approach_speed_m_per_s);
    }

    fn accumulation(&mut self, accumulation: &Accumulation) {
        assert_eq!(accumulation.after.slide_m_per_s, 0.0);
        assert!(accumulation.ended_s >= accumulation.time_s && accumulation.ended_s.is_finite());
        self.ends += 1;
    }
}

#[test]
fn every_impact_follows_the_law_and_the_energy_balance_closes() {
    let mut draw = Draw::new(3);
    let (mut impacts, mut ends) = (0, 0);
    for _ in 0..200 {
        let law = draw.law();
        let set_up = draw.set_up(|_| Wall::SpeedRestitution(law));
        let (sine, initial) = (draw.sine(&set_up), draw.initial(&set_up));
        let mut motion = Exact::new(&set_up, &sine, &initial).expect("drawn within the ranges");
        let (mut meter, mut seen) = (EnergyMeter::new(&set_up), Impacts::of(law));
        motion.run(10.0, &mut (&mut meter, &mut seen));
        assert_eq!(motion.unresolved(), 0);
        let balance = meter.balance();
        let turned_over = balance.dissipated_j() + balance.input_j.abs() + balance.stored_change_j.abs();
        assert!(balance.impacts_j >= 0.0);
        // As for a constant coefficient: rounding of thousands of arcs.
        assert!(balance.residual_j.abs() <= 1e-12 * turned_over, "{:e} of {turned_over:e}", balance.residual_j);
        (impacts, ends) = (impacts + seen.impacts, ends + seen.ends);
    }
    assert!(impacts > 10_000 && ends > 100, "{impacts} impacts, {ends} chatters");
}

/// The structure swings freely; the particle bounces on its wall ever lower.
fn swinging(draw: &mut Draw, law: Restitution, mass_ratio: f64) -> (SetUp, Initial) {
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let particle = Particle {
        mass_kg: 1.6 * mass_ratio,
        clearance_m: 0.035 * draw.between(0.3, 1.0),
        friction_coefficient: 0.0,
        wall: Wall::SpeedRestitution(law),
        cavity: Cavity::default(),
    };
    (
        SetUp { particle: Some(particle), ..SetUp::bare(structure) },
        Initial { x_m: 0.035, y_m: 0.035, ..Initial::default() },
    )
}

#[derive(Default)]
struct ListedEnds {
    step: f64,
    seen: Vec<f64>,
}

impl sampled::Observer<f64> for ListedEnds {
    fn accumulation(&mut self, at: f64, _: i8) {
        self.seen.push((self.step + at) * 1e-3);
    }
}

#[derive(Default)]
struct Ends(Vec<f64>);

impl Observer for Ends {
    const ARCS: bool = false;

    fn accumulation(&mut self, accumulation: &Accumulation) {
        self.0.push(accumulation.ended_s);
    }
}

#[test]
fn a_chatter_of_falling_restitution_ends_with_its_last_bounce_under_either_driver() {
    let mut draw = Draw::new(4);
    let mut compared = 0;
    for n in 0..80 {
        let law = Restitution { maximum: draw.between(0.1, 0.8), ..draw.law() };
        let mass_ratio = draw.between(0.02, 0.2);
        let (set_up, initial) = swinging(&mut draw, law, mass_ratio);
        let mut exact = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
        let mut sampled = Sampled::<f64>::new(&set_up, Units::metres(1e-3), &initial).expect("physical");
        let (mut ends, mut listed) = (Ends::default(), ListedEnds::default());
        exact.run(8.0, &mut ends);
        for step in 0..8000 {
            listed.step = f64::from(step);
            sampled.step(&BaseSegment::at_rest(0.0), &mut listed);
        }
        for (a, b) in ends.0.iter().zip(&listed.seen).take(2) {
            // As in `accumulations`, for 1 − e of 0.2 instead of 0.4.
            assert!((a - b).abs() < 4e-7, "{n}: {a} {b} {law:?}");
            compared += 1;
        }
    }
    assert!(compared > 20, "only {compared} were compared");
}

#[test]
fn a_chatter_ends_even_where_the_maximum_is_near_one() {
    let mut draw = Draw::new(5);
    for _ in 0..20 {
        let law = Restitution { maximum: 0.999, coefficient: 0.9, ..draw.law() };
        let (set_up, initial) = swinging(&mut draw, law, 1e-4);
        let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
        let mut seen = Impacts::of(law);
        motion.run(30.0, &mut seen);
        assert_eq!(motion.unresolved(), 0);
        assert!(seen.impacts < 200_000, "{} impacts of {law:?}", seen.impacts);
    }
}

fn sampled_states<S: Scalar>(set_up: &SetUp, initial: &Initial, length_m: f64) -> Vec<SampledState<S>> {
    let units = Units { step_s: 1e-3, length_m };
    let mut sampled = Sampled::<S>::new(set_up, units, initial).expect("physical");
    (0..3000)
        .map(|_| {
            sampled.step(&BaseSegment::at_rest(S::ZERO), &mut ());
            *sampled.state()
        })
        .collect()
}

#[test]
fn an_exponent_of_zero_gives_the_bits_of_the_constant_coefficient() {
    let mut draw = Draw::new(6);
    for n in 0..40 {
        let coefficient = draw.between(0.0, 1.0);
        let plain = draw.set_up(|_| Wall::Restitution { coefficient });
        let law = Restitution { coefficient, reference_speed_m_per_s: 0.37, exponent: 0.0, maximum: 1.0 };
        let mut stated = plain;
        stated.particle.as_mut().expect("it has one").wall = Wall::SpeedRestitution(law);
        let (sine, initial) = (draw.sine(&plain), draw.initial(&plain));
        let run = |set_up: &SetUp| {
            let mut motion = Exact::new(set_up, &sine, &initial).expect("physical");
            motion.run(5.0, &mut ());
            *motion.state()
        };
        assert_eq!(run(&plain), run(&stated), "{n}");
        assert_eq!(sampled_states::<f64>(&plain, &initial, 1.0), sampled_states::<f64>(&stated, &initial, 1.0));
        assert_eq!(sampled_states::<f32>(&plain, &initial, 1.0), sampled_states::<f32>(&stated, &initial, 1.0));
    }
}

#[test]
fn both_drivers_and_every_scalar_move_alike() {
    let law = Restitution { coefficient: 0.5, reference_speed_m_per_s: 0.3, exponent: 0.25, maximum: 0.8 };
    let mut draw = Draw::new(7);
    let (set_up, initial) = swinging(&mut draw, law, 0.1);
    let mut exact = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
    let mut seen = Impacts::of(law);
    exact.run(2.0, &mut seen);
    assert!(seen.impacts > 8, "{} impacts", seen.impacts);
    let at = |state: SampledState<f64>| (state.x, state.offset);
    let exact = (exact.state().x_m, exact.state().offset_m);
    let double = at(sampled_states::<f64>(&set_up, &initial, 1.0)[1999]);
    assert!((double.0 - exact.0).abs() < 1e-12 && (double.1 - exact.1).abs() < 1e-11, "{double:?} {exact:?}");
    let single = sampled_states::<f32>(&set_up, &initial, 1.0)[1999];
    assert!((single.x.to_f64() - exact.0).abs() < 1e-5, "{single:?} {exact:?}");
}

#[test]
fn the_closed_form_orbit_is_of_constant_restitution_only() {
    let drive = |set_up: &SetUp| SymmetricOrbit::new(set_up, 1e-3, set_up.structure.angular_frequency_rad_per_s());
    let law = Restitution { coefficient: 0.5, reference_speed_m_per_s: 0.3, exponent: 0.25, maximum: 0.8 };
    let (falling, _) = swinging(&mut Draw::new(8), law, 0.1);
    let mut constant = falling;
    constant.particle.as_mut().expect("it has one").wall = Wall::Restitution { coefficient: 0.5 };
    assert!(drive(&constant).is_some() && drive(&falling).is_none());
}
