//! Text of `damprig simulate --analyse`: energy balance, steady state, orbit and stability.

use crate::report::numbers::{millimetres, significant};
use crate::simulation::analysis::{Analysis, ForcedResponse};

/// The lines below the summary of a simulation.
pub fn text(analysis: &Analysis) -> String {
    let e = &analysis.energy;
    let joule = |value: f64| format!("{} J", significant(value, 5));
    let by_mechanism = [
        ("  by dashpot", e.structure_damping_j),
        ("  by impacts", e.impacts_j),
        ("  by particle friction", e.internal_friction_j),
        ("  by friction damper", e.friction_damper_j),
        ("  by soft wall or TMD", e.link_damping_j),
    ];
    let mut lines = vec![
        ("energy input", joule(e.input_j)),
        ("energy stored", joule(e.stored_j)),
        ("energy dissipated", joule(by_mechanism.iter().map(|(_, energy_j)| energy_j).sum())),
    ];
    let dissipated = by_mechanism.iter().filter(|(_, energy_j)| *energy_j != 0.0);
    lines.extend(dissipated.map(|(name, energy_j)| (*name, joule(*energy_j))));
    lines.push(("energy residual", format!("{} J (rounding)", significant(e.residual_j, 2))));
    if let Some(driven) = &analysis.driven {
        lines.extend(steady(driven));
    }
    let mut text = String::from("Analysis");
    for (name, value) in lines {
        text.push_str(&format!("\n  {name:<23} {value}"));
    }
    text
}

fn steady(driven: &ForcedResponse) -> Vec<(&'static str, String)> {
    let n = driven.periods;
    let mut lines = vec![
        (
            "lock-in",
            format!(
                "amplitude {}, phase {}° relative to the drive, over the last {n} periods",
                millimetres(driven.amplitude_m),
                significant(driven.phase_rad.to_degrees(), 5)
            ),
        ),
        ("cycle maxima", format!("mean {} over the same periods", millimetres(driven.mean_cycle_max_abs_x_m))),
        (
            "period",
            match driven.repeats_after {
                Some(1) => "1 drive period".to_string(),
                Some(k) => format!("{k} drive periods"),
                None => format!("none up to {} drive periods: transient, long-periodic or chaotic", n / 2),
            },
        ),
    ];
    if let Some(orbit) = &driven.two_impact_orbit {
        lines.push((
            "two-impact orbit",
            format!(
                "closed form: approach speed {} m/s, particle speed {} m/s, x at impact {}",
                significant(orbit.approach_speed_m_per_s, 9),
                significant(orbit.particle_speed_m_per_s, 9),
                millimetres(orbit.impact_displacement_m)
            ),
        ));
    }
    if let Some(orbit) = &driven.orbit {
        let multipliers: Vec<String> = orbit
            .multipliers
            .iter()
            .zip(&orbit.neutral)
            .map(|([re, im], neutral)| {
                let value =
                    if *im == 0.0 { significant(*re, 5) } else { format!("{} {:+.5}i", significant(*re, 5), im) };
                if *neutral { format!("{value} (neutral)") } else { value }
            })
            .collect();
        lines.push((
            "periodic orbit",
            format!(
                "{} drive period{}, {}; Floquet multipliers {}",
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
