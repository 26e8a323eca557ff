//! Tests of the device side of the link, through the messages that a host sends.

mod dampers;
mod drive;
mod emergency_stop;
mod limits;
mod sensors;
mod settings;
mod settings_orders;
mod simulated;
mod support;
mod uploads;
