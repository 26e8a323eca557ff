//! The manual as `damprig help TOPIC` prints it: the pages of docs, compiled into the command.
//!
//! `search` finds the page or the section that answers some words, `terminal` prints it as plain text, `web` as a page for the browser.

mod search;
mod terminal;
mod web;

pub use search::{SearchResult, find};
pub use terminal::to_text;
pub use web::to_html;

/// A page of the manual.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Page {
    /// Its file below docs, such as `how-to/read-e-n.md`.
    pub path: &'static str,
    /// Its text, Markdown.
    pub text: &'static str,
}

/// The pages of some files below docs.
macro_rules! pages {
    ($($path:literal),* $(,)?) => {
        &[$(Page { path: $path, text: include_str!(concat!("../../../docs/", $path)) }),*]
    };
}

/// All pages, in the order of the table of contents (docs/SUMMARY.md).
pub const PAGES: &[Page] = pages![
    "README.md",
    "tutorial/virtual-rig.md",
    "FIRST_SERIES.md",
    "tutorial/design.md",
    "how-to/calibrate-lasers.md",
    "how-to/change-limit.md",
    "how-to/resume-run.md",
    "how-to/operator-instructions.md",
    "how-to/base-record.md",
    "how-to/random-order.md",
    "how-to/hidden-branch.md",
    "how-to/resonance.md",
    "how-to/export-matlab.md",
    "how-to/best-clearance.md",
    "how-to/read-e-n.md",
    "how-to/which-firmware.md",
    "how-to/cluster.md",
    "how-to/client.md",
    "LAB_GUIDE.md",
    "HARDWARE.md",
    "MONITOR.md",
    "FILES.md",
    "STUDIES.md",
    "OPTIMISE.md",
    "CONTINUE.md",
    "SPECTRUM.md",
    "PYTHON.md",
    "MATLAB.md",
    "KEYS.md",
    "COMMANDS.md",
    "EXIT_CODES.md",
    "RUN_FOLDER.md",
    "PROTOCOL.md",
    "GLOSSARY.md",
    "theory/models.md",
    "WALLS.md",
    "STRUCTURES.md",
    "PARTICLES.md",
    "COMPARE.md",
    "IDENTIFY.md",
    "THESIS.md",
    "ARCHITECTURE.md",
    "PERFORMANCE.md",
    "ERRATA.md",
    "RELEASE.md",
];

/// The table of contents.
const CONTENTS: &str = include_str!("../../../docs/SUMMARY.md");

impl Page {
    /// The name by which `damprig help` takes it: the file's, in small letters with hyphens.
    #[must_use]
    pub fn name(&self) -> String {
        let file = self.path.rsplit('/').next().unwrap_or(self.path);
        file.trim_end_matches(".md").to_lowercase().replace('_', "-")
    }

    /// Its first heading.
    #[must_use]
    pub fn title(&self) -> &'static str {
        self.text.lines().next().unwrap_or_default().trim_start_matches("# ")
    }

    /// Whether it is read as a whole: a tutorial or one task.
    #[must_use]
    pub fn is_short(&self) -> bool {
        self.path.starts_with("tutorial/") || self.path.starts_with("how-to/")
    }
}

/// The parts of the manual: name, and pages.
#[must_use]
pub fn parts() -> Vec<(&'static str, Vec<&'static Page>)> {
    let mut parts: Vec<(&str, Vec<&Page>)> = Vec::new();
    for line in CONTENTS.lines() {
        if let Some(name) = line.strip_prefix("# ") {
            parts.push((name, Vec::new()));
        } else if let Some((_, path)) = line.strip_prefix("- ").and_then(|line| line.split_once("]("))
            && let Some((_, pages)) = parts.last_mut()
        {
            pages.extend(PAGES.iter().find(|page| page.path == path.trim_end_matches(')')));
        }
    }
    parts.retain(|(_, pages)| !pages.is_empty());
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_compiled_pages_are_those_of_the_table_of_contents() {
        let listed =
            CONTENTS.lines().filter_map(|line| line.split_once("](")).map(|(_, path)| path.trim_end_matches(')'));
        let compiled: Vec<&str> = PAGES.iter().map(|page| page.path).collect();
        assert_eq!(listed.collect::<Vec<_>>(), compiled);
        // All but the start page, which stands before the parts.
        assert_eq!(parts().iter().map(|(_, pages)| pages.len()).sum::<usize>(), PAGES.len() - 1);
    }

    #[test]
    fn each_page_has_a_name_and_a_title_of_its_own() {
        let mut names: Vec<String> = PAGES.iter().map(Page::name).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), PAGES.len());
        for page in PAGES {
            assert!(page.text.starts_with("# "), "{} begins with its title", page.path);
        }
    }
}
