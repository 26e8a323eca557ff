//! The control tick: a block of samples, at most one request, one tick of the rig, the outputs.
//!
//! Runs above every other task and never waits for one.

use damprig_device::control::{Control, Name, RealPlant};
use damprig_protocol::Ask;

use crate::board::nucleo_g474re::{self, Bench};
use crate::tasks::lanes::{BAD_FRAMES, Outgoing, REQUESTS, REQUESTS_DROPPED, ROWS, counted};

/// Owns the rig.
#[embassy_executor::task]
pub async fn run(mut bench: Bench) -> ! {
    let mut control = Control::new(Name { firmware: env!("CARGO_PKG_VERSION"), board: nucleo_g474re::NAME });
    bench.start();
    loop {
        let sensors = bench.next_block().await;
        if let Ok(request) = REQUESTS.try_receive() {
            control.note(counted(&BAD_FRAMES), counted(&REQUESTS_DROPPED));
            let starts = request.ask == Ask::Start;
            control.serve(request, &mut RealPlant, &mut Outgoing);
            if starts && control.next_tick() == 0 {
                // Rows of the old count of ticks would follow the reply.
                ROWS.clear();
            }
        }
        control.serve_scheduled(&mut RealPlant, &mut Outgoing);
        let actuators = control.tick(&sensors, &mut Outgoing);
        bench.set_drive(if actuators.drive_enabled { actuators.drive_m } else { 0.0 });
    }
}
