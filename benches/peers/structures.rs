//! Speed of structures with several places: an impact damper, alone and with a friction damper, at the top of frames of 1 to 20 storeys that are
//! driven at their first natural frequency: `cargo bench --manifest-path benches/peers/Cargo.toml --bench structures`.
//!
//! Beside one storey the engine for one degree of freedom moves the same; an adaptive Runge–Kutta method with root finding from a crate moves the
//! frames that have two impacts a cycle, from the same settled state. Million cycles a second on one thread, the best of several
//! interleaved rounds; compare the ratios.

use std::f64::consts::TAU;
use std::time::Instant;

use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::model::{Cavity, FrictionDamper, Particle, SetUp as One, Structure, Wall};
use damprig_structures::{
    FrictionJoint, Impact, ImpactDamper, Modes, Motion, Observer, SetUp, State, Storey, base_at_start,
};
use diffsol::{NalgebraMat, OdeBuilder, OdeSolverMethod, OdeSolverStopReason};

/// Cycles before the time is taken, rounds, and cycles of each.
const SETTLE: f64 = 2_000.0;
const ROUNDS: usize = 10;
const CYCLES: f64 = 500.0;

const MASS_KG: f64 = 2.0;
const STIFFNESS_N_PER_M: f64 = 1500.0;
const PARTICLE_KG: f64 = 0.2;
const BASE_M: f64 = 3e-3;

/// A frame with its dampers.
struct Frame {
    storeys: usize,
    damping_n_s_per_m: f64,
    clearance_m: f64,
    restitution: f64,
    friction_n: f64,
}

const fn frame(storeys: usize, damping_n_s_per_m: f64, clearance_m: f64, restitution: f64, friction_n: f64) -> Frame {
    Frame { storeys, damping_n_s_per_m, clearance_m, restitution, friction_n }
}

/// The first five have two impacts a cycle.
const FRAMES: [Frame; 8] = [
    frame(1, 0.8, 0.025, 0.5, 0.0),
    frame(2, 2.0, 0.04, 0.3, 0.0),
    frame(5, 2.0, 0.06, 0.3, 0.0),
    frame(20, 2.0, 0.4, 0.3, 0.0),
    frame(20, 8.0, 0.3, 0.6, 0.0),
    frame(20, 5.0, 0.025, 0.8, 0.0),
    frame(2, 0.8, 0.025, 0.5, 1.0),
    frame(5, 0.8, 0.025, 0.5, 1.0),
];

impl Frame {
    fn particle(&self) -> Particle {
        let wall = Wall::Restitution { coefficient: self.restitution };
        let cavity = Cavity::default();
        Particle { mass_kg: PARTICLE_KG, clearance_m: self.clearance_m, friction_coefficient: 0.0, wall, cavity }
    }

    fn set_up(&self) -> SetUp {
        let storey = Storey {
            mass_kg: MASS_KG,
            stiffness_n_per_m: STIFFNESS_N_PER_M,
            damping_n_s_per_m: self.damping_n_s_per_m,
        };
        let place = self.storeys - 1;
        let mut set_up = SetUp::bare(Modes::storeys(&vec![storey; self.storeys]).expect("a physical frame"));
        set_up.impact_dampers.push(ImpactDamper::new(place, self.particle()));
        if self.friction_n > 0.0 {
            let damper = FrictionDamper { force_n: self.friction_n };
            set_up.friction_dampers.push(FrictionJoint { place, other: place.checked_sub(1), damper });
        }
        set_up
    }
}

fn sine(turning: f64) -> Excitation {
    Excitation::Sine { amplitude_m: BASE_M, angular_frequency_rad_per_s: turning, phase_rad: 0.0 }
}

struct Impacts(u64);

impl Observer for Impacts {
    fn impact(&mut self, _: &Impact) {
        self.0 += 1;
    }
}

/// A frame in motion.
struct Running {
    turning: f64,
    motion: Motion,
    impacts: Impacts,
    rate: f64,
}

/// A set-up with Ω of its base, which has moved for [`SETTLE`] cycles.
fn settled(frame: &Frame) -> (SetUp, f64, Motion) {
    let set_up = frame.set_up();
    let turning = set_up.structure.modes[0].angular_frequency_rad_per_s;
    let start = set_up.at_rest(base_at_start(&sine(turning)));
    let mut motion = Motion::new(&set_up, &sine(turning), &start).expect("a physical set-up");
    motion.run(SETTLE * TAU / turning, &mut ()).expect("a motion in closed form");
    (set_up, turning, motion)
}

impl Running {
    fn new(frame: &Frame) -> Self {
        let (_, turning, motion) = settled(frame);
        Self { turning, motion, impacts: Impacts(0), rate: 0.0 }
    }
}

/// Cycles a second of what moves by [`CYCLES`].
fn rate_of(moves: impl FnOnce()) -> f64 {
    let begun = Instant::now();
    moves();
    CYCLES / begun.elapsed().as_secs_f64()
}

fn main() {
    // `cargo test --benches` only checks that the benchmark runs.
    let rounds = if std::env::args().any(|a| a == "--bench") { ROUNDS } else { 1 };
    let mut frames: Vec<Running> = FRAMES.iter().map(Running::new).collect();
    let structure = Structure {
        mass_kg: MASS_KG,
        stiffness_n_per_m: STIFFNESS_N_PER_M,
        damping_n_s_per_m: FRAMES[0].damping_n_s_per_m,
    };
    let one = One { particle: Some(FRAMES[0].particle()), ..One::bare(structure) };
    let turning = structure.angular_frequency_rad_per_s();
    let mut exact = Exact::new(&one, &sine(turning), &one.neutral()).expect("a physical set-up");
    exact.run(SETTLE * TAU / turning, &mut ());
    let mut rate_of_one = 0.0_f64;
    let mut cycles = SETTLE;
    for _ in 0..rounds {
        cycles += CYCLES;
        rate_of_one = rate_of_one.max(rate_of(|| exact.run(cycles * TAU / turning, &mut ())));
        for Running { turning, motion, impacts, rate, .. } in &mut frames {
            let moves = || motion.run(cycles * TAU / *turning, impacts).expect("a motion in closed form");
            *rate = rate.max(rate_of(moves));
        }
    }
    println!("one degree of freedom, its own engine: {:.3} million cycles a second", rate_of_one * 1e-6);
    for (Frame { storeys, friction_n, .. }, Running { impacts, rate, .. }) in FRAMES.iter().zip(&frames) {
        let a_cycle = impacts.0 as f64 / (rounds as f64 * CYCLES);
        println!(
            "{storeys:>2} storeys, friction {friction_n} N: {:.4} million, {a_cycle:.2} impacts a cycle",
            rate * 1e-6
        );
    }
    beside_diffsol();
}

/// Prints times and last impact speeds of a few cycles from the settled state, beside those of another solver.
fn beside_diffsol() {
    /// Approach speed of the last impact, m/s.
    struct Last(f64);

    impl Observer for Last {
        fn impact(&mut self, impact: &Impact) {
            self.0 = impact.approach_speed_m_per_s;
        }
    }

    const CYCLES: f64 = 30.0;
    /// The errors of its last impact speeds are 1e-9 and less with it.
    const TOLERANCE: f64 = 1e-8;
    println!("\n{CYCLES} cycles from the settled state, times of both, and how far the last impact speeds are apart");
    for frame in &FRAMES[..5] {
        let (set_up, turning, motion) = settled(frame);
        let settled = motion.state();
        let end_s = CYCLES * TAU / turning;
        let mut best = [f64::INFINITY; 2];
        let mut last = [0.0; 2];
        for _ in 0..10 {
            let begun = Instant::now();
            let mut of_engine = Last(0.0);
            let mut motion = Motion::new(&set_up, &sine(turning), &settled).expect("a physical set-up");
            motion.run(end_s, &mut of_engine).expect("a motion in closed form");
            best[0] = best[0].min(begun.elapsed().as_secs_f64());
            let begun = Instant::now();
            last = [of_engine.0, diffsol_of_modes(&set_up, turning, &settled, end_s, TOLERANCE)];
            best[1] = best[1].min(begun.elapsed().as_secs_f64());
        }
        println!(
            "{:>2} storeys: {:.3} ms, {:.1} ms, {:.0} times; {:.1e}",
            frame.storeys,
            best[0] * 1e3,
            best[1] * 1e3,
            best[1] / best[0],
            (last[1] / last[0] - 1.0).abs()
        );
    }
}

/// Adaptive Runge–Kutta method of order 5(4) from the crate `diffsol` with its root finding, restarted after every impact. Returns the approach speed
/// of the last impact, m/s.
fn diffsol_of_modes(set_up: &SetUp, turning: f64, start: &State, end_s: f64, tolerance: f64) -> f64 {
    let modes = &set_up.structure.modes;
    let n = modes.len();
    let ImpactDamper { place, particle, .. } = set_up.impact_dampers[0];
    let Particle { clearance_m: d, mass_kg, .. } = particle;
    let Wall::Restitution { coefficient } = particle.wall else { panic!("a hard wall") };
    let shape: Vec<f64> = modes.iter().map(|mode| mode.shape[place]).collect();
    let x_of = |t: f64, s: &[f64]| {
        let of = |values: &[f64]| values.iter().zip(&shape).map(|(q, phi)| q * phi).sum::<f64>();
        let (sine, cosine) = (turning * t).sin_cos();
        (of(&s[..n]) + BASE_M * sine, of(&s[n..2 * n]) + BASE_M * turning * cosine)
    };
    let rates = |t: f64, s: &[f64], ds: &mut [f64]| {
        let base = BASE_M * turning * turning * (turning * t).sin();
        for (i, mode) in modes.iter().enumerate() {
            let omega = mode.angular_frequency_rad_per_s;
            ds[i] = s[n + i];
            ds[n + i] = mode.participation * base - omega * (omega * s[i] + 2.0 * mode.damping_ratio * s[n + i]);
        }
        (ds[2 * n], ds[2 * n + 1]) = (s[2 * n + 1], 0.0);
    };
    let body = start.particles[0];
    let begin = [&start.modal[..], &start.modal_rate, &[body.y_m, body.u_m_per_s]].concat();
    let problem = OdeBuilder::<NalgebraMat<f64>>::new()
        .rtol(tolerance)
        .atol([tolerance * BASE_M])
        .h0(1e-3)
        .rhs(|s: &[f64], _: &[f64], t, ds: &mut [f64]| rates(t, s, ds))
        .init(|_, _, s: &mut [f64]| s.copy_from_slice(&begin), 2 * n + 2)
        .root(
            |s: &[f64], _: &[f64], t, gap: &mut [f64]| {
                let offset = s[2 * n] - x_of(t, s).0;
                (gap[0], gap[1]) = (d - offset, d + offset);
            },
            2,
        )
        .build()
        .expect("the equations are complete");
    let mut solver = problem.tsit45().expect("the problem can be solved");
    solver.set_stop_time(end_s).expect("the end lies ahead");
    let per_mass: f64 = shape.iter().map(|phi| phi * phi).sum();
    let mut last = 0.0;
    loop {
        match solver.step().expect("the method steps on") {
            OdeSolverStopReason::InternalTimestep => {}
            OdeSolverStopReason::TstopReached => return last,
            OdeSolverStopReason::RootFound(t, _) => {
                let hit = solver.interpolate(t).expect("the root lies in the step");
                let mut s: Vec<f64> = hit.batch_as_slice(0).to_vec();
                let (x, v) = x_of(t, &s);
                let approach = s[2 * n + 1] - v;
                last = approach.abs();
                let impulse = (1.0 + coefficient) * approach / (1.0 / mass_kg + per_mass);
                s[n..2 * n].iter_mut().zip(&shape).for_each(|(rate, phi)| *rate += phi * impulse);
                s[2 * n + 1] -= impulse / mass_kg;
                // Start slightly inside the cavity, so that the same root is not found again.
                s[2 * n] = x + (s[2 * n] - x).signum() * d * (1.0 - 1e-13);
                let mut ds = vec![0.0; s.len()];
                rates(t, &s, &mut ds);
                let state = solver.state_mut();
                state.y.batch_as_mut_slice(0).copy_from_slice(&s);
                state.dy.batch_as_mut_slice(0).copy_from_slice(&ds);
                *state.t = t;
                solver.set_stop_time(end_s).expect("the end lies ahead");
            }
        }
    }
}
