//! The help of `damprig`: its commands in groups, and where to find what is known under another name.

use std::fmt::Write;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, Error};

/// The commands by what they are for.
const GROUPS: [(&str, &[&str]); 4] = [
    ("Rig", &["run", "monitor", "devices", "settings", "calibrate", "flash", "log"]),
    ("Results", &["runs", "compare", "identify", "spectrum", "inspect"]),
    ("Design", &["init", "simulate", "study", "optimise", "continue"]),
    ("Reference", &["examples", "keys", "schema", "man", "completions", "help"]),
];

/// Words that are tried as commands, and what does it.
const ELSEWHERE: [(&str, &str); 12] = [
    ("report", "damprig runs report RUN"),
    ("export", "damprig runs export RUN --format csv"),
    ("list", "damprig runs"),
    ("show", "damprig runs show RUN"),
    ("verify", "damprig runs verify RUN"),
    ("resume", "damprig run --resume RUN"),
    ("plot", "damprig simulate CASE --plot FILE.png, or damprig runs report RUN"),
    ("sweep", "damprig study run STUDY, or damprig run CAMPAIGN"),
    ("bifurcation", "damprig study bifurcation CASE --axis KEY=FROM:TO:COUNT"),
    ("optimize", "damprig optimise FILE"),
    ("continuation", "damprig continue FILE"),
    ("new", "damprig init FILE"),
];

/// The command with its commands in groups in its help.
pub fn grouped(command: Command) -> Command {
    let header = *command.get_styles().get_header();
    let literal = *command.get_styles().get_literal();
    let mut text = "{about}\n\n{usage-heading} {usage}\n".to_string();
    for (group, names) in GROUPS {
        let _ = write!(text, "\n{header}{group}:{header:#}\n");
        for name in names {
            let about = command.find_subcommand(name).and_then(Command::get_about);
            let about = about.map_or_else(|| "Print this help, or the help of a command".into(), ToString::to_string);
            let _ = writeln!(text, "  {literal}{name:<12}{literal:#} {about}");
        }
    }
    let _ = write!(text, "\n{header}Options:{header:#}\n{{options}}{{after-help}}");
    command.help_template(text)
}

/// The error with the command that does what an unknown command names.
pub fn with_hint(mut error: Error) -> Error {
    if error.kind() == ErrorKind::InvalidSubcommand
        && let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand)
        && let Some((_, command)) = ELSEWHERE.iter().find(|(name, _)| name == word)
    {
        error.remove(ContextKind::SuggestedSubcommand);
        let tip = vec![format!("write `{command}`").into()];
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(tip));
    }
    error
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_command_stands_in_one_group() {
        let mut command = Cli::command();
        command.build();
        let mut own: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
        let mut grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        own.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(own, grouped);
    }

    #[test]
    fn what_is_known_under_another_name_is_found() {
        for (word, command) in ELSEWHERE {
            let error = with_hint(Cli::command().try_get_matches_from(["damprig", word]).expect_err("no command"));
            assert!(error.to_string().contains(&format!("write `{command}`")), "{error}");
            for command in command.split(", or ") {
                let words: Vec<&str> = command.split(' ').collect();
                let cli = Cli::command();
                let found = words[1..].iter().try_fold(&cli, |at, word| at.find_subcommand(word)).is_some();
                assert!(found || cli.find_subcommand(words[1]).is_some(), "{command}");
            }
        }
    }
}
