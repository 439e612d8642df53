//! Glioscope, the workstation: one window of linked views on overlapping tumour masks, and the same
//! numbers and pictures from a command line.
//!
//! Rooms, each knowing those before it: [`model`] (what is saved), [`world`] (what is alive and derived),
//! [`command`] (what a user can do), [`views`] (one file per pane), [`window`], [`cli`]. Views read the document and
//! the world and write commands; commands change the document; the document decides what is derived and drawn.

pub mod cli;
pub mod command;
pub mod error;
pub mod format;
pub mod model;
pub mod output;
pub mod views;
pub mod window;
pub mod world;
