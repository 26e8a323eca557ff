//! Tests of the whole system, one file for each capability, in one binary that links once.
//! `cargo test -p damprig-tests golden` runs one file.

mod budgets;
mod emulated_campaign;
mod emulator;
mod fixed_point;
mod golden;
mod hardware;
mod layout;
mod link;
mod log;
mod manual;
mod panics;
mod protocol_page;
mod recorded;
mod soak;
