//! One async task a file. What they decide is the shared device code's; what they touch is the board's.

#[cfg(feature = "board-nucleo-g474re")]
pub mod alive;
#[cfg(feature = "board-nucleo-g474re")]
pub mod control;
#[cfg(feature = "count-instructions")]
pub mod count;
#[cfg(feature = "board-mps2-an385")]
pub mod fixed_point;
#[cfg(feature = "board-mps2-an386")]
pub mod granted;
#[cfg(feature = "board-nucleo-g474re")]
pub mod lanes;
#[cfg(feature = "board-nucleo-g474re")]
pub mod receive;
#[cfg(feature = "board-nucleo-g474re")]
pub mod settings;
#[cfg(feature = "board-nucleo-g474re")]
pub mod transmit;
