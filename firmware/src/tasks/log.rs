//! Log lines of what changes: state of the rig, faults, spring, link, losses. `damprig log` shows them.
//!
//! Control only compares a few values per step and hands over a change; this task writes the lines, at the priority of the line's
//! tasks, into a ring that is overwritten when nobody reads it. Nothing waits. A change that is followed by another before its line
//! is written is left out; losses and the link are looked at once per second.

use core::sync::atomic::{AtomicBool, Ordering};

use damprig_core::control::fault::Fault;
use damprig_core::control::friction_spring::SpringStage;
use damprig_core::rig::RigState;
use damprig_device::controller::Controller;
use damprig_protocol::Counters;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

/// Steps between two looks at the link and the losses: 1 s.
const LOOK_STEPS: u32 = 1_000;

/// Looks without a message of the host after which the link counts as down.
const MAX_SILENT: u32 = 10;

/// A message came from the host.
pub static HEARD: AtomicBool = AtomicBool::new(false);

static CHANGED: Signal<CriticalSectionRawMutex, Seen> = Signal::new();

/// What the log tells.
#[derive(Clone, Copy, PartialEq)]
struct Seen {
    state: RigState,
    spring: SpringStage,
    fault: Option<Fault>,
    is_linked: bool,
    /// Bad frames, requests, replies and rows that were lost.
    lost: [u32; 4],
}

const AT_START: Seen =
    Seen { state: RigState::Idle, spring: SpringStage::Unhomed, fault: None, is_linked: false, lost: [0; 4] };

/// Control's side of the log.
pub struct LogWatch {
    seen: Seen,
    /// Index of the spring's stage, as the rig's signal has it.
    spring_signal: f32,
    steps: u32,
    silent: u32,
}

impl Default for LogWatch {
    fn default() -> Self {
        Self { seen: AT_START, spring_signal: 0.0, steps: 0, silent: MAX_SILENT }
    }
}

impl LogWatch {
    /// Looks for changes; call once per step.
    pub fn note(&mut self, controller: &Controller) {
        let rig = controller.rig();
        let (state, spring_signal) = (rig.state(), rig.signals().spring_stage);
        self.steps += 1;
        let looks = self.steps >= LOOK_STEPS;
        if state == self.seen.state && spring_signal == self.spring_signal && !looks {
            return;
        }
        self.spring_signal = spring_signal;
        let status = rig.status();
        let mut seen = Seen { state, spring: status.spring.stage, fault: status.fault, ..self.seen };
        if looks {
            self.steps = 0;
            self.silent = if HEARD.swap(false, Ordering::Relaxed) { 0 } else { self.silent.saturating_add(1) };
            seen.is_linked = self.silent < MAX_SILENT;
            let Counters { bad_frames, requests_dropped, replies_dropped, rows_dropped, .. } = controller.counters();
            seen.lost = [bad_frames, requests_dropped, replies_dropped, rows_dropped];
        }
        if seen != self.seen {
            self.seen = seen;
            CHANGED.signal(seen);
        }
    }
}

/// Writes the lines.
pub async fn run() -> ! {
    let mut told = AT_START;
    loop {
        let seen = CHANGED.wait().await;
        if seen.is_linked != told.is_linked {
            if seen.is_linked {
                defmt::info!("link: the host sends");
            } else {
                defmt::warn!("link: no message for {=u32} s", MAX_SILENT);
            }
        }
        if seen.state != told.state {
            defmt::info!("state: {=str}", seen.state.text());
        }
        if seen.fault != told.fault {
            match seen.fault {
                Some(Fault { cause, tick, value, limit }) => {
                    defmt::error!(
                        "fault in tick {=u32}: {=str}: {=f32}, limit {=f32}",
                        tick,
                        cause.text(),
                        value,
                        limit
                    );
                }
                None => defmt::info!("fault cleared"),
            }
        }
        if seen.spring != told.spring {
            defmt::info!("spring: {=str}", seen.spring.text());
        }
        if seen.lost != told.lost {
            let [frames, requests, replies, rows] = seen.lost;
            defmt::warn!(
                "lost since the start: {=u32} frames, {=u32} requests, {=u32} replies, {=u32} rows",
                frames,
                requests,
                replies,
                rows
            );
        }
        told = seen;
    }
}
