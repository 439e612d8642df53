//! Glioscope, the workstation: one window of linked views on overlapping tumour masks, and the same
//! numbers and pictures from a command line.
//!
//! Modules, each depending on those before it: [`theme`] (colours and type), [`model`] (saved state), [`world`] (the
//! loaded case and derived results), [`words`] (sentences by language), [`report`], [`page`] and [`animation`] (what is handed over), [`command`] (user actions), [`cpu_paint`] (the
//! interface without a graphics card), [`views`] (one file per pane), [`study`] (how well people see in which light), [`window`], [`cli`]. Views read the document and the
//! world and write commands; commands change the document; the document determines what is derived and drawn.

pub mod animation;
pub mod cli;
pub mod command;
pub mod cpu_paint;
pub mod error;
pub mod export;
pub mod format;
pub mod model;
pub mod output;
pub mod pacs;
pub mod page;
pub mod report;
pub mod study;
pub mod theme;
pub mod views;
pub mod window;
pub mod words;
pub mod world;
