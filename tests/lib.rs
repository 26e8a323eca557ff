//! Tests of the whole damprig system. Each file beside this one groups related claims; [`support`] is shared.

pub mod support;
