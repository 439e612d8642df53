//! The second image in the context view: its projection, and the legend of its colours.

use egui::{Align2, Rect, Stroke, StrokeKind, Ui, pos2, vec2};
use glioscope_render::{flat::Mixing, views::context::ImageProjection};

use crate::{
    format,
    model::fusion::{image_name, name_with_unit},
    theme::{self, LABEL_POINTS, Tokens},
    views::{
        draw,
        pane::{Input, Stage},
    },
    world::jobs::Lookup,
};

/// Size of the colours' bar, points.
const BAR_POINTS: [f32; 2] = [96.0, 9.0];
/// Narrower views have no legend: it would cover them.
const LEAST_WIDTH_POINTS: f32 = 240.0;
/// Room for the scale bar below it, points.
const BELOW_POINTS: f32 = 76.0;

/// The projection, where the user wants one; else `None`. Until a worker has prepared the image there is none, and a note.
pub(super) fn projection(ui: &Ui, stage: &mut Stage<'_>) -> (Option<ImageProjection>, Option<String>) {
    let (input, ask) = (stage.input, stage.ask);
    let fusion = &input.doc.edit.fusion;
    let Some(second) = input.second.filter(|_| fusion.in_context && !input.is_plain) else {
        return (None, None);
    };
    match stage.results.image.second(second.image, ask) {
        Lookup::Ready(volume) => {
            let projection = ImageProjection {
                volume: volume.clone(),
                window: second.window,
                map: fusion.map,
                opacity: if fusion.mixing == Mixing::Over { fusion.opacity } else { 1.0 },
                threshold: fusion.threshold_in(second.window),
            };
            (Some(projection), None)
        }
        Lookup::Working(_) => {
            ui.request_repaint_after(std::time::Duration::from_millis(100));
            (None, Some(format!("Preparing {}…", second.id)))
        }
        Lookup::Failed(error) => (None, Some(error.to_string())),
    }
}

/// Draws what the projection's colours mean, at the lower left.
pub(super) fn legend(ui: &Ui, input: &Input<'_>, rect: Rect, projection: &ImageProjection) {
    let Some(second) = input.second.filter(|_| rect.width() >= LEAST_WIDTH_POINTS) else { return };
    let dark = ui.visuals().dark_mode;
    let ink = Tokens::of(dark).text;
    let painter = ui.painter().with_clip_rect(rect);
    let font = theme::font(LABEL_POINTS);
    let name = name_with_unit(&image_name(second.id, second.time), second.image.volume().unit());
    let above = format::four_digits(projection.threshold);
    let name = draw::elided(
        ui,
        &format!("{name}, most along each ray, above {above}"),
        &font,
        ink,
        rect.width() * 0.6,
    );
    let [low, high] = [projection.window.low, projection.window.high].map(format::four_digits);
    let left = rect.left() + 10.0;
    let bottom = rect.bottom() - BELOW_POINTS;
    let bar = Rect::from_min_size(pos2(left, bottom - BAR_POINTS[1]), BAR_POINTS.into());
    let top = bar.top() - name.size().y - 4.0;
    let high_width = painter.layout_no_wrap(high.clone(), font.clone(), ink).size().x;
    let low = painter.layout_no_wrap(format!("{low} to"), font.clone(), ink);
    let texts = low.size().x + high_width + 12.0;
    let width = name.size().x.max(bar.width() + texts);
    draw::plate(&painter, Rect::from_min_max(pos2(left, top), pos2(left + width, bar.bottom() + 2.0)), dark);
    painter.galley(pos2(left, top), name, ink);
    draw::color_ramp(&painter, bar, projection.map, BAR_POINTS[0] as u8);
    painter.rect_stroke(bar, 0.0, Stroke::new(1.0, theme::EDGE), StrokeKind::Outside);
    let beside = bar.right_center() + vec2(6.0, 0.0);
    let low_width = low.size().x;
    painter.galley(beside - vec2(0.0, low.size().y / 2.0), low, ink);
    painter.text(beside + vec2(low_width + 4.0, 0.0), Align2::LEFT_CENTER, high, font, ink);
}
