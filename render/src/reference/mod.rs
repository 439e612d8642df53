//! Slow, exact answers that the fast ones are held against.

pub mod emission;
pub mod twins;
