//! Documents for the JSON Schemas: shipped files and examples, the verdict of the parser, and that of an independent validator.

use std::path::{Path, PathBuf};
use std::process::Command;

use damprig::campaign::Campaign;
use damprig::continuation::Continuation;
use damprig::file_keys::FileKind;
use damprig::input::Source;
use damprig::optimise::Optimisation;
use damprig::simulation::Case;
use damprig::study::Study;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::case_examples::MORE_CASES;
use super::design_examples::{MORE_CONTINUATION, MORE_OPTIMISATIONS, MORE_STUDIES};
use super::examples::{MORE_CAMPAIGN, MORE_SHEETS, PLANTS, SET_UP_FILE};
use crate::common::{damprig, python};
use crate::mutations;

pub const CAMPAIGN: &str = "campaign";
pub const CASE: &str = "case";
pub const SET_UP: &str = "set-up";
pub const STUDY: &str = "study";
pub const OPTIMISATION: &str = "optimisation";
pub const CONTINUATION: &str = "continuation";

pub fn own(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

pub fn json_of(toml: &str) -> Value {
    serde_json::to_value(toml.parse::<toml::Table>().expect("TOML")).expect("JSON")
}

/// All shipped files and those of this test: name, kind, content.
pub fn files() -> Vec<(String, &'static str, Value)> {
    let mut files = Vec::new();
    for (folder, kind) in [
        ("campaigns", CAMPAIGN),
        ("cases", CASE),
        ("studies", STUDY),
        ("optimisations", OPTIMISATION),
        ("continuations", CONTINUATION),
    ] {
        let entries = std::fs::read_dir(own(folder)).unwrap().flatten().map(|entry| entry.path());
        for path in entries.filter(|path| path.extension().is_some_and(|extension| extension == "toml")) {
            files.push((path.display().to_string(), kind, json_of(&std::fs::read_to_string(&path).unwrap())));
        }
    }
    assert!(files.len() > 12, "{}", files.len());
    files.extend(mutations::CAMPAIGNS.map(|text| ("a seed of mutations".into(), CAMPAIGN, json_of(text))));
    files.push(("more campaigns".into(), CAMPAIGN, json_of(MORE_CAMPAIGN)));
    files.push(("more sheets".into(), CAMPAIGN, json_of(MORE_SHEETS)));
    files.extend(PLANTS.map(|text| ("plants".into(), CAMPAIGN, json_of(text))));
    files.extend(MORE_CASES.map(|text| ("more cases".into(), CASE, json_of(text))));
    files.push(("set-up file".into(), SET_UP, json_of(SET_UP_FILE)));
    files.extend(MORE_STUDIES.map(|text| ("more studies".into(), STUDY, json_of(text))));
    files.extend(MORE_OPTIMISATIONS.map(|text| ("more optimisations".into(), OPTIMISATION, json_of(text))));
    files.push(("more of a continuation".into(), CONTINUATION, json_of(MORE_CONTINUATION)));
    files
}

pub fn kind_of(name: &str) -> FileKind {
    match name {
        CAMPAIGN => FileKind::Campaign,
        CASE => FileKind::Case,
        STUDY => FileKind::Study,
        OPTIMISATION => FileKind::Optimisation,
        CONTINUATION => FileKind::Continuation,
        _ => FileKind::SetUp,
    }
}

/// Documents with the verdict that their schema must give.
#[derive(Default)]
pub struct Documents(pub Vec<Value>);

impl Documents {
    pub fn expect(&mut self, is_valid: bool, kind: &str, name: impl Into<String>, document: &Value) {
        let name = name.into();
        self.0.push(json!({ "name": name, "schema": kind, "is_valid": is_valid, "document": document }));
    }

    /// Lets the validator judge them by the schemas that `damprig schema` prints.
    pub fn judge(self) {
        let folder = TempDir::new().unwrap();
        let printed = |kind: &str| -> Value {
            let output = damprig(&folder).args(["schema", kind]).output().unwrap();
            serde_json::from_slice(&output.stdout).expect("a schema is JSON")
        };
        let kinds = [CAMPAIGN, CASE, SET_UP, STUDY, OPTIMISATION, CONTINUATION];
        let schemas: serde_json::Map<String, Value> =
            kinds.into_iter().map(|kind| (kind.to_string(), printed(kind))).collect();
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
pub fn is_parsed(kind: &str, document: &Value) -> bool {
    let folder = TempDir::new().unwrap();
    std::fs::write(
        folder.path().join("identified.toml"),
        "[structure]\nmass_kg = 1.6\nnatural_frequency_hz = 2.5\ndamping_ratio = 0.0038\n",
    )
    .unwrap();
    std::fs::write(folder.path().join("record.csv"), "t,z_mm\n0,0\n0.01,0.4\n0.02,0\n").unwrap();
    std::fs::write(folder.path().join("voltage.csv"), "t_s,ch1\n0,0\n0.01,0.4\n0.02,0\n").unwrap();
    std::fs::write(folder.path().join("one.csv"), "1\n").unwrap();
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
        STUDY | OPTIMISATION | CONTINUATION => {
            let [cases, files, more] = ["cases", "files", "files/cases"].map(|name| folder.path().join(name));
            for folder in [&cases, &files, &more] {
                std::fs::create_dir(folder).unwrap();
            }
            for case in ["spid.toml", "soft-wall.toml", "many-particles.toml", "frame.toml"] {
                std::fs::copy(own("cases").join(case), cases.join(case)).unwrap();
            }
            std::fs::copy(own("optimisations/cases/hybrid.toml"), more.join("hybrid.toml")).unwrap();
            // Of the overlay of a study.
            let (continuations, curves) = (folder.path().join("continuations"), "grazing-curve.toml");
            std::fs::create_dir(&continuations).unwrap();
            std::fs::copy(own("continuations").join(curves), continuations.join(curves)).unwrap();
            let design = "particle.clearance_m,particle.wall.coefficient\n0.03,0.5\n0.04,0.6\n";
            std::fs::write(files.join("design.csv"), design).unwrap();
            let file = files.join("file.toml");
            std::fs::write(&file, text).unwrap();
            match kind {
                STUDY => Study::read(&file).is_ok(),
                OPTIMISATION => Optimisation::read(&file).is_ok(),
                _ => Continuation::read(&file).is_ok(),
            }
        }
        _ => {
            std::fs::write(folder.path().join("identified.toml"), text).unwrap();
            let campaign = "set_up_file = \"identified.toml\"\nname = \"t\"\nstructure = { mass_kg = 1.6 }\n\
                            [[set_up]]\nname = \"s\"\nbase_amplitude_m = 1e-4\n[[experiment]]\nkind = \"free_vibration\"\n\
                            start_m = 0.03\nmeasure_s = 5\n";
            Campaign::parse(Source::new(name, campaign)).is_ok()
        }
    }
}
