//! Text of a structure with several places: its modes and dampers, and what each place and damper did.

use std::f64::consts::TAU;

use crate::report::describe;
use crate::report::numbers::{millimetres, significant};
use crate::simulation::multi_degree::MultiDegree;
use crate::simulation::multi_degree::measure::{DamperResult, ModeShare, PlaceResult, PlacesResult};
use crate::structure::at_place;

/// Most modes that are listed.
const LISTED: usize = 5;

/// Least share of the energy of a mode that is named among the results.
const MIN_SHARE: f64 = 1e-3;

/// The structure and its dampers, a line per part.
pub fn set_up(several: &MultiDegree) -> Vec<(&'static str, String)> {
    let set_up = &several.set_up;
    let mut modes: Vec<_> = set_up.structure.modes.iter().collect();
    modes.sort_by(|a, b| a.angular_frequency_rad_per_s.total_cmp(&b.angular_frequency_rad_per_s));
    let more = if modes.len() > LISTED { ", …" } else { "" };
    let list = |of: &dyn Fn(&damprig_structures::Mode) -> f64, digits| {
        let listed: Vec<String> = modes.iter().take(LISTED).map(|mode| significant(of(mode), digits)).collect();
        format!("{}{more}", listed.join(", "))
    };
    let frequencies = list(&|mode| mode.angular_frequency_rad_per_s / TAU, 5);
    let ratios = list(&|mode| mode.damping_ratio, 3);
    let mut lines = vec![
        ("structure", several.kind.clone()),
        ("modes", format!("{}: {frequencies} Hz, ζ = {ratios}", modes.len())),
    ];
    let place = |number: usize| format!("at {}", several.places[number]);
    // Of the lowest mode that moves the place, as the key `mass_ratio`.
    let mass_ratio = |number: usize, mass_kg: f64| {
        let structure = at_place(&set_up.structure, number);
        structure.map_or(String::new(), |of| format!(" (mass ratio {})", significant(mass_kg / of.mass_kg, 3)))
    };
    for damper in &set_up.impact_dampers {
        let particle = &damper.particle;
        let friction = match particle.friction_coefficient {
            0.0 => String::new(),
            mu => format!(", μi = {}", significant(mu, 4)),
        };
        lines.push((
            "particle",
            format!(
                "{}: {} kg{}, d = {}, {}{friction}",
                place(damper.place),
                significant(particle.mass_kg, 4),
                mass_ratio(damper.place, particle.mass_kg),
                millimetres(particle.clearance_m),
                describe::walls_with(particle, damper.piezoelectric)
            ),
        ));
    }
    for joint in &set_up.friction_dampers {
        let other = joint.other.map_or("the base".into(), |other| several.places[other].clone());
        let force = significant(joint.damper.force_n, 4);
        lines.push(("friction damper", format!("{} to {other}: F = {force} N", place(joint.place))));
    }
    for tuned in &set_up.tuned_masses {
        let tmd = &tuned.tmd;
        let own = (tmd.stiffness_n_per_m / tmd.mass_kg).sqrt();
        lines.push((
            "tuned mass",
            format!(
                "{}: {} kg{}, {} Hz, ζ1 = {}",
                place(tuned.place),
                significant(tmd.mass_kg, 4),
                mass_ratio(tuned.place, tmd.mass_kg),
                significant(own / TAU, 5),
                significant(tmd.damping_n_s_per_m / (2.0 * tmd.mass_kg * own), 4)
            ),
        ));
    }
    lines.push(("x is that", place(several.observed)));
    lines
}

/// What each place and each impact damper did, and the modes that take part.
pub fn results(result: &PlacesResult) -> Vec<(&'static str, String)> {
    let place = |of: &PlaceResult| {
        let (x, relative, rms) =
            (millimetres(of.max_abs_x_m), millimetres(of.max_abs_x_minus_z_m), millimetres(of.rms_x_m));
        let drift = of.max_abs_drift_m.map_or(String::new(), |drift| format!(", drift {}", millimetres(drift)));
        let acceleration = significant(of.max_abs_acceleration_m_per_s2, 4);
        let text = format!("largest |x| {x}, |x − z| {relative}{drift}, |x″| {acceleration} m/s², RMS of x {rms}");
        ("place", format!("{}: {text}", of.place))
    };
    let window = match result.measured_from_s {
        0.0 => String::new(),
        from_s => format!(" (from {} s on)", significant(from_s, 5)),
    };
    let damper = |of: &DamperResult| {
        let speed = significant(of.max_approach_speed_m_per_s, 4);
        let force = of.peak_contact_force_n.map(|force_n| format!(", at most {} N on a wall", significant(force_n, 4)));
        let force = force.unwrap_or_default();
        let harvested = of.harvested_power_w.zip(of.max_abs_voltage_v).map(|(power_w, voltage_v)| {
            let [power, voltage] = [power_w, voltage_v].map(|value| significant(value, 4));
            format!("; its loads take {power} W, at most {voltage} V{window}")
        });
        let harvested = harvested.unwrap_or_default();
        ("particle", format!("at {}: {} impacts, at most {speed} m/s{force}{harvested}", of.place, of.impact_count))
    };
    let mode = |(number, of): (usize, &ModeShare)| {
        let (share, rms) = (significant(100.0 * of.energy_share, 3), millimetres(of.rms_x_m));
        let frequency = significant(of.frequency_hz, 5);
        let text =
            format!("{number}, {frequency} Hz: {share} % of the modes' energy, RMS of its part of x {rms}{window}");
        ("mode", text)
    };
    let taking_part = (1..).zip(&result.mode_shares).filter(|(_, of)| of.energy_share >= MIN_SHARE);
    let dampers = result.impact_dampers.iter().map(damper);
    result.places.iter().map(place).chain(dampers).chain(taking_part.map(mode)).collect()
}
