//! Tests of the device side of the link: settings in flash, and the requests that set and save them.

mod settings;
mod settings_requests;
mod support;
