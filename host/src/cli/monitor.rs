//! `damprig monitor`: shows an idle rig, a run that another program records, or a run that is over. `damprig run --monitor` shares
//! its options.

use std::io::IsTerminal;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;

use super::arguments::{Rig, SpeedArg, seconds};
use super::ctrl_c::CtrlC;
use crate::client::link::{Address, Cable, cable};
use crate::client::session::Session;
use crate::failure::{Failure, Outcome};
use crate::monitor::terminal::{TerminalView, TerminalWatcher};
use crate::monitor::{Handles, Monitor, Permissions, Serving, Token, folder, rig};
use crate::run_folder::RunFolder;
use crate::run_folder::read::folder::find;

/// Where the page is served and who may control.
#[derive(Clone, Debug, Args)]
pub(super) struct PageArgs {
    /// Address and port of the page; port 0 for any free port. An address other than 127.0.0.1 lets other machines watch
    /// [default: 127.0.0.1:8421, or a free port if that is in use]
    #[arg(long, value_name = "ADDR:PORT", value_parser = address)]
    listen: Option<SocketAddr>,

    /// Let the page act: stop, pause, hold, set the spring, clear a fault. It needs the token in the printed address
    #[arg(long)]
    control: bool,
}

fn address(text: &str) -> Result<SocketAddr, String> {
    let hint = "write an address and a port, as 127.0.0.1:8421 or [::1]:8421; port 0 for any free one";
    text.parse().map_err(|_| hint.into())
}

impl PageArgs {
    pub(super) fn is_given(&self) -> bool {
        self.listen.is_some() || self.control
    }

    pub(super) fn can_control(&self) -> bool {
        self.control
    }

    /// Starts the monitor and takes the address of its page. Faults can be injected into a rig that is simulated in real time.
    pub(super) fn prepare(&self, rig: &Address, where_to_stop: String, handles: Handles) -> Result<Monitor, Failure> {
        let can_inject = matches!(rig, Address::RealTime { .. });
        let token = self.control.then(Token::new).transpose().map_err(Failure::Failed)?;
        let permissions = Permissions { can_control: self.control, can_inject, where_to_stop };
        let serving = Serving { listen: self.listen, token };
        Monitor::prepare(Some(serving), permissions, handles)
    }
}

/// Serves the page of a monitor, if it has one, and prints its address.
pub(super) fn serve(monitor: &mut Monitor) -> Outcome {
    monitor.serve()?;
    monitor.url().iter().for_each(|url| warn!("Monitor: {url}"));
    if monitor.is_public() {
        let what = if monitor.can_control() {
            "those with the token can control the rig, and the connection is not encrypted"
        } else {
            "they cannot control the rig"
        };
        warn!("warning: every machine that reaches this one can open the page; {what}");
    }
    Ok(())
}

/// What viewers may do besides asking the session: pull the cable of a rig in this process.
pub(super) fn handles(rig: &Address) -> Handles {
    let pull = |cable: Cable| Box::new(move |on| if on { cable.pull() } else { cable.plug() }) as Box<_>;
    Handles { cable: cable(rig).map(pull), ..Handles::default() }
}

/// Where a run can be stopped, for viewers who cannot.
pub(super) fn where_to_stop() -> String {
    format!("Stop: Ctrl-C in the terminal that runs damprig on {}.", host_name())
}

/// Refuses `--tui` without a terminal.
pub(super) fn check_terminal(is_wanted: bool) -> Outcome {
    if !is_wanted || std::io::stdout().is_terminal() && std::io::stdin().is_terminal() {
        return Ok(());
    }
    let message = "--tui: it needs a terminal for input and output; leave it out, or use --monitor for a page";
    Err(Failure::Input(message.into()))
}

/// Opens the terminal view.
pub(super) fn open_terminal(
    monitor: &Monitor,
    stop: &Arc<AtomicBool>,
    owns_run: bool,
    mount_without_asking: bool,
) -> Result<(TerminalView, TerminalWatcher), Failure> {
    TerminalView::open(&monitor.feed(), stop, monitor.player(), owns_run, mount_without_asking)
        .map_err(|e| Failure::Failed(format!("--tui: the terminal cannot be used: {e}")))
}

/// Name of this machine, for people.
fn host_name() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok().or_else(|| std::env::var("COMPUTERNAME").ok());
    let name = name.unwrap_or_default().trim().to_string();
    if name.is_empty() { "the machine of the rig".into() } else { name }
}

/// Shows a rig or a run live, on a page in the browser.
///
/// With --rig an idle rig: displacements, forces, spring, sensors and counters as its controller measures them. With --run a
/// run: one that is being recorded is followed, up to a second behind; one that is over is replayed. A run that this program
/// starts itself is watched with `damprig run --monitor`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct MonitorArgs {
    /// Rig: auto (the only connected board), serial:PATH, tcp:HOST:PORT, virtual:realtime, virtual:realtime,f32 (the board's
    /// precision), virtual:realtime,BOARD.toml or virtual:realtime,f32,BOARD.toml (with settings from a file, as written by
    /// `damprig settings export`)
    #[arg(long, value_name = "RIG", required_unless_present = "run")]
    rig: Option<Rig>,

    /// Folder of a run, or its name below runs/
    #[arg(long, value_name = "FOLDER", conflicts_with = "rig")]
    run: Option<PathBuf>,

    /// Rig seconds per second: of a replay (0.01 to 1000), or of virtual:realtime (0.5 to 20) [default: 1]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    speed: Option<f64>,

    /// Show the numbers in this terminal too
    #[arg(long)]
    tui: bool,

    /// Time without a message after which the link counts as lost
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = seconds)]
    timeout: f64,

    #[command(flatten)]
    page: PageArgs,
}

const AFTER_HELP: &str = "\
Examples:
  damprig monitor --rig auto                           the connected board
  damprig monitor --rig virtual:realtime --control     learn the tool without a board: inject faults, clear them
  damprig monitor --run runs/<run>                     follow or replay a run
  damprig monitor --run runs/<run> --speed 10 --listen 0.0.0.0:8421

Of a rig the first line says which settings act: where they come from, and the board's limits. If
saved settings do not act (damaged, of another layout), the board drives only with
`damprig run --accept-settings`.

Ctrl-C ends the monitor.

Exit codes:
  0    ended with Ctrl-C
  1    the rig or the folder cannot be read, or the address is in use
  2    the command line is wrong";

/// Runs the subcommand.
///
/// # Errors
/// A rig that does not answer, a folder without a run, an address in use.
pub fn run(args: &MonitorArgs) -> Outcome {
    check_terminal(args.tui)?;
    let ctrl_c = CtrlC::watch()?;
    match (&args.run, &args.rig) {
        (Some(wanted), _) => watch_folder(args, wanted, ctrl_c.flag()),
        (None, Some(rig)) => watch_rig(args, rig, ctrl_c.flag()),
        (None, None) => Err(Failure::Input("give --rig or --run".into())),
    }
}

/// What a page is told that shows a folder.
const ABOUT_FOLDERS: &str = "This page shows a run folder; a run that is still going on is stopped where it runs.";

fn watch_folder(args: &MonitorArgs, wanted: &std::path::Path, stop: &Arc<AtomicBool>) -> Outcome {
    let (slowest, fastest) = folder::REPLAY_SPEEDS;
    let speed = args.speed.unwrap_or(1.0);
    if !(slowest..=fastest).contains(&speed) {
        let message = format!("--speed {speed}: a replay runs at {slowest} to {fastest} rig seconds per second");
        return Err(Failure::Input(message));
    }
    if args.page.can_control() {
        let message =
            "--control: a run in a folder can only be watched; `damprig run --monitor --control` controls a run";
        return Err(Failure::Input(message.into()));
    }
    let path = find(wanted)?;
    RunFolder::open(&path)?;
    let mut monitor = args.page.prepare(
        &Address::VIRTUAL,
        ABOUT_FOLDERS.into(),
        Handles { can_replay: true, ..Handles::default() },
    )?;
    serve(&mut monitor)?;
    let terminal = args.tui.then(|| open_terminal(&monitor, stop, false, true)).transpose()?;
    let (feed, actions) = (monitor.feed(), monitor.take_actions());
    let watched = match actions {
        Some(actions) => folder::watch(&path, speed, &feed, &actions, stop),
        None => Ok(()),
    };
    monitor.end();
    drop(terminal);
    watched
}

fn watch_rig(args: &MonitorArgs, rig: &Rig, stop: &Arc<AtomicBool>) -> Outcome {
    let address = SpeedArg { speed: args.speed }.apply(rig.find()?)?;
    if let Address::Virtual { .. } = &address {
        let message = "--rig: the time of this virtual rig passes only in a run; use --rig virtual:realtime";
        return Err(Failure::Input(message.into()));
    }
    let timeout = Duration::from_secs_f64(args.timeout);
    let open = || {
        // A board that was plugged in again may have another port.
        let found = (*rig == Rig::Auto).then(|| rig.find().ok()).flatten();
        Session::open(found.as_ref().unwrap_or(&address), timeout)
    };
    // The rig is there before its page: it has the cable, and a wrong one is refused at once.
    let session = open()?;
    say!("{}", session.settings_line());
    if session.needs_consent() {
        warn!(
            "warning: the settings that were saved on the board do not act; it drives only with consent (`damprig run --accept-settings`)"
        );
    }
    drop(session);
    let mut monitor = args.page.prepare(&address, where_to_stop(), handles(&address))?;
    serve(&mut monitor)?;
    let terminal = args.tui.then(|| open_terminal(&monitor, stop, false, true)).transpose()?;
    let (feed, actions) = (monitor.feed(), monitor.take_actions());
    let watched = match actions {
        Some(actions) => rig::watch(&open, &feed, &actions, stop).map_err(Failure::failed),
        None => Ok(()),
    };
    monitor.end();
    drop(terminal);
    watched
}
