//! Declarations of the keys of input files, as plain data.
//!
//! A [`Table`] declares its quantities, a [`Quantity`] the keys that it may be written under, a [`Key`] its type, range
//! and meaning. [`Section::given`](super::Section::given) reads a quantity; its checks, defaults and messages follow from
//! the declaration alone.

/// Range of a number, within the limits of its [`Unit`].
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
    /// A whole number, 0 or greater, that an `f64` represents exactly.
    Whole,
}

/// The type of a key's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A finite number.
    Number(Range),
    /// A list of finite numbers.
    Numbers,
    /// One of these words.
    Word(&'static [&'static str]),
    /// A text.
    Text,
    /// A text, or a place counted from 1.
    TextOrPlace,
    /// A table.
    Table,
}

/// A key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// As files spell it; a number's unit is its end.
    pub name: &'static str,
    /// Type of its value.
    pub kind: Kind,
    /// Its meaning, in one line.
    pub doc: &'static str,
    /// The least and the largest usual value of a number: others are allowed, with a warning.
    pub usual: Option<(f64, f64)>,
}

impl Key {
    /// The same key with a range of usual values, whose ends are usual.
    #[must_use]
    pub const fn usual(self, least: f64, most: f64) -> Self {
        Self { usual: Some((least, most)), ..self }
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
    /// It may be left out.
    Optional,
    /// It may be left out and has this value then.
    Default(DefaultValue),
    /// It must be left out.
    Forbidden,
    /// The first need if the quantity is written under that key, otherwise the second.
    If(&'static Quantity, &'static str, &'static Need, &'static Need),
}

/// A quantity and its alternative keys.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    /// The keys.
    pub keys: &'static [Key],
    /// Whether one of the keys must be written.
    pub need: Need,
}

impl Quantity {
    /// The same quantity where it must be written.
    #[must_use]
    pub const fn required(self) -> Self {
        Self { need: Need::Required, ..self }
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
    /// The word under `kind` that selects this table; `None` for a table with only one kind.
    pub kind: Option<&'static str>,
    /// Meaning of the table, in one line.
    pub doc: &'static str,
    /// Its quantities.
    pub quantities: &'static [Quantity],
}

/// A unit of measure and the magnitudes that it allows besides zero. The bounds are far beyond any rig: derived values stay
/// finite, and a wrong exponent is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// The suffix of its keys.
    pub suffix: &'static str,
    /// Symbol in messages; empty for a plain number.
    pub symbol: &'static str,
    /// The least magnitude that is not zero.
    pub least: f64,
    /// The largest magnitude.
    pub most: f64,
}

const fn unit(suffix: &'static str, symbol: &'static str, least: f64, most: f64) -> Unit {
    Unit { suffix, symbol, least, most }
}

/// A suffix that ends with another suffix comes before it.
const UNITS: [Unit; 17] = [
    unit("_n_s_per_m", "N·s/m", 0.0, 1e18),
    unit("_n_per_m", "N/m", 1e-12, 1e18),
    unit("_rad_per_s", "rad/s", 1e-9, 1e9),
    unit("_m_per_s2", "m/s²", 1e-18, 1e6),
    unit("_m_per_s", "m/s", 1e-18, 1e6),
    unit("phase_rad", "rad", 0.0, 1e6),
    unit("_pa", "Pa", 1e-6, 1e18),
    unit("_kg", "kg", 1e-12, 1e12),
    unit("_hz", "Hz", 1e-9, 1e9),
    unit("_m", "m", 1e-18, 1e6),
    unit("amplitude_n", "N", 1e-18, 1e12),
    unit("_n", "N", 0.0, 1e12),
    unit("_s", "s", 1e-12, 1e12),
    unit("coefficient", "", 1e-18, 100.0),
    unit("loss_factor", "", 0.0, 1e6),
    unit("damping_ratio", "", 0.0, 1e6),
    unit("_ratio", "", 1e-9, 1e6),
];

impl Unit {
    /// The unit of a key, by its name's end.
    #[must_use]
    pub fn of(key: &str) -> Option<&'static Self> {
        UNITS.iter().find(|unit| key.ends_with(unit.suffix))
    }

    /// Why the magnitude of `value` is not allowed, if it is not.
    pub(super) fn refusal(&self, value: f64) -> Option<String> {
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
    /// Why `value` is outside the range, if it is.
    #[must_use]
    pub fn refusal(self, value: f64) -> Option<String> {
        let (is_inside, allowed) = match self {
            Self::Any => return None,
            Self::NotZero => (value != 0.0, "a number other than 0".into()),
            Self::Positive => (value > 0.0, "greater than 0".into()),
            Self::NotNegative => (value >= 0.0, "0 or greater".into()),
            Self::Between(low, high) => ((low..=high).contains(&value), format!("from {low} to {high}")),
            // Beyond 2⁵³ an `f64` does not represent every whole number.
            Self::Whole => {
                (value.fract() == 0.0 && (0.0..=9e15).contains(&value), "a whole number from 0 to 9e15".into())
            }
        };
        (!is_inside).then(|| format!("must be {allowed}"))
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
}

/// A key that holds a number.
pub(crate) const fn number(name: &'static str, range: Range, doc: &'static str) -> Key {
    Key { name, kind: Kind::Number(range), doc, usual: None }
}

/// A key that holds one of some words.
pub(crate) const fn word(name: &'static str, words: &'static [&'static str], doc: &'static str) -> Key {
    Key { name, kind: Kind::Word(words), doc, usual: None }
}

/// A key of another kind.
pub(crate) const fn key(name: &'static str, kind: Kind, doc: &'static str) -> Key {
    Key { name, kind, doc, usual: None }
}

/// Declares tables: a module for each, a constant for every quantity, and `TABLES` for all.
macro_rules! tables {
    ($all:literal $($doc:literal $module:ident($path:literal $(, $kind:literal)?) {
        $($name:ident: $need:expr, [$($key:expr),+ $(,)?];)*
    })+) => {
        $(
            #[doc = $doc]
            pub(crate) mod $module {
                #[allow(unused_imports)]
                use super::*;
                $(pub(crate) const $name: Quantity = Quantity { keys: &[$($key),+], need: $need };)*
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
pub(crate) use tables;

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
