//! The control tick: a block of samples, one tick of the rig, the outputs, at most one order, the watchdog.
//!
//! Runs above every other task and never waits for one.

use damprig_core::settings::{Settings, Source};
use damprig_device::control::{Birth, Control, Name};
use damprig_device::store::Store;
use damprig_protocol::{CALLS_TOLD, CrashCause};
use static_cell::ConstStaticCell;

use crate::board::nucleo_g474re::{self, Bench};
use crate::crash;
use crate::tasks::alive;
use crate::tasks::lanes::{BAD_FRAMES, OrdersOut, Outgoing, REQUESTS_DROPPED, ROWS, counted};
use crate::tasks::settings::Structure;

/// The record buffer.
static RECORD_STORE: ConstStaticCell<Store> = ConstStaticCell::new(Store::new());

/// Owns the rig.
#[embassy_executor::task]
pub async fn run(mut bench: Bench, birth: Birth, kept: &'static (Settings, Source), mut orders: OrdersOut) -> ! {
    let name = Name {
        revision: option_env!("DAMPRIG_REVISION").unwrap_or_default(),
        profile: if cfg!(debug_assertions) { "dev" } else { "release" },
        ..Name::new(env!("CARGO_PKG_VERSION"), nucleo_g474re::NAME)
    };
    let mut control = Control::new(name, birth);
    control.start_with(&kept.0, kept.1);
    let store = RECORD_STORE.take();
    let mut line = alive::Watch::default();
    bench.start();
    loop {
        let sensors = bench.next_block(&control.settings().calibration).await;
        control.end_saving(&mut Structure, &mut Outgoing);
        let actuators = control.tick(&sensors, store, &mut Outgoing);
        bench.set(&actuators, &control.settings().calibration.drive);
        if let Some(order) = orders.try_receive() {
            control.note(counted(&BAD_FRAMES), counted(&REQUESTS_DROPPED));
            control.note_timing(bench.timing());
            let starts = order.is_start();
            control.serve(order, &mut Structure, store, &mut Outgoing);
            orders.receive_done();
            if starts && control.next_tick() == 0 {
                // Rows of the old count of ticks would follow the reply.
                ROWS.clear();
            }
        }
        bench.end_tick();
        crash::note_tick(control.next_tick());
        // A tick that does not come here, and a line whose tasks do not run, let the watchdog bite.
        if line.is_alive() {
            bench.feed_watchdog();
        } else if line.has_just_died() {
            crash::note(CrashCause::CommunicationStalled, [0; CALLS_TOLD]);
        }
    }
}
