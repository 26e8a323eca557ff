//! The body of the control loop, the same on every board and in the virtual rig: one tick of the rig, then one request.
//!
//! On a simulated board a host can address requests to a tick; those are served at that tick in any number.
//!
//! The firmware's control task and the virtual rig call [`step`]. They differ in what they wait for between two steps
//! and in where the queues are stored.

use damprig_protocol::Clock;

use crate::board::Board;
use crate::controller::Controller;
use crate::queues::{Outgoing, Requests};
use crate::upload_buffer::UploadBuffer;

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A tick of the rig, and a request if one waited.
    Ticked,
    /// A request; the clock is stopped.
    Served,
    /// Nothing: the clock is stopped and no request waits.
    Idle,
}

/// Runs one step of the loop: samples, tick, outputs, events and telemetry, then requests.
pub fn step(
    controller: &mut Controller,
    upload: &mut UploadBuffer,
    board: &mut impl Board,
    requests: &mut impl Requests,
    outgoing: &mut impl Outgoing,
) -> Step {
    let mut served = serve_due(controller, upload, board, outgoing);
    controller.end_saving(board, outgoing);
    let samples = board.samples(controller.rig());
    if let Some(sensors) = &samples {
        if board.clock() == Clock::Granted {
            // A granted tick shows that the host is connected.
            controller.hear_host();
        }
        let actuators = controller.tick(sensors, upload, outgoing);
        board.set(&actuators, controller.rig());
    }
    controller.note_losses(requests.losses());
    controller.note_timing(board.timing());
    // Serve one request. Requests with a tick that follow it are served too: they need wait for their tick only.
    let mut first = true;
    while let Some(request) = requests.front().filter(|request| first || request.at_tick.is_some()) {
        controller.serve(request, board, upload, outgoing);
        requests.drop_front();
        (first, served) = (false, true);
    }
    match (samples.is_some(), served) {
        (true, _) => Step::Ticked,
        (false, true) => Step::Served,
        (false, false) => Step::Idle,
    }
}

/// Serves the request that was kept for the next tick.
fn serve_due(
    controller: &mut Controller,
    upload: &mut UploadBuffer,
    board: &mut impl Board,
    outgoing: &mut impl Outgoing,
) -> bool {
    let due = board.due(controller.next_tick());
    if let Some(request) = &due {
        controller.serve(request, board, upload, outgoing);
    }
    due.is_some()
}
