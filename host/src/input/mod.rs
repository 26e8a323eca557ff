//! Reads input files and reports their problems all at once: file, line, key, value, what is allowed, and the likely fix.
//!
//! [`section`] reads a TOML table, [`key`] has the declarations of keys; this module holds the text and renders the messages.
//! The keys themselves are declared by the parsers of set-ups, campaigns and cases.

mod files;
pub mod key;
pub mod locate;
pub mod regular;
pub mod section;
pub mod shipped;
mod shown;
pub(crate) mod suggest;
mod without_panic;

use std::collections::BTreeMap;
use std::io::{Error, ErrorKind};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use toml::de::DeTable;

use crate::failure::Failure;

pub use files::{FileDigest, Files};
pub use section::{Number, Section, Text};
pub use shown::{shown, shown_in_line};
pub use suggest::{listed, near, replacement};
pub(crate) use without_panic::without_panic;

/// Name of the campaign in a run folder, as a hint when a folder is given.
const CAMPAIGN: &str = "campaign.toml";

/// Problems of a file in one message; a file that is no campaign at all may have thousands.
const MAX_SHOWN: usize = 20;

/// Place of a value in its file, in bytes.
pub type Span = Range<usize>;

/// A file that another file names: relative to it.
#[must_use]
pub fn resolve(beside: &Path, file: &str) -> PathBuf {
    beside.parent().map_or_else(|| PathBuf::from(file), |folder| folder.join(file))
}

/// A problem of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// The problem, with key and value.
    pub title: String,
    /// Where.
    pub span: Span,
    /// What is allowed; shown beside the marked text.
    pub allowed: String,
    /// The likely fix, if there is one.
    pub help: Option<String>,
}

/// The files that a campaign names, as copied into its run folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Copies {
    /// Motion records and noise by the number of their `[[experiment]]`, from 1.
    pub records: BTreeMap<usize, PathBuf>,
    /// The set-up file.
    pub set_up_file: Option<PathBuf>,
}

/// A text with its name, and the problems found in it so far.
#[derive(Debug)]
pub struct Source {
    name: String,
    text: String,
    is_recorded: bool,
    copies: Option<Copies>,
    files: Arc<Files>,
    problems: Mutex<Vec<Problem>>,
    warnings: Mutex<Vec<Problem>>,
    attached: [OnceLock<AttachedText>; MAX_ATTACHED],
}

/// Most texts attached to a source: a file that it names, and values set from outside.
const MAX_ATTACHED: usize = 2;

/// A text beside this one; its places begin after the end of this one and of those attached before.
#[derive(Debug)]
struct AttachedText {
    name: String,
    text: String,
    offset: usize,
}

impl Source {
    /// Reads a file.
    ///
    /// # Errors
    /// Names the file and says why it cannot be read; when it does not exist, names files that look like it.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        text_of(path, regular::read_input(path)).map(|text| Self::new(path.display().to_string(), text))
    }

    /// Reads a file that this one names, once for all sources with the same [`Source::with_files`].
    ///
    /// # Errors
    /// As [`Source::read`].
    pub fn read_named(&self, path: &Path) -> Result<Self, Failure> {
        let text = self.files.parsed(path, "text", |bytes| text_of(path, bytes))?;
        Ok(Self::new(path.display().to_string(), text))
    }

    /// With the files that are read already.
    #[must_use]
    pub fn with_files(mut self, files: &Arc<Files>) -> Self {
        self.files = Arc::clone(files);
        self
    }

    /// The files that this one names.
    #[must_use]
    pub fn files(&self) -> &Files {
        &self.files
    }

    /// A text in memory; `name` is its name in messages.
    #[must_use]
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            text: text.into(),
            is_recorded: false,
            copies: None,
            files: Arc::default(),
            problems: Mutex::default(),
            warnings: Mutex::default(),
            attached: Default::default(),
        }
    }

    /// The copy in a run folder, which may be older than this program: keys that are refused since then are ignored.
    #[must_use]
    pub fn recorded(mut self) -> Self {
        self.is_recorded = true;
        self
    }

    /// Whether it is the copy in a run folder.
    #[must_use]
    pub fn is_recorded(&self) -> bool {
        self.is_recorded
    }

    /// The campaign of a run folder: the files that it names are these copies, and no others.
    #[must_use]
    pub fn with_copies(mut self, copies: Copies) -> Self {
        self.copies = Some(copies);
        self
    }

    /// The copies of a run folder, if it is the campaign of one.
    #[must_use]
    pub fn copies(&self) -> Option<&Copies> {
        self.copies.as_ref()
    }

    fn problems(&self) -> MutexGuard<'_, Vec<Problem>> {
        // The list is valid even if a thread panicked while it held the lock.
        self.problems.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a warning: the file is used as it is.
    pub fn warn(&self, warning: Problem) {
        self.warnings.lock().unwrap_or_else(PoisonError::into_inner).push(warning);
    }

    /// The warnings so far in the order of the file, one for each place: the first 20, and how many there are.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = self.warnings.lock().unwrap_or_else(PoisonError::into_inner).clone();
        warnings.sort_by_key(|warning| warning.span.start);
        // Several set-ups may inherit one value.
        warnings.dedup_by(|later, first| later.span == first.span && later.allowed == first.allowed);
        let renderer = Renderer::plain();
        let mut texts: Vec<String> =
            warnings.iter().take(MAX_SHOWN).map(|w| self.render(&renderer, &Level::WARNING, w)).collect();
        if warnings.len() > MAX_SHOWN {
            texts.push(format!("{} has {} unusual values; these are the first {MAX_SHOWN}", self.name, warnings.len()));
        }
        texts
    }

    /// Its name in messages: the path of a file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The text as read.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Attaches a text, for example a file that this one names, so that problems in it are shown with its own name and lines.
    /// Returns it after as many blanks as its places are shifted by: parse that. Two texts can be attached.
    #[must_use]
    pub fn attach(&self, name: &str, text: &str) -> String {
        let last = self.attached.iter().filter_map(OnceLock::get).last();
        let offset = last.map_or(self.text.len(), |last| last.offset + last.text.len()) + 1;
        if let Some(free) = self.attached.iter().find(|place| place.get().is_none()) {
            let _ = free.set(AttachedText { name: name.to_string(), text: text.to_string(), offset });
        }
        " ".repeat(offset) + text
    }

    /// The name and text of the file that a place is in, and the place in that text.
    fn place(&self, span: &Span) -> (&str, &str, Span) {
        let attached = self.attached.iter().filter_map(OnceLock::get).filter(|text| span.start >= text.offset).last();
        match attached {
            Some(file) => (&file.name, &file.text, span.start - file.offset..span.end.saturating_sub(file.offset)),
            None => (&self.name, &self.text, span.clone()),
        }
    }

    /// The problems in an attached text, with their places in that text.
    #[must_use]
    pub fn problems_in(&self, attached: &str) -> Vec<Problem> {
        let placed = |problem: &Problem| {
            let (name, _, span) = self.place(&problem.span);
            (name == attached).then(|| Problem { span, ..problem.clone() })
        };
        self.problems().iter().filter_map(placed).collect()
    }

    /// The text at a place, in this file or in the attached one.
    #[must_use]
    pub fn written(&self, span: &Span) -> Option<&str> {
        let (_, text, span) = self.place(span);
        text.get(span)
    }

    /// Parses `text` as TOML in place of the source's own; `title` is the problem's title when it is not TOML.
    pub fn read_toml<T>(&self, text: &str, title: &str, read: impl FnOnce(&Section) -> Option<T>) -> Option<T> {
        self.read_changed_toml(text, title, |_| (), read)
    }

    /// The same, with `change` made to the document before it is read.
    pub fn read_changed_toml<'t, T>(
        &self,
        text: &'t str,
        title: &str,
        change: impl FnOnce(&mut DeTable<'t>),
        read: impl FnOnce(&Section) -> Option<T>,
    ) -> Option<T> {
        match DeTable::parse(text) {
            Ok(mut document) => {
                change(document.get_mut());
                let root = Section::root(self, &document);
                let found = read(&root);
                root.finish();
                found
            }
            Err(error) => {
                self.report(Problem {
                    title: title.into(),
                    span: error.span().unwrap_or_default(),
                    allowed: error.message().to_string(),
                    help: None,
                });
                None
            }
        }
    }

    /// Adds a problem; reading continues, so that one message has all problems.
    pub fn report(&self, problem: Problem) {
        self.problems().push(problem);
    }

    /// Whether there are no problems so far.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        self.problems().is_empty()
    }

    /// The problems so far as one message, in the order of the file: the first 20, and how many there are.
    ///
    /// # Errors
    /// When there are any.
    pub fn verdict(&self) -> Result<(), Failure> {
        let mut problems = self.problems().clone();
        if problems.is_empty() {
            return Ok(());
        }
        problems.sort_by_key(|p| p.span.start);
        problems.dedup();
        let renderer = Renderer::plain();
        let mut answers: Vec<String> =
            problems.iter().take(MAX_SHOWN).map(|p| self.render(&renderer, &Level::ERROR, p)).collect();
        if problems.len() > MAX_SHOWN {
            answers.push(format!("{} has {} problems; these are the first {MAX_SHOWN}", self.name, problems.len()));
        }
        // The command prints "error: " before the first.
        Err(Failure::Input(answers.join("\n\nerror: ")))
    }

    fn render(&self, renderer: &Renderer, level: &Level<'static>, problem: &Problem) -> String {
        let (name, text, span) = self.place(&problem.span);
        let end = span.end.min(text.len());
        let start = span.start.min(end);
        // A header or an inline table may span lines; its first line is marked.
        let end = text[start..end].find('\n').map_or(end, |n| start + n);
        let snippet = Snippet::source(text)
            .path(name)
            .annotation(AnnotationKind::Primary.span(start..end).label(problem.allowed.as_str()));
        let mut group = level.clone().primary_title(problem.title.as_str()).element(snippet);
        if let Some(help) = &problem.help {
            group = group.element(Level::HELP.message(help.as_str()));
        }
        let text = renderer.render(&[group]).to_string();
        // The command prints the level itself.
        ["error: ", "warning: "].iter().find_map(|level| text.strip_prefix(level)).unwrap_or(&text).to_string()
    }
}

/// The bytes of a file as a text, or why it has none.
fn text_of(path: &Path, bytes: std::io::Result<Vec<u8>>) -> Result<String, Failure> {
    let text = bytes.and_then(|bytes| String::from_utf8(bytes).map_err(|e| Error::new(ErrorKind::InvalidData, e)));
    text.map_err(|error| {
        let mut answer = format!("cannot read {}: {error}", path.display());
        if error.kind() == ErrorKind::NotFound {
            answer.push_str(&neighbours(path));
        } else if error.kind() == ErrorKind::InvalidData {
            answer.push_str("\n  it must be a text in UTF-8");
        } else if path.join(CAMPAIGN).is_file() {
            answer.push_str(&format!("\n  did you mean {}?", path.join(CAMPAIGN).display()));
        }
        Failure::Input(answer)
    })
}

/// "did you mean": files beside a missing one with a near name.
fn neighbours(path: &Path) -> String {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let wanted = path.file_name().unwrap_or_default().to_string_lossy().to_string();
    let names: Vec<String> = match std::fs::read_dir(folder) {
        Ok(entries) => entries
            .flatten()
            .map(|e| e.file_name().to_string_lossy().to_string())
            .filter(|n| Path::new(n).extension().is_some_and(|e| e == "toml" || e == "json"))
            .collect(),
        Err(_) => return format!("\n  there is no folder {}", folder.display()),
    };
    match near(&wanted, names.iter().map(String::as_str)).first() {
        Some(name) => format!("\n  did you mean {}?", folder.join(name).display()),
        None => String::new(),
    }
}
