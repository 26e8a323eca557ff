//! The boards: pins and peripherals only. Decisions are `damprig-core`'s, wiring is `main.rs`'s.

#[cfg(feature = "board-mps2-an386")]
pub mod mps2_an386;
#[cfg(feature = "board-nucleo-g474re")]
pub mod nucleo_g474re;
