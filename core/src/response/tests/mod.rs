//! Truth is written by hand from the sources (see `rules.rs`), not from the code.

mod made;
mod margins;
mod other_criteria;
mod properties;
mod rano_20;
mod rano_2010;
mod reading;
mod table;
