//! Reads a case with a structure of several degrees of freedom.

mod dampers;
mod start;

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use damprig_structures::{Body, HarmonicForce, Refused, SetUp, State};

use super::{MultiDegree, driver};
use crate::input::{Problem, Section};
use crate::setup::{BASE_AMPLITUDE, BaseAmplitude, set_up_keys};
use crate::simulation::Case;
use crate::simulation::excitation::CaseExcitation;
use crate::simulation::keys::{case, force_sine};
use crate::simulation::read_case::{base_amplitude, check_cycles, read_excitation, read_run};
use crate::structure::{DESCRIPTIONS, at_place, check_participation, description, description_of, read_structure};
use dampers::{Dampers, impact_damper, read_places};
use start::{BaseStart, ShapeStart, read_initial, start};

/// Reads the case, whose structure the key `key` describes; `None` after a problem has been reported.
pub fn read(root: &Section, key: &'static str, name: String) -> Option<Case> {
    refuse_others(root);
    // A structure that cannot be read is told alone, not with what is mounted on it.
    for quantity in [&description::OBSERVED, &set_up_keys::PARTICLE, &set_up_keys::FRICTION_DAMPER, &set_up_keys::TMD] {
        root.leave(quantity);
    }
    let stated_m = root.scalar(&BASE_AMPLITUDE);
    let (excitation, beside) = read_excitation(root, stated_m);
    let force = root.table_of(&case::FORCE, None);
    let run_section = root.table_of(&case::RUN, None);
    let record_s = match &excitation {
        Some(CaseExcitation::Recorded(record)) => Some(record.duration_s()),
        _ => None,
    };
    let run = run_section.as_ref().and_then(|s| read_run(s, record_s));
    let initial_section = root.table_of(&case::INITIAL, None);
    let initial = initial_section.as_ref().map_or(Some(ShapeStart::default()), read_initial);
    let x0_m = initial.and_then(|initial| initial.x_m).filter(|x0_m| *x0_m != 0.0);
    let base = excitation.as_ref().map_or(BaseAmplitude::Unread, |it| base_amplitude(it, stated_m, x0_m));
    let gravity = root.scalar(&set_up_keys::GRAVITY);
    let (described, mut places) = read_structure(root, key)?;
    let kind = described.kind();
    let mounted = read_places(root, &mut places);
    let observed = match root.is_given(&description::OBSERVED) {
        true => places.named(root, &description::OBSERVED)?,
        false => places.usual(),
    };
    let driven = match force.as_ref().filter(|force| force.is_given(&force_sine::PLACE)) {
        Some(force) => Some(places.named(force, &force_sine::PLACE)?),
        None => force.as_ref().map(|_| observed),
    };
    let (excitation, mounted) = (excitation?, mounted?);
    let modes = match described.modes(&places) {
        Ok(modes) => modes,
        Err(refused) => return refuse(root, key, &refused),
    };
    let structure = at_place(&modes, observed).or_else(|| {
        let names = places.names();
        refuse_place(root, &names[observed]);
        None
    })?;
    let lowest = modes.modes.iter().map(|mode| mode.angular_frequency_rad_per_s).fold(f64::INFINITY, f64::min);
    let highest = modes.modes.iter().map(|mode| mode.angular_frequency_rad_per_s).fold(0.0, f64::max);
    let (excitation, record) = match excitation.on(lowest) {
        CaseExcitation::ClosedForm(excitation) | CaseExcitation::FrequencyRatio(excitation) => (excitation, None),
        CaseExcitation::Recorded(record) => (Excitation::Fixed, Some(record)),
    };
    if record.is_some() || (excitation.moves_base() && excitation != Excitation::Fixed) {
        check_participation(root, Some("or let a `force` act in place of the base's motion"))?;
    }
    let beside =
        beside.zip(driven).map(|((amplitude_n, phase_rad), place)| HarmonicForce { place, amplitude_n, phase_rad });
    let set_up = SetUp {
        gravity_m_per_s2: gravity?,
        driven_place: driven.filter(|_| beside.is_none()),
        force_beside_base: beside,
        ..SetUp::bare(modes)
    };
    let mut read = Dampers { set_up, contacts: Vec::new(), starts_m: Vec::new() };
    let mut is_valid = true;
    for mounted in mounted {
        is_valid &= read.add(mounted, base, &places).is_some();
    }
    let (initial, run) = (initial?, run?);
    if !is_valid {
        return None;
    }
    let base = BaseStart::of(&excitation, record.as_ref());
    let (start, place_starts) = start(&read, base, initial, observed, initial_section.as_ref())?;
    let multi_degree = MultiDegree {
        key,
        kind,
        set_up: read.set_up,
        contacts: read.contacts,
        places: places.names(),
        on_beam: places.on_beam(),
        observed,
        start,
        place_starts,
    };
    let case = Case {
        name,
        set_up: multi_degree.as_one_degree(structure),
        contacts: [None; 2],
        many_particles: None,
        excitation,
        record,
        initial: multi_degree.initial(),
        run,
        multi_degree: Some(multi_degree),
    };
    if let Some(period_s) = case.drive_period_s() {
        warn_if_far_from_modes(root, 1.0 / period_s, [lowest, highest].map(|omega| omega / TAU));
    }
    // What is wrong with a key has been told at the key.
    if root.source().is_clean()
        && let Some(several) = &case.multi_degree
        && let Err(refused) = driver::check(&case, several)
    {
        return refuse(root, key, &refused);
    }
    if let Some(section) = &run_section {
        check_cycles(section, &case);
    }
    Some(case)
}

/// The case of one degree of freedom `case` as one with several places: with a force P sin(Ωt + φ), of P, N, and φ, rad, beside the sine of its
/// base, or with piezoelectric walls. `None` after a problem has been reported.
pub fn of_one_degree(root: &Section, case: &Case, beside: Option<(f64, f64)>) -> Option<MultiDegree> {
    let key = if beside.is_some() { case::FORCE.name() } else { set_up_keys::PARTICLE.name() };
    if case.many_particles.is_some() && beside.is_some() {
        root.source().report(Problem {
            title: "`force` beside a moving `base` is not available for this damper".into(),
            span: root.span_of(key),
            allowed: "spheres in a box follow a moving base or a force".into(),
            help: None,
        });
        return None;
    }
    let mut set_up = SetUp::from(&case.set_up);
    set_up.force_beside_base =
        beside.map(|(amplitude_n, phase_rad)| HarmonicForce { place: 0, amplitude_n, phase_rad });
    set_up.driven_place = (!case.excitation.moves_base()).then_some(0);
    for damper in &mut set_up.impact_dampers {
        *damper = impact_damper(damper.place, damper.particle, case.contacts);
    }
    let base = BaseStart::of(&case.excitation, case.record.as_ref()).base;
    let charges_c = set_up.at_rest(base).charges_c;
    let several = MultiDegree {
        key,
        kind: "one degree of freedom".into(),
        set_up,
        contacts: case.set_up.particle.iter().map(|_| case.contacts).collect(),
        places: vec![set_up_keys::STRUCTURE.name().into()],
        on_beam: None,
        observed: 0,
        start: State { charges_c, ..State::on_base(&case.set_up, &case.initial, base) },
        place_starts: vec![Body { y_m: case.initial.x_m, u_m_per_s: case.initial.v_m_per_s }],
    };
    match driver::check(case, &several) {
        Ok(()) => Some(several),
        Err(refused) => refuse(root, key, &refused),
    }
}

/// Refuses a second structure, and what goes only with a structure of one degree of freedom.
fn refuse_others(root: &Section) {
    let mut structures = DESCRIPTIONS.iter().chain([&&set_up_keys::STRUCTURE]).filter(|other| root.is_given(other));
    let Some(first) = structures.next().map(|description| description.name()) else { return };
    let others = structures.map(|other| (other.name(), "a case has one structure"));
    let of_one_degree = [
        (&case::MANY_PARTICLES, "spheres in a box are on a structure of one degree of freedom"),
        (&case::SET_UP_FILE, "a set-up file has a structure of one degree of freedom"),
    ];
    let of_one_degree = of_one_degree.into_iter().filter(|(other, _)| root.is_given(other));
    for (name, allowed) in others.chain(of_one_degree.map(|(other, allowed)| (other.name(), allowed))) {
        root.source().report(Problem {
            title: format!("`{first}` and `{name}` are both given"),
            span: root.span_of(name),
            allowed: allowed.into(),
            help: Some(format!("leave out `{first}` or `{name}`")),
        });
    }
}

/// A sine below this share of the lowest natural frequency, or above this multiple of the highest, is unusual.
const USUAL_SHARE: f64 = 1.0 / 30.0;
const USUAL_MULTIPLE: f64 = 2.0;

/// Warns of a sine that is far from all modes, whose lowest and highest frequencies are given.
fn warn_if_far_from_modes(root: &Section, drive_hz: f64, [lowest_hz, highest_hz]: [f64; 2]) {
    if (USUAL_SHARE * lowest_hz..=USUAL_MULTIPLE * highest_hz).contains(&drive_hz) {
        return;
    }
    let key = if root.is_given(&case::BASE) { case::BASE.name() } else { case::FORCE.name() };
    root.source().warn(Problem {
        title: format!("`{key}` drives at {drive_hz:.4} Hz, far from all modes"),
        span: root.span_of(key),
        allowed: format!("the structure has its modes from {lowest_hz:.4} Hz to {highest_hz:.4} Hz: it hardly moves, or modes that would are not in it"),
        help: Some("check the units of the structure; the case is simulated as it is".into()),
    });
}

/// Reports why a set-up is refused.
fn refuse<T>(root: &Section, key: &'static str, refused: &Refused) -> Option<T> {
    root.source().report(Problem {
        title: "this structure with its dampers cannot be simulated".into(),
        span: root.span_of(key),
        allowed: refused.to_string(),
        help: None,
    });
    None
}

/// Reports a place that is at rest in every mode.
fn refuse_place(root: &Section, place: &str) {
    root.source().report(Problem {
        title: format!("no mode moves the place {place:?}"),
        span: description_of(root).map_or(root.span(), |key| root.span_of(key)),
        allowed: "a damper, a force and the observed displacement are at places that the modes move".into(),
        help: Some("take another place, or more modes".into()),
    });
}
