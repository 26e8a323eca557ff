//! Writing whole files: a file gets its name when it is complete, so that a full disk or a kill leaves nothing under the name.

pub mod out_file;
pub mod whole_file;
