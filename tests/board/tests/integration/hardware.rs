//! Option bytes, analogue supply and brown-out of the board.

use damprig_board::peripherals::flash::OPTR_DELIVERED;
use damprig_board::{Board, Config, Time};
use damprig_core::settings::{Settings, Source};
use damprig_protocol::{CrashCause, Reply, Request, Reset};

use crate::common::{
    Host, Served, bare, damprig, description, driving, image, is_driving, opened, pass, project, said,
};

/// BOR_LEV = 4 and nSWBOOT0 = 0, the rest as delivered.
const OPTR_WANTED: u32 = OPTR_DELIVERED & !(7 << 8) & !(1 << 26) | 4 << 8;

const DBANK: u32 = 1 << 22;

/// The measurement's own error is one code of the internal reference, 1/1 654 at 3 V, in either measurement.
const SUPPLY_ERROR: f32 = 2.0 / 1_654.0 * 0.5 + 1e-4;

#[test]
fn the_board_tells_its_option_bytes_and_its_analogue_supply() {
    for (option_bytes, supply_v) in [(OPTR_DELIVERED, 3.3), (OPTR_WANTED, 3.2), (OPTR_WANTED & !DBANK, 3.4)] {
        let Some(image) = image() else { return };
        let config = Config { option_bytes, supply_v, ..Config::new(bare()) };
        let mut board = Board::new(image, &config).unwrap();
        let description = description(&mut board);
        assert_eq!(description.option_bytes, Some(option_bytes));
        let measured = description.supply_v.expect("the board measures its supply");
        println!("{supply_v} V is measured as {measured} V");
        assert!((measured / supply_v as f32 - 1.0).abs() < SUPPLY_ERROR, "{measured} V for {supply_v} V");
    }
}

#[test]
fn a_flash_of_one_bank_keeps_the_board_on_default_settings_and_saves_none() {
    let Some(image) = image() else { return };
    let config = Config { option_bytes: OPTR_DELIVERED & !DBANK, ..Config::new(bare()) };
    let mut board = Board::new(image, &config).unwrap();
    let mut host = Host::new(&mut board);
    let Reply::Settings { settings, source } = host.ask(Request::Settings) else { panic!("no settings") };
    // Whatever was saved cannot be read, so the board does not drive without consent.
    assert_eq!((settings, source), (Settings::default(), Source::Damaged));
    let refused = host.try_ask(Request::SaveSettings).unwrap_err();
    assert!(format!("{refused:?}").contains("DBANK"), "{refused:?}");
}

/// What `damprig run` prints to a board with these option bytes and this supply, for a campaign that the board then rejects
/// because of a limit.
fn notes(option_bytes: u32, supply_v: f64) -> Option<String> {
    let board = Served::new(image()?, Config { option_bytes, supply_v, ..Config::new(bare()) }, |_| {});
    let folder = tempfile::TempDir::new().unwrap();
    let campaign = folder.path().join("campaign.toml");
    let short = std::fs::read_to_string(project().join("host/campaigns/short.toml")).unwrap();
    std::fs::write(&campaign, short.replace("[rig]", "[rig]\nhost_silent_s = 60")).unwrap();
    let output = damprig().arg("run").arg(campaign).args(["--yes", "--rig", &board.rig]).output().unwrap();
    board.off();
    assert!(said(&output).contains("host_silent_s"), "{}", said(&output));
    Some(said(&output))
}

#[test]
fn wrong_option_bytes_and_a_wrong_supply_are_warnings_of_the_command() {
    let Some(delivered) = notes(OPTR_DELIVERED, 3.3) else { return };
    assert!(delivered.contains("option byte BOR_LEV is 0, wanted is 4"), "{delivered}");
    assert!(delivered.contains("option byte nSWBOOT0 is 1, wanted is 0"), "{delivered}");
    assert!(!delivered.contains("DBANK") && !delivered.contains("supply of the board's converters"), "{delivered}");
    let set = notes(OPTR_WANTED, 3.3).unwrap();
    assert!(!set.contains("option byte") && !set.contains("supply of the board's converters"), "{set}");
    let low = notes(OPTR_WANTED & !DBANK, 3.2).unwrap();
    assert!(low.contains("option byte DBANK is 0, wanted is 1"), "{low}");
    assert!(low.contains("3.20 V instead of 3.3 V") && low.contains("off by 3."), "{low}");
}

/// Lowers the supply of a rig that drives from 3.3 V to `to_v` in `steps` steps of `step_us`. Returns the board, and how long
/// after the supply passed 2.86 V the relay opened.
fn brown_out(option_bytes: u32, to_v: f64, steps: u32, step_us: u64) -> Option<(Board, Time)> {
    let mut board = driving(&Config { option_bytes, ..Config::new(bare()) })?;
    let mut passed = None;
    for n in 1..=steps {
        let volts = 3.3 + (to_v - 3.3) * f64::from(n) / f64::from(steps);
        board.chip_mut().set_supply(volts);
        if volts < 2.86 {
            passed.get_or_insert(board.now());
        }
        let next = board.now() + Time::from_us(step_us);
        crate::common::run(&mut board, next);
    }
    let opened = opened(&board, passed.unwrap());
    pass(&mut board, 100);
    assert!(!is_driving(&board) && board.chip_mut().take_sent().is_empty(), "the board is silent below its supply");
    Some((board, opened))
}

/// A slow ramp: 1.3 V in 500 ms; a fast one: 3.3 V in 100 µs.
#[test]
fn a_supply_that_falls_slowly_or_fast_opens_the_relay_at_every_brown_out_level() {
    for (option_bytes, told_low) in [(OPTR_DELIVERED, true), (OPTR_WANTED, false)] {
        for (to_v, steps, step_us) in [(2.0, 500, 1_000), (0.0, 100, 1)] {
            let Some((mut board, opened)) = brown_out(option_bytes, to_v, steps, step_us) else { return };
            println!(
                "to {to_v} V in {} µs: the relay opens {} µs after 2.86 V",
                u64::from(steps) * step_us,
                opened.us()
            );
            assert!(opened < Time::from_us(50), "{} us", opened.us());
            board.chip_mut().set_supply(3.3);
            pass(&mut board, 100);
            let description = description(&mut board);
            assert!(!is_driving(&board));
            // The brown-out reset, at 1.64 V or 2.8 V, forgets what the firmware has noted.
            let is_noted = told_low && to_v > 1.64;
            let crash = description.last_crash.map(|crash| crash.cause);
            assert_eq!(crash, is_noted.then_some(CrashCause::SupplyLow), "to {to_v} V");
            assert_eq!(description.reset, if is_noted { Reset::Software } else { Reset::Power }, "to {to_v} V");
        }
    }
}
