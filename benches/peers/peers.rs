//! Alternative methods for comparison: an adaptive solver and a fixed-step solver, neither with resting contact.

use diffsol::{NalgebraMat, OdeBuilder, OdeSolverMethod, OdeSolverStopReason};

use crate::cases::Setting;

type M = NalgebraMat<f64>;

/// Velocities after an impact: the momentum is conserved, the relative velocity is multiplied by −e.
fn impact(restitution: f64, mass_ratio: f64, v: f64, u: f64) -> (f64, f64) {
    let common = (v + mass_ratio * u) / (1.0 + mass_ratio);
    let relative = -restitution * (u - v);
    (common - mass_ratio / (1.0 + mass_ratio) * relative, common + relative / (1.0 + mass_ratio))
}

struct Equations {
    stiffness: f64,
    damping: f64,
    mass_ratio: f64,
    turning: f64,
}

impl Equations {
    fn new(setting: &Setting) -> Self {
        let set_up = setting.set_up();
        Self {
            stiffness: set_up.structure.stiffness_n_per_m / set_up.structure.mass_kg,
            damping: set_up.structure.damping_n_s_per_m / set_up.structure.mass_kg,
            mass_ratio: set_up.particle.map_or(0.0, |p| p.mass_kg) / set_up.structure.mass_kg,
            turning: setting.angular_frequency_rad_per_s(),
        }
    }

    /// Acceleration x″ of the structure.
    fn acceleration(&self, t: f64, x: f64, v: f64) -> f64 {
        let (sine, cosine) = (self.turning * t).sin_cos();
        -self.stiffness * (x - sine) - self.damping * (v - self.turning * cosine)
    }
}

/// Adaptive Runge–Kutta method of order 5(4) from the crate `diffsol`, with its root finding, restarted after every
/// impact. Returns the approach speed of the last impact.
pub fn diffsol(setting: &Setting, tolerance: f64) -> f64 {
    let equations = Equations::new(setting);
    let d = setting.clearance_m;
    let problem = OdeBuilder::<M>::new()
        .rtol(tolerance)
        .atol([tolerance])
        .h0(1e-3)
        .rhs(|s: &[f64], _: &[f64], t, ds: &mut [f64]| {
            ds[0] = s[1];
            ds[1] = equations.acceleration(t, s[0], s[1]);
            ds[2] = s[3];
            ds[3] = 0.0;
        })
        .init(|_, _, s: &mut [f64]| s.fill(0.0), 4)
        .root(
            |s: &[f64], _: &[f64], _, gap: &mut [f64]| {
                gap[0] = d - (s[2] - s[0]);
                gap[1] = d + (s[2] - s[0]);
            },
            2,
        )
        .build()
        .expect("the equations are complete");
    let mut solver = problem.tsit45().expect("the problem can be solved");
    let end_s = setting.end_s();
    solver.set_stop_time(end_s).expect("the end lies ahead");
    let mut last = 0.0;
    loop {
        match solver.step().expect("the method steps on") {
            OdeSolverStopReason::InternalTimestep => {}
            OdeSolverStopReason::TstopReached => return last,
            OdeSolverStopReason::RootFound(t, _) => {
                let hit = solver.interpolate(t).expect("the root lies in the step");
                let s: Vec<f64> = hit.batch_as_slice(0).to_vec();
                last = (s[3] - s[1]).abs();
                let side = (s[2] - s[0]).signum();
                let (v, u) = impact(setting.restitution, equations.mass_ratio, s[1], s[3]);
                // Start slightly inside the cavity, so that the same root is not found again.
                let y = s[0] + side * d * (1.0 - 1e-13);
                let acceleration = equations.acceleration(t, s[0], v);
                let state = solver.state_mut();
                state.y.batch_as_mut_slice(0).copy_from_slice(&[s[0], v, y, u]);
                state.dy.batch_as_mut_slice(0).copy_from_slice(&[v, acceleration, u, 0.0]);
                *state.t = t;
                solver.set_stop_time(end_s).expect("the end lies ahead");
            }
        }
    }
}

/// Classical Runge–Kutta method with a step of 10⁻⁴ s; an impact occurs at the end of the step in which the gap
/// closes. Returns the approach speed of the last impact.
pub fn fixed_step(setting: &Setting) -> f64 {
    const STEP_S: f64 = 1e-4;
    let equations = Equations::new(setting);
    let d = setting.clearance_m;
    let (mut x, mut v, mut y, mut u, mut last) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for n in 0..(setting.end_s() / STEP_S).round() as u64 {
        let t = n as f64 * STEP_S;
        let half = 0.5 * STEP_S;
        let a1 = equations.acceleration(t, x, v);
        let (v2, a2) = (v + half * a1, equations.acceleration(t + half, x + half * v, v + half * a1));
        let (v3, a3) = (v + half * a2, equations.acceleration(t + half, x + half * v2, v + half * a2));
        let (v4, a4) = (v + STEP_S * a3, equations.acceleration(t + STEP_S, x + STEP_S * v3, v + STEP_S * a3));
        x += STEP_S / 6.0 * (v + 2.0 * (v2 + v3) + v4);
        v += STEP_S / 6.0 * (a1 + 2.0 * (a2 + a3) + a4);
        y += STEP_S * u;
        let outside = (y - x).abs() >= d && (y - x) * (u - v) > 0.0;
        if outside {
            last = (u - v).abs();
            (v, u) = impact(setting.restitution, equations.mass_ratio, v, u);
        }
    }
    last
}
