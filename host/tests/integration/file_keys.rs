//! What is made from the declared keys: the JSON Schemas of input files, the key reference, and new files.
//!
//! `tests/python/check_schemas.py` judges documents by the schemas; without its Python (see `exports`) that is left out.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{damprig, folder_with, python};
use crate::mutations;
use damprig::campaign::Campaign;
use damprig::file_keys::FileKind;
use damprig::file_keys::new_file::{self, Damper, Excitation, Values};
use damprig::file_keys::reference::reference;
use damprig::file_keys::schema::schema;
use damprig::input::Source;
use damprig::input::key::{Key, Kind, Table};
use damprig::simulation::Case;
use predicates::str::contains;
use serde_json::{Value, json};
use tempfile::TempDir;

const CAMPAIGN: &str = "campaign";
const CASE: &str = "case";
const SET_UP: &str = "set-up";

/// Files with all tables and keys that the shipped ones leave out.
const MORE_CAMPAIGNS: &str = r#"
name = "more"
gravity_m_per_s2 = 9.81
set_up_file = "identified.toml"
friction_damper = { spring = { friction_ratio = 0.6, friction_coefficient = 0.3, stiffness_n_per_m = 500 } }
tmd = { mass_kg = 0.1, frequency_ratio = 0.9, damping_n_s_per_m = 0.1 }

[rig]
structure_limit_m = 0.07
base_limit_m = 0.07
half_cycles_ahead = 6
wall_force_limit_n = 400
saturated_s = 1.0
host_silent_s = 10
brake_n = 0.5
noise_seed = 3
shaker = { amplifier = "current", current_limit_a = 4 }
sensors = { kind = "ideal" }

[[set_up]]
name = "voigt"
base_amplitude_m = 0.001
structure = { mass_kg = 1.6, stiffness_n_per_m = 400, damping_n_s_per_m = 0.2 }
particle = { mass_kg = 0.16, clearance_m = 0.01, start_m = 0.001, wall = { kind = "voigt", storage_modulus_pa = 1e6, shape_factor_m = 0.05, loss_factor = 0.2, law = "contact", release = "zero_force" } }

[[set_up]]
name = "friction"
label = "FD"
base_amplitude_m = 0.001
gravity_m_per_s2 = 9.8
friction_damper = {}

[[set_up]]
name = "tuned"
base_amplitude_m = 0.001
tmd = {}

[[set_up]]
name = "tank"
base_amplitude_m = 0.001
damper = "unmodelled"

[[experiment]]
kind = "stepped_sine"
frequencies_hz = { from_hz = 2.4, to_hz = 2.5, step_hz = 0.1 }
start = "from_rest"
ramp_s = 0.1
settle_s = 0.2
dwell_s = 3
rest_level_m = 1e-4
steady = { tolerance = 0.02, scatter = 0.01, longest_dwell_s = 6 }
drive = "closed_loop"
closed_loop = { gain_per_s = 20, tolerance = 0.01, wait_s = 10, drive_limit_m = 0.004 }
set_ups = ["voigt"]

[[experiment]]
kind = "playback"
file = "record.csv"
quantity = "displacement"
unit = "mm"
column = 2
time_column = "t"
scale = 0.5
baseline = "linear"
sample_rate_hz = 100
ramp_s = 0.01
tail_s = 1
rest_level_m = 1e-4

[[experiment]]
kind = "playback"
file = "record.csv"
quantity = "displacement"
unit = "mm"
column = "z_mm"
time_step_s = 0.01

[[experiment]]
kind = "impulse"
shape = "rectangle"
amplitude_m = 0.002
duration_s = 0.2
rise_s = 0.02
sample_rate_hz = 1000
ramp_s = 0
tail_s = 0.5
rest_level_m = 1e-4

[[experiment]]
kind = "free_vibration"
start_m = 0.02
level_m = 0.016
hold_s = 0.5
timeout_s = 60
measure_s = 2
cycles = 4
"#;

const MORE_CASES: [&str; 6] = [
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
friction_damper = { spring = { normal_force_n = 1 } }
base = { kind = "record", file = "record.csv", quantity = "displacement", unit = "mm", scale = 0.5, column = 2, time_column = "t" }
run = {}
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "record", file = "record.csv", quantity = "displacement", unit = "mm", column = "z_mm", time_step_s = 0.01 }
run = { duration_s = 1 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
force = { kind = "sine", amplitude_n = 1, angular_frequency_rad_per_s = 15, phase_rad = 0.1 }
run = { duration_s = 1 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "fixed" }
force = { kind = "half_sine", amplitude_n = -2, duration_s = 0.2 }
run = { duration_s = 1 }
"#,
    r#"
name = "more"
set_up_file = "identified.toml"
gravity_m_per_s2 = 9.81
base_amplitude_m = 0.002
base = { kind = "sine", angular_frequency_rad_per_s = 15, phase_rad = 0.1 }
particle = { mass_kg = 0.1, clearance_ratio = 3, start = "centre", friction_coefficient = 0.1, wall = { kind = "voigt", stiffness_n_per_m = 1000, damping_n_s_per_m = 1, release = "zero_penetration" } }
friction_damper = { spring = { deflection_m = 0.001 } }
run = { duration_s = 4, sample_times_s = [0.1, 0.2], cycle_s = 0.4, steady_from_cycle = 2 }
"#,
    r#"
structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }
base = { kind = "half_sine", amplitude_m = -0.003, duration_s = 0.2 }
initial = { x_m = 0.01, v_m_per_s = 0.1, y_m = 0.01, u_m_per_s = 0 }
tmd = { mass_ratio = 0.1, stiffness_n_per_m = 30, damping_ratio = 0.1 }
run = { duration_s = 4 }
"#,
];

const SET_UP_FILE: &str = r#"
[structure]
natural_frequency_hz = 2.50012
damping_ratio = 0.003801
[particle]
friction_coefficient = 0.05
wall = { kind = "restitution", coefficient = 0.47 }
[[identified]]
key = "structure.damping_ratio"
value = 0.003801
standard_uncertainty = 3e-6
interval_95 = [0.003795, 0.003807]
unit = ""
method = "decay"
taken_from = "a run"
date = "2026-06-01"
damprig = "damprig 0.1.0"
"#;

fn own(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn json_of(toml: &str) -> Value {
    serde_json::to_value(toml.parse::<toml::Table>().expect("TOML")).expect("JSON")
}

/// All shipped files and those of this test: name, kind, content.
fn files() -> Vec<(String, &'static str, Value)> {
    let mut files = Vec::new();
    for (folder, kind) in [("campaigns", CAMPAIGN), ("cases", CASE)] {
        let entries = std::fs::read_dir(own(folder)).unwrap().flatten().map(|entry| entry.path());
        for path in entries.filter(|path| path.extension().is_some_and(|extension| extension == "toml")) {
            files.push((path.display().to_string(), kind, json_of(&std::fs::read_to_string(&path).unwrap())));
        }
    }
    assert!(files.len() > 12, "{}", files.len());
    files.extend(mutations::CAMPAIGNS.map(|text| ("a seed of mutations".into(), CAMPAIGN, json_of(text))));
    files.push(("more campaigns".into(), CAMPAIGN, json_of(MORE_CAMPAIGNS)));
    files.extend(MORE_CASES.map(|text| ("more cases".into(), CASE, json_of(text))));
    files.push(("set-up file".into(), SET_UP, json_of(SET_UP_FILE)));
    files
}

fn kind_of(name: &str) -> FileKind {
    match name {
        CAMPAIGN => FileKind::Campaign,
        CASE => FileKind::Case,
        _ => FileKind::SetUp,
    }
}

/// Documents with the verdict that their schema must give.
#[derive(Default)]
struct Documents(Vec<Value>);

impl Documents {
    fn expect(&mut self, is_valid: bool, kind: &str, name: impl Into<String>, document: &Value) {
        let name = name.into();
        self.0.push(json!({ "name": name, "schema": kind, "is_valid": is_valid, "document": document }));
    }

    /// Lets the validator judge them by the schemas that `damprig schema` prints.
    fn judge(self) {
        let folder = TempDir::new().unwrap();
        let printed = |kind: &str| -> Value {
            let output = damprig(&folder).args(["schema", kind]).output().unwrap();
            serde_json::from_slice(&output.stdout).expect("a schema is JSON")
        };
        let schemas = json!({ CAMPAIGN: printed(CAMPAIGN), CASE: printed(CASE), SET_UP: printed(SET_UP) });
        let Some(python) = python() else {
            println!("left out: no Python with jsonschema (tests/run makes one; DAMPRIG_PYTHON names one)");
            return;
        };
        let file = folder.path().join("documents.json");
        let given = json!({ "schemas": schemas, "documents": self.0 });
        std::fs::write(&file, serde_json::to_vec(&given).unwrap()).unwrap();
        let script = own("../tests/python/check_schemas.py");
        let output = Command::new(python).arg(script).arg(&file).output().expect("Python starts");
        let said = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(output.status.success(), "{}{}", said(&output.stdout), said(&output.stderr));
        println!("{}", said(&output.stdout));
    }
}

/// Whether the parser accepts a document; files that it names exist.
fn is_parsed(kind: &str, document: &Value) -> bool {
    let folder = TempDir::new().unwrap();
    std::fs::write(
        folder.path().join("identified.toml"),
        "[structure]\nmass_kg = 1.6\nnatural_frequency_hz = 2.5\ndamping_ratio = 0.0038\n",
    )
    .unwrap();
    std::fs::write(folder.path().join("record.csv"), "t,z_mm\n0,0\n0.01,0.4\n0.02,0\n").unwrap();
    std::fs::create_dir(folder.path().join("records")).unwrap();
    for (from, to) in [("campaigns/records/synthetic.csv", "records/synthetic.csv"), ("cases/shake.csv", "shake.csv")] {
        std::fs::copy(own(from), folder.path().join(to)).unwrap();
    }
    let name = folder.path().join("file.toml").display().to_string();
    // TOML has no null.
    let Ok(text) = toml::to_string(&document) else { return false };
    match kind {
        CAMPAIGN => Campaign::parse(Source::new(name, text)).is_ok(),
        CASE => Case::parse(&Source::new(name, text), "case").is_ok(),
        _ => {
            std::fs::write(folder.path().join("identified.toml"), text).unwrap();
            let campaign = "set_up_file = \"identified.toml\"\nname = \"t\"\nstructure = { mass_kg = 1.6 }\n\
                            [[set_up]]\nname = \"s\"\nbase_amplitude_m = 1e-4\n[[experiment]]\nkind = \"free_vibration\"\n\
                            start_m = 0.03\nmeasure_s = 5\n";
            Campaign::parse(Source::new(name, campaign)).is_ok()
        }
    }
}

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
            if value.is_object() {
                let mut misspelt = value.clone();
                misspelt["zzz"] = 1.into();
                refuse(&mut documents, format!("{at}/zzz"), &with(&document, place, misspelt));
            }
            let Some((path, of, key)) = declared(&tables, &document, place) else { continue };
            if matches!(key.kind, Kind::Word(_)) {
                refuse(&mut documents, format!("{at} = \"zzz\""), &with(&document, place, "zzz".into()));
            }
            if value.is_number() && key.kind != Kind::TextOrPlace {
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
    for n in 0..1500 {
        let (kind, text) = &seeds[n % seeds.len()];
        let Ok(table) = mutations::mutate(text, &mut rng).parse::<toml::Table>() else { continue };
        let Ok(document) = serde_json::to_value(table) else { continue };
        if is_parsed(kind, &document) {
            documents.expect(true, kind, format!("mutation {n}: {document}"), &document);
        }
    }
    assert!(documents.0.len() > 300, "{}", documents.0.len());
    documents.judge();
}

/// Every choice of some items, but none.
fn choices<T: Copy>(items: &[T]) -> Vec<Vec<T>> {
    let pick =
        |bits: usize| items.iter().enumerate().filter(|(n, _)| bits >> n & 1 == 1).map(|(_, item)| *item).collect();
    (1..1 << items.len()).map(pick).collect()
}

#[test]
fn every_new_file_is_accepted_without_a_warning() {
    let values = Values::default();
    for dampers in choices(&Damper::ALL) {
        for experiments in choices(&Excitation::ALL) {
            let text = new_file::campaign("new", &dampers, &experiments, &values);
            let campaign = Campaign::parse(Source::new("new.toml", text.clone()));
            let campaign = campaign.unwrap_or_else(|refusal| panic!("{refusal}\n{text}"));
            assert!(campaign.source.warnings().is_empty(), "{:?}\n{text}", campaign.source.warnings());
            assert_eq!((campaign.set_ups.len(), campaign.experiments.len()), (dampers.len(), experiments.len()));
        }
    }
    for damper in Damper::ALL {
        for excitation in Excitation::ALL {
            let text = new_file::case("new", damper, excitation, &values);
            let source = Source::new("new.toml", text.clone());
            Case::parse(&source, "new").unwrap_or_else(|refusal| panic!("{refusal}\n{text}"));
            assert!(source.warnings().is_empty(), "{:?}\n{text}", source.warnings());
        }
    }
}

/// Success without a warning. A loaded machine may predict long experiments in part only.
fn is_quiet(output: &std::process::Output) -> bool {
    let said = String::from_utf8_lossy(&output.stderr);
    output.status.success() && said.lines().all(|line| line.contains("predicted in part only"))
}

#[test]
fn every_new_campaign_passes_its_dry_run_and_every_new_case_is_simulated() {
    let folder = TempDir::new().unwrap();
    for damper in ["bare", "spid", "fd", "hybrid", "tmd", "bare,spid,fd,hybrid,tmd"] {
        for experiment in ["stepped-sine", "free-vibration", "impulse"] {
            let chosen = ["--damper", damper, "--experiment", experiment, "--force"];
            damprig(&folder)
                .arg("init")
                .args(chosen)
                .assert()
                .success()
                .stdout(contains("damprig run campaign.toml --dry-run"));
            let dry = damprig(&folder).args(["run", "campaign.toml", "--dry-run"]).assert();
            let output = dry.get_output();
            assert!(is_quiet(output), "{damper}, {experiment}: {output:?}");
            if !damper.contains(',') {
                damprig(&folder).args(["init", "--case"]).args(chosen).assert().success();
                let simulated = damprig(&folder).args(["simulate", "case.toml"]).assert();
                let output = simulated.get_output();
                assert!(is_quiet(output), "{damper}, {experiment}: {output:?}");
            }
        }
    }
}

#[test]
fn a_new_campaign_has_the_given_values_and_explains_each_key_once() {
    let folder = TempDir::new().unwrap();
    let flags =
        ["--mass-kg", "2", "--natural-frequency-hz", "4", "--damping-ratio", "0.01", "--base-amplitude-m", "0.001"];
    damprig(&folder).args(["init", "my lab.toml", "--damper", "spid,tmd"]).args(flags).assert().success();
    let text = std::fs::read_to_string(folder.path().join("my lab.toml")).unwrap();
    let campaign = Campaign::parse(Source::new("my lab.toml", text.clone())).unwrap();
    let model = campaign.set_ups[0].model();
    assert_eq!((campaign.name.as_str(), model.structure.mass_kg), ("my-lab", 2.0));
    assert!((campaign.set_ups[1].natural_frequency_hz() / 4.0 - 1.0).abs() < 1e-12);
    assert_eq!(campaign.set_ups[0].base_amplitude_m, 0.001);
    for words in [
        "# M, the structure's mass",
        "# ζ = c/(2√(kM)); or damping_n_s_per_m",
        "# the time that is measured at each frequency",
    ] {
        assert_eq!(text.matches(words).count(), 1, "{words}:\n{text}");
    }
    // The mass ratio of the particle and that of the tuned mass are two keys.
    assert_eq!(text.matches("mass_ratio = 0.1").count(), 2, "{text}");
    assert_eq!(text.matches("# m/M, the").count(), 2, "{text}");
}

#[test]
fn a_lightly_damped_bare_structure_is_driven_less() {
    let z = |damping_ratio: f64, damper: Damper| {
        let values = Values { damping_ratio, ..Values::default() };
        let text = new_file::campaign("new", &[damper], &[Excitation::SteppedSine], &values);
        Campaign::parse(Source::new("new.toml", text)).unwrap().set_ups[0].base_amplitude_m
    };
    assert_eq!(z(0.05, Damper::Bare), 0.0015);
    assert_eq!(z(0.0038, Damper::Spid), 0.0015);
    // Z/(2ζ) is two thirds of the limit of 78 mm, in two digits.
    let driven = z(0.001, Damper::Bare);
    assert!((0.045..0.0531).contains(&(driven / 0.002)), "{driven}");
}

#[test]
fn an_existing_file_or_a_value_out_of_range_is_refused_and_nothing_is_written() {
    let folder = folder_with("mine");
    let refused = |arguments: &[&str], words: &[&str]| {
        let output = damprig(&folder).arg("init").args(arguments).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        words.iter().for_each(|word| assert!(said.contains(word), "{arguments:?}: no {word:?} in {said}"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    };
    refused(&["test.toml"], &["cannot write test.toml: it exists", "--force"]);
    refused(&["--restitution", "1.2"], &["particle.wall.coefficient` = 1.2", "from 0 to 1", "nothing was written"]);
    refused(&["--natural-frequency-hz", "60"], &["at most 50 Hz"]);
    refused(&["--damper", "spid,spid"], &["--damper: spid is named twice"]);
    refused(&["--case", "--damper", "spid,fd"], &["--damper: a case has one, not spid and fd"]);
    refused(&["--damper", "spring"], &["hybrid"]);
    assert_eq!(std::fs::read_to_string(folder.path().join("test.toml")).unwrap(), "mine");
    damprig(&folder).args(["init", "test.toml", "--force"]).assert().success();
    assert!(std::fs::read_to_string(folder.path().join("test.toml")).unwrap().starts_with("# A campaign"));
}

/// Runs `damprig init` on a terminal, whose keyboard types these lines.
#[cfg(target_os = "linux")]
fn answered(folder: &TempDir, lines: &str) -> Option<String> {
    use std::io::Write;
    use std::process::Stdio;

    let binary = assert_cmd::cargo::cargo_bin("damprig");
    let child = Command::new("script")
        .args(["-qec", &format!("{} init", binary.display()), "/dev/null"])
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut child) = child else {
        println!("left out: no `script`, which makes a terminal");
        return None;
    };
    child.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}");
    Some(said)
}

#[cfg(target_os = "linux")]
#[test]
fn on_a_terminal_it_asks_and_takes_the_defaults_in_brackets() {
    let folder = TempDir::new().unwrap();
    let Some(said) = answered(&folder, "\nbare,fd\nimpulse\n2.0\n\nmuch\n0.01\n\n") else { return };
    for words in [
        "Dampers, of bare, spid, fd, hybrid, tmd [bare,spid]",
        "must be a number 0 or greater",
        "Written to campaign.toml",
    ] {
        assert!(said.contains(words), "no {words:?} in {said}");
    }
    let campaign = Campaign::read(&folder.path().join("campaign.toml")).unwrap();
    let names: Vec<&str> = campaign.set_ups.iter().map(|set_up| set_up.name.as_str()).collect();
    assert_eq!((names, campaign.experiments.len()), (vec!["bare", "fd"], 1));
    assert_eq!(campaign.set_ups[0].model().structure.mass_kg, 2.0);
    assert!((campaign.set_ups[0].model().structure.damping_ratio() - 0.01).abs() < 1e-12);
    let Some(said) = answered(&folder, "case\nhybrid\nfree-vibration\n\n\n\n\n") else { return };
    assert!(said.contains("Next: damprig simulate case.toml"), "{said}");
    assert!(Case::read(&folder.path().join("case.toml")).unwrap().set_up.friction_damper.is_some());
}
