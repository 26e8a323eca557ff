//! What several tests share: the built images and the emulator.

pub mod emulator;
pub mod images;
