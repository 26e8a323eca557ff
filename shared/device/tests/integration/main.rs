//! Tests of the device side of the link: settings in flash, the requests that set and save them, and the queues.

mod layouts;
mod queues;
mod settings;
mod settings_requests;
mod support;
mod wrong_data;
