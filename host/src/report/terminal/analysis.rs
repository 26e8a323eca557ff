//! Text of `damprig simulate --analyse`: energy balance, steady state, orbit and stability.

use damprig_core::analysis::energy::Balance;

use crate::report::numbers::{millimetres, significant};
use crate::simulation::analysis::{Analysis, ForcedResponse, Lyapunov, MotionKind, RunKeys, Sensitivities};

/// The lines below the summary of a simulation.
pub fn text(analysis: &Analysis) -> String {
    let mut lines: Vec<(&str, String)> = analysis.walls.as_deref().map(on_walls).into_iter().collect();
    lines.extend(analysis.energy.as_ref().map(energy).unwrap_or_default());
    let driven = analysis.driven.as_ref();
    lines.extend(driven.map(steady).unwrap_or_default());
    lines.extend(analysis.sensitivities.as_ref().and_then(|found| found.run.as_ref()).and_then(repeating));
    lines.extend(analysis.lyapunov.as_ref().map(|found| ("disturbances", lyapunov(found))));
    lines.extend(analysis.no_sensitivities.clone().map(|why| ("sensitivities of the run", why)));
    let mut text = String::from("Analysis");
    for (name, value) in lines {
        text.push_str(&format!("\n  {name:<24} {value}"));
    }
    let found = driven.and_then(|driven| driven.sensitivities.as_ref()).or(analysis.sensitivities.as_ref());
    found.map_or(text.clone(), |found| text + "\n\n" + &sensitivities(found))
}

/// The periodic motion that a run ends on.
fn repeating(run: &RunKeys) -> Option<(&'static str, String)> {
    let [re, im] = *run.multipliers.first()?;
    let most = re.hypot(im);
    let stability = if most < 1.0 { "small disturbances decay" } else { "a small disturbance stays or grows" };
    let all: Vec<String> = run.multipliers.iter().take(MULTIPLIERS).map(multiplier).collect();
    let more = if run.multipliers.len() > MULTIPLIERS { ", …" } else { "" };
    Some((
        "periodic motion",
        format!(
            "repeats after {} of the drive within 0.0001 %; {stability}: Floquet multipliers {}{more}",
            periods(run.repeats_after?),
            all.join(", ")
        ),
    ))
}

/// Most multipliers that are printed.
const MULTIPLIERS: usize = 6;

fn multiplier([re, im]: &[f64; 2]) -> String {
    if *im == 0.0 { significant(*re, 5) } else { format!("{} {im:+.5}i", significant(*re, 5)) }
}

fn periods(count: u32) -> String {
    if count == 1 { "one period".to_string() } else { format!("{count} periods") }
}

/// What acts in place of Hertz walls: another motion than that of the summary.
fn on_walls(acting: &str) -> (&'static str, String) {
    ("walls", format!("{acting}; the energy, steady state and sensitivities below are of that motion"))
}

fn energy(e: &Balance) -> Vec<(&'static str, String)> {
    let joule = |value: f64| format!("{} J", significant(value, 5));
    let by_mechanism = [
        ("  by dashpot", e.structure_damping_j),
        ("  by impacts", e.impacts_j),
        ("  by particle friction", e.internal_friction_j),
        ("  by friction damper", e.friction_damper_j),
        ("  by soft wall, TMD, load", e.link_damping_j),
    ];
    let mut lines = vec![
        ("energy input", joule(e.input_j)),
        ("change of stored energy", format!("{} (end minus start)", joule(e.stored_change_j))),
        ("energy dissipated", joule(by_mechanism.iter().map(|(_, energy_j)| energy_j).sum())),
    ];
    let dissipated = by_mechanism.iter().filter(|(_, energy_j)| *energy_j != 0.0);
    lines.extend(dissipated.map(|(name, energy_j)| (*name, joule(*energy_j))));
    lines.push(("energy residual", format!("{} J (rounding)", significant(e.residual_j, 2))));
    lines
}

/// Width of the longest bar.
const BAR: f64 = 20.0;

/// A table of relative changes, with a bar for that of the largest |x|.
fn sensitivities(found: &Sensitivities) -> String {
    let rises = "by how many per cent a result rises for 1 % more of a quantity.";
    let mut text = match &found.run {
        None => format!(
            "Sensitivities of the periodic motion: {rises} Each quantity changes\nalone in SI units (ratios of the case do not follow), but stiffness and dashpot of the structure keep fn and ζ.\n"
        ),
        Some(run) => {
            let what = match run.repeats_after {
                Some(1) => "of the periodic motion that the run ends on".to_string(),
                Some(periods) => format!("of the periodic motion that the run ends on, of {periods} drive periods"),
                None => "of the whole run".to_string(),
            };
            format!(
                "Sensitivities {what}: {rises}\nEach key of the case changes alone; what the case derives from it follows.\n"
            )
        }
    };
    let has_impacts = found.of.iter().any(|of| of.impact_speed.is_some());
    let speed = if has_impacts { "   impact speed" } else { "" };
    text += &format!("  {:<38}   largest |x|       RMS of x{speed}   an event changes at about", "");
    let most = found.of.iter().map(|of| of.max_abs_x.abs()).fold(0.0, f64::max);
    for of in &found.of {
        let number = |value: f64| format!("{value:>+14.4}");
        let speed = of.impact_speed.map(number).unwrap_or_default();
        let within = match of.holds_within {
            Some(within) if within < 1.0 => format!("± {}", percent(within)),
            _ => "beyond ± 100 %".to_string(),
        };
        let bar = "█".repeat((BAR * of.max_abs_x.abs() / most).round() as usize);
        let (key, x, rms) = (&of.key, number(of.max_abs_x), number(of.rms_x));
        text += format!("\n  {key:<38}{x} {rms} {speed}   {within:<21} {bar}").trim_end();
    }
    text += match &found.run {
        None => {
            "\n  Beyond that change, or past a fold or doubling of the orbit (`damprig continue`), the motion is another one."
        }
        Some(_) => {
            "\n  Beyond that change events come in another order, are lost or gained; small ones hardly change a result."
        }
    };
    for (why, keys) in found.run.iter().flat_map(|run| {
        [
            ("0.3 % more or less of them makes another case or none", &run.left_out),
            ("any change of them, however small, changes the sequence of events", &run.grazing),
        ]
    }) {
        if !keys.is_empty() {
            text += &format!("\n  Left out, as {why}: {}.", keys.join(", "));
        }
    }
    let ties = [(found.is_tie, "|x| is largest at two places"), (found.is_speed_tie, "Two impacts are the fastest")];
    for (_, what) in ties.iter().filter(|(is_tie, _)| *is_tie) {
        text += &format!("\n  {what}, which follow the quantities differently: its changes are those of one of them.");
    }
    text
}

/// A relative difference in percent.
fn percent(share: f64) -> String {
    format!("{} %", significant(100.0 * share, 2))
}

/// What the Lyapunov exponent says.
fn lyapunov(found: &Lyapunov) -> String {
    let what = match found {
        found if found.is_chaotic() => "small disturbances grow: the motion is chaotic over these periods",
        found if found.is_settling() => "small disturbances decay: the motion settles, or has a long period",
        _ => "small disturbances neither grow nor decay beyond doubt",
    };
    format!(
        "{what}; Lyapunov exponent {:+.4} ± {:.4} per drive period (one standard error), over {} periods beyond the run",
        found.per_period, found.error, found.periods
    )
}

/// The verdict on the end of the run, with what it rests on.
fn motion(driven: &ForcedResponse) -> String {
    let tolerance = percent(driven.tolerance);
    let plural = |count: usize| if count == 1 { "drive period".to_string() } else { format!("{count} drive periods") };
    let maxima = match driven.cycle_maxima_spread {
        Some(spread) if spread < driven.tolerance => format!(" (its largest |x| is steady within {})", percent(spread)),
        _ => String::new(),
    };
    let from_orbit = driven.orbit.as_ref().map(|orbit| percent(orbit.distance)).unwrap_or_default();
    match (driven.motion, driven.repeats_after) {
        (MotionKind::Periodic, after) => {
            let after = after.unwrap_or(1);
            let varies = if after > 1 { "; its cycles differ from each other within that" } else { "" };
            format!("periodic: repeats every {} within {}{varies}", plural(after), percent(driven.repeats_within))
        }
        (MotionKind::Settling, Some(after)) => format!(
            "settling: repeats every {} within {}, but the run ends {from_orbit} from the periodic orbit",
            plural(after),
            percent(driven.repeats_within)
        ),
        (MotionKind::Settling, None) => format!(
            "settling: the last periods differ by {} or more, and the run ends {from_orbit} from the periodic orbit{maxima}",
            percent(driven.repeats_within)
        ),
        (MotionKind::NotPeriodic, _) => format!(
            "not periodic: does not repeat within {tolerance} after up to {}, {} at best: transient, long-periodic or chaotic{maxima}",
            plural(driven.section.len() / 2),
            percent(driven.repeats_within)
        ),
    }
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
        ("motion", motion(driven)),
    ];
    lines.extend(driven.lyapunov.as_ref().map(|found| ("disturbances", lyapunov(found))));
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
            .map(|(of, neutral)| {
                let value = multiplier(of);
                if *neutral { format!("{value} (neutral)") } else { value }
            })
            .collect();
        lines.push((
            "periodic orbit",
            format!(
                "{} drive period{}, {}; the run ends {} from it: {}; Floquet multipliers {}",
                orbit.periods,
                if orbit.periods == 1 { "" } else { "s" },
                orbit.stability,
                percent(orbit.distance),
                match (driven.motion, orbit.is_run_on_it) {
                    (MotionKind::Periodic, _) => "it is on this orbit",
                    (MotionKind::NotPeriodic, true) => "it passes close to this orbit",
                    (MotionKind::Settling, _) if orbit.is_near() => "it settles onto this orbit",
                    _ => "it is not on this orbit",
                },
                multipliers.join(", ")
            ),
        ));
    }
    if let Some(why) = &driven.no_orbit {
        lines.push(("periodic orbit", why.clone()));
    }
    if let Some(why) = &driven.no_sensitivities {
        lines.push(("sensitivities", why.clone()));
    }
    lines
}
