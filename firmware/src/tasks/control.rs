//! The control task: waits for a tick and calls the body of the control loop.
//!
//! On the controller board it has the highest priority of all tasks and never waits for another one.

use damprig_core::settings::{Settings, Source};
use damprig_device::board::DeviceInfo;
use damprig_device::control_loop::{Step, step};
use damprig_device::controller::{BootInfo, Controller};
use damprig_device::upload_buffer::UploadBuffer;
use static_cell::ConstStaticCell;

use crate::boards::TaskBoard;
use crate::tasks::comms_heartbeat::{Heartbeat, HeartbeatWatch};
use crate::tasks::log;
use crate::tasks::queues::{Queues, RequestsOut};

/// The buffer of the uploaded record.
static UPLOAD_BUFFER: ConstStaticCell<UploadBuffer> = ConstStaticCell::new(UploadBuffer::new());

/// Runs the control loop. Owns the rig.
pub async fn run(
    mut board: impl TaskBoard,
    name: &'static str,
    boot: BootInfo,
    stored: &'static (Settings, Source),
    mut requests: RequestsOut,
) -> ! {
    if let Some(crash) = boot.last_crash {
        defmt::error!("last crash: {=str}, in tick {=u32}", crash.cause.text(), crash.tick);
    }
    let mut controller = Controller::new(info(name), boot);
    controller.start_with(&stored.0, stored.1);
    let upload = UPLOAD_BUFFER.take();
    let mut heartbeat = HeartbeatWatch::default();
    let mut log = log::LogWatch::default();
    let mut last = Step::Idle;
    board.start();
    loop {
        board.wait(last, controller.rig()).await;
        last = step(&mut controller, upload, &mut board, &mut requests, &mut Queues);
        log.note(&controller);
        board.end_step(controller.next_tick());
        match heartbeat.check() {
            Heartbeat::Alive => board.feed_watchdog(),
            Heartbeat::Stalls => board.communication_stalled(),
            Heartbeat::Stalled => {}
        }
    }
}

/// Description of this image for the host.
pub fn info(name: &'static str) -> DeviceInfo {
    DeviceInfo {
        revision: crate::identity::REVISION,
        profile: if cfg!(debug_assertions) { "dev" } else { "release" },
        ..DeviceInfo::new(env!("CARGO_PKG_VERSION"), name)
    }
}
