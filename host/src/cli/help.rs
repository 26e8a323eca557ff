//! `damprig help`: the help of a command, or a page of the manual in the terminal or the browser.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Stdio};

use clap::Args;
use clap::Command;
use clap::error::ErrorKind;

use super::output;
use crate::failure::{Failure, Outcome};
use crate::manual::{self, PAGES, Page, SearchResult};

/// Prints the help of a command, or a page of the manual.
///
/// Commands go first: `damprig help run` is the help of the command; its last lines name pages of the manual. Any other word is looked for
/// in the whole manual: names of pages, titles, headings, texts.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct HelpArgs {
    /// A command, with its subcommand if it has any, or words of the manual; without any: all commands and pages
    #[arg(value_name = "COMMAND|TOPIC")]
    words: Vec<String>,
    /// Open the page in the browser: of the installed book, or this page alone where no book is installed
    #[arg(long)]
    web: bool,
}

const AFTER_HELP: &str = "\
Examples:
  damprig help run                 the help of a command
  damprig help E_n                 the page of the manual that explains E_n
  damprig help laser
  damprig help option bytes        a section of a long page
  damprig help exit-codes | less
  damprig help --web               the manual in the browser
  damprig help protocol --web

Exit codes:
  0    success
  1    the page could not be written
  2    there is neither a command nor a page for this; the nearest are named";

/// Width of a text that does not go to a terminal, and its largest width there, columns.
const WIDTH: usize = 100;

/// Prints or opens what was asked for.
///
/// # Errors
/// Nothing has these words, or the page for the browser could not be written.
pub fn run(args: &HelpArgs, command: Command) -> Outcome {
    let topic = args.words.join(" ");
    if args.web {
        return open_page(&topic);
    }
    if is_command(&args.words, &command) {
        print_command(&args.words, command);
        return Ok(());
    }
    match manual::find(&topic) {
        SearchResult::Text { page, section, text, others } => {
            say!("{}", manual::to_text(text, width()));
            say!("");
            let name = page.name();
            if section.is_some() {
                say!("A section of the page \"{}\": `damprig help {name}` prints all of it.", page.title());
            }
            let place = installed_book().and_then(|book| in_book(&book, page, section));
            let place = place.map_or(String::new(), |address| format!(" opens {address}"));
            say!("In the browser: `damprig help {topic} --web`{place}");
            if !others.is_empty() {
                say!("Other pages: {}", others.join(", "));
            }
            Ok(())
        }
        SearchResult::Nothing(near) => Err(nothing(&topic, &near)),
    }
}

/// Whether the words are a command; no words are damprig itself.
fn is_command(words: &[String], command: &Command) -> bool {
    words.iter().try_fold(command, |at, word| at.find_subcommand(word)).is_some()
}

/// Prints the help of a command as `--help` does, and the pages of the manual that go with it.
fn print_command(words: &[String], command: Command) {
    let line = ["damprig"].into_iter().chain(words.iter().map(String::as_str)).chain(["--help"]);
    if let Err(text) = command.try_get_matches_from(line)
        && text.kind() == ErrorKind::DisplayHelp
    {
        output::print_text(&text);
    }
    say!("");
    if words.is_empty() {
        return list();
    }
    if let SearchResult::Text { page, mut others, .. } = manual::find(&words.join(" ")) {
        others.insert(0, page.name());
        say!("In the manual (damprig help PAGE): {}", others.join(", "));
    }
}

/// The pages of the manual, by parts.
fn list() {
    say!("Pages of the manual (damprig help PAGE, or any words):");
    for (part, pages) in manual::parts() {
        say!("");
        say!("{part}:");
        pages.into_iter().for_each(|page| say!("  {:<22}  {}", page.name(), page.title()));
    }
}

fn nothing(topic: &str, near: &[String]) -> Failure {
    let near = if near.is_empty() { String::new() } else { format!("; near it are: {}", near.join(", ")) };
    Failure::Input(format!(
        "there is neither a command nor a page of the manual for \"{topic}\"{near}; `damprig help` lists all"
    ))
}

/// Columns to fill.
fn width() -> usize {
    if !std::io::stdout().is_terminal() {
        return WIDTH;
    }
    ratatui::crossterm::terminal::size().map_or(WIDTH, |(columns, _)| usize::from(columns).clamp(40, WIDTH))
}

/// Opens a page in the browser, and prints its address.
fn open_page(topic: &str) -> Outcome {
    let start = &PAGES[0];
    let (page, section) = match manual::find(topic) {
        _ if topic.is_empty() => (start, None),
        SearchResult::Text { page, section, .. } => (page, section),
        SearchResult::Nothing(near) => return Err(nothing(topic, &near)),
    };
    let address = match installed_book().and_then(|book| in_book(&book, page, section)) {
        Some(address) => address,
        None => address(&alone(page)?),
    };
    say!("{address}");
    if !browse(&address) {
        warn!("no browser could be started (the variable BROWSER may name one); open this address");
    }
    Ok(())
}

/// The folder of the installed book: beside the command, or in `share` of the folder above it.
fn installed_book() -> Option<PathBuf> {
    let command = std::env::current_exe().ok()?.canonicalize().ok()?;
    let beside = command.parent()?;
    let places = [beside.join("manual"), beside.join("../manual"), beside.join("../share/damprig/manual")];
    places.into_iter().find(|place| place.join("index.html").is_file() && place.join("toc.html").is_file())
}

/// Address of a page of the book; `None` if that book, perhaps of another version, does not have it.
fn in_book(book: &Path, page: &Page, section: Option<&str>) -> Option<String> {
    let name = if page == &PAGES[0] { "index.html".into() } else { page.path.replace(".md", ".html") };
    let file = book.join(name);
    let mut address = file.is_file().then(|| address(&file))?;
    if let Some(heading) = section {
        let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        address.push('#');
        address.push_str(&kept.collect::<String>().to_lowercase().replace(' ', "-"));
    }
    Some(address)
}

/// A page in a file of its own for the browser.
fn alone(page: &Page) -> Result<PathBuf, Failure> {
    let failed =
        |error: &dyn std::fmt::Display| Failure::Failed(format!("cannot write the page for the browser: {error}"));
    let file = tempfile::Builder::new().prefix("damprig-").suffix(".html").tempfile().map_err(|e| failed(&e))?;
    file.as_file().write_all(manual::to_html(page).as_bytes()).map_err(|e| failed(&e))?;
    // The browser reads it when this command is over.
    file.keep().map(|(_, path)| path).map_err(|e| failed(&e))
}

/// The address of a file.
fn address(file: &Path) -> String {
    let path = file.canonicalize().unwrap_or_else(|_| file.to_path_buf()).display().to_string();
    // C:\\… as /C:/…
    let path = if cfg!(windows) { format!("/{}", path.trim_start_matches(r"\\?\").replace('\\', "/")) } else { path };
    format!("file://{}", path.replace('%', "%25").replace(' ', "%20").replace('#', "%23"))
}

/// Starts a browser: that of the variable BROWSER, or the system's. Whether a program could be started.
fn browse(address: &str) -> bool {
    let (program, first): (String, &[&str]) = match std::env::var("BROWSER") {
        Ok(program) if !program.is_empty() => (program, &[]),
        _ if cfg!(windows) => ("cmd".into(), &["/C", "start", ""]),
        _ if cfg!(target_os = "macos") => ("open".into(), &[]),
        _ => ("xdg-open".into(), &[]),
    };
    let mut browser = Process::new(program);
    browser.args(first).arg(address).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    browser.spawn().is_ok()
}
