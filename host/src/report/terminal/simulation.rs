//! What a simulated case says to people: what it is, what it did, what it will cost, and its picture.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::Wall;

use crate::motion_record::Quantity;
use crate::report::figures::simulated_motion::{Notes, draw};
use crate::report::figures::{FigureError, Picture};
use crate::simulation::cost::Cost;
use crate::simulation::envelope::Outline;
use crate::simulation::result::FEW_ACCUMULATIONS;
use crate::simulation::time_history::TablePath;
use crate::simulation::{Answer, Case};

/// Runs that take longer are warned about, s.
const LONG_S: f64 = 10.0;

/// Histories with more rows are warned about.
const MANY_ROWS: f64 = 2e7;

/// Departure of the last cycles from their mean below which a motion counts as steady.
const STEADY: f64 = 1e-3;

/// `value` with so many significant digits, without trailing zeros.
pub fn digits(value: f64, significant: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let magnitude = value.abs().log10().floor() as i32;
    if !(-4..=9).contains(&magnitude) {
        let text = format!("{value:.*e}", significant.saturating_sub(1));
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let mantissa =
            if mantissa.contains('.') { mantissa.trim_end_matches('0').trim_end_matches('.') } else { mantissa };
        return format!("{mantissa}e{exponent}");
    }
    let decimals = usize::try_from(significant as i32 - 1 - magnitude).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

fn mm(value_m: f64) -> String {
    format!("{} mm", digits(value_m * 1e3, 6))
}

/// A time for people.
fn span(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{} s", digits(s, 2)),
        s if s < 7_200.0 => format!("{} min", digits(s / 60.0, 2)),
        s if s < 172_800.0 => format!("{} h", digits(s / 3_600.0, 2)),
        s if s < 6.3e7 => format!("{} days", digits(s / 86_400.0, 2)),
        s => format!("{} years", digits(s / 3.15e7, 2)),
    }
}

/// What had better be known before the run starts.
pub fn warnings(case: &Case, cost: &Cost, history: Option<(&TablePath, f64)>) -> Vec<String> {
    let mut warnings = Vec::new();
    if let Some(arc_s) = cost.stiff_arc_s {
        warnings.push(format!(
            "the wall is stiff next to the structure: while they touch, a natural period takes {} arcs of {} s",
            digits(case.natural_period_s() / arc_s, 2),
            digits(arc_s, 2)
        ));
    }
    if cost.seconds > LONG_S {
        warnings.push(format!(
            "{} s of motion will take about {} of computing ({} arcs); Ctrl-C keeps what is done",
            digits(case.run.duration_s, 6),
            span(cost.seconds),
            digits(cost.arcs, 2)
        ));
    }
    if let Some((path, rate_hz)) = history {
        let rows = rate_hz * case.run.duration_s;
        if rows > MANY_ROWS {
            warnings.push(format!(
                "{} will have {} rows, some {} GB; a lower --rate makes it smaller",
                path.path().display(),
                digits(rows, 2),
                digits(rows * path.bytes_a_row() * 1e-9, 2)
            ));
        }
    }
    warnings
}

/// What the case is, a line each.
fn set_up(case: &Case) -> Vec<(&'static str, String)> {
    let structure = &case.set_up.structure;
    let omega = structure.angular_frequency_rad_per_s();
    let mut lines = vec![(
        "structure",
        format!(
            "{} kg, fn = {} Hz, ζ = {}",
            digits(structure.mass_kg, 4),
            digits(omega / TAU, 5),
            digits(structure.damping_ratio(), 3)
        ),
    )];
    let reference = case.reference_m();
    let relative = |length_m: f64| {
        reference.map_or(String::new(), |(by_m, name)| format!(" (d/{name} = {})", digits(length_m / by_m, 4)))
    };
    if let Some(p) = &case.set_up.particle {
        let wall = match p.wall {
            Wall::Restitution { coefficient } => format!("e = {}", digits(coefficient, 4)),
            Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, .. } => {
                format!("k1 = {} N/m, c1 = {} N·s/m", digits(stiffness_n_per_m, 5), digits(damping_n_s_per_m, 5))
            }
        };
        let ratio = digits(p.mass_kg / structure.mass_kg, 4);
        let friction = match p.friction_coefficient {
            0.0 => String::new(),
            mu => format!(", μi = {}", digits(mu, 4)),
        };
        let (d, by) = (mm(p.clearance_m), relative(p.clearance_m));
        lines.push(("particle", format!("mass ratio {ratio}, d = {d}{by}, {wall}{friction}")));
    }
    if let Some(damper) = &case.set_up.friction_damper {
        let ratio = reference.map_or(String::new(), |(by_m, name)| {
            format!(" (F/k{name} = {})", digits(damper.force_n / (structure.stiffness_n_per_m * by_m), 4))
        });
        lines.push(("friction damper", format!("F = {} N{ratio}", digits(damper.force_n, 4))));
    }
    if let Some(tmd) = &case.set_up.tmd {
        let own = (tmd.stiffness_n_per_m / tmd.mass_kg).sqrt();
        let zeta = tmd.damping_n_s_per_m / (2.0 * tmd.mass_kg * own);
        let (ratio, gamma) = (tmd.mass_kg / structure.mass_kg, own / omega);
        let text = format!("mass ratio {}, γ = {}, ζ1 = {}", digits(ratio, 4), digits(gamma, 4), digits(zeta, 4));
        lines.push(("tuned mass", text));
    }
    lines.push(("excitation", excitation(case)));
    lines
}

fn excitation(case: &Case) -> String {
    if let Some(record) = &case.record {
        let file = record.file.file_name().unwrap_or_default().to_string_lossy();
        let peak = match record.quantity {
            Quantity::Acceleration => format!("acceleration, peak {} m/s²", digits(record.peak(), 4)),
            Quantity::Displacement => format!("displacement, peak {}", mm(record.peak())),
        };
        return format!(
            "{file}: {peak}, {} s at {} Hz",
            digits(record.duration_s(), 5),
            digits(1.0 / record.step_s, 5)
        );
    }
    let hz = |omega: f64| digits(omega / TAU, 5);
    match case.excitation {
        Excitation::Fixed => format!("none; starts from x0 = {}", mm(case.initial.x_m)),
        Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, .. } => {
            let r = angular_frequency_rad_per_s / case.set_up.structure.angular_frequency_rad_per_s();
            format!("base Z = {}, {} Hz (f/fn = {})", mm(amplitude_m), hz(angular_frequency_rad_per_s), digits(r, 4))
        }
        Excitation::HalfSine { amplitude_m, duration_s } => {
            format!("half-sine pulse of the base, Z = {}, {} s", mm(amplitude_m), digits(duration_s, 4))
        }
        Excitation::Versine { amplitude_m, duration_s } => {
            format!("versine pulse of the base, Z = {}, {} s", mm(amplitude_m), digits(duration_s, 4))
        }
        Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s, .. } => {
            format!("force {} N at {} Hz", digits(amplitude_n, 4), hz(angular_frequency_rad_per_s))
        }
        Excitation::ForceHalfSine { amplitude_n, duration_s } => {
            format!("half-sine force, {} N, {} s", digits(amplitude_n, 4), digits(duration_s, 4))
        }
    }
}

/// How many chatters ended in a particle resting on a wall, and when the first of them did.
fn accumulations(answer: &Answer) -> String {
    let first = answer.accumulations.iter().take(FEW_ACCUMULATIONS);
    let ends: Vec<String> = first.map(|a| digits(a.t_s, 9)).collect();
    let count = answer.summary.accumulation_count;
    let all = count == ends.len() as u64;
    format!(
        "{count}: the particle came to rest on a wall at {}{} s; the last impacts of each are summed, not listed",
        ends.join(", "),
        if all { "" } else { ", …" }
    )
}

/// The summary for people.
pub fn summary(case: &Case, answer: &Answer) -> String {
    let s = &answer.summary;
    let over = |value_m: f64, name: &str| {
        case.reference_m().map_or(String::new(), |(by_m, by)| format!("  {name}/{by} = {}", digits(value_m / by_m, 5)))
    };
    // Under a pulse or a record no cycle is like the one before.
    let is_periodic = matches!(case.excitation, Excitation::Sine { .. } | Excitation::ForceSine { .. });
    let ending = answer.ending.filter(|_| is_periodic);
    let mut lines = set_up(case);
    lines.push(("", String::new()));
    lines.push(("largest |x|", mm(s.max_abs_x_m) + &over(s.max_abs_x_m, "X")));
    lines.push(("largest |x − z|", mm(s.max_abs_x_minus_z_m)));
    if let Some(rms_m) = s.rms_x_minus_z_m {
        lines.push(("RMS of x − z", mm(rms_m)));
    }
    lines.push(("RMS of x", mm(s.rms_x_m) + &over(s.rms_x_m, "RMS")));
    if case.set_up.particle.is_some() {
        let kind = if case.has_soft_wall() { "contacts" } else { "impacts" };
        let rate = ending.map_or(String::new(), |e| format!(", {} a cycle at the end", digits(e.impacts_per_cycle, 3)));
        lines.push((kind, format!("{}{rate}", s.impact_count)));
    }
    if s.accumulation_count > 0 {
        lines.push(("accumulations", accumulations(answer)));
    }
    if s.unresolved > 0 {
        let text = format!(
            "{} times events were too many to be told apart, and a moment was taken without them",
            s.unresolved
        );
        lines.push(("unresolved", text));
    }
    if let Some(force) = s.peak_contact_force_n {
        lines.push(("contact force", format!("at most {} N", digits(force, 5))));
    }
    if let (Some(duration), Some(e)) = (s.first_contact_duration_s, s.first_contact_restitution) {
        lines.push(("first contact", format!("{} ms, restitution {}", digits(duration * 1e3, 4), digits(e, 4))));
    }
    if let Some(mean) = s.steady_mean_cycle_max_abs_x_m {
        let from = case.run.steady_from_cycle.unwrap_or(0);
        lines.push((
            "steady cycles",
            format!("mean of largest |x| from cycle {from} on {}{}", mm(mean), over(mean, "X")),
        ));
    }
    if let Some(ending) = ending {
        let text = if ending.spread < STEADY {
            format!("steady: the last 20 stay within {} % of it", digits(100.0 * ending.spread, 1))
        } else {
            format!("not steady: the last 20 depart from it by up to {} %", digits(100.0 * ending.spread, 2))
        };
        let mean = ending.mean_cycle_max_m;
        lines.push(("last 10 cycles", format!("largest |x| {} on average{}; {text}", mm(mean), over(mean, "X"))));
    }
    if let Some(record) = case.record.as_ref().filter(|r| r.quantity == Quantity::Acceleration) {
        let drift = digits(record.drift_m(), 3);
        lines.push((
            "baseline",
            format!("not corrected: z drifts to {drift} m by the record's end, and x with it; x − z does not"),
        ));
    }
    let cycles = digits(s.simulated_s / case.cycle_s(), 5);
    let what = if is_periodic || case.run.cycle_s.is_some() { "cycles" } else { "natural periods" };
    let mut text = format!("{}: {} s simulated ({cycles} {what})", case.name, digits(s.simulated_s, 9));
    for (name, value) in lines {
        text.push_str(format!("\n  {name:16} {value}").trim_end());
        if name.is_empty() {
            text.push('\n');
        }
    }
    text.replace("\n\n\n", "\n\n")
}

/// The picture of the windows that were seen.
///
/// # Errors
/// What the drawing library says.
pub fn figure(case: &Case, whole: Option<&Outline>, last: Option<&Outline>) -> Result<Picture, FigureError> {
    let outlines: Vec<&Outline> = [whole, last].into_iter().flatten().filter(|o| !o.is_empty()).collect();
    if outlines.is_empty() {
        return Err(FigureError("the run was stopped before the drawn time".into()));
    }
    let set_up = &case.set_up;
    let second_mass = match (set_up.particle, set_up.tmd) {
        (Some(_), _) => Some("particle"),
        (None, Some(_)) => Some("tuned mass"),
        (None, None) => None,
    };
    let base_moves = outlines.iter().all(|o| !o.is_relative()) && case.record.is_some()
        || matches!(
            case.excitation,
            Excitation::Sine { .. } | Excitation::HalfSine { .. } | Excitation::Versine { .. }
        );
    let notes = Notes {
        clearance_m: set_up.particle.map(|p| p.clearance_m),
        second_mass,
        base_moves,
        title: format!("{}: {}", case.name, excitation(case)),
    };
    draw(&outlines, &notes)
}
