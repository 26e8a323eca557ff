//! What the tests share.

pub mod host;
