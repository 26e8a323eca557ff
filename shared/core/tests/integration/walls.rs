//! Walls as they are: restitution that varies with the speed of the impact.

use damprig_core::analysis::energy::EnergyMeter;
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::exact::{Accumulation, Exact, Excitation, Impact, Observer};
use damprig_core::integrator::sampled::{self, Sampled, SampledState};
use damprig_core::integrator::units::Units;
use damprig_core::model::{
    Cavity, ImpactLaw, Initial, Particle, Restitution, SPEED_TABLE_POINTS, SetUp, SpeedTable, Structure, Wall,
};
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

    /// A table of e up to `most`; it rises too, where its rebound may.
    fn table(&mut self, most: f64) -> SpeedTable {
        let mut points = vec![[10.0_f64.powf(self.between(-3.0, 0.0)), self.between(0.0, most)]];
        for _ in 0..=self.one_of(SPEED_TABLE_POINTS as u32 - 1) {
            let before = points[points.len() - 1];
            let speed = before[0] * 10.0_f64.powf(self.between(0.001, 0.7));
            points.push([speed, self.between(SpeedTable::least_at(before, speed), most)]);
        }
        SpeedTable::new(&points).expect("2 to 6 points")
    }

    /// A wall whose e depends on the speed, up to `most`.
    fn varying(&mut self, most: f64) -> Wall {
        if self.coin() {
            return Wall::TableRestitution(self.table(most));
        }
        let law = self.law();
        Wall::SpeedRestitution(Restitution { maximum: law.maximum.min(most), ..law })
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
fn a_table_is_linear_between_its_points_and_its_rebound_never_falls() {
    let table = SpeedTable::new(&[[0.1, 0.9], [0.5, 0.75], [2.0, 0.6]]).expect("three points");
    for (v, e) in [(1e-6, 0.9), (0.1, 0.9), (0.3, 0.825), (0.5, 0.75), (1.25, 0.675), (2.0, 0.6), (1e3, 0.6)] {
        assert!((table.at(v) - e).abs() < 4.0 * f64::EPSILON, "e({v}) = {} instead of {e}", table.at(v));
    }
    assert_eq!((table.slope(0.05), table.slope(1.0), table.slope(2.0)), (0.0, (0.6 - 0.75) / 1.5, 0.0));
    let mut draw = Draw::new(11);
    for _ in 0..1000 {
        let table = draw.table(0.95);
        let law = Wall::TableRestitution(table).impact_law::<f64>(1.0).expect("a hard wall");
        let single_law = Wall::TableRestitution(table).impact_law::<f32>(1.0).expect("a hard wall");
        let mut before = 0.0;
        for n in -400..=400 {
            let v = 10.0_f64.powf(f64::from(n) / 100.0);
            let e = law.at(v);
            assert_eq!(e, table.at(v));
            assert!((0.0..=law.maximum()).contains(&e), "e({v}) = {e} of {table:?}");
            assert!(v * e >= before * (1.0 - 8.0 * f64::EPSILON), "the rebound falls at {v} m/s with {table:?}");
            assert!(!law.is_slow(v) || e == law.slow());
            before = v * e;
            // The speed has a rounding, which the slope of e enlarges: 0.95 over at least 0.1 % of the speed.
            let single = f64::from(single_law.at(v as f32));
            let steep = table.points().windows(2).map(|p| ((p[1][1] - p[0][1]) / (p[1][0] / p[0][0] - 1.0)).abs());
            let rounding = f64::from(f32::EPSILON) * (2.0 + 3.0 * steep.fold(0.0, f64::max));
            assert!((single - e).abs() < rounding, "{single} instead of {e} at {v}: {table:?}");
            // The twin takes the approach speed from the sum of both speeds.
            let closing = v * (1.0 + e);
            assert!((law.approach(closing) / v - 1.0).abs() < 16.0 * f64::EPSILON, "{v}: {table:?}");
            let single = f64::from(single_law.approach(closing as f32));
            assert!((single / v - 1.0).abs() < 16.0 * f64::from(f32::EPSILON), "{single} instead of {v}: {table:?}");
        }
    }
}

#[test]
fn values_of_a_table_outside_their_ranges_are_named() {
    let refused = |points: &[[f64; 2]]| {
        let table = SpeedTable::new(points).expect("2 to 6 points");
        let set_up = Draw::new(2).set_up(|_| Wall::TableRestitution(table));
        set_up.validate().expect_err("a value is out of range").parameter
    };
    let (speeds, coefficients) = ("particle.wall.speeds_m_per_s", "particle.wall.coefficients");
    assert_eq!(refused(&[[0.0, 0.5], [1.0, 0.5]]), speeds);
    assert_eq!(refused(&[[f64::NAN, 0.5], [1.0, 0.5]]), speeds);
    assert_eq!(refused(&[[1.0, 0.5], [1.0005, 0.5]]), speeds);
    assert_eq!(refused(&[[1.0, 0.5], [0.5, 0.5]]), speeds);
    assert_eq!(refused(&[[1.0, 0.5], [f64::INFINITY, 0.5]]), speeds);
    assert_eq!(refused(&[[1.0, 0.5], [1.0, 0.5]]), speeds);
    assert_eq!(refused(&[[1.0, 1.0], [2.0, 0.9]]), coefficients);
    assert_eq!(refused(&[[1.0, f64::NAN], [2.0, 0.9]]), coefficients);
    assert_eq!(refused(&[[1.0, -0.1], [2.0, 0.9]]), coefficients);
    // At twice the speed e may fall to two thirds: v·e is then level there.
    assert_eq!(refused(&[[1.0, 0.9], [2.0, 0.599]]), coefficients);
    assert_eq!(SpeedTable::new(&[[1.0, 0.9], [2.0, 0.601]]).unwrap().validate(), Ok(()));
    assert!(SpeedTable::new(&[[1.0, 0.5]]).is_none() && SpeedTable::new(&[]).is_none());
    let seven: Vec<[f64; 2]> = (1..=7).map(|n| [f64::from(n), 0.5]).collect();
    assert!(SpeedTable::new(&seven).is_none());
    assert_eq!(SpeedTable::new(&seven[..6]).unwrap().points(), &seven[..6]);
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
    law: ImpactLaw<f64>,
    impacts: usize,
    ends: usize,
    slowest: f64,
}

impl Impacts {
    fn of(wall: Wall) -> Self {
        Self { law: wall.impact_law(1.0).expect("a hard wall"), impacts: 0, ends: 0, slowest: f64::INFINITY }
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
    for _ in 0..400 {
        let wall = draw.varying(0.95);
        let set_up = draw.set_up(|_| wall);
        let (sine, initial) = (draw.sine(&set_up), draw.initial(&set_up));
        let mut motion = Exact::new(&set_up, &sine, &initial).expect("drawn within the ranges");
        let (mut meter, mut seen) = (EnergyMeter::new(&set_up), Impacts::of(wall));
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
fn swinging(draw: &mut Draw, wall: Wall, mass_ratio: f64) -> (SetUp, Initial) {
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let particle = Particle {
        mass_kg: 1.6 * mass_ratio,
        clearance_m: 0.035 * draw.between(0.3, 1.0),
        friction_coefficient: 0.0,
        wall,
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

impl sampled::SampledObserver<f64> for ListedEnds {
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
fn a_chatter_of_varying_restitution_ends_with_its_last_bounce_under_either_driver() {
    let mut draw = Draw::new(4);
    let mut compared = 0;
    for n in 0..80 {
        let most = draw.between(0.1, 0.8);
        let wall = draw.varying(most);
        let mass_ratio = draw.between(0.02, 0.2);
        let (set_up, initial) = swinging(&mut draw, wall, mass_ratio);
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
            assert!((a - b).abs() < 4e-7, "{n}: {a} {b} {wall:?}");
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
        let wall = if draw.coin() { Wall::SpeedRestitution(law) } else { Wall::TableRestitution(draw.table(0.999)) };
        let (set_up, initial) = swinging(&mut draw, wall, 1e-4);
        let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
        let mut seen = Impacts::of(wall);
        motion.run(30.0, &mut seen);
        assert_eq!(motion.unresolved(), 0);
        assert!(seen.impacts < 200_000, "{} impacts of {wall:?}", seen.impacts);
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
fn an_exponent_of_zero_and_a_level_table_give_the_bits_of_the_constant_coefficient() {
    let mut draw = Draw::new(6);
    for n in 0..80 {
        let coefficient = draw.between(0.0, 1.0);
        let plain = draw.set_up(|_| Wall::Restitution { coefficient });
        let law = Restitution { coefficient, reference_speed_m_per_s: 0.37, exponent: 0.0, maximum: 1.0 };
        let level = SpeedTable::new(&[[1e-3, coefficient], [0.2, coefficient], [3.0, coefficient]]).unwrap();
        let mut stated = plain;
        let wall = if n % 2 == 0 { Wall::SpeedRestitution(law) } else { Wall::TableRestitution(level) };
        stated.particle.as_mut().expect("it has one").wall = wall;
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
    let table = SpeedTable::new(&[[0.05, 0.8], [0.3, 0.5], [1.0, 0.55]]).expect("three points");
    for wall in [Wall::SpeedRestitution(law), Wall::TableRestitution(table)] {
        let mut draw = Draw::new(7);
        let (set_up, initial) = swinging(&mut draw, wall, 0.1);
        let mut exact = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
        let mut seen = Impacts::of(wall);
        exact.run(2.0, &mut seen);
        assert!(seen.impacts > 8, "{} impacts", seen.impacts);
        let at = |state: SampledState<f64>| (state.x, state.offset);
        let exact = (exact.state().x_m, exact.state().offset_m);
        let double = at(sampled_states::<f64>(&set_up, &initial, 1.0)[1999]);
        assert!((double.0 - exact.0).abs() < 1e-12 && (double.1 - exact.1).abs() < 1e-11, "{double:?} {exact:?}");
        let single = sampled_states::<f32>(&set_up, &initial, 1.0)[1999];
        assert!((single.x.to_f64() - exact.0).abs() < 1e-5, "{single:?} {exact:?}");
    }
}

#[test]
fn the_closed_form_orbit_is_of_constant_restitution_only() {
    let drive = |set_up: &SetUp| SymmetricOrbit::new(set_up, 1e-3, set_up.structure.angular_frequency_rad_per_s());
    let law = Restitution { coefficient: 0.5, reference_speed_m_per_s: 0.3, exponent: 0.25, maximum: 0.8 };
    let (falling, _) = swinging(&mut Draw::new(8), Wall::SpeedRestitution(law), 0.1);
    let of = |wall: Wall| {
        let mut set_up = falling;
        set_up.particle.as_mut().expect("it has one").wall = wall;
        drive(&set_up)
    };
    assert!(of(Wall::Restitution { coefficient: 0.5 }).is_some() && drive(&falling).is_none());
    assert!(of(Wall::TableRestitution(Draw::new(9).table(0.9))).is_none());
}
