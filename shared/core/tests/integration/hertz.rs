//! Hertz walls: contacts against the closed forms of free impacts, a second method, and what any wall must keep.

use damprig_core::analysis::energy::EnergyMeter;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::series::value;
use damprig_core::integrator::exact::{Arc, ContactEnd, Exact, ExactState, Excitation, Impact, Observer};
use damprig_core::integrator::modes::{Contact as Touching, Grip, Mode};
use damprig_core::integrator::sampled::{Joined, Sampled};
use damprig_core::integrator::units::Units;
use damprig_core::model::{
    Cavity, Dissipation, FrictionDamper, GRAVITY_M_PER_S2, Hertz, Initial, Particle, Release, SetUp, Structure, Wall,
};

use differential_equations::prelude::{ExplicitRungeKutta, IVP, ODE};

use crate::draw::Draw;

fn hunt_crossley(stiffness_n_per_m15: f64, coefficient_s_per_m: f64) -> Hertz {
    Hertz { stiffness_n_per_m15, dissipation: Dissipation::HuntCrossley { coefficient_s_per_m } }
}

fn lankarani_nikravesh(stiffness_n_per_m15: f64, coefficient: f64) -> Hertz {
    Hertz { stiffness_n_per_m15, dissipation: Dissipation::LankaraniNikravesh { coefficient } }
}

/// What a contact was.
#[derive(Clone, Copy, Debug, Default)]
struct Contact {
    touch_s: f64,
    approach_m_per_s: f64,
    duration_s: f64,
    force_n: f64,
    separation_m_per_s: f64,
    depth_m: f64,
    pieces: u32,
}

/// The first contact of a run.
#[derive(Default)]
struct First {
    contact: Contact,
    touched: bool,
    ended: bool,
    end_m: f64,
}

impl Observer for First {
    fn arc(&mut self, arc: &Arc<'_>) {
        if self.touched && !self.ended {
            self.contact.pieces += 1;
            let deepest = (0..=50).map(|n| arc.state(arc.length_s * f64::from(n) / 50.0));
            let deepest = deepest.map(|s| s.offset_m.abs() - self.end_m).fold(0.0, f64::max);
            self.contact.depth_m = self.contact.depth_m.max(deepest);
            // Where it turns, the deepest point is the root of the speed.
            if arc.start.slide_m_per_s * arc.end.slide_m_per_s < 0.0 {
                let (mut low, mut high) = (0.0, arc.length_s);
                for _ in 0..80 {
                    let middle = 0.5 * (low + high);
                    let same = arc.state(middle).slide_m_per_s * arc.start.slide_m_per_s > 0.0;
                    (low, high) = if same { (middle, high) } else { (low, middle) };
                }
                self.contact.depth_m = self.contact.depth_m.max(arc.state(low).offset_m.abs() - self.end_m);
            }
        }
    }

    fn impact(&mut self, impact: &Impact) {
        if !self.touched {
            (self.touched, self.end_m) = (true, impact.before.offset_m.abs());
            self.contact.touch_s = impact.time_s;
            self.contact.approach_m_per_s = impact.approach_speed_m_per_s;
        }
    }

    fn contact_end(&mut self, end: &ContactEnd) {
        if !self.ended {
            self.ended = true;
            let hertz = end.hertz.expect("a Hertz wall");
            self.contact.duration_s = hertz.duration_s;
            self.contact.force_n = hertz.peak_force_n;
            assert_eq!(
                (hertz.touch_s, hertz.approach_speed_m_per_s),
                (self.contact.touch_s, self.contact.approach_m_per_s)
            );
            self.contact.separation_m_per_s = end.separation_speed_m_per_s;
        }
    }

    fn goes_on(&mut self, _: f64) -> bool {
        !self.ended
    }
}

/// Two free bodies: the structure's spring does nothing within a contact.
fn free(hertz: Hertz, mass_kg: f64, clearance_m: f64) -> SetUp {
    let structure = Structure { mass_kg: 1.0, stiffness_n_per_m: 1e-12, damping_n_s_per_m: 0.0 };
    let wall = Wall::Hertz(hertz);
    let particle = Particle { mass_kg, clearance_m, friction_coefficient: 0.0, wall, cavity: Cavity::default() };
    SetUp { particle: Some(particle), ..SetUp::bare(structure) }
}

/// The first contact of a free particle of that speed, and its largest force, N.
fn impact(set_up: &SetUp, speed_m_per_s: f64) -> (Contact, f64) {
    // From the wall itself: the touch is at t = 0, so that the duration has no rounding of a late time.
    let initial = Initial {
        y_m: set_up.particle.expect("it has one").clearance_m,
        u_m_per_s: speed_m_per_s,
        ..Initial::default()
    };
    let mut motion = Exact::new(set_up, &Excitation::Fixed, &initial).expect("physical");
    let mut first = First::default();
    let mut response = Response::new(Wanted { whole_run: true, ..Wanted::default() });
    motion.run(1e3, &mut (&mut first, &mut response));
    assert!(first.ended, "{set_up:?}");
    assert_eq!(motion.unresolved(), 0);
    let force_n = response.peak_contact_force_n().expect("a contact");
    assert_eq!(first.contact.force_n, force_n);
    (first.contact, force_n)
}

/// ∫ dt of a free impact over δ′ = u from v to −e v, by tanh-sinh quadrature: dt = −(m/k) du/((1 + βu) δ^1.5).
fn duration_s(hertz: &Hertz, reduced_kg: f64, v: f64) -> f64 {
    let (k, b) = (hertz.stiffness_n_per_m15, hertz.rate_s_per_m(v));
    let separation = v * hertz.restitution(v);
    // G(u + c) − G(u) without cancellation: (x b u + x − ln(1 + x))/b² with x = b c/(1 + b u).
    let gained = |u: f64, c: f64| {
        if b == 0.0 {
            return c * u + 0.5 * c * c;
        }
        let x = b * c / (1.0 + b * u);
        let rest = if x.abs() > 0.05 {
            x - x.ln_1p()
        } else {
            (2..20).rev().fold(0.0, |sum, n| 1.0 / f64::from(n) - x * sum) * x * x
        };
        (x * b * u + rest) / (b * b)
    };
    let half = |from: f64, to: f64| {
        // Singular at `from`, where δ = 0; regular at 0.
        let length = to - from;
        let mut sum = 0.0;
        let step = 1.0 / 64.0;
        for n in -400..400 {
            let t = f64::from(n) * step;
            let s = core::f64::consts::FRAC_PI_2 * t.sinh();
            // Distance from `from` as a share: 1/(1 + exp(−2s)).
            let share = 1.0 / (1.0 + (-2.0 * s).exp());
            let weight = core::f64::consts::FRAC_PI_2 * t.cosh() / (2.0 * s.cosh().powi(2));
            let a = length * share;
            let u = from + a;
            if share == 0.0 || !weight.is_finite() || weight == 0.0 {
                continue;
            }
            let work = gained(u, -a);
            let depth15 = (2.5 * reduced_kg / k * work).powf(0.6);
            sum += step * weight * length.abs() * (reduced_kg / k) / ((1.0 + b * u) * depth15);
        }
        sum
    };
    half(v, 0.0) + half(-separation, 0.0)
}

#[test]
fn a_free_impact_has_duration_force_depth_and_restitution_of_the_closed_forms_over_five_decades() {
    let mut worst = [0.0_f64; 4];
    for decade in 0..=10 {
        let speed = 1e-3 * 10.0_f64.powf(0.5 * f64::from(decade));
        for (hertz, mass_kg) in [
            (hunt_crossley(1e9, 0.0), 0.16),
            (hunt_crossley(1e6, 0.3), 0.02),
            (hunt_crossley(1e10, 0.02), 0.4),
            (lankarani_nikravesh(1e9, 0.6), 0.16),
            (lankarani_nikravesh(1e7, 0.95), 0.3),
            (lankarani_nikravesh(1e8, 0.0), 0.1),
        ] {
            let set_up = free(hertz, mass_kg, 0.01);
            let (contact, force_n) = impact(&set_up, speed);
            let reduced_kg = mass_kg / (1.0 + mass_kg);
            let e = contact.separation_m_per_s / contact.approach_m_per_s;
            let offs = [
                // Where β v is large, 1 − β e v is below the rounding of its terms in the quadrature.
                if hertz.rate_s_per_m(speed) * speed > 15.0 {
                    0.0
                } else {
                    contact.duration_s / duration_s(&hertz, reduced_kg, speed) - 1.0
                },
                force_n / hertz.peak_force_n(reduced_kg, speed) - 1.0,
                contact.depth_m / hertz.peak_penetration_m(reduced_kg, speed) - 1.0,
                e - hertz.restitution(speed),
            ];
            println!(
                "{speed:.1e} {:?}: {:.1e} {:.1e} {:.1e} {:.1e} {} pieces e {e}",
                hertz.dissipation, offs[0], offs[1], offs[2], offs[3], contact.pieces
            );
            for (worst, off) in worst.iter_mut().zip(offs) {
                assert!(off.is_finite());
                *worst = worst.max(off.abs());
            }
        }
    }
    println!("at most: duration {:.1e}, force {:.1e}, depth {:.1e}, e {:.1e}", worst[0], worst[1], worst[2], worst[3]);
    assert!(worst.iter().all(|off| *off < 1e-9), "{worst:?}");
    let hertz = hunt_crossley(1e9, 0.0);
    let off = duration_s(&hertz, 0.1, 0.3) / hertz.elastic_duration_s(0.1, 0.3) - 1.0;
    assert!(off.abs() < 1e-12, "the quadrature itself: {off:e}");
}

impl Draw {
    fn hertz_wall(&mut self) -> Wall {
        let stiffness_n_per_m15 = 10.0_f64.powf(self.between(4.0, 9.5));
        Wall::Hertz(if self.coin() {
            hunt_crossley(stiffness_n_per_m15, if self.coin() { self.between(0.0, 5.0) } else { 0.0 })
        } else {
            lankarani_nikravesh(stiffness_n_per_m15, self.between(0.0, 1.0))
        })
    }

    /// A cavity with a Hertz wall at one side at least, off its centre and inclined.
    fn hertz_cavity(&mut self) -> SetUp {
        let mut set_up = self.set_up(Self::hertz_wall);
        let particle = set_up.particle.as_mut().expect("it has one");
        let positive_wall = match self.one_of(4) {
            0 => Some(Wall::Restitution { coefficient: self.between(0.0, 0.95) }),
            1 => Some(Wall::Voigt {
                stiffness_n_per_m: self.between(500.0, 60_000.0),
                damping_n_s_per_m: self.between(0.0, 20.0),
                release: Release::ZeroForce,
            }),
            2 => Some(self.hertz_wall()),
            _ => None,
        };
        particle.cavity = Cavity {
            positive_wall,
            offset_m: particle.clearance_m * self.between(-2.0, 2.0),
            inclination_deg: if self.one_of(4) == 0 { 90.0 } else { self.between(-90.0, 90.0) },
        };
        if self.coin() {
            particle.cavity.inclination_deg = 0.0;
        }
        set_up
    }
}

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
        let turned_over = balance.dissipated_j() + balance.input_j.abs() + balance.stored_change_j.abs();
        let size = turned_over + set_up.particle.expect("it has one").mass_kg * set_up.weight_m_per_s2().abs() * 0.1;
        let off = balance.residual_j.abs() / size;
        assert!(off <= 1e-9, "{n}: {:e} of {size:e} {set_up:?}", balance.residual_j);
        assert!(balance.link_damping_j >= -1e-12 * size, "{n}: {:e}", balance.link_damping_j);
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

#[test]
fn the_sampled_integrator_refuses_a_hertz_wall() {
    let set_up = free(hunt_crossley(1e9, 0.0), 0.1, 0.01);
    let name = "particle.wall.stiffness_n_per_m15";
    let units = Units::metres(1e-3);
    assert_eq!(Joined::<f64>::joined(&set_up, units, &set_up.neutral()).expect_err("Hertz").parameter, name);
    let other = Sampled::<f64>::new(&set_up, units, &set_up.neutral()).expect_err("Hertz");
    assert_eq!(other.parameter, name);
    let mut negative = set_up;
    negative.particle.as_mut().expect("it has one").wall = Wall::Hertz(hunt_crossley(-1.0, 0.0));
    assert_eq!(negative.validate().expect_err("below 0").parameter, name);
    negative.particle.as_mut().expect("it has one").wall = Wall::Hertz(lankarani_nikravesh(1.0, 1.1));
    assert_eq!(negative.validate().expect_err("above 1").parameter, "particle.wall.coefficient");
}

/// A contact with every smooth force, in units of its own duration and depth: x, x′, δ, δ′.
struct Scaled<'a> {
    set_up: &'a SetUp,
    hertz: Hertz,
    rate_s_per_m: f64,
    base: (f64, f64, f64),
    duration_s: f64,
    depth_m: f64,
}

impl ODE<f64, [f64; 4]> for Scaled<'_> {
    fn diff(&self, t: f64, s: &[f64; 4], rate: &mut [f64; 4]) {
        let (structure, particle) = (&self.set_up.structure, self.set_up.particle.expect("it has one"));
        let (amplitude_m, turning, phase) = self.base;
        let speed = self.depth_m / self.duration_s;
        let (sine, cosine) = (turning * t * self.duration_s + phase).sin_cos();
        let stretch = s[0] * self.depth_m - amplitude_m * sine;
        let slip = s[1] * speed - amplitude_m * turning * cosine;
        let depth_m = s[2].max(0.0) * self.depth_m;
        let push =
            self.hertz.stiffness_n_per_m15 * depth_m.powf(1.5) * (1.0 + self.rate_s_per_m * s[3] * speed).max(0.0);
        let x = (push - structure.stiffness_n_per_m * stretch - structure.damping_n_s_per_m * slip) / structure.mass_kg;
        let y = -push / particle.mass_kg - self.set_up.weight_m_per_s2();
        let per = self.duration_s / speed;
        *rate = [s[1], x * per, s[3], (y - x) * per];
    }
}

#[test]
fn a_contact_under_every_smooth_force_agrees_with_a_second_method() {
    let mut draw = Draw::new(34);
    let mut worst = 0.0_f64;
    for _ in 0..60 {
        let mut set_up = draw.set_up(Draw::hertz_wall);
        set_up.friction_damper = None;
        let particle = set_up.particle.as_mut().expect("it has one");
        (particle.friction_coefficient, particle.cavity.inclination_deg) = (0.0, draw.between(-90.0, 90.0));
        // The other wall is out of reach.
        particle.clearance_m = 1.0;
        let particle = *particle;
        let hertz = particle.wall.hertz().expect("drawn");
        let (approach, x_m, v) = (draw.between(0.02, 2.0), draw.between(-5e-3, 5e-3), draw.between(-0.2, 0.2));
        let initial = Initial { x_m, v_m_per_s: v, y_m: x_m + particle.clearance_m, u_m_per_s: v + approach };
        let sine = draw.sine(&set_up);
        let Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad } = sine else { unreachable!() };
        let reduced_kg = particle.mass_kg * set_up.structure.mass_kg / (particle.mass_kg + set_up.structure.mass_kg);
        let scaled = Scaled {
            set_up: &set_up,
            hertz,
            rate_s_per_m: hertz.rate_s_per_m(approach),
            base: (amplitude_m, angular_frequency_rad_per_s, phase_rad),
            duration_s: hertz.elastic_duration_s(reduced_kg, approach),
            depth_m: hertz.peak_penetration_m(reduced_kg, approach),
        };
        let speed = scaled.depth_m / scaled.duration_s;
        // While it presses, near its end, and in most cases behind it.
        for share in [0.1, 0.4, 0.8, 1.3] {
            let mut motion = Exact::new(&set_up, &sine, &initial).expect("physical");
            motion.run(share * scaled.duration_s, &mut ());
            let method = ExplicitRungeKutta::dop853().rtol(1e-13).atol(1e-14);
            let start = [x_m / scaled.depth_m, v / speed, 0.0, approach / speed];
            let solution = IVP::ode(&scaled, 0.0, share, start).method(method).solve().expect("it ends");
            let other = *solution.last().expect("a point").1;
            let state = motion.state();
            // The largest of x and x′ is that of the motion of the structure, not of the contact.
            let offs = [
                (state.x_m / scaled.depth_m - other[0]) / (1.0 + other[0].abs()),
                (state.v_m_per_s / speed - other[1]) / (approach / speed + other[1].abs()),
                (state.offset_m - particle.clearance_m) / scaled.depth_m - other[2],
                (state.slide_m_per_s / speed - other[3]) * speed / approach,
            ];
            for off in offs {
                // y − x has a rounding of the clearance.
                let rounding = 16.0 * f64::EPSILON * particle.clearance_m / scaled.depth_m;
                assert!(off.abs() < 1e-9 + rounding, "{share}: {offs:?} {set_up:?}");
                worst = worst.max(off.abs() - rounding);
            }
        }
    }
    println!("largest difference {worst:.1e} of the contact");
}
