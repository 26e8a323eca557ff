//! The text of a new study or optimisation: a case over some of its keys, with comments.

use damprig_core::integrator::exact::Excitation;

use crate::simulation::Case;
use crate::study::bifurcation::SweepAxis;

/// The axes that the damper of a case is designed by: clearance and restitution, friction ratio, or the frequency of the drive.
#[must_use]
pub fn usual_axes(case: &Case) -> Vec<SweepAxis> {
    let axis = |key: &str, from: f64, to: f64, count: usize| {
        let values = (0..count).map(|n| from + (to - from) * n as f64 / (count - 1) as f64).collect();
        SweepAxis { key: key.into(), values }
    };
    let mut axes = Vec::new();
    // One of several has its number.
    let several = case.multi_degree.as_ref().map(|several| &several.set_up);
    let of = |table: &str, count: Option<usize>, key: &str| match count {
        Some(2..) => format!("{table}.1.{key}"),
        _ => format!("{table}.{key}"),
    };
    let of_particle = |key: &str| of("particle", several.map(|set_up| set_up.impact_dampers.len()), key);
    let of_friction = |key: &str| of("friction_damper", several.map(|set_up| set_up.friction_dampers.len()), key);
    if let Some(particle) = &case.set_up.particle {
        if let Some((reference_m, _)) = case.reference_m() {
            let ratio = particle.clearance_m / reference_m;
            axes.push(axis(&of_particle("clearance_ratio"), round(0.5 * ratio), round(2.0 * ratio), 41));
        }
        if !particle.wall.is_soft() {
            axes.push(axis(&of_particle("wall.coefficient"), 0.1, 0.9, 33));
        }
    }
    if case.set_up.friction_damper.is_some() && is_driven(case) {
        axes.push(axis(&of_friction("friction_ratio"), 0.1, 0.7, 25));
    }
    if axes.is_empty() {
        let natural_hz = 1.0 / case.natural_period_s();
        axes.push(match (is_driven(case), &case.multi_degree) {
            (true, _) => axis(drive_key(case), round(0.8 * natural_hz), round(1.2 * natural_hz), 41),
            (false, None) => {
                axis("structure.natural_frequency_hz", round(0.8 * natural_hz), round(1.2 * natural_hz), 41)
            }
            (false, Some(_)) => {
                let start_m = if case.initial.x_m == 0.0 { 0.001 } else { case.initial.x_m };
                axis("initial.x_m", round(0.5 * start_m), round(2.0 * start_m), 41)
            }
        });
    }
    axes
}

/// The text of a study of the case in the file `case_file`.
#[must_use]
pub fn study(name: &str, case_file: &str, case: &Case, axes: &[SweepAxis]) -> String {
    let mut metrics =
        vec![if case.reference_m().is_some() && case.record.is_none() { "x_over_z" } else { "max_abs_x_m" }];
    metrics.extend(case.has_impacts().then_some("impacts_per_cycle"));
    metrics.extend(case.record.is_none().then_some("cycle_spread"));
    let mut text = format!(
        "# A case over all combinations of the values of its axes. `damprig keys` has all keys of a study.\n\
         name = {}\n\
         case = {}    # relative to this file\n\
         metrics = [{}]\n\
         # goal = \"maximum\"    # of the first metric; the smallest value is the best without it\n",
        quoted(name),
        quoted(case_file),
        metrics.iter().map(|metric| quoted(metric)).collect::<Vec<_>>().join(", ")
    );
    for axis in axes {
        text += &format!(
            "\n[[axis]]\nkey = {}    # any key of the case, with its tables\nfrom = {}\nto = {}\ncount = {}\n# scale = \"log\"\n",
            quoted(&axis.key),
            number(axis.values[0]),
            number(axis.values[axis.values.len() - 1]),
            axis.values.len()
        );
    }
    if is_driven(case) {
        let natural_hz = 1.0 / case.natural_period_s();
        text += &format!(
            "\n# A band of frequencies, of which each point has its peak:\n# [[axis]]\n# key = {}\n# from = {}\n# to = {}\n# count = 21\n\
             # reduce = \"maximum\"\n",
            quoted(drive_key(case)),
            number(round(0.8 * natural_hz)),
            number(round(1.2 * natural_hz))
        );
        text += "\n[record]\nsettle_cycles = 200    # simulated from the case's start, not counted\ncycles = 100           # counted\n";
    } else {
        text += "\n# What is counted; without it the case's run.duration_s.\n# [record]\n# duration_s = 12\n";
    }
    if case.has_particle() {
        text += "\n# Each point from several starts of the particle, from wall to wall; `over`: which value counts.\n# [ensemble]\n# starts = 21\n# over = \"worst\"    # or \"q95\", \"median\", \"mean\"\n";
    }
    text
}

/// The text of an optimisation of the case in the file `case_file`: for the lowest peak over a band about the natural frequency, or the
/// smallest |x| of a motion that no sine drives. Axes give the variables and their ranges.
#[must_use]
pub fn optimisation(name: &str, case_file: &str, case: &Case, axes: &[SweepAxis]) -> String {
    let objective = if is_driven(case) { "max_x_over_z" } else { "max_abs_x_m" };
    let mut text = format!(
        "# The values of the variables at which the objective is best. `damprig keys` has all keys of an optimisation.\n\
         name = {}\n\
         case = {}    # relative to this file\n\
         objective = {}\n\
         # goal = \"maximum\"    # the smallest value is the best without it\n",
        quoted(name),
        quoted(case_file),
        quoted(objective)
    );
    for axis in axes {
        text += &format!(
            "\n[[variable]]\nkey = {}    # any number of the case, with its tables\nfrom = {}\nto = {}\n# relative_tolerance = 0.01    # how exactly it can be made, as a share of the value; the worst within it counts\n",
            quoted(&axis.key),
            number(axis.values[0]),
            number(axis.values[axis.values.len() - 1])
        );
    }
    text += "\n# What has to be kept:\n# [[constraint]]\n# metric = \"max_abs_x_minus_z_m\"\n# at_most = 0.05\n";
    if is_driven(case) {
        let natural_hz = 1.0 / case.natural_period_s();
        text += &format!(
            "\n# The band whose highest peak counts.\n[[axis]]\nkey = {}\nfrom = {}\nto = {}\ncount = 21\nreduce = \"maximum\"\n",
            quoted(drive_key(case)),
            number(round(0.8 * natural_hz)),
            number(round(1.2 * natural_hz))
        );
        text += &format!(
            "\n[record]\nduration_s = {}    # simulated from the case's start, all of it counted\n",
            number(round(80.0 * case.natural_period_s()))
        );
    }
    if case.set_up.particle.is_some() {
        text += "\n# The worst of several starts of the particle, from wall to wall.\n# [ensemble]\n# starts = 11\n";
    }
    text
}

fn is_driven(case: &Case) -> bool {
    case.is_under_a_sine()
}

fn drive_key(case: &Case) -> &'static str {
    if matches!(case.excitation, Excitation::ForceSine { .. }) { "force.frequency_hz" } else { "base.frequency_hz" }
}

/// Two digits.
fn round(value: f64) -> f64 {
    let unit = 10_f64.powf(value.abs().log10().floor() - 1.0);
    // Divided by a whole number where it can be, so that the digits are few.
    if unit < 1.0 { (value / unit).round() / (1.0 / unit).round() } else { (value / unit).round() * unit }
}

fn number(value: f64) -> String {
    toml::Value::Float(value).to_string()
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}
