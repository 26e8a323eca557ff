//! Support for the tests.

pub mod flash;
