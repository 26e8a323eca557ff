//! Tests of settings through the `damprig` command, and of the flash that stores them.

use damprig_board::peripherals::flash::{Bank2, Cut};
use damprig_board::{Board, Config, Output, Time};
use damprig_core::settings::{Settings, Source};
use damprig_protocol::{Reply, Request};

use crate::common::{Host, Served, bare, damprig, image, is_driving, project, run_campaign, said, sine};

fn settings(rig: &str, arguments: &[&str]) -> std::process::Output {
    let output = damprig().arg("settings").args(arguments).args(["--rig", rig]).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", said(&output));
    output
}

#[test]
fn a_saved_setting_is_read_back_after_power_off() {
    let Some(first) = image() else { return };
    let board = Served::new(first, Config::new(bare()), |_| {});
    let shown = said(&settings(&board.rig, &["show"]));
    assert!(shown.contains("as delivered"), "{shown}");
    settings(&board.rig, &["set", "spring.step_m=4e-6", "--save"]);
    let outcome = board.off();
    let again = Served::new(image().unwrap(), Config { bank2: outcome.bank2, ..Config::new(bare()) }, |_| {});
    let shown = said(&settings(&again.rig, &["show"]));
    assert!(shown.contains("(stored)") && shown.contains("step_m = 4e-6"), "{shown}");
    assert_eq!((again.off().bytes_lost, outcome.bytes_lost), (0, 0));
}

/// A second bank whose settings pages begin with this.
fn bank2_with(record: &[u8]) -> Bank2 {
    let mut bank2 = Bank2::default();
    bank2.bytes[..record.len()].copy_from_slice(record);
    bank2
}

/// A second bank whose settings pages hold arbitrary bytes.
fn garbage() -> Bank2 {
    bank2_with(&(0..4096_usize).map(|n| (n * n / 7) as u8).collect::<Vec<u8>>())
}

#[test]
fn a_drive_on_damaged_settings_is_refused_by_the_command_and_by_the_image() {
    let Some(first) = image() else { return };
    let folder = tempfile::TempDir::new().unwrap();
    let campaign = std::fs::read_to_string(project().join("host/campaigns/short.toml")).unwrap();
    let board = Served::new(first, Config { bank2: garbage(), ..Config::new(bare()) }, |_| {});
    let refused = run_campaign(&campaign, &board.rig, &folder.path().join("out"));
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
    let told = said(&refused);
    assert!(told.contains("the stored settings are damaged") && told.contains("--accept-settings"), "{told}");
    let is_closed = |(_, output): &(Time, Output)| *output == Output::Relay(true);
    assert!(!board.off().trace.iter().any(is_closed), "the relay closed");
    // A host that does not ask for consent.
    let mut board = Board::new(image().unwrap(), &Config { bank2: garbage(), ..Config::new(bare()) }).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    host.ask(Request::Configure(sine(1e-3, 2.5)));
    let refused = host.try_ask(Request::Start).unwrap_err();
    assert!(refused.to_string().contains("the saved settings do not act"), "{refused}");
    host.ask(Request::AcceptSettings);
    host.ask(Request::Start);
    host.pass(Time::from_ms(500));
    assert!(is_driving(&board));
}

#[test]
fn settings_of_a_firmware_with_the_last_layout_act_and_are_read_as_they_lie_there() {
    let Some(first) = image() else { return };
    let text = include_str!("../../../../shared/device/tests/integration/layouts/last.hex").trim();
    let record: Vec<u8> =
        (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap()).collect();
    let board = Served::new(first, Config { bank2: bank2_with(&record), ..Config::new(bare()) }, |_| {});
    let shown = said(&settings(&board.rig, &["show"]));
    assert!(shown.contains("stored by a firmware with the layout before"), "{shown}");
    assert!(shown.contains("structure_m = 0.02") && shown.contains("zero_counts = 32700.5"), "{shown}");
    let folder = tempfile::TempDir::new().unwrap();
    let file = folder.path().join("kept.toml");
    let kept = |extra: &[&str]| settings(&board.rig, &[&["backup", file.to_str().unwrap()][..], extra].concat());
    kept(&[]);
    assert!(std::fs::read_to_string(&file).unwrap().contains(text));
    // A save puts it into this layout; the bytes that the board tells are those of after the save.
    settings(&board.rig, &["restore", file.to_str().unwrap()]);
    assert!(said(&settings(&board.rig, &["show"])).contains("(stored)"));
    let told = said(&kept(&["--force"]));
    assert!(told.contains(": stored\n") && !told.contains("the layout before"), "{told}");
    board.off();
}

/// Tells a board with this second bank, and a supply that fails as given by `cut`, to save settings. Returns the
/// resulting bank and the number of flash operations.
fn save(bank2: &Bank2, wall_force_n: f32, cut: Option<(u64, Cut)>) -> Option<(Bank2, u64)> {
    let mut board = Board::new(image()?, &Config { bank2: bank2.clone(), cut, ..Config::new(bare()) }).unwrap();
    let mut host = Host::new(&mut board);
    let mut settings = Settings::default();
    settings.safety.wall_force_n = wall_force_n;
    host.ask(Request::SetSettings(settings));
    host.send(Request::SaveSettings);
    host.pass(Time::from_ms(60));
    Some((board.chip().bank2().clone(), board.chip().flash_operations()))
}

/// The wall force limit that a board with this second bank reports, and its source.
fn read(bank2: &Bank2) -> (f32, Source) {
    let mut board = Board::new(image().unwrap(), &Config { bank2: bank2.clone(), ..Config::new(bare()) }).unwrap();
    match Host::new(&mut board).ask(Request::Settings) {
        Reply::Settings { settings, source } => (settings.safety.wall_force_n, source),
        other => panic!("{other:?}"),
    }
}

/// Covers the driver's own sequence of operations, and a damaged word that raises the non-maskable interrupt when read.
#[test]
fn power_loss_at_any_operation_of_a_save_leaves_the_old_settings_or_the_new() {
    let Some((old, _)) = save(&Bank2::default(), 300.0, None) else { return };
    assert_eq!(read(&old), (300.0, Source::Stored));
    let (new, operations) = save(&old, 200.0, None).unwrap();
    assert_eq!(read(&new), (200.0, Source::Stored));
    assert!(operations > 20, "{operations}");
    let (mut old_read, mut new_read) = (0, 0);
    let all = [Cut::Half, Cut::Before, Cut::After];
    let cuts = if std::env::var_os("DAMPRIG_FULL").is_some() { &all[..] } else { &all[..1] };
    for operation in 0..operations {
        for &cut in cuts {
            let (left, _) = save(&old, 200.0, Some((operation, cut))).unwrap();
            let (wall_force_n, source) = read(&left);
            assert!(wall_force_n == 300.0 || wall_force_n == 200.0, "operation {operation}, {cut:?}: {wall_force_n}");
            // What an interrupted save has left is told: the rig does not drive on it without consent.
            let is_told = source == Source::Stored || source == Source::Older && wall_force_n == 300.0;
            assert!(is_told, "operation {operation}, {cut:?}: {source:?}");
            old_read += u32::from(wall_force_n == 300.0);
            new_read += u32::from(wall_force_n == 200.0);
        }
    }
    // Only the last operation completes the new record.
    assert!(old_read > 0 && (new_read > 0 || cuts.len() == 1), "{old_read} {new_read}");
}

/// A worn cell of the flash reads as 0 whatever is programmed, and no error tells.
#[test]
fn a_flash_that_reads_other_bytes_than_were_written_is_reported_and_the_old_settings_stay() {
    let Some((old, _)) = save(&Bank2::default(), 300.0, None) else { return };
    // The next save goes to the page without a record. Every fortieth byte of the record that is not 0 anyway.
    let is_blank = |page: usize| old.bytes[page..page + 2_048].iter().all(|byte| *byte == 0xff);
    let (page, written) = if is_blank(0) { (0, 2_048) } else { (2_048, 0) };
    let matters = (0..280).filter(|at| old.bytes[written + at] != 0);
    let (mut tried, mut refused) = (0, 0);
    for at in matters.step_by(40).map(|at| (page + at) as u32) {
        tried += 1;
        let mut board = Board::new(image().unwrap(), &Config { bank2: old.clone(), ..Config::new(bare()) }).unwrap();
        board.chip_mut().stick_flash(at, 0xff);
        let mut host = Host::new(&mut board);
        let Reply::Settings { mut settings, .. } = host.ask(Request::Settings) else { panic!("no settings") };
        settings.safety.wall_force_n = 200.0;
        host.ask(Request::SetSettings(settings));
        let saved = host.try_ask(Request::SaveSettings);
        let Reply::Settings { source, .. } = host.ask(Request::Settings) else { panic!("no settings") };
        let (wall_force_n, after) = read_stuck(board.chip().bank2(), at);
        match saved {
            Ok(_) => assert_eq!((wall_force_n, source, after), (200.0, Source::Stored, Source::Stored), "byte {at}"),
            Err(why) => {
                refused += 1;
                assert!(why.to_string().contains("did not take"), "{why}");
                // The stuck byte makes the page without a record a damaged one, before the save and after it.
                assert_eq!((wall_force_n, source, after), (300.0, Source::Older, Source::Older), "byte {at}");
            }
        }
    }
    // The number and the changed limit may have a 0 where the old record has none.
    assert!(tried >= 3 && refused >= tried - 1, "{refused} of {tried}");
}

/// As [`read`], from a flash with this byte stuck at 0.
fn read_stuck(bank2: &Bank2, at: u32) -> (f32, Source) {
    let mut board = Board::new(image().unwrap(), &Config { bank2: bank2.clone(), ..Config::new(bare()) }).unwrap();
    board.chip_mut().stick_flash(at, 0xff);
    match Host::new(&mut board).ask(Request::Settings) {
        Reply::Settings { settings, source } => (settings.safety.wall_force_n, source),
        other => panic!("{other:?}"),
    }
}
