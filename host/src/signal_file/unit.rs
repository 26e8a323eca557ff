//! Units as files write them.

use std::str::FromStr;

/// Standard gravity by definition, m/s²: the unit g of an acceleration.
pub const STANDARD_GRAVITY: f64 = 9.806_65;

/// Quantity of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnitKind {
    /// m/s².
    Acceleration,
    /// m/s.
    Velocity,
    /// m.
    Displacement,
    /// N.
    Force,
    /// Pa.
    Pressure,
    /// V: a sensor whose sensitivity the file does not state.
    Voltage,
    /// s.
    Time,
    /// Hz.
    Frequency,
    /// rad.
    Angle,
}

impl UnitKind {
    /// Its name, for people.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Acceleration => "acceleration",
            Self::Velocity => "velocity",
            Self::Displacement => "displacement",
            Self::Force => "force",
            Self::Pressure => "pressure",
            Self::Voltage => "voltage",
            Self::Time => "time",
            Self::Frequency => "frequency",
            Self::Angle => "angle",
        }
    }
}

/// A unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Its quantity.
    pub kind: UnitKind,
    /// SI units per unit.
    pub si: f64,
}

/// Names of units, as [`plain`] writes them, with SI units per unit.
const UNITS: &[(UnitKind, &[(&str, f64)])] = &[
    (
        UnitKind::Acceleration,
        &[
            ("m/s2", 1.0),
            ("m_per_s2", 1.0),
            ("g", STANDARD_GRAVITY),
            ("gn", STANDARD_GRAVITY),
            ("mg", 1e-3 * STANDARD_GRAVITY),
            ("cm/s2", 0.01),
            ("gal", 0.01),
            ("mm/s2", 1e-3),
            ("mm_per_s2", 1e-3),
            ("ft/s2", 0.3048),
            ("in/s2", 0.0254),
        ],
    ),
    (
        UnitKind::Velocity,
        &[
            ("m/s", 1.0),
            ("m_per_s", 1.0),
            ("cm/s", 0.01),
            ("mm/s", 1e-3),
            ("mm_per_s", 1e-3),
            ("ft/s", 0.3048),
            ("in/s", 0.0254),
        ],
    ),
    (
        UnitKind::Displacement,
        &[("m", 1.0), ("cm", 0.01), ("mm", 1e-3), ("um", 1e-6), ("nm", 1e-9), ("in", 0.0254), ("ft", 0.3048)],
    ),
    (UnitKind::Force, &[("n", 1.0), ("kn", 1e3), ("mn", 1e-3), ("lbf", 4.448_221_615_260_5)]),
    (UnitKind::Pressure, &[("pa", 1.0), ("mpa", 1e-3), ("kpa", 1e3)]),
    (UnitKind::Voltage, &[("v", 1.0), ("mv", 1e-3), ("volt", 1.0), ("volts", 1.0)]),
    (UnitKind::Time, &[("s", 1.0), ("sec", 1.0), ("seconds", 1.0), ("ms", 1e-3), ("us", 1e-6)]),
    (UnitKind::Frequency, &[("hz", 1.0), ("khz", 1e3)]),
    (UnitKind::Angle, &[("rad", 1.0), ("deg", DEGREE), ("°", DEGREE)]),
];

const DEGREE: f64 = std::f64::consts::PI / 180.0;

impl Unit {
    /// The unit that a text names; `None` for one that is not known, and where capitals decide what it is (`MPa` is no
    /// millipascal, `mN` no meganewton).
    #[must_use]
    pub fn of(text: &str) -> Option<Self> {
        let text = text.trim();
        if text.starts_with('M') && matches!(plain(text).as_str(), "mpa" | "mn" | "mm" | "mv" | "mg" | "mhz") {
            return None;
        }
        let wanted = plain(text);
        let find = |(kind, names): &(UnitKind, &[(&str, f64)])| {
            names.iter().find(|(name, _)| *name == wanted).map(|(_, si)| Self { kind: *kind, si: *si })
        };
        UNITS.iter().find_map(find)
    }
}

impl FromStr for Unit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::of(text).ok_or_else(|| "must be a unit such as m/s2, g, mm/s2, m/s, mm/s, m, mm, N, V or mV".into())
    }
}

/// A quantity per another one, as of a frequency response: `m/s2/N`, `g/N`, `m_per_n`, `N/m`, `(m/s²)/(m/s²)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// The upper quantity.
    pub of: Unit,
    /// The lower one.
    pub per: Unit,
}

impl Ratio {
    /// The ratio that a text names; `None` for a unit without a ratio (`m/s`), and where a part is not known or the parts are not clear.
    #[must_use]
    pub fn of(text: &str) -> Option<Self> {
        if Unit::of(text).is_some() {
            return None;
        }
        let text = text.trim().replace(" per ", "/").replace("_per_", "/");
        let mut depth = 0;
        let mut found = Vec::new();
        for (at, c) in text.char_indices() {
            match c {
                '(' | '[' => depth += 1,
                ')' | ']' => depth -= 1,
                '/' if depth == 0 => {
                    let units = Unit::of(&text[..at]).zip(Unit::of(&text[at + 1..]));
                    found.extend(units.map(|(of, per)| Self { of, per }));
                }
                _ => {}
            }
        }
        if let [only] = found[..] { Some(only) } else { None }
    }
}

/// A unit's text in one spelling: `m/s²`, `m/s^2`, `(m/s**2)`, `m/s/s` and `m/sec2` are `m/s2`.
fn plain(text: &str) -> String {
    let text = text.trim().trim_matches(['(', ')', '[', ']']).to_lowercase();
    let text = text.replace(['²', '\u{fffd}'], "2").replace("**", "").replace(['^', ' '], "").replace(['µ', 'μ'], "u");
    text.replace("/sec", "/s").replace("/s/s", "/s2").replace("m*s-2", "m/s2")
}

/// Name and unit of a column: `Time (s)`, `Acc [g]`, `a_m_per_s2`, `x_mm`, `h_g_per_n`. The unit is empty where the name has none.
#[must_use]
pub fn of_column(column: &str) -> (String, String) {
    let column = column.trim();
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let Some((name, rest)) = column.rsplit_once(open)
            && let Some(unit) = rest.strip_suffix(close)
            && !name.trim().is_empty()
        {
            return (name.trim().into(), unit.trim().into());
        }
    }
    let suffixes = column.char_indices().filter(|(_, c)| *c == '_').map(|(at, _)| at);
    for at in suffixes {
        let (name, unit) = (&column[..at], &column[at + 1..]);
        if !name.is_empty() && (Unit::of(unit).is_some() || Ratio::of(unit).is_some()) {
            return (name.into(), unit.into());
        }
    }
    (column.into(), String::new())
}
