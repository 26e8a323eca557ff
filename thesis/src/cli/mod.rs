//! `damprig-thesis`: computes the figures and tables of the source document and sets them beside the published values.

mod work;

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use clap::Parser;

use crate::catalogue::{Catalogue, Item};
use crate::claims;
use crate::compared::{ComparedItem, Comparison};
use crate::files;
use crate::marked;
use crate::page;
use crate::published::{PUBLISHED, Published};
use crate::results::Results;
use crate::run;
use damprig::cli::output::print;
use damprig::failure::{Failure, Outcome};
use damprig::report::numbers::significant;
use damprig::report::terminal::plain_table;

/// Computes every figure and table of the source document and sets them beside the published values.
///
/// docs/THESIS.md describes the results, the readings and the files.
#[derive(Debug, Parser)]
#[command(name = "damprig-thesis", version, after_help = AFTER_HELP, max_term_width = 100)]
pub struct Args {
    /// Figures and tables (table-3-4) [default: all]
    #[arg(value_name = "ITEM")]
    items: Vec<String>,

    /// Folder of the results
    #[arg(long, value_name = "DIR", default_value = "thesis-results")]
    out: PathBuf,

    /// List all figures and tables, where their numbers come from and why; compute nothing
    #[arg(long, conflicts_with_all = ["quick", "published"])]
    list: bool,

    /// Leave out the other readings of the document, which show how the results move
    #[arg(long)]
    quick: bool,

    /// Print the numbers with their readings as one JSON object
    #[arg(long)]
    json: bool,

    /// Fill gaps in the published values from this file (TOML, as published.toml)
    #[arg(long, value_name = "FILE")]
    published: Option<PathBuf>,

    /// Use the items.toml, published.toml and other files in this folder [default: those of this version, written to DIR/files]
    #[arg(long, value_name = "FOLDER")]
    files: Option<PathBuf>,
}

const AFTER_HELP: &str = "\
Examples:
  damprig-thesis                                           everything; then open thesis-results/thesis.html
  damprig-thesis --quick                                   without the other readings
  damprig-thesis --list
  damprig-thesis table-3-4 fig-3-9
  damprig-thesis table-3-4 --json
  damprig-thesis --published my-values.toml

The folder gets thesis.html, thesis.md, published.csv, claims.csv, the results of each item in a folder of its name, and in files/ the
studies, cases, continuations and campaigns behind them, which the other commands of damprig run alone. What is complete is not
computed again; Ctrl-C stops, and the same command goes on.

Exit codes:
  0    success
  1    a part could not be computed or a file not be written; the other parts are kept
  2    the command line or a file is wrong
  130  interrupted (Ctrl-C, SIGTERM or SIGHUP); the results so far are kept";

/// Runs the command.
///
/// # Errors
/// Bad input, an unwritable file, an interrupted run.
pub fn run(args: &Args) -> Outcome {
    let checked = Shipped::new(args)?;
    let catalogue = checked.catalogue()?;
    wanted(&catalogue, &args.items)?;
    if args.list {
        return list(&catalogue, args);
    }
    let mut published = Published::read(&catalogue)?;
    if let Some(file) = &args.published {
        published.fill(file)?;
    }
    let _lock = lock(&args.out)?;
    let folder = match &args.files {
        Some(folder) => folder.clone(),
        None => files::write_out(&args.out)?,
    };
    let catalogue = Catalogue::read(&folder)?;
    let results = Results::at(&args.out);
    let items = wanted(&catalogue, &args.items)?;
    let tasks = run::plan(&catalogue, &results, &items, args.quick)?;
    let ended = work::compute(&catalogue, &tasks, args.json)?;
    let all: Vec<&Item> = catalogue.items.iter().collect();
    let files = command_folder(&folder, &args.out);
    marked::draw(&catalogue, &published, &results)?;
    let whole = Comparison::of(
        &catalogue,
        &published,
        &results,
        &all,
        claims::judge_all(&catalogue, &results, &published),
        &files,
    );
    page::write(&whole, &args.out)?;
    let shown = Comparison { items: whole.items.into_iter().filter(|c| is_among(c.item, &items)).collect(), ..whole };
    if args.json {
        print(&shown.json().to_string());
    } else {
        say(&shown, args);
    }
    ended
}

/// Keeps other processes from computing into the same folder, until it is dropped.
fn lock(out: &Path) -> Result<File, Failure> {
    let path = out.join(".lock");
    let failed = |error: std::io::Error| Failure::Failed(format!("{}: {error}", path.display()));
    std::fs::create_dir_all(out).map_err(|error| Failure::Failed(format!("{}: {error}", out.display())))?;
    let file = File::create(&path).map_err(failed)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(Failure::Failed(format!(
            "another damprig-thesis computes into {}\n  wait until it has ended, or give another --out",
            out.display()
        ))),
        Err(TryLockError::Error(error)) => Err(failed(error)),
    }
}

/// The files to check the command line against, before anything is written.
struct Shipped {
    folder: PathBuf,
    /// Removes the folder at the end.
    _temporary: Option<tempfile::TempDir>,
}

impl Shipped {
    fn new(args: &Args) -> Result<Self, Failure> {
        if let Some(folder) = &args.files {
            return Ok(Self { folder: folder.clone(), _temporary: None });
        }
        let temporary = tempfile::TempDir::new().map_err(Failure::failed)?;
        let folder = files::write_out(temporary.path())?;
        Ok(Self { folder, _temporary: Some(temporary) })
    }

    fn catalogue(&self) -> Result<Catalogue, Failure> {
        Catalogue::read(&self.folder)
    }
}

/// The items that the command line names, in the order of the document; all if it names none.
fn wanted<'a>(catalogue: &'a Catalogue, names: &[String]) -> Result<Vec<&'a Item>, Failure> {
    let named = names.iter().map(|name| catalogue.find(name)).collect::<Result<Vec<&Item>, _>>()?;
    let is_wanted = |item: &&Item| named.is_empty() || is_among(item, &named);
    Ok(catalogue.items.iter().filter(is_wanted).collect())
}

fn is_among(item: &Item, items: &[&Item]) -> bool {
    items.iter().any(|other| other.name == item.name)
}

/// The folder of the files as a command names it that is started in the folder of the results.
fn command_folder(folder: &Path, out: &Path) -> PathBuf {
    let elsewhere = || folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    folder.strip_prefix(out).map_or_else(|_| elsewhere(), Path::to_path_buf)
}

fn list(catalogue: &Catalogue, args: &Args) -> Outcome {
    let items = wanted(catalogue, &args.items)?;
    if args.json {
        let item = |item: &&Item| {
            serde_json::json!({
                "name": item.name,
                "title": item.title,
                "kind": item.kind.name(),
                "reason": item.reason,
                "reading": item.reading,
            })
        };
        print(&serde_json::Value::from(items.iter().map(item).collect::<Vec<_>>()).to_string());
        return Ok(());
    }
    let mut table = plain_table(&["Item", "Shows", "Numbers", "Why"]);
    table.set_content_arrangement(comfy_table::ContentArrangement::Dynamic);
    for item in items {
        table.add_row([item.name.as_str(), &item.title, item.kind.words(), item.reason.as_deref().unwrap_or("")]);
    }
    print(&table.to_string());
    Ok(())
}

/// Prints a line for each item with published values, the verdicts, and where the page is.
fn say(comparison: &Comparison, args: &Args) {
    for compared in comparison.items.iter().filter(|compared| !compared.rows.is_empty()) {
        say_item(compared);
    }
    for judgement in &comparison.judgements {
        print(&format!("Claim {}: {}\n  {}", judgement.number, judgement.words(), judgement.claim));
    }
    let gaps = comparison.gaps();
    if gaps > 0 && args.published.is_none() {
        print(&format!(
            "{gaps} published values and curves are missing: fill them in with --published FILE, as {PUBLISHED}"
        ));
    }
    print(&format!("Page: {}", args.out.join(page::PAGE).display()));
}

fn say_item(compared: &ComparedItem) {
    print(&format!("{}: {}", compared.item.name, compared.item.title));
    for row in &compared.rows {
        let published = row.value.value.map_or_else(|| "—".into(), |value| significant(value, 5));
        let computed = row.computed.as_ref().map_or_else(|_| "—".into(), |value| significant(*value, 5));
        let unit = row.unit();
        print(&format!("  {:48} {:>10}  {computed:>10} {unit}", row.value.label, format!("({published})")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_in_the_documents_exists() {
        let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let text = std::fs::read_to_string(top.join("docs/THESIS.md")).expect("a document of the project") + AFTER_HELP;
        // Text after two spaces explains the command.
        let lines = text.lines().map(|line| line.trim().split("  ").next().unwrap_or(""));
        let commands: Vec<&str> = lines.filter(|line| line.starts_with("damprig-thesis")).collect();
        assert!(commands.len() >= 10, "{commands:?}");
        for command in commands {
            Args::try_parse_from(command.split_whitespace()).unwrap_or_else(|error| panic!("`{command}`: {error}"));
        }
    }
}
