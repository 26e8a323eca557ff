//! Who may depend on whom: the layout is the architecture.

use std::collections::BTreeSet;

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, Package};
use damprig_tests::support::images::project;

/// Our crates, and which of ours each may depend on.
const DIRECTIONS: [(&str, &[&str]); 9] = [
    ("damprig-core", &[]),
    ("damprig-protocol", &["damprig-core"]),
    ("damprig-device", &["damprig-core", "damprig-protocol"]),
    ("damprig-simulator", &["damprig-core", "damprig-protocol", "damprig-device"]),
    ("damprig-firmware", &["damprig-core", "damprig-protocol", "damprig-device", "damprig-simulator"]),
    ("damprig", &["damprig-core", "damprig-protocol", "damprig-device", "damprig-simulator"]),
    ("damprig-tests", &["damprig-core", "damprig-protocol", "damprig-device", "damprig-simulator"]),
    ("damprig-fuzzing", &["damprig-core", "damprig-protocol", "damprig-device", "damprig-simulator"]),
    ("damprig-benches", &["damprig-core"]),
];

/// What the crates under `shared/` never reach, directly or through others: what belongs to one side alone.
const ONE_SIDED: [&str; 9] =
    ["embassy", "cortex-m", "defmt", "tokio", "async-std", "std_detect", "clap", "arrow", "serialport"];

fn workspace() -> Metadata {
    MetadataCommand::new().manifest_path(project().join("Cargo.toml")).other_options(locked()).exec().unwrap()
}

/// Without what it depends on: that is fetched only to build it.
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

/// Everything that a package is built from, directly or not; what only its tests need is left out.
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
fn every_crate_of_ours_has_its_directions_stated() {
    let (workspace, firmware) = (workspace(), firmware());
    let stated: BTreeSet<_> = DIRECTIONS.iter().map(|(name, _)| (*name).to_string()).collect();
    let members = workspace.workspace_packages().into_iter().chain(firmware.workspace_packages());
    let present: BTreeSet<_> = members.map(|package| package.name.to_string()).collect();
    assert_eq!(present, stated);
}

#[test]
fn what_both_sides_share_reaches_nothing_of_one_side() {
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
