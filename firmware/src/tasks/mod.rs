//! The async tasks, one per file, generic over the board. Decisions are in the shared device code, pins and
//! peripherals in the boards.

#[cfg(not(feature = "board-mps2-an385"))]
pub mod comms_heartbeat;
#[cfg(not(feature = "board-mps2-an385"))]
pub mod control;
#[cfg(feature = "count-instructions")]
pub mod count;
#[cfg(feature = "board-mps2-an385")]
pub mod fixed_point;
#[cfg(not(feature = "board-mps2-an385"))]
pub mod log;
#[cfg(not(feature = "board-mps2-an385"))]
pub mod queues;
#[cfg(not(feature = "board-mps2-an385"))]
pub mod receive;
#[cfg(not(feature = "board-mps2-an385"))]
pub mod settings;
#[cfg(not(feature = "board-mps2-an385"))]
pub mod transmit;

/// Lets every ready task run. The executor polls the ready tasks in batches, the most recently woken first, so after
/// one turn of this task the others may still wait.
#[cfg(not(feature = "board-mps2-an385"))]
pub async fn let_others_run() {
    embassy_futures::yield_now().await;
    embassy_futures::yield_now().await;
}
