//! Glioscope, the workstation: one window of linked views on overlapping tumour masks, and the same
//! numbers and pictures from a command line.
//!
//! Views read the [`document`] and the [`world`] and write [`commands`]; commands change the document;
//! the document decides what is derived and drawn.

pub mod about;
pub mod cli;
pub mod commands;
pub mod comparing;
pub mod dialogs;
pub mod document;
pub mod files;
pub mod format;
pub mod history;
pub mod jobs;
pub mod layout;
pub mod menu;
pub mod offscreen;
pub mod palette;
pub mod panes;
pub mod recent;
pub mod rulers;
pub mod run_window;
pub mod session;
pub mod viewport;
pub mod views;
pub mod window;
pub mod workstation;
pub mod world;
