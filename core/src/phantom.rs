//! The head phantom.
