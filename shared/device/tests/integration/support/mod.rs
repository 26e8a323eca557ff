//! What the tests share.

pub mod flash;
pub mod host;
