//! Undo and redo: snapshots of what undo covers, one per command or per gesture.

use std::time::{Duration, Instant};

use super::document::Edit;

/// A pause that ends a gesture.
const REST: Duration = Duration::from_millis(800);
/// Snapshots kept.
const DEPTH: usize = 200;

/// What was, and what was undone.
#[derive(Debug, Default)]
pub struct History {
    past: Vec<Edit>,
    future: Vec<Edit>,
    gesture: Option<(&'static str, Instant)>,
    held: bool,
}

impl History {
    /// Call after a command changed `before` into something else, at `now`. Commands of one `gesture`, one soon
    /// after the other, are undone together; those of none are undone one by one.
    pub fn record(&mut self, before: Edit, gesture: Option<&'static str>, now: Instant) {
        let continues = match (self.gesture, gesture) {
            (Some((last, at)), Some(this)) => {
                last == this && (self.held || now.saturating_duration_since(at) < REST)
            }
            _ => false,
        };
        if !continues {
            self.past.push(before);
            if self.past.len() > DEPTH {
                self.past.remove(0);
            }
        }
        self.future.clear();
        self.gesture = gesture.map(|g| (g, now));
    }

    /// Notes whether a pointer button is down. What happens between press and release is one gesture,
    /// however long it rests; the next press begins another.
    pub fn hold(&mut self, held: bool) {
        if held != self.held {
            self.gesture = None;
            self.held = held;
        }
    }

    /// Takes back the last change; `false` when there is none.
    pub fn undo(&mut self, current: &mut Edit) -> bool {
        self.gesture = None;
        let Some(before) = self.past.pop() else { return false };
        self.future.push(std::mem::replace(current, before));
        true
    }

    /// Does again what was undone; `false` when there is nothing.
    pub fn redo(&mut self, current: &mut Edit) -> bool {
        self.gesture = None;
        let Some(after) = self.future.pop() else { return false };
        self.past.push(std::mem::replace(current, after));
        true
    }

    /// Whether there is something to take back.
    pub fn can_undo(&self) -> bool {
        !self.past.is_empty()
    }

    /// Whether there is something to do again.
    pub fn can_redo(&self) -> bool {
        !self.future.is_empty()
    }
}
