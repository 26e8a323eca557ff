//! Chatters that end with a particle at rest on a hard wall: their number, their times, and the summed impacts.

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Accumulation, Exact, Excitation, Impact, Observer};
use damprig_core::integrator::modes::Sign;
use damprig_core::integrator::sampled::{self, Sampled};
use damprig_core::integrator::units::Units;
use damprig_core::model::{Cavity, Initial, Particle, SetUp, Structure, Wall};
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

fn draws(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    move |low, high| low + (high - low) * (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

fn damper(mass_ratio: f64, clearance_m: f64, coefficient: f64, friction_coefficient: f64) -> SetUp {
    let particle = Particle {
        mass_kg: 1.6 * mass_ratio,
        clearance_m,
        friction_coefficient,
        wall: Wall::Restitution { coefficient },
        cavity: Cavity::default(),
    };
    SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)) }
}

#[derive(Default)]
struct Ends {
    fastest_m_per_s: f64,
    /// Times (s) and sides of the ends.
    seen: Vec<(f64, Sign)>,
    longest_s: f64,
}

impl Observer for Ends {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        self.fastest_m_per_s = self.fastest_m_per_s.max(impact.approach_speed_m_per_s);
    }

    fn accumulation(&mut self, accumulation: &Accumulation) {
        let left_out = accumulation.before.slide_m_per_s.abs();
        assert!(left_out <= 1e-4 * self.fastest_m_per_s, "{left_out:e} of {:e}", self.fastest_m_per_s);
        self.seen.push((accumulation.ended_s, accumulation.side));
        self.longest_s = self.longest_s.max(accumulation.ended_s - accumulation.time_s);
    }
}

#[test]
fn only_impacts_slower_than_a_ten_thousandth_of_the_fastest_are_summed_even_for_a_light_particle() {
    let mut draw = draws(51);
    let mut ends = 0;
    for _ in 0..60 {
        // The lighter the particle, the less its bounces affect the motion.
        let set_up = damper(10.0_f64.powf(draw(-8.0, -0.5)), 0.06, draw(0.1, 0.8), 0.0);
        let drive =
            Excitation::Sine { amplitude_m: 3e-3, angular_frequency_rad_per_s: draw(14.0, 17.0), phase_rad: 0.0 };
        let mut motion = Exact::new(&set_up, &drive, &Initial::default()).expect("physical");
        let (mut seen, mut response) = (Ends::default(), Response::new(Wanted::default()));
        motion.run(30.0, &mut (&mut seen, &mut response));
        assert_eq!(response.accumulation_count(), seen.seen.len() as u64);
        ends += seen.seen.len();
    }
    assert!(ends > 50, "only {ends} chatters ended");
}

const STEP_S: f64 = 1e-3;

/// Ends of chatters for the sampled driver, which lists every bounce that it distinguishes from rest.
#[derive(Default)]
struct ListedEnds {
    step: f64,
    seen: Vec<(f64, Sign)>,
}

impl sampled::SampledObserver<f64> for ListedEnds {
    fn accumulation(&mut self, at: f64, side: Sign) {
        self.seen.push(((self.step + at) * STEP_S, side));
    }
}

#[test]
fn a_chatter_ends_with_its_last_bounce_under_either_driver() {
    let mut draw = draws(52);
    let (mut compared, mut summed_s) = (0, 0.0_f64);
    for n in 0..80 {
        let friction = if n % 2 == 0 { 0.0 } else { draw(0.001, 0.02) };
        let set_up = damper(draw(0.02, 0.2), 0.035 * draw(0.3, 1.0), draw(0.1, 0.6), friction);
        let initial = Initial { x_m: 0.035, y_m: 0.035, ..Initial::default() };
        let mut exact = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
        let mut sampled = Sampled::<f64>::new(&set_up, Units::metres(STEP_S), &initial).expect("physical");
        let (mut ends, mut listed) = (Ends::default(), ListedEnds::default());
        exact.run(8.0, &mut ends);
        for step in 0..8000 {
            listed.step = f64::from(step);
            sampled.step(&BaseSegment::at_rest(0.0), &mut listed);
        }
        // A motion that amplifies rounding errors may chatter differently later, so only the first two ends are
        // compared.
        for (a, b) in ends.seen.iter().zip(&listed.seen).take(2) {
            assert_eq!(a.1, b.1, "{n}");
            // Bounces that the sampled driver cannot distinguish from rest leave the wall at √(64 ε d A), where A is
            // some m/s², and last 2/(1 − e)/A times that: 2·10⁻⁷ s. The error of the first-order sum is smaller:
            // (6·10⁻⁵ s)² over a period.
            assert!((a.0 - b.0).abs() < 2e-7, "{n}: {} {}", a.0, b.0);
            compared += 1;
        }
        summed_s = summed_s.max(ends.longest_s);
    }
    assert!(compared > 20, "only {compared} were compared");
    assert!(summed_s > 2e-5, "only tails of at most {summed_s:e} s were summed");
}

#[test]
fn a_plastic_impact_is_not_an_accumulation() {
    let set_up = damper(0.1, 0.02, 0.0, 0.0);
    let initial = Initial { x_m: 0.035, y_m: 0.035, ..Initial::default() };
    let mut exact = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
    let (mut ends, mut listed) = (Ends::default(), ListedEnds::default());
    exact.run(4.0, &mut ends);
    let mut sampled = Sampled::<f64>::new(&set_up, Units::metres(STEP_S), &initial).expect("physical");
    (0..4000).for_each(|_| sampled.step(&BaseSegment::at_rest(0.0), &mut listed));
    assert!(ends.fastest_m_per_s > 0.0 && ends.seen.is_empty() && listed.seen.is_empty());
}
