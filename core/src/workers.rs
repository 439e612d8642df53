//! The threads on which kernels run in parallel.

/// Starts the worker threads. Without this call they start when first needed, and the program ends with a panic where
/// the system refuses them.
///
/// # Errors
/// The system's reason, in one line; also on a second call.
pub fn start() -> Result<(), String> {
    rayon::ThreadPoolBuilder::new().build_global().map_err(|error| error.to_string())
}
