//! What several tests share: the built images, the emulator and the command.

pub mod command;
pub mod emulator;
pub mod images;
