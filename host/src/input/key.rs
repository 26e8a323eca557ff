//! Declarations of the keys of input files, as plain data.
//!
//! A [`Table`] declares its quantities, a [`KeyedQuantity`] the keys that it may be written under, a [`Key`] its type, range
//! and meaning. [`Section::given`](super::Section::given) reads a quantity; its checks, defaults and messages follow from
//! the declaration alone.

/// Range of a number, within the limits of its [`KeyUnit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any sign.
    Any,
    /// Any sign, but not 0.
    NotZero,
    /// Greater than 0.
    Positive,
    /// 0 or greater.
    NotNegative,
    /// From the first to the second.
    Between(f64, f64),
    /// Greater than the first, at most the second.
    Above(f64, f64),
    /// Greater than the first, less than the second.
    Inside(f64, f64),
    /// 0, or from the first to the second.
    ZeroOr(f64, f64),
    /// A whole number from the first to the second.
    Whole(f64, f64),
}

/// The largest bound of a whole number: up to 2⁵³ an `f64` represents every one.
pub const MAX_WHOLE: f64 = 9e15;

/// The type of a key's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ValueKind {
    /// A finite number.
    Number(Range),
    /// A list of such numbers.
    Numbers(Range),
    /// A list of such numbers, or a table that describes them.
    NumbersOrTable(Range),
    /// One of these words.
    Word(&'static [&'static str]),
    /// A text.
    Text,
    /// A list of texts.
    Texts,
    /// A text, or a place counted from 1.
    TextOrPlace,
    /// A text, or the tables of a case.
    TextOrCase,
    /// A table.
    Table,
    /// A table, or a list of them.
    OneOrMoreTables,
    /// A list of tables.
    Tables,
}

impl ValueKind {
    /// The range of a number or of the numbers of a list.
    #[must_use]
    pub const fn range(self) -> Option<Range> {
        match self {
            Self::Number(range) | Self::Numbers(range) | Self::NumbersOrTable(range) => Some(range),
            _ => None,
        }
    }
}

/// A key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// As files spell it; a number's unit is its end.
    pub name: &'static str,
    /// Type of its value.
    pub kind: ValueKind,
    /// Its meaning, in one line.
    pub doc: &'static str,
    /// The least and the largest usual value of a number: others are allowed, with a warning.
    pub usual: Option<(f64, f64)>,
    /// Why its range is so, or what to write instead: part of the message when a number is out of range.
    pub note: Option<&'static str>,
}

impl Key {
    /// The same key with a range of usual values, whose ends are usual.
    #[must_use]
    pub const fn usual(self, least: f64, most: f64) -> Self {
        Self { usual: Some((least, most)), ..self }
    }

    /// The same key with a note on its range.
    #[must_use]
    pub const fn note(self, note: &'static str) -> Self {
        Self { note: Some(note), ..self }
    }

    /// Its unit.
    #[must_use]
    pub fn unit(&self) -> Option<&'static KeyUnit> {
        KeyUnit::of(self.name)
    }

    /// Why a number is beyond the magnitudes of its unit or outside its range, if it is.
    #[must_use]
    pub fn refusal(&self, value: f64) -> Option<String> {
        let unit = self.unit().and_then(|unit| unit.refusal(value));
        unit.or_else(|| self.range_refusal(value))
    }

    fn range_refusal(&self, value: f64) -> Option<String> {
        let range = self.kind.range()?;
        let mut refusal = range.refusal(value)?;
        // A bound has a unit; "greater than 0" needs none.
        if let (Some(unit), [_, Some(_)]) = (self.unit(), range.ends())
            && !unit.symbol.is_empty()
        {
            refusal.push_str(&format!(" {}", unit.symbol));
        }
        if let Some(note) = self.note {
            refusal.push_str(&format!(": {note}"));
        }
        Some(refusal)
    }

    /// Whether a value is outside the usual range, if the key has one.
    #[must_use]
    pub fn is_unusual(&self, value: f64) -> bool {
        self.usual.is_some_and(|(least, most)| !(least..=most).contains(&value))
    }
}

/// The default value of a quantity.
#[derive(Clone, Copy, Debug)]
pub enum DefaultValue {
    /// This number, in the unit of the first key.
    Number(f64),
    /// The number that another crate declares, in the unit of the first key.
    From(fn() -> f64),
    /// This word.
    Word(&'static str),
}

/// Whether a quantity has to be written.
#[derive(Clone, Copy, Debug)]
pub enum Need {
    /// Under one of its keys.
    Required,
    /// Under one of its keys, unless another table of the file gives it, as the text says.
    RequiredUnless(&'static str),
    /// It may be left out.
    Optional,
    /// It may be left out and has this value then.
    Default(DefaultValue),
    /// It must be left out.
    Forbidden,
    /// The first need if the quantity is written under that key, otherwise the second.
    If(&'static KeyedQuantity, &'static str, &'static Need, &'static Need),
    /// The first need if the quantity is that word, otherwise the second.
    IfWord(&'static KeyedQuantity, &'static str, &'static Need, &'static Need),
}

/// A quantity and its alternative keys.
#[derive(Clone, Copy, Debug)]
pub struct KeyedQuantity {
    /// The keys.
    pub keys: &'static [Key],
    /// Whether one of the keys must be written.
    pub need: Need,
}

impl KeyedQuantity {
    /// The same quantity where it may be left out.
    #[must_use]
    pub const fn optional(self) -> Self {
        Self { need: Need::Optional, ..self }
    }

    /// Its default value, if it has one whatever else is written.
    #[must_use]
    pub const fn default_value(&self) -> Option<DefaultValue> {
        if let Need::Default(value) = self.need { Some(value) } else { None }
    }

    /// Its key of this name.
    #[must_use]
    pub fn key(&self, name: &str) -> Option<&'static Key> {
        self.keys.iter().find(|key| key.name == name)
    }

    /// The name of its first key.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.keys[0].name
    }
}

/// The keys of a table.
#[derive(Clone, Copy, Debug)]
pub struct Table {
    /// Its path (`particle.wall`); empty for the top of a set-up or a file.
    pub path: &'static str,
    /// The word under `kind` that selects this table; `None` for a table with only one kind, and for the keys that all kinds of a
    /// table have.
    pub kind: Option<&'static str>,
    /// Meaning of the table, in one line.
    pub doc: &'static str,
    /// Its quantities.
    pub quantities: &'static [KeyedQuantity],
}

/// A unit of measure and the magnitudes that it allows besides zero. The bounds are far beyond any rig: derived values stay
/// finite, and a wrong exponent is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyUnit {
    /// The suffix of its keys.
    pub suffix: &'static str,
    /// Symbol in messages; empty for a plain number.
    pub symbol: &'static str,
    /// The least magnitude that is not zero.
    pub least: f64,
    /// The largest magnitude.
    pub most: f64,
}

const fn unit(suffix: &'static str, symbol: &'static str, least: f64, most: f64) -> KeyUnit {
    KeyUnit { suffix, symbol, least, most }
}

/// A suffix that ends with another suffix comes before it.
const UNITS: [KeyUnit; 32] = [
    unit("_n_s_per_m", "N·s/m", 1e-18, 1e18),
    unit("_s_per_m", "s/m", 1e-18, 1e6),
    unit("_n_per_m15", "N/m^1.5", 1e-12, 1e21),
    unit("_n_per_a", "N/A", 0.0, f64::MAX),
    unit("_n_per_m", "N/m", 1e-12, 1e18),
    unit("_rad_per_s", "rad/s", 1e-9, 1e9),
    unit("_m_per_s2", "m/s²", 1e-18, 1e6),
    unit("_m_per_s", "m/s", 1e-18, 1e6),
    unit("_kg_per_m3", "kg/m³", 1e-6, 1e9),
    unit("_kg_per_m", "kg/m", 1e-12, 1e12),
    unit("_n_m2", "N·m²", 1e-18, 1e18),
    unit("_per_s", "1/s", 1e-12, 1e12),
    unit("phase_rad", "rad", 0.0, 1e6),
    unit("_pa", "Pa", 1e-6, 1e18),
    unit("_hz", "Hz", 1e-9, 1e9),
    unit("per_root_kg", "1/√kg", 1e-18, 1e6),
    unit("_root_kg", "√kg", 1e-18, 1e6),
    unit("_kg", "kg", 1e-12, 1e12),
    unit("_m4", "m⁴", 1e-24, 1e12),
    unit("_m2", "m²", 1e-18, 1e12),
    unit("_m", "m", 1e-18, 1e6),
    unit("amplitude_n", "N", 1e-18, 1e12),
    unit("_n", "N", 0.0, 1e12),
    unit("_s", "s", 1e-12, 1e12),
    unit("_n_per_v", "N/V", 0.0, 1e9),
    unit("_v", "V", 0.0, f64::MAX),
    unit("_f", "F", 1e-18, 1e6),
    unit("_a", "A", 0.0, f64::MAX),
    unit("_ohm", "Ω", 0.0, f64::MAX),
    unit("coefficient", "", 1e-18, 100.0),
    unit("loss_factor", "", 0.0, 1e6),
    unit("_ratio", "", 1e-9, 1e6),
];

impl KeyUnit {
    /// The unit of a key, by its name's end.
    #[must_use]
    pub fn of(key: &str) -> Option<&'static Self> {
        UNITS.iter().find(|unit| key.ends_with(unit.suffix))
    }

    /// Why the magnitude of `value` is not allowed, if it is not.
    pub(crate) fn refusal(&self, value: f64) -> Option<String> {
        let Self { symbol, least, most, .. } = self;
        let space = if symbol.is_empty() { "" } else { " " };
        match value.abs() {
            magnitude if magnitude > *most => Some(format!("must be at most {most:e}{space}{symbol} in magnitude")),
            magnitude if magnitude > 0.0 && magnitude < *least => {
                Some(format!("must be 0 or at least {least:e}{space}{symbol} in magnitude"))
            }
            _ => None,
        }
    }
}

impl Range {
    /// What it allows, in words.
    #[must_use]
    pub fn allowed(self) -> String {
        match self {
            Self::Any => "any number".into(),
            Self::NotZero => "a number other than 0".into(),
            Self::Positive => "greater than 0".into(),
            Self::NotNegative => "0 or greater".into(),
            Self::Between(low, high) => format!("from {low} to {high}"),
            Self::Above(low, high) => format!("greater than {low} and at most {high}"),
            Self::Inside(low, high) => format!("greater than {low} and less than {high}"),
            Self::ZeroOr(low, high) => format!("0 or from {low} to {high}"),
            Self::Whole(low, high) if high >= MAX_WHOLE => format!("a whole number from {low} to {high:e}"),
            Self::Whole(low, high) => format!("a whole number from {low} to {high}"),
        }
    }

    /// Whether it allows a number.
    #[must_use]
    pub fn allows(self, value: f64) -> bool {
        match self {
            Self::Any => true,
            Self::NotZero => value != 0.0,
            Self::Positive => value > 0.0,
            Self::NotNegative => value >= 0.0,
            Self::Between(low, high) => (low..=high).contains(&value),
            Self::Above(low, high) => value > low && value <= high,
            Self::Inside(low, high) => value > low && value < high,
            Self::ZeroOr(low, high) => value == 0.0 || (low..=high).contains(&value),
            Self::Whole(low, high) => value.fract() == 0.0 && (low..=high).contains(&value),
        }
    }

    /// Its lower and its upper end, each with whether the end itself is excluded.
    #[must_use]
    pub fn ends(self) -> [Option<(f64, bool)>; 2] {
        match self {
            Self::Any | Self::NotZero => [None, None],
            Self::Positive => [Some((0.0, true)), None],
            Self::NotNegative => [Some((0.0, false)), None],
            Self::Between(low, high) | Self::Whole(low, high) => [Some((low, false)), Some((high, false))],
            Self::Above(low, high) => [Some((low, true)), Some((high, false))],
            Self::Inside(low, high) => [Some((low, true)), Some((high, true))],
            Self::ZeroOr(_, high) => [Some((0.0, false)), Some((high, false))],
        }
    }

    /// Why `value` is outside the range, if it is.
    #[must_use]
    pub fn refusal(self, value: f64) -> Option<String> {
        (!self.allows(value)).then(|| format!("must be {}", self.allowed()))
    }
}

impl DefaultValue {
    /// The number, if it is one.
    #[must_use]
    pub fn number(self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(number),
            Self::From(number) => Some(number()),
            Self::Word(_) => None,
        }
    }

    /// As a file writes it. A number that another crate declares in single precision has its shortest decimal.
    #[must_use]
    pub fn written(self) -> String {
        match (self, self.number()) {
            (Self::Word(word), _) => format!("{word:?}"),
            (_, Some(number)) if number.fract() == 0.0 && number.abs() < MAX_WHOLE => format!("{number:.0}"),
            (_, Some(number)) if f64::from(number as f32) == number => format!("{:?}", number as f32),
            (_, number) => format!("{:?}", number.unwrap_or(f64::NAN)),
        }
    }
}

/// A key that holds a number.
#[must_use]
pub const fn number(name: &'static str, range: Range, doc: &'static str) -> Key {
    Key { name, kind: ValueKind::Number(range), doc, usual: None, note: None }
}

/// A key that holds one of some words.
#[must_use]
pub const fn word(name: &'static str, words: &'static [&'static str], doc: &'static str) -> Key {
    Key { name, kind: ValueKind::Word(words), doc, usual: None, note: None }
}

/// A key of another kind.
#[must_use]
pub const fn key(name: &'static str, kind: ValueKind, doc: &'static str) -> Key {
    Key { name, kind, doc, usual: None, note: None }
}

/// Declares tables: a module for each, a constant for every quantity, and `TABLES` for all.
#[macro_export]
macro_rules! tables {
    ($all:literal $($doc:literal $module:ident($path:literal $(, $kind:literal)?) {
        $($name:ident: $need:expr, [$($key:expr),+ $(,)?];)*
    })+) => {
        $(
            #[doc = $doc]
            pub(crate) mod $module {
                #[allow(unused_imports)]
                use super::*;
                $(pub(crate) const $name: KeyedQuantity = KeyedQuantity { keys: &[$($key),+], need: $need };)*
                pub(crate) const TABLE: Table = Table {
                    path: $path,
                    kind: { let kind: &[&'static str] = &[$($kind)?]; kind.first().copied() },
                    doc: $doc,
                    quantities: &[$($name),*],
                };
            }
        )+
        #[doc = $all]
        pub const TABLES: &[Table] = &[$($module::TABLE),+];
    };
}
pub use tables;

/// The names of a list's items, as the words of a key.
macro_rules! names {
    ($list:expr, $item:ident => $name:expr) => {{
        const NAMES: [&str; $list.len()] = {
            let mut names = [""; $list.len()];
            let mut n = 0;
            while n < names.len() {
                let $item = &$list[n];
                names[n] = $name;
                n += 1;
            }
            names
        };
        &NAMES
    }};
}
pub(crate) use names;
