//! The host's end of the link to a rig: bytes ([`link`]), requests and reports ([`session`]), uploads, and finding boards
//! ([`devices`]).

pub mod backup;
pub mod board_check;
pub mod controller;
pub mod devices;
pub mod link;
pub mod session;
mod upload;
