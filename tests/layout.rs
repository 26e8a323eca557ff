//! Checks the allowed dependencies between crates and between the modules of a crate.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, Package};
use damprig_tests::support::images::project;

/// The project's crates, and the project crates that each may depend on.
const DIRECTIONS: [(&str, &[&str]); 17] = [
    ("damprig-core", &[]),
    ("damprig-protocol", &["damprig-core"]),
    ("damprig-device", &["damprig-core", "damprig-protocol"]),
    ("damprig-simulator", &["damprig-core", "damprig-protocol", "damprig-device"]),
    ("damprig-continuation", &["damprig-core", "damprig-structures"]),
    ("damprig-fourier", &[]),
    ("damprig-identification", &["damprig-core", "damprig-fourier"]),
    ("damprig-motion", &["damprig-core", "damprig-device", "damprig-simulator", "damprig-structures"]),
    ("damprig-particles", &["damprig-core"]),
    ("damprig-structures", &["damprig-core"]),
    ("damprig-firmware", &["damprig-core", "damprig-protocol", "damprig-device", "damprig-simulator"]),
    (
        "damprig",
        &[
            "damprig-continuation",
            "damprig-core",
            "damprig-fourier",
            "damprig-identification",
            "damprig-motion",
            "damprig-particles",
            "damprig-structures",
            "damprig-protocol",
            "damprig-device",
            "damprig-simulator",
        ],
    ),
    ("damprig-thesis", &["damprig", "damprig-core"]),
    ("damprig-tests", &["damprig-core", "damprig-protocol", "damprig-device", "damprig-simulator"]),
    ("damprig-fuzzing", &["damprig", "damprig-core", "damprig-protocol", "damprig-device", "damprig-simulator"]),
    ("damprig-benches", &["damprig", "damprig-core", "damprig-protocol"]),
    ("damprig-python", &["damprig", "damprig-core", "damprig-protocol", "damprig-simulator"]),
];

/// Dependencies that the crates under `shared/` must not have, directly or indirectly: each belongs to one side only.
const ONE_SIDED: [&str; 9] =
    ["embassy", "cortex-m", "defmt", "tokio", "async-std", "std_detect", "clap", "arrow", "serialport"];

/// The modules of the core from the lowest layer to the highest; each may import only earlier ones.
const CORE_LAYERS: [&str; 12] = [
    "scalar",
    "sine",
    "io",
    "model",
    "integrator",
    "fixed_point",
    "analysis",
    "measure",
    "control",
    "settings",
    "twin",
    "rig",
];

/// The modules of the host from the lowest layer to the highest.
const HOST_LAYERS: [&str; 31] = [
    "failure",
    "host_time",
    "quantity",
    "storage",
    "table",
    "input",
    "signal_file",
    "settings",
    "structure",
    "setup",
    "motion_record",
    "spectrum",
    "campaign",
    "client",
    "run_folder",
    "prediction",
    "runner",
    "simulation",
    "continuation",
    "study",
    "optimise",
    "file_keys",
    "identify",
    "compare",
    "calibrate",
    "board",
    "report",
    "recorded_run",
    "monitor",
    "manual",
    "cli",
];

/// The modules of the source document's program from the lowest layer to the highest.
const THESIS_LAYERS: [&str; 13] = [
    "files",
    "keys",
    "results",
    "catalogue",
    "published_curve",
    "published",
    "found",
    "claims",
    "marked",
    "run",
    "compared",
    "page",
    "cli",
];

fn workspace() -> Metadata {
    MetadataCommand::new().manifest_path(project().join("Cargo.toml")).other_options(locked()).exec().unwrap()
}

/// Metadata of the firmware without its dependencies, which are downloaded only for a build.
fn firmware() -> Metadata {
    let manifest = project().join("firmware/Cargo.toml");
    MetadataCommand::new().manifest_path(manifest).no_deps().other_options(locked()).exec().unwrap()
}

fn locked() -> Vec<String> {
    vec!["--locked".into()]
}

fn named<'a>(metadata: &'a Metadata, name: &str) -> &'a Package {
    metadata.packages.iter().find(|package| package.name == name).unwrap_or_else(|| panic!("no package {name}"))
}

/// All direct and indirect dependencies of a package, except those only for its tests.
fn reached(metadata: &Metadata, name: &str) -> BTreeSet<String> {
    let nodes = &metadata.resolve.as_ref().unwrap().nodes;
    let mut open = vec![&named(metadata, name).id];
    let mut seen = BTreeSet::new();
    while let Some(id) = open.pop() {
        let node = nodes.iter().find(|node| node.id == *id).unwrap();
        let normal =
            node.deps.iter().filter(|dep| dep.dep_kinds.iter().any(|kind| kind.kind == DependencyKind::Normal));
        open.extend(normal.map(|dep| &dep.pkg).filter(|id| seen.insert((*id).clone())));
    }
    metadata.packages.iter().filter(|p| seen.contains(&p.id)).map(|p| p.name.to_string()).collect()
}

#[test]
fn each_crate_depends_only_on_those_below_it() {
    let (workspace, firmware) = (workspace(), firmware());
    for (name, allowed) in DIRECTIONS {
        let metadata = if name == "damprig-firmware" { &firmware } else { &workspace };
        for dependency in &named(metadata, name).dependencies {
            let ours = dependency.name.starts_with("damprig");
            assert!(
                !ours || allowed.contains(&dependency.name.as_str()),
                "{name} depends on {}: allowed are {allowed:?}",
                dependency.name
            );
        }
    }
}

#[test]
fn every_crate_of_the_project_is_in_the_table() {
    let (workspace, firmware) = (workspace(), firmware());
    let stated: BTreeSet<_> = DIRECTIONS.iter().map(|(name, _)| (*name).to_string()).collect();
    let members = workspace.workspace_packages().into_iter().chain(firmware.workspace_packages());
    let present: BTreeSet<_> = members.map(|package| package.name.to_string()).collect();
    assert_eq!(present, stated);
}

#[test]
fn shared_crates_have_no_dependencies_that_belong_to_one_side() {
    let workspace = workspace();
    for name in ["damprig-core", "damprig-protocol", "damprig-device", "damprig-simulator"] {
        let reached = reached(&workspace, name);
        assert!(reached.contains("serde"), "{name}: the walk found too little: {reached:?}");
        for package in &reached {
            let wrong = ONE_SIDED.iter().find(|prefix| package.starts_with(**prefix));
            assert!(wrong.is_none(), "{name} reaches {package}");
        }
    }
}

/// The top-level modules of its crate that a source file names: `crate::a::…`, `crate::{a, b::…}`. Comments are
/// ignored.
fn named_modules(source: &str) -> BTreeSet<String> {
    let code: String = source.lines().map(|line| line.split("//").next().unwrap_or("").to_owned() + "\n").collect();
    let mut modules = BTreeSet::new();
    for path in code.split("crate::").skip(1) {
        let Some(group) = path.strip_prefix('{') else {
            modules.insert(first_word(path));
            continue;
        };
        let mut depth = 0;
        let mut item = String::new();
        for character in group.chars() {
            match character {
                '}' if depth == 0 => break,
                ',' if depth == 0 => drop(modules.insert(first_word(&std::mem::take(&mut item)))),
                _ => {
                    depth += i32::from(character == '{') - i32::from(character == '}');
                    item.push(character);
                }
            }
        }
        modules.insert(first_word(&item));
    }
    modules.remove("");
    modules
}

fn first_word(path: &str) -> String {
    path.trim().chars().take_while(|character| character.is_alphanumeric() || *character == '_').collect()
}

/// All source files below a folder.
fn sources(folder: &Path) -> Vec<(String, String)> {
    let mut files = vec![];
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push((path.display().to_string(), fs::read_to_string(&path).unwrap()));
        }
    }
    files
}

/// The imports of a crate from a higher layer, and the modules without a layer. `layers` are in ascending order.
fn upward_imports(files: &[(String, String)], src: &Path, layers: &[&str]) -> Vec<String> {
    let layer = |module: &str| layers.iter().position(|name| *name == module);
    let mut wrong = vec![];
    for (path, source) in files {
        let below = Path::new(path).strip_prefix(src).unwrap().with_extension("");
        let own = below.iter().next().unwrap().to_string_lossy().into_owned();
        if own == "lib" || own == "main" {
            continue;
        }
        let Some(own_layer) = layer(&own) else {
            wrong.push(format!("{path}: the module {own} has no layer"));
            continue;
        };
        for module in named_modules(source) {
            if layer(&module).is_some_and(|layer| layer > own_layer) {
                wrong.push(format!("{path}: {own} imports the higher module {module}"));
            }
        }
    }
    wrong
}

fn assert_layered(crate_folder: &str, layers: &[&str]) {
    let src = project().join(crate_folder).join("src");
    let files = sources(&src);
    assert!(files.len() > layers.len() / 2, "{crate_folder}: the walk found {} files", files.len());
    let wrong = upward_imports(&files, &src, layers);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_module_of_the_core_imports_only_lower_ones() {
    assert_layered("shared/core", &CORE_LAYERS);
}

#[test]
fn a_module_of_the_host_imports_only_lower_ones() {
    assert_layered("host", &HOST_LAYERS);
}

#[test]
fn a_module_of_the_source_documents_program_imports_only_lower_ones() {
    assert_layered("thesis", &THESIS_LAYERS);
}

#[test]
fn an_import_of_a_higher_module_is_found_in_every_form() {
    let layers = ["low", "middle", "high"];
    let upward = |path: &str, source: &str| {
        upward_imports(&[(format!("src/{path}"), source.into())], Path::new("src"), &layers).len()
    };
    for source in [
        "use crate::high::Name;",
        "use crate::{low::Name, high::{A, B}};",
        "    fn f() -> crate::high::Name {}",
        "#[cfg(test)]\nmod tests {\n    use crate::high;\n}",
    ] {
        assert_eq!(upward("middle/part.rs", source), 1, "{source}");
        assert_eq!(upward("high.rs", source), 0, "{source}");
    }
    assert_eq!(upward("middle.rs", "// use crate::high::Name;\nuse crate::low::{Name, high};"), 0);
    assert_eq!(upward("low.rs", "use crate::{middle, high};"), 2);
    assert_eq!(upward("other.rs", ""), 1, "a module without a layer");
}
