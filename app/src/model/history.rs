//! Undo and redo: snapshots of [`Edit`], one per command or gesture.

use std::time::{Duration, Instant};

use super::document::Edit;

/// A pause of this length ends a gesture, unless a pointer button is down.
const GESTURE_PAUSE: Duration = Duration::from_millis(800);
/// Maximum number of undo steps.
const MAX_UNDO: usize = 200;

/// Snapshots to undo and to redo.
#[derive(Debug, Default)]
pub struct History {
    past: Vec<Edit>,
    future: Vec<Edit>,
    gesture: Option<(&'static str, Instant)>,
    pointer_down: bool,
}

impl History {
    /// Records that a command changed `before`, at `now`. Commands of the same `gesture` in quick succession, or while
    /// a pointer button is down, are undone together; commands without a gesture are undone one by one.
    pub fn record(&mut self, before: Edit, gesture: Option<&'static str>, now: Instant) {
        let continues = match (self.gesture, gesture) {
            (Some((last, at)), Some(this)) => {
                last == this && (self.pointer_down || now.saturating_duration_since(at) < GESTURE_PAUSE)
            }
            _ => false,
        };
        if !continues {
            self.past.push(before);
            if self.past.len() > MAX_UNDO {
                self.past.remove(0);
            }
        }
        self.future.clear();
        self.gesture = gesture.map(|g| (g, now));
    }

    /// Records whether a pointer button is down. Everything from press to release is one gesture, whatever its pauses;
    /// the next press starts another.
    pub fn hold(&mut self, pointer_down: bool) {
        if pointer_down != self.pointer_down {
            self.gesture = None;
            self.pointer_down = pointer_down;
        }
    }

    /// Undoes the last change; `false` when there is none.
    pub fn undo(&mut self, current: &mut Edit) -> bool {
        self.gesture = None;
        let Some(before) = self.past.pop() else { return false };
        self.future.push(std::mem::replace(current, before));
        true
    }

    /// Redoes the last undone change; `false` when there is none.
    pub fn redo(&mut self, current: &mut Edit) -> bool {
        self.gesture = None;
        let Some(after) = self.future.pop() else { return false };
        self.past.push(std::mem::replace(current, after));
        true
    }

    /// Whether there is a change to undo.
    pub fn can_undo(&self) -> bool {
        !self.past.is_empty()
    }

    /// Whether there is a change to redo.
    pub fn can_redo(&self) -> bool {
        !self.future.is_empty()
    }
}
