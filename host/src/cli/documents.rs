//! `damprig completions` and `damprig man`: shell completions and manual pages, made from the definition of the command line.
//! `damprig schema` and `damprig keys`: JSON Schemas and the key reference, made from the declarations of the keys.

use clap::Args;
use clap::Command;
use clap_complete::Shell;
use clap_mangen::Man;

use crate::failure::{Failure, Outcome};
use crate::file_keys::{FileKind, reference, schema, typed_dicts};

/// Prints the completions of a shell, for its completion folder or start-up file.
#[derive(Debug, Args)]
#[command(after_help = COMPLETIONS_HELP)]
pub struct Completions {
    /// Shell
    #[arg(value_enum)]
    shell: Shell,
}

const COMPLETIONS_HELP: &str = "\
Examples:
  damprig completions bash > ~/.local/share/bash-completion/completions/damprig
  damprig completions zsh > ~/.zfunc/_damprig
  damprig completions fish > ~/.config/fish/completions/damprig.fish";

/// Prints the manual page of damprig or of one of its commands (roff).
#[derive(Debug, Args)]
#[command(after_help = MAN_HELP)]
pub struct ManualPage {
    /// Command, with its subcommand if it has any; damprig itself without one
    #[arg(value_name = "COMMAND")]
    command: Vec<String>,
    /// Print the help of all commands as one page of the manual (Markdown)
    #[arg(long, conflicts_with = "command")]
    markdown: bool,
}

const MAN_HELP: &str = "\
Examples:
  damprig man | man -l -
  damprig man run > ~/.local/share/man/man1/damprig-run.1
  damprig man runs export > ~/.local/share/man/man1/damprig-runs-export.1
  damprig man --markdown > docs/COMMANDS.md";

/// Prints the JSON Schema of a kind of file, with which an editor completes and checks it.
#[derive(Debug, Args)]
#[command(after_help = SCHEMA_HELP)]
pub struct Schema {
    /// Kind of file
    #[arg(value_enum, value_name = "KIND")]
    kind: FileKind,
}

const SCHEMA_HELP: &str = "\
Example:
  damprig schema campaign > campaign.schema.json

Editors with a TOML extension (Even Better TOML, taplo) then complete and check a campaign beside it whose
first line is
  #:schema campaign.schema.json";

/// Prints all keys of campaigns, cases, set-up files, studies and optimisations, with unit, range, default and meaning (Markdown).
#[derive(Debug, Args)]
pub struct KeysArgs {
    /// Print them as types of Python, the module damprig.keys of the Python package
    #[arg(long)]
    python: bool,
}

/// Prints a JSON Schema.
///
/// # Errors
/// None.
pub fn schema(args: &Schema) -> Outcome {
    say!("{:#}", schema::schema(args.kind));
    Ok(())
}

/// Prints the key reference.
///
/// # Errors
/// None.
pub fn keys(args: &KeysArgs) -> Outcome {
    let text = if args.python { typed_dicts::module() } else { reference::reference() };
    say!("{}", text.trim_end());
    Ok(())
}

/// Prints completions.
///
/// # Errors
/// None.
pub fn completions(args: &Completions, mut command: Command) -> Outcome {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "damprig", &mut text);
    print(&text);
    Ok(())
}

/// Prints a manual page.
///
/// # Errors
/// There is no such command.
pub fn manual_page(args: &ManualPage, mut command: Command) -> Outcome {
    if args.markdown {
        say!("{}", commands_page(command).trim_end());
        return Ok(());
    }
    // Names the subcommands in full.
    command.build();
    let found = args.command.iter().try_fold(&command, |at, word| at.find_subcommand(word));
    let Some(found) = found else {
        let words = args.command.join(" ");
        return Err(Failure::Input(format!("there is no command `damprig {words}`; `damprig help` lists all")));
    };
    let mut text = Vec::new();
    Man::new(found.clone()).render(&mut text).map_err(Failure::failed)?;
    print(&text);
    Ok(())
}

/// The page of all commands: the help of each in a section of its own.
#[must_use]
pub fn commands_page(command: Command) -> String {
    // The same text in every terminal.
    let mut command = command.term_width(100);
    command.build();
    let mut page = String::from(
        "# Commands\n`damprig man --markdown` prints this page from the definition of the command line. `damprig help COMMAND` prints one of its sections.\n",
    );
    add_command(&command, &mut page);
    page
}

/// Adds the section of a command, and those of its subcommands.
fn add_command(command: &Command, page: &mut String) {
    let name = command.get_bin_name().unwrap_or_else(|| command.get_name());
    let help = command.clone().render_long_help().to_string();
    let help: Vec<&str> = help.trim_end().lines().map(str::trim_end).collect();
    page.push_str(&format!("\n## {name}\n```text\n{}\n```\n", help.join("\n")));
    let shown =
        command.get_subcommands().filter(|sub| !sub.is_hide_set() && (sub.get_name() != "help" || name == "damprig"));
    shown.for_each(|sub| add_command(sub, page));
}

fn print(text: &[u8]) {
    say!("{}", String::from_utf8_lossy(text).trim_end());
}
