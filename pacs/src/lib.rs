//! DICOMweb (PS3.18): searching an archive (QIDO-RS), retrieving studies into a bounded cache (WADO-RS) and storing files
//! (STOW-RS), blocking. What a server sends is bounded before it is kept, and nothing of it becomes a path but valid UIDs.
//!
//! A [`Server`] is connected to as a [`Client`]; each of its calls can be cancelled from another thread.

mod address;
mod cache;
mod client;
mod credentials;
mod error;
mod identity;
mod json;
mod locks;
mod multipart;
mod reader;
mod retrieve;
mod rows;
mod search;
mod send;
mod session;
mod store_answer;
mod tags;
mod text;
mod uid;
mod upload;

pub use cache::{Cache, InUse};
pub use client::{Cancel, Client, Server, Timeouts};
pub use credentials::{Credentials, Secret};
pub use error::Error;
pub use retrieve::{Failed, Progress, Retrieved};
pub use rows::{InstanceRow, SeriesRow, StudyRow};
pub use search::Query;
pub use send::{Sent, Unsent};
pub use uid::Uid;
