//! `damprig settings`: shows, changes, saves, exports and imports the settings of a board.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Subcommand};
use damprig_core::settings::Settings;
use damprig_protocol::Request;

use super::arguments::{ForceArg, Rig};
use super::consent::ConsentArg;
use crate::client::backup::{Backup, NotRestored, Restored};
use crate::client::session::{AnyBoard, Session};
use crate::failure::{Failure, Outcome};
use crate::input::{Source, near};
use crate::settings::{decimal, entries, from_toml, states_limits, to_toml};
use crate::storage::out_file::{to_failure, write_new};

/// Shows, changes, saves and copies the settings of a board: sensor calibration, limits, spring and impact constants.
///
/// Changes take effect at once. They are lost at power-off unless they are saved.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct SettingsArgs {
    #[command(subcommand)]
    action: SettingsAction,

    /// Rig: auto (the only connected board), serial:PATH, tcp:HOST:PORT, virtual, or virtual:BOARD.toml. The virtual rig takes
    /// its settings from BOARD.toml, as written by `export`, and forgets changes when the command ends
    #[arg(long, value_name = "RIG", default_value = "virtual", global = true)]
    rig: Rig,

    /// Time without a message after which the link counts as lost
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = super::arguments::seconds, global = true)]
    timeout: f64,
}

const AFTER_HELP: &str = "\
Examples:
  damprig settings show --rig auto
  damprig settings set spring.step_m=4e-6 safety.wall_force_n=300 --rig auto --save
  damprig settings export rig.toml --rig auto
  damprig settings import rig.toml --rig serial:/dev/ttyACM0 --save
  damprig settings backup kept.toml --rig auto                before another firmware; restore it after
  damprig settings restore kept.toml --rig auto
  damprig settings export board.toml          defaults; edit, then run with --rig virtual:board.toml
  damprig settings backup kept.toml --rig virtual:board.toml  practise a backup without a board

`show`, and the first line of most other commands, say where the settings in use come from. With --save
`set` and `import` also save the settings that they leave alone: if those saved before do not act
(damaged, of another layout), that needs --accept-settings.";

#[derive(Debug, Subcommand)]
enum SettingsAction {
    /// Print the settings in use as TOML
    Show,
    /// Change settings
    Set {
        /// Settings with their tables, as printed by `show`: spring.step_m=4e-6
        #[arg(value_name = "KEY=VALUE", required = true)]
        values: Vec<String>,
        /// Also save all settings
        #[arg(long)]
        save: bool,
        #[command(flatten)]
        consent: ConsentArg,
    },
    /// Save the settings in use, so that they survive a power cut
    Save,
    /// Write the settings in use to a new file
    Export {
        /// File
        #[arg(value_name = "FILE.toml")]
        file: PathBuf,
        #[command(flatten)]
        force: ForceArg,
    },
    /// Apply the settings of a file; settings that it leaves out stay as they are
    Import {
        /// File
        #[arg(value_name = "FILE.toml")]
        file: PathBuf,
        /// Also save all settings
        #[arg(long)]
        save: bool,
        #[command(flatten)]
        consent: ConsentArg,
    },
    /// Write the settings that the board keeps to a new file, byte by byte, for `restore` alone. Works with a firmware of any version
    Backup {
        /// File
        #[arg(value_name = "FILE.toml")]
        file: PathBuf,
        #[command(flatten)]
        force: ForceArg,
    },
    /// Save the settings of a backup on the board, and check that the board has them
    Restore {
        /// File written by `backup`
        #[arg(value_name = "FILE.toml")]
        file: PathBuf,
    },
}

/// Runs the subcommand.
///
/// # Errors
/// A wrong key, value or file; a board that does not answer or rejects the settings.
pub fn run(args: &SettingsArgs) -> Outcome {
    // Report input errors before connecting to the board.
    let timeout = Duration::from_secs_f64(args.timeout);
    if let SettingsAction::Export { file, force } | SettingsAction::Backup { file, force } = &args.action {
        force.check(file)?;
    }
    match &args.action {
        SettingsAction::Backup { file, force } => return backup(args, file, *force, timeout),
        SettingsAction::Restore { file } => return restore(args, file, timeout),
        _ => {}
    }
    let file = match &args.action {
        SettingsAction::Import { file, .. } => Some(Source::read(file)?),
        SettingsAction::Set { values, .. } => {
            changed(values, &Settings::default())?;
            None
        }
        _ => None,
    };
    let address = args.rig.find()?;
    let mut session = Session::open(&address, timeout)?;
    let present = session.settings;
    match &args.action {
        SettingsAction::Show => {
            say!("{}", to_toml(&present, &head(&session)).trim_end());
            Ok(())
        }
        SettingsAction::Export { file, force } => export(file, *force, &to_toml(&present, &head(&session))),
        SettingsAction::Save => {
            say!("{}", session.settings_line());
            save(&mut session)
        }
        // Handled above.
        SettingsAction::Backup { .. } | SettingsAction::Restore { .. } => Ok(()),
        SettingsAction::Set { values, save, consent } => {
            if *save {
                // The others would be saved too.
                consent.check(&mut session, "not set")?;
            }
            let wanted = changed(values, &present)?;
            send(&mut session, &present, &wanted, *save)
        }
        SettingsAction::Import { save, consent, .. } => {
            // Read above.
            let Some(source) = file else { return Ok(()) };
            let wanted = from_toml(&source, &present)?;
            if *save && !states_limits(source.text()) {
                consent.check(&mut session, "not imported: the file does not state every limit (safety.…)")?;
            }
            let own = &session.identity.board;
            if let Some(other) = board_of(source.text()).filter(|other| *other != own.as_str()) {
                warn!(
                    "note: {} is from the board {other}, this is {own}: the sensor calibration is imported too",
                    source.name()
                );
            }
            send(&mut session, &present, &wanted, *save)
        }
    }
}

/// Keeps what a board of any protocol has saved.
fn backup(args: &SettingsArgs, file: &Path, force: ForceArg, timeout: Duration) -> Outcome {
    let mut board = AnyBoard::open(&args.rig.find()?, timeout)?;
    let backup = Backup::of(&mut board)?;
    say!("Settings of {}, firmware {}: {}", backup.board, backup.firmware, backup.summary());
    export(file, force, &backup.to_text())
}

fn restore(args: &SettingsArgs, file: &Path, timeout: Duration) -> Outcome {
    let backup = Backup::read(file)?;
    let failed = |error: NotRestored| {
        let message = format!("{}: {error}", file.display());
        if matches!(error, NotRestored::Unreadable(_)) { Failure::Input(message) } else { Failure::Failed(message) }
    };
    // Before the board is asked for anything.
    backup.restorable().map_err(failed)?;
    let mut session = Session::open(&args.rig.find()?, timeout)?;
    let own = &session.identity.board;
    if *backup.board != **own {
        warn!(
            "note: {} is from the board {}, this is {own}: the sensor calibration is restored too",
            file.display(),
            backup.board
        );
    }
    if backup.settings().1.needs_consent() {
        warn!("note: {}: {}", file.display(), backup.summary());
    }
    let done = backup.restore(&mut session).map_err(failed)?;
    say!("{}", session.settings_line());
    say!(
        "{}",
        match done {
            Restored::Unchanged => "the board has these settings already",
            Restored::Saved => "restored, saved and verified",
        }
    );
    Ok(())
}

/// The board named in the header of an exported file.
fn board_of(text: &str) -> Option<&str> {
    text.lines().find_map(|line| line.strip_prefix("# Settings of ")?.split_once(", firmware ")).map(|(board, _)| board)
}

fn head(session: &Session) -> String {
    let (board, firmware) = (&session.identity.board, &session.identity.firmware);
    format!("Settings of {board}, firmware {firmware} ({})", session.settings_origin())
}

fn export(file: &Path, force: ForceArg, text: &str) -> Outcome {
    // Written atomically: an incomplete file would import without an error.
    write_new(&force.file(file), |f| f.write_all(text.as_bytes()).map_err(|e| to_failure(file)(&e)))?;
    say!("written to {}", file.display());
    Ok(())
}

fn send(session: &mut Session, present: &Settings, wanted: &Settings, and_save: bool) -> Outcome {
    let is_changed = wanted != present;
    if is_changed {
        session.execute("use the settings", Request::SetSettings(*wanted))?;
    } else {
        say!("nothing changed: no setting differs from those in use");
    }
    for ((place, before), (_, after)) in entries(present).iter().zip(entries(wanted)) {
        if *before != after {
            say!("{}: {} -> {}", place.join("."), decimal(*before), decimal(after));
        }
    }
    if and_save {
        return save(session);
    }
    if is_changed {
        say!("in use; lost at power-off unless they are saved (`damprig settings save`)");
    }
    Ok(())
}

fn save(session: &mut Session) -> Outcome {
    session.execute("save its settings", Request::SaveSettings)?;
    say!("saved");
    if session.name().starts_with("virtual") {
        say!("note: the virtual rig ends with this command; use a file with --rig virtual:BOARD.toml");
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
            return Err(Failure::Input(format!("`{key}` is given twice")));
        }
        given.push(key);
        if !names.iter().any(|name| name == key) {
            let last = key.rsplit('.').next().unwrap_or(key);
            let same = |name: &&String| name.rsplit('.').next() == Some(last);
            let mut candidates: Vec<&str> = names.iter().filter(same).map(String::as_str).collect();
            candidates.extend(near(key, names.iter().map(String::as_str)));
            candidates.dedup();
            let help = if candidates.is_empty() {
                "`damprig settings show` lists all settings".to_string()
            } else {
                format!(
                    "did you mean {}?",
                    candidates.iter().take(3).map(|c| format!("`{c}`")).collect::<Vec<_>>().join(", ")
                )
            };
            return Err(Failure::Input(format!("there is no setting `{key}`: {help}")));
        }
        let Some(value) = number.parse::<f64>().ok().filter(|value| value.is_finite()) else {
            return Err(Failure::Input(format!("`{key}` = {number} is not allowed: must be a finite number")));
        };
        // TOML wants digits on both sides of the point.
        let number = if number.parse::<toml::Value>().is_ok() { number.to_string() } else { format!("{value:?}") };
        text.push_str(&format!("{key} = {number}\n"));
    }
    from_toml(&Source::new("command line", text), present)
}
