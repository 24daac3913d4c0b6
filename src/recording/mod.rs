//! What is kept while a capture runs.

mod spool;

pub use spool::{Spool, SpoolReader};
