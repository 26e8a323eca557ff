//! Tests of the core through its public interface, one file for each part.

mod accumulations;
mod balance;
mod cavities;
mod closed_forms;
mod draw;
mod energy_books;
mod events;
mod exact_properties;
mod first_instant;
mod hertz;
mod hold;
mod joined;
mod safety;
mod sampled;
mod scalars;
mod second_method;
mod walls;
