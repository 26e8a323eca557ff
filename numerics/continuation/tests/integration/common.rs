//! Set-ups and tasks of the tests.

use std::f64::consts::TAU;

use damprig_continuation::{Diagram, Parameter, ReturnMap, Steps, System, Task, Ties};
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::exact::{Exact, ExactState, Excitation};
use damprig_core::model::{Cavity, Initial, Particle, SetUp, Structure, Wall};

/// ω of the tests' structures, rad/s.
pub const NATURAL: f64 = TAU * 2.5;

/// A structure of 1 kg with an impact damper of 0.1 kg and hard walls, without internal friction.
pub fn impact_damper(clearance_m: f64, coefficient: f64) -> SetUp {
    let wall = Wall::Restitution { coefficient };
    let particle = Particle { mass_kg: 0.1, clearance_m, friction_coefficient: 0.0, wall, cavity: Cavity::default() };
    SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.0, 2.5, 0.0038)) }
}

/// A sine of the base with an amplitude of 1 m, at `ratio` of the natural frequency.
pub fn sine(ratio: f64) -> Excitation {
    Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: ratio * NATURAL, phase_rad: 0.0 }
}

/// A start from x, x′, y − x and y′ − x′.
pub fn initial([x_m, v_m_per_s, offset_m, slide_m_per_s]: [f64; 4]) -> Initial {
    Initial { x_m, v_m_per_s, y_m: x_m + offset_m, u_m_per_s: v_m_per_s + slide_m_per_s }
}

/// x, x′, y − x and y′ − x′.
pub fn vector(state: &ExactState) -> [f64; 4] {
    [state.x_m, state.v_m_per_s, state.offset_m, state.slide_m_per_s]
}

/// A state on a settled motion, away from events, and the map from there.
pub fn settled(set_up: &SetUp, ratio: f64, periods: u32, phase_rad: f64) -> Option<([f64; 4], ReturnMap)> {
    let turning = ratio * NATURAL;
    let drive = |phase_rad| Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: turning, phase_rad };
    let mut motion = Exact::new(set_up, &drive(phase_rad), &set_up.neutral()).expect("physical");
    motion.run(60.0 * TAU / turning, &mut ());
    // A state in a soft wall does not say whether the wall pushes.
    let is_outside = |p: Particle| (motion.state().offset_m - p.cavity.offset_m).abs() > p.clearance_m;
    if set_up.particle.is_some_and(is_outside) {
        return None;
    }
    let map = ReturnMap::new(set_up, &drive(phase_rad), periods).expect("physical");
    let (from_s, to_s) = *map.quiet_parts_s(&initial(vector(motion.state()))).expect("resolved").first()?;
    let quiet_s = 0.5 * (from_s + to_s);
    motion.run(60.0 * TAU / turning + quiet_s, &mut ());
    let map = ReturnMap::new(set_up, &drive(phase_rad + turning * quiet_s), periods).expect("physical");
    Some((vector(motion.state()), map))
}

/// A task over a range, from `start_at`.
pub fn task(parameter: Parameter, range: (f64, f64), start_at: f64) -> Task {
    Task {
        parameter,
        range,
        start_at,
        initial: Initial::default(),
        phase_rad: 0.0,
        most_periods: 6_000,
        switch: false,
        most_restarts: 0,
        steps: Steps::default(),
    }
}

/// The branches of a task.
pub fn diagram(set_up: &SetUp, excitation: &Excitation, task: &Task) -> Diagram {
    let system = System::new(set_up, excitation, Ties::default()).expect("physical");
    system.explore(task).unwrap_or_else(|why| panic!("{why}"))
}

/// A diagram as text, for messages.
pub fn text(diagram: &Diagram) -> String {
    let mut text = String::new();
    for (n, branch) in diagram.branches.iter().enumerate() {
        let ends = (branch.orbits.first().map(|o| o.parameters[0]), branch.orbits.last().map(|o| o.parameters[0]));
        text += &format!(
            "branch {n}: {:?} periods {} segments {} orbits {} from {:?} ends {:?} stable {}\n",
            branch.origin,
            branch.sequence.periods,
            branch.sequence.segments.len(),
            branch.orbits.len(),
            ends,
            branch.ends,
            branch.orbits.iter().filter(|o| o.is_stable()).count()
        );
        for (at, special) in &branch.specials {
            text += &format!(
                "  {at}: {} at {} ± {:.1e}: {}; multipliers {:?}\n",
                special.kind.name(),
                special.parameter,
                special.parameter_error,
                special.meaning,
                special.orbit.multipliers.iter().map(|m| format!("{m:.4}")).collect::<Vec<_>>()
            );
        }
    }
    text + &format!("{:?}", diagram.gaps)
}

/// Lets a task start on the symmetric two-impact orbit of the closed form.
pub fn start_on_symmetric_orbit(task: &mut Task, clearance_m: f64, coefficient: f64, ratio: f64) {
    let set_up = impact_damper(clearance_m, coefficient);
    let known = SymmetricOrbit::new(&set_up, 1.0, ratio * NATURAL).expect("it exists");
    (task.initial, task.phase_rad) = (known.initial(), known.drive_phase_rad);
}
