//! Set-ups and tasks of the tests.

use damprig_continuation::{Diagram, Parameter, Steps, System, Task, Ties};
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Cavity, Initial, Particle, SetUp, Structure, Wall};

/// ω of the tests' structures, rad/s.
pub const NATURAL: f64 = std::f64::consts::TAU * 2.5;

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
