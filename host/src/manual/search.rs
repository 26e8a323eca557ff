//! Finds the page, or the section of a long page, that answers some words.
//!
//! Pages and sections are ranked by BM25 (Robertson and Zaragoza 2009) with fields: a word in a page's title counts six times, in a section's heading
//! four times one in the text.

use std::collections::HashMap;
use std::sync::OnceLock;

use super::{PAGES, Page};
use crate::input::near;

/// What was found for some words.
#[derive(Clone, Debug, PartialEq)]
pub enum SearchResult {
    /// The text that answers best, and the names of other pages that have the words, best first.
    Text {
        /// The page.
        page: &'static Page,
        /// Its heading, where it is a section of the page.
        section: Option<&'static str>,
        /// The text, Markdown.
        text: &'static str,
        /// Names of other pages.
        others: Vec<String>,
    },
    /// No page has the words; the nearest names and words, nearest first.
    Nothing(Vec<String>),
}

/// A page or a section with the counts of its words.
struct SearchUnit {
    page: &'static Page,
    section: Option<&'static str>,
    text: &'static str,
    counts: HashMap<String, f64>,
}

const TITLE_WEIGHT: f64 = 6.0;
const HEADING_WEIGHT: f64 = 4.0;
/// BM25's constants: saturation of repeats, share of the length's correction.
const SATURATION: f64 = 1.2;
const LENGTH_SHARE: f64 = 0.6;

/// Words of a question that say nothing about its subject.
const EMPTY_WORDS: [&str; 26] = [
    "a", "an", "and", "are", "by", "can", "did", "do", "does", "for", "from", "how", "i", "in", "is", "it", "my", "of",
    "on", "or", "the", "this", "to", "what", "which", "with",
];

/// The text that answers some words, such as `laser calibration` or `E_n`.
#[must_use]
pub fn find(question: &str) -> SearchResult {
    let name = question.trim().to_lowercase().replace([' ', '_'], "-");
    let named = PAGES.iter().find(|page| page.name() == name || page.title().eq_ignore_ascii_case(question.trim()));
    let ranked = rank(question);
    let best = ranked.first().copied();
    let (page, section, text) = match (named, best) {
        (Some(page), _) => (page, None, page.text),
        (None, Some(unit)) if unit.page.is_short() => (unit.page, None, unit.page.text),
        (None, Some(unit)) => (unit.page, unit.section, unit.text),
        (None, None) => return SearchResult::Nothing(nearest(question)),
    };
    let mut others: Vec<String> = Vec::new();
    for unit in ranked {
        let name = unit.page.name();
        if unit.page != page && !others.contains(&name) && others.len() < 4 {
            others.push(name);
        }
    }
    SearchResult::Text { page, section, text, others }
}

/// Pages and sections with all words, best first; with most of the words if none has all.
fn rank(question: &str) -> Vec<&'static SearchUnit> {
    let units = units();
    let wanted: Vec<String> = words(question).filter(|word| !EMPTY_WORDS.contains(&word.as_str())).collect();
    let counts: Vec<Vec<f64>> = units.iter().map(|unit| wanted.iter().map(|word| unit.count(word)).collect()).collect();
    let total = units.len() as f64;
    let rarity: Vec<f64> = (0..wanted.len())
        .map(|word| {
            let having = counts.iter().filter(|counts| counts[word] > 0.0).count() as f64;
            libm::log(1.0 + (total - having + 0.5) / (having + 0.5))
        })
        .collect();
    let most = counts.iter().map(|counts| present(counts)).max().unwrap_or(0);
    if most == 0 {
        return Vec::new();
    }
    let score =
        |counts: &[f64]| counts.iter().zip(&rarity).map(|(n, rarity)| rarity * n / (n + SATURATION)).sum::<f64>();
    let having = units.iter().zip(&counts).filter(|(_, counts)| present(counts) == most);
    let mut scored: Vec<(f64, &SearchUnit)> = having.map(|(unit, counts)| (score(counts), unit)).collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    scored.into_iter().map(|(_, unit)| unit).collect()
}

/// The number of words that a unit has.
fn present(counts: &[f64]) -> usize {
    counts.iter().filter(|count| **count > 0.0).count()
}

impl SearchUnit {
    /// The weighted count of a word and of longer ones that begin with it.
    fn count(&self, word: &str) -> f64 {
        if word.len() < 4 {
            return self.counts.get(word).copied().unwrap_or(0.0);
        }
        self.counts.iter().filter(|(own, _)| own.starts_with(word)).map(|(_, count)| count).sum()
    }
}

/// All pages and their sections.
fn units() -> &'static [SearchUnit] {
    static UNITS: OnceLock<Vec<SearchUnit>> = OnceLock::new();
    UNITS.get_or_init(|| {
        let texts: Vec<_> = PAGES.iter().flat_map(texts).collect();
        let mean = texts.iter().map(|(_, _, text)| text.len()).sum::<usize>() as f64 / texts.len() as f64;
        texts
            .into_iter()
            .map(|(page, section, text)| {
                let length = 1.0 - LENGTH_SHARE + LENGTH_SHARE * text.len() as f64 / mean;
                let mut counts = HashMap::new();
                words(text).for_each(|word| *counts.entry(word).or_insert(0.0) += 1.0 / length);
                words(page.title()).for_each(|word| *counts.entry(word).or_insert(0.0) += TITLE_WEIGHT);
                let heading = section.unwrap_or_default();
                words(heading).for_each(|word| *counts.entry(word).or_insert(0.0) += HEADING_WEIGHT);
                SearchUnit { page, section, text, counts }
            })
            .collect()
    })
}

/// A page as a whole, and its sections: from each heading to the next of the same or a higher level.
fn texts(page: &'static Page) -> Vec<(&'static Page, Option<&'static str>, &'static str)> {
    let mut headings: Vec<(usize, usize, &str)> = Vec::new();
    let (mut at, mut is_code) = (0, false);
    for line in page.text.split_inclusive('\n') {
        is_code ^= line.trim_start().starts_with("```");
        let level = line.bytes().take_while(|byte| *byte == b'#').count();
        if !is_code && (2..=3).contains(&level) {
            headings.push((at, level, line.trim_start_matches('#').trim()));
        }
        at += line.len();
    }
    let sections = headings.iter().enumerate().map(|(number, &(start, level, heading))| {
        let next = headings[number + 1..].iter().find(|(_, other, _)| *other <= level);
        let end = next.map_or(page.text.len(), |(end, ..)| *end);
        (page, Some(heading), page.text[start..end].trim_end())
    });
    std::iter::once((page, None, page.text)).chain(sections).collect()
}

/// The words of a text in small letters, without the s of a plural.
fn words(text: &str) -> impl Iterator<Item = String> {
    let words = text.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|word| !word.is_empty());
    words.map(|word| {
        let word = word.to_lowercase();
        match word.strip_suffix('s') {
            Some(singular) if singular.len() > 3 && !singular.ends_with('s') => singular.to_string(),
            _ => word,
        }
    })
}

/// Names of pages and words of titles and headings that are spelled like some words.
fn nearest(question: &str) -> Vec<String> {
    let names: Vec<String> = PAGES.iter().map(Page::name).collect();
    let headings: Vec<String> =
        units().iter().flat_map(|unit| words(unit.section.unwrap_or(unit.page.title()))).collect();
    let wanted = question.to_lowercase();
    let found = near(&wanted, names.iter().chain(&headings).map(String::as_str));
    let mut distinct: Vec<String> = Vec::new();
    found.into_iter().for_each(|word| {
        if !distinct.iter().any(|other| other == word) {
            distinct.push(word.into());
        }
    });
    distinct
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page_for(question: &str) -> &'static str {
        match find(question) {
            SearchResult::Text { page, .. } => page.path,
            SearchResult::Nothing(near) => panic!("{question}: nothing; near: {near:?}"),
        }
    }

    /// The questions that the book's search field answers are answered by the command too.
    #[test]
    fn the_questions_of_the_manual_are_answered_first() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/manual/questions.toml");
        let questions: toml::Table = std::fs::read_to_string(file).unwrap().parse().unwrap();
        let questions = questions["question"].as_array().unwrap();
        assert!(questions.len() >= 10);
        for question in questions {
            let [words, page] = ["words", "page"].map(|key| question[key].as_str().unwrap());
            assert_eq!(page_for(words), page, "{words}");
        }
    }

    #[test]
    fn a_name_or_a_title_gives_its_page_as_a_whole() {
        for page in PAGES {
            for topic in [page.name(), page.title().to_string()] {
                let found = find(&topic);
                assert!(
                    matches!(found, SearchResult::Text { page: found, section: None, .. } if found == page),
                    "{topic}"
                );
            }
        }
    }

    #[test]
    fn a_section_of_a_long_page_is_found_by_its_heading() {
        let SearchResult::Text { page, section, text, .. } = find("option bytes") else { panic!("nothing") };
        assert_eq!((page.path, section), ("LAB_GUIDE.md", Some("Option bytes")));
        assert!(text.contains("BOR_LEV") && !text.contains("## Calibration"));
    }

    #[test]
    fn nothing_is_found_for_an_unknown_word_but_what_is_spelled_like_it() {
        let SearchResult::Nothing(near) = find("calibrashun") else { panic!("something") };
        assert!(near.iter().any(|word| word.starts_with("calibrat")), "{near:?}");
        assert_eq!(find("qqqq"), SearchResult::Nothing(Vec::new()));
        assert_eq!(find(""), SearchResult::Nothing(Vec::new()));
    }
}
