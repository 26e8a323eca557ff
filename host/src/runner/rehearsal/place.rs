//! Finds the key of the campaign that sets a parameter of the controller.

use damprig_core::rig::Rejected;

use super::RefusedRequest;
use crate::campaign::transient::two_digits_down;
use crate::campaign::{Campaign, ExperimentKind, SpringTarget};
use crate::input::locate::PathStep::{self, Item, Key};
use crate::input::locate::path_text;
use crate::input::{Problem, Span};
use crate::settings::decimal;
use crate::setup;

/// A path of the campaign's file.
type Path<'a> = Vec<PathStep<'a>>;

/// The problem, at the key that sets the rejected parameter, for a request of the experiment at `experiment` on the set-up at
/// `set_up`.
pub(super) fn problem(campaign: &Campaign, set_up: usize, experiment: usize, refused: &RefusedRequest) -> Problem {
    let names = (&campaign.set_ups[set_up].name, &campaign.experiments[experiment].name);
    let source = &campaign.source;
    let parameter = parameter_of(&refused.why);
    let paths = paths(campaign, set_up, experiment, parameter);
    let found = paths.iter().find_map(|path| Some((path, source.locate(path)?)));
    let reason = match &refused.why {
        Rejected::Invalid { parameter, value, allowed } => {
            format!("{parameter} = {} is rejected: must be {allowed}", decimal(*value as f32))
        }
        other => other.to_string(),
    };
    let help = help(campaign, set_up, &refused.why);
    match found {
        Some((path, span)) => {
            let written = source.text().get(span.clone()).and_then(|text| text.lines().next()).unwrap_or_default();
            let title = format!(
                "`{}` = {written} is not allowed: the controller refuses to {} (set-up {:?}, experiment {:?})",
                path_text(path),
                refused.what,
                names.0,
                names.1
            );
            Problem { title, span, allowed: reason, help }
        }
        None => Problem {
            title: format!(
                "set-up {:?}, experiment {:?}: the controller refuses to {}",
                names.0, names.1, refused.what
            ),
            span: header(campaign, set_up, experiment, parameter),
            allowed: reason,
            help,
        },
    }
}

fn parameter_of(why: &Rejected) -> &str {
    match why {
        Rejected::Invalid { parameter, .. } | Rejected::AboveLimit { parameter, .. } => parameter,
        Rejected::Looser { setting, .. } => setting,
        Rejected::WrongState { .. } | Rejected::WrongStage { .. } | Rejected::NotHere { .. } => "",
    }
}

/// Place of the set-up for a parameter of one, else of the experiment.
fn header(campaign: &Campaign, set_up: usize, experiment: usize, parameter: &str) -> Span {
    let of_set_up = set_up_paths(set_up, parameter).is_empty();
    let place = if of_set_up { [Key("experiment"), Item(experiment)] } else { [Key("set_up"), Item(set_up)] };
    campaign.source.locate(&place).unwrap_or_default()
}

/// Where the campaign may set a parameter, the most likely place first.
fn paths<'a>(campaign: &Campaign, set_up: usize, experiment: usize, parameter: &'a str) -> Vec<Path<'a>> {
    let of_experiment = |keys: &[&'a str]| -> Path<'a> {
        [Key("experiment"), Item(experiment)].into_iter().chain(keys.iter().map(|key| Key(key))).collect()
    };
    let in_rig = |keys: &[&'a str]| -> Path<'a> { keys.iter().map(|key| Key(key)).collect() };
    match parameter.split_once('.') {
        Some(("drive", "calibrated_at_hz")) => vec![in_rig(&["rig", "shaker", "calibrated_at_hz"])],
        Some(("drive", key)) => vec![of_experiment(&["closed_loop", key])],
        Some(("steady", key)) => vec![of_experiment(&["steady", key])],
        Some(("shaker", key)) => vec![in_rig(&["rig", "shaker", key])],
        Some(("sensors", "resolution_m")) => vec![in_rig(&["rig", "sensor_resolution_m"])],
        Some(("sensors", "noise_rms_m")) => vec![in_rig(&["rig", "sensor_noise_rms_m"])],
        Some(("sensors", key)) => vec![in_rig(&["rig", "sensors", key])],
        Some(("safety", _)) => {
            campaign.rig.limits.key_of(parameter).map(|key| in_rig(&["rig", key])).into_iter().collect()
        }
        Some(_) => set_up_paths(set_up, parameter),
        None => match parameter {
            "amplitude_m" => vec![vec![Key("set_up"), Item(set_up), Key(campaign.set_ups[set_up].amplitude_key())]],
            "scale_m" => match &campaign.experiments[experiment].kind {
                ExperimentKind::Playback(playback) => vec![of_experiment(&[playback.key])],
                _ => Vec::new(),
            },
            "force_n" | "deflection_m" | "friction_ratio" => {
                let keys = ["friction_ratio", "normal_force_n", "deflection_m"];
                keys.into_iter().flat_map(|key| own_and_shared(set_up, "friction_damper.spring", key)).collect()
            }
            "gravity_m_per_s2" => own_and_shared(set_up, "", parameter),
            _ => vec![of_experiment(&[parameter])],
        },
    }
}

/// Where a set-up may set a parameter of the model: under any key of its quantity, in its own table or in the file's.
fn set_up_paths(set_up: usize, parameter: &str) -> Vec<Path<'_>> {
    // Limits on derived values of the spring concern its stiffness.
    let parameter = match parameter {
        "spring.structure_stiffness_n_per_m" => "structure.stiffness_n_per_m",
        "spring.friction_coefficient" | "spring_plant.friction_coefficient" => {
            "friction_damper.spring.friction_coefficient"
        }
        _ if parameter.starts_with("spring") => "friction_damper.spring.stiffness_n_per_m",
        _ => parameter,
    };
    let Some((path, key)) = parameter.rsplit_once('.') else { return Vec::new() };
    let quantities = setup::TABLES.iter().filter(|table| table.path == path).flat_map(|table| table.quantities);
    let quantity = quantities.filter(|quantity| quantity.keys.iter().any(|known| known.name == key));
    quantity.flat_map(|quantity| quantity.keys).flat_map(|known| own_and_shared(set_up, path, known.name)).collect()
}

fn own_and_shared<'a>(set_up: usize, table: &'a str, key: &'a str) -> Vec<Path<'a>> {
    let shared: Path = table.split('.').filter(|part| !part.is_empty()).chain([key]).map(Key).collect();
    let own = [Key("set_up"), Item(set_up)].into_iter().chain(shared.iter().copied()).collect();
    vec![own, shared]
}

/// The largest target of a spring that presses with its force, where that is what was rejected.
fn help(campaign: &Campaign, set_up: usize, why: &Rejected) -> Option<String> {
    let Rejected::Invalid { parameter, value, .. } = why else { return None };
    if parameter != "force_n" || *value <= 0.0 {
        return None;
    }
    let most = campaign.rig.board.spring;
    let share = f64::from(most.working_force_n()) / value;
    let text = match campaign.set_ups[set_up].spring()?.target {
        SpringTarget::FrictionRatio(ratio) => format!("friction_ratio = {}", two_digits_down(ratio * share)),
        SpringTarget::NormalForce(force) => format!("normal_force_n = {}", two_digits_down(force * share)),
        SpringTarget::Deflection(_) => return None,
    };
    let setting = decimal(most.largest_force_n);
    (share < 1.0).then(|| format!("write {text} or less; the board's spring.largest_force_n is {setting} N"))
}
