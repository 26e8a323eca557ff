//! Errors of a session, with their texts.

use crate::client::link::Unreachable;

/// Errors of a session.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The link could not be opened.
    #[error(transparent)]
    Unreachable(#[from] Unreachable),
    /// The link broke.
    #[error("the link to {link} broke: {error}")]
    Broken {
        /// Which.
        link: String,
        /// What the system says.
        error: std::io::Error,
    },
    /// Nothing arrived within the timeout.
    #[error("the device at {link} stopped answering: nothing for {seconds} s{hint}")]
    Silent {
        /// Which.
        link: String,
        /// The timeout.
        seconds: f64,
        /// What to check.
        hint: String,
    },
    /// The device has another protocol version or schema.
    #[error(
        "the device at {link} has another protocol: device version {device_version} (schema {device_schema}, firmware {firmware} on {board}), this program version {version} (schema {schema}, damprig {program}); flash the firmware of this program's version, or use the program of the firmware's version"
    )]
    Version {
        /// Which.
        link: String,
        /// The device's.
        device_version: u16,
        /// The device's.
        device_schema: String,
        /// The device's.
        firmware: String,
        /// The device's.
        board: String,
        /// Ours.
        version: u16,
        /// Ours.
        schema: String,
        /// Ours.
        program: &'static str,
    },
    /// A different device answers.
    #[error("a different device answers at {link}: it was {board}, it is {what}; the run was stopped")]
    Another {
        /// Which link.
        link: String,
        /// The board before.
        board: String,
        /// The device now.
        what: String,
    },
    /// The board's settings have changed since the run was started.
    #[error(
        "the board's settings have changed since the run was started:\n  {}\n  restore them (`damprig settings set`), or start a new run",
        differences.join("\n  ")
    )]
    Settings {
        /// One difference a line.
        differences: Vec<String>,
    },
    /// The device rejected a request.
    #[error("the device refused to {what}: {why}")]
    Refused {
        /// The request, in words.
        what: &'static str,
        /// The device's reason.
        why: String,
    },
    /// An upload failed.
    #[error("the record could not be uploaded: {why}")]
    Upload {
        /// Why.
        why: String,
    },
    /// The device sends what nobody asked for, without end.
    #[error(
        "the device at {link} sends more than it was asked for: {what}; it was disconnected. Is it the right device, and is its firmware intact?"
    )]
    Flood {
        /// Which.
        link: String,
        /// What it sent.
        what: String,
    },
    /// What the device says about itself cannot be used.
    #[error(
        "the device at {link} reports {what}: it cannot be used like this; flash its firmware again, or update this program"
    )]
    Unusable {
        /// Which.
        link: String,
        /// What it reported.
        what: String,
    },
    /// Ctrl-C.
    #[error("interrupted")]
    Interrupted,
    /// The reply is not one to the request.
    #[error("the device sent an unexpected reply when asked to {what}")]
    UnexpectedReply {
        /// The request, in words.
        what: &'static str,
    },
}
