//! Records as boards hold them, byte by byte: of the layout of today, and of the one before.
//!
//! **When the first test here fails, the layout of the settings has changed**, and boards hold records that this firmware
//! does not read any more. Then, in `shared/device/src/settings_record.rs`, `last::Settings` becomes the type of before the
//! change (copies of every type in it that has changed), its conversion fills in the new values, and `layouts/present.hex`
//! becomes `layouts/last.hex` and a new one is recorded. Never record it anew without that.

use crate::support::flash::{Flash, SIZE};
use damprig_core::settings::{Settings, Source};
use damprig_device::settings_record::{LAST_LAYOUT, LAYOUT, SettingsRecord};
use damprig_device::settings_store::SettingsStore;

/// The settings in both records. Those of the last layout have no calibration records.
fn recorded() -> Settings {
    let mut settings = Settings::default();
    settings.calibration.x.zero_counts = 32_700.5;
    settings.calibration.x.metres_per_count = 2.5e-6;
    settings.safety.limits.structure_m = 0.02;
    settings.spring.step_m = 4e-6;
    settings.impacts.threshold_n = 3.0;
    settings.calibrated.x.date_days = 20_574.0;
    settings.calibrated.walls.residual_n_s = 1e-3;
    settings
}

/// Written by the firmware of this layout.
const PRESENT: &str = include_str!("layouts/present.hex");

/// Written by the firmware of the layout before, without calibration records.
const LAST: &str = include_str!("layouts/last.hex");

fn bytes(hexadecimal: &str) -> Vec<u8> {
    let digits: Vec<u32> = hexadecimal.chars().filter_map(|c| c.to_digit(16)).collect();
    digits.chunks_exact(2).map(|pair| (pair[0] << 4 | pair[1]) as u8).collect()
}

/// A flash with this record in its first page.
fn flash_with(record: &str) -> Flash {
    let mut flash = Flash::default();
    let record = bytes(record);
    flash.bytes[..record.len()].copy_from_slice(&record);
    flash
}

fn store(flash: &mut Flash) -> SettingsStore<&mut Flash> {
    SettingsStore::new(flash, 0..SIZE as u32).unwrap()
}

const ADVICE: &str =
    "the layout of the settings has changed: add a migration before anything else; see the head of this file";

#[test]
fn a_board_of_this_layout_keeps_its_settings() {
    assert_eq!(LAYOUT[..], bytes(PRESENT)[..8], "{ADVICE}");
    let mut flash = flash_with(PRESENT);
    assert_eq!(store(&mut flash).load(), (recorded(), Source::Stored), "{ADVICE}");
    // A save writes the same bytes, but for the sequence number and the checksum.
    store(&mut flash).save(&recorded()).unwrap();
    let (old, new) = flash.bytes.split_at(SIZE / 2);
    let length = bytes(PRESENT).len();
    assert_eq!((&old[..8], &old[12..length - 4]), (&new[..8], &new[12..length - 4]), "{ADVICE}");
}

#[test]
fn a_record_of_the_last_layout_is_migrated_and_then_saved_in_this_one() {
    assert_eq!(LAST_LAYOUT[..], bytes(LAST)[..8], "the last layout is that of boards in the field: `last::Settings`");
    let migrated = Settings { calibrated: Default::default(), ..recorded() };
    let mut flash = flash_with(LAST);
    assert_eq!(store(&mut flash).load(), (migrated, Source::Migrated));
    let mut whole = [0xff; 320];
    whole[..bytes(LAST).len()].copy_from_slice(&bytes(LAST));
    assert_eq!(
        SettingsRecord::read(&whole),
        SettingsRecord::Settings { number: 0, settings: migrated, is_migrated: true }
    );
    store(&mut flash).save(&migrated).unwrap();
    assert_eq!(store(&mut flash).load(), (migrated, Source::Stored));
}

#[test]
fn a_damaged_record_of_the_last_layout_is_damaged() {
    let length = bytes(LAST).len();
    for bit in 0..8 * length {
        let mut flash = flash_with(LAST);
        flash.bytes[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(store(&mut flash).load(), (Settings::default(), Source::Damaged), "bit {bit}");
    }
}
