//! Saves the settings when control asks, at the line's priority: the line stands still for the 25 ms, the tick does not. What
//! finds no room meanwhile is counted.

use core::sync::atomic::{AtomicBool, Ordering};

use damprig_core::rig::Refusal;
use damprig_core::settings::Settings;
use damprig_device::control::{Bench, RealPlant, Saving};
use damprig_protocol::ask::PassedOver;
use damprig_protocol::{Clock, PlantKind};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

use crate::board::nucleo_g474re::settings::BoardKeeper;

static TO_SAVE: Signal<CriticalSectionRawMutex, Settings> = Signal::new();
static SAVED: Signal<CriticalSectionRawMutex, bool> = Signal::new();
static CAN_SAVE: AtomicBool = AtomicBool::new(false);

/// Owns the flash.
#[embassy_executor::task]
pub async fn run(mut keeper: BoardKeeper) -> ! {
    CAN_SAVE.store(true, Ordering::Relaxed);
    loop {
        let settings = TO_SAVE.wait().await;
        SAVED.signal(keeper.save(&settings).is_ok());
    }
}

/// Control's side: a real structure, and a flash.
pub struct Structure;

impl Bench<PassedOver> for Structure {
    const PLANT: PlantKind = <RealPlant as Bench>::PLANT;
    const CLOCK: Clock = <RealPlant as Bench>::CLOCK;

    fn set_plant(&mut self, config: &PassedOver) -> Result<(), Refusal> {
        RealPlant.set_plant(config)
    }

    fn restart(&mut self) -> Result<(), Refusal> {
        Bench::<PassedOver>::restart(&mut RealPlant)
    }

    fn save(&mut self, settings: &Settings) -> Result<Saving, Refusal> {
        if !CAN_SAVE.load(Ordering::Relaxed) {
            return Err(Refusal::NotHere("the flash is one bank: set the option byte DBANK"));
        }
        TO_SAVE.signal(*settings);
        Ok(Saving::Begun)
    }

    fn saved(&mut self) -> Option<Result<(), Refusal>> {
        let is_saved = SAVED.try_take()?;
        Some(is_saved.then_some(()).ok_or(Refusal::NotHere("the flash did not take the settings")))
    }
}
