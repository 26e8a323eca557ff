//! Exact derivatives against central differences of motions and closed forms.

use crate::random_set_ups::{Case, Draw, cubic};
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Cavity, Particle, Wall};
use damprig_structures::{
    Body, Drive, ImpactDamper, Mode, Modes, Motion, MotionCase, NoDerivatives, Observer, Piece, SetUp, State, Varied,
};
use fastrand::Rng;

/// Cycles of each motion.
const CYCLES: f64 = 6.0;

/// A change of a case by a factor of one of its quantities; whether it has it.
pub type Change = fn(&mut Case, f64) -> bool;

pub const QUANTITIES: [(&str, Change); 13] = [
    ("frequency of the first mode", |case, by| {
        case.set_up.structure.modes[0].angular_frequency_rad_per_s *= by;
        true
    }),
    ("damping of the second mode", |case, by| {
        case.set_up.structure.modes[1].damping_ratio *= by;
        true
    }),
    ("shape at the first place", |case, by| {
        case.set_up.structure.modes[0].shape[0] *= by;
        true
    }),
    ("start", |case, by| {
        case.start.modal[0] *= by;
        true
    }),
    ("mass of the particle", |case, by| {
        case.set_up.impact_dampers.first_mut().map(|damper| damper.particle.mass_kg *= by).is_some()
    }),
    ("clearance", |case, by| {
        case.set_up.impact_dampers.first_mut().map(|damper| damper.particle.clearance_m *= by).is_some()
    }),
    ("friction of the particle", |case, by| {
        let damper = case.set_up.impact_dampers.first_mut();
        damper.is_some_and(|damper| {
            damper.particle.friction_coefficient *= by;
            damper.particle.friction_coefficient > 0.0
        })
    }),
    ("inclination", |case, by| {
        let damper = case.set_up.impact_dampers.first_mut();
        damper.is_some_and(|damper| {
            damper.particle.cavity.inclination_deg *= by;
            damper.particle.cavity.inclination_deg != 0.0
        })
    }),
    ("wall", |case, by| {
        let Some(damper) = case.set_up.impact_dampers.first_mut() else { return false };
        match &mut damper.particle.wall {
            Wall::Restitution { coefficient } => *coefficient *= by,
            Wall::SpeedRestitution(law) => law.exponent *= by,
            Wall::Voigt { stiffness_n_per_m, .. } => *stiffness_n_per_m *= by,
            _ => return false,
        }
        true
    }),
    ("friction force", |case, by| {
        case.set_up.friction_dampers.first_mut().map(|joint| joint.damper.force_n *= by).is_some()
    }),
    ("spring of the tuned mass", |case, by| {
        case.set_up.tuned_masses.first_mut().map(|tuned| tuned.tmd.stiffness_n_per_m *= by).is_some()
    }),
    ("amplitude of the drive", |case, by| match &mut case.excitation {
        Excitation::Sine { amplitude_m: amplitude, .. } | Excitation::ForceSine { amplitude_n: amplitude, .. } => {
            *amplitude *= by;
            true
        }
        _ => false,
    }),
    ("frequency of the drive", |case, by| match &mut case.excitation {
        Excitation::Sine { angular_frequency_rad_per_s: turning, .. }
        | Excitation::ForceSine { angular_frequency_rad_per_s: turning, .. } => {
            *turning *= by;
            true
        }
        _ => false,
    }),
];

pub fn motion_case(case: &Case) -> MotionCase {
    MotionCase {
        set_up: case.set_up.clone(),
        drive: Drive::ClosedForm(case.excitation),
        start: case.start.clone(),
        duration_s: CYCLES * case.cycle_s,
    }
}

pub fn changed(case: &Case, change: Change, by: f64) -> Case {
    let mut case = case.clone();
    change(&mut case, by);
    case
}

/// The end of a motion, as [`damprig_structures::Derivatives`] has it.
fn end(case: &Case, of: &Case) -> Vec<f64> {
    let mut motion = Motion::new(&case.set_up, &case.excitation, &case.start).expect("it starts");
    motion.run(CYCLES * of.cycle_s, &mut ()).expect("it goes on");
    let (state, (z, rate)) = (motion.state(), motion.base());
    let is_force = case.set_up.driven_place.is_some();
    let influence = |place: usize| if is_force { 0.0 } else { case.set_up.structure.influence[place] };
    let bodies = state.tuned_masses.iter().zip(case.set_up.tuned_masses.iter().map(|tuned| tuned.place));
    let particles = state.particles.iter().zip(case.set_up.impact_dampers.iter().map(|damper| damper.place));
    let bodies: Vec<_> = bodies.chain(particles).collect();
    let mut end = state.modal.clone();
    end.extend(bodies.iter().map(|(body, place)| body.y_m - influence(*place) * z));
    end.extend(&state.modal_rate);
    end.extend(bodies.iter().map(|(body, place)| body.u_m_per_s - influence(*place) * rate));
    end
}

/// The derivative of the end per relative change from central differences over h, h/2, h/4, extrapolated, with what two extrapolations differ by.
fn differences(case: &Case, change: Change, h: f64) -> Vec<(f64, f64)> {
    let central = |h: f64| -> Vec<f64> {
        let [low, high] = [1.0 - h, 1.0 + h].map(|by| end(&changed(case, change, by), case));
        high.iter().zip(low).map(|(high, low)| (high - low) / (2.0 * h)).collect()
    };
    let [coarse, middle, fine] = [h, 0.5 * h, 0.25 * h].map(central);
    let all = coarse.into_iter().zip(middle).zip(fine);
    all.map(|((coarse, middle), fine)| {
        let [first, second] = [(4.0 * middle - coarse) / 3.0, (4.0 * fine - middle) / 3.0];
        ((16.0 * second - first) / 15.0, (second - first).abs())
    })
    .collect()
}

/// Whether the end has the same derivative on both sides, to 10⁻⁴ of the largest, over a relative change of 10⁻⁶ of each quantity.
fn is_smooth(case: &Case, own: &[&(&str, Change)]) -> bool {
    own.iter().all(|(_, change)| {
        let at = |by: f64| end(&changed(case, *change, by), case);
        let (low, here, high) = (at(1.0 - 1e-6), at(1.0), at(1.0 + 1e-6));
        let slopes = low.iter().zip(&here).zip(&high).map(|((low, here), high)| [here - low, high - here]);
        let slopes: Vec<[f64; 2]> = slopes.map(|both| both.map(|change| change / 1e-6)).collect();
        let size = slopes.iter().flatten().map(|slope| slope.abs()).fold(case.scale_m, f64::max);
        slopes.iter().all(|[before, after]| (after - before).abs() <= 1e-4 * size)
    })
}

/// All 200 with `DAMPRIG_FULL`, else the first 12. At most 5 % of the motions with an end that is smooth in every quantity are refused.
#[test]
fn derivatives_of_random_motions_are_those_of_their_differences() {
    let count = if std::env::var_os("DAMPRIG_FULL").is_some() { 200 } else { 12 };
    let (mut compared, mut cases, mut worst, mut wrong, mut smooth_refused) = (0, 0, 0.0_f64, Vec::new(), Vec::new());
    let mut refused: std::collections::BTreeMap<String, usize> = std::collections::BTreeMap::new();
    for number in 0..count {
        let case = Draw(Rng::with_seed(number as u64)).case(number);
        let own: Vec<_> = QUANTITIES.iter().filter(|(_, change)| change(&mut case.clone(), 1.0)).collect();
        let varied: Vec<Varied> = own
            .iter()
            .map(|(_, change)| Varied {
                value: 1.0,
                cases: Varied::AT.map(|by| {
                    let mut at = motion_case(&changed(&case, *change, by));
                    at.duration_s = CYCLES * case.cycle_s;
                    at
                }),
            })
            .collect();
        let found = match motion_case(&case).derivatives(&varied, &mut |_| true) {
            Ok(found) => found,
            Err(why) => {
                let kind = format!("{why:?}");
                let kind = kind.split([' ', '(', '{']).next().unwrap_or_default();
                *refused.entry(kind.to_string()).or_default() += 1;
                if !matches!(why, NoDerivatives::Growth { .. }) && is_smooth(&case, &own) {
                    smooth_refused.push(format!("{number}: {why}"));
                }
                continue;
            }
        };
        cases += 1;
        for (which, (name, change)) in own.iter().enumerate() {
            let h = (0.05 * found.holds_within[which]).min(1e-3);
            if h < 1e-6 {
                continue;
            }
            let size = found.end.iter().map(|of| of.by[which].abs()).fold(0.0, f64::max);
            for (place, (by, uncertain)) in differences(&case, *change, h).into_iter().enumerate() {
                // Velocities differ from displacements in size.
                let scale = size.max(case.scale_m);
                let apart = (found.end[place].by[which] - by).abs() / scale;
                // What the differences do not know, and their rounding.
                let allowed = uncertain / scale + 1e-13 * found.growth.max(1.0) * 10.0 / h;
                if allowed > 1e-6 {
                    continue;
                }
                compared += 1;
                if apart > (3.0 * allowed).max(1e-8) {
                    wrong.push(format!(
                        "{number}, {name}, {place}: {apart:.1e} apart, {allowed:.1e} known, growth {:.1}, h {h:.0e}",
                        found.growth
                    ));
                } else if allowed < 1e-8 {
                    worst = worst.max(apart);
                }
            }
        }
    }
    println!(
        "{cases} of {count} cases, {compared} derivatives compared, largest difference {worst:.1e}; refused: {refused:?}, of them smooth:\n{}",
        smooth_refused.join("\n")
    );
    assert!(smooth_refused.len() * 20 <= cases + smooth_refused.len(), "{}", smooth_refused.len());
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
    assert!(compared > 20 * count);
}

/// A particle in a cavity upright that does not move.
fn upright(height_m: f64, g: f64, e: f64) -> MotionCase {
    let mode = Mode { angular_frequency_rad_per_s: 10.0, damping_ratio: 0.1, shape: vec![0.0], participation: 0.0 };
    let structure = Modes { modes: vec![mode], influence: vec![0.0], coupling_per_s: Vec::new() };
    let wall = Wall::Restitution { coefficient: e };
    let cavity = Cavity { inclination_deg: 90.0, ..Cavity::default() };
    let particle = Particle { mass_kg: 0.1, clearance_m: 1.0, friction_coefficient: 0.0, wall, cavity };
    let set_up =
        SetUp { impact_dampers: vec![ImpactDamper::new(0, particle)], gravity_m_per_s2: g, ..SetUp::bare(structure) };
    let start = State {
        modal: vec![0.0],
        modal_rate: vec![0.0],
        particles: vec![Body { y_m: height_m - 1.0, u_m_per_s: 0.0 }],
        ..State::default()
    };
    MotionCase { set_up, drive: Drive::ClosedForm(Excitation::Fixed), start, duration_s: 2.0 }
}

/// t₁ = √(2h/g), t_n = t₁ (1 + 2 Σ eᵏ) and v_n = eⁿ⁻¹ √(2gh).
#[test]
fn times_and_speeds_of_a_bouncing_mass_have_the_derivatives_of_the_closed_form() {
    let (height_m, g, e) = (0.3, 9.81, 0.7);
    let varied = [
        Varied { value: height_m, cases: Varied::AT.map(|by| upright(by * height_m, g, e)) },
        Varied { value: g, cases: Varied::AT.map(|by| upright(height_m, by * g, e)) },
        Varied { value: e, cases: Varied::AT.map(|by| upright(height_m, g, by * e)) },
    ];
    let found = upright(height_m, g, e).derivatives(&varied, &mut |_| true).expect("it has derivatives");
    let first_s = (2.0 * height_m / g).sqrt();
    let mut worst = 0.0_f64;
    assert!(found.impacts.len() >= 10, "{}", found.impacts.len());
    for (n, impact) in found.impacts.iter().enumerate().take(10) {
        let n = n as i32;
        let sum: f64 = (1..=n).map(|k| e.powi(k)).sum();
        let by_e: f64 = (1..=n).map(|k| f64::from(k) * e.powi(k - 1)).sum();
        let time_s = first_s * (1.0 + 2.0 * sum);
        let speed = e.powi(n) * (2.0 * g * height_m).sqrt();
        let of_time = [0.5 * time_s / height_m, -0.5 * time_s / g, 2.0 * first_s * by_e];
        let of_speed = [0.5 * speed / height_m, 0.5 * speed / g, f64::from(n) * speed / e];
        let time = impact.time_s.by.iter().zip(of_time).map(|(by, is)| (by - is).abs() / is.abs().max(time_s));
        let speeds = &impact.approach_speed_m_per_s.by;
        let speed = speeds.iter().zip(of_speed).map(|(by, is)| (by - is).abs() / is.abs().max(speed));
        worst = time.chain(speed).fold(worst, f64::max);
    }
    println!("largest difference {worst:.1e}");
    assert!(worst < 1e-12, "{worst:.1e}");
}

/// The largest displacements and mean squares from pieces of a motion.
#[derive(Default)]
pub struct Measured {
    pub largest_m: Vec<f64>,
    pub squares: Vec<f64>,
}

impl Observer for Measured {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        self.largest_m.resize(piece.place_count(), 0.0);
        self.squares.resize(piece.place_count(), 0.0);
        for place in 0..piece.place_count() {
            let course = piece.place(place);
            self.largest_m[place] = course.largest_abs((0.0, piece.length_s), self.largest_m[place]);
            self.squares[place] += course.square_m2_s();
        }
    }
}

/// Pulses of the base and of a force, from a random state: the largest displacement and the RMS of every place by the pulse's height and length,
/// and the end.
#[test]
fn peaks_and_mean_squares_under_pulses_follow_height_and_length_of_the_pulse() {
    let pulses: [fn(f64, f64) -> Excitation; 3] = [
        |size, duration_s| Excitation::HalfSine { amplitude_m: 4e-3 * size, duration_s },
        |size, duration_s| Excitation::Versine { amplitude_m: 4e-3 * size, duration_s },
        |size, duration_s| Excitation::ForceHalfSine { amplitude_n: 2.0 * size, duration_s },
    ];
    let mut compared = 0;
    for (n, pulse) in pulses.into_iter().enumerate() {
        // Set-ups 3, 4, 8 and 19 have no impacts at one instant.
        for number in [3, 4, 8, 19] {
            let case = Draw(Rng::with_seed(number)).case(number as usize);
            let length_s = 0.4 * case.cycle_s;
            let at = |size: f64, by: f64| {
                let mut set_up = SetUp { force_beside_base: None, driven_place: None, ..case.set_up.clone() };
                set_up.driven_place = (n == 2).then_some(0);
                let drive = Drive::ClosedForm(pulse(size, by * length_s));
                MotionCase { set_up, drive, start: case.start.clone(), duration_s: 3.0 * case.cycle_s }
            };
            let varied = [
                Varied { value: 1.0, cases: Varied::AT.map(|by| at(by, 1.0)) },
                Varied { value: 1.0, cases: Varied::AT.map(|by| at(1.0, by)) },
            ];
            let Ok(found) = at(1.0, 1.0).derivatives(&varied, &mut |_| true) else { continue };
            let measured = |size: f64, by: f64| {
                let case = at(size, by);
                let Drive::ClosedForm(excitation) = &case.drive else { unreachable!("a pulse") };
                let mut motion = Motion::new(&case.set_up, excitation, &case.start).expect("it starts");
                let mut measured = Measured::default();
                motion.run(case.duration_s, &mut measured).expect("it goes on");
                let rms = measured.squares.iter().map(|square| (square / case.duration_s).sqrt());
                measured.largest_m.iter().copied().chain(rms).collect::<Vec<f64>>()
            };
            for which in 0..2 {
                let h = (0.05 * found.holds_within[which]).min(1e-3);
                let value = |h: f64| if which == 0 { measured(1.0 + h, 1.0) } else { measured(1.0, 1.0 + h) };
                let central = |h: f64| -> Vec<f64> {
                    value(h).iter().zip(value(-h)).map(|(high, low)| (high - low) / (2.0 * h)).collect()
                };
                let (coarse, fine) = (central(h), central(0.5 * h));
                let own = found.largest_abs_m.iter().map(|largest| &largest.of).chain(&found.rms_m);
                for ((own, coarse), fine) in own.zip(coarse).zip(fine) {
                    let extrapolated = (4.0 * fine - coarse) / 3.0;
                    let allowed = 1e-8 * own.value + (fine - coarse).abs() + 1e-12 * own.value / h;
                    let apart = (own.by[which] - extrapolated).abs();
                    assert!(apart <= allowed, "pulse {n}, {number}, {which}: {apart:.1e} apart, {allowed:.1e} allowed");
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 40, "{compared}");
}

/// A sine of the base as 2000 cubics in a cycle: its derivatives are those of the sine.
#[test]
fn a_base_of_samples_has_the_derivatives_of_the_sine_through_them() {
    let mut compared = 0;
    for number in 0..40 {
        let mut case = Draw(Rng::with_seed(number)).case(number as usize);
        let Excitation::Sine { amplitude_m, .. } = case.excitation else { continue };
        case.set_up.force_beside_base = None;
        let changed = |by: f64| match case.excitation {
            Excitation::Sine { angular_frequency_rad_per_s, phase_rad, .. } => {
                Excitation::Sine { amplitude_m: by * amplitude_m, angular_frequency_rad_per_s, phase_rad }
            }
            other => other,
        };
        let step_s = case.cycle_s / 2000.0;
        let of = |drive: Drive| MotionCase { drive, duration_s: 2.0 * case.cycle_s, ..motion_case(&case) };
        let sampled = |by: f64| {
            let sine = changed(by);
            let powers: Vec<[f64; 4]> = (0..4000).map(|n| cubic(&sine, f64::from(n) * step_s, step_s)).collect();
            of(Drive::Samples { step_s, powers: powers.into() })
        };
        let closed = |by: f64| of(Drive::ClosedForm(changed(by)));
        let by_sine =
            closed(1.0).derivatives(&[Varied { value: amplitude_m, cases: Varied::AT.map(closed) }], &mut |_| true);
        let by_samples =
            sampled(1.0).derivatives(&[Varied { value: amplitude_m, cases: Varied::AT.map(sampled) }], &mut |_| true);
        let (Ok(by_sine), Ok(by_samples)) = (&by_sine, &by_samples) else {
            assert_eq!(by_sine.is_ok(), by_samples.is_ok(), "{number}: {by_sine:?}, {by_samples:?}");
            continue;
        };
        let size = by_sine.end.iter().map(|end| end.by[0].abs()).fold(0.0, f64::max);
        for (a, b) in by_sine.end.iter().zip(&by_samples.end) {
            // 2.5e-10 of the base's velocity in each event, which the later ones carry on.
            assert!((a.by[0] - b.by[0]).abs() < 1e-7 * size * by_sine.growth.max(1.0), "{number}: {a:?} {b:?}");
        }
        compared += 1;
    }
    assert!(compared >= 4, "{compared}");
}

/// A chaotic motion has no derivatives, and two particles that meet their walls at one instant have none.
#[test]
fn motions_without_derivatives_are_refused_with_the_reason() {
    let mut long = upright(0.3, 9.81, 0.99);
    let Some(damper) = long.set_up.impact_dampers.first_mut() else { unreachable!("one damper") };
    damper.particle.clearance_m = 0.31;
    long.start.particles[0].y_m = 0.0;
    let mode = &mut long.set_up.structure.modes[0];
    (mode.shape[0], mode.angular_frequency_rad_per_s, mode.damping_ratio) = (1.0, 30.0, 0.01);
    long.set_up.driven_place = Some(0);
    long.drive = Drive::ClosedForm(Excitation::ForceSine {
        amplitude_n: 30.0,
        angular_frequency_rad_per_s: 31.0,
        phase_rad: 0.4,
    });
    long.duration_s = 10.0;
    let chaotic = long.derivatives(&[], &mut |_| true);
    assert!(matches!(chaotic, Err(NoDerivatives::Growth { growth }) if growth > 1e7), "{chaotic:?}");

    let mut twins = upright(0.3, 9.81, 0.5);
    twins.set_up.structure.modes[0].shape[0] = 0.5;
    twins.set_up.impact_dampers.push(twins.set_up.impact_dampers[0]);
    twins.start.particles.push(twins.start.particles[0]);
    let together = twins.derivatives(&[], &mut |_| true);
    assert!(matches!(together, Err(NoDerivatives::Together { .. })), "{together:?}");

    // It touches the upper wall without speed.
    let grazing = |height_m: f64| {
        let mut case = upright(height_m, 9.81, 0.5);
        case.start.particles[0] = Body { y_m: 0.0, u_m_per_s: (2.0 * 9.81 * height_m).sqrt() };
        case
    };
    let value = 1.0 - 1e-9;
    let varied = Varied { value, cases: Varied::AT.map(|by| grazing(by * value)) };
    let refused = grazing(value).derivatives(&[varied], &mut |_| true);
    assert!(matches!(refused, Err(NoDerivatives::Grazing { change }) if change < 1e-6), "{refused:?}");
}
