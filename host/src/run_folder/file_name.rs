//! The name of a file inside a run folder, as the journal and the manifest state it.

use std::fmt;
use std::ops::Deref;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// Longest name, bytes.
const LONGEST: usize = 1024;

/// Longest part of a name, bytes: the limit of the common file systems.
const LONGEST_PART: usize = 255;

/// A path relative to the run folder that cannot leave it: plain names joined by `/`. No `..`, no absolute path, no other
/// separator, no control character.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub struct FileName(String);

/// A text that is not the name of a file inside a run folder.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is not the name of a file inside the run folder: plain names joined by `/` are allowed")]
pub struct NotInside(String);

impl FileName {
    /// Checks a name.
    ///
    /// # Errors
    /// When it could be a file outside the folder, or cannot be a file name.
    pub fn new(name: &str) -> Result<Self, NotInside> {
        let is_plain = |part: &str| {
            let is_dots = part.bytes().all(|b| b == b'.');
            let is_allowed = |c: char| !c.is_control() && c != '\\' && (c != ':' || cfg!(not(windows)));
            !is_dots && part.len() <= LONGEST_PART && part.chars().all(is_allowed)
        };
        if name.len() <= LONGEST && name.split('/').all(is_plain) {
            Ok(Self(name.to_string()))
        } else {
            Err(NotInside(name.chars().take(80).collect()))
        }
    }
}

impl TryFrom<String> for FileName {
    type Error = NotInside;

    fn try_from(name: String) -> Result<Self, NotInside> {
        Self::new(&name)
    }
}

impl Deref for FileName {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl AsRef<Path> for FileName {
    fn as_ref(&self) -> &Path {
        Path::new(&self.0)
    }
}

impl fmt::Display for FileName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_inside_the_folder_are_accepted() {
        for name in ["journal.jsonl", "samples.parts/000001.parquet", "records/1-Erdbeben, Süd.csv", ".hidden", "a..b"]
        {
            assert_eq!(FileName::new(name).as_deref(), Ok(name));
        }
        let long = "a".repeat(256);
        for name in
            ["", "/etc/passwd", "..", ".", "../x", "a/../../x", "a//b", "a/", "a\0b", "a\nb", "a\\b", "./a", &long]
        {
            assert!(FileName::new(name).is_err(), "{name:?}");
        }
        assert!(
            serde_json::from_str::<FileName>("\"../x\"").unwrap_err().to_string().contains("inside the run folder")
        );
    }
}
