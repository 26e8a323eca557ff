//! A set-up means the same in a case and in a campaign, and the parser applies the declared keys.
//!
//! The files are generated from the declarations, at random with fixed seeds.

use std::collections::BTreeSet;

use damprig::campaign::Campaign;
use damprig::input::Source;
use damprig::input::key::{DefaultValue, Key, KeyUnit, KeyedQuantity, Need, Range, Table, ValueKind};
use damprig::simulation::Case;
use damprig::{motion_record, setup, simulation, structure};
use fastrand::Rng;

/// A change to one table of a generated file.
#[derive(Clone)]
struct Edit {
    path: &'static str,
    kind: Option<&'static str>,
    /// Key to change or add.
    key: &'static str,
    /// New value; `None` removes the key.
    value: Option<String>,
}

impl Edit {
    fn new(table: &Table, key: &'static str, value: Option<String>) -> Self {
        Self { path: table.path, kind: table.kind, key, value }
    }
}

/// Tables and quantities of a structure with several places, which `multi_degree.rs` tests, and the file that would have to exist.
const SEVERAL_PLACES: [&str; 10] = [
    "storey",
    "beam",
    "mode",
    "matrices",
    "places",
    "modal_damping_ratio",
    "observed_place",
    "place",
    "other_place",
    "set_up_file",
];

fn is_of_one_place(table: &Table) -> bool {
    !SEVERAL_PLACES.contains(&table.path)
}

/// Generates files from the declared tables.
struct Writer<'t> {
    tables: &'t [Table],
    rng: Rng,
    edit: Option<Edit>,
    /// Path, kind and key of the generated entries.
    written: Vec<(&'static str, Option<&'static str>, &'static str)>,
}

type Lines = Vec<(&'static str, String)>;

impl<'t> Writer<'t> {
    fn new(tables: &'t [Table], seed: u64) -> Self {
        Self { tables, rng: Rng::with_seed(seed), edit: None, written: Vec::new() }
    }

    /// Keys and values of the table at `path`; the kind is chosen at random if there are several.
    fn table(&mut self, path: &'static str) -> Lines {
        let mut tables: Vec<&Table> = self.tables.iter().filter(|table| table.path == path).collect();
        let mut lines = Lines::new();
        if tables[0].kind.is_some() {
            let kind = tables[self.rng.usize(..tables.len())].kind;
            lines.push(("kind", format!("{:?}", kind.expect("all of a path have one"))));
            // Tables of a kind complete each other.
            tables.retain(|table| table.kind == kind);
        }
        for quantity in tables.iter().flat_map(|table| table.quantities) {
            if SEVERAL_PLACES.contains(&quantity.name()) {
                continue;
            }
            if let Some(key) = self.choose(quantity, &lines) {
                lines.push((key.name, self.value(path, key)));
                self.written.push((path, tables[0].kind, key.name));
            }
        }
        if let Some(edit) = self.edit.clone().filter(|edit| edit.path == path && edit.kind == tables[0].kind) {
            lines.retain(|(key, _)| *key != edit.key);
            lines.extend(edit.value.map(|value| (edit.key, value)));
        }
        lines
    }

    /// The key for a quantity, given the `lines` so far.
    fn choose(&mut self, quantity: &KeyedQuantity, lines: &Lines) -> Option<&'static Key> {
        let mut need = quantity.need;
        while let Need::If(_, name, then, otherwise) = need {
            need = if lines.iter().any(|(key, _)| *key == name) { *then } else { *otherwise };
        }
        let is_written = match need {
            Need::Required | Need::RequiredUnless(_) => true,
            Need::Forbidden => false,
            _ => self.rng.bool(),
        };
        is_written.then(|| &quantity.keys[self.rng.usize(..quantity.keys.len())])
    }

    fn value(&mut self, path: &'static str, key: &Key) -> String {
        match key.kind {
            ValueKind::Table | ValueKind::OneOrMoreTables => {
                let full = if path.is_empty() { key.name.into() } else { format!("{path}.{}", key.name) };
                let inner = self.tables.iter().find(|table| table.path == full).expect("a declared table").path;
                let inner = self.table(inner);
                let lines: Vec<String> = inner.iter().map(|(key, value)| format!("{key} = {value}")).collect();
                format!("{{ {} }}", lines.join(", "))
            }
            ValueKind::Word(words) => format!("{:?}", words[self.rng.usize(..words.len())]),
            ValueKind::Number(_) => format!("{:?}", self.number(path, key.name)),
            ValueKind::Numbers(Range::Positive) => "[0.01, 0.05]".into(),
            ValueKind::Numbers(_) => "[0.0, 0.05]".into(),
            ValueKind::Text => "\"some.csv\"".into(),
            ValueKind::TextOrPlace => "2".into(),
            ValueKind::NumbersOrTable(_) | ValueKind::Texts | ValueKind::TextOrCase | ValueKind::Tables => {
                panic!("no case has {}", key.name)
            }
        }
    }

    /// A number of realistic magnitude, so that any combination is a valid set-up.
    fn number(&mut self, path: &str, key: &str) -> f64 {
        let (low, high) = match (key, KeyUnit::of(key).map_or("", |unit| unit.symbol)) {
            ("seed", _) => return f64::from(self.rng.u8(..)),
            // Spheres that fit into their box.
            ("count", _) => return f64::from(self.rng.u8(1..5)),
            ("diameter_m", _) => (4e-3, 6e-3),
            ("restitution", _) => (0.2, 0.9),
            ("contact_time_s", _) => (5e-4, 2e-3),
            ("pulse_factor", _) => (1.0, 3.0),
            ("steps_per_contact", _) => (20.0, 30.0),
            ("youngs_modulus_pa", _) => (1e9, 1e10),
            ("poisson_ratio" | "particle_poisson_ratio", _) => (0.1, 0.4),
            ("width_m" | "height_m", _) => (0.05, 0.1),
            ("length_m", _) => (0.1, 0.2),
            ("stiffness_n_per_m", _) if path == "many_particles" => (1e5, 1e6),
            ("from_hz", _) => (0.1, 1.0),
            ("to_hz", _) => (5.0, 10.0),
            ("duration_s", _) if path == "base.noise" => (4.0, 8.0),
            ("start_m", _) => (-4e-5, 4e-5),
            ("offset_m", _) => (-3e-5, 3e-5),
            ("steady_from_cycle", _) => return f64::from(self.rng.u8(..3)),
            (_, "kg") => (1.0, 1.9),
            (_, "Hz") => (1.0, 10.0),
            (_, "N/m") => (100.0, 1000.0),
            (_, "m") => (1e-3, 0.1),
            (_, "Pa") => (1e4, 1e6),
            _ => (0.05, 1.0),
        };
        low + (high - low) * self.rng.f64()
    }
}

fn text(lines: &Lines) -> String {
    lines.iter().map(|(key, value)| format!("{key} = {value}\n")).collect()
}

fn case(text: &str) -> Result<Case, String> {
    Case::parse(&Source::new("case.toml", text), "case").map_err(|refusal| refusal.to_string())
}

/// A campaign with these top-level tables and one set-up.
fn campaign(shared: &str, set_up: &str) -> Result<Campaign, String> {
    let experiment = "kind = \"stepped_sine\"\nfrequencies_hz = [2.5]\nstart = \"from_rest\"\ndwell_s = 4\n";
    let text = format!("name = \"t\"\n{shared}[[experiment]]\n{experiment}[[set_up]]\nname = \"s\"\n{set_up}");
    Campaign::parse(Source::new("campaign.toml", text)).map_err(|refusal| refusal.to_string())
}

/// All tables of a case.
fn tables() -> Vec<Table> {
    [setup::TABLES, structure::TABLES, simulation::TABLES, motion_record::TABLES].concat()
}

/// The case of a seed with a change.
fn written(seed: u64, edit: Option<Edit>) -> String {
    let all = tables();
    let mut writer = Writer::new(&all, seed);
    writer.edit = edit;
    text(&writer.table(""))
}

/// The first seed whose case has the table and key and satisfies the condition.
fn seed_with(table: &Table, key: Option<&str>, wanted: impl Fn(u64) -> bool) -> u64 {
    let all = tables();
    let seed = (0..50_000).find(|seed| {
        let mut writer = Writer::new(&all, *seed);
        writer.table("");
        let is_it = |(path, kind, name): &(&str, Option<&str>, &str)| {
            *path == table.path && *kind == table.kind && key.is_none_or(|key| key == *name)
        };
        writer.written.iter().any(is_it) && wanted(*seed)
    });
    seed.unwrap_or_else(|| panic!("no case has `{}` {:?} with {key:?}", table.path, table.kind))
}

#[test]
fn a_set_up_written_in_a_case_and_in_a_campaign_gives_the_same_model() {
    const Z_M: f64 = 0.003;
    for seed in 0..2000 {
        let mut writer = Writer::new(setup::TABLES, seed);
        let mut set_up = writer.table("");
        set_up.retain(|(key, _)| *key != "base_amplitude_m");
        let stated = format!("base_amplitude_m = {Z_M}\n");
        let (at_top, in_base) = if writer.rng.bool() {
            (stated.clone(), String::new())
        } else {
            (String::new(), format!("amplitude_m = {Z_M}, "))
        };
        let sine = format!("base = {{ kind = \"sine\", {in_base}frequency_hz = 2.5 }}\nrun = {{ duration_s = 1 }}\n");
        let alone = text(&set_up);
        // A case has one start, and a campaign no piezoelectric wall.
        if alone.contains("\"unknown\"") || alone.contains("\"piezoelectric\"") {
            continue;
        }
        let case = case(&format!("{alone}{at_top}{sine}")).unwrap_or_else(|refusal| panic!("seed {seed}: {refusal}"));

        // A campaign may have some keys at its top level, for all set-ups.
        let (mut shared, mut own) = (Lines::new(), Lines::new());
        for (key, value) in set_up {
            let is_shared = writer.rng.bool();
            if is_shared && !["structure", "gravity_m_per_s2"].contains(&key) {
                own.push((key, "{}".into()));
            }
            if is_shared { &mut shared } else { &mut own }.push((key, value));
        }
        let campaign = campaign(&text(&shared), &format!("{stated}{}", text(&own)));
        let campaign = campaign.unwrap_or_else(|refusal| panic!("seed {seed}: {refusal}"));
        assert_eq!(case.set_up.without_hertz(), campaign.set_ups[0].model(), "seed {seed}:\n{alone}");
        assert_eq!(case.initial.y_m, campaign.set_ups[0].particle_start_m(), "seed {seed}:\n{alone}");
    }
}

#[test]
fn the_parser_reads_the_declared_keys_and_no_others() {
    let allowed = |answer: &str| -> BTreeSet<String> {
        let list = answer.split("allowed here: ").nth(1).unwrap_or_else(|| panic!("no list in:\n{answer}"));
        list.lines().next().unwrap_or_default().split(", ").map(str::to_string).collect()
    };
    let declared = |path: &str, kind: Option<&str>, tables: &[Table]| -> BTreeSet<String> {
        let own = tables.iter().filter(|table| table.path == path && table.kind == kind);
        let keys = own.flat_map(|table| table.quantities).flat_map(|quantity| quantity.keys);
        keys.map(|key| key.name).chain(kind.map(|_| "kind")).map(str::to_string).collect()
    };
    let all = tables();
    for table in all.iter().filter(|table| table.kind != Some("fixed") && is_of_one_place(table)) {
        let seed = seed_with(table, None, |_| true);
        let answer = case(&written(seed, Some(Edit::new(table, "zzz", Some("1".into()))))).expect_err("zzz");
        assert_eq!(allowed(&answer), declared(table.path, table.kind, &all), "{}:\n{answer}", table.path);
    }
    let answer = campaign("", "zzz = 1\n").expect_err("zzz");
    let mut keys = declared("", None, setup::TABLES);
    keys.extend(["name", "label", "damper", "instruction", "force_amplitude_n"].map(String::from));
    assert_eq!(allowed(&answer), keys, "{answer}");
}

#[test]
fn a_number_is_refused_outside_its_declared_range_and_read_within() {
    let all = tables();
    for table in all.iter().filter(|table| is_of_one_place(table)) {
        let written_ones = |quantity: &&KeyedQuantity| !SEVERAL_PLACES.contains(&quantity.name());
        for key in table.quantities.iter().filter(written_ones).flat_map(|quantity| quantity.keys) {
            let ValueKind::Number(range) = key.kind else { continue };
            let (least, most) = KeyUnit::of(key.name).map_or((0.0, f64::MAX), |unit| (unit.least, unit.most));
            let (low, high) = match range {
                Range::Any => (-most, most),
                Range::NotZero | Range::Positive => (if least > 0.0 { least } else { 1e-300 }, most),
                Range::NotNegative => (0.0, most),
                Range::Between(low, high) | Range::Whole(low, high) => (low, high),
                Range::Above(low, high) => (low.max(least), high),
                Range::Inside(low, high) => (low + 1e-9, high - 1e-9),
                Range::ZeroOr(..) => panic!("no case has {}", key.name),
            };
            let below = if range == Range::NotZero { 0.0 } else { low - 0.1 * low.abs().max(1e-3) };
            // With a top-level Z the base's own amplitude is refused.
            let is_alone = |seed| key.name == "base_amplitude_m" || !written(seed, None).contains("base_amplitude_m");
            let seed = seed_with(table, Some(key.name), is_alone);
            let answer_to = |value: f64| {
                let answer = case(&written(seed, Some(Edit::new(table, key.name, Some(format!("{value:?}"))))));
                let refused = format!("{}` = {value:?} is not allowed", key.name);
                // Ignore other checks of the model.
                let is_range = |text: &str| {
                    text.contains("in magnitude") || range.refusal(value).is_some_and(|r| text.contains(&r))
                };
                answer.err().filter(|text| text.contains(&refused) && is_range(text))
            };
            for value in [below, 2.0 * high].into_iter().filter(|value| value.is_finite()) {
                assert!(answer_to(value).is_some(), "{}.{} = {value:e} was read", table.path, key.name);
            }
            for value in [low, high] {
                assert_eq!(answer_to(value), None, "{}.{} = {value:e}", table.path, key.name);
            }
        }
    }
}

#[test]
fn writing_a_default_changes_nothing() {
    let mut defaults = 0;
    for table in tables().into_iter().filter(is_of_one_place) {
        for quantity in table.quantities {
            let mut need = quantity.need;
            while let Need::If(.., otherwise) = need {
                need = *otherwise;
            }
            let Need::Default(default) = need else { continue };
            let value = match default {
                DefaultValue::Word(word) => format!("{word:?}"),
                _ => format!("{:?}", default.number().expect("a number")),
            };
            let key = quantity.keys[0].name;
            let with = |seed| case(&written(seed, Some(Edit::new(&table, key, Some(value.clone())))));
            let seed = seed_with(&table, Some(key), |seed| with(seed).is_ok());
            let without = case(&written(seed, Some(Edit::new(&table, key, None))));
            assert_eq!(with(seed), without, "{}.{key} = {value}", table.path);
            defaults += 1;
        }
    }
    assert!(defaults > 5, "{defaults}");
}

const STRUCTURE: &str = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n";
const SINE: &str = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }\n";
const RUN: &str = "run = { duration_s = 1 }\n";
const RATIOS: &str = "particle = { mass_ratio = 0.1, clearance_ratio = 5, wall = { kind = \"restitution\", coefficient = 0.5 } }\n\
                      friction_damper = { friction_ratio = 0.4 }\n";

/// The message must contain all of `words`.
fn refused<T: std::fmt::Debug>(answer: Result<T, String>, words: &[&str]) {
    let answer = answer.expect_err("it is refused");
    for word in words {
        assert!(answer.contains(word), "no {word:?} in:\n{answer}");
    }
}

#[test]
fn a_case_may_give_clearance_and_friction_relative_to_its_base_amplitude() {
    let found = case(&format!("{STRUCTURE}{SINE}{RUN}{RATIOS}")).unwrap().set_up;
    assert_eq!(found.particle.unwrap().clearance_m, 5.0 * 0.003);
    assert_eq!(found.friction_damper.unwrap().force_n, 0.4 * found.structure.stiffness_n_per_m * 0.003);
    let pulse = "base = { kind = \"versine\", amplitude_m = -0.01, duration_s = 0.2 }\n";
    let found = case(&format!("{STRUCTURE}{pulse}{RUN}{RATIOS}")).unwrap().set_up;
    assert_eq!(found.particle.unwrap().clearance_m, 5.0 * 0.01, "a downward pulse");
    let stated = "base_amplitude_m = 0.002\ninitial = { x_m = 0.035 }\n";
    let found = case(&format!("{STRUCTURE}{stated}{RUN}{RATIOS}")).unwrap().set_up;
    assert_eq!(found.particle.unwrap().clearance_m, 5.0 * 0.002, "free vibration with a stated Z");
}

#[test]
fn a_ratio_without_a_base_amplitude_is_refused_with_the_key_to_write() {
    let words = [
        "`particle.clearance_ratio` = 5 is not allowed",
        "is relative to Z, and the base of this case is fixed",
        "write `clearance_m`",
        "`friction_damper.friction_ratio` = 0.4",
        "write `force_n`",
    ];
    refused(case(&format!("{STRUCTURE}{RUN}{RATIOS}")), &words);
    refused(case(&format!("{STRUCTURE}{RUN}{RATIOS}base = {{ kind = \"fixed\" }}\n")), &words);
    refused(case(&format!("{STRUCTURE}{RUN}{RATIOS}{}", SINE.replace("0.003", "0"))), &["the base's amplitude is 0"]);
    let spring = "friction_damper = { spring = { friction_ratio = 0.6 } }\n";
    refused(case(&format!("{STRUCTURE}{RUN}{spring}")), &["spring.friction_ratio` = 0.6", "write `normal_force_n`"]);
}

#[test]
fn a_base_amplitude_is_given_once_and_only_if_it_is_used() {
    let twice = ["`base.amplitude_m` = 0.003", "`base_amplitude_m` gives the same quantity"];
    refused(case(&format!("{STRUCTURE}{SINE}{RUN}base_amplitude_m = 0.003\n")), &twice);
    let vain = ["`base_amplitude_m` = 0.003", "is not used", "write base = { kind = \"sine\""];
    refused(case(&format!("{STRUCTURE}{RUN}base_amplitude_m = 0.003\n")), &vain);
}

#[test]
fn a_case_may_say_how_its_friction_spring_is_tuned_and_where_its_particle_starts() {
    let spring = "friction_damper = { spring = { normal_force_n = 2, friction_coefficient = 0.25 } }\n";
    let found = case(&format!("{STRUCTURE}{RUN}{spring}")).unwrap().set_up;
    assert_eq!(found.friction_damper.unwrap().force_n, 0.5, "μe·F_N");
    let particle = |more: &str| RATIOS.replace("mass_ratio = 0.1", &format!("mass_ratio = 0.1, {more}"));
    let initial = "initial = { x_m = 0.001 }\n";
    let at_wall = particle("start = \"at_positive_wall\"");
    let found = case(&format!("{STRUCTURE}{SINE}{RUN}{at_wall}{initial}")).unwrap().initial;
    assert_eq!(found.y_m, 0.001 + 5.0 * 0.003);
    let both = initial.replace("0.001", "0.001, y_m = 0.002");
    refused(
        case(&format!("{STRUCTURE}{SINE}{RUN}{at_wall}{both}")),
        &["`initial.y_m` = 0.002", "the particle's table gives its start too"],
    );
}

#[test]
fn a_wall_without_its_kind_is_answered_with_the_kinds() {
    let wall = RATIOS.replace("kind = \"restitution\", ", "");
    let words = ["`particle.wall.kind` is missing", "kind = \"restitution\" or kind = \"voigt\""];
    refused(case(&format!("{STRUCTURE}{SINE}{RUN}{wall}")), &words);
}

#[test]
fn own_keys_of_a_set_up_override_inherited_ones() {
    let shared = format!("{STRUCTURE}tmd = {{ mass_ratio = 0.1, stiffness_n_per_m = 30, damping_ratio = 0.1 }}\n");
    for own in ["frequency_ratio = 0.9, damping_n_s_per_m = 0.5", "tuning = \"warburton\""] {
        let set_up = format!("base_amplitude_m = 0.003\ntmd = {{ {own} }}\n");
        let inherited = campaign(&shared, &set_up).unwrap().set_ups[0].model();
        let whole = case(&format!("{STRUCTURE}{RUN}tmd = {{ mass_ratio = 0.1, {own} }}\n")).unwrap().set_up;
        assert_eq!(inherited, whole, "{own}");
    }
}
