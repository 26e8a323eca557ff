//! The symmetric orbit with two impacts per cycle, against its closed form.

use damprig_continuation::Parameter;
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;

use crate::common::{NATURAL, diagram, impact_damper, sine, start_on_symmetric_orbit, task, text};

#[test]
fn every_orbit_of_the_branch_is_one_of_the_closed_form() {
    for (ratio, e, start) in [(1.0, 0.5, 10.0), (1.0, 0.3, 10.0), (1.1, 0.5, 5.0), (0.9, 0.3, 10.0)] {
        let set_up = impact_damper(start, e);
        let mut task = task(Parameter::Clearance, (2.0, 40.0), start);
        start_on_symmetric_orbit(&mut task, start, e, ratio);
        let found = diagram(&set_up, &sine(ratio), &task);
        println!("{ratio} {e}\n{}", text(&found));
        for orbit in &found.branches[0].orbits {
            let there = impact_damper(orbit.parameters[0], e);
            let both = SymmetricOrbit::both(&there, 1.0, ratio * NATURAL).expect("hard walls");
            let off = both
                .iter()
                .flatten()
                .map(|known| (orbit.fastest_impact_m_per_s - known.approach_speed_m_per_s).abs() / NATURAL)
                .fold(f64::INFINITY, f64::min);
            assert!(off < 1e-9, "{orbit:?}: {off}");
        }
    }
}
