//! Curves of a continuation over the map of a study.

use std::path::{Path, PathBuf};

use super::axis::{self, StudyAxis};
use super::keys::overlay as keys;
use super::table::MIN_OF_MAP;
use crate::continuation::Continuation;
use crate::input::Section;
use crate::input::section::Text;

/// Curves over the map.
#[derive(Clone, Debug)]
pub struct Overlay {
    /// Path of the continuation file.
    pub path: PathBuf,
    /// What it says.
    pub continuation: Continuation,
}

/// Reads an `[[overlay]]` of the study at `path`.
pub(super) fn read(s: &Section, path: &Path) -> Option<(Text, Overlay)> {
    let named = s.text_of(&keys::CONTINUATION);
    s.finish();
    let named = named?;
    let path = path.parent().unwrap_or(Path::new("")).join(&named.value);
    match Continuation::read(&path) {
        Ok(continuation) => Some((named, Overlay { path, continuation })),
        Err(refusal) => {
            s.refuse(keys::CONTINUATION.name(), &named.span, refusal.to_string(), None);
            None
        }
    }
}

impl Overlay {
    /// Why the curves do not belong over the map of a study with these axes, and what to do.
    pub(super) fn mismatch(&self, axes: &[StudyAxis], case_path: &Path, case_text: &str) -> Option<(String, String)> {
        let (first, Some(second)) = self.continuation.keys() else {
            let help = "add a table [second] with the other axis of the study to the continuation file";
            return Some(("must be a continuation in two parameters".into(), help.into()));
        };
        let is_grid = |axis: &StudyAxis| {
            let is_long = matches!(&axis.values, axis::AxisValues::Numbers(numbers) if numbers.len() >= MIN_OF_MAP);
            is_long && axis.reduce.is_none()
        };
        if axes.len() != 2 || !axes.iter().all(is_grid) {
            let help = "leave the overlay out, or the other axes".into();
            return Some((format!("needs a map: two axes of at least {MIN_OF_MAP} numbers, and no others"), help));
        }
        if let Some(axis) = axes.iter().find(|axis| ![first, second].contains(&axis.key.as_str())) {
            let both: Vec<&str> = axes.iter().map(|axis| axis.key.as_str()).collect();
            let what = format!("must have the study's axes as its parameters: {} is not one of them", axis.key);
            let help =
                format!("it has {first} and {second}: write {} for them in the continuation file", both.join(" and "));
            return Some((what, help));
        }
        (self.continuation.case_text != case_text).then(|| {
            let what = format!("must be of the study's case, not of {}", self.continuation.case_file.display());
            (what, format!("write the path of {} in the continuation file", case_path.display()))
        })
    }
}
