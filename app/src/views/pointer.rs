//! The order of mouse and key events. egui interprets all events of a frame at once, by the pointer's last position and
//! the keys then pressed: a press, a drag and a release within one frame would be lost, or act on what lies where the
//! pointer is by then. Here a frame ends at every press and release; the rest waits for the next frame.

use std::collections::VecDeque;

use egui::{Context, Event, Id, Key, Modifiers, Plugin, RawInput, Ui};

fn press_id() -> Id {
    Id::unique("modifiers at the last press")
}

/// Keys held at the last press of a pointer button: they decide what a drag does, whatever is pressed later.
pub fn press_modifiers(ctx: &Context) -> Modifiers {
    ctx.data(|data| data.get_temp(press_id())).unwrap_or_else(|| ctx.input(|i| i.modifiers))
}

/// Installs the order of events; once per window.
pub fn install(ctx: &Context) {
    ctx.add_plugin(EventOrder::default());
}

#[derive(Default)]
struct EventOrder {
    /// Events for the next frames, with the time at which they arrived.
    waiting: VecDeque<(Option<f64>, Event)>,
    modifiers: Modifiers,
    buttons_down: usize,
    time: f64,
}

/// What the current frame contains so far.
#[derive(Default)]
struct Frame {
    pointer_moved: bool,
    key: bool,
    /// A key pressed with Ctrl, which may open a text field.
    command_key: Option<Key>,
}

impl Plugin for EventOrder {
    fn debug_name(&self) -> &'static str {
        "order of events"
    }

    fn input_hook(&mut self, ctx: &Context, input: &mut RawInput) {
        let arrived = input.time;
        self.waiting.extend(input.events.drain(..).map(|event| (arrived, event)));
        let mut frame = Frame::default();
        while let Some((time, event)) = self.waiting.pop_front() {
            if self.starts_frame(&frame, &event) {
                self.waiting.push_front((time, event));
                break;
            }
            // The time of arrival: slow frames must not turn two quick clicks into two slow ones.
            input.time = time;
            let ends_frame = self.take(&mut frame, ctx, &event);
            input.events.push(event);
            if ends_frame {
                break;
            }
        }
        if let Some(time) = &mut input.time {
            *time = time.max(self.time + 1e-6);
            self.time = *time;
        }
    }

    fn on_end_pass(&mut self, ui: &mut Ui) {
        if !self.waiting.is_empty() {
            ui.request_repaint();
        }
    }
}

impl EventOrder {
    /// Whether `event` must wait for a frame of its own.
    fn starts_frame(&self, frame: &Frame, event: &Event) -> bool {
        match event {
            // The keys before it may change what a press does; the drag up to a release must be seen first.
            Event::PointerButton { pressed, .. } => {
                frame.key || (!pressed && frame.pointer_moved && self.buttons_down > 0)
            }
            Event::Text(_) | Event::Paste(_) => frame.command_key.is_some(),
            Event::Key { key, pressed: true, .. } => frame.command_key.is_some_and(|first| first != *key),
            _ => false,
        }
    }

    /// Notes an event of the current frame. Whether the frame ends after it.
    fn take(&mut self, frame: &mut Frame, ctx: &Context, event: &Event) -> bool {
        match event {
            Event::ModifiersChanged(modifiers) => self.modifiers = *modifiers,
            Event::PointerMoved(_) => frame.pointer_moved = true,
            Event::Key { key, pressed: true, modifiers, .. } => {
                frame.key = true;
                if modifiers.command || modifiers.ctrl {
                    frame.command_key = Some(*key);
                }
            }
            Event::PointerButton { pressed: true, modifiers, .. } => {
                self.buttons_down += 1;
                let held = *modifiers | self.modifiers;
                ctx.data_mut(|data| data.insert_temp(press_id(), held));
                return true;
            }
            Event::PointerButton { pressed: false, .. } => {
                self.buttons_down = self.buttons_down.saturating_sub(1);
                return true;
            }
            Event::WindowFocused(false) => {
                self.modifiers = Modifiers::NONE;
                self.buttons_down = 0;
            }
            _ => {}
        }
        false
    }
}
