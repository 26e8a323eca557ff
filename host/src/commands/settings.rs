//! `damprig settings`: what a board is before an experiment says anything, looked at, changed, kept, and carried to files.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args as ClapArgs, Subcommand};
use damprig_core::settings::{Settings, Source as Origin};
use damprig_protocol::Request;

use super::devices::Rig;
use super::{Failure, Outcome};
use crate::export::whole::{to_failure, write_new};
use crate::input::{Source, near};
use crate::session::Session;
use crate::settings::{decimal, entries, from_toml, origin_text, to_toml};

/// Shows, changes, saves and copies a board's settings: sensor scales, limits, spring and impact constants.
///
/// A board uses changed settings at once, and forgets them at power-off unless they are saved.
#[derive(Debug, ClapArgs)]
#[command(after_help = AFTER_HELP)]
pub struct Args {
    #[command(subcommand)]
    action: Action,

    /// The rig: virtual, virtual:BOARD.toml, tcp:HOST:PORT, serial:PATH, or auto for the only board that is plugged in. A
    /// simulated board keeps settings as long as it lives, the virtual rig until the command ends: there the settings are those of
    /// BOARD.toml, a file as `export` writes it
    #[arg(long, value_name = "RIG", default_value = "virtual", global = true)]
    rig: Rig,

    /// Seconds of silence after which the device counts as gone
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = super::run::seconds, global = true)]
    timeout: f64,
}

const AFTER_HELP: &str = "\
Examples:
  damprig settings show --rig auto
  damprig settings set spring.step_m=4e-6 safety.wall_force_n=300 --rig auto --save
  damprig settings export rig.toml --rig auto
  damprig settings import rig.toml --rig serial:/dev/ttyACM0 --save
  damprig settings export board.toml --rig virtual     # then edit it, and: damprig run CAMPAIGN.toml --rig virtual:board.toml";

#[derive(Debug, Subcommand)]
enum Action {
    /// Print the settings in use, as TOML
    Show,
    /// Use other values from now on
    Set {
        /// KEY=VALUE, as `show` prints the keys with their tables: spring.step_m=4e-6
        #[arg(value_name = "KEY=VALUE", required = true)]
        values: Vec<String>,
        /// Save them, too
        #[arg(long)]
        save: bool,
    },
    /// Keep the settings in use over power cuts
    Save,
    /// Write the settings in use to a file that does not exist
    Export {
        /// The file
        #[arg(value_name = "FILE.toml")]
        file: PathBuf,
    },
    /// Use the settings of a file from now on; what it leaves out stays
    Import {
        /// The file
        #[arg(value_name = "FILE.toml")]
        file: PathBuf,
        /// Save them, too
        #[arg(long)]
        save: bool,
    },
}

/// Runs the subcommand.
///
/// # Errors
/// A wrong key, value or file; a board that does not answer, or refuses.
pub fn run(args: &Args) -> Outcome {
    // What can be wrong without the board is told before it is asked.
    let file = match &args.action {
        Action::Import { file, .. } => Some(Source::read(file).map_err(|e| Failure::Input(e.to_string()))?),
        Action::Set { values, .. } => {
            changed(values, &Settings::default())?;
            None
        }
        _ => None,
    };
    let address = args.rig.find()?;
    let mut session = Session::open(&address, Duration::from_secs_f64(args.timeout)).map_err(failed)?;
    let (present, origin) = session.read_settings().map_err(failed)?;
    match &args.action {
        Action::Show => {
            print!("{}", to_toml(&present, &head(&session, origin)));
            Ok(())
        }
        Action::Export { file } => export(file, &to_toml(&present, &head(&session, origin))),
        Action::Save => save(&mut session),
        Action::Set { values, save } => {
            let wanted = changed(values, &present)?;
            send(&mut session, &present, &wanted, *save)
        }
        Action::Import { save, .. } => {
            // It was read above.
            let Some(source) = file else { return Ok(()) };
            let wanted = from_toml(&source, &present).map_err(|e| Failure::Input(e.to_string()))?;
            let own = &session.identity.board;
            if let Some(other) = board_of(source.text()).filter(|other| *other != own.as_str()) {
                eprintln!(
                    "note: {} is of the board {other}, this is {own}: its sensors' scales come along",
                    source.name()
                );
            }
            send(&mut session, &present, &wanted, *save)
        }
    }
}

fn failed(error: impl std::fmt::Display) -> Failure {
    Failure::Failed(error.to_string())
}

/// The board that an exported file says it is of.
fn board_of(text: &str) -> Option<&str> {
    text.lines().find_map(|line| line.strip_prefix("# Settings of ")?.split_once(", firmware ")).map(|(board, _)| board)
}

fn head(session: &Session, origin: Origin) -> String {
    let (board, firmware) = (&session.identity.board, &session.identity.firmware);
    format!("Settings of {board}, firmware {firmware} ({})", origin_text(origin))
}

fn export(file: &Path, text: &str) -> Outcome {
    if file.symlink_metadata().is_ok() {
        let message = format!("cannot write {}: it exists; move it away, or name another", file.display());
        return Err(Failure::Input(message));
    }
    // Half a file would be imported without a word: what it leaves out stays.
    write_new(file, |f| f.write_all(text.as_bytes()).map_err(|e| to_failure(file)(&e))).map_err(failed)?;
    println!("written to {}", file.display());
    Ok(())
}

fn send(session: &mut Session, present: &Settings, wanted: &Settings, and_save: bool) -> Outcome {
    session.tell("use the settings", Request::SetSettings(*wanted)).map_err(failed)?;
    let mut differences = 0;
    for ((place, before), (_, after)) in entries(present).iter().zip(entries(wanted)) {
        if *before != after {
            differences += 1;
            println!("{}: {} -> {}", place.join("."), decimal(*before), decimal(after));
        }
    }
    if differences == 0 {
        println!("nothing differs from what the board uses");
    }
    if and_save {
        return save(session);
    }
    println!("in use; at power-off the board forgets them unless they are saved (`damprig settings save`)");
    Ok(())
}

fn save(session: &mut Session) -> Outcome {
    session.tell("save its settings", Request::SaveSettings).map_err(failed)?;
    println!("saved");
    if session.name().starts_with("virtual") {
        println!("note: the virtual rig ends with this command; a file for --rig virtual:BOARD.toml keeps settings");
    }
    Ok(())
}

/// `present` with the values of `KEY=VALUE` texts.
fn changed(values: &[String], present: &Settings) -> Result<Settings, Failure> {
    let names: Vec<String> = entries(present).into_iter().map(|(place, _)| place.join(".")).collect();
    let (mut text, mut given) = (String::new(), Vec::new());
    for value in values {
        let Some((key, number)) = value.split_once('=').map(|(key, number)| (key.trim(), number.trim())) else {
            return Err(Failure::Input(format!("{value:?}: write KEY=VALUE, for example spring.step_m=4e-6")));
        };
        if key.is_empty() {
            return Err(Failure::Input(format!("{value:?}: write KEY=VALUE, for example spring.step_m=4e-6")));
        }
        if given.contains(&key) {
            return Err(Failure::Input(format!("`{key}` is given twice: leave out one")));
        }
        given.push(key);
        if !names.iter().any(|name| name == key) {
            let last = key.rsplit('.').next().unwrap_or(key);
            let same = |name: &&String| name.rsplit('.').next() == Some(last);
            let mut candidates: Vec<&str> = names.iter().filter(same).map(String::as_str).collect();
            candidates.extend(near(key, names.iter().map(String::as_str)));
            candidates.dedup();
            let help = if candidates.is_empty() {
                "`damprig settings show` lists them".to_string()
            } else {
                format!(
                    "did you mean {}?",
                    candidates.iter().take(3).map(|c| format!("`{c}`")).collect::<Vec<_>>().join(", ")
                )
            };
            return Err(Failure::Input(format!("there is no setting `{key}`: {help}")));
        }
        if !number.parse::<f32>().is_ok_and(f32::is_finite) {
            return Err(Failure::Input(format!("`{key}` = {number} is not allowed: must be a finite number")));
        }
        // A number of Rust's may lack what TOML wants: digits around the point.
        let number = number.parse::<f32>().map_or_else(|_| number.to_string(), decimal);
        text.push_str(&format!("{key} = {number}\n"));
    }
    from_toml(&Source::new("command line", text), present).map_err(|e| Failure::Input(e.to_string()))
}
