//! The settings task: saves the settings in flash when control requests it, at the priority of the line's tasks.
//! These wait for the save, 25 ms; the ticks do not.

use core::sync::atomic::{AtomicBool, Ordering};

use damprig_core::rig::Rejected;
use damprig_core::settings::Settings;
use damprig_device::board::Saving;
use damprig_device::settings_store::SettingsStore;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embedded_storage::nor_flash::NorFlash;

static TO_SAVE: Signal<CriticalSectionRawMutex, Settings> = Signal::new();
static SAVED: Signal<CriticalSectionRawMutex, bool> = Signal::new();
static HAS_STORE: AtomicBool = AtomicBool::new(false);
static IS_SAVING: AtomicBool = AtomicBool::new(false);

/// Runs the settings task. Owns the flash.
pub async fn run(mut store: SettingsStore<impl NorFlash>) -> ! {
    HAS_STORE.store(true, Ordering::Relaxed);
    loop {
        let settings = TO_SAVE.wait().await;
        SAVED.signal(store.save(&settings).is_ok());
    }
}

/// Begins a save.
///
/// # Errors
/// There is no settings memory.
pub fn save(settings: &Settings) -> Result<Saving, Rejected> {
    if !HAS_STORE.load(Ordering::Relaxed) {
        return Err(Rejected::not_here("the flash is one bank: set the option byte DBANK"));
    }
    IS_SAVING.store(true, Ordering::Relaxed);
    TO_SAVE.signal(*settings);
    Ok(Saving::Begun)
}

/// Returns once how a save has ended.
pub fn saved() -> Option<Result<(), Rejected>> {
    let is_saved = SAVED.try_take()?;
    IS_SAVING.store(false, Ordering::Relaxed);
    Some(is_saved.then_some(()).ok_or(Rejected::not_here("the flash did not take the settings")))
}

/// Whether a save has begun whose result has not been taken.
#[cfg(feature = "board-mps2-an386")]
pub fn is_saving() -> bool {
    IS_SAVING.load(Ordering::Relaxed)
}
