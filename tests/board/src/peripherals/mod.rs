//! Register models of the chip's peripherals, one file each, with the register names of the reference manual (RM0440).
//!
//! Each model contains its own registers, reset values and write rules. Every access passes the time and the clocks.
//! [`crate::chip`] models the connections between peripherals (a timer that triggers a converter whose samples a DMA
//! channel stores).

pub mod adc;
pub mod dac;
pub mod dbgmcu;
pub mod dma;
pub mod dwt;
pub mod exti;
pub mod flash;
pub mod gpio;
pub mod iwdg;
pub mod lpuart;
pub mod nvic;
pub mod pwr;
pub mod rcc;
pub mod scb;
pub mod tim;
