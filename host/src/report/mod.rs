//! What people and other programs get from runs and simulations: figures, the report page, exports, terminal text.
//!
//! Modules import only those listed before them.

pub mod exports;
pub mod figures;
pub mod page;
pub mod terminal;
