//! Another damper under the same rules: its case, its variables and what is uncertain of it.

use std::path::{Path, PathBuf};

use super::file::{Set, read_set};
use super::keys::alternative as keys;
use crate::input::section::Given;
use crate::input::{self, Section, Source};

/// A path and a text of a case.
pub(super) type CaseText = (PathBuf, String);

/// Another damper.
pub(super) struct Alternative {
    pub name: String,
    pub case: CaseText,
    pub set: Set,
}

/// Reads the alternatives to an optimisation of this name with a case of this text.
pub(super) fn read(tables: &[Section], path: &Path, name: &str, case: Option<&str>) -> Vec<Option<Alternative>> {
    let mut names = vec![name.to_string()];
    tables.iter().map(|s| read_one(s, path, &mut names, case)).collect()
}

fn read_one(s: &Section, path: &Path, names: &mut Vec<String>, own: Option<&str>) -> Option<Alternative> {
    let name = s.text_of(&keys::NAME);
    let case = read_case(s, &keys::CASE, path, None, own);
    let set = read_set(s, &keys::VARIABLE, &keys::UNCERTAIN);
    s.finish();
    let name = name?.value;
    if names.contains(&name) {
        let help = format!("give it a name of its own: {} are taken", names.join(", "));
        s.reject(keys::NAME.name(), "is the name of another damper here", Some(help));
        return None;
    }
    names.push(name.clone());
    Some(Alternative { name, case: case?, set: set? })
}

/// The tables of a case that are dampers.
const DAMPERS: [&str; 4] = ["particle", "friction_damper", "tmd", "many_particles"];

/// The case: `given`, the file that is named, or the tables under the key; these take the place of those of `own` and of its dampers.
pub(super) fn read_case(
    s: &Section,
    key: &input::key::KeyedQuantity,
    path: &Path,
    given: Option<&Source>,
    own: Option<&str>,
) -> Option<CaseText> {
    match s.given(key)?.1 {
        Given::Text(text) => crate::study::file::read_case(s, path, &text, given),
        Given::Table(section) => {
            let mut case: toml::Table = own.and_then(|own| toml::from_str(own).ok()).unwrap_or_default();
            DAMPERS.iter().for_each(|damper| drop(case.remove(*damper)));
            case.extend(section.as_toml());
            // Beside the file, as the files that the case names are.
            let name = format!("{} [{}]", path.file_name().unwrap_or_default().display(), s.full(key.name()));
            Some((path.with_file_name(name), case.to_string()))
        }
        _ => None,
    }
}
