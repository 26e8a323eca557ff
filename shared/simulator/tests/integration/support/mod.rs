//! Support for the tests.

pub mod host;
