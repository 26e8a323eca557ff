//! The tasks, one a file, generic over the board: the shared device code decides, the board touches pins and peripherals.

#[cfg(not(feature = "board-mps2-an385"))]
pub mod comms_heartbeat;
#[cfg(not(feature = "board-mps2-an385"))]
pub mod control;
#[cfg(feature = "count-instructions")]
pub mod count;
#[cfg(feature = "board-mps2-an385")]
pub mod fixed_point;
#[cfg(not(feature = "board-mps2-an385"))]
pub mod queues;
#[cfg(not(feature = "board-mps2-an385"))]
pub mod receive;
#[cfg(not(feature = "board-mps2-an385"))]
pub mod settings;
#[cfg(not(feature = "board-mps2-an385"))]
pub mod transmit;

/// Lets every task run that is ready to. The executor polls the ready tasks in batches, the one that became ready last first,
/// so after one turn of this task the others may still wait.
#[cfg(not(feature = "board-mps2-an385"))]
pub async fn let_others_run() {
    embassy_futures::yield_now().await;
    embassy_futures::yield_now().await;
}
