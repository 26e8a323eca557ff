//! Reads the case file (TOML or JSON, the same keys): set-up, excitation, initial state and run.

use std::path::Path;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Initial, SetUp};
use toml::de::DeTable;

use super::case::{Case, RunSpec};
use super::excitation::{self, CaseExcitation};
use super::json_case;
use super::keys::{case, force_half_sine, force_sine, initial, run};
use super::set_values::{self, SetValues};
use super::{many_particles, multi_degree, refusals};
use crate::input::locate::PathStep::Key;
use crate::input::{Problem, Section, Source, resolve};
use crate::motion_record::Record;
use crate::setup::{self, BASE_AMPLITUDE, BaseAmplitude, SetUpSpec, SharedKeys, refuse_place, set_up_file};
use crate::structure::{description, description_of};

/// Reads a case, with some of its values set from outside; `None` after a problem has been reported.
pub(super) fn read(source: &Source, name: &str, values: &SetValues) -> Option<Case> {
    let (toml, title) = toml_of(source)?;
    let shifted = source.attach(&values.origin, &values.lines);
    let set = match DeTable::parse(&shifted) {
        Ok(set) => set,
        Err(error) => {
            source.report(Problem {
                title: "a value set from outside is not TOML".into(),
                span: error.span().unwrap_or_default(),
                allowed: error.message().to_string(),
                help: None,
            });
            return None;
        }
    };
    let values = set.get_ref();
    if let Some((key, name, other)) = set_values::both_of_one(values, "") {
        source.report(Problem {
            title: format!("`{name}` and `{other}` are both set"),
            span: key.span(),
            allowed: "they give the same quantity".into(),
            help: Some("set one of them".into()),
        });
        return None;
    }
    source.read_changed_toml(
        &toml,
        title,
        |own| {
            for (span, allowed) in set_values::put(own, values, "") {
                source.report(Problem {
                    title: "a value is set in a table that the file does not have".into(),
                    span,
                    allowed,
                    help: None,
                });
            }
        },
        |root| read_root(root, name),
    )
}

/// The text of a case as TOML, with the title of the problem that it is none; `None` after a problem has been reported.
pub(super) fn toml_of(source: &Source) -> Option<(String, &'static str)> {
    // Valid JSON may hold what TOML forbids: a number of 20 digits, a duplicate key.
    Some(match is_json(source) {
        true => (json_case::to_toml(source)?, "this JSON cannot be read"),
        false => (source.text().to_string(), "this is not TOML"),
    })
}

fn read_root(root: &Section, name: &str) -> Option<Case> {
    let name = root.text_of(&case::NAME).map_or_else(|| name.to_string(), |text| text.value);
    if let Some(key) = description_of(root) {
        return multi_degree::read::read(root, key, name);
    }
    for quantity in [&description::OBSERVED, &description::PLACES, &description::MODAL_DAMPING] {
        refuse_place(root, quantity);
    }
    let stated_m = root.scalar(&BASE_AMPLITUDE);
    let (case_excitation, beside) = read_excitation(root, stated_m);
    let record = match &case_excitation {
        Some(CaseExcitation::Recorded(record)) => Some(record),
        _ => None,
    };
    let initial_section = root.table_of(&case::INITIAL, None);
    if let Some(initial) = &initial_section {
        refuse_place(initial, &initial::MODE);
    }
    if let Some(force) = root.table_of(&case::FORCE, None) {
        refuse_place(&force, &force_sine::PLACE);
    }
    let x0_m = initial_section.as_ref().and_then(|s| s.scalar(&initial::X)).filter(|x0_m| *x0_m != 0.0);
    let base = case_excitation.as_ref().map_or(BaseAmplitude::Unread, |it| base_amplitude(it, stated_m, x0_m));
    let source = root.source();
    let file = set_up_file::attach(root);
    let document = file.as_ref().and_then(|file| file.parse(source));
    if let (Some(file), Some(document)) = (&file, &document) {
        file.check(source, document);
    }
    let shared = SharedKeys::of_file(document.as_ref().map(|document| document.get_ref()));
    let spec = setup::read(root, &shared, base, record.map(|record| record.step_s), None);
    if spec.as_ref().is_some_and(SetUpSpec::is_start_unknown) {
        let span = source.locate(&[Key("particle"), Key("start")]).unwrap_or_default();
        source.report(Problem {
            title: "`particle.start` = \"unknown\" is for campaigns".into(),
            span,
            allowed: "a case has one start: \"centre\", \"at_negative_wall\", \"at_positive_wall\", or `start_m`"
                .into(),
            help: Some("simulate it from several starts".into()),
        });
    }
    let z_m = match (base, &spec) {
        (BaseAmplitude::Is(z_m), _) => z_m,
        (BaseAmplitude::Force(force_n), Some(spec)) => force_n / spec.structure().stiffness_n_per_m,
        _ => 0.0,
    };
    let start = spec.map_or((0.0, false), |spec| (spec.particle_start_m(z_m), spec.places_particle()));
    let initial = read_initial(initial_section.as_ref(), record.map_or(0.0, Record::start_m), start);
    let run_section = root.table_of(&case::RUN, None);
    let run = run_section.as_ref().and_then(|s| read_run(s, record.map(Record::duration_s)));
    let spheres = root.table_of(&case::MANY_PARTICLES, None);
    if let (Some(spheres), Some(spec)) = (&spheres, &spec) {
        refusals::refuse_beside_spheres(spheres, spec, record, initial_section.as_ref());
    }
    let gravity_m_per_s2 = spec.map_or(0.0, |spec| spec.at(z_m).gravity_m_per_s2);
    let many_particles = match &spheres {
        Some(spheres) => many_particles::read::read(spheres, spec.as_ref().map(SetUpSpec::structure), gravity_m_per_s2),
        None => None,
    };
    let (spec, case_excitation, run) = (spec?, case_excitation?, run?);
    if root.is_given(&case::MANY_PARTICLES) && many_particles.is_none() {
        return None;
    }
    if stated_m.is_some() && !spec.is_relative() && case_excitation.amplitude_m().is_none() {
        let help = "write base = { kind = \"sine\", frequency_hz = … } to move the base by it, or leave it out";
        root.reject(BASE_AMPLITUDE.name(), "is not used: the case has no ratio and no moving base", Some(help.into()));
    }
    // In a case the force is the excitation.
    let set_up = SetUp { is_force_driven: false, ..spec.at(z_m) };
    let (excitation, record) = match case_excitation.on(set_up.structure.angular_frequency_rad_per_s()) {
        CaseExcitation::ClosedForm(excitation) | CaseExcitation::FrequencyRatio(excitation) => (excitation, None),
        CaseExcitation::Recorded(record) => (Excitation::Fixed, Some(record)),
    };
    for invalid in [set_up.validate(), excitation.validate(), set_up.validate_initial(&initial)] {
        let Err(invalid) = invalid else { continue };
        // The model's own checks, for example a particle outside its cavity.
        let place = initial_section.as_ref().filter(|_| invalid.parameter == "initial.y_m");
        root.source().report(Problem {
            title: format!("`{}` = {} is not allowed", invalid.parameter, invalid.value),
            span: place.map_or(root.span(), |section| section.span_of("y_m")),
            allowed: format!("must be {}", invalid.allowed),
            help: None,
        });
    }
    let contacts = spec.contacts();
    let mut case =
        Case { name, set_up, contacts, many_particles, excitation, record, initial, run, multi_degree: None };
    if beside.is_some() || spec.harvests() {
        case.multi_degree = Some(multi_degree::read::of_one_degree(root, &case, beside)?);
    }
    if let Some(section) = &run_section {
        check_cycles(section, &case);
    }
    if let (Some(section), Some(damper)) = (&spheres, &case.many_particles) {
        many_particles::read::check_contact(section, damper, case.shortest_period_s());
    }
    // A record moves the sampled integrator, which has no contacts that last; that for several places has them.
    let has_sampled_motion = case.record.is_some() && case.multi_degree.is_none();
    Some(if has_sampled_motion { case.without_hertz() } else { case })
}

/// Reads `base` and `force`: the excitation, and P, N, and φ, rad, of a force beside a sine of the base.
pub(super) fn read_excitation(root: &Section, stated_m: Option<f64>) -> (Option<CaseExcitation>, Option<(f64, f64)>) {
    let beside = |file: &str| resolve(Path::new(root.source().name()), file);
    let base = match root.table_of(&case::BASE, None) {
        Some(s) => excitation::base(&s, stated_m, &beside),
        None if root.is_given(&case::BASE) => None,
        None => Some(CaseExcitation::ClosedForm(Excitation::Fixed)),
    };
    let Some(force) = root.table_of(&case::FORCE, None) else { return (base, None) };
    match base {
        Some(base) if base.is_none() => (excitation::force(&force), None),
        Some(base) if base.is_sine_of_base() => (Some(base), excitation::force_beside_base(&force)),
        Some(base) => {
            root.source().report(Problem {
                title: "`force` and a moving `base` are both given".into(),
                span: force.span(),
                allowed: "both can be given if both are sines: the force then has the base's frequency".into(),
                help: Some("write base = {kind = \"fixed\"}, or leave out `force`".into()),
            });
            excitation::force(&force);
            (Some(base), None)
        }
        None => {
            // Without frequency or duration it may be one beside the base that cannot be read.
            if force.is_given(&force_sine::FREQUENCY) || force.is_given(&force_half_sine::DURATION) {
                excitation::force(&force);
            }
            (None, None)
        }
    }
}

/// What ratios refer to: Z, the amplitude of the base motion, or the one stated in the set-up; P of a force; x0 of a free vibration.
pub(super) fn base_amplitude(excitation: &CaseExcitation, stated_m: Option<f64>, x0_m: Option<f64>) -> BaseAmplitude {
    let free_m = x0_m.filter(|_| excitation.is_none());
    let force_n = excitation.amplitude_n().filter(|force_n| *force_n > 0.0);
    match (excitation.amplitude_m(), stated_m) {
        (Some(0.0), _) => BaseAmplitude::Absent("the base's amplitude is 0"),
        (Some(z_m), _) | (None, Some(z_m)) => BaseAmplitude::Is(z_m),
        (None, None) if matches!(excitation, CaseExcitation::Recorded(_)) => {
            BaseAmplitude::Absent("a record has no amplitude")
        }
        (None, None) => match (free_m, force_n) {
            (Some(x0_m), _) => BaseAmplitude::Is(x0_m.abs()),
            (None, Some(force_n)) => BaseAmplitude::Force(force_n),
            (None, None) => BaseAmplitude::Absent("the base of this case is fixed"),
        },
    }
}

/// Shortest allowed cycle as a fraction of the shorter of natural and drive period.
const MIN_CYCLE: f64 = 1e-6;

/// Rejects a cycle so short that the run would only close empty cycles, and steady cycles without a length or beyond the run.
pub(super) fn check_cycles(run: &Section, case: &Case) {
    let least_s = MIN_CYCLE * case.shortest_period_s();
    if case.run.cycle_s.is_some_and(|cycle_s| cycle_s < least_s) {
        let allowed = format!("must be {least_s:.3e} s or more: a millionth of the period of structure or drive");
        run.reject(run::CYCLE.name(), allowed, None);
    }
    let Some(first) = case.run.steady_from_cycle else { return };
    let key = run::STEADY_FROM.name();
    let Some(cycle_s) = case.run.cycle_s.or(case.drive_period_s()) else {
        let help = Some("give `cycle_s`, or leave out `steady_from_cycle`".into());
        run.reject(key, "needs `cycle_s`, the length of a cycle: only a sine has a period of its own", help);
        return;
    };
    let cycles = (case.run.duration_s / cycle_s * (1.0 + 1e-12)).floor();
    if first as f64 + 1.0 > cycles {
        let allowed = format!("must leave one whole cycle: the run has {cycles}, counted from 0");
        run.reject(key, allowed, Some("make `duration_s` longer, or `steady_from_cycle` smaller".into()));
    }
}

/// Whether the text is JSON, by its first characters. No TOML table header starts with `[{` or `[]`.
fn is_json(source: &Source) -> bool {
    let text = source.text().trim_start();
    text.starts_with('{') || text.strip_prefix('[').is_some_and(|rest| rest.trim_start().starts_with(['{', ']']))
}

/// Reads `initial`. Defaults: the structure starts at 0, or at the record's first base displacement; a second mass starts
/// with the structure; a particle starts `start_m` from the structure, as its table says if it `is_placed`.
fn read_initial(s: Option<&Section>, base_start_m: f64, (start_m, is_placed): (f64, bool)) -> Initial {
    let or = |quantity, absent: f64| s.and_then(|s| s.scalar(quantity)).unwrap_or(absent);
    let (x_m, v_m_per_s) = (or(&initial::X, base_start_m), or(&initial::V, 0.0));
    let y_m = or(&initial::Y, x_m + start_m);
    let read = Initial { x_m, v_m_per_s, y_m, u_m_per_s: or(&initial::U, v_m_per_s) };
    if let Some(s) = s {
        if is_placed && s.is_given(&initial::Y) {
            let help = Some("leave out `y_m`, or `start` and `start_m` of the particle".into());
            s.reject(initial::Y.name(), "the particle's table gives its start too", help);
        }
        s.finish();
    }
    read
}

/// Reads `run`. The duration defaults to that of the record.
pub(super) fn read_run(s: &Section, record_s: Option<f64>) -> Option<RunSpec> {
    let duration = match record_s {
        Some(length_s) if !s.is_given(&run::DURATION) => Some(length_s),
        _ => s.scalar(&run::DURATION),
    };
    let times = s.numbers_of(&run::SAMPLE_TIMES).unwrap_or_default();
    let cycle_s = s.scalar(&run::CYCLE);
    let steady_from = s.scalar(&run::STEADY_FROM);
    s.finish();
    let duration_s = duration?;
    for (i, time) in times.iter().enumerate() {
        let early = i > 0 && time.value < times[i - 1].value;
        if early || !(0.0..=duration_s * (1.0 + 1e-12)).contains(&time.value) {
            let allowed = format!("must be in rising order, from 0 to duration_s = {duration_s}");
            s.refuse(run::SAMPLE_TIMES.name(), &time.span, allowed, None);
            return None;
        }
    }
    Some(RunSpec {
        duration_s,
        sample_times_s: times.iter().map(|time| time.value).collect(),
        cycle_s,
        steady_from_cycle: steady_from.map(|first| first as u64),
    })
}
