//! `damprig simulate --analyse` for people.

use super::simulation::digits;
use crate::simulation::analysis::{Analysis, Driven};

/// The lines below a simulation's summary.
pub fn text(analysis: &Analysis) -> String {
    let e = &analysis.energy;
    let joule = |value: f64| format!("{} J", digits(value, 5));
    let mut lines = vec![("energy in", joule(e.input_j)), ("energy stored", joule(e.stored_j))];
    for (name, taken) in [
        ("  by dashpot", e.structure_damping_j),
        ("  by impacts", e.impacts_j),
        ("  by friction", e.internal_friction_j),
        ("  by damper", e.friction_damper_j),
        ("  by link", e.link_damping_j),
    ] {
        if taken != 0.0 {
            lines.push((name, joule(taken)));
        }
    }
    lines.push(("  left open", format!("{} J (rounding)", digits(e.residual_j, 2))));
    if let Some(driven) = &analysis.driven {
        lines.extend(steady(driven));
    }
    let mut text = String::from("Analysis");
    for (name, value) in lines {
        text.push_str(&format!("\n  {name:<16} {value}"));
    }
    text
}

fn steady(driven: &Driven) -> Vec<(&'static str, String)> {
    let mm = |value_m: f64| format!("{} mm", digits(value_m * 1e3, 6));
    let n = driven.periods;
    let mut lines = vec![
        (
            "lock-in",
            format!(
                "{} at {}° of the drive, over the last {n} periods",
                mm(driven.amplitude_m),
                digits(driven.phase_rad.to_degrees(), 5)
            ),
        ),
        ("cycle maxima", format!("{} on average, same periods", mm(driven.mean_cycle_max_abs_x_m))),
        (
            "section",
            match driven.repeats_after {
                Some(1) => "repeats every period".to_string(),
                Some(k) => format!("repeats every {k} periods"),
                None => format!("does not repeat within {} periods: transient, long-periodic or chaotic", n / 2),
            },
        ),
    ];
    if let Some(orbit) = &driven.two_impact_orbit {
        lines.push((
            "two impacts",
            format!(
                "closed form: approach speed {} m/s, particle {} m/s, x at impact {}",
                digits(orbit.approach_speed_m_per_s, 9),
                digits(orbit.particle_speed_m_per_s, 9),
                mm(orbit.impact_displacement_m)
            ),
        ));
    }
    if let Some(orbit) = &driven.orbit {
        let multipliers: Vec<String> = orbit
            .multipliers
            .iter()
            .zip(&orbit.neutral)
            .map(|([re, im], neutral)| {
                let value = if *im == 0.0 { digits(*re, 5) } else { format!("{} {:+.5}i", digits(*re, 5), im) };
                if *neutral { format!("{value} (neutral)") } else { value }
            })
            .collect();
        lines.push((
            "periodic orbit",
            format!(
                "of {} drive period{}, {}; Floquet multipliers {}",
                orbit.periods,
                if orbit.periods == 1 { "" } else { "s" },
                orbit.stability,
                multipliers.join(", ")
            ),
        ));
    }
    if let Some(why) = &driven.no_orbit {
        lines.push(("periodic orbit", why.clone()));
    }
    lines
}
