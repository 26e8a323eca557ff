//! Results of runs and simulations for people and other programs: figures, the report page, exports and terminal
//! text.
//!
//! `numbers`, `parameters`, `peak`, `describe` and `text_table` are the lowest layer, then [`documents`] (what the terminal and a page show alike) and [`plot`], then [`force_surface`], [`resonance`] and [`figures`]; [`page`], [`exports`] and [`terminal`] do not import each
//! other. The modules named after files write what a command leaves in its folder.

pub mod backbone_table;
pub mod basins_files;
pub mod bifurcation_files;
pub mod branch_table;
pub mod case_files;
pub mod compared;
pub mod describe;
pub mod documents;
pub mod exports;
pub mod figures;
pub mod force_surface;
pub mod numbers;
pub mod optimum_files;
pub mod page;
pub mod parameters;
pub mod peak;
pub mod plot;
pub mod resonance;
pub mod resonance_table;
pub mod restitution_table;
pub mod spectrum_table;
pub mod study_files;
pub mod terminal;
pub mod text_table;
