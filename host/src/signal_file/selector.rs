//! One signal of a file: `FILE`, `FILE#3`, `FILE#name`.

use std::path::{Path, PathBuf};

use super::{Contents, Signal};
use crate::failure::Failure;
use crate::input::near;

/// A file, and which of its signals.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selector {
    /// The file.
    pub path: PathBuf,
    /// Number from 1, or name; `None` for the only one.
    pub which: Option<String>,
}

impl Selector {
    /// Splits `FILE#which`. A file whose name has a `#` is taken as it is, if it exists.
    #[must_use]
    pub fn of(text: &Path) -> Self {
        let shown = text.to_string_lossy();
        match shown.rsplit_once('#') {
            Some((file, which)) if !file.is_empty() && !which.is_empty() && !text.exists() => {
                Self { path: PathBuf::from(file), which: Some(which.into()) }
            }
            _ => Self { path: text.to_path_buf(), which: None },
        }
    }

    /// The signal among those of its file.
    ///
    /// # Errors
    /// There are several and none is chosen, or none is as chosen; the message lists them.
    pub fn choose(&self, contents: Contents) -> Result<Signal, Failure> {
        let file = self.path.display();
        let signals = contents.signals;
        if signals.is_empty() {
            let why: Vec<String> = contents.remarks.iter().map(|remark| format!("\n  {remark}")).collect();
            return Err(Failure::Input(format!("{file}: there is no signal in it{}", why.concat())));
        }
        let list = || {
            let lines = signals.iter().enumerate().map(|(n, signal)| format!("\n  {file}#{}: {}", n + 1, signal.name));
            lines.take(20).collect::<String>()
        };
        let at = match &self.which {
            None if signals.len() == 1 => 0,
            None => {
                return Err(Failure::Input(format!("{file}: it has {} signals: which one?{}", signals.len(), list())));
            }
            Some(which) => {
                let by_number = which.parse::<usize>().ok().filter(|n| (1..=signals.len()).contains(n)).map(|n| n - 1);
                let named: Vec<usize> = (0..signals.len()).filter(|n| signals[*n].name == *which).collect();
                match (named.as_slice(), by_number) {
                    ([only], _) => *only,
                    ([], Some(only)) => only,
                    ([], None) => {
                        let near = near(which, signals.iter().map(|signal| signal.name.as_str()));
                        let hint = near.first().map_or(String::new(), |name| format!("; did you mean #{name}?"));
                        return Err(Failure::Input(format!("{file}: there is no signal {which:?}{hint}{}", list())));
                    }
                    _ => {
                        return Err(Failure::Input(format!(
                            "{file}: {} signals are named {which:?}: choose by number{}",
                            named.len(),
                            list()
                        )));
                    }
                }
            }
        };
        Ok(signals.into_iter().nth(at).unwrap_or_else(|| unreachable!("a place in the list")))
    }

    /// Reads the signal.
    ///
    /// # Errors
    /// As [`super::read`] and [`Self::choose`].
    pub fn read(&self) -> Result<Signal, Failure> {
        self.choose(super::read(&self.path)?)
    }
}
