//! `damprig flash`: checks a firmware image, keeps the board's settings in a file, writes the image, and gives the settings back.

use std::cell::RefCell;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args as ClapArgs;
use damprig_protocol::{ClockSource, Counters, Reset};
use indicatif::ProgressBar;
use probe_rs::flashing::{ProgressEvent, ProgressOperation};
use probe_rs::probe::DebugProbeSelector;

use super::arguments::Rig;
use super::outcome::{Failure, Outcome};
use crate::board::BOARD;
use crate::board::image::{Image, find};
use crate::board::probe::{Attached, Candidate, NoProbe, candidates, choose, selector};
use crate::client::backup::{Backup, Restored};
use crate::client::board_check;
use crate::client::controller::Controller;
use crate::client::devices::{only, ports, query};
use crate::client::link::Address;
use crate::client::session::{Session, hex};
use crate::host_time;
use crate::storage::out_file::{OutFile, to_failure, write_new};

/// Flashes the firmware of the controller board: checks the image, keeps the board's settings in a file, writes the image and reads
/// it back, resets the board, connects, and makes sure that the board has its settings.
///
/// The reset opens the drive's relay, so let the rig come to rest first. Writing leaves the board's settings memory alone; settings
/// that the new firmware does not read are restored from the file.
#[derive(Debug, ClapArgs)]
pub struct Args {
    #[command(flatten)]
    target: ImageAndProbe,

    /// Where to connect before and afterwards: auto (the serial port of the probe, else the only board) or serial:PATH
    #[arg(long, value_name = "RIG", default_value = "auto")]
    rig: Rig,

    /// File for the board's settings [default: settings-nucleo-g474re-<date>-<time>.toml]
    #[arg(long, value_name = "FILE.toml", conflicts_with = "without_backup")]
    backup: Option<PathBuf>,

    /// Write the image although the board's settings cannot be read first: a new board, or one whose firmware does not answer
    #[arg(long)]
    without_backup: bool,

    /// Time to wait for the board
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = super::arguments::seconds)]
    timeout: f64,
}

/// Which image and which probe.
#[derive(Debug, ClapArgs)]
pub struct ImageAndProbe {
    /// Firmware image [default: firmware/target/images/nucleo-g474re.elf, here or in a parent folder]
    #[arg(value_name = "IMAGE")]
    image: Option<PathBuf>,

    /// Debug probe, needed if several are connected: VID:PID or VID:PID:SERIAL, as the error message lists them
    #[arg(long, value_name = "VID:PID[:SERIAL]", value_parser = selector)]
    probe: Option<DebugProbeSelector>,
}

impl ImageAndProbe {
    /// The image, checked before any probe is touched.
    ///
    /// # Errors
    /// No image, or one for another board or protocol.
    pub fn image(&self) -> Result<Image, Failure> {
        let path = match &self.image {
            Some(path) => path.clone(),
            None => {
                let here = std::env::current_dir().map_err(|e| Failure::Failed(format!("no working folder: {e}")))?;
                find(&here).map_err(Failure::Input)?
            }
        };
        Image::read(&path).map_err(Failure::Input)
    }

    /// The selected probe.
    ///
    /// # Errors
    /// No probe, or several probes.
    pub fn choose(&self) -> Result<Candidate, Failure> {
        choose(&candidates(), self.probe.as_ref()).map_err(|none| match none {
            NoProbe::Missing(why) => Failure::Failed(why),
            NoProbe::Ambiguous(why) => Failure::Input(why),
        })
    }

    /// The selected probe, attached to the chip.
    ///
    /// # Errors
    /// No probe, several probes, or no chip.
    pub fn attach(&self) -> Result<(Candidate, Attached), Failure> {
        let probe = self.choose()?;
        let attached = Attached::to(&probe).map_err(Failure::Failed)?;
        Ok((probe, attached))
    }
}

/// Runs the subcommand.
///
/// # Errors
/// An invalid image; no probe, several probes, no chip; a flash error; a board that does not answer.
pub fn run(args: &Args) -> Outcome {
    let image = args.target.image()?;
    let probe = args.target.choose()?;
    let kept = if args.without_backup { None } else { Some(keep_settings(args, &probe)?) };
    let mut attached = Attached::to(&probe).map_err(Failure::Failed)?;
    let kilobytes = image.length() as f64 / 1e3;
    warn!("{}: {kilobytes:.1} KB through {} {}", image.path.display(), probe.name, probe.selector);
    let bars = RefCell::new(Bars::default());
    attached.write(&image, |event| bars.borrow_mut().show(event)).map_err(Failure::Failed)?;
    attached.reset().map_err(Failure::Failed)?;
    drop(attached);
    warn!("written and verified; the board restarts");
    let mut session = connect(args, &probe)?;
    // Only the board that was written gets the settings.
    let mut restored = Ok(());
    if is_own(&image, &session)
        && let Some((file, backup)) = &kept
    {
        restored = give_back(&mut session, backup, file);
    }
    describe(&image, &mut session)?;
    restored
}

/// Keeps the settings of the board in a file before anything is written.
fn keep_settings(args: &Args, probe: &Candidate) -> Result<(PathBuf, Backup), Failure> {
    let kept = address(&args.rig, probe).and_then(|address| Backup::before_update(&address, Duration::from_secs(2)));
    let backup = kept.map_err(|why| {
        Failure::Failed(format!(
            "the board's settings cannot be kept before the image is written: {why}\n  nothing was written. On a new board, or one that \
             does not answer: --without-backup"
        ))
    })?;
    let file = args
        .backup
        .clone()
        .unwrap_or_else(|| format!("settings-{BOARD}-{}.toml", host_time::now().strftime("%Y-%m-%d-%H%M%S")).into());
    let out = OutFile { path: file.clone(), force: false };
    let text = backup.to_text();
    write_new(&out, |f| f.write_all(text.as_bytes()).map_err(|e| to_failure(&file)(&e))).map_err(Failure::failed)?;
    warn!("settings of the board kept in {}: {}", file.display(), backup.summary());
    Ok((file, backup))
}

/// Makes sure that the board has the settings that it had before.
fn give_back(session: &mut Session, backup: &Backup, file: &Path) -> Outcome {
    if backup.is_blank() {
        warn!("the board had no saved settings: none were restored");
        return Ok(());
    }
    let done = backup.restore(session).map_err(|error| {
        let file = file.display();
        Failure::Failed(format!(
            "the image is written and runs, but the board does not have its settings: {error}\n  they are kept in {file}; \
             `damprig settings restore {file}` tries again"
        ))
    })?;
    warn!(
        "{}",
        match done {
            Restored::Unchanged => "the board has its settings",
            Restored::Saved => "settings restored, saved and verified",
        }
    );
    Ok(())
}

fn is_own(image: &Image, session: &Session) -> bool {
    (&session.identity.board, &session.identity.firmware) == (&image.identity.board, &image.identity.firmware)
}

/// A progress bar for each operation.
#[derive(Default)]
struct Bars(Option<ProgressBar>, Vec<(&'static str, u64)>);

impl Bars {
    fn show(&mut self, event: ProgressEvent) {
        match event {
            ProgressEvent::AddProgressBar { operation, total } => self.1.push((name(operation), total.unwrap_or(0))),
            ProgressEvent::Started(operation) => {
                let total = self.1.iter().filter(|(of, _)| *of == name(operation)).map(|(_, total)| total).sum();
                let bar = super::progress::bar(total);
                bar.set_message(name(operation));
                self.0 = Some(bar);
            }
            ProgressEvent::Progress { size, .. } => {
                if let Some(bar) = &self.0 {
                    bar.inc(size);
                }
            }
            ProgressEvent::Finished(_) | ProgressEvent::Failed(_) => {
                if let Some(bar) = self.0.take() {
                    bar.finish_and_clear();
                }
            }
            _ => {}
        }
    }
}

fn name(operation: ProgressOperation) -> &'static str {
    match operation {
        ProgressOperation::Fill => "reading",
        ProgressOperation::Erase => "erasing",
        ProgressOperation::Program => "writing",
        ProgressOperation::Verify => "reading back",
    }
}

/// Connects to the board, which needs time to start and to show its port.
fn connect(args: &Args, probe: &Candidate) -> Result<Session, Failure> {
    let end = Instant::now() + Duration::from_secs_f64(args.timeout);
    loop {
        let answer = address(&args.rig, probe)
            .and_then(|address| Session::open(&address, Duration::from_secs(1)).map_err(|e| e.to_string()));
        match answer {
            Ok(session) => return Ok(session),
            Err(why) if Instant::now() >= end => {
                return Err(Failure::Failed(format!(
                    "the image is written and verified, but the board did not answer within {} s: {why}\n  `damprig log` shows the firmware's log",
                    args.timeout
                )));
            }
            Err(_) => std::thread::sleep(Duration::from_millis(200)),
        }
    }
}

/// Address of the board: the serial port with the probe's serial number.
fn address(rig: &Rig, probe: &Candidate) -> Result<Address, String> {
    let Rig::At(address) = rig else {
        let ports = ports()?;
        let number = probe.selector.serial_number.as_deref().unwrap_or_default();
        let own = ports.iter().find(|port| {
            port.usb.as_ref().is_some_and(|usb| !number.is_empty() && usb.serial_number.eq_ignore_ascii_case(number))
        });
        return match own {
            Some(port) => Ok(Address::Serial((&port.path).into())),
            None => only(&query(ports, false, Duration::from_secs(1))),
        };
    };
    Ok(address.clone())
}

/// Prints the board's identity and state.
///
/// # Errors
/// It runs another firmware than the one written.
fn describe(image: &Image, session: &mut Session) -> Outcome {
    let counted = session.status().map(|(_, counters)| Controller::between(&Counters::default(), &counters));
    let health = counted.map_or_else(|e| e.to_string(), |c| [vec![c.line()], c.complaints()].concat().join("; "));
    let session = &*session;
    let (it, about) = (&session.identity, &session.description);
    let revision = if about.revision.is_empty() { "revision unknown" } else { about.revision.as_str() };
    say!("{} at {}", it.board, session.name());
    say!("  firmware  {} ({revision}, {} build)", it.firmware, about.profile);
    say!("  protocol  {} (schema {})", it.protocol, hex(&it.schema));
    say!("  clock     {}", clock(about.clock_source));
    say!("  reset by  {}", reset(about.reset));
    say!("  settings  {}", session.settings_text());
    say!("  health    {health}");
    if let Some(supply_v) = about.supply_v {
        say!("  supply    {supply_v:.2} V");
    }
    for warning in board_check::warnings(session) {
        say!("  warning   {warning}");
    }
    say!("  crash     {}", about.last_crash.map_or("none".into(), |crash| format!("before this start: {crash}")));
    if is_own(image, session) {
        return Ok(());
    }
    Err(Failure::Failed(format!(
        "another board answers at {}: written {} {}, found {} {}; give the board's port with --rig serial:PATH",
        session.name(),
        image.identity.board,
        image.identity.firmware,
        it.board,
        it.firmware
    )))
}

fn clock(source: ClockSource) -> &'static str {
    match source {
        ClockSource::Granted => "tick credit of the host",
        ClockSource::Crystal => "crystal, ±50 ppm",
        ClockSource::InternalOscillator => "internal oscillator, ±1 %: the crystal did not start",
    }
}

fn reset(reset: Reset) -> &'static str {
    match reset {
        Reset::Unknown => "unknown",
        Reset::Power => "power-on or low supply voltage",
        Reset::Pin => "the reset button or the debugger",
        // A debugger requests it in the same way.
        Reset::Software => "the firmware or the debugger",
        Reset::Watchdog => "the watchdog",
    }
}
