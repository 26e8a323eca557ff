//! The keys of each kind of input file, as its parser declares them: for editors as a JSON Schema ([`schema`]), for people as a
//! reference ([`mod@reference`]), as types of Python ([`typed_dicts`]) and as a new file with comments ([`new_file`]).

pub mod fit;
pub mod modal_case;
pub mod new_file;
pub mod new_study;
mod new_sweep;
pub mod reference;
pub mod schema;
pub mod typed_dicts;

use crate::input::key::{MAX_WHOLE, Table};
use crate::setup::{PARTS, set_up_file};
use crate::{campaign, continuation, motion_record, optimise, setup, simulation, structure, study};

/// The kinds of input files with declared keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FileKind {
    /// A campaign, for `damprig run`.
    Campaign,
    /// A case, for `damprig simulate`.
    Case,
    /// A set-up file, which a campaign or a case names.
    SetUp,
    /// A study, for `damprig study`.
    Study,
    /// An optimisation, for `damprig optimise`.
    Optimisation,
    /// A continuation, for `damprig continue`.
    Continuation,
}

impl FileKind {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Campaign, Self::Case, Self::SetUp, Self::Study, Self::Optimisation, Self::Continuation];

    /// The word for it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Campaign => "campaign",
            Self::Case => "case",
            Self::SetUp => "set-up",
            Self::Study => "study",
            Self::Optimisation => "optimisation",
            Self::Continuation => "continuation",
        }
    }

    /// Folder of the shipped files of this kind, and the command that takes one; `None` of a set-up file.
    #[must_use]
    pub const fn shipped(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Campaign => Some(("campaigns", "damprig run")),
            Self::Case => Some(("cases", "damprig simulate")),
            Self::SetUp => None,
            Self::Study => Some(("studies", "damprig study run")),
            Self::Optimisation => Some(("optimisations", "damprig optimise")),
            Self::Continuation => Some(("continuations", "damprig continue")),
        }
    }

    /// What such a file is, in one line.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Campaign => "Campaign of damprig: set-ups and experiments, for `damprig run`",
            Self::Case => "Case of damprig: one simulation, for `damprig simulate`",
            Self::SetUp => "Set-up file of damprig, for the key `set_up_file` of a campaign or a case",
            Self::Study => "Study of damprig: a case over many values of its keys, for `damprig study`",
            Self::Optimisation => "Optimisation of damprig: the best values of a case's keys, for `damprig optimise`",
            Self::Continuation => {
                "Continuation of damprig: periodic orbits over a key of a case, for `damprig continue`"
            }
        }
    }

    /// The kind of a text, if it is TOML and every key at its top is one of that kind.
    #[must_use]
    pub fn of(text: &str) -> Option<Self> {
        let top = text.parse::<toml::Table>().ok().filter(|top| !top.is_empty())?;
        Self::ALL.into_iter().find(|kind| {
            let tables = kind.tables();
            top.keys().all(|key| {
                tables.iter().any(|table| {
                    table.path == key || (table.path.is_empty() && table.quantities.iter().any(|own| own.name() == key))
                })
            })
        })
    }

    /// Its tables. Tables with the same path and kind complete each other.
    #[must_use]
    pub fn tables(self) -> Vec<Table> {
        let parts = setup::TABLES.iter().filter(|table| !table.path.is_empty());
        match self {
            Self::Campaign => campaign::TABLES
                .iter()
                .chain(&structure::PLANT)
                .chain(&campaign::PLAYED)
                .chain(parts)
                .copied()
                .collect(),
            Self::Case => [simulation::TABLES, structure::TABLES, setup::TABLES, motion_record::TABLES].concat(),
            Self::SetUp => set_up_file::TABLES.iter().chain(parts).copied().collect(),
            Self::Study => study::TABLES.to_vec(),
            Self::Optimisation => optimise::TABLES.iter().chain(&study::SHARED).copied().collect(),
            Self::Continuation => continuation::TABLES.to_vec(),
        }
    }
}

/// The kinds of the table at a path, each with all its tables: those of all kinds first. One without a kind if it has no kinds.
fn kinds_at(tables: &[Table], path: &str) -> Vec<(Option<&'static str>, Vec<Table>)> {
    let at: Vec<Table> = tables.iter().filter(|table| table.path == path).copied().collect();
    let common: Vec<Table> = at.iter().filter(|table| table.kind.is_none()).copied().collect();
    let mut kinds: Vec<(Option<&str>, Vec<Table>)> = Vec::new();
    for table in at.iter().filter(|table| table.kind.is_some()) {
        match kinds.iter_mut().find(|(kind, _)| *kind == table.kind) {
            Some((_, tables)) => tables.push(*table),
            None => kinds.push((table.kind, common.iter().chain([table]).copied().collect())),
        }
    }
    if kinds.is_empty() { vec![(None, common)] } else { kinds }
}

/// The path of the table under a key of the table at `path`. Without one of its own there it is that of the top: a set-up of a campaign
/// has the tables of a set-up, an alternative has variables as its optimisation.
fn path_of(tables: &[Table], path: &str, key: &str) -> String {
    let below = format!("{path}.{key}");
    if tables.iter().any(|table| table.path == below) { below } else { key.to_string() }
}

/// Whether the table at a path is one of those that another file or the top of a campaign may complete, or inside one.
fn is_part(path: &str) -> bool {
    let first = path.split('.').next().unwrap_or_default();
    PARTS.iter().any(|part| part.name() == first)
}

/// A number as people and JSON write it: without a point if it is whole.
fn plain(number: f64) -> String {
    if number.fract() == 0.0 && number.abs() < MAX_WHOLE { format!("{number:.0}") } else { format!("{number:?}") }
}
