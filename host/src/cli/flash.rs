//! `damprig flash`: checks a firmware image, keeps the board's settings in a file, writes the image, and gives the settings back.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use damprig_protocol::{ClockSource, Counters, Reset};

use super::arguments::{ForceArg, Rig};
use crate::board::BOARD;
use crate::board::drive::{MountedDrive, NoDrive};
use crate::board::hex::to_hex;
use crate::board::image::{Image, find};
use crate::client::backup::{Backup, Restored};
use crate::client::board_check;
use crate::client::controller::Controller;
use crate::client::devices::{only, ports, query};
use crate::client::link::Address;
use crate::client::session::{Session, hex};
use crate::failure::{Failure, Outcome};
use crate::host_time;
use crate::storage::out_file::{OutFile, to_failure, write_new};

/// Flashes the firmware of the controller board: checks the image, keeps the board's settings in a file, writes the image, waits until
/// the board has restarted with it, and makes sure that the board has its settings.
///
/// The image goes through the drive that the board's ST-LINK shows (NOD_G474RE), as a hex file. A program built with the feature `probe`
/// writes through the debug probe, which also reads it back; --drive chooses the drive there.
///
/// The reset opens the drive's relay, so let the rig come to rest first. Settings that the board does not have afterwards are restored
/// from the file.
#[derive(Debug, Args)]
pub struct FlashArgs {
    /// Firmware image (ELF) [default: firmware/target/images/nucleo-g474re.elf, here or in a parent folder, else the installed one]
    #[arg(value_name = "IMAGE")]
    image: Option<PathBuf>,

    /// Folder where the ST-LINK's drive is mounted [default: the only mounted drive of a NUCLEO-G474RE]
    #[arg(long, value_name = "FOLDER")]
    drive: Option<PathBuf>,

    /// Debug probe, needed if several are connected: VID:PID or VID:PID:SERIAL, as the error message lists them
    #[cfg(feature = "probe")]
    #[arg(long, value_name = "VID:PID[:SERIAL]", value_parser = super::flash_probe::selector, conflicts_with = "drive")]
    probe: Option<super::flash_probe::Selector>,

    /// Only write the image as Intel HEX to this new file; no board is touched
    #[arg(long, value_name = "FILE.hex", conflicts_with_all = ["drive", "backup", "without_backup"])]
    hex: Option<PathBuf>,

    /// Where to connect before and afterwards: auto (the serial port of the probe, else the only board), serial:PATH or tcp:HOST:PORT
    #[arg(long, value_name = "RIG", default_value = "auto")]
    rig: Rig,

    /// File for the board's settings [default: settings-nucleo-g474re-<date>-<time>.toml]
    #[arg(long, value_name = "FILE.toml", conflicts_with = "without_backup")]
    backup: Option<PathBuf>,

    #[command(flatten)]
    force: ForceArg,

    /// Write the image although the board's settings cannot be read first: a new board, or one whose firmware does not answer
    #[arg(long)]
    without_backup: bool,

    /// Time to wait for the board
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = super::arguments::seconds)]
    timeout: f64,
}

/// What writes the image.
enum ImageWriter {
    Drive(MountedDrive),
    #[cfg(feature = "probe")]
    Probe(super::flash_probe::Candidate),
}

impl ImageWriter {
    /// Finds it. Touches no board.
    #[cfg(not(feature = "probe"))]
    fn find(args: &FlashArgs) -> Result<Self, Failure> {
        drive(args.drive.as_deref()).map(Self::Drive)
    }

    /// Finds it. Touches no board.
    #[cfg(feature = "probe")]
    fn find(args: &FlashArgs) -> Result<Self, Failure> {
        match &args.drive {
            Some(folder) => drive(Some(folder)).map(Self::Drive),
            None => super::flash_probe::choose(args.probe.as_ref()).map(Self::Probe),
        }
    }

    /// Why the ST-LINK did not write an image, now or earlier, as its drive says.
    fn refusal(&self) -> Option<String> {
        match self {
            Self::Drive(drive) => drive.refusal(),
            #[cfg(feature = "probe")]
            Self::Probe(_) => None,
        }
    }

    /// Serial number of the ST-LINK; empty if it is not known.
    fn serial_number(&self) -> &str {
        match self {
            Self::Drive(_) => "",
            #[cfg(feature = "probe")]
            Self::Probe(probe) => probe.selector.serial_number.as_deref().unwrap_or_default(),
        }
    }

    /// Writes the image; the board restarts.
    fn write(&self, image: &Image) -> Outcome {
        let (path, kilobytes) = (image.path.display(), image.length() as f64 / 1e3);
        match self {
            Self::Drive(drive) => {
                warn!("{path}: {kilobytes:.1} KB through the drive {}", drive.folder().display());
                drive.copy(&to_hex(&image.pieces)).map_err(Failure::Failed)?;
                warn!("copied; the ST-LINK writes it and restarts the board");
            }
            #[cfg(feature = "probe")]
            Self::Probe(probe) => {
                warn!("{path}: {kilobytes:.1} KB through {} {}", probe.name, probe.selector);
                super::flash_probe::write(probe, image)?;
                warn!("written and verified; the board restarts");
            }
        }
        Ok(())
    }
}

fn drive(folder: Option<&Path>) -> Result<MountedDrive, Failure> {
    match folder {
        Some(folder) => MountedDrive::at(folder).map_err(Failure::Input),
        None => MountedDrive::find().map_err(|none| match none {
            NoDrive::Missing(why) => Failure::Failed(why),
            NoDrive::Ambiguous(why) => Failure::Input(why),
        }),
    }
}

/// The image, checked before any board is touched.
///
/// # Errors
/// No image, or one for another board or protocol.
pub(super) fn image(given: Option<&Path>) -> Result<Image, Failure> {
    let path = match given {
        Some(path) => path.to_path_buf(),
        None => {
            let here = std::env::current_dir().map_err(|e| Failure::Failed(format!("no working folder: {e}")))?;
            find(&here).map_err(Failure::Input)?
        }
    };
    Image::read(&path).map_err(Failure::Input)
}

/// Runs the subcommand.
///
/// # Errors
/// An invalid image; no drive or probe, several of them; an image that is not written; a board that does not restart with it.
pub fn run(args: &FlashArgs) -> Outcome {
    [&args.hex, &args.backup].into_iter().flatten().try_for_each(|file| args.force.check(file))?;
    let image = image(args.image.as_deref())?;
    if let Some(file) = &args.hex {
        return write_hex(&image, &args.force.file(file));
    }
    let way = ImageWriter::find(args)?;
    let kept = if args.without_backup { None } else { Some(keep_settings(args, &way)?) };
    let begun = Instant::now();
    let earlier_refusal = way.refusal();
    way.write(&image)?;
    let mut session = connect(args, &way, begun, earlier_refusal)?;
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

/// Writes the image as a hex file and prints its SHA-256.
fn write_hex(image: &Image, out: &OutFile) -> Outcome {
    let (text, file) = (to_hex(&image.pieces), &out.path);
    write_new(out, |f| f.write_all(text.as_bytes()).map_err(|e| to_failure(file)(&e)))?;
    say!(
        "{}: {:.1} KB of flash, {} {}",
        file.display(),
        image.length() as f64 / 1e3,
        image.identity.board,
        image.identity.firmware
    );
    Ok(())
}

/// Keeps the settings of the board in a file before anything is written.
fn keep_settings(args: &FlashArgs, way: &ImageWriter) -> Result<(PathBuf, Backup), Failure> {
    let kept = address(&args.rig, way).and_then(|address| Backup::before_update(&address, Duration::from_secs(2)));
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
    let text = backup.to_text();
    write_new(&args.force.file(&file), |f| f.write_all(text.as_bytes()).map_err(|e| to_failure(&file)(&e)))?;
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

/// Whether the board runs the image: its board, version and revision of the source.
fn is_own(image: &Image, session: &Session) -> bool {
    let (it, there) = (&image.identity, &session.identity);
    (&there.board, &there.firmware) == (&it.board, &it.firmware)
        && session.description.revision == image.revision.as_str()
}

/// Connects to the board when it has restarted: until then the old firmware may answer. `begun` is when writing began.
fn connect(
    args: &FlashArgs,
    way: &ImageWriter,
    begun: Instant,
    earlier_refusal: Option<String>,
) -> Result<Session, Failure> {
    let end = Instant::now() + Duration::from_secs_f64(args.timeout);
    loop {
        let answer = address(&args.rig, way)
            .and_then(|address| Session::open(&address, Duration::from_secs(1)).map_err(|e| e.to_string()))
            .and_then(|session| restarted(session, begun));
        let refusal = way.refusal();
        match answer {
            Ok(session) => return Ok(session),
            Err(_) if refusal.is_some() && refusal != earlier_refusal => {
                return Err(Failure::Failed(format!(
                    "the ST-LINK did not write the image: {}\n  the firmware on the board may be incomplete: flash it again",
                    refusal.unwrap_or_default()
                )));
            }
            Err(why) if Instant::now() >= end => {
                return Err(Failure::Failed(format!(
                    "the image was sent, but the board has not restarted with it within {} s: {why}\n  press its reset button, then \
                     `damprig devices` shows what it runs; flash it again if it does not answer",
                    args.timeout
                )));
            }
            Err(_) => std::thread::sleep(Duration::from_millis(200)),
        }
    }
}

/// The session, if the board has counted its ticks for a shorter time than since `begun`.
fn restarted(mut session: Session, begun: Instant) -> Result<Session, String> {
    let (status, _) = session.status().map_err(|error| error.to_string())?;
    let running_s = f64::from(status.tick) / f64::from(session.description.tick_hz);
    let since_s = begun.elapsed().as_secs_f64();
    // The internal oscillator may be 1 % fast.
    if running_s < 1.02 * since_s {
        return Ok(session);
    }
    Err(format!(
        "the firmware that answers has been running for {running_s:.0} s, longer than the {since_s:.0} s since writing began"
    ))
}

/// Address of the board: the serial port with the ST-LINK's serial number, else the only board.
fn address(rig: &Rig, way: &ImageWriter) -> Result<Address, String> {
    let Rig::At(address) = rig else {
        let ports = ports()?;
        let number = way.serial_number();
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
        "another board or firmware answers at {}: written {} {} ({}), found {} {} ({revision}); give the board's port with --rig serial:PATH",
        session.name(),
        image.identity.board,
        image.identity.firmware,
        if image.revision.is_empty() { "revision unknown" } else { &image.revision },
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
