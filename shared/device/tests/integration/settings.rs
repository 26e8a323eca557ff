//! Power loss at any flash operation leaves the old settings or the new ones, never none and never a mixture.

use crate::support::flash::{Cut, Flash, PAGE, SIZE, WORD};
use damprig_core::settings::{Settings, Source};
use damprig_device::settings_record::encode;
use damprig_device::settings_store::{NotSaved, SettingsStore};

fn store(flash: &mut Flash) -> SettingsStore<&mut Flash> {
    SettingsStore::new(flash, 0..SIZE as u32).expect("two pages")
}

fn load(flash: &mut Flash) -> (Settings, Source) {
    store(flash).load()
}

fn save(flash: &mut Flash, settings: &Settings) -> Result<(), NotSaved> {
    store(flash).save(settings)
}

/// Settings that differ in several values from those of any other number.
fn numbered(number: u16) -> Settings {
    let mut settings = Settings::default();
    settings.calibration.drive.zero_counts += 0.1 * f32::from(number);
    settings.safety.wall_force_n = 100.0 + 0.1 * f32::from(number);
    settings.impacts.ringing = 0.5 - f32::from(number) * 1e-4;
    settings
}

/// Enough saves to have used both pages more than once.
const SAVINGS: u16 = 2;

/// The flash after so many saves.
fn after(savings: u16) -> Flash {
    let mut flash = Flash::default();
    for number in 1..=savings {
        save(&mut flash, &numbered(number)).unwrap();
    }
    flash
}

const CUTS: [Cut; 8] = [
    Cut::Before,
    Cut::Half,
    Cut::Mixed(1),
    Cut::Mixed(2),
    Cut::Mixed(3),
    Cut::Anything(1),
    Cut::Anything(2),
    Cut::After,
];

#[test]
fn the_last_saved_settings_are_read_after_any_number_of_saves() {
    let mut flash = Flash::default();
    assert_eq!(load(&mut flash), (Settings::default(), Source::Default));
    for number in 1..=4 * SAVINGS {
        save(&mut flash, &numbered(number)).unwrap();
        assert_eq!(load(&mut flash.restarted(None)), (numbered(number), Source::Stored));
    }
}

#[test]
fn power_loss_at_any_operation_and_again_in_the_next_save_leaves_the_old_settings_or_the_new() {
    let (mut tried, mut old_read) = (0, 0);
    for savings in 0..=SAVINGS {
        let before = after(savings);
        let old = if savings == 0 { Settings::default() } else { numbered(savings) };
        let (new, third) = (numbered(1000), numbered(2000));
        let mut whole = before.restarted(None);
        save(&mut whole, &new).unwrap();
        assert!(whole.operations > 20, "too few operations for a save: {}", whole.operations);
        for (n, cut) in (0..whole.operations).flat_map(|n| CUTS.map(|cut| (n, cut))) {
            let here = || format!("saving {savings}, operation {n}, {cut:?}");
            let mut flash = before.restarted(Some((n, cut)));
            assert_eq!(save(&mut flash, &new), Err(NotSaved), "{}", here());
            let (read, source) = load(&mut flash.restarted(None));
            assert!(read == old || read == new, "{}: neither", here());
            // Whatever is left of an interrupted save, the rig drives on no settings that were not saved, unless by consent.
            let expected = if read == new { Source::Stored } else { Source::Older };
            let is_whole = source == if read == old && savings == 0 { Source::Default } else { Source::Stored };
            assert!(
                is_whole || source == expected || savings == 0 && source == Source::Damaged,
                "{}: {source:?}",
                here()
            );
            tried += 1;
            old_read += usize::from(read == old);
            // Save again on what the first cut left, and cut the supply again.
            for (m, second) in (0..whole.operations).flat_map(|m| CUTS.map(|cut| (m, cut))) {
                let mut flash = flash.restarted(Some((m, second)));
                assert_eq!(save(&mut flash, &third), Err(NotSaved));
                let (again, _) = load(&mut flash.restarted(None));
                assert!(again == read || again == third, "{}, then {m}, {second:?}: neither", here());
                tried += 1;
            }
            let mut flash = flash.restarted(None);
            save(&mut flash, &third).unwrap_or_else(|NotSaved| panic!("{}: not saved any more", here()));
            assert_eq!(load(&mut flash), (third, Source::Stored), "{}", here());
        }
    }
    println!("{tried} cuts over {} savings: 0 corruptions, the old settings after {old_read} first cuts", SAVINGS + 1);
    assert!(old_read > 0 && old_read < tried);
}

#[test]
fn a_flash_that_cannot_be_written_is_reported_and_keeps_its_settings() {
    let mut flash = after(3).restarted(Some((0, Cut::Before)));
    assert_eq!(save(&mut flash, &numbered(9)), Err(NotSaved));
    assert_eq!(load(&mut flash.restarted(None)), (numbered(3), Source::Stored));
}

#[test]
fn a_flash_with_arbitrary_bytes_reads_as_damaged_and_can_be_saved_to() {
    let mut flash = Flash::default();
    for (n, byte) in flash.bytes.iter_mut().enumerate() {
        *byte = (n * n / 7) as u8;
    }
    assert_eq!(load(&mut flash), (Settings::default(), Source::Damaged));
    save(&mut flash, &numbered(5)).unwrap();
    assert_eq!(load(&mut flash), (numbered(5), Source::Stored));
}

#[test]
fn a_flipped_bit_anywhere_never_gives_other_settings() {
    let whole = after(1);
    for bit in 0..8 * 40 * WORD {
        let mut flash = whole.restarted(None);
        flash.bytes[bit / 8] ^= 1 << (bit % 8);
        let (read, source) = load(&mut flash);
        let as_expected = match source {
            Source::Stored => read == numbered(1),
            Source::Damaged => read == Settings::default(),
            _ => false,
        };
        assert!(as_expected, "bit {bit}: {source:?}");
    }
}

/// Changes the layout hash of the record in a page and corrects the checksum.
fn as_of_another_layout(flash: &mut Flash, page: usize) {
    let record = &mut flash.bytes[page * PAGE..];
    let length = 16 + u32::from_le_bytes(record[12..16].try_into().unwrap()) as usize;
    record[0] ^= 1;
    let checksum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&record[..length]);
    record[length..length + 4].copy_from_slice(&checksum.to_le_bytes());
}

#[test]
fn a_record_of_another_layout_is_a_source_of_its_own_until_settings_are_saved() {
    let mut flash = after(1);
    as_of_another_layout(&mut flash, 0);
    assert_eq!(load(&mut flash), (Settings::default(), Source::OtherLayout));
    save(&mut flash, &numbered(2)).unwrap();
    assert_eq!(load(&mut flash), (numbered(2), Source::Stored));
}

#[test]
fn a_damaged_record_beside_a_good_one_is_told() {
    for (page, left) in [(0, 2), (1, 1)] {
        let mut flash = after(2);
        flash.bytes[page * PAGE + 20] ^= 1;
        assert_eq!(load(&mut flash), (numbered(left), Source::Older), "page {page}");
        save(&mut flash, &numbered(3)).unwrap();
        assert_eq!(load(&mut flash), (numbered(3), Source::Stored), "page {page}");
    }
}

/// Another firmware saved settings, then the one of before came back.
#[test]
fn a_newer_record_of_another_layout_is_told_and_an_older_one_is_not() {
    for (page, expected) in [(0, (numbered(2), Source::Stored)), (1, (numbered(1), Source::Older))] {
        let mut flash = after(2);
        as_of_another_layout(&mut flash, page);
        assert_eq!(load(&mut flash), expected, "page {page}");
    }
}

#[test]
fn settings_out_of_range_are_rejected_even_in_a_valid_record() {
    let mut wrong = numbered(1);
    wrong.spring.step_m = -1.0;
    let mut flash = Flash::default();
    let record = encode(0, &wrong).unwrap();
    flash.bytes[..record.len()].copy_from_slice(&record);
    assert_eq!(load(&mut flash), (Settings::default(), Source::Damaged));
    assert_eq!(save(&mut flash, &wrong), Err(NotSaved));
}

#[test]
fn a_range_that_is_not_two_whole_pages_is_rejected() {
    for range in [0..PAGE as u32, 0..SIZE as u32 - 1, 8..SIZE as u32 + 8] {
        assert!(SettingsStore::new(&mut Flash::default(), range).is_none());
    }
}
