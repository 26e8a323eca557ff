//! The image's identity section (`identity.x`), which is not loaded. `damprig flash` reads it before it touches a
//! board. A running board sends the identity of the shared device code.

use damprig_protocol::image;

/// Revision of the source, as the build states it in `DAMPRIG_REVISION`; empty if it does not.
pub const REVISION: &str = match option_env!("DAMPRIG_REVISION") {
    Some(revision) => revision,
    None => "",
};

use crate::board::NAME;

#[used]
#[unsafe(link_section = ".damprig.identity")]
static IDENTITY: [u8; image::LENGTH] = image::to_bytes(NAME, env!("CARGO_PKG_VERSION"), REVISION);
