//! A board's settings as a TOML file with units in the names: writing, reading with error messages, comparing.
//!
//! Names and order of the settings come from `damprig-core`'s [`Settings`].

use std::fmt::Write;
use std::path::Path;

use damprig_core::io::Invalid;
use damprig_core::settings::{Prepared, Settings, Source as Origin};
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use crate::failure::Failure;
use crate::host_time::date_text;
use crate::input::{Problem, Source, Span, replacement};

/// A setting: its path in the file and its value.
pub type SettingEntry = (Vec<String>, f32);

/// Where settings come from, in words.
#[must_use]
pub fn origin_text(origin: Origin) -> &'static str {
    match origin {
        Origin::Default => "as delivered: none were ever saved",
        Origin::Stored => "stored",
        Origin::Damaged => "as delivered or set since: the stored settings are damaged or cannot be read",
        Origin::Host => "changed, not stored",
        Origin::OtherLayout => {
            "as delivered or set since: the stored settings have a layout that this firmware does not know"
        }
        Origin::Migrated => "stored by a firmware with the layout before; values that it did not have are as delivered",
        Origin::Older => "perhaps not the last that were stored: a record is damaged, or newer and of another layout",
    }
}

/// The limits of a board that keep its motion and forces, in words.
#[must_use]
pub fn limits_text(settings: &Settings) -> String {
    let safety = &settings.safety;
    let one = |what: &str, limit: f32, factor: f64, unit: &str| match limit {
        0.0 => format!("no limit of {what}"),
        // Of the shortest decimal, so its product needs no more digits than this.
        limit => format!("{what} up to {} {unit}", (number_of(limit) * factor * 1e6).round() / 1e6),
    };
    [
        one("|x|", safety.limits.structure_m, 1e3, "mm"),
        one("|z|", safety.limits.base_m, 1e3, "mm"),
        one("wall force", safety.wall_force_n, 1.0, "N"),
    ]
    .join(", ")
}

/// All settings with their paths, in order.
#[must_use]
pub fn entries(settings: &Settings) -> Vec<SettingEntry> {
    fn walk(table: &Table, path: &[String], into: &mut Vec<SettingEntry>) {
        for (key, value) in table {
            let place: Vec<String> = path.iter().chain([key]).cloned().collect();
            match value {
                Value::Table(inner) => walk(inner, &place, into),
                // The `f64` holds an `f32`.
                Value::Float(number) => into.push((place, *number as f32)),
                _ => {}
            }
        }
    }
    let mut list = Vec::new();
    walk(&table(settings), &[], &mut list);
    list
}

/// Settings are tables of numbers, whatever their values.
fn table(settings: &Settings) -> Table {
    Table::try_from(settings).unwrap_or_default()
}

/// The settings as a file; `head` goes before them as a comment.
#[must_use]
pub fn to_toml(settings: &Settings, head: &str) -> String {
    toml_of(&entries(settings), head)
}

/// Some settings as a file; `head` goes before them as a comment. Dates are also written as such.
#[must_use]
pub fn toml_of(entries: &[SettingEntry], head: &str) -> String {
    let mut text = String::new();
    for line in head.lines() {
        let _ = writeln!(text, "# {line}");
    }
    let mut section = String::new();
    for (place, value) in entries {
        let (key, path) = place.split_last().map_or(("", ""[..].to_string()), |(key, path)| (key, path.join(".")));
        if path != section {
            let _ = write!(text, "\n[{path}]\n");
            section = path;
        }
        // The shortest decimal that reads back as the same number.
        let date = if key == "date_days" { format!("   # {}", date_text(*value)) } else { String::new() };
        let _ = writeln!(text, "{key} = {}{date}", decimal(*value));
    }
    text
}

/// The settings with other values of some, by their paths; unknown paths are left out. The values are not checked.
#[must_use]
pub fn with_values(settings: &Settings, values: &[(&str, f32)]) -> Settings {
    let mut changed = table(settings);
    for (path, value) in values {
        let (tables, key) = path.rsplit_once('.').unwrap_or(("", path));
        let inner = tables.split('.').try_fold(&mut changed, |table, name| table.get_mut(name)?.as_table_mut());
        if let Some(place) = inner.and_then(|table| table.get_mut(key)) {
            *place = Value::Float(f64::from(*value));
        }
    }
    // Of the template's shape, so it is settings.
    changed.try_into().unwrap_or(*settings)
}

/// The shortest decimal of a number, as TOML wants it: with a point or an exponent.
#[must_use]
pub fn decimal(value: f32) -> String {
    format!("{value:?}")
}

/// The `f64` of a setting's shortest decimal.
#[must_use]
pub fn number_of(value: f32) -> f64 {
    decimal(value).parse().unwrap_or(f64::from(value))
}

/// Reads the settings of a virtual board: a file as `damprig settings export` writes it. Settings that it leaves out have
/// their defaults.
///
/// # Errors
/// A file that cannot be read; else as [`from_toml`].
pub fn read_board(path: &Path) -> Result<Settings, Failure> {
    from_toml(&Source::read(path)?, &Settings::default())
}

/// The settings in which two boards differ, one a line; only paths for which `is_meant`.
#[must_use]
pub fn differences(before: &Settings, now: &Settings, is_meant: impl Fn(&[String]) -> bool) -> Vec<String> {
    let pairs = entries(before).into_iter().zip(entries(now));
    let differ = |((place, before), (_, now)): (SettingEntry, SettingEntry)| {
        let differs = is_meant(&place) && before.to_bits() != now.to_bits();
        differs.then(|| format!("{}: {} when it was started, {} now", place.join("."), decimal(before), decimal(now)))
    };
    pairs.filter_map(differ).collect()
}

/// Reads settings; those that the file leaves out are as in `present`.
///
/// # Errors
/// All problems of the file with their lines: unknown keys with near candidates, values that are not numbers or out of range.
pub fn from_toml(source: &Source, present: &Settings) -> Result<Settings, Failure> {
    let document = match DeTable::parse(source.text()) {
        Ok(document) => document,
        Err(error) => {
            source.report(Problem {
                title: "this is not TOML".into(),
                span: error.span().unwrap_or_default(),
                allowed: error.message().to_string(),
                help: None,
            });
            source.verdict()?;
            return Ok(*present);
        }
    };
    if let Some((key, _)) = document.get_ref().iter().find(|(key, _)| key.get_ref() == "backup") {
        source.report(Problem {
            title: "this is a backup of the settings memory of a board".into(),
            span: key.span(),
            allowed: "`settings import` and --rig virtual:FILE take settings as `damprig settings export` writes them"
                .into(),
            help: Some(format!("`damprig settings restore {}` gives the backup to a board", source.name())),
        });
        source.verdict()?;
    }
    let mut template = table(present);
    let mut spans = Vec::new();
    fill(source, "", &mut template, document.get_ref(), &mut spans);
    if spans.is_empty() && source.is_clean() {
        source.report(Problem {
            title: "the file sets nothing".into(),
            span: 0..0,
            allowed: "one setting or more; `damprig settings export` writes them all".into(),
            help: None,
        });
    }
    source.verdict()?;
    // Of the template's shape, so it is settings.
    let settings: Settings = template.try_into().unwrap_or(*present);
    if let Err(invalid) = check(&settings) {
        let span = spans.iter().find(|(place, _)| is_named(place, &invalid)).map(|(_, span)| span.clone());
        let written = span.clone().and_then(|span| source.text().get(span));
        let value = written.map_or_else(|| decimal(invalid.value as f32), str::to_string);
        source.report(Problem {
            title: format!("`{}` = {value} is not allowed", invalid.parameter),
            span: span.unwrap_or_default(),
            allowed: format!("must be {}", invalid.allowed),
            help: None,
        });
    }
    source.verdict().map(|()| settings)
}

/// Whether a file, as [`from_toml`] reads it, states every limit of the board.
#[must_use]
pub fn states_limits(text: &str) -> bool {
    let Ok(file) = text.parse::<Table>() else { return false };
    let limits = entries(&Settings::default()).into_iter().filter(|(place, _)| place[0] == "safety");
    let states = |place: &[String]| {
        let mut found = file.get(&place[0]);
        place[1..].iter().for_each(|name| found = found.and_then(|table| table.get(name)));
        found.is_some()
    };
    limits.into_iter().all(|(place, _)| states(&place))
}

/// Checks settings as a board does.
///
/// # Errors
/// Names the first parameter out of range.
pub fn check(settings: &Settings) -> Result<(), Invalid> {
    Prepared::new(settings).map(|_| ())
}

/// Whether the place in the file is the parameter's: some parts of the core name theirs without the table around.
fn is_named(place: &str, invalid: &Invalid) -> bool {
    place == invalid.parameter || place.ends_with(&format!(".{}", invalid.parameter))
}

fn fill(source: &Source, path: &str, template: &mut Table, found: &DeTable<'_>, spans: &mut Vec<(String, Span)>) {
    let names: Vec<String> = template.keys().cloned().collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    for (key, value) in found {
        let full = if path.is_empty() { key.get_ref().to_string() } else { format!("{path}.{}", key.get_ref()) };
        let number = number(value);
        match (template.get_mut(key.get_ref().as_ref()), value.get_ref().as_table()) {
            (None, _) => source.report(Problem {
                title: format!("unknown key `{full}`"),
                span: key.span(),
                allowed: format!("allowed here: {}", names.join(", ")),
                help: replacement(key.get_ref(), number, &names).map(|(_, help)| help),
            }),
            (Some(Value::Table(inner)), Some(table)) => fill(source, &full, inner, table, spans),
            (Some(Value::Table(_)), None) => source.report(Problem {
                title: format!("`{full}` is not allowed"),
                span: value.span(),
                allowed: "must be a table".into(),
                help: Some(format!("write `[{full}]`")),
            }),
            (Some(place), _) => match number {
                Some(number) => {
                    // As the board has it.
                    *place = Value::Float(f64::from(number as f32));
                    spans.push((full, value.span()));
                }
                None => source.report(Problem {
                    title: format!("`{full}` is not allowed"),
                    span: value.span(),
                    allowed: NUMBER.into(),
                    help: None,
                }),
            },
        }
    }
}

/// What a setting may be.
const NUMBER: &str =
    "must be a finite number that the board's single precision holds: 0, or 1.2e-38 to 3.4e38 in magnitude";

/// The finite number that a board's `f32` can hold. A number that it would make 0 or a subnormal one is none.
fn number(value: &Spanned<DeValue<'_>>) -> Option<f64> {
    let number: f64 = match value.get_ref() {
        DeValue::Integer(i) if i.radix() == 10 => i.as_str().parse().ok()?,
        DeValue::Float(f) => f.as_str().parse().ok()?,
        _ => return None,
    };
    (number == 0.0 || (number as f32).is_normal()).then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_settings_read_back_to_the_bit() {
        let mut settings = Settings::default();
        settings.calibration.x.metres_per_count = 0.1 + 0.2;
        settings.spring.step_m = f32::MIN_POSITIVE;
        settings.spring.travel_m = 1e-33;
        let text = to_toml(&settings, "one\ntwo");
        let source = Source::new("test", text.clone());
        let document: Table = text.parse().unwrap();
        assert_eq!(document["calibration"]["x"].as_table().unwrap().len(), 2, "{text}");
        let mut template = table(&Settings::default());
        fill(&source, "", &mut template, DeTable::parse(&text).unwrap().get_ref(), &mut vec![]);
        assert_eq!(Settings::clone(&template.try_into().unwrap()), settings, "{text}");
        assert!(source.is_clean());
    }

    #[test]
    fn every_setting_is_a_number_with_its_unit_in_its_name() {
        let all = entries(&Settings::default());
        assert_eq!(all.len(), 66);
        const WITHOUT: [&str; 3] = ["half_cycles_ahead", "friction_coefficient", "ringing"];
        const UNITS: [&str; 8] = ["_m", "_n", "_s", "_hz", "_days", "_counts", "_per_count", "_n_per_m"];
        for (place, _) in &all {
            let name = place.last().unwrap().as_str();
            let has_unit = UNITS.iter().any(|unit| name.ends_with(unit)) || WITHOUT.contains(&name);
            assert!(has_unit, "{place:?}");
        }
    }

    #[test]
    fn a_date_is_shown_as_a_date_and_reads_back() {
        let mut settings = Settings::default();
        settings.calibrated.r#match.date_days = 20_574.0;
        let text = to_toml(&settings, "");
        assert!(text.contains("[calibrated.match]\ndate_days = 20574.0   # 2026-05-01\n"), "{text}");
        assert!(text.contains("[calibrated.x]\ndate_days = 0.0   # never\n"), "{text}");
        assert_eq!(from_toml(&Source::new("test", text), &Settings::default()).unwrap(), settings);
    }

    /// The tables of a file from before there were dates of calibrations.
    #[test]
    fn a_file_without_dates_of_calibrations_is_read() {
        let mut before = Settings::default();
        before.calibration.x.zero_counts = 32_700.0;
        let own = |(place, _): &SettingEntry| place[0] != "calibrated";
        let entries: Vec<SettingEntry> = entries(&before).into_iter().filter(own).collect();
        assert_eq!(entries.len(), 45);
        let read = from_toml(&Source::new("old.toml", toml_of(&entries, "")), &Settings::default()).unwrap();
        assert_eq!(read, before);
    }

    #[test]
    fn settings_that_a_file_leaves_out_stay() {
        let present = Settings::default();
        let read = from_toml(&Source::new("test", "[spring]\nstep_m = 4e-6\n"), &present).unwrap();
        assert_eq!(read.spring.step_m, 4e-6);
        assert_eq!(Settings { spring: present.spring, ..read }, present);
    }

    #[test]
    fn an_unknown_key_gets_its_nearest_match_and_a_bad_value_its_line() {
        let present = Settings::default();
        let answer = |text: &str| from_toml(&Source::new("board.toml", text), &present).unwrap_err().to_string();
        let unknown = answer("[spring]\nstep_mm = 0.005\n[safty]\nx = 1\n");
        for words in ["unknown key `spring.step_mm`", "write `step_m = 0.000005`", "unknown key `safty`", "`safety`"] {
            assert!(unknown.contains(words), "no {words:?} in:\n{unknown}");
        }
        let wrong = answer("\n[safety.limits]\nstructure_m = -1\n");
        for words in ["board.toml:3", "structure_m` = -1"] {
            assert!(wrong.contains(words), "no {words:?} in:\n{wrong}");
        }
        assert!(answer("[impacts]\nringing = \"much\"\n").contains("must be a finite number"));
        assert!(answer("spring = 3\n").contains("must be a table"));
        assert!(answer("[spring\n").contains("not TOML"));
    }
}
