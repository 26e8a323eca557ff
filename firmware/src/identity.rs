//! Who the image is, in a section of its file that is not loaded (`identity.x`): `damprig flash` reads it before it touches a
//! board. What the running board says is the shared device code's.

use damprig_protocol::image;

use crate::board::NAME;

#[used]
#[unsafe(link_section = ".damprig.identity")]
static IDENTITY: [u8; image::LENGTH] = image::to_bytes(NAME, env!("CARGO_PKG_VERSION"));
