//! The two flash pages of the settings, in bank 2. The program is in bank 1.
//!
//! Erasing a page takes 22 ms, 24.5 ms at most (data sheet). Only the task that erases waits for it, with interrupts
//! enabled, and any access to bank 2.

use core::ops::Range;

use damprig_core::settings::{Settings, Source};
use damprig_device::settings_store::SettingsStore;
use embassy_stm32::flash::{Blocking, Flash};
use embassy_stm32::{Peri, pac, peripherals};
use static_cell::StaticCell;

/// The flash that stores the settings.
pub type SettingsFlash = Flash<'static, Blocking>;

/// Range of the settings, bytes from the start of the flash, from `memory.x`.
fn place() -> Range<u32> {
    unsafe extern "C" {
        static __settings_begin: u8;
        static __settings_end: u8;
    }
    (&raw const __settings_begin).addr() as u32..(&raw const __settings_end).addr() as u32
}

/// Opens the flash and reads the settings. Returns no store on a chip whose option byte DBANK selects a single bank:
/// an erase would stop the program, and the driver does not support it. Whatever was saved cannot be read then.
pub fn open(
    flash: Peri<'static, peripherals::FLASH>,
) -> (Option<SettingsStore<SettingsFlash>>, &'static (Settings, Source)) {
    let has_banks = pac::FLASH.optr().read().dbank();
    let mut store = has_banks.then(|| SettingsStore::new(Flash::new_blocking(flash), place())).flatten();
    static STORED: StaticCell<(Settings, Source)> = StaticCell::new();
    let stored =
        STORED.init_with(|| store.as_mut().map_or((Settings::default(), Source::Damaged), SettingsStore::load));
    (store, stored)
}

/// Whether the non-maskable interrupt was caused by reading a damaged word of bank 2, and clears its flag. An
/// interrupted programming operation can leave a word that the ECC cannot correct. Such a word reads as arbitrary
/// bytes, which the checksum of the settings detects.
pub fn was_misread() -> bool {
    let errors = pac::FLASH.eccr().read();
    let is_ours = errors.eccd() && errors.bk_ecc();
    if is_ours {
        // A flag is cleared by writing 1.
        pac::FLASH.eccr().write_value(errors);
    }
    is_ours
}
