//! The figures and tables of the source document, from `items.toml`: what each shows, how it is read, and what computes it.

use std::path::{Path, PathBuf};

use super::keys::{METHODS, bifurcation as sweep_keys, item as item_keys, items as items_keys, part as part_keys};
use damprig::failure::Failure;
use damprig::input::section::{FreeKey, FreeValue, Given, Text};
use damprig::input::{Problem, Section, Source, listed, near};
use damprig::simulation::case::default_name;
use damprig::study::bifurcation::SweepAxis;

/// Name of the file with the items.
pub const ITEMS: &str = "items.toml";

/// All items.
#[derive(Clone, Debug, PartialEq)]
pub struct Catalogue {
    /// Folder of `items.toml`; the files that it names are relative to it.
    pub folder: PathBuf,
    /// In the order of the file.
    pub items: Vec<Item>,
}

/// A figure or table.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Name in commands: `table-3-4`.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// Where its numbers come from.
    pub kind: ItemKind,
    /// Why it is of this kind.
    pub reason: Option<String>,
    /// How the main parts read the document where it leaves something open.
    pub reading: Option<String>,
    /// What is computed, in order.
    pub parts: Vec<Part>,
}

/// Where the numbers of an item come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ItemKind {
    /// Computed from a model.
    Computed,
    /// Measured on the virtual rig.
    VirtualRig,
    /// Known only as a measurement of the document; not computed.
    MeasuredOnly,
}

impl ItemKind {
    const ALL: [Self; 3] = [Self::Computed, Self::VirtualRig, Self::MeasuredOnly];

    /// As `items.toml` writes it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Computed => "computed",
            Self::VirtualRig => "virtual_rig",
            Self::MeasuredOnly => "measured_only",
        }
    }

    /// In words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Computed => "computed",
            Self::VirtualRig => "virtual rig",
            Self::MeasuredOnly => "measured only",
        }
    }
}

/// A part of an item.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Name of its folder.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// Another reading of the document, which shows how the result moves; `--quick` leaves it out.
    pub is_other_reading: bool,
    /// Rows of its table that stand for printed ones: `KEY.PRINTED` and the key's value here.
    pub read_as: Vec<FreeKey>,
    /// What computes it.
    pub work: Work,
}

impl Part {
    /// The row of this part's table that stands for a printed row.
    #[must_use]
    pub fn row_for(&self, printed: &[FreeKey]) -> Vec<FreeKey> {
        let read = |key: &FreeKey| {
            let FreeValue::Number(number) = key.value else { return key.clone() };
            let place = format!("{}.{number}", key.key);
            let read = self.read_as.iter().find(|read| read.key == place);
            FreeKey { value: read.map_or(&key.value, |read| &read.value).clone(), ..key.clone() }
        };
        printed.iter().map(read).collect()
    }
}

/// What computes a part. Paths are relative to the catalogue's folder.
#[derive(Clone, Debug, PartialEq)]
pub enum Work {
    /// A study.
    Study(PathBuf),
    /// Cases, drawn over each other.
    Cases(Vec<PathBuf>),
    /// A bifurcation diagram.
    Bifurcation(Bifurcation),
    /// A continuation.
    Continuation(PathBuf),
    /// A campaign on the virtual rig.
    Campaign(PathBuf),
    /// Code of its own, by its place in the table of methods.
    Method(&'static str),
}

impl Work {
    /// As `items.toml` writes it.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Study(_) => "study",
            Self::Cases(_) => "cases",
            Self::Bifurcation(_) => "bifurcation",
            Self::Continuation(_) => "continuation",
            Self::Campaign(_) => "campaign",
            Self::Method(_) => "method",
        }
    }

    /// The files that it names.
    #[must_use]
    pub fn files(&self) -> Vec<&Path> {
        match self {
            Self::Study(file) | Self::Continuation(file) | Self::Campaign(file) => vec![file],
            Self::Cases(files) => files.iter().map(PathBuf::as_path).collect(),
            Self::Bifurcation(sweep) => vec![&sweep.case],
            Self::Method(_) => Vec::new(),
        }
    }
}

/// A bifurcation diagram, with the options of `damprig study bifurcation`.
#[derive(Clone, Debug, PartialEq)]
pub struct Bifurcation {
    /// The case.
    pub case: PathBuf,
    /// `KEY=FROM:TO:COUNT`, as written.
    pub axis: String,
    /// The key and its values.
    pub swept: SweepAxis,
    /// `both`, `up` or `down`.
    pub direction: &'static str,
    /// Cycles at each value before sampling.
    pub settle_cycles: u32,
    /// Sampled cycles at each value.
    pub cycles: u32,
    /// Value at which the Poincaré section is drawn too.
    pub section: Option<f64>,
    /// `KEY=VALUE`, in place of values of the case.
    pub set: Vec<String>,
}

impl Catalogue {
    /// Reads `items.toml` in a folder.
    ///
    /// # Errors
    /// Lists all problems of the file: line, key, value, what is allowed.
    pub fn read(folder: &Path) -> Result<Self, Failure> {
        let source = Source::read(&folder.join(ITEMS))?;
        let items = source.read_toml(source.text(), "this is not TOML", |root| {
            root.tables_of(&items_keys::ITEM)
                .iter()
                .map(|section| read_item(section, folder))
                .collect::<Option<Vec<_>>>()
        });
        source.verdict()?;
        let items = items.ok_or_else(|| Failure::Input(format!("{}: the items could not be read", source.name())))?;
        for (place, item) in items.iter().enumerate() {
            if items[..place].iter().any(|other| other.name == item.name) {
                return Err(Failure::Input(format!("{}: two items have the name {:?}", source.name(), item.name)));
            }
        }
        Ok(Self { folder: folder.to_path_buf(), items })
    }

    /// The item with this name.
    ///
    /// # Errors
    /// Without such an item, names those that look like it.
    pub fn find(&self, name: &str) -> Result<&Item, Failure> {
        self.items.iter().find(|item| item.name == name).ok_or_else(|| {
            let names = || self.items.iter().map(|item| item.name.as_str());
            let help = match near(name, names())[..] {
                [] => format!("items: {}", listed(names())),
                ref candidates => format!("did you mean {}?", candidates.join(", ")),
            };
            Failure::Input(format!("there is no item {name:?}\n  {help}\n  `damprig-thesis --list` shows all"))
        })
    }
}

impl Item {
    /// The other readings of a main part: those named after it, `peak-starts` of `peak`, and those named after no main part.
    pub fn other_readings<'a>(&'a self, main: &'a Part) -> impl Iterator<Item = &'a Part> {
        let owner = move |part: &Part| {
            let mains = self.parts.iter().filter(|main| !main.is_other_reading);
            let is_of = |main: &&Part| part.name.strip_prefix(&main.name).is_some_and(|rest| rest.starts_with('-'));
            // The longest name is the nearest.
            mains.filter(is_of).max_by_key(|main| main.name.len()).map(|main| main.name.clone())
        };
        let belongs = move |part: &&Part| part.is_other_reading && owner(part).is_none_or(|owner| owner == main.name);
        self.parts.iter().filter(belongs)
    }

    /// The part with this name.
    #[must_use]
    pub fn part(&self, name: &str) -> Option<&Part> {
        self.parts.iter().find(|part| part.name == name)
    }

    /// The parts that are computed: all, or without the other readings.
    pub fn parts(&self, is_quick: bool) -> impl Iterator<Item = &Part> {
        self.parts.iter().filter(move |part| !is_quick || !part.is_other_reading)
    }

    /// The document's own name of the item: `Table 3-4`.
    #[must_use]
    pub fn label(&self) -> String {
        let Some((kind, number)) = self.name.split_once('-') else { return self.name.clone() };
        let kind = match kind {
            "fig" => "Figure",
            "table" => "Table",
            "eq" => "Equation",
            "section" => "Section",
            "future" => "Future work",
            _ => return self.name.clone(),
        };
        format!("{kind} {}", number.to_uppercase())
    }

    /// The chapter: `3` of `table-3-4`, `A` of `fig-a-2`.
    #[must_use]
    pub fn chapter(&self) -> String {
        self.name.split('-').nth(1).unwrap_or_default().to_uppercase()
    }
}

fn read_item(s: &Section, folder: &Path) -> Option<Item> {
    let name = name_of(s, s.text_of(&item_keys::NAME));
    let title = s.text_of(&item_keys::TITLE);
    let kind = s.word(&item_keys::KIND);
    let reason = s.text_of(&item_keys::REASON);
    let reading = s.text_of(&item_keys::READING);
    let parts: Vec<Option<Part>> =
        s.tables_of(&item_keys::PART).iter().map(|section| read_part(section, folder)).collect();
    let is_lacking = s.given(&item_keys::PART).is_none();
    s.finish();
    let parts = parts.into_iter().collect::<Option<Vec<Part>>>()?;
    let kind = ItemKind::ALL[kind?];
    if is_lacking && kind != ItemKind::MeasuredOnly {
        return None;
    }
    for (place, part) in parts.iter().enumerate() {
        if parts[..place].iter().any(|other| other.name == part.name) {
            s.reject("part", format!("two parts have the name {:?}", part.name), None);
        }
    }
    Some(Item {
        name: name?,
        title: title?.value,
        kind,
        reason: reason.map(|text| text.value),
        reading: reading.map(|text| text.value),
        parts,
    })
}

/// A name that can be that of a folder.
fn name_of(s: &Section, text: Option<Text>) -> Option<String> {
    let text = text?;
    let is_valid = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    if text.value == super::files::FOLDER {
        s.refuse("name", &text.span, "is the name of the folder with the files", None);
        return None;
    }
    if text.value.is_empty() || text.value.starts_with('-') || !text.value.chars().all(is_valid) {
        s.refuse("name", &text.span, "must have small letters, digits and hyphens only", None);
        return None;
    }
    Some(text.value)
}

fn read_part(s: &Section, folder: &Path) -> Option<Part> {
    let name = name_of(s, s.text_of(&part_keys::NAME));
    let title = s.text_of(&part_keys::TITLE);
    let is_other_reading = s.switch("other_reading").unwrap_or(false);
    let work = s.given(&part_keys::WHAT).and_then(|(place, given)| {
        let key = part_keys::WHAT.keys[place].name;
        let file = |text: &Text| file_of(s, key, text, folder);
        match (key, given) {
            ("study", Given::Text(text)) => Some(Work::Study(file(&text)?)),
            ("continuation", Given::Text(text)) => Some(Work::Continuation(file(&text)?)),
            ("campaign", Given::Text(text)) => Some(Work::Campaign(file(&text)?)),
            ("cases", Given::Texts(texts)) => {
                if texts.is_empty() {
                    s.reject("cases", "must name at least one case", None);
                }
                let files = texts.iter().map(file).collect::<Option<Vec<_>>>()?;
                refuse_same_names(s, &files);
                Some(Work::Cases(files))
            }
            ("bifurcation", Given::Table(section)) => read_bifurcation(&section, folder).map(Work::Bifurcation),
            ("method", Given::Word(place)) => Some(Work::Method(METHODS[place])),
            _ => None,
        }
    });
    let read_as = s.table_of(&part_keys::READ_AS, None).map(|table| table.free_keys()).unwrap_or_default();
    read_as.iter().for_each(|read| check_read_as(s, read));
    s.finish();
    Some(Part { name: name?, title: title?.value, is_other_reading, read_as, work: work? })
}

/// The results of cases are files of their names.
fn refuse_same_names(s: &Section, files: &[PathBuf]) {
    let names: Vec<String> = files.iter().map(|file| default_name(file)).collect();
    for (place, name) in names.iter().enumerate() {
        if names[..place].contains(name) {
            s.reject("cases", format!("two case files have the name {name:?}, so have their results"), None);
        }
    }
}

/// `KEY.PRINTED` with a number of each.
fn check_read_as(s: &Section, read: &FreeKey) {
    // A printed 2.5 is a quoted key with a point of its own.
    let ends_with_number = read.key.match_indices('.').any(|(point, _)| read.key[point + 1..].parse::<f64>().is_ok());
    if !ends_with_number || !matches!(read.value, FreeValue::Number(_)) {
        let allowed = "must give numbers for printed numbers of a key: { \"particle.clearance_ratio\" = { 5 = 2.5 } }";
        s.refuse("read_as", &read.span, allowed, None);
    }
}

fn read_bifurcation(s: &Section, folder: &Path) -> Option<Bifurcation> {
    let case = s.text_of(&sweep_keys::CASE).and_then(|text| file_of(s, "case", &text, folder));
    let axis = s.text_of(&sweep_keys::AXIS);
    let direction = s.word(&sweep_keys::DIRECTION);
    let settle = s.scalar(&sweep_keys::SETTLE);
    let cycles = s.scalar(&sweep_keys::CYCLES);
    let section = s.scalar(&sweep_keys::SECTION);
    let set = s.texts_of(&sweep_keys::SET).unwrap_or_default();
    s.finish();
    let axis = axis?;
    let swept = axis.value.parse::<SweepAxis>().map_err(|error| s.refuse("axis", &axis.span, error, None)).ok()?;
    Some(Bifurcation {
        case: case?,
        axis: axis.value,
        swept,
        direction: ["both", "up", "down"][direction?],
        settle_cycles: settle? as u32,
        cycles: cycles? as u32,
        section,
        set: set.into_iter().map(|text| text.value).collect(),
    })
}

/// A file beside `items.toml`, which must be there.
fn file_of(s: &Section, key: &str, text: &Text, folder: &Path) -> Option<PathBuf> {
    if folder.join(&text.value).is_file() {
        return Some(text.value.clone().into());
    }
    s.source().report(Problem {
        title: format!("`{}` = {:?} is not allowed", s.full(key), text.value),
        span: text.span.clone(),
        allowed: format!("there is no such file in {}", folder.display()),
        help: None,
    });
    None
}
