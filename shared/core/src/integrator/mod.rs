//! The dynamics: one mode machine ([`modes`]) under two drivers, *sampled* and *exact*.

pub mod modes;
