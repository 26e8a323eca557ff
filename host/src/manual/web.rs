//! A page of the manual for the browser, where no built book is installed.

use pulldown_cmark::{CowStr, Event, Options, Parser, Tag, TagEnd, html};

use super::Page;

const STYLE: &str = "body{max-width:50rem;margin:2rem auto;padding:0 1rem;font:1rem/1.5 system-ui,sans-serif;color-scheme:light dark}\
table{border-collapse:collapse}td,th{border:1px solid;padding:.2rem .5rem;vertical-align:top;text-align:left}pre{overflow:auto;padding:.5rem;border:1px solid}";

/// A page as HTML that needs no other file: pictures are their descriptions, and links to other pages name the command that shows them.
#[must_use]
pub fn to_html(page: &Page) -> String {
    let mut body = String::new();
    html::push_html(&mut body, events(page).into_iter());
    let title = page.title();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>damprig: {}</title><style>{STYLE}</style></head><body>\n{body}</body></html>\n",
        title.replace('&', "&amp;").replace('<', "&lt;")
    )
}

/// The parts of a page, without what leads to other files.
fn events(page: &Page) -> Vec<Event<'static>> {
    let mut events: Vec<Event> = Vec::new();
    let mut ends: Vec<String> = Vec::new();
    for event in Parser::new_ext(page.text, Options::ENABLE_TABLES) {
        match event {
            Event::Start(Tag::Link { ref dest_url, .. }) if !dest_url.contains("://") => ends.push(command(dest_url)),
            Event::Start(Tag::Image { .. }) => events.push(Event::Text("[picture: ".into())),
            Event::End(TagEnd::Image) => events.push(Event::Text("]".into())),
            Event::End(TagEnd::Link) if !ends.is_empty() => {
                events.push(Event::Text(CowStr::from(ends.pop().unwrap_or_default())));
            }
            other => events.push(other.into_static()),
        }
    }
    events
}

/// What stands behind a link to another page: the command that shows it.
fn command(target: &str) -> String {
    let file = target.split('#').next().unwrap_or_default().rsplit('/').next().unwrap_or_default();
    match super::PAGES.iter().find(|page| page.path.rsplit('/').next() == Some(file)) {
        Some(page) => format!(" (damprig help {})", page.name()),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::PAGES;
    use super::*;

    #[test]
    fn a_page_needs_no_other_file() {
        for page in PAGES {
            let html = to_html(page);
            assert!(html.contains("<h1>"), "{}", page.path);
            assert!(!html.contains("src=") && !html.contains("href=\"../") && !html.contains(".md\""), "{}", page.path);
        }
    }

    #[test]
    fn a_link_to_a_page_becomes_its_command() {
        let page = PAGES.iter().find(|page| page.path == "how-to/read-e-n.md").unwrap();
        assert!(to_html(page).contains("(damprig help compare)"));
    }
}
