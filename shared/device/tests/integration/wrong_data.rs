//! A flash that gives wrong data without an error: a save that says ok is read back, and a failed one damages nothing.

use damprig_core::settings::{Settings, Source};
use damprig_device::settings_store::{NotSaved, SettingsStore};

use crate::support::flash::{Flash, PAGE, SIZE};

fn store(flash: &mut Flash) -> SettingsStore<&mut Flash> {
    SettingsStore::new(flash, 0..SIZE as u32).expect("two pages")
}

fn numbered(number: u16) -> Settings {
    let mut settings = Settings::default();
    settings.safety.wall_force_n = 100.0 + 0.1 * f32::from(number);
    settings
}

/// A flash that holds the settings 1 and 2, the older ones in its first page.
fn used() -> Flash {
    let mut flash = Flash::default();
    for number in 1..=2 {
        store(&mut flash).save(&numbered(number)).unwrap();
    }
    assert_eq!(flash.bytes[..PAGE].iter().position(|byte| *byte != 0xff), Some(0));
    flash
}

/// Saves settings 3 and checks the claim; returns whether the save succeeded. The flash keeps its defect while it is read. A
/// failed save leaves the settings before.
fn save_and_read(flash: &mut Flash, what: &str) -> bool {
    let saved = store(flash).save(&numbered(3));
    let read = store(flash).load();
    match saved {
        Ok(()) => assert_eq!(read, (numbered(3), Source::Stored), "{what}: saved and not read"),
        Err(NotSaved) => assert_eq!(read.0, numbered(2), "{what}: not saved, and not the settings before"),
    }
    saved.is_ok()
}

#[test]
fn a_bit_that_always_reads_the_same_makes_a_save_fail_or_does_not_matter() {
    let whole = used();
    let (mut saved, mut refused) = (0, 0);
    for at in 0..330 {
        for bit in 0..8 {
            for value in [0, 0xff] {
                let mut flash = whole.clone();
                flash.stuck = Some((at, 1 << bit, value));
                let is_saved = save_and_read(&mut flash, &format!("byte {at}, bit {bit} reads {value}"));
                saved += u32::from(is_saved);
                refused += u32::from(!is_saved);
            }
        }
    }
    println!("{saved} saved, {refused} refused");
    // Each bit of a record has one of the two values.
    assert!(refused > 1_000 && saved >= refused, "{saved} {refused}");
}

#[test]
fn an_operation_without_effect_makes_a_save_fail_or_does_not_matter() {
    let whole = used();
    let mut sound = whole.clone();
    sound.operations = 0;
    assert!(save_and_read(&mut sound, "a sound flash"));
    let mut refused = 0;
    for number in 0..sound.operations {
        let mut flash = whole.restarted(None);
        flash.ineffective = Some(number);
        // A record that the ineffective erase has left makes the flash refuse to program its words.
        refused += u32::from(!save_and_read(&mut flash, &format!("operation {number}")));
    }
    // The record's padding is erased already.
    assert!(refused > 20, "{refused} of {}", sound.operations);
}
