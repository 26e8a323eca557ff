//! Reads a case with a structure of several degrees of freedom.

use std::path::Path;

use damprig_core::integrator::exact::Excitation;
use damprig_core::integrator::exact::time::Time;
use damprig_core::model::{Initial, SetUp as OneDegree, Structure, Wall};
use damprig_structures::{
    Beam, Body, Damping, FrictionJoint, ImpactDamper, Mode, Modes, Motion, Refused, SetUp, State, Storey, Support,
    TunedMass,
};

use super::places::Places;
use super::{MultiDegree, SecondMass, at_place};
use crate::input::key::Quantity;
use crate::input::section::Given;
use crate::input::{Problem, Section, Text};
use crate::motion_record::resolve;
use crate::setup::{
    self, BASE_AMPLITUDE, BaseAmplitude, Damper, SetUpSpec, friction_damper_keys, particle_keys, set_up_keys,
};
use crate::simulation::Case;
use crate::simulation::case::{base_amplitude, check_cycles, read_excitation, read_run};
use crate::simulation::excitation::CaseExcitation;
use crate::simulation::keys::{
    beam, beam_cantilever, beam_supported, case, force_sine, initial, matrices, mode, storey,
};

/// The keys that describe such a structure, one of which a case has in place of `structure`.
const DESCRIPTIONS: [&Quantity; 4] = [&case::STOREYS, &case::BEAM, &case::MODES, &case::MATRICES];

/// The key of the description of such a structure, if the case has one.
pub fn description(root: &Section) -> Option<&'static str> {
    DESCRIPTIONS.iter().find(|description| root.is_given(description)).map(|description| description.name())
}

/// A structure whose places are still being collected.
enum Described {
    Storeys(Vec<Storey>, Option<f64>),
    Beam(Box<Beam>),
    Modes(Modes),
    Matrices(Matrices),
}

/// Matrices by rows.
struct Matrices {
    mass_kg: Vec<f64>,
    stiffness_n_per_m: Vec<f64>,
    damping: Damping,
    influence: Vec<f64>,
}

impl Described {
    fn modes(self, places: &Places) -> Result<Modes, Refused> {
        match (self, places) {
            (Self::Storeys(storeys, None), _) => Modes::storeys(&storeys),
            (Self::Storeys(storeys, Some(ratio)), _) => Modes::frame(&storeys, &Damping::Ratio(ratio)),
            (Self::Beam(beam), Places::OnBeam { positions_m, .. }) => {
                Modes::beam(&Beam { places_m: positions_m.clone(), ..*beam })
            }
            (Self::Beam(beam), Places::Named(_)) => Modes::beam(&beam),
            (Self::Modes(modes), _) => Ok(modes),
            (Self::Matrices(of), _) => {
                Modes::from_matrices(&of.mass_kg, &of.stiffness_n_per_m, &of.damping, &of.influence)
            }
        }
    }

    fn kind(&self) -> String {
        match self {
            Self::Storeys(storeys, _) => format!("frame of {} storeys", storeys.len()),
            Self::Beam(beam) => {
                let held = if beam.support == Support::Cantilever { "cantilever" } else { "simply supported beam" };
                format!("{held} of {} m", beam.length_m)
            }
            Self::Modes(modes) => format!("{} stated modes", modes.modes.len()),
            Self::Matrices(of) => format!("matrices of {0} × {0}", of.influence.len()),
        }
    }
}

/// A damper's table with its places.
struct Mounted<'a> {
    table: Section<'a>,
    damper: Damper,
    place: usize,
    other: Option<usize>,
}

/// Reads the case; `None` after a problem has been reported.
pub fn read(root: &Section, name: String) -> Option<Case> {
    refuse_others(root);
    // A structure that cannot be read is told alone, not with what is mounted on it.
    for quantity in [&case::OBSERVED, &set_up_keys::PARTICLE, &set_up_keys::FRICTION_DAMPER, &set_up_keys::TMD] {
        root.leave(quantity);
    }
    let stated_m = root.scalar(&BASE_AMPLITUDE);
    let excitation = read_excitation(root, stated_m);
    let force = root.table_of(&case::FORCE, None);
    let run_section = root.table_of(&case::RUN, None);
    let run = run_section.as_ref().and_then(|s| read_run(s, None));
    let initial_section = root.table_of(&case::INITIAL, None);
    let initial = initial_section.as_ref().map_or(Some(Start::default()), read_initial);
    let x0_m = initial.map(|initial| initial.x_m).filter(|x0_m| *x0_m != 0.0);
    let base = excitation.as_ref().map_or(BaseAmplitude::Unread, |it| base_amplitude(it, stated_m, x0_m));
    let gravity = root.scalar(&set_up_keys::GRAVITY);
    let (described, mut places) = read_structure(root)?;
    let kind = described.kind();
    let mounted = read_places(root, &mut places);
    let observed = match root.is_given(&case::OBSERVED) {
        true => places.named(root, &case::OBSERVED)?,
        false => places.usual(),
    };
    let driven = match force.as_ref().filter(|force| force.is_given(&force_sine::PLACE)) {
        Some(force) => Some(places.named(force, &force_sine::PLACE)?),
        None => force.as_ref().map(|_| observed),
    };
    let (excitation, mounted) = (excitation?, mounted?);
    let modes = match described.modes(&places) {
        Ok(modes) => modes,
        Err(refused) => return refuse(root, &refused),
    };
    let structure = at_place(&modes, observed).or_else(|| {
        let names = places.names();
        refuse_place(root, &names[observed]);
        None
    })?;
    if matches!(excitation, CaseExcitation::Recorded(_)) {
        root.reject(
            case::BASE.name(),
            "a structure with several places needs a base or a force in closed form",
            Some("take a sine or a pulse".into()),
        );
        return None;
    }
    let lowest = modes.modes.iter().map(|mode| mode.angular_frequency_rad_per_s).fold(f64::INFINITY, f64::min);
    let excitation = match excitation.on(lowest) {
        CaseExcitation::ClosedForm(excitation) | CaseExcitation::FrequencyRatio(excitation) => excitation,
        CaseExcitation::Recorded(_) => return None,
    };
    if excitation.moves_base() && excitation != Excitation::Fixed {
        check_participation(root)?;
    }
    let mut read = Dampers {
        set_up: SetUp { gravity_m_per_s2: gravity?, driven_place: driven, ..SetUp::bare(modes) },
        starts_m: Vec::new(),
    };
    let mut is_sound = true;
    for mounted in mounted {
        is_sound &= read.add(mounted, base, &places).is_some();
    }
    let (initial, run) = (initial?, run?);
    if !is_sound {
        return None;
    }
    let (start, place_starts) = start(&read, &excitation, initial, observed, initial_section.as_ref())?;
    if let Err(refused) = Motion::new(&read.set_up, &excitation, &start) {
        return refuse(root, &refused);
    }
    let multi_degree = MultiDegree {
        key: description(root)?,
        kind,
        set_up: read.set_up,
        places: places.names(),
        observed,
        start,
        place_starts,
    };
    let case = Case {
        name,
        set_up: as_one_degree(&multi_degree, structure),
        contacts: [None; 2],
        many_particles: None,
        excitation,
        record: None,
        initial: initial_of(&multi_degree),
        run,
        multi_degree: Some(multi_degree),
    };
    if let Some(section) = &run_section {
        check_cycles(section, &case);
    }
    Some(case)
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

/// Reports why a set-up is refused.
fn refuse<T>(root: &Section, refused: &Refused) -> Option<T> {
    root.source().report(Problem {
        title: "this structure with its dampers cannot be simulated".into(),
        span: description(root).map_or(root.span(), |key| root.span_of(key)),
        allowed: refused.to_string(),
        help: None,
    });
    None
}

fn refuse_place(root: &Section, place: &str) {
    root.source().report(Problem {
        title: format!("no mode moves the place {place:?}"),
        span: description(root).map_or(root.span(), |key| root.span_of(key)),
        allowed: "a damper, a force and the observed displacement are at places that the modes move".into(),
        help: Some("take another place, or more modes".into()),
    });
}

fn read_structure(root: &Section) -> Option<(Described, Places)> {
    let modal_damping = root.scalar(&case::MODAL_DAMPING);
    let names = root.texts_of(&case::PLACES);
    match description(root)? {
        "storey" => read_storeys(root, modal_damping),
        "beam" => read_beam(root),
        "mode" => read_modes(root, names?),
        _ => read_matrices(root, names?),
    }
}

fn read_storeys(root: &Section, modal_damping: Option<f64>) -> Option<(Described, Places)> {
    let mut storeys = Vec::new();
    let mut names: Vec<String> = Vec::new();
    for (n, s) in root.tables_of(&case::STOREYS).iter().enumerate() {
        let name = s.text_of(&storey::NAME);
        let (mass, stiffness) = (s.scalar(&storey::MASS), s.scalar(&storey::STIFFNESS));
        let damping = s.scalar(&storey::DAMPING);
        if modal_damping.is_some() && s.is_given(&storey::DAMPING) {
            let help = Some("leave out one of them".into());
            s.reject(storey::DAMPING.name(), format!("`{}` is given too", case::MODAL_DAMPING.name()), help);
        }
        s.finish();
        let place = name.as_ref().map_or_else(|| format!("floor {}", n + 1), |name| name.value.clone());
        if names.contains(&place) {
            let help = Some("give each floor a name of its own".into());
            match name {
                Some(name) => s.refuse(storey::NAME.name(), &name.span, "must be the name of one floor", help),
                None => s.reject(storey::NAME.name(), format!("another floor has the name {place:?}"), help),
            }
        }
        names.push(place);
        storeys.push(mass.zip(stiffness).zip(damping).map(|((mass_kg, stiffness_n_per_m), damping_n_s_per_m)| {
            Storey { mass_kg, stiffness_n_per_m, damping_n_s_per_m }
        }));
    }
    if storeys.is_empty() {
        root.reject(case::STOREYS.name(), "a frame has at least one storey", None);
        return None;
    }
    let storeys: Option<Vec<Storey>> = storeys.into_iter().collect();
    Some((Described::Storeys(storeys?, modal_damping), Places::Named(names)))
}

fn read_beam(root: &Section) -> Option<(Described, Places)> {
    let s = root.table_of(&case::BEAM, None)?;
    let support = match s.variant(&[beam_cantilever::TABLE, beam_supported::TABLE])? {
        0 => Support::Cantilever,
        _ => Support::SimplySupported,
    };
    let tip_mass = if support == Support::Cantilever { s.scalar(&beam_cantilever::TIP_MASS) } else { Some(0.0) };
    let length = s.scalar(&beam::LENGTH);
    let product = |(spelling, first): (usize, f64), second: Option<f64>| match spelling {
        0 => Some(first),
        _ => Some(first * second?),
    };
    let second_moment = s.scalar(&beam::SECOND_MOMENT);
    let stiffness = s.one_of(&beam::STIFFNESS).and_then(|stiffness| product(stiffness, second_moment));
    let area = s.scalar(&beam::AREA);
    let mass = s.one_of(&beam::MASS).and_then(|mass| product(mass, area));
    let (modes, damping) = (s.scalar(&beam::MODES), s.scalar(&beam::DAMPING));
    s.finish();
    let length_m = length?;
    let beam = Beam {
        support,
        bending_stiffness_n_m2: stiffness?,
        mass_per_length_kg_per_m: mass?,
        length_m,
        tip_mass_kg: tip_mass?,
        modes: modes? as usize,
        damping_ratio: damping?,
        places_m: Vec::new(),
    };
    Some((Described::Beam(Box::new(beam)), Places::OnBeam { support, length_m, positions_m: Vec::new() }))
}

fn read_modes(root: &Section, names: Vec<Text>) -> Option<(Described, Places)> {
    let tables = root.tables_of(&case::MODES);
    let count = names.len();
    let read = |s: &Section| {
        let frequency = s.one_of(&mode::FREQUENCY);
        let damping = s.scalar(&mode::DAMPING);
        let shape = s.numbers_of(&mode::SHAPE);
        let participation = s.scalar(&mode::PARTICIPATION).unwrap_or(0.0);
        s.finish();
        let shape: Vec<f64> = shape?.iter().map(|phi| phi.value).collect();
        if count != shape.len() {
            let allowed = format!("must have a number for each of the {count} `places`; it has {}", shape.len());
            s.reject(mode::SHAPE.name(), allowed, None);
            return None;
        }
        let angular_frequency_rad_per_s = match frequency? {
            (0, frequency_hz) => std::f64::consts::TAU * frequency_hz,
            (_, omega) => omega,
        };
        Some(Mode { angular_frequency_rad_per_s, damping_ratio: damping?, shape, participation })
    };
    let modes: Vec<Option<Mode>> = tables.iter().map(read).collect();
    let names = names_of(root, names)?;
    let modes: Option<Vec<Mode>> = modes.into_iter().collect();
    let modes = Modes { modes: modes?, influence: vec![1.0; names.len()], coupling_per_s: Vec::new() };
    Some((Described::Modes(modes), Places::Named(names)))
}

/// The names of places, each of one.
fn names_of(root: &Section, names: Vec<Text>) -> Option<Vec<String>> {
    if names.is_empty() {
        root.reject(case::PLACES.name(), "must name at least one place", None);
        return None;
    }
    for (n, name) in names.iter().enumerate() {
        if names[..n].iter().any(|other| other.value == name.value) {
            root.refuse(case::PLACES.name(), &name.span, "must be the name of one place", None);
            return None;
        }
    }
    Some(names.into_iter().map(|name| name.value).collect())
}

fn read_matrices(root: &Section, names: Vec<Text>) -> Option<(Described, Places)> {
    let s = root.table_of(&case::MATRICES, None)?;
    let count = names.len();
    let file = |name: Text, key: &str| matrix_of(&s, key, &name, count);
    let mass = s.text_of(&matrices::MASS).and_then(|name| file(name, matrices::MASS.name()));
    let stiffness = s.text_of(&matrices::STIFFNESS).and_then(|name| file(name, matrices::STIFFNESS.name()));
    let stiffness_s = s.scalar(&matrices::STIFFNESS_DAMPING);
    let damping = match s.given(&matrices::DAMPING) {
        Some((0, Given::Number(ratio))) => Some(Damping::Ratio(ratio)),
        Some((_, Given::Number(mass_per_s))) => {
            stiffness_s.map(|stiffness_s| Damping::Rayleigh { mass_per_s, stiffness_s })
        }
        Some((_, Given::Text(name))) => file(name, matrices::DAMPING.keys[2].name).map(Damping::Matrix),
        _ => None,
    };
    let influence = match s.is_given(&matrices::INFLUENCE) {
        true => s.numbers_of(&matrices::INFLUENCE).map(|list| list.iter().map(|iota| iota.value).collect::<Vec<f64>>()),
        false => Some(vec![1.0; count]),
    };
    s.finish();
    let influence = influence?;
    if influence.len() != count {
        let allowed = format!("must have a number for each of the {count} `places`; it has {}", influence.len());
        s.reject(matrices::INFLUENCE.name(), allowed, None);
        return None;
    }
    let read = Matrices { mass_kg: mass?, stiffness_n_per_m: stiffness?, damping: damping?, influence };
    Some((Described::Matrices(read), Places::Named(names_of(root, names)?)))
}

/// A square matrix by rows from a file of comma-separated numbers; `None` after a problem has been reported.
fn matrix_of(s: &Section, key: &str, name: &Text, count: usize) -> Option<Vec<f64>> {
    let refuse = |allowed: String| {
        s.refuse(key, &name.span, allowed, None);
        None
    };
    let path = resolve(Path::new(s.source().name()), &name.value);
    let text = match s.source().read_named(&path) {
        Ok(file) => file.text().to_string(),
        Err(refusal) => return refuse(refusal.to_string().replace('\n', ";")),
    };
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).trim(csv::Trim::All).from_reader(text.as_bytes());
    let mut rows = Vec::new();
    let mut lines = 0;
    for (line, record) in (1..).zip(reader.records()) {
        let Ok(record) = record else { return refuse(format!("line {line} of the file is no list of numbers")) };
        lines = line;
        if record.len() != count {
            return refuse(format!(
                "line {line} of the file must have {count} numbers, one for each of `places`; it has {}",
                record.len()
            ));
        }
        for (column, field) in (1..).zip(&record) {
            match field.parse::<f64>() {
                Ok(number) if number.is_finite() => rows.push(number),
                _ => {
                    return refuse(format!(
                        "line {line}, column {column} of the file is {field:?}, which is no finite number"
                    ));
                }
            }
        }
    }
    if lines != count {
        return refuse(format!("the file must have {count} lines, one for each of `places`; it has {lines}"));
    }
    Some(rows)
}

/// The participation of every mode is needed where the base moves.
fn check_participation(root: &Section) -> Option<()> {
    let lacking: Vec<Section> =
        root.tables_of(&case::MODES).into_iter().filter(|s| !s.is_given(&mode::PARTICIPATION)).collect();
    for s in &lacking {
        let key = mode::PARTICIPATION.name();
        root.source().report(Problem {
            title: format!("`{}` is missing", s.full(key)),
            span: s.span(),
            allowed: mode::PARTICIPATION.keys[0].doc.into(),
            help: Some("or let a `force` act in place of the base's motion".into()),
        });
    }
    lacking.is_empty().then_some(())
}

/// The dampers' tables with their places; `None` after a problem has been reported.
fn read_places<'a>(root: &Section<'a>, places: &mut Places) -> Option<Vec<Mounted<'a>>> {
    let mut mounted = Vec::new();
    let mut is_sound = true;
    for (quantity, damper) in [
        (&set_up_keys::PARTICLE, Damper::Particle),
        (&set_up_keys::FRICTION_DAMPER, Damper::Friction),
        (&set_up_keys::TMD, Damper::Tmd),
    ] {
        for table in root.tables_of(quantity) {
            if !table.is_given(&particle_keys::PLACE) {
                let keys = particle_keys::PLACE.keys;
                let name = if matches!(places, Places::OnBeam { .. }) { keys[1].name } else { keys[0].name };
                root.source().report(Problem {
                    title: format!("`{}` is missing", table.full(name)),
                    span: table.span(),
                    allowed: "the structure has several places: say where the damper is mounted".into(),
                    help: None,
                });
            }
            let place = places.named(&table, &particle_keys::PLACE);
            let other = match damper {
                Damper::Friction if table.is_given(&friction_damper_keys::OTHER_PLACE) => {
                    Some(other_place(&table, places, place))
                }
                _ => None,
            };
            match (place, other) {
                (Some(place), None) => mounted.push(Mounted { table, damper, place, other: None }),
                (Some(place), Some(Some(other))) => mounted.push(Mounted { table, damper, place, other: Some(other) }),
                _ => is_sound = false,
            }
        }
    }
    is_sound.then_some(mounted)
}

/// The place of a friction damper's other end; `None` after a problem has been reported.
fn other_place(s: &Section, places: &mut Places, place: Option<usize>) -> Option<usize> {
    let other = places.named(s, &friction_damper_keys::OTHER_PLACE)?;
    if place == Some(other) {
        let key = s.written(&friction_damper_keys::OTHER_PLACE)?.name;
        s.reject(key, "must be another place than that of the damper", Some("leave it out for the base".into()));
        return None;
    }
    Some(other)
}

/// A set-up whose dampers are being read, with y − x of each particle at the start.
struct Dampers {
    set_up: SetUp,
    starts_m: Vec<f64>,
}

impl Dampers {
    /// Reads a damper and mounts it; `None` after a problem has been reported.
    fn add(&mut self, mounted: Mounted, base: BaseAmplitude, places: &Places) -> Option<()> {
        let Mounted { table: s, damper, place, other } = mounted;
        let Some(structure) = at_place(&self.set_up.structure, place) else {
            refuse_place(&s, &places.names()[place]);
            return None;
        };
        // Of a force, P/k with the k at the damper's place.
        let base = match base {
            BaseAmplitude::Force(force_n) => BaseAmplitude::Is(force_n / structure.stiffness_n_per_m),
            other => other,
        };
        let z_m = if let BaseAmplitude::Is(z_m) = base { z_m } else { 0.0 };
        let spec = setup::read_damper(&s, damper, structure, base)?;
        if spec.is_start_unknown() {
            let help = "take one of the walls, or \"centre\"";
            s.reject("start", "\"unknown\" is for campaigns", Some(help.into()));
            return None;
        }
        let read = spec.at(z_m);
        if let Some(particle) = read.particle {
            if let Some(why) = left_out(&spec, &particle.walls()) {
                s.reject("wall", why, None);
                return None;
            }
            self.set_up.impact_dampers.push(ImpactDamper { place, particle });
            self.starts_m.push(spec.particle_start_m(z_m));
        }
        // Without a force there is no damper.
        if let Some(damper) = read.friction_damper.filter(|damper| damper.force_n > 0.0) {
            self.set_up.friction_dampers.push(FrictionJoint { place, other, damper });
        }
        self.set_up.tuned_masses.extend(read.tmd.map(|tmd| TunedMass { place, tmd }));
        Some(())
    }
}

/// What of walls a structure of several degrees of freedom does not follow.
fn left_out(spec: &SetUpSpec, walls: &[Wall; 2]) -> Option<&'static str> {
    if walls.iter().any(|wall| wall.hertz().is_some()) {
        return Some("Hertz contact is not available on a structure with several places; state the restitution");
    }
    let is_stated = spec.contacts().iter().any(Option::is_some);
    is_stated.then_some(
        "the force of a hard wall is not available on a structure with several places; leave its contact out",
    )
}

/// x and x′ at the observed place in the shape of a mode.
#[derive(Clone, Copy, Debug, Default)]
struct Start {
    x_m: f64,
    v_m_per_s: f64,
    /// From 0.
    mode: usize,
}

fn read_initial(s: &Section) -> Option<Start> {
    for quantity in [&initial::Y, &initial::U] {
        if s.is_given(quantity) {
            let help = "give `start` or `start_m` of the particle";
            s.reject(quantity.name(), "is for a structure with one place", Some(help.into()));
        }
    }
    let x_m = if s.is_given(&initial::X) { s.scalar(&initial::X) } else { Some(0.0) };
    let v_m_per_s = s.scalar(&initial::V);
    let mode = if s.is_given(&initial::MODE) { s.scalar(&initial::MODE) } else { Some(1.0) };
    s.finish();
    Some(Start { x_m: x_m?, v_m_per_s: v_m_per_s?, mode: mode? as usize - 1 })
}

/// The state at the start, and the displacement and velocity of each place.
fn start(
    read: &Dampers,
    excitation: &Excitation,
    initial: Start,
    observed: usize,
    section: Option<&Section>,
) -> Option<(State, Vec<Body>)> {
    let set_up = &read.set_up;
    let mut state = set_up.at_rest(excitation);
    let modes = &set_up.structure.modes;
    let mut order: Vec<usize> = (0..modes.len()).collect();
    order.sort_by(|&a, &b| modes[a].angular_frequency_rad_per_s.total_cmp(&modes[b].angular_frequency_rad_per_s));
    if initial.x_m != 0.0 || initial.v_m_per_s != 0.0 {
        let shape = order.get(initial.mode).map(|&mode| (mode, modes[mode].shape[observed]));
        let Some((mode, phi)) = shape.filter(|(_, phi)| *phi != 0.0) else {
            let allowed = match shape {
                Some(_) => "must be a mode that moves the observed place".into(),
                None => format!("must be at most {}, the number of modes", modes.len()),
            };
            section?.reject(initial::MODE.name(), allowed, None);
            return None;
        };
        state.modal[mode] += initial.x_m / phi;
        state.modal_rate[mode] += initial.v_m_per_s / phi;
    }
    let wave = excitation.wave(Time::default());
    let share = if excitation.moves_base() { 1.0 } else { 0.0 };
    let base = [share * (wave.offset + wave.sine), share * excitation.angular_frequency_rad_per_s() * wave.cosine];
    let of = |coordinates: &[f64], base: f64| -> Vec<f64> {
        let sum = |place: usize| modes.iter().zip(coordinates).map(|(mode, q)| mode.shape[place] * q).sum::<f64>();
        set_up.structure.influence.iter().enumerate().map(|(place, iota)| sum(place) + iota * base).collect()
    };
    let (x, v) = (of(&state.modal, base[0]), of(&state.modal_rate, base[1]));
    let places: Vec<Body> = x.into_iter().zip(v).map(|(y_m, u_m_per_s)| Body { y_m, u_m_per_s }).collect();
    let body = |place: usize, start_m: f64| Body { y_m: places[place].y_m + start_m, ..places[place] };
    state.particles =
        set_up.impact_dampers.iter().zip(&read.starts_m).map(|(of, start_m)| body(of.place, *start_m)).collect();
    state.tuned_masses = set_up.tuned_masses.iter().map(|of| body(of.place, 0.0)).collect();
    Some((state, places))
}

/// What tables and figures of one degree of freedom show: the lowest mode at the observed place and the dampers that are there.
fn as_one_degree(of: &MultiDegree, structure: Structure) -> OneDegree {
    let set_up = &of.set_up;
    let particle = set_up.impact_dampers.first().filter(|_| of.second_mass() == Some(SecondMass::Particle));
    let tuned = set_up.tuned_masses.first().filter(|_| of.second_mass() == Some(SecondMass::Tuned));
    let friction = set_up.friction_dampers.first().filter(|joint| joint.place == of.observed && joint.other.is_none());
    OneDegree {
        particle: particle.map(|damper| damper.particle),
        friction_damper: friction.map(|joint| joint.damper),
        tmd: tuned.map(|tuned| tuned.tmd),
        gravity_m_per_s2: set_up.gravity_m_per_s2,
        ..OneDegree::bare(structure)
    }
}

fn initial_of(of: &MultiDegree) -> Initial {
    let Body { y_m: x_m, u_m_per_s: v_m_per_s } = of.place_starts[of.observed];
    let second = match of.second_mass() {
        Some(SecondMass::Particle) => of.start.particles.first(),
        Some(SecondMass::Tuned) => of.start.tuned_masses.first(),
        None => None,
    };
    let body = second.copied().unwrap_or(Body { y_m: x_m, u_m_per_s: v_m_per_s });
    Initial { x_m, v_m_per_s, y_m: body.y_m, u_m_per_s: body.u_m_per_s }
}
