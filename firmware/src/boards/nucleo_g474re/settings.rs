//! The two flash pages of the settings, in bank 2; the program is fetched from bank 1.
//!
//! Erasing a page takes 22 ms, 24.5 ms at most (data sheet). Only the task that erases waits for it, with interrupts enabled, and
//! whatever reads bank 2.

use core::ops::Range;

use damprig_core::settings::{Settings, Source};
use damprig_device::settings_store::SettingsStore;
use embassy_stm32::flash::{Blocking, Flash};
use embassy_stm32::{Peri, pac, peripherals};
use static_cell::StaticCell;

/// The flash that stores the settings.
pub type SettingsFlash = Flash<'static, Blocking>;

/// Bytes from the flash's start, as `memory.x` has them.
fn place() -> Range<u32> {
    unsafe extern "C" {
        static __settings_begin: u8;
        static __settings_end: u8;
    }
    (&raw const __settings_begin).addr() as u32..(&raw const __settings_end).addr() as u32
}

/// Opens the flash and reads the settings. No place on a chip whose option byte DBANK makes one bank of it: erasing would
/// stop the program, and the driver would not go on.
pub fn open(
    flash: Peri<'static, peripherals::FLASH>,
) -> (Option<SettingsStore<SettingsFlash>>, &'static (Settings, Source)) {
    let has_banks = pac::FLASH.optr().read().dbank();
    let mut store = has_banks.then(|| SettingsStore::new(Flash::new_blocking(flash), place())).flatten();
    static STORED: StaticCell<(Settings, Source)> = StaticCell::new();
    let stored = STORED.init_with(|| store.as_mut().map(SettingsStore::load).unwrap_or_default());
    (store, stored)
}

/// A word of bank 2 that an interrupted programming left beyond what the flash's error correction can mend was read: it reads
/// as anything, which the settings' checksum finds, and raises the non-maskable interrupt, which asks here.
pub fn was_misread() -> bool {
    let errors = pac::FLASH.eccr().read();
    let is_ours = errors.eccd() && errors.bk_ecc();
    if is_ours {
        // Writing a flag's 1 clears it.
        pac::FLASH.eccr().write_value(errors);
    }
    is_ours
}
