//! Text of `damprig simulate`: warnings before the run, set-up and summary after it.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use damprig_particles::{Damper, Elasticity};

use crate::motion_record::{Record, RecordQuantity};
use crate::report::describe;
use crate::report::numbers::{about, millimetres, significant};
use crate::report::terminal::multi_degree;
use crate::simulation::collector::MAX_ACCUMULATIONS_WITHOUT_IMPACTS;
use crate::simulation::cost::{Cost, LONG_S};
use crate::simulation::many_particles::SpheresResult;
use crate::simulation::result::ContactFigures;
use crate::simulation::settling;
use crate::simulation::time_history::TablePath;
use crate::simulation::{Case, SimulationResult};

/// Rows of a time history above which a warning is given.
const MANY_ROWS: f64 = 2e7;

/// Overlap over the diameter above which contacts count as soft.
const LARGE_OVERLAP: f64 = 0.05;

/// Warnings before the run: stiff walls, long computing time, large files.
pub fn warnings(case: &Case, cost: &Cost, history: Option<(&TablePath, f64)>) -> Vec<String> {
    let mut warnings = Vec::new();
    if let Some(first) = case.run.steady_from_cycle {
        let times_s = [case.cycle_s(), case.run.duration_s];
        warnings.extend(settling::warning(case, "steady_from_cycle", first as f64, times_s));
    }
    if let Some(arc_s) = cost.stiff_arc_s {
        warnings.push(format!(
            "the wall is stiff compared with the structure: in contact, a natural period takes {} arcs of {} s",
            significant(case.natural_period_s() / arc_s, 2),
            significant(arc_s, 2)
        ));
    }
    if cost.seconds > LONG_S {
        let pieces = if case.many_particles.is_some() || case.multi_degree.is_some() { "steps" } else { "arcs" };
        warnings.push(format!(
            "simulating {} s may take {} ({} {pieces}), judging by the first {} s; Ctrl-C stops the run and keeps the results so far",
            significant(case.run.duration_s, 6),
            about(cost.seconds),
            significant(cost.arcs, 2),
            significant(cost.trial_s, 2)
        ));
    }
    if let Some((path, rate_hz)) = history {
        let rows = rate_hz * case.run.duration_s;
        if rows > MANY_ROWS {
            warnings.push(format!(
                "{} will have {} rows, about {} GB; a lower --rate makes it smaller",
                path.path().display(),
                significant(rows, 2),
                significant(rows * path.bytes_per_row() * 1e-9, 2)
            ));
        }
    }
    warnings
}

/// The set-up, a line per part.
fn set_up(case: &Case) -> Vec<(&'static str, String)> {
    if let Some(several) = &case.multi_degree {
        let mut lines = multi_degree::set_up(several);
        let place = several.set_up.driven_place.or(several.set_up.force_beside_base.map(|force| force.place));
        let driven = place.map_or(String::new(), |place| format!(" at {}", several.places[place]));
        lines.extend(case.hertz_as_hard().map(|text| ("walls", text)));
        lines.push(("excitation", describe::excitation(case) + &driven));
        return lines;
    }
    let structure = &case.set_up.structure;
    let omega = structure.angular_frequency_rad_per_s();
    let mut lines = vec![(
        "structure",
        format!(
            "{} kg, fn = {} Hz, ζ = {}",
            significant(structure.mass_kg, 4),
            significant(omega / TAU, 5),
            significant(structure.damping_ratio(), 3)
        ),
    )];
    let reference = case.reference_m();
    let relative = |length_m: f64| {
        reference.map_or(String::new(), |(by_m, name)| format!(" (d/{name} = {})", significant(length_m / by_m, 4)))
    };
    if let Some(p) = &case.set_up.particle {
        let wall = describe::walls(p);
        let ratio = significant(p.mass_kg / structure.mass_kg, 4);
        let friction = match p.friction_coefficient {
            0.0 => String::new(),
            mu => format!(", μi = {}", significant(mu, 4)),
        };
        let (d, by) = (millimetres(p.clearance_m), relative(p.clearance_m));
        lines.push(("particle", format!("mass ratio {ratio}, d = {d}{by}, {wall}{friction}")));
        lines.extend(case.hertz_as_hard().map(|text| ("walls", text)));
    }
    if let Some(damper) = &case.set_up.friction_damper {
        let ratio = reference.map_or(String::new(), |(by_m, name)| {
            format!(" (F/k{name} = {})", significant(damper.force_n / (structure.stiffness_n_per_m * by_m), 4))
        });
        lines.push(("friction damper", format!("F = {} N{ratio}", significant(damper.force_n, 4))));
    }
    if let Some(tmd) = &case.set_up.tmd {
        let own = (tmd.stiffness_n_per_m / tmd.mass_kg).sqrt();
        let zeta = tmd.damping_n_s_per_m / (2.0 * tmd.mass_kg * own);
        let (ratio, gamma) = (tmd.mass_kg / structure.mass_kg, own / omega);
        let text = format!(
            "mass ratio {}, γ = {}, ζ1 = {}",
            significant(ratio, 4),
            significant(gamma, 4),
            significant(zeta, 4)
        );
        lines.push(("tuned mass", text));
    }
    if let Some(spheres) = &case.many_particles {
        lines.extend(many_particles(case, spheres));
    }
    lines.push(("excitation", describe::excitation(case)));
    lines
}

/// The spheres and their box.
fn many_particles(case: &Case, spheres: &Damper) -> [(&'static str, String); 2] {
    let volume_m3 = std::f64::consts::PI / 6.0 * spheres.diameter_m.powi(3);
    let ratio = spheres.mass_kg / case.set_up.structure.mass_kg;
    let sides = spheres.cavity.sides_m();
    let share = spheres.count as f64 * volume_m3 / sides.iter().product::<f64>();
    let friction = match spheres.friction_coefficient {
        0.0 => String::new(),
        mu => format!(", μ = {}", significant(mu, 4)),
    };
    let elasticity = match spheres.elasticity {
        Elasticity::Spring { stiffness_n_per_m } => format!("k = {} N/m", significant(stiffness_n_per_m, 3)),
        Elasticity::Hertz { youngs_modulus_pa, poisson_ratio } => {
            format!("E = {} GPa, ν = {}", significant(1e-9 * youngs_modulus_pa, 3), significant(poisson_ratio, 3))
        }
    };
    let text = format!(
        "{} of {}, mass ratio {} ({} kg/m³), e = {}{friction}, {}",
        spheres.count,
        millimetres(spheres.diameter_m),
        significant(ratio, 4),
        significant(spheres.sphere_kg() / volume_m3, 3),
        significant(spheres.restitution, 4),
        elasticity
    );
    let sides = sides.map(millimetres).join(" × ");
    [("spheres", text), ("box", format!("{sides}, {} % filled", significant(100.0 * share, 3)))]
}

/// What the spheres did.
fn spheres_results(result: &SpheresResult) -> Vec<(&'static str, String)> {
    let mut lines = vec![("collisions", format!("{} between spheres", result.collisions))];
    let last = &result.last;
    if last.cycles > 0 {
        let text = format!(
            "{} mJ per cycle, loss factor {}; collective motion {} (last {} cycles)",
            significant(1e3 * last.lost_per_cycle_j(), 4),
            significant(last.loss_factor(), 3),
            significant(last.collective_motion(), 3),
            last.cycles
        );
        lines.push(("spheres lose", text));
    }
    let (impacts_j, friction_j) = (result.lost_in_impacts_j, result.lost_in_friction_j);
    lines.push((
        "lost in all",
        format!(
            "{} mJ in impacts, {} mJ in friction, {} mJ in the structure; the energy book misses {} mJ",
            significant(1e3 * impacts_j, 4),
            significant(1e3 * friction_j, 4),
            significant(1e3 * result.lost_in_structure_j, 4),
            significant(1e3 * result.energy_error_j, 2)
        ),
    ));
    let overlap = significant(100.0 * result.largest_overlap_ratio, 2);
    let soft =
        if result.largest_overlap_ratio > LARGE_OVERLAP { ": the contacts are soft; raise the stiffness" } else { "" };
    lines.push((
        "contacts",
        format!("largest overlap {overlap} % of the diameter{soft}; step {} µs", significant(1e6 * result.step_s, 3)),
    ));
    lines
}

/// Durations of the contacts with Hertz walls, and e of a free impact at their mean speed.
fn contact_times(contacts: &ContactFigures, case: &Case) -> String {
    let ms = |seconds: f64| significant(seconds * 1e3, 4);
    let speed = contacts.mean_approach_speed_m_per_s;
    let laws = case.hertz_laws();
    let e: Vec<_> = laws.iter().map(|law| significant(law.restitution(speed), 4)).collect();
    let speed = significant(speed, 3);
    let (shortest, longest, e) = (ms(contacts.shortest_s), ms(contacts.longest_s), e.join(" and "));
    format!("{shortest} to {longest} ms; e = {e} of a free impact at their mean speed of {speed} m/s")
}

/// Number of accumulations and the times of the first ones.
fn accumulations(result: &SimulationResult) -> String {
    let first = result.accumulations.iter().take(MAX_ACCUMULATIONS_WITHOUT_IMPACTS);
    let ends: Vec<String> = first.map(|a| significant(a.t_s, 9)).collect();
    let count = result.summary.accumulation_count;
    let all = count == ends.len() as u64;
    format!(
        "{count}; the particle came to rest on a wall at {}{} s; the last impacts of each are summed, not listed",
        ends.join(", "),
        if all { "" } else { ", …" }
    )
}

/// Set-up and results.
pub fn summary(case: &Case, result: &SimulationResult) -> String {
    let s = &result.summary;
    let over = |value_m: f64, name: &str| {
        case.reference_m()
            .map_or(String::new(), |(by_m, by)| format!("  {name}/{by} = {}", significant(value_m / by_m, 5)))
    };
    // A pulse or a record has no steady state.
    let is_periodic = matches!(case.excitation, Excitation::Sine { .. } | Excitation::ForceSine { .. });
    let last_cycles = result.last_cycles.filter(|_| is_periodic);
    let mut lines = set_up(case);
    lines.push(("", String::new()));
    lines.push(("largest |x|", millimetres(s.max_abs_x_m) + &over(s.max_abs_x_m, "X")));
    lines.push(("largest |x − z|", millimetres(s.max_abs_x_minus_z_m)));
    if let Some(rms_m) = s.rms_x_minus_z_m {
        lines.push(("RMS of x − z", millimetres(rms_m)));
    }
    lines.push(("RMS of x", millimetres(s.rms_x_m) + &over(s.rms_x_m, "RMS")));
    if case.has_impacts() {
        let kind = if case.has_soft_walls() { "contacts" } else { "impacts" };
        let rate = last_cycles
            .map_or(String::new(), |e| format!(", {} per cycle at the end", significant(e.impacts_per_cycle, 3)));
        lines.push((kind, format!("{}{rate}", s.impact_count)));
    }
    if let Some(spheres) = &result.many_particles {
        lines.extend(spheres_results(spheres));
    }
    if let Some(places) = &result.multi_degree {
        lines.extend(multi_degree::results(places));
    }
    if s.accumulation_count > 0 {
        lines.push(("accumulations", accumulations(result)));
    }
    if s.unresolved > 0 {
        let text =
            format!("{} instants with too many events; the motion continued without resolving them", s.unresolved);
        lines.push(("unresolved", text));
    }
    if let Some(beyond_m) = s.passed_wall_by_m {
        let text = format!(
            "the particle is {} mm beyond its wall: with release = \"zero_force\" a wall acts again only when the particle is back; from then on \
             nothing here is that of a damper",
            significant(1e3 * beyond_m, 4)
        );
        lines.push(("passed the wall", text));
    }
    if let Some(force) = s.peak_contact_force_n {
        lines.push(("wall force", format!("at most {} N", significant(force, 5))));
    }
    if let (Some(duration), Some(e)) = (s.first_contact_duration_s, s.first_contact_restitution) {
        lines.push((
            "first contact",
            format!("{} ms, restitution {}", significant(duration * 1e3, 4), significant(e, 4)),
        ));
    }
    if let Some(contacts) = &s.contacts {
        lines.push(("contact time", contact_times(contacts, case)));
    }
    if let Some(mean) = s.steady_mean_cycle_max_abs_x_m {
        let from = case.run.steady_from_cycle.unwrap_or(0);
        lines.push((
            "steady cycles",
            format!("mean of the largest |x| from cycle {from} on: {}{}", millimetres(mean), over(mean, "X")),
        ));
    }
    if let Some(last_cycles) = last_cycles {
        let text = if last_cycles.is_steady() {
            format!("|x| is steady: the last 20 are within {} % of it", significant(100.0 * last_cycles.spread, 1))
        } else {
            format!(
                "|x| is not steady from cycle to cycle: the last 20 deviate from it by up to {} %",
                significant(100.0 * last_cycles.spread, 2)
            )
        };
        let mean = last_cycles.mean_cycle_max_m;
        lines.push((
            "last 10 cycles",
            format!("mean of the largest |x|: {}{}; {text}", millimetres(mean), over(mean, "X")),
        ));
    }
    if let Some(text) = case.record.as_ref().and_then(Record::resampled_text) {
        lines.push(("record", text));
    }
    if let (Some(record), Some(jump)) = (&case.record, s.record_start_jump_m_per_s) {
        let (jump, step_s) = (significant(jump, 3), significant(record.step_s, 4));
        lines.push((
            "record's start",
            format!(
                "the record starts with {jump} m/s; the base reaches it smoothly over the first interval of {step_s} s"
            ),
        ));
    }
    if let Some(record) = case.record.as_ref().filter(|r| r.quantity == RecordQuantity::Acceleration) {
        let drift = significant(record.drift_m(), 3);
        lines.push((
            "baseline",
            format!("not corrected: z and x drift to {drift} m by the end of the record; x − z does not drift"),
        ));
    }
    let cycles = significant(s.simulated_s / case.cycle_s(), 5);
    let what = if is_periodic || case.run.cycle_s.is_some() { "cycles" } else { "natural periods" };
    let mut text = format!("{}: {} s simulated ({cycles} {what})", case.name, significant(s.simulated_s, 9));
    for (name, value) in lines {
        text.push_str(format!("\n  {name:16} {value}").trim_end());
        if name.is_empty() {
            text.push('\n');
        }
    }
    text.replace("\n\n\n", "\n\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Source;

    #[test]
    fn a_run_of_spheres_that_never_ends_is_told_in_steps_and_without_a_number_of_years() {
        let text = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0 }
                    run = { duration_s = 10 }
                    many_particles = { count = 9, diameter_m = 0.01, mass_ratio = 0.1, restitution = 0.5, contact_time_s = 0.001, length_m = 0.1, width_m = 0.05, height_m = 0.05 }";
        let mut case = Case::parse(&Source::new("case.toml", text), "case").expect("sound");
        let cost = Cost { arcs: 4e5, seconds: 1e30, trial_s: 0.01, stiff_arc_s: None };
        let told = |case: &Case, cost: &Cost| warnings(case, cost, None).concat();
        assert!(told(&case, &cost).contains("may take more than 1000 years (400000 steps)"), "{}", told(&case, &cost));
        let cost = Cost { seconds: 300.0, ..cost };
        assert!(told(&case, &cost).contains("may take about 5 min (400000 steps)"), "{}", told(&case, &cost));
        case.many_particles = None;
        assert!(told(&case, &cost).contains("(400000 arcs)"));
    }
}
