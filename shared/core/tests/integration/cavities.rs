//! Cavities as they are: two different walls, a cavity that is not centred, and one that is inclined or upright.

use damprig_core::analysis::energy::EnergyMeter;
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::exact::{Accumulation, Arc, Exact, ExactState, Excitation, Impact, Observer};
use damprig_core::integrator::modes::{Contact, Mode};
use damprig_core::integrator::sampled::{Joined, SampledState};
use damprig_core::integrator::units::Units;
use damprig_core::model::{Cavity, GRAVITY_M_PER_S2, Initial, Particle, Release, Restitution, SetUp, Structure, Wall};
use damprig_core::scalar::Scalar;

use crate::balance::missed;
use crate::draw::Draw;

mod states;

impl Draw {
    fn wall(&mut self) -> Wall {
        match self.one_of(4) {
            0 => Wall::Restitution { coefficient: self.between(0.0, 0.95) },
            1 => Wall::SpeedRestitution(Restitution {
                coefficient: self.between(0.1, 0.9),
                reference_speed_m_per_s: self.between(0.05, 1.0),
                exponent: self.between(0.05, 1.0),
                maximum: self.between(0.3, 0.95),
            }),
            kind => Wall::Voigt {
                stiffness_n_per_m: self.between(500.0, 60_000.0),
                damping_n_s_per_m: self.between(0.0, 20.0),
                release: if kind == 2 { Release::ZeroForce } else { Release::ZeroPenetration },
            },
        }
    }

    /// A cavity with two walls of any kinds, off its centre and inclined.
    fn cavity(&mut self) -> SetUp {
        let set_up = self.set_up(Self::wall);
        with(&set_up, |particle| {
            particle.cavity = Cavity {
                positive_wall: Some(self.wall()),
                offset_m: particle.clearance_m * self.between(-2.0, 2.0),
                inclination_deg: if self.one_of(4) == 0 { 90.0 } else { self.between(-90.0, 90.0) },
            }
        })
    }
}

fn particle(set_up: &SetUp) -> Particle {
    set_up.particle.expect("it has one")
}

fn with(set_up: &SetUp, change: impl FnOnce(&mut Particle)) -> SetUp {
    let mut changed = *set_up;
    change(changed.particle.as_mut().expect("it has one"));
    changed
}

/// Every state at 200 instants of 4 s.
fn exact_states(set_up: &SetUp, excitation: &Excitation, initial: &Initial) -> Vec<ExactState> {
    let mut motion = Exact::new(set_up, excitation, initial).expect("physical");
    let states = (1..=200).map(|n| {
        motion.run(0.02 * f64::from(n), &mut ());
        *motion.state()
    });
    let states = states.collect();
    assert_eq!(motion.unresolved(), 0, "{set_up:?}");
    states
}

fn joined_states<S: Scalar>(set_up: &SetUp, initial: &Initial, pulse_m: f64) -> Vec<SampledState<S>> {
    let mut motion = Joined::<S>::joined(set_up, Units::metres(1e-3), initial).expect("physical");
    let at = |step: u32| pulse_m * libm::sin(step.min(100) as f64 * 0.01 * core::f64::consts::PI);
    (0..2000)
        .map(|step| {
            let ends = [at(step), at(step + 1)].map(S::from_f64);
            motion.step(&BaseSegment::hermite(ends[0], ends[1], S::ZERO, S::ZERO), &mut ());
            *motion.state()
        })
        .collect()
}

#[test]
fn two_equal_walls_that_are_given_apart_are_one_wall_to_the_last_bit() {
    let mut draw = Draw::new(1);
    for _ in 0..60 {
        let one = with(&draw.cavity(), |p| p.cavity.positive_wall = None);
        let two = with(&one, |p| p.cavity.positive_wall = Some(p.wall));
        let (sine, initial) = (draw.sine(&one), draw.initial(&one));
        assert_eq!(exact_states(&one, &sine, &initial), exact_states(&two, &sine, &initial));
        assert_eq!(joined_states::<f64>(&one, &initial, 2e-3), joined_states::<f64>(&two, &initial, 2e-3));
        assert_eq!(joined_states::<f32>(&one, &initial, 2e-3), joined_states::<f32>(&two, &initial, 2e-3));
    }
}

#[test]
fn the_mirrored_set_up_has_the_mirrored_motion_to_the_last_bit() {
    let mut draw = Draw::new(2);
    for _ in 0..120 {
        let set_up = draw.cavity();
        let mirrored = with(&set_up, |p| {
            let [negative, positive] = p.walls();
            (p.wall, p.cavity.positive_wall) = (positive, Some(negative));
            (p.cavity.offset_m, p.cavity.inclination_deg) = (-p.cavity.offset_m, -p.cavity.inclination_deg);
        });
        let initial = draw.initial(&set_up);
        let opposite = Initial {
            x_m: -initial.x_m,
            v_m_per_s: -initial.v_m_per_s,
            y_m: -initial.y_m,
            u_m_per_s: -initial.u_m_per_s,
        };
        let pulse_m = draw.between(-5e-3, 5e-3);
        let pulse = |amplitude_m: f64| Excitation::HalfSine { amplitude_m, duration_s: 0.3 };
        let motion = exact_states(&set_up, &pulse(pulse_m), &initial);
        for (a, b) in motion.iter().zip(exact_states(&mirrored, &pulse(-pulse_m), &opposite)) {
            assert_eq!((a.x_m, a.v_m_per_s), (-b.x_m, -b.v_m_per_s), "{set_up:?}");
            assert_eq!((a.offset_m, a.slide_m_per_s), (-b.offset_m, -b.slide_m_per_s), "{set_up:?}");
        }
        fn same<S: Scalar>((set_up, initial, pulse_m): (&SetUp, &Initial, f64), mirrored: (&SetUp, &Initial)) {
            let motion = joined_states::<S>(set_up, initial, pulse_m);
            for (a, b) in motion.iter().zip(joined_states::<S>(mirrored.0, mirrored.1, -pulse_m)) {
                let opposite = SampledState { x: -b.x, v: -b.v, offset: -b.offset, slide: -b.slide };
                assert_eq!(*a, opposite, "{set_up:?}");
            }
        }
        same::<f64>((&set_up, &initial, pulse_m), (&mirrored, &opposite));
        same::<f32>((&set_up, &initial, pulse_m), (&mirrored, &opposite));
    }
}

/// Where an error grows as little as possible: a heavy damping of the structure, a few impacts.
#[test]
fn a_cavity_off_its_centre_moves_the_structure_as_a_centred_one_does() {
    let mut draw = Draw::new(3);
    let mut worst = 0.0_f64;
    for _ in 0..60 {
        let set_up = draw.cavity();
        let offset_m = particle(&set_up).cavity.offset_m;
        let centred = with(&set_up, |p| p.cavity.offset_m = 0.0);
        let initial = draw.initial(&set_up);
        let shifted = Initial { y_m: initial.y_m - offset_m, ..initial };
        let run = |set_up: &SetUp, initial: &Initial| {
            let mut motion = Exact::new(set_up, &Excitation::Fixed, initial).expect("physical");
            motion.run(0.5, &mut ());
            *motion.state()
        };
        let (there, here) = (run(&set_up, &initial), run(&centred, &shifted));
        let off = (there.x_m - here.x_m).abs().max((there.offset_m - offset_m - here.offset_m).abs());
        worst = worst.max(off);
    }
    println!("largest difference {worst:e} m");
    assert!(worst < 1e-12, "{worst:e} m");
}

/// A structure so heavy and so slow that nothing moves it.
fn rock(cavity: Cavity, friction_coefficient: f64, wall: Wall) -> SetUp {
    let particle = Particle { mass_kg: 0.1, clearance_m: 0.1, friction_coefficient, wall, cavity };
    SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1e14, 1e-3, 0.0)) }
}

const UPRIGHT: Cavity = Cavity { positive_wall: None, offset_m: 0.0, inclination_deg: 90.0 };

#[derive(Default)]
struct Bounces {
    impacts: Vec<Impact>,
    end: Option<Accumulation>,
}

impl Observer for Bounces {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        self.impacts.push(*impact);
    }

    fn accumulation(&mut self, accumulation: &Accumulation) {
        self.end = Some(*accumulation);
    }
}

#[test]
fn a_ball_in_an_upright_cavity_bounces_at_the_times_of_the_closed_form_and_comes_to_rest() {
    let falling = Restitution { coefficient: 0.6, reference_speed_m_per_s: 0.5, exponent: 0.25, maximum: 0.8 };
    for (wall, law) in [
        (Wall::Restitution { coefficient: 0.7 }, Restitution::constant(0.7)),
        (Wall::SpeedRestitution(falling), falling),
    ] {
        let set_up = rock(UPRIGHT, 0.3, wall);
        let top = Initial { y_m: 0.1, ..Initial::default() };
        let mut motion = Exact::new(&set_up, &Excitation::Fixed, &top).expect("physical");
        let mut seen = Bounces::default();
        motion.run(5.0, &mut seen);
        let g = GRAVITY_M_PER_S2;
        let mut speed = (2.0 * g * 0.2_f64).sqrt();
        let mut time = speed / g;
        assert!(seen.impacts.len() > 20, "{}", seen.impacts.len());
        for impact in &seen.impacts {
            assert_eq!(impact.side, -1);
            assert!((impact.time_s - time).abs() < 1e-12, "{} {time}", impact.time_s);
            assert!((impact.approach_speed_m_per_s - speed).abs() < 1e-12);
            speed *= law.at(speed);
            time += 2.0 * speed / g;
        }
        // The times of the impacts that are summed.
        while speed > 1e-14 {
            speed *= law.at(speed);
            time += 2.0 * speed / g;
        }
        let end = seen.end.expect("the ball comes to rest");
        assert!((end.ended_s - time).abs() < 1e-12, "{} {time}", end.ended_s);
        assert_eq!(motion.mode().contact, Contact::Held(-1));
        assert_eq!(motion.state().offset_m, -0.1);
    }
}

#[test]
fn the_sampled_drivers_ball_bounces_as_that_of_the_closed_form() {
    let set_up = rock(UPRIGHT, 0.0, Wall::Restitution { coefficient: 0.7 });
    let top = Initial { y_m: 0.1, ..Initial::default() };
    let states = joined_states::<f64>(&set_up, &top, 0.0);
    let g = GRAVITY_M_PER_S2;
    let (fall_s, speed) = ((0.4 / g).sqrt(), 0.7 * (0.4 * g).sqrt());
    for (n, state) in states.iter().enumerate().take_while(|(n, _)| (*n as f64) < 1e3 * (fall_s + 2.0 * speed / g)) {
        let t = (n + 1) as f64 * 1e-3;
        let since = t - fall_s;
        let height = if since < 0.0 { 0.2 - 0.5 * g * t * t } else { speed * since - 0.5 * g * since * since };
        // The last step may end after the second impact.
        assert!((state.offset + 0.1 - height.max(0.0)).abs() < 1e-12 || height < 1e-3, "{t}: {state:?} {height}");
    }
    assert!((states[1999].offset + 0.1).abs() < 1e-15 && states[1999].slide == 0.0, "it rests");
}

#[test]
fn on_an_incline_the_particle_sticks_below_the_angle_of_friction_and_slides_above_it() {
    let slope = |inclination_deg: f64| {
        let cavity = Cavity { inclination_deg, ..Cavity::default() };
        let set_up = rock(cavity, 0.5, Wall::Restitution { coefficient: 0.5 });
        let mut motion = Exact::new(&set_up, &Excitation::Fixed, &Initial::default()).expect("physical");
        motion.run(0.15, &mut ());
        (motion.mode(), *motion.state())
    };
    // The angle of friction is 26.57°.
    for degrees in [-26.0, 26.0] {
        let (mode, state) = slope(degrees);
        assert_eq!((mode.contact, state.offset_m), (Contact::Held(0), 0.0), "{degrees}");
    }
    for degrees in [-40.0_f64, 27.0, 60.0] {
        let (mode, state) = slope(degrees);
        let angle = degrees.abs().to_radians();
        let a = -degrees.signum() * GRAVITY_M_PER_S2 * (angle.sin() - 0.5 * angle.cos());
        assert!(matches!(mode.contact, Contact::Free(_)));
        assert!((state.slide_m_per_s - 0.15 * a).abs() < 1e-14, "{degrees}: {state:?}");
        // It meets no wall in this time.
        assert!((state.offset_m - 0.01125 * a).abs() < 1e-15 && state.offset_m.abs() < 0.1, "{degrees}: {state:?}");
    }
}

/// The contact force of a particle that rests on a wall, and its value where the wall releases the particle.
struct Contacts {
    set_up: SetUp,
    least_n: f64,
    at_release_n: Vec<f64>,
    was_held: bool,
    last_n: f64,
}

impl Observer for Contacts {
    fn arc(&mut self, arc: &Arc<'_>) {
        let weight = self.set_up.weight_m_per_s2();
        let held = matches!(arc.mode.contact, Contact::Held(-1));
        if !held && self.was_held {
            self.at_release_n.push(self.last_n);
        }
        self.was_held = held;
        if held {
            let h = arc.length_s / 100.0;
            for n in 1..100 {
                let t = h * f64::from(n);
                let a = (arc.state(t + h).v_m_per_s - arc.state(t - h).v_m_per_s) / (2.0 * h);
                self.least_n = self.least_n.min(a + weight);
            }
            let (end, early) = (arc.end.v_m_per_s, arc.state(arc.length_s - h).v_m_per_s);
            self.last_n = (end - early) / h + weight;
        }
    }
}

#[test]
fn a_particle_that_rests_on_its_wall_leaves_it_where_the_wall_would_have_to_pull() {
    let structure = Structure::from_modal(1.6, 2.5, 0.01);
    let wall = Wall::Restitution { coefficient: 0.3 };
    let cavity = Cavity { inclination_deg: 40.0, ..Cavity::default() };
    let particle = Particle { mass_kg: 0.16, clearance_m: 0.05, friction_coefficient: 0.0, wall, cavity };
    let set_up = SetUp { particle: Some(particle), ..SetUp::bare(structure) };
    let initial = Initial { x_m: 0.0, y_m: -0.05, ..Initial::default() };
    let drive = |amplitude_m: f64| Excitation::Sine {
        amplitude_m,
        angular_frequency_rad_per_s: structure.angular_frequency_rad_per_s(),
        phase_rad: 0.0,
    };
    let watch = |amplitude_m: f64| {
        let mut motion = Exact::new(&set_up, &drive(amplitude_m), &initial).expect("physical");
        let mut seen =
            Contacts { set_up, least_n: f64::INFINITY, at_release_n: Vec::new(), was_held: false, last_n: 0.0 };
        motion.run(6.0, &mut seen);
        seen
    };
    let moves = watch(1e-3);
    assert!(moves.at_release_n.is_empty() && moves.least_n > 0.5, "{} N/kg", moves.least_n);
    let leaves = watch(4e-3);
    println!("least {} N/kg, at releases {:?}", leaves.least_n, leaves.at_release_n);
    assert!(leaves.at_release_n.len() > 3);
    // Differences over a hundredth of an arc.
    assert!(leaves.least_n > -0.05);
    assert!(leaves.at_release_n.iter().all(|force| force.abs() < 0.1), "{:?}", leaves.at_release_n);
}

#[derive(Default)]
struct Counts {
    impacts: u32,
    ends: u32,
    held: u32,
}

impl Observer for Counts {
    const ARCS: bool = false;

    fn impact(&mut self, _: &Impact) {
        self.impacts += 1;
    }

    fn accumulation(&mut self, _: &Accumulation) {
        self.ends += 1;
    }

    fn mode(&mut self, _: f64, mode: Mode) {
        self.held += u32::from(matches!(mode.contact, Contact::Held(_)));
    }
}

#[test]
fn the_energy_balance_of_every_cavity_closes_and_no_particle_passes_a_hard_wall() {
    let mut draw = Draw::new(4);
    let (mut all, mut worst) = (Counts::default(), 0.0_f64);
    for n in 0..300 {
        let set_up = draw.cavity();
        let (sine, initial) = (draw.sine(&set_up), draw.initial(&set_up));
        let mut motion = Exact::new(&set_up, &sine, &initial).expect("drawn within the ranges");
        let (mut meter, mut inside) = (EnergyMeter::new(&set_up), Inside(set_up));
        motion.run(10.0, &mut (&mut meter, &mut (&mut inside, &mut all)));
        assert_eq!(motion.unresolved(), 0);
        let balance = meter.balance();
        // At 10 s the time of an event is rounded to 1.8e-15 s. A particle of 10 g on a wall of 60 kN/m, with √(k1/m) = 2450/s, has then
        // 4e-12 of its energy more or less after a contact; the contacts add as a random walk whose early steps are smaller.
        let (off, size_j) = missed(&set_up, &balance);
        assert!(off <= 1e-11, "{n}: {:e} of {size_j:e} {set_up:?}", balance.residual_j);
        worst = worst.max(off);
    }
    println!("at most {worst:e} of the energy");
    assert!(all.impacts > 10_000 && all.ends > 100 && all.held > 100, "{} {} {}", all.impacts, all.ends, all.held);
}

struct Inside(SetUp);

impl Observer for Inside {
    fn arc(&mut self, arc: &Arc<'_>) {
        let particle = particle(&self.0);
        let ([low, high], [negative, positive]) = (particle.ends_m(), particle.walls());
        let allowed = 64.0 * f64::EPSILON * (low.abs() + high.abs() + arc.start.x_m.abs() + arc.end.x_m.abs());
        for n in 0..=20 {
            let offset = arc.state(arc.length_s * f64::from(n) / 20.0).offset_m;
            assert!(negative.is_soft() || offset >= low - allowed, "{:e} past the wall", low - offset);
            assert!(positive.is_soft() || offset <= high + allowed, "{:e} past the wall", offset - high);
        }
    }
}

#[test]
fn both_drivers_move_alike_in_every_cavity() {
    let mut draw = Draw::new(5);
    let (mut worst, mut resolved) = (0.0_f64, 0);
    for n in 0..120 {
        let set_up = draw.cavity();
        let initial = draw.initial(&set_up);
        let mut exact = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
        exact.run(0.4, &mut ());
        let mut sampled = Joined::<f64>::joined(&set_up, Units::metres(1e-3), &initial).expect("physical");
        (0..400).for_each(|_| sampled.step(&BaseSegment::at_rest(0.0), &mut ()));
        let (sampled, is_resolved) = (*sampled.state(), sampled.unresolved() == 0);
        let exact = exact.state();
        let off = (exact.x_m - sampled.x).abs().max((exact.offset_m - sampled.offset).abs());
        // A chatter may have more events than a step allows; it is then cut short.
        if !is_resolved {
            continue;
        }
        resolved += 1;
        worst = worst.max(off);
        // Flights of a soft contact are exact to 2e-13 of their amplitude, and impacts magnify that.
        assert!(off < 1e-9, "{n}: {off:e} {set_up:?}");
    }
    println!("largest difference {worst:e} m");
    assert!(resolved > 80, "{resolved}");
}

#[test]
fn the_closed_form_orbit_is_of_symmetric_cavities_and_shifts_with_the_cavity() {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 15e-3,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.5 },
        cavity: Cavity { offset_m: 4e-3, ..Cavity::default() },
    };
    let set_up = SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)) };
    let turning = set_up.structure.angular_frequency_rad_per_s();
    let orbit = |set_up: &SetUp| SymmetricOrbit::new(set_up, 1.5e-3, turning);
    let found = orbit(&set_up).expect("it exists");
    let drive = Excitation::Sine {
        amplitude_m: 1.5e-3,
        angular_frequency_rad_per_s: turning,
        phase_rad: found.drive_phase_rad,
    };
    let mut motion = Exact::new(&set_up, &drive, &found.initial()).expect("physical");
    motion.run(core::f64::consts::TAU / turning, &mut ());
    assert!((motion.state().x_m - found.impact_displacement_m).abs() < 1e-9, "{:?}", motion.state());
    assert!(orbit(&with(&set_up, |p| p.cavity.inclination_deg = 1.0)).is_none());
    assert!(orbit(&with(&set_up, |p| p.cavity.positive_wall = Some(Wall::Restitution { coefficient: 0.6 }))).is_none());
}

#[test]
fn values_of_a_cavity_outside_their_ranges_are_named() {
    let set_up = Draw::new(6).cavity();
    let refused = |change: fn(&mut Particle)| with(&set_up, change).validate().expect_err("out of range").parameter;
    assert_eq!(refused(|p| p.cavity.inclination_deg = 90.1), "particle.inclination_deg");
    assert_eq!(refused(|p| p.cavity.inclination_deg = f64::NAN), "particle.inclination_deg");
    assert_eq!(refused(|p| p.cavity.offset_m = f64::INFINITY), "particle.offset_m");
    let bouncy = |p: &mut Particle| p.cavity.positive_wall = Some(Wall::Restitution { coefficient: 1.1 });
    assert_eq!(refused(bouncy), "particle.positive_wall.coefficient");
    let outside = Initial { y_m: particle(&set_up).ends_m()[1] + 1e-3, ..Initial::default() };
    assert_eq!(set_up.validate_initial(&outside).expect_err("outside").parameter, "initial.y_m");
    assert!(set_up.validate_initial(&set_up.neutral()).is_ok());
}
