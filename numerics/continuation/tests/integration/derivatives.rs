//! Derivatives of motions by their start and by parameters: against closed forms and differences of the simulated motion.

use std::f64::consts::TAU;

use damprig_continuation::{Derivatives, Derived, NoDerivatives, Parameter, ReturnMap, System};
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Exact, Excitation, Impact, Observer};
use damprig_core::integrator::modes::{Grip, Mode};
use damprig_core::model::{
    Cavity, FrictionDamper, Initial, Particle, Release, Restitution, SetUp, Structure, Tmd, Wall,
};

use crate::common::{NATURAL, impact_damper, initial, settled, vector};

/// A ball that bounces on a structure too heavy to move, in an upright cavity so high that only its floor is met.
fn bouncing(e: f64, gravity_m_per_s2: f64) -> SetUp {
    let cavity = Cavity { inclination_deg: 90.0, ..Cavity::default() };
    let wall = Wall::Restitution { coefficient: e };
    let particle = Particle { mass_kg: 0.1, clearance_m: 10.0, friction_coefficient: 0.0, wall, cavity };
    SetUp { particle: Some(particle), gravity_m_per_s2, ..SetUp::bare(Structure::from_modal(1e18, 2.5, 0.01)) }
}

/// The n-th bounce is at √(2h/g) (1 + 2e + … + 2eⁿ⁻¹), with the speed eⁿ⁻¹ √(2gh).
#[test]
fn bounces_have_the_derivatives_of_their_closed_form() {
    let (e, g, height): (f64, f64, f64) = (0.9, 9.81, 0.8);
    let set_up = bouncing(e, g);
    // The base moves by less than any rounding of the motion; one period of the drive holds all bounces that are compared.
    let drive = Excitation::Sine { amplitude_m: 1e-25, angular_frequency_rad_per_s: TAU / 3.0, phase_rad: 0.0 };
    let map = ReturnMap::new(&set_up, &drive, 1).unwrap();
    let start = Initial { y_m: -10.0 + height, ..Initial::default() };
    let found = map.derivatives(&start, &[Parameter::Restitution, Parameter::Gravity]).unwrap();
    assert!(found.impacts.len() >= 4, "{}", found.impacts.len());
    let fall = (2.0 * height / g).sqrt();
    for (n, impact) in (1..).zip(&found.impacts) {
        let n = f64::from(n);
        // Σ and its derivative by e.
        let sum = 1.0 + 2.0 * (1..n as i32).map(|k| e.powi(k)).sum::<f64>();
        let by_e = 2.0 * (1..n as i32).map(|k| f64::from(k) * e.powi(k - 1)).sum::<f64>();
        let speed = e.powf(n - 1.0) * (2.0 * g * height).sqrt();
        let near = |found: &Derived, value: f64, by_e: f64, by_g: f64, by_height: f64| {
            let pairs = [
                (found.value, value),
                (found.by_parameters[0], by_e),
                (found.by_parameters[1], by_g),
                (found.by_start[2], by_height),
            ];
            for (found, expected) in pairs {
                // The height is the difference of two of 10 m.
                let rounding = 1e-12 * expected.abs().max(value);
                assert!((found - expected).abs() <= rounding, "bounce {n}: {found} in place of {expected}");
            }
        };
        near(&impact.time_s, fall * sum, fall * by_e, -0.5 * fall * sum / g, 0.5 * fall * sum / height);
        let by_e = (n - 1.0) * speed / e;
        near(&impact.approach_speed_m_per_s, speed, by_e, 0.5 * speed / g, 0.5 * speed / height);
    }
}

/// Seen of a simulated motion: what the derivatives are compared for.
#[derive(Default)]
struct Seen(Vec<(f64, f64)>);

impl Observer for Seen {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        self.0.push((impact.time_s, impact.approach_speed_m_per_s));
    }
}

/// End, largest |x|, RMS of x, and time and speed of the last impact, from the simulation alone; the number of impacts.
fn measured(map: &ReturnMap, at: [f64; 4]) -> (Vec<f64>, usize) {
    let mut response = Response::new(Wanted { whole_run: true, ..Wanted::default() });
    let end = *map.watch(&initial(at), &mut response).state();
    let mut seen = Seen::default();
    map.watch(&initial(at), &mut seen);
    let mut all = vector(&end).to_vec();
    all.extend([response.max_abs_x_m(), response.rms_x_m()]);
    all.extend(seen.0.last().map_or([0.0; 2], |(time_s, speed)| [*time_s, *speed]));
    (all, seen.0.len())
}

/// Place of the largest |x| among them.
const LARGEST: usize = 4;

fn derived(found: &Derivatives) -> Vec<Derived> {
    let mut all = found.end.to_vec();
    all.extend([found.largest_abs_x_m.of.clone(), found.rms_x_m.clone()]);
    if let Some(last) = found.impacts.last() {
        all.extend([last.time_s.clone(), last.approach_speed_m_per_s.clone()]);
    }
    all
}

/// Central differences with steps of `step`, its half and its quarter, extrapolated, and the error that is left: infinite at a kink, where the
/// differences of both sides do not approach each other. `None` where the number of impacts changes.
fn differences(step: f64, rounding: &[f64], at: impl Fn(f64) -> (Vec<f64>, usize)) -> Option<Vec<(f64, f64)>> {
    let (here, count) = at(0.0);
    let mut bends = Vec::new();
    let central = [1.0, 0.5, 0.25].map(|share| {
        let ((above, more), (below, fewer)) = (at(share * step), at(-share * step));
        bends
            .push(above.iter().zip(&below).zip(&here).map(|((a, b), h)| (a + b - 2.0 * h).abs()).collect::<Vec<f64>>());
        let slopes = above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * share * step));
        (more == count && fewer == count).then(|| slopes.collect::<Vec<f64>>())
    });
    let [coarse, middle, fine] = [central[0].as_ref()?, central[1].as_ref()?, central[2].as_ref()?];
    let of = |n: usize| {
        let (first, second) = ((4.0 * middle[n] - coarse[n]) / 3.0, (4.0 * fine[n] - middle[n]) / 3.0);
        let best = (16.0 * second - first) / 15.0;
        // f″ h² falls to a sixteenth, a kink to a quarter.
        let is_kink = bends[2][n] > 0.15 * bends[0][n] + 10.0 * rounding[n];
        (best, if is_kink { f64::INFINITY } else { (best - second).abs() + rounding[n] / step })
    };
    Some((0..rounding.len()).map(of).collect())
}

type Draw<'a> = &'a mut dyn FnMut(f64, f64) -> f64;

/// A random set-up with the parameters that it has, and its frequency ratio.
fn drawn(n: usize, draw: Draw<'_>) -> (SetUp, f64) {
    let structure = SetUp::bare(Structure::from_modal(1.0, 2.5, draw(0.01, 0.1)));
    let k = structure.structure.stiffness_n_per_m;
    let particle = |clearance_m: f64, friction_coefficient: f64, wall: Wall| {
        Some(Particle { mass_kg: 0.1, clearance_m, friction_coefficient, wall, cavity: Cavity::default() })
    };
    let hard = Wall::Restitution { coefficient: draw(0.2, 0.9) };
    let falling = Wall::SpeedRestitution(Restitution {
        coefficient: draw(0.3, 0.9),
        reference_speed_m_per_s: draw(5.0, 60.0),
        exponent: draw(0.05, 0.5),
        maximum: 0.95,
    });
    let release = if draw(0.0, 1.0) < 0.5 { Release::ZeroForce } else { Release::ZeroPenetration };
    let soft = Wall::Voigt { stiffness_n_per_m: draw(500.0, 2e4), damping_n_s_per_m: draw(0.5, 10.0), release };
    let (clearance, ratio) = (draw(1.0, 12.0), draw(0.75, 1.25));
    let damper = Some(FrictionDamper { force_n: draw(0.05, 0.7) * k });
    // Gravity as large as the accelerations of these motions of metres.
    let friction = |set_up: SetUp| SetUp { gravity_m_per_s2: 0.2 * NATURAL * NATURAL, ..set_up };
    let set_up = match n % 7 {
        0 => SetUp { particle: particle(clearance, 0.0, hard), ..structure },
        1 => SetUp { particle: particle(clearance, 0.0, falling), ..structure },
        2 => SetUp { particle: particle(clearance, 0.0, soft), ..structure },
        3 => SetUp { friction_damper: damper, ..structure },
        4 => friction(SetUp { particle: particle(clearance, draw(0.05, 0.5), hard), ..structure }),
        5 => SetUp { particle: particle(clearance, 0.0, hard), friction_damper: damper, ..structure },
        _ => {
            let (mass_kg, frequency) = (draw(0.03, 0.2), draw(0.8, 1.2) * NATURAL);
            let stiffness_n_per_m = mass_kg * frequency * frequency;
            let damping_n_s_per_m = 2.0 * draw(0.02, 0.2) * mass_kg * frequency;
            SetUp { tmd: Some(Tmd { mass_kg, stiffness_n_per_m, damping_n_s_per_m }), ..structure }
        }
    };
    (set_up, ratio)
}

const PARAMETERS: [Parameter; 13] = [
    Parameter::Frequency,
    Parameter::BaseAmplitude,
    Parameter::NaturalFrequency,
    Parameter::StructureDampingRatio,
    Parameter::StructureMass,
    Parameter::Mass,
    Parameter::Clearance,
    Parameter::InternalFriction,
    Parameter::Restitution,
    Parameter::RestitutionExponent,
    Parameter::LinkStiffness,
    Parameter::LinkDamping,
    Parameter::DamperForce,
];

/// The map at another value of a parameter, from the same phase.
fn moved(system: &System, parameter: Parameter, value: f64, phase_rad: f64, periods: u32) -> ReturnMap {
    let (set_up, mut excitation) = system.at(&[(parameter, value)]);
    if let Excitation::Sine { phase_rad: phase, .. } = &mut excitation {
        *phase = phase_rad;
    }
    ReturnMap::new(&set_up, &excitation, periods).unwrap()
}

/// What a comparison of random motions found.
#[derive(Default)]
struct Tally {
    compared: usize,
    refused: usize,
    chatter: usize,
    worst: f64,
}

/// Compares all derivatives of one motion with differences; those whose own error is beyond 1e-8 are left out.
fn compare(
    name: &str,
    found: &Derivatives,
    columns: &[(f64, Vec<f64>)],
    tally: &mut Tally,
    at: impl Fn(usize, f64) -> (Vec<f64>, usize),
) {
    let derived = derived(found);
    let values: Vec<f64> = derived.iter().map(|of| of.value).collect();
    let (simulated, _) = at(0, 0.0);
    for (n, (value, simulated)) in values.iter().zip(&simulated).enumerate() {
        let rounding = 1e-13 * (1.0 + found.growth) * (1.0 + value.abs());
        assert!((value - simulated).abs() <= rounding, "{name}, value {n}: {value}, {simulated} simulated");
    }
    for (k, (value, slopes)) in columns.iter().enumerate() {
        let step = 2e-3 * value.abs().max(1e-3);
        let rounding: Vec<f64> = values.iter().map(|v| 1e-14 * (1.0 + found.growth) * v.abs().max(1e-2)).collect();
        let Some(differences) = differences(step, &rounding, |by| at(k, by)) else { continue };
        for (n, ((expected, error), slope)) in differences.iter().zip(slopes).enumerate() {
            let size = expected.abs().max(values[n].abs() / value.abs().max(1e-3));
            // At a tie the largest |x| has no derivative from both sides.
            if *error > 1e-8 * size || (n == LARGEST && found.largest_abs_x_m.is_tie) {
                continue;
            }
            tally.compared += 1;
            let off = (slope - expected).abs();
            tally.worst = tally.worst.max(off / size);
            assert!(off <= 1e-8 * size, "{name}, column {k}, value {n}: {slope} in place of {expected} ± {error:e}");
        }
    }
}

/// Transient motions of 200 random set-ups over one to three periods.
#[test]
fn derivatives_of_200_random_motions_are_those_of_extrapolated_differences() {
    let mut random = fastrand::Rng::with_seed(36);
    let mut draw = |low: f64, high: f64| low + (high - low) * random.f64();
    let (mut tally, mut motions, mut n) = (Tally::default(), 0, 0);
    while motions < 200 {
        n += 1;
        let (set_up, ratio) = drawn(n, &mut draw);
        let (phase_rad, periods) = (draw(0.0, TAU), 1 + n as u32 % 3);
        let Some((at, map)) = settled(&set_up, ratio, periods, phase_rad) else { continue };
        motions += 1;
        let system = map.system();
        let parameters: Vec<Parameter> =
            PARAMETERS.into_iter().filter(|p| system.has(*p) && system.value(*p) > 0.0).collect();
        let found = match map.derivatives(&initial(at), &parameters) {
            Ok(found) => found,
            Err(NoDerivatives::Chatter) => {
                tally.chatter += 1;
                continue;
            }
            Err(why) => {
                println!("{n}: {why}");
                tally.refused += 1;
                continue;
            }
        };
        let all = derived(&found);
        let of_parameters = parameters.iter().enumerate().map(|(p, parameter)| {
            (system.value(*parameter), all.iter().map(|of| of.by_parameters[p]).collect::<Vec<f64>>())
        });
        // By the start for steps of the amplitude, and of it times Ω.
        let units = [1.0, ratio * NATURAL, 1.0, ratio * NATURAL];
        let of_start = (0..system.size()).map(|k| (units[k], all.iter().map(|of| of.by_start[k]).collect()));
        let of_parameters = of_parameters.chain(of_start);
        let columns: Vec<_> = of_parameters.collect();
        compare(&format!("{n} {set_up:?}"), &found, &columns, &mut tally, |p, by| {
            let Some(parameter) = parameters.get(p) else {
                let mut from = at;
                from[p - parameters.len()] += by;
                return measured(&map, from);
            };
            let value = system.value(*parameter);
            measured(&moved(system, *parameter, value + by, map.phase_rad(), periods), at)
        });
    }
    println!(
        "{} compared, {} refused, {} with chatter, worst {:.1e}",
        tally.compared, tally.refused, tally.chatter, tally.worst
    );
    assert!(tally.compared > 8_000);
    // Of the smooth ones.
    assert!(20 * tally.refused <= motions - tally.chatter, "{} of {motions} refused", tally.refused);
}

/// The orbit with two impacts a period has the derivatives of its closed form.
#[test]
fn a_periodic_orbit_moves_as_its_closed_form() {
    for (ratio, e, d) in [(1.0, 0.5, 10.0), (1.1, 0.5, 5.0), (0.97, 0.7, 8.0)] {
        let formula = |e: f64, d: f64| SymmetricOrbit::new(&impact_damper(d, e), 1.0, ratio * NATURAL).unwrap();
        let (set_up, known) = (impact_damper(d, e), formula(e, d));
        // From a quarter of a period after an impact.
        let turning = ratio * NATURAL;
        let drive = |phase_rad| Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: turning, phase_rad };
        let mut motion = Exact::new(&set_up, &drive(known.drive_phase_rad), &known.initial()).unwrap();
        motion.run(0.25 * TAU / turning, &mut ());
        let start = initial(vector(motion.state()));
        let map = ReturnMap::new(&set_up, &drive(known.drive_phase_rad + 0.25 * TAU), 1).unwrap();
        let found = map.orbit_derivatives(&start, &[Parameter::Restitution, Parameter::Clearance]).unwrap();
        assert_eq!(found.impacts.len(), 2);
        let by = |at: &dyn Fn(f64) -> SymmetricOrbit, step: f64| {
            let speeds = |by: f64| (vec![at(by).approach_speed_m_per_s], 0);
            let expected = differences(step, &[1e-13 * known.approach_speed_m_per_s], speeds).unwrap()[0];
            assert!(expected.1 < 1e-8 * expected.0.abs().max(known.approach_speed_m_per_s), "{expected:?}");
            expected.0
        };
        let expected = [by(&|by| formula(e + by, d), 1e-3), by(&|by| formula(e, d + by), 1e-2)];
        for impact in &found.impacts {
            let speed = &impact.approach_speed_m_per_s;
            for (found, expected) in speed.by_parameters.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-8 * speed.value, "{ratio} {e} {d}: {found}, {expected}");
            }
        }
        // Every length is a multiple of the base's where the clearance is.
        let scaled = map.orbit_derivatives(&start, &[Parameter::BaseAmplitude, Parameter::Clearance]).unwrap();
        let x = &scaled.largest_abs_x_m.of;
        assert!((x.by_parameters[0] + d * x.by_parameters[1] - x.value).abs() < 1e-10 * x.value, "{x:?}");
    }
}

#[test]
fn grazing_and_growing_motions_are_refused_with_the_reason() {
    let amplitude = |damping_ratio: f64| 1.0 / (2.0 * damping_ratio);
    let x = amplitude(0.05) * (1.0_f64 + 0.01).sqrt();
    let drive = Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: NATURAL, phase_rad: 0.0 };
    // At resonance the steady motion of the structure alone has the amplitude √(1 + 4ζ²)/(2ζ); a particle at rest is met, or not.
    let at = |clearance_m: f64| {
        let mut set_up = impact_damper(clearance_m, 0.5);
        set_up.structure = Structure::from_modal(1.0, 2.5, 0.05);
        let bare = SetUp::bare(set_up.structure);
        let mut motion = Exact::new(&bare, &drive, &Initial::default()).unwrap();
        motion.run(300.0 * TAU / NATURAL, &mut ());
        let state = motion.state();
        let start = Initial { x_m: state.x_m, v_m_per_s: state.v_m_per_s, ..Initial::default() };
        ReturnMap::new(&set_up, &drive, 1).unwrap().derivatives(&start, &[Parameter::Clearance])
    };
    for off in [-1e-8, 1e-8] {
        let refused = at(x * (1.0 + off)).unwrap_err();
        assert!(matches!(refused, NoDerivatives::Grazing { change } if change < 1e-7), "{off}: {refused}");
    }
    let missed = at(x * 1.01).unwrap();
    assert!(missed.impacts.is_empty());
    // The clearance may fall by what it is larger.
    assert!((missed.holds_within[0] - (1.0 - 1.0 / 1.01)).abs() < 1e-6, "{:?}", missed.holds_within);
    let chaotic = ReturnMap::new(&impact_damper(5.0, 0.95), &drive, 40).unwrap();
    let refused = chaotic.derivatives(&Initial::default(), &[Parameter::Clearance]).unwrap_err();
    assert!(matches!(refused, NoDerivatives::Growth { growth } if growth > 1e7), "{refused}");
}

/// A structure with friction alone, below its resonance: from F = 0.664 kZ on it sticks at each reversal. On both sides of that force the
/// derivatives say how far it is.
#[test]
fn a_stick_that_appears_or_vanishes_ends_the_range_of_a_derivative() {
    let structure = Structure::from_modal(1.0, 2.5, 0.02);
    let set_up = |ratio: f64| SetUp {
        friction_damper: Some(FrictionDamper { force_n: ratio * structure.stiffness_n_per_m }),
        ..SetUp::bare(structure)
    };
    let turning = 0.92 * NATURAL;
    let drive = |phase_rad| Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: turning, phase_rad };
    // From the middle of a slip.
    let settled = |ratio: f64| {
        let mut motion = Exact::new(&set_up(ratio), &drive(0.0), &Initial::default()).unwrap();
        motion.run(400.0 * TAU / turning, &mut ());
        let start = initial(vector(motion.state()));
        let map = ReturnMap::new(&set_up(ratio), &drive(0.0), 1).unwrap();
        let (from_s, to_s) = map.quiet_parts_s(&start).unwrap()[0];
        let quiet_s = 0.5 * (from_s + to_s);
        motion.run(400.0 * TAU / turning + quiet_s, &mut ());
        (initial(vector(motion.state())), ReturnMap::new(&set_up(ratio), &drive(turning * quiet_s), 1).unwrap())
    };
    let sticks = |ratio: f64| {
        let (start, map) = settled(ratio);
        let mut modes = Sticks(false);
        map.watch(&start, &mut modes);
        modes.0
    };
    let (mut low, mut high) = (0.6, 0.75);
    assert!(!sticks(low) && sticks(high));
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if sticks(middle) { high = middle } else { low = middle }
    }
    for off in [-1e-2, -1e-3, 1e-3, 1e-2] {
        let (start, map) = settled(high * (1.0 + off));
        let within = map.orbit_derivatives(&start, &[Parameter::DamperForce]).unwrap().holds_within[0];
        // To first order.
        assert!((within / off.abs() - 1.0).abs() < 0.3, "{off}: {within}");
    }
}

struct Sticks(bool);

impl Observer for Sticks {
    const ARCS: bool = false;

    fn mode(&mut self, _: f64, mode: Mode) {
        self.0 |= mode.grip == Grip::Stuck;
    }
}
