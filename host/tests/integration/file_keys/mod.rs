//! What is made from the declared keys: JSON Schemas, the key reference, and new files.
//!
//! `tests/python/check_schemas.py` judges documents by the schemas; without its Python (see `exports`) that is left out.

mod case_examples;
mod design_examples;
mod documents;
mod examples;
mod new_files;
mod schemas;
