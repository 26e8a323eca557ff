//! Shared code of the tests: the built images, the emulator and the `damprig` command.

pub mod command;
pub mod emulator;
pub mod images;
