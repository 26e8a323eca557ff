//! The settings task: saves the settings in flash when control requests it, at the priority of the line's tasks.
//! These wait for the save, 25 ms; the ticks do not.

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};

use damprig_core::rig::Rejected;
use damprig_core::settings::Settings;
use damprig_device::board::Saving;
use damprig_device::settings_store::{Records, SettingsStore};
use damprig_protocol::StoredPart;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embedded_storage::nor_flash::NorFlash;

static TO_SAVE: Signal<CriticalSectionRawMutex, Settings> = Signal::new();
static SAVED: Signal<CriticalSectionRawMutex, bool> = Signal::new();
static HAS_STORE: AtomicBool = AtomicBool::new(false);
static IS_SAVING: AtomicBool = AtomicBool::new(false);

/// The bytes of the pages: control never reads the flash, which stands still while a page is erased.
static RECORDS: Mutex<CriticalSectionRawMutex, RefCell<Records>> = Mutex::new(RefCell::new(Records::UNREAD));

/// Takes the bytes of the pages, for a host that asks for them.
fn keep_records(store: &mut SettingsStore<impl NorFlash>) {
    let mut records = Records::UNREAD;
    store.copy(&mut records);
    RECORDS.lock(|place| place.replace(records));
}

/// Bytes of a page of the settings memory.
pub fn stored(page: u8, from: u16) -> StoredPart {
    if !HAS_STORE.load(Ordering::Relaxed) {
        return StoredPart::NONE;
    }
    RECORDS.lock(|records| records.borrow().part(page, from))
}

/// Runs the settings task. Owns the flash.
pub async fn run(mut store: SettingsStore<impl NorFlash>) -> ! {
    keep_records(&mut store);
    HAS_STORE.store(true, Ordering::Relaxed);
    loop {
        let settings = TO_SAVE.wait().await;
        let is_saved = store.save(&settings).is_ok();
        keep_records(&mut store);
        SAVED.signal(is_saved);
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
