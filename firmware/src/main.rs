#![no_std]
#![no_main]
#![allow(missing_docs)]
use defmt_rtt as _;
use panic_probe as _;
use embassy_stm32 as _;
#[cortex_m_rt::entry]
fn main() -> ! { loop {} }
