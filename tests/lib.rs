//! Whole-system tests of damprig. Each file beside this one is a group of claims; what they share is here.

pub mod support;
