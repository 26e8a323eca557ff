//! The JSON Schemas and the key reference that are made from the declared keys.

use std::collections::BTreeSet;

use damprig::file_keys::FileKind;
use damprig::file_keys::reference::reference;
use damprig::file_keys::schema::schema;
use damprig::input::key::{Key, Table, ValueKind};
use serde_json::Value;
use tempfile::TempDir;

use super::documents::{CAMPAIGN, CASE, Documents, SET_UP, files, is_parsed, json_of, kind_of, own};
use crate::common::{damprig, is_full};
use crate::mutations;

/// The place of a value in a document: keys, and numbers of lists.
type Place = Vec<String>;

/// All values of a document with their places.
fn values(document: &Value, place: &Place, found: &mut Vec<(Place, Value)>) {
    let inner: Vec<(String, &Value)> = match document {
        Value::Object(map) => map.iter().map(|(key, value)| (key.clone(), value)).collect(),
        Value::Array(list) => list.iter().enumerate().map(|(n, value)| (n.to_string(), value)).collect(),
        _ => Vec::new(),
    };
    for (key, value) in inner {
        let place: Place = [&place[..], &[key]].concat();
        found.push((place.clone(), value.clone()));
        values(value, &place, found);
    }
}

fn pointer(place: &[String]) -> String {
    place.iter().map(|part| format!("/{part}")).collect()
}

fn with(document: &Value, place: &[String], value: Value) -> Value {
    let mut changed = document.clone();
    *changed.pointer_mut(&pointer(place)).expect("a place of the document") = value;
    changed
}

/// The declaration of the key at a place, with its table and kind.
fn declared(
    tables: &[Table],
    document: &Value,
    place: &[String],
) -> Option<(String, Option<&'static str>, &'static Key)> {
    let (key, above) = place.split_last()?;
    let kind = document.pointer(&format!("{}/kind", pointer(above))).and_then(Value::as_str);
    let names: Vec<&str> = above.iter().map(String::as_str).filter(|part| part.parse::<usize>().is_err()).collect();
    let path = names.join(".");
    let paths = [path.as_str(), path.strip_prefix("set_up.").unwrap_or(&path)];
    let table = tables.iter().find(|table| {
        paths.contains(&table.path)
            && (table.kind.is_none() || table.kind == kind)
            && table.quantities.iter().any(|quantity| quantity.key(key).is_some())
    })?;
    let key = table.quantities.iter().find_map(|quantity| quantity.key(key))?;
    Some((table.path.to_string(), table.kind, key))
}

#[test]
fn the_key_reference_is_the_one_that_the_declarations_give() {
    let path = own("../docs/KEYS.md");
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == reference(), "docs/KEYS.md is out of date: write it anew with `damprig keys > docs/KEYS.md`");
    let folder = TempDir::new().unwrap();
    damprig(&folder).arg("keys").assert().success().stdout(committed);
}

#[test]
fn every_declared_key_is_in_the_reference_and_in_a_schema_and_explained() {
    let page = reference();
    for file in FileKind::ALL {
        let text = schema(file).to_string();
        for key in file.tables().iter().flat_map(|table| table.quantities).flat_map(|quantity| quantity.keys) {
            assert!(page.contains(&format!("| `{}` |", key.name)), "{}", key.name);
            assert!(text.contains(&format!("{:?}:", key.name)), "{}", key.name);
            assert!(!key.doc.is_empty() && !key.doc.ends_with('.'), "{}", key.name);
        }
    }
}

#[test]
fn schemas_accept_every_shipped_file_and_every_key() {
    let mut documents = Documents::default();
    let mut missing: BTreeSet<(String, &str)> = BTreeSet::new();
    for file in FileKind::ALL {
        for table in file.tables() {
            let keys = table.quantities.iter().flat_map(|quantity| quantity.keys);
            missing.extend(keys.map(|key| (table.path.to_string(), key.name)));
        }
    }
    for (name, kind, document) in files() {
        documents.expect(true, kind, &name, &document);
        assert!(is_parsed(kind, &document), "{name}");
        let mut found = Vec::new();
        values(&document, &Vec::new(), &mut found);
        for (place, _) in &found {
            if let Some((path, _, key)) = declared(&kind_of(kind).tables(), &document, place) {
                missing.remove(&(path, key.name));
            }
        }
    }
    assert!(missing.is_empty(), "no file of this test has {missing:?}");
    documents.judge();
}

#[test]
fn schemas_and_parser_refuse_misspelt_keys_values_out_of_range_and_wrong_types() {
    let mut documents = Documents::default();
    let mut ranges = BTreeSet::new();
    // Every key once; in the full tests in every file.
    let mut seen = BTreeSet::new();
    let is_full = is_full();
    for (name, kind, document) in files() {
        let tables = kind_of(kind).tables();
        let mut found = Vec::new();
        values(&document, &Vec::new(), &mut found);
        let refuse = |documents: &mut Documents, what: String, changed: &Value| {
            documents.expect(false, kind, format!("{name}: {what}"), changed);
            // A part that no set-up has is not read; its file is.
            assert!(!is_parsed(kind, changed) || what.starts_with("/particle"), "{name}: {what} was parsed");
        };
        for (place, value) in &found {
            let at = pointer(place);
            let of_key = declared(&tables, &document, place).map(|(path, of, key)| (path, of, key.name));
            if !seen.insert((kind, of_key, value.is_object())) && !is_full {
                continue;
            }
            if value.is_object() {
                let mut misspelt = value.clone();
                misspelt["zzz"] = 1.into();
                refuse(&mut documents, format!("{at}/zzz"), &with(&document, place, misspelt));
            }
            let Some((path, of, key)) = declared(&tables, &document, place) else { continue };
            if matches!(key.kind, ValueKind::Word(_)) {
                refuse(&mut documents, format!("{at} = \"zzz\""), &with(&document, place, "zzz".into()));
            }
            if value.is_number() && key.kind != ValueKind::TextOrPlace {
                refuse(&mut documents, format!("{at} is a text"), &with(&document, place, "1.6 kg".into()));
                let Some(range) = key.kind.range() else { continue };
                for ((end, is_excluded), outwards) in
                    range.ends().into_iter().zip([-1.0, 1.0]).filter_map(|(end, o)| Some((end?, o)))
                {
                    let beyond = if is_excluded { end } else { end + outwards * 0.01 * end.abs().max(1.0) };
                    refuse(&mut documents, format!("{at} = {beyond}"), &with(&document, place, beyond.into()));
                    ranges.insert((path.clone(), of, key.name));
                    if !is_excluded {
                        documents.expect(
                            true,
                            kind,
                            format!("{name}: {at} = {end}"),
                            &with(&document, place, end.into()),
                        );
                    }
                }
            }
        }
        let mut misspelt = document.clone();
        misspelt["zzz"] = 1.into();
        refuse(&mut documents, "/zzz".into(), &misspelt);
    }
    assert!(ranges.len() > 80, "{}", ranges.len());
    documents.judge();
}

#[test]
fn schemas_state_which_keys_are_required_and_which_exclude_each_other() {
    let structure = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n";
    let set_up = "name = \"s\"\nbase_amplitude_m = 0.001\n";
    let release = "kind = \"free_vibration\"\nstart_m = 0.03\nmeasure_s = 5\n";
    let campaign = |top: &str, set_up: &str, experiment: &str| {
        json_of(&format!("{top}[[set_up]]\n{set_up}[[experiment]]\n{experiment}"))
    };
    let named = format!("name = \"t\"\n{structure}");
    let mut documents = Documents::default();
    let mut both = |is_valid: bool, kind: &str, name: &str, document: &Value| {
        assert_eq!(is_parsed(kind, document), is_valid, "{name}");
        documents.expect(is_valid, kind, name, document);
    };
    both(true, CAMPAIGN, "the least campaign", &campaign(&named, set_up, release));
    both(false, CAMPAIGN, "without a name", &campaign(structure, set_up, release));
    both(false, CAMPAIGN, "without an experiment", &json_of(&format!("{named}[[set_up]]\n{set_up}")));
    both(false, CAMPAIGN, "without a base amplitude", &campaign(&named, "name = \"s\"\n", release));
    both(false, CAMPAIGN, "without a kind", &campaign(&named, set_up, "start_m = 0.03\nmeasure_s = 5\n"));
    both(false, CAMPAIGN, "a key of another kind", &campaign(&named, set_up, &format!("{release}dwell_s = 4\n")));
    both(
        false,
        CAMPAIGN,
        "two targets",
        &campaign(
            &named,
            &format!("{set_up}friction_damper = {{ spring = {{ normal_force_n = 1, friction_ratio = 0.5 }} }}\n"),
            release,
        ),
    );
    both(
        false,
        CAMPAIGN,
        "no target",
        &campaign(&named, &format!("{set_up}friction_damper = {{ spring = {{}} }}\n"), release),
    );
    both(
        false,
        CAMPAIGN,
        "particle and tuned mass",
        &campaign(
            &named,
            &format!(
                "{set_up}particle = {{ mass_ratio = 0.1, clearance_m = 0.01, wall = {{ kind = \"restitution\", coefficient = 0.5 }} }}\ntmd = {{ mass_ratio = 0.1, tuning = \"warburton\" }}\n"
            ),
            release,
        ),
    );
    let impulse = "kind = \"impulse\"\namplitude_m = 0.002\nduration_s = 0.2\n";
    both(false, CAMPAIGN, "no shape", &campaign(&named, set_up, impulse));
    for (shape, is_valid) in [("rectangle", true), ("versine", false)] {
        let rise = format!("{impulse}shape = \"{shape}\"\nrise_s = 0.02\n");
        both(is_valid, CAMPAIGN, &format!("rise of a {shape}"), &campaign(&named, set_up, &rise));
    }
    for (amplifier, is_valid) in [("", true), ("amplifier = \"voltage\"\n", true), ("amplifier = \"current\"\n", false)]
    {
        let top = format!("{named}[rig.shaker]\n{amplifier}limit_v = 20\n");
        both(is_valid, CAMPAIGN, amplifier, &campaign(&top, set_up, release));
    }
    for (limits, is_valid) in
        [("displacement_limit_m = 0.07\n", true), ("displacement_limit_m = 0.07\nbase_limit_m = 0.07\n", false)]
    {
        both(is_valid, CAMPAIGN, limits, &campaign(&format!("{named}[rig]\n{limits}"), set_up, release));
    }
    let run = "run = { duration_s = 1 }\n";
    both(true, CASE, "the least case", &json_of(&format!("{structure}{run}")));
    both(false, CASE, "without a run", &json_of(structure));
    both(false, CASE, "without a structure", &json_of(run));
    both(true, CASE, "with that of a file", &json_of(&format!("set_up_file = \"identified.toml\"\n{run}")));
    both(
        false,
        CASE,
        "without a mass",
        &json_of(&format!("structure = {{ natural_frequency_hz = 2.5, damping_ratio = 0 }}\n{run}")),
    );
    both(
        true,
        CASE,
        "with the mass of a file",
        &json_of(&format!("set_up_file = \"identified.toml\"\nstructure = {{ natural_frequency_hz = 2.4 }}\n{run}")),
    );
    both(
        false,
        CASE,
        "one quantity twice",
        &json_of(&format!("{}{run}", structure.replace("damping_ratio", "stiffness_n_per_m = 400, damping_ratio"))),
    );
    for (wall, is_valid) in [
        ("material = \"rubber\", release = \"zero_force\"", true),
        ("material = \"rubber\"", false),
        ("storage_modulus_pa = 1e6, loss_factor = 0.1, release = \"zero_force\"", false),
        ("storage_modulus_pa = 1e6, shape_factor_m = 0.05, loss_factor = 0.1, release = \"zero_force\"", true),
        ("stiffness_n_per_m = 1e3, shape_factor_m = 0.05, loss_factor = 0.1, release = \"zero_force\"", false),
        ("stiffness_n_per_m = 1e3, damping_n_s_per_m = 1, law = \"contact\", release = \"zero_force\"", false),
    ] {
        let particle =
            format!("particle = {{ mass_ratio = 0.1, clearance_m = 0.01, wall = {{ kind = \"voigt\", {wall} }} }}\n");
        both(is_valid, CASE, wall, &json_of(&format!("{structure}{run}{particle}")));
    }
    documents.judge();
}

/// Gives the keys of a case that a variable, an axis or an uncertain key replaces the values of another document: the parser does not read what
/// the case itself has there.
fn keep_replaced(document: &mut Value, of: &Value) {
    let tables = ["variable", "axis", "uncertain"].iter().filter_map(|name| document.get(*name)?.as_array());
    let keys: Vec<String> =
        tables.flatten().filter_map(|table| Some(table.get("key")?.as_str()?.to_string())).collect();
    for key in keys {
        let pointer = format!("/case/{}", key.replace('.', "/"));
        if let (Some(own), Some(other)) = (document.pointer_mut(&pointer), of.pointer(&pointer)) {
            *own = other.clone();
        }
    }
    let alternatives = document.get_mut("alternative").and_then(Value::as_array_mut);
    for (n, alternative) in alternatives.into_iter().flatten().enumerate() {
        keep_replaced(alternative, of.pointer(&format!("/alternative/{n}")).unwrap_or(&Value::Null));
    }
}

/// An editor never marks a file that the parser accepts.
#[test]
fn schemas_accept_every_mutated_file_that_the_parser_accepts() {
    let mut documents = Documents::default();
    let mut seeds: Vec<(&str, String)> = files()
        .into_iter()
        .filter(|(_, kind, _)| *kind != SET_UP)
        .map(|(_, kind, document)| (kind, toml::to_string(&document).unwrap()))
        .collect();
    // No set-up of this seed has the particle, so that the parser does not read it.
    seeds.retain(|(_, text)| !text.contains("name = \"shaker\""));
    let mut rng = fastrand::Rng::with_seed(12);
    let count = if is_full() { 1500 } else { 300 };
    for n in 0..count {
        let (kind, text) = &seeds[n % seeds.len()];
        let Ok(table) = mutations::mutate(text, &mut rng).parse::<toml::Table>() else { continue };
        let Ok(mut document) = serde_json::to_value(table) else { continue };
        let seed = text.parse::<toml::Table>().map(serde_json::to_value).expect("a seed is TOML").expect("and JSON");
        keep_replaced(&mut document, &seed);
        if is_parsed(kind, &document) {
            documents.expect(true, kind, format!("mutation {n}: {document}"), &document);
        }
    }
    assert!(documents.0.len() > count / 7, "{}", documents.0.len());
    documents.judge();
}
