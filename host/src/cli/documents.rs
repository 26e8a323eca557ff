//! `damprig completions` and `damprig man`: shell completions and manual pages, made from the definition of the command line.

use clap::Args as ClapArgs;
use clap::Command;
use clap_complete::Shell;
use clap_mangen::Man;

use super::outcome::{Failure, Outcome};

/// Prints the completions of a shell, for its completion folder or start-up file.
#[derive(Debug, ClapArgs)]
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
#[derive(Debug, ClapArgs)]
#[command(after_help = MAN_HELP)]
pub struct ManualPage {
    /// Command, with its subcommand if it has any; damprig itself without one
    #[arg(value_name = "COMMAND")]
    command: Vec<String>,
}

const MAN_HELP: &str = "\
Examples:
  damprig man | man -l -
  damprig man run > ~/.local/share/man/man1/damprig-run.1
  damprig man runs export > ~/.local/share/man/man1/damprig-runs-export.1";

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

fn print(text: &[u8]) {
    say!("{}", String::from_utf8_lossy(text).trim_end());
}
