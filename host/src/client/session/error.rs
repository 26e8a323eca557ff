//! Errors of a session, with their texts.

use crate::client::link::Unreachable;
use crate::failure::Failure;

/// Errors of a session.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The link could not be opened.
    #[error(transparent)]
    Unreachable(#[from] Unreachable),
    /// The link broke.
    #[error("the link to {link} broke: {error}")]
    Broken {
        /// Name of the link.
        link: String,
        /// The system's error.
        error: std::io::Error,
    },
    /// Nothing arrived within the timeout.
    #[error("the device at {link} stopped answering: nothing for {seconds} s{hint}")]
    Silent {
        /// Name of the link.
        link: String,
        /// The timeout.
        seconds: f64,
        /// What to check, in words.
        hint: String,
    },
    /// The device has another protocol version or schema.
    #[error(
        "the device at {link} has another protocol: device version {device_version} (schema {device_schema}, firmware {firmware} on {board}), this program version {version} (schema {schema}, damprig {program}); flash the firmware of this program's version with `damprig flash`, or use the program of the firmware's version"
    )]
    Version {
        /// Name of the link.
        link: String,
        /// Protocol version of the device.
        device_version: u16,
        /// Schema hash of the device.
        device_schema: String,
        /// Firmware version of the device.
        firmware: String,
        /// Board of the device.
        board: String,
        /// Protocol version of this program.
        version: u16,
        /// Schema hash of this program.
        schema: String,
        /// Version of this program.
        program: &'static str,
    },
    /// A different device answers.
    #[error("a different device answers at {link}: it was {board}, it is {what}; the run was stopped")]
    Another {
        /// Name of the link.
        link: String,
        /// The board on which the run was started.
        board: String,
        /// Description of the device that answers now.
        what: String,
    },
    /// The board's settings have changed since the run was started.
    #[error(
        "the board's settings have changed since the run was started:\n  {}\n  restore them (`damprig settings set`), or start a new run",
        differences.join("\n  ")
    )]
    Settings {
        /// The differences, one per line.
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
        /// The reason.
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
    /// The settings that the device keeps cannot be read.
    #[error("the settings that the device at {link} keeps cannot be read: {why}")]
    NoRecords {
        /// Which.
        link: String,
        /// Why not, and what to do.
        why: &'static str,
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
    /// The reply does not match the request.
    #[error("the device sent an unexpected reply when asked to {what}")]
    UnexpectedReply {
        /// The request, in words.
        what: &'static str,
    },
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        if matches!(error, SessionError::Interrupted) { Self::stopped() } else { Self::failed(error) }
    }
}
