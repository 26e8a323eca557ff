//! What any wall must keep: energy, mirror image, friction, rest, and the limit of a hard wall.

use damprig_core::analysis::energy::EnergyMeter;
use damprig_core::integrator::exact::series::value;
use damprig_core::integrator::exact::{Arc, ContactEnd, Exact, ExactState, Excitation, Impact, Observer};
use damprig_core::integrator::modes::{Contact as Touching, Grip, Mode};
use damprig_core::model::{Cavity, FrictionDamper, GRAVITY_M_PER_S2, Initial, Particle, SetUp, Structure, Wall};

use super::free_impacts::First;
use super::{hunt_crossley, lankarani_nikravesh};
use crate::balance::missed;
use crate::draw::Draw;

/// Counts, and the least force of the Hertz walls.
#[derive(Default)]
struct Counts {
    impacts: u32,
    ends: u32,
    slips: u32,
    /// Pieces in which the wall lags behind the particle.
    lagging: u32,
    /// Least and largest force of the Hertz walls, N.
    least_n: f64,
    most_n: f64,
    ends_m: [f64; 2],
}

impl Counts {
    fn of(set_up: &SetUp) -> Self {
        Self { ends_m: set_up.particle.expect("it has one").ends_m(), ..Self::default() }
    }
}

impl Observer for Counts {
    fn arc(&mut self, arc: &Arc<'_>) {
        if arc.hertz_contact().is_some() {
            let force = arc.contact_force().expect("pressed");
            let forces = (0..=8).map(|n| value(&force, arc.end_fraction() * f64::from(n) / 8.0));
            let (low, high) = forces.fold((0.0_f64, 0.0_f64), |(low, high), f| (low.min(f), high.max(f)));
            self.most_n = self.most_n.max(high);
            self.least_n = self.least_n.min(low);
        } else if arc.pressed_side() == 0 {
            let [low, high] = self.ends_m;
            let middle = arc.state(0.5 * arc.length_s).offset_m;
            self.lagging += u32::from(middle < low - 1e-12 || middle > high + 1e-12);
        }
    }

    fn impact(&mut self, _: &Impact) {
        self.impacts += 1;
    }

    fn contact_end(&mut self, _: &ContactEnd) {
        self.ends += 1;
    }

    fn mode(&mut self, _: f64, mode: Mode) {
        self.slips += u32::from(matches!(mode.grip, Grip::Slip(_)));
    }
}

#[test]
fn the_energy_balance_of_every_hertz_cavity_closes_and_no_wall_pulls() {
    let mut draw = Draw::new(31);
    let (mut all, mut worst, mut arcs, mut least) = (Counts::default(), 0.0_f64, 0, 0.0_f64);
    for n in 0..150 {
        let set_up = draw.hertz_cavity();
        let (sine, initial) = (draw.sine(&set_up), draw.initial(&set_up));
        let mut motion = Exact::new(&set_up, &sine, &initial).expect("drawn within the ranges");
        let mut meter = EnergyMeter::new(&set_up);
        let mut counts = Counts::of(&set_up);
        motion.run(4.0, &mut (&mut meter, &mut counts));
        assert_eq!(motion.unresolved(), 0, "{set_up:?}");
        arcs = arcs.max(motion.work().arcs_walked);
        let balance = meter.balance();
        let (off, size_j) = missed(&set_up, &balance);
        assert!(off <= 1e-9, "{n}: {:e} of {size_j:e} {set_up:?}", balance.residual_j);
        assert!(balance.link_damping_j >= -1e-12 * size_j, "{n}: {:e}", balance.link_damping_j);
        worst = worst.max(off);
        all.impacts += counts.impacts;
        all.ends += counts.ends;
        all.slips += counts.slips;
        all.lagging += counts.lagging;
        least = least.min(counts.least_n / counts.most_n.max(f64::MIN_POSITIVE));
    }
    println!(
        "at most {worst:.1e} of the energy; {} impacts, {} lagging, least force {:.1e} of the largest, {arcs} arcs",
        all.impacts, all.lagging, least
    );
    // The polynomial of a faint force.
    assert!(least > -1e-6, "{least:e}");
    assert!(
        all.impacts > 2000 && all.ends > 1000 && all.slips > 100 && all.lagging > 0,
        "{} {}",
        all.impacts,
        all.ends
    );
}

/// Every state at 100 instants of 2 s.
fn states(set_up: &SetUp, excitation: &Excitation, initial: &Initial) -> Vec<ExactState> {
    let mut motion = Exact::new(set_up, excitation, initial).expect("physical");
    let states = (1..=100).map(|n| {
        motion.run(0.02 * f64::from(n), &mut ());
        *motion.state()
    });
    states.collect()
}

#[test]
fn a_mirrored_hertz_cavity_has_the_mirrored_motion_to_the_last_bit() {
    let mut draw = Draw::new(32);
    for _ in 0..40 {
        let set_up = draw.hertz_cavity();
        let mut mirrored = set_up;
        let p = mirrored.particle.as_mut().expect("it has one");
        let [negative, positive] = p.walls();
        (p.wall, p.cavity.positive_wall) = (positive, Some(negative));
        (p.cavity.offset_m, p.cavity.inclination_deg) = (-p.cavity.offset_m, -p.cavity.inclination_deg);
        let initial = draw.initial(&set_up);
        let opposite = Initial {
            x_m: -initial.x_m,
            v_m_per_s: -initial.v_m_per_s,
            y_m: -initial.y_m,
            u_m_per_s: -initial.u_m_per_s,
        };
        let pulse_m = draw.between(-5e-3, 5e-3);
        let pulse = |amplitude_m: f64| Excitation::HalfSine { amplitude_m, duration_s: 0.3 };
        let motion = states(&set_up, &pulse(pulse_m), &initial);
        for (a, b) in motion.iter().zip(states(&mirrored, &pulse(-pulse_m), &opposite)) {
            assert_eq!((a.x_m, a.v_m_per_s), (-b.x_m, -b.v_m_per_s), "{set_up:?}");
            assert_eq!((a.offset_m, a.slide_m_per_s), (-b.offset_m, -b.slide_m_per_s), "{set_up:?}");
        }
    }
}

#[test]
fn a_stiff_hertz_wall_is_a_hard_wall_with_the_restitution_of_its_law() {
    let structure = Structure::from_modal(1.6, 2.5, 0.01);
    let at = |wall: Wall| {
        let particle =
            Particle { mass_kg: 0.16, clearance_m: 0.01, friction_coefficient: 0.0, wall, cavity: Cavity::default() };
        let set_up = SetUp { particle: Some(particle), ..SetUp::bare(structure) };
        let initial = Initial { x_m: 5e-3, y_m: 5e-3, u_m_per_s: 0.4, ..Initial::default() };
        let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
        motion.run(0.25, &mut ());
        *motion.state()
    };
    let law = |stiffness| lankarani_nikravesh(stiffness, 0.6);
    let hard = at(Wall::Restitution { coefficient: law(1.0).restitution(1.0) });
    let off = |stiffness: f64| {
        let soft = at(Wall::Hertz(law(stiffness)));
        (soft.x_m - hard.x_m).abs().max((soft.offset_m - hard.offset_m).abs())
    };
    // The duration of a contact falls as k^(−2/5): by 10 from k to 316 k.
    let offs = [1e9, 316e9, 1e14, 316e14].map(off);
    println!("{:.2e} {:.2e} {:.2e} {:.2e} m", offs[0], offs[1], offs[2], offs[3]);
    assert!((8.0..12.0).contains(&(offs[0] / offs[1])) && (8.0..12.0).contains(&(offs[2] / offs[3])), "{offs:?}");
    assert!(offs[3] < 1e-6, "{offs:?}");
}

/// Force of the wall where the damper begins to slip, N.
struct BreakAway {
    force_n: f64,
    at_break_n: Option<f64>,
}

impl Observer for BreakAway {
    fn arc(&mut self, arc: &Arc<'_>) {
        if let Some(force) = arc.contact_force() {
            self.force_n = value(&force, arc.end_fraction());
        }
    }

    fn mode(&mut self, _: f64, mode: Mode) {
        if matches!(mode.grip, Grip::Slip(_)) {
            self.at_break_n.get_or_insert(self.force_n);
        }
    }
}

#[test]
fn a_structure_that_the_friction_damper_holds_breaks_away_where_the_contact_force_exceeds_the_friction() {
    let hertz = hunt_crossley(1e8, 0.5);
    let (mass_kg, speed) = (0.16, 0.3);
    // The held structure does not move: the particle hits a body without end.
    let peak_n = hertz.peak_force_n(mass_kg, speed);
    let run = |force_n: f64| {
        let wall = Wall::Hertz(hertz);
        let particle =
            Particle { mass_kg, clearance_m: 0.01, friction_coefficient: 0.0, wall, cavity: Cavity::default() };
        let set_up = SetUp {
            particle: Some(particle),
            friction_damper: Some(FrictionDamper { force_n }),
            ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.01))
        };
        let initial = Initial { u_m_per_s: speed, ..Initial::default() };
        let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
        let mut seen = BreakAway { force_n: 0.0, at_break_n: None };
        motion.run(0.05, &mut seen);
        (seen.at_break_n, motion.state().x_m)
    };
    assert_eq!(run(peak_n * (1.0 + 1e-9)), (None, 0.0));
    for share in [0.05, 0.5, 0.9, 1.0 - 1e-9] {
        let (at_break_n, x_m) = run(peak_n * share);
        let off = at_break_n.expect("it slips") / (peak_n * share) - 1.0;
        assert!(off.abs() < 1e-9 && x_m > 0.0, "{share}: {off:e} {x_m:e}");
    }
}

#[test]
fn a_ball_in_an_upright_cavity_comes_to_rest_at_the_static_penetration() {
    let (k, mass_kg) = (1e8, 0.16);
    for hertz in [hunt_crossley(k, 5.0), lankarani_nikravesh(k, 0.5)] {
        let wall = Wall::Hertz(hertz);
        let cavity = Cavity { inclination_deg: 90.0, ..Cavity::default() };
        let particle = Particle { mass_kg, clearance_m: 0.01, friction_coefficient: 0.0, wall, cavity };
        let set_up = SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1e12, 1.0, 0.0)) };
        let initial = Initial { y_m: 0.005, ..Initial::default() };
        let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
        let (mut first, mut counts) = (First::default(), Counts::of(&set_up));
        motion.run(0.2, &mut first);
        motion.run(3.0, &mut counts);
        let arcs = motion.work().arcs_walked;
        motion.run(4.0, &mut ());
        let state = *motion.state();
        let still_m = libm::pow(mass_kg * GRAVITY_M_PER_S2 / k, 2.0 / 3.0);
        let depth_m = -0.01 - state.offset_m;
        println!(
            "{:?}: {} impacts, depth {depth_m:e} of {still_m:e}, {} arcs in the last second",
            hertz.dissipation,
            counts.impacts,
            motion.work().arcs_walked - arcs
        );
        assert!((depth_m / still_m - 1.0).abs() < 1e-6, "{hertz:?}: {depth_m:e} {still_m:e}");
        assert!(state.slide_m_per_s.abs() < 1e-8 && counts.impacts < 2000, "{state:?}");
        assert!(motion.work().arcs_walked - arcs < 50_000);
        assert!(matches!(motion.mode().contact, Touching::Free(_)));
    }
}
