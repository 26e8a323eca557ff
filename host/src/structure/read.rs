//! Reads what describes the structure, and its places: storeys, a beam, modes or matrices.

use damprig_structures::{Beam, Damping, MAX_MODES, Mode, Modes, Refused, Storey, Support};

use super::OnBeam;
use super::keys::{beam, beam_cantilever, beam_supported, description, matrices, mode, storey};
use super::matrix_file::matrix_of;
use super::places::Places;
use crate::input::section::Given;
use crate::input::{Problem, Section, Text};

/// A structure whose places are still being collected.
pub enum Described {
    /// Storeys, and ζ of every mode where it is not that of the storeys.
    Storeys(Vec<Storey>, Option<f64>),
    /// A beam without places.
    Beam(Box<Beam>),
    /// Modes as stated.
    Modes(Modes),
    /// Matrices from files.
    Matrices(Matrices),
}

/// Matrices by rows.
pub struct Matrices {
    mass_kg: Vec<f64>,
    stiffness_n_per_m: Vec<f64>,
    damping: Damping,
    influence: Vec<f64>,
}

impl Described {
    /// Its modes at these places.
    ///
    /// # Errors
    /// What is no structure.
    pub fn modes(&self, places: &Places) -> Result<Modes, Refused> {
        match (self, places) {
            (Self::Storeys(storeys, None), _) => Modes::storeys(storeys),
            (Self::Storeys(storeys, Some(ratio)), _) => Modes::frame(storeys, &Damping::Ratio(*ratio)),
            (Self::Beam(beam), Places::OnBeam(OnBeam { positions_m, .. })) => {
                Modes::beam(&Beam { places_m: positions_m.clone(), ..Beam::clone(beam) })
            }
            (Self::Beam(beam), Places::Named(_)) => Modes::beam(beam),
            (Self::Modes(modes), _) => Ok(modes.clone()),
            (Self::Matrices(of), _) => {
                Modes::from_matrices(&of.mass_kg, &of.stiffness_n_per_m, &of.damping, &of.influence)
            }
        }
    }

    /// What it is, in a few words.
    pub fn kind(&self) -> String {
        match self {
            Self::Storeys(storeys, _) => format!("frame of {} storeys", storeys.len()),
            Self::Beam(beam) => {
                let held = if beam.support == Support::Cantilever { "cantilever" } else { "simply supported beam" };
                format!("{held} of {} m", beam.length_m)
            }
            Self::Modes(modes) => match modes.modes.len() {
                1 => "stated mode".into(),
                count => format!("structure of {count} stated modes"),
            },
            Self::Matrices(of) => format!("matrices of {0} × {0}", of.influence.len()),
        }
    }
}

/// Reads the structure; `key` is that of its description. `None` after a problem has been reported.
pub fn read_structure(root: &Section, key: &str) -> Option<(Described, Places)> {
    let modal_damping = root.scalar(&description::MODAL_DAMPING);
    let names = root.texts_of(&description::PLACES);
    match key {
        "storey" => read_storeys(root, modal_damping),
        "beam" => read_beam(root),
        "mode" => read_modes(root, names?),
        _ => read_matrices(root, names?),
    }
}

fn read_storeys(root: &Section, modal_damping: Option<f64>) -> Option<(Described, Places)> {
    let mut storeys = Vec::new();
    let mut names: Vec<String> = Vec::new();
    for (n, s) in root.tables_of(&description::STOREYS).iter().enumerate() {
        let name = s.text_of(&storey::NAME);
        let (mass, stiffness) = (s.scalar(&storey::MASS), s.scalar(&storey::STIFFNESS));
        let damping = s.scalar(&storey::DAMPING);
        if modal_damping.is_some() && s.is_given(&storey::DAMPING) {
            let help = Some("leave out one of them".into());
            s.reject(storey::DAMPING.name(), format!("`{}` is given too", description::MODAL_DAMPING.name()), help);
        }
        s.finish();
        let place = name.as_ref().map_or_else(|| format!("floor {}", n + 1), |name| name.value.clone());
        if names.contains(&place) {
            let help = Some("give each floor a name of its own".into());
            match name {
                Some(name) => s.refuse(storey::NAME.name(), &name.span, "is the name of another floor too", help),
                None => s.reject(storey::NAME.name(), format!("another floor has the name {place:?}"), help),
            }
        }
        names.push(place);
        storeys.push(mass.zip(stiffness).zip(damping).map(|((mass_kg, stiffness_n_per_m), damping_n_s_per_m)| {
            Storey { mass_kg, stiffness_n_per_m, damping_n_s_per_m }
        }));
    }
    if storeys.is_empty() {
        root.reject(description::STOREYS.name(), "a frame has at least one storey", None);
        return None;
    }
    few_enough(root, description::STOREYS.name(), storeys.len())?;
    let storeys: Option<Vec<Storey>> = storeys.into_iter().collect();
    Some((Described::Storeys(storeys?, modal_damping), Places::Named(names)))
}

fn read_beam(root: &Section) -> Option<(Described, Places)> {
    let s = root.table_of(&description::BEAM, None)?;
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
    Some((Described::Beam(Box::new(beam)), Places::OnBeam(OnBeam { support, length_m, positions_m: Vec::new() })))
}

fn read_modes(root: &Section, names: Vec<Text>) -> Option<(Described, Places)> {
    let tables = root.tables_of(&description::MODES);
    few_enough(root, description::MODES.name(), tables.len())?;
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

/// Refuses more than [`MAX_MODES`].
fn few_enough(root: &Section, key: &'static str, count: usize) -> Option<()> {
    if count > MAX_MODES {
        let help = Some("take the lowest modes only, as `[[mode]]`".into());
        root.reject(key, format!("there are {count}; at most {MAX_MODES} are followed"), help);
        return None;
    }
    Some(())
}

/// The names of places, each of one.
fn names_of(root: &Section, names: Vec<Text>) -> Option<Vec<String>> {
    if names.is_empty() {
        root.reject(description::PLACES.name(), "must name at least one place", None);
        return None;
    }
    for (n, name) in names.iter().enumerate() {
        if names[..n].iter().any(|other| other.value == name.value) {
            let help = Some("give each place a name of its own".into());
            root.refuse(description::PLACES.name(), &name.span, "is the name of another place too", help);
            return None;
        }
    }
    Some(names.into_iter().map(|name| name.value).collect())
}

fn read_matrices(root: &Section, names: Vec<Text>) -> Option<(Described, Places)> {
    let s = root.table_of(&description::MATRICES, None)?;
    let count = names.len();
    few_enough(root, description::PLACES.name(), count)?;
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
    let names = names_of(root, names)?;
    let described = Described::Matrices(read);
    let places = Places::Named(names);
    if let Err(refused) = described.modes(&places)
        && let Some((key, help)) = wrong_matrix(&refused)
    {
        s.reject(key, refused.to_string(), Some(help.into()));
        return None;
    }
    Some((described, places))
}

/// The key of the matrix that is no one of a structure, and what to do; `None` where it is no matrix.
fn wrong_matrix(refused: &Refused) -> Option<(&'static str, &'static str)> {
    let of = |what: &str| match what {
        "the mass matrix" => matrices::MASS.name(),
        "the stiffness matrix" => matrices::STIFFNESS.name(),
        _ => matrices::DAMPING.keys[2].name,
    };
    Some(match refused {
        Refused::NotSymmetric { what, .. } => (of(what), "correct the entry; of a measured matrix take (A + Aᵀ)/2"),
        Refused::NotDefinite(what) => (of(what), "condense the places without mass, or give them one"),
        Refused::Unsupported => (matrices::STIFFNESS.name(), "hold every part by a spring to the base"),
        Refused::NegativeDamping => {
            (matrices::DAMPING.keys[2].name, "correct the matrix; of a measured one take (C + Cᵀ)/2")
        }
        _ => return None,
    })
}

/// The participation of every mode is needed where the base moves; `help` names another way.
pub fn check_participation(root: &Section, help: Option<&str>) -> Option<()> {
    let lacking: Vec<Section> =
        root.tables_of(&description::MODES).into_iter().filter(|s| !s.is_given(&mode::PARTICIPATION)).collect();
    for s in &lacking {
        let key = mode::PARTICIPATION.name();
        root.source().report(Problem {
            title: format!("`{}` is missing", s.full(key)),
            span: s.span(),
            allowed: mode::PARTICIPATION.keys[0].doc.into(),
            help: help.map(str::to_string),
        });
    }
    lacking.is_empty().then_some(())
}
