//! The boards: pins and peripherals only. Decisions are `damprig-core`'s, wiring is `main.rs`'s.

#[cfg(any(feature = "count-instructions", feature = "board-mps2-an385"))]
pub mod instructions;
#[cfg(feature = "board-mps2-an385")]
pub mod mps2_an385;
#[cfg(feature = "board-mps2-an386")]
pub mod mps2_an386;
#[cfg(feature = "board-nucleo-g474re")]
pub mod nucleo_g474re;
