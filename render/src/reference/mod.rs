//! Slow, exact answers that the fast ones are held against.

pub mod combined;
pub mod emission;
pub mod hemisphere;
pub mod lit;
pub mod march;
pub mod medium;
pub mod monte_carlo;
pub mod random;
#[cfg(test)]
mod tests;
pub mod twins;
pub mod vicinity;
