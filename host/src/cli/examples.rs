//! `damprig examples`: lists the shipped campaigns, cases, studies, optimisations and continuations, and copies one here.
//! Finds the shipped file that `damprig run NAME` and the like mean where no file has that name.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::arguments::{ForceArg, JsonArg};
use super::output::is_quiet;
use crate::failure::{Failure, Outcome};
use crate::file_keys::FileKind;
use crate::input::shipped::{FILES, ROOT, plain};
use crate::input::{Source, near};
use crate::storage::create_folder;
use crate::storage::out_file::{to_failure, write_new};

/// Lists the example files that come with damprig, or copies one of them here.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct ExamplesArgs {
    /// Example to copy into this folder, with the files that it names; all are listed without one
    #[arg(value_name = "NAME")]
    name: Option<String>,

    #[command(flatten)]
    json: JsonArg,

    #[command(flatten)]
    force: ForceArg,
}

const AFTER_HELP: &str = "\
Examples:
  damprig examples                  list all
  damprig examples hybrid           copy the campaign hybrid to hybrid.toml, to change it
  damprig examples cases/hybrid     copy the case of the same name

Where no file has the name, `damprig run hybrid`, `damprig simulate spid` and the other commands take the
shipped file, and say so on their first line.

Exit codes:
  0    success
  1    a file could not be written
  2    there is no such example, or a file of its name exists; nothing was written";

/// An example that has a name and a command.
#[derive(Clone, Copy, Debug)]
struct Example {
    kind: FileKind,
    folder: &'static str,
    /// The command that takes it.
    command: &'static str,
    /// Name without folder and extension.
    name: &'static str,
    /// Path as in [`FILES`].
    path: &'static str,
    text: &'static str,
}

impl Example {
    /// All, kind by kind.
    fn all() -> impl Iterator<Item = Self> {
        FileKind::ALL.into_iter().filter_map(|kind| Some((kind, kind.shipped()?))).flat_map(
            |(kind, (folder, command))| {
                FILES.iter().filter_map(move |(path, text)| {
                    let name = path.strip_prefix(folder)?.strip_prefix('/')?.strip_suffix(".toml")?;
                    (!name.contains('/')).then_some(Self { kind, folder, command, name, path, text })
                })
            },
        )
    }

    /// Whether it is meant by `NAME`, `NAME.toml`, or either with the folder of its kind.
    fn is_meant_by(&self, wanted: &str) -> bool {
        let wanted = wanted.strip_suffix(".toml").unwrap_or(wanted);
        let wanted = wanted.strip_prefix(self.folder).and_then(|rest| rest.strip_prefix('/')).unwrap_or(wanted);
        wanted == self.name
    }

    /// Name with the folder of its kind: no other example has it.
    fn full_name(&self) -> &'static str {
        self.path.strip_suffix(".toml").unwrap_or(self.path)
    }

    /// The shortest name that `damprig examples` knows it by.
    fn short_name(&self) -> &'static str {
        let first = Self::all().find(|other| other.name == self.name);
        if first.is_some_and(|first| first.kind == self.kind) { self.name } else { self.full_name() }
    }

    /// First sentence of the comment at its beginning.
    fn description(&self) -> String {
        let comment = self.text.lines().map_while(|line| line.strip_prefix('#')).map(str::trim);
        let comment = comment.collect::<Vec<_>>().join(" ");
        let end = comment.find(". ").unwrap_or(comment.len());
        comment[..end].trim_end_matches('.').to_string()
    }
}

/// The file that a command means by `given`: itself, if there is one, else the shipped example of that name. Says which example was
/// taken.
///
/// # Errors
/// There is neither; names what is near.
pub(super) fn find(kind: FileKind, given: &Path) -> Result<PathBuf, Failure> {
    if given.symlink_metadata().is_ok() {
        return Ok(given.to_path_buf());
    }
    let wanted = given.to_str().unwrap_or_default();
    if let Some(example) = Example::all().find(|example| example.kind == kind && example.is_meant_by(wanted)) {
        if !is_quiet() {
            let (path, name) = (example.path, example.short_name());
            warn!("Shipped example {path}; `damprig examples {name}` copies it here, to change it");
        }
        return Ok(Path::new(ROOT).join(example.path));
    }
    // The reader's message names files that look like it.
    let Err(refusal) = Source::read(given) else { return Ok(given.to_path_buf()) };
    Err(Failure::Input(format!("{refusal}\n  {}", no_example(wanted, Some(kind)))))
}

/// "there is no shipped …", with near names.
fn no_example(wanted: &str, kind: Option<FileKind>) -> String {
    let what = kind.map_or("file", FileKind::name);
    let stem = wanted.strip_suffix(".toml").unwrap_or(wanted);
    let of_kind = || Example::all().filter(|example| kind.is_none_or(|kind| example.kind == kind));
    let other = Example::all().find(|example| example.is_meant_by(wanted));
    let hint = match (other, near(stem, of_kind().map(|example| example.name)).first()) {
        (Some(other), _) => {
            let (kind, command, name) = (other.kind.name(), other.command, other.name);
            format!("; there is a {kind} of this name: `{command} {name}`")
        }
        (None, Some(near)) => format!("; did you mean {near}?"),
        (None, None) => String::new(),
    };
    format!("no shipped {what} has this name{hint}\n  `damprig examples` lists the shipped files")
}

/// Runs the subcommand.
///
/// # Errors
/// No such example, a file that exists or cannot be written.
pub fn run(args: &ExamplesArgs) -> Outcome {
    match &args.name {
        None => list(args.json),
        Some(name) => copy(name, args.json, args.force),
    }
}

/// An example in the list, as JSON.
#[derive(Serialize)]
struct Listed {
    name: &'static str,
    kind: &'static str,
    description: String,
    command: String,
    bytes: usize,
}

fn list(json: JsonArg) -> Outcome {
    if json.is_given() {
        let all: Vec<Listed> = Example::all()
            .map(|example| Listed {
                name: example.short_name(),
                kind: example.kind.name(),
                description: example.description(),
                command: format!("{} {}", example.command, example.name),
                bytes: example.text.len(),
            })
            .collect();
        say!("{}", serde_json::to_string(&all)?);
        return Ok(());
    }
    for (kind, (folder, command)) in FileKind::ALL.into_iter().filter_map(|kind| Some((kind, kind.shipped()?))) {
        say!("{} ({command} NAME)", capital(folder));
        for example in Example::all().filter(|example| example.kind == kind) {
            say!("  {:<28} {}", example.short_name(), example.description());
        }
    }
    say!("\n`damprig examples NAME` copies one into this folder, with the files that it names.");
    Ok(())
}

fn capital(word: &str) -> String {
    format!("{}{}", word[..1].to_uppercase(), &word[1..])
}

fn copy(wanted: &str, json: JsonArg, force: ForceArg) -> Outcome {
    let mut fit = Example::all().filter(|example| example.is_meant_by(wanted));
    let Some(example) = fit.next() else {
        return Err(Failure::Input(format!("{wanted}: {}", no_example(wanted, None))));
    };
    let files = files_of(&example);
    let mut new = Vec::new();
    for (to, text) in files {
        match std::fs::read(&to) {
            // Several examples name the same case.
            Ok(there) if there == text.as_bytes() && !new.is_empty() => {}
            _ => {
                force.check(&to)?;
                new.push((to, text));
            }
        }
    }
    for (to, text) in &new {
        if let Some(folder) = to.parent() {
            create_folder(folder)?;
        }
        write_new(&force.file(to), |file| file.write_all(text.as_bytes()).map_err(|e| to_failure(to)(&e)))?;
    }
    let names: Vec<String> = new.iter().map(|(to, _)| to.display().to_string()).collect();
    let next = format!("{} {}.toml", example.command, example.name);
    if json.is_given() {
        say!("{}", serde_json::json!({ "copied": names, "next": next }));
        return Ok(());
    }
    say!("Copied {}", names.join(", "));
    for other in fit {
        say!("A {} has this name too: `damprig examples {}`", other.kind.name(), other.full_name());
    }
    say!("Next: {next}");
    Ok(())
}

/// The copies of an example and of the files that it names. The example is copied into this folder, the others into folders below it, so
/// paths in the example lose their `../`; those in the other files stay right.
fn files_of(example: &Example) -> Vec<(PathBuf, String)> {
    let own = PathBuf::from(example.path.rsplit('/').next().unwrap_or(example.path));
    let mut files = vec![(own, example.text.replace("\"../", "\""))];
    // An example in FILES, and where its copy belongs.
    let mut named: Vec<(&str, PathBuf)> = named_files(example.path, example.text)
        .map(|(path, word)| (path, PathBuf::from(word.trim_start_matches("../"))))
        .collect();
    while let Some((path, to)) = named.pop() {
        if files.iter().any(|(there, _)| *there == to) {
            continue;
        }
        let text = FILES.iter().find(|(of, _)| *of == path).map_or("", |(_, text)| *text);
        named.extend(named_files(path, text).map(|(path, word)| (path, plain(&beside(&to, word)))));
        files.push((to, text.to_string()));
    }
    files
}

/// The examples that a text names in quotes, relative to its own path: path as in [`FILES`], and the word in the text.
fn named_files<'a>(own: &'a str, text: &'a str) -> impl Iterator<Item = (&'static str, &'a str)> {
    text.lines().flat_map(|line| line.split('"').skip(1).step_by(2)).filter_map(move |word| {
        let place = plain(&beside(Path::new(own), word));
        FILES.iter().find(|(path, _)| Path::new(path) == place).map(|(path, _)| (*path, word))
    })
}

/// The path that a file means by `word`.
fn beside(file: &Path, word: &str) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(word)
}
