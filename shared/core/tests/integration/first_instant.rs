//! Events at the start of a motion, compared with closed forms. An impact at t = 0 conserves momentum, multiplies the
//! relative velocity by −e, and changes nothing else, for every damper and base motion.

use damprig_core::analysis::energy::EnergyMeter;
use damprig_core::integrator::exact::{Exact, ExactState, Excitation, Impact, Observer};
use damprig_core::integrator::modes::{Contact, Grip};
use damprig_core::model::{Cavity, FrictionDamper, Initial, Particle, Release, SetUp, Structure, Tmd, Wall};
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

mod closed_forms;
mod sampled_driver;

use closed_forms::*;

#[test]
fn an_impact_at_the_start_conserves_momentum_and_changes_no_other_velocity() {
    let mut draw = Draw::new(31);
    let (mut free, mut slipping) = (0, 0);
    for n in 0..4000 {
        let any = draw.between(0.05, 0.95);
        let restitution = draw.one_of(&[1.0, any, any]);
        let mut set_up = draw.hard(restitution);
        set_up.friction_damper = draw.damper();
        let excitation = draw.excitation(&set_up.structure);
        let drive = Drive::of(&excitation);
        let first = FirstImpact::draw(&mut draw, &set_up, &drive);
        let Some(end_s) = undisturbed_s(0.15, |t| after_impact(&set_up, &drive, &first, t).1) else { continue };
        let mut motion = Exact::new(&set_up, &excitation, &first.initial).expect("drawn within the ranges");
        let mut seen = (Seen::new(), EnergyMeter::new(&set_up));
        motion.run(end_s, &mut seen);
        let impact = seen.0.first.expect("it starts with an impact");
        assert_eq!((impact.time_s, f64::from(impact.side), seen.0.impacts), (0.0, first.side, 1), "{n}");
        let (expected, _) = after_impact(&set_up, &drive, &first, end_s);
        // Rounding errors of displacements of some cm, over some rad.
        let (found, turning) = (phase(motion.state()), drive.turning.max(40.0));
        assert!(close(&found, &expected, 1e-14, turning), "{n}: {found:?} {expected:?}\n{set_up:?} {excitation:?}");
        let balance = seen.1.balance();
        let through = balance.dissipated_j() + balance.input_j.abs() + balance.stored_change_j.abs();
        assert!(balance.residual_j.abs() <= 1e-13 * (through + 0.1), "{n}: {balance:?}");
        let has_damper = set_up.friction_damper.is_some_and(|damper| damper.force_n > 0.0);
        if has_damper { slipping += 1 } else { free += 1 }
    }
    assert!(free > 1500 && slipping > 500, "only {free} and {slipping} were tested");
}

#[test]
fn an_impact_at_the_start_of_a_known_case_gives_the_structure_its_share_of_the_momentum() {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 0.03,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.5 },
        cavity: Cavity::default(),
    };
    let set_up = SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)) };
    let initial = Initial { x_m: 0.0, v_m_per_s: -0.01, y_m: 0.03, u_m_per_s: 1.0 };
    let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
    motion.run(1e-9, &mut ());
    // −0.01 + 0.1/1.1 · 1.5 · 1.01
    assert!((motion.state().v_m_per_s - 0.127_727_272_727_272_73).abs() < 1e-9);
    assert_eq!(motion.mode().grip, Grip::Absent);
}

/// Without restitution particle and structure move together if the wall pushes the particle, and separate if it would
/// have to pull.
#[test]
fn a_plastic_impact_at_the_start_sticks_or_separates_by_the_sign_of_the_wall_force() {
    let mut draw = Draw::new(32);
    let (mut joined, mut parted) = (0, 0);
    for n in 0..2000 {
        let mut set_up = draw.hard(0.0);
        let particle = set_up.particle.as_mut().expect("a particle is mounted");
        particle.friction_coefficient = 0.0;
        let particle = *particle;
        let excitation = draw.excitation(&set_up.structure);
        let drive = Drive::of(&excitation);
        let first = FirstImpact::draw(&mut draw, &set_up, &drive);
        let (structure, v) = (&set_up.structure, first.after.0);
        let together = structure.mass_kg + particle.mass_kg;
        let at = |mass: f64, t: f64| oscillator(structure, mass, &drive, 0.0, (first.initial.x_m, v), t);
        let acceleration = |t: f64| {
            let ((x, vx), (z, vz)) = (at(together, t), drive.base(t));
            let pull = structure.stiffness_n_per_m * (x - z) + structure.damping_n_s_per_m * (vx - vz);
            (drive.force(t) - pull) / together
        };
        let stays = acceleration(0.0) * first.side < 0.0;
        let holds = |t: f64| {
            let apart = first.initial.y_m + v * t - at(structure.mass_kg, t).0;
            let same = if stays { acceleration(t) * first.side < 0.0 } else { apart.abs() < particle.clearance_m };
            same && t < drive.until_s
        };
        let Some(end_s) = undisturbed_s(0.1, holds) else { continue };
        let mut motion = Exact::new(&set_up, &excitation, &first.initial).expect("drawn within the ranges");
        let mut seen = Seen::new();
        motion.run(end_s, &mut seen);
        assert_eq!(seen.impacts, 1, "{n}");
        let (x, vx) = at(if stays { together } else { structure.mass_kg }, end_s);
        let (y, u) =
            if stays { (x + first.side * particle.clearance_m, vx) } else { (first.initial.y_m + v * end_s, v) };
        let (found, turning) = (phase(motion.state()), drive.turning.max(40.0));
        assert!(close(&found, &[x, vx, y, u], 1e-14, turning), "{n}: {found:?} {:?}", [x, vx, y, u]);
        if stays { joined += 1 } else { parted += 1 }
    }
    assert!(joined > 500 && parted > 500, "only {joined} and {parted} were tested");
}

/// Fourth-order Runge–Kutta method with short steps for the equations of one mode; relative error below 10⁻¹³.
fn runge_kutta(
    rate: impl Fn(f64, &Phase) -> Phase,
    mut s: Phase,
    end_s: f64,
    mut see: impl FnMut(f64, &Phase),
) -> Phase {
    let steps = 4000;
    let h = end_s / f64::from(steps);
    let moved = |s: &Phase, k: &Phase, by: f64| core::array::from_fn(|n| s[n] + by * k[n]);
    for step in 0..steps {
        let t = h * f64::from(step);
        let a = rate(t, &s);
        let b = rate(t + 0.5 * h, &moved(&s, &a, 0.5 * h));
        let c = rate(t + 0.5 * h, &moved(&s, &b, 0.5 * h));
        let d = rate(t + h, &moved(&s, &c, h));
        s = core::array::from_fn(|n| s[n] + h / 6.0 * (a[n] + 2.0 * (b[n] + c[n]) + d[n]));
        see(t + h, &s);
    }
    s
}

/// A tuned mass, or a particle that starts in contact with a soft wall: no velocity jumps, and the friction damper
/// resists the slip.
#[test]
fn no_velocity_jumps_at_the_start_of_a_tuned_mass_or_of_a_soft_contact() {
    let mut draw = Draw::new(33);
    let (mut tuned, mut soft) = (0, 0);
    for n in 0..600 {
        let mut set_up = draw.hard(0.5);
        set_up.friction_damper = draw.damper();
        let is_tuned = n % 2 == 0;
        let (stiffness, damping, second, rest);
        let mut particle = set_up.particle.expect("a particle is mounted");
        let excitation = draw.excitation(&set_up.structure);
        let drive = Drive::of(&excitation);
        let any = draw.between(-0.3, 0.3);
        let (x0, v0) = (draw.maybe(-20e-3, 20e-3), draw.one_of(&[0.0, any, any]));
        let side = draw.side();
        let offset;
        if is_tuned {
            let tmd = draw.tmd(&set_up.structure);
            (set_up.particle, set_up.tmd) = (None, Some(tmd));
            (stiffness, damping, second, rest) = (tmd.stiffness_n_per_m, tmd.damping_n_s_per_m, tmd.mass_kg, 0.0);
            offset = draw.between(-20e-3, 20e-3);
        } else {
            particle.wall = draw.soft();
            particle.friction_coefficient = 0.0;
            set_up.particle = Some(particle);
            let Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, .. } = particle.wall else { unreachable!() };
            (stiffness, damping, second) = (stiffness_n_per_m, damping_n_s_per_m, particle.mass_kg);
            rest = side * particle.clearance_m;
            offset = rest;
        }
        let initial =
            Initial { x_m: x0, v_m_per_s: v0, y_m: x0 + offset, u_m_per_s: v0 + side * draw.between(0.05, 1.0) };
        let structure = set_up.structure;
        let slip = v0 - drive.base(0.0).1;
        let resistance = set_up.friction_damper.map_or(0.0, |damper| damper.force_n) * slip.signum();
        if slip == 0.0 && resistance != 0.0 {
            continue;
        }
        let rate = |t: f64, s: &Phase| {
            let (z, vz) = drive.base(t);
            let joint = stiffness * (s[2] - s[0] - rest) + damping * (s[3] - s[1]);
            let spring = structure.stiffness_n_per_m * (s[0] - z) + structure.damping_n_s_per_m * (s[1] - vz);
            [s[1], (joint - spring - resistance + drive.force(t)) / structure.mass_kg, s[3], -joint / second]
        };
        // While the slip keeps its direction and the wall pushes.
        let mut until_s = 0.0;
        let mut holds = true;
        let start = [initial.x_m, initial.v_m_per_s, initial.y_m, initial.u_m_per_s];
        runge_kutta(rate, start, 0.02, |t, s| {
            let slips = resistance == 0.0 || (s[1] - drive.base(t).1) * slip > 0.0;
            let force = side * (stiffness * (s[2] - s[0] - rest) + damping * (s[3] - s[1]));
            let pushes = is_tuned || (force > 0.0 && side * (s[2] - s[0] - rest) > 0.0);
            holds &= slips && pushes && t < drive.until_s;
            if holds {
                until_s = 0.9 * t;
            }
        });
        if until_s < 1e-3 {
            continue;
        }
        let expected = runge_kutta(rate, start, until_s, |_, _| {});
        let mut motion = Exact::new(&set_up, &excitation, &initial).expect("drawn within the ranges");
        let mut meter = EnergyMeter::new(&set_up);
        motion.run(until_s, &mut meter);
        let found = phase(motion.state());
        assert!(close(&found, &expected, 1e-13, 100.0), "{n}: {found:?} {expected:?}\n{set_up:?} {excitation:?}");
        let balance = meter.balance();
        let through = balance.dissipated_j() + balance.input_j.abs() + balance.stored_change_j.abs();
        assert!(balance.residual_j.abs() <= 1e-13 * (through + 0.1), "{n}: {balance:?}");
        if is_tuned { tuned += 1 } else { soft += 1 }
    }
    assert!(tuned > 150 && soft > 150, "only {tuned} and {soft} were tested");
}

/// A structure with the velocity of the base sticks if the friction damper can hold it; otherwise it slips in the
/// direction of the other forces.
#[test]
fn a_structure_as_fast_as_its_base_sticks_or_slips_by_the_required_friction_force() {
    let mut draw = Draw::new(34);
    let (mut stuck, mut slipping) = (0, 0);
    for n in 0..1000 {
        let structure = draw.structure();
        let force_n = draw.between(0.05, 4.0);
        let set_up = SetUp { friction_damper: Some(FrictionDamper { force_n }), ..SetUp::bare(structure) };
        // Bases whose initial velocity is exactly zero.
        let turning = structure.angular_frequency_rad_per_s() * draw.between(0.5, 1.6);
        let amplitude_n = draw.between(0.1, 4.0);
        let excitation = draw.one_of(&[
            Excitation::Fixed,
            Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s: turning, phase_rad: FRAC_PI_2 },
        ]);
        let drive = Drive::of(&excitation);
        let initial = Initial { x_m: draw.between(-20e-3, 20e-3), ..Initial::default() };
        let pull = drive.force(0.0) - structure.stiffness_n_per_m * initial.x_m;
        let sticks = pull.abs() <= force_n;
        let resistance = force_n * pull.signum();
        let at = |t: f64| oscillator(&structure, structure.mass_kg, &drive, -resistance, (initial.x_m, 0.0), t);
        let holds = |t: f64| {
            if sticks {
                (drive.force(t) - structure.stiffness_n_per_m * initial.x_m).abs() <= force_n
            } else {
                at(t).1 * pull > 0.0
            }
        };
        let Some(end_s) = undisturbed_s(0.1, holds) else { continue };
        let mut motion = Exact::new(&set_up, &excitation, &initial).expect("drawn within the ranges");
        motion.run(end_s, &mut ());
        let (x, v) = if sticks { (initial.x_m, 0.0) } else { at(end_s) };
        let found = motion.state();
        // Near resonance the closed form is a difference of large displacements.
        let steady = amplitude_n / (structure.stiffness_n_per_m - structure.mass_kg * turning * turning).abs();
        let allowed = 64.0 * f64::EPSILON * (steady + initial.x_m.abs());
        let apart = ((found.x_m - x).abs(), (found.v_m_per_s - v).abs());
        assert!(apart.0 <= allowed && apart.1 <= allowed * turning.max(40.0), "{n}: {apart:?}, allowed {allowed:e}");
        assert_eq!(motion.mode().grip == Grip::Stuck, sticks, "{n}");
        if sticks { stuck += 1 } else { slipping += 1 }
    }
    assert!(stuck > 150 && slipping > 500, "only {stuck} and {slipping} were tested");
}

#[test]
fn a_restart_during_a_run_equals_a_start_with_the_drive_phase_of_that_time() {
    let mut draw = Draw::new(35);
    for n in 0..500 {
        let restitution = draw.between(0.0, 1.0);
        let mut set_up = draw.hard(restitution);
        set_up.friction_damper = draw.damper();
        let turning = set_up.structure.angular_frequency_rad_per_s() * draw.between(0.5, 1.6);
        let (amplitude_m, phase_rad, late_s) =
            (draw.between(0.5e-3, 5e-3), draw.between(-3.0, 3.0), draw.between(0.1, 3.0));
        let sine = |phase_rad: f64| Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: turning, phase_rad };
        let drive = Drive::of(&sine(phase_rad + turning * late_s));
        let first = FirstImpact::draw(&mut draw, &set_up, &drive);
        let mut restarted = Exact::new(&set_up, &sine(phase_rad), &Initial::default()).expect("physical");
        restarted.run(late_s, &mut ());
        restarted.reset(late_s, &first.initial);
        let mut fresh = Exact::new(&set_up, &sine(phase_rad + turning * late_s), &first.initial).expect("physical");
        let end_s = draw.between(1e-6, 0.02);
        let (mut seen_restarted, mut seen_fresh) = (Seen::new(), Seen::new());
        restarted.run(late_s + end_s, &mut seen_restarted);
        fresh.run(end_s, &mut seen_fresh);
        let (found, expected) = (phase(restarted.state()), phase(fresh.state()));
        assert!(close(&found, &expected, 1e-14, 100.0), "{n}: {found:?} {expected:?}");
        assert_eq!(seen_restarted.impacts, seen_fresh.impacts, "{n}");
    }
}

/// Everything starts at rest, with the particle at a wall: it presses, rests or leaves without an impact. A particle
/// that starts a nanometre before the wall gives the same motion but for that nanometre.
#[test]
fn a_particle_at_rest_at_a_wall_makes_no_impact_and_leaves_no_unresolved_event() {
    let mut draw = Draw::new(39);
    let (mut pressed, mut compared) = (0, 0);
    for n in 0..3000 {
        let any = draw.between(0.0, 1.0);
        let restitution = draw.one_of(&[0.0, 1.0, any]);
        let mut set_up = draw.hard(restitution);
        set_up.friction_damper = draw.damper();
        let is_soft = n % 2 == 0;
        let mut particle = set_up.particle.expect("a particle is mounted");
        if is_soft {
            particle.wall = draw.soft();
            set_up.particle = Some(particle);
        }
        let excitation = draw.excitation(&set_up.structure);
        let (x_m, v) = (draw.maybe(-20e-3, 20e-3), draw.maybe(-0.2, 0.2));
        let side = draw.side();
        let start = |short_m: f64| Initial {
            x_m,
            v_m_per_s: v,
            y_m: x_m + side * (particle.clearance_m - short_m),
            u_m_per_s: v,
        };
        let mut motion = Exact::new(&set_up, &excitation, &start(0.0)).expect("drawn within the ranges");
        let mut seen = (Seen::new(), EnergyMeter::new(&set_up));
        motion.run(1e-4, &mut seen);
        let is_clear = matches!(motion.mode().contact, Contact::Free(_));
        pressed += usize::from(!is_clear || motion.touch() != Default::default());
        assert_eq!(seen.0.impacts, 0, "{n}: {:?}\n{set_up:?} {excitation:?} {:?}", seen.0.first, start(0.0));
        motion.run(3.0, &mut seen);
        assert_eq!(motion.unresolved(), 0, "{n}: {set_up:?} {excitation:?} {:?}", start(0.0));
        assert!(seen.0.least_m_per_s > 1e-15, "{n}: {:e}", seen.0.least_m_per_s);
        let balance = seen.1.balance();
        let through = balance.dissipated_j() + balance.input_j.abs() + balance.stored_change_j.abs();
        assert!(
            balance.residual_j.abs() <= 1e-12 * (through + 0.1),
            "{n}: {balance:?}\n{set_up:?} {excitation:?} {:?}",
            start(0.0)
        );
        if is_soft {
            let at = |short_m: f64| {
                let mut motion = Exact::new(&set_up, &excitation, &start(short_m)).expect("drawn within the ranges");
                motion.run(0.05, &mut ());
                phase(motion.state())
            };
            let (touching, apart) = (at(0.0), at(1e-9));
            // Contacts and friction propagate a change, but do not amplify it a thousandfold.
            assert!(close(&touching, &apart, 1e-6, 100.0), "{n}: {touching:?} {apart:?}\n{set_up:?} {excitation:?}");
            compared += 1;
        }
    }
    assert!(pressed > 500 && compared == 1500, "{pressed} pressed, {compared} compared");
}

/// A half-sine pulse ends with a jump of the base's velocity, a versine without. A sticking structure keeps its
/// velocity: it slips after the half-sine, but not after the versine.
#[test]
fn a_sticking_structure_keeps_its_velocity_when_that_of_the_base_jumps() {
    let mut draw = Draw::new(41);
    for n in 0..300 {
        let structure = draw.structure();
        let duration_s = draw.between(0.1, 0.4);
        let amplitude_m = draw.between(1e-3, 5e-3);
        let turning = TAU / duration_s;
        // Enough friction to carry the structure through the pulse.
        let force_n = 2.0 * amplitude_m * structure.mass_kg * turning * turning;
        let set_up = SetUp { friction_damper: Some(FrictionDamper { force_n }), ..SetUp::bare(structure) };
        let still = Initial { v_m_per_s: amplitude_m * PI / duration_s, ..Initial::default() };
        let half_sine = Excitation::HalfSine { amplitude_m, duration_s };
        let versine = Excitation::Versine { amplitude_m, duration_s };
        for (excitation, initial, jump) in
            [(half_sine, still, amplitude_m * PI / duration_s), (versine, Initial::default(), 0.0)]
        {
            let mut motion = Exact::new(&set_up, &excitation, &initial).expect("drawn within the ranges");
            motion.run(duration_s * (1.0 - 1e-9), &mut ());
            assert_eq!(motion.mode().grip, Grip::Stuck, "{n} {excitation:?}");
            let slides_s = jump * structure.mass_kg / force_n;
            let mut slipped = Slipped(false);
            motion.run(duration_s + 1e-6 * slides_s.max(1e-3), &mut slipped);
            let v = motion.state().v_m_per_s;
            assert!((v + jump).abs() <= 1e-5 * jump + 1e-12, "{n}: {v} after a jump of {jump}");
            assert_eq!(slipped.0, jump > 0.0, "{n} {excitation:?}");
        }
    }
}

struct Slipped(bool);

impl Observer for Slipped {
    const ARCS: bool = false;

    fn mode(&mut self, _: f64, mode: damprig_core::integrator::modes::Mode) {
        self.0 |= matches!(mode.grip, Grip::Slip(_));
    }
}
