//! The window's colours, type and spacing, for the dark and the light theme: the one place where they are stated.
//! Elsewhere a raw colour fails clippy; colours of masks and of images come from their own tables.
//!
//! One hue, one meaning: blue is interaction, amber a warning, red an error, white with a dark edge the lens and the
//! crosshair, orange growth and green shrinkage. Text has a contrast of at least 4.5 to 1 on its ground, marks 3 to 1
//! (WCAG 2.2, 1.4.3 and 1.4.11), which tests hold.
#![allow(clippy::disallowed_methods, reason = "colours are stated here")]

use std::sync::Arc;

use egui::{
    Color32, Context, CornerRadius, FontFamily, FontId, Margin, Shadow, Stroke, Style, TextStyle, Ui,
    Visuals,
    style::{Selection, WidgetVisuals, Widgets},
    vec2,
};
use glioscope_core::optics::srgb;

/// Size of text in tables, menus and sentences, points.
pub const TEXT_POINTS: f32 = 13.0;
/// Size of labels in views, points.
pub const LABEL_POINTS: f32 = 11.5;
/// Size of headings, points.
pub const HEADING_POINTS: f32 = 16.0;

/// Marks and text over images, in both themes: white with [`EDGE`] around it is legible on black, white and every mask.
pub const ON_IMAGE: Color32 = Color32::WHITE;
/// The dark edge of marks and text over images.
pub const EDGE: Color32 = Color32::from_black_alpha(200);
/// Ground of text over images.
pub const PLATE: Color32 = Color32::from_black_alpha(178);
/// The crosshair of slices, which shows the image through it.
pub const CROSSHAIR: Color32 = Color32::from_rgba_unmultiplied_const(255, 255, 255, 178);
/// Warnings over images.
pub const WARNING_ON_IMAGE: Color32 = Color32::from_rgb(0xf0, 0xb4, 0x29);
/// Measured lines, in every view, with [`EDGE`] around them.
pub const RULER: Color32 = Color32::from_rgb(0xff, 0xe0, 0x66);
/// The ground of images.
pub const IMAGE_GROUND: [u8; 3] = [0x0b, 0x0d, 0x10];
/// Dark text on light marks.
pub const DARK_INK: Color32 = Color32::BLACK;

/// Colours of a theme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tokens {
    /// Ground of 3D views.
    pub viewport: Color32,
    /// Ground of panes, menus and bars.
    pub panel: Color32,
    /// Ground of dialogs, menus that are open and buttons.
    pub raised: Color32,
    /// Lines between panes and around fields.
    pub line: Color32,
    /// Text.
    pub text: Color32,
    /// Text that is read second: units, explanations, what is off.
    pub second: Color32,
    /// Interaction alone: pointed at, focused, chosen.
    pub interaction: Color32,
    /// Ground of what is chosen, under [`Tokens::text`].
    pub chosen: Color32,
    /// Warnings.
    pub warning: Color32,
    /// Ground of warnings, under [`Tokens::text`].
    pub warning_ground: Color32,
    /// Errors.
    pub error: Color32,
    /// What grew between two dates.
    pub growth: Color32,
    /// What shrank between two dates.
    pub shrinkage: Color32,
}

const fn hex(rgb: u32) -> Color32 {
    Color32::from_rgb((rgb >> 16) as u8, (rgb >> 8) as u8, rgb as u8)
}

/// The dark theme's colours.
pub const DARK: Tokens = Tokens {
    viewport: hex(0x14181d),
    panel: hex(0x1a1f26),
    raised: hex(0x222831),
    line: hex(0x2f3742),
    text: hex(0xe7eaee),
    second: hex(0xa3adb8),
    interaction: hex(0x4aa8ff),
    chosen: hex(0x1d4468),
    warning: hex(0xf0b429),
    warning_ground: hex(0x3a2f12),
    error: hex(0xff6b5e),
    growth: hex(0xf26b3a),
    shrinkage: hex(0x12806d),
};

/// The light theme's colours.
pub const LIGHT: Tokens = Tokens {
    viewport: hex(0xf4f4f2),
    panel: hex(0xfbfbfa),
    raised: hex(0xffffff),
    line: hex(0xd8dbe0),
    text: hex(0x1a1f26),
    second: hex(0x56606c),
    interaction: hex(0x0a66c2),
    chosen: hex(0xcfe3f7),
    warning: hex(0x946200),
    warning_ground: hex(0xfdf0cf),
    error: hex(0xb3261e),
    growth: hex(0xd9531f),
    shrinkage: hex(0x0b5f50),
};

impl Tokens {
    /// The theme's colours.
    pub const fn of(dark: bool) -> &'static Self {
        if dark { &DARK } else { &LIGHT }
    }

    /// The colours of the theme that `ui` is drawn in.
    pub fn in_ui(ui: &Ui) -> &'static Self {
        Self::of(ui.visuals().dark_mode)
    }

    /// Ground of 3D views as sRGB.
    pub const fn viewport_rgb(&self) -> [u8; 3] {
        [self.viewport.r(), self.viewport.g(), self.viewport.b()]
    }

    /// The ramp of what shrank and grew: -1 shrinkage, 0 nothing, 1 growth.
    pub fn diverging(&self, share: f32) -> Color32 {
        let middle = self.panel.lerp_to_gamma(self.second, 0.35);
        middle.lerp_to_gamma(if share < 0.0 { self.shrinkage } else { self.growth }, share.abs())
    }

    /// Ground of text over a 3D view: mostly the view's own ground.
    pub fn plate(&self) -> Color32 {
        let [r, g, b] = self.viewport_rgb();
        Color32::from_rgba_unmultiplied(r, g, b, 200)
    }
}

/// The ramp of numbers without a sign, viridis at five places: equal steps of numbers are equal steps for the eye, in grey and for each
/// colour deficiency, too.
const SEQUENTIAL: [Color32; 5] = [hex(0x440154), hex(0x3b528b), hex(0x21918c), hex(0x5ec962), hex(0xfde725)];

/// The ramp of numbers at 0 to 1.
pub fn sequential(share: f32) -> Color32 {
    let at = share.clamp(0.0, 1.0) * (SEQUENTIAL.len() - 1) as f32;
    let low = (at as usize).min(SEQUENTIAL.len() - 2);
    SEQUENTIAL[low].lerp_to_gamma(SEQUENTIAL[low + 1], at - low as f32)
}

/// An sRGB colour of a mask, an image or a ramp as egui's type.
pub const fn color([r, g, b]: [u8; 3]) -> Color32 {
    Color32::from_rgb(r, g, b)
}

/// Text in views, which have no style of their own.
pub const fn font(points: f32) -> FontId {
    FontId::new(points, FontFamily::Proportional)
}

/// Sets both themes' styles.
pub fn install(ctx: &Context) {
    for (theme, tokens) in [(egui::Theme::Dark, &DARK), (egui::Theme::Light, &LIGHT)] {
        let style = ctx.style_of(theme);
        ctx.set_style_of(theme, Arc::new(styled(&style, tokens, theme == egui::Theme::Dark)));
    }
}

/// `before` with the theme's colours, type and spacing. Motion is left as it is.
fn styled(before: &Style, t: &Tokens, dark: bool) -> Style {
    let mut style = before.clone();
    style.text_styles = [
        (TextStyle::Small, font(LABEL_POINTS)),
        (TextStyle::Body, font(TEXT_POINTS)),
        (TextStyle::Button, font(TEXT_POINTS)),
        (TextStyle::Heading, font(HEADING_POINTS)),
        (TextStyle::Monospace, FontId::new(12.5, FontFamily::Monospace)),
    ]
    .into();
    let spacing = &mut style.spacing;
    spacing.item_spacing = vec2(8.0, 4.0);
    spacing.button_padding = vec2(8.0, 2.0);
    spacing.window_margin = Margin::same(12);
    spacing.menu_margin = Margin::same(8);
    // Scroll bars beside what they scroll, not over its last digits.
    spacing.scroll.floating_allocated_width = spacing.scroll.bar_width;
    style.visuals = visuals(t, dark);
    style
}

fn visuals(t: &Tokens, dark: bool) -> Visuals {
    let before = if dark { Visuals::dark() } else { Visuals::light() };
    let widget = |ground: Color32, edge: Color32, ink: Color32| WidgetVisuals {
        bg_fill: ground,
        weak_bg_fill: ground,
        bg_stroke: Stroke::new(1.0, edge),
        corner_radius: CornerRadius::same(4),
        fg_stroke: Stroke::new(1.0, ink),
        expansion: 0.0,
    };
    let button = t.panel.lerp_to_gamma(t.line, 0.7);
    let shadow = Shadow { offset: [0, 4], blur: 16, spread: 0, color: Color32::from_black_alpha(96) };
    Visuals {
        weak_text_color: Some(t.second),
        widgets: Widgets {
            noninteractive: widget(t.panel, t.line, t.text),
            // The ground of check boxes and radio buttons stands out more than that of buttons.
            inactive: WidgetVisuals {
                bg_stroke: Stroke::NONE,
                bg_fill: t.panel.lerp_to_gamma(t.second, 0.35),
                ..widget(button, t.line, t.text)
            },
            hovered: widget(t.line, t.interaction, t.text),
            active: WidgetVisuals {
                // Also the colour of strong text.
                fg_stroke: Stroke::new(1.5, if dark { Color32::WHITE } else { Color32::BLACK }),
                ..widget(t.chosen, t.interaction, t.text)
            },
            open: widget(t.line, t.line, t.text),
        },
        selection: Selection { bg_fill: t.chosen, stroke: Stroke::new(1.0, t.text) },
        hyperlink_color: t.interaction,
        faint_bg_color: t.panel.lerp_to_gamma(t.line, 0.3),
        extreme_bg_color: if dark { t.viewport } else { t.raised },
        // In the light theme a field would have the ground it stands on.
        text_edit_bg_color: (!dark).then(|| t.panel.lerp_to_gamma(t.line, 0.55)),
        code_bg_color: t.line,
        warn_fg_color: t.warning,
        error_fg_color: t.error,
        window_corner_radius: CornerRadius::same(8),
        window_fill: t.raised,
        window_stroke: Stroke::new(1.0, t.line),
        window_shadow: shadow,
        menu_corner_radius: CornerRadius::same(6),
        popup_shadow: shadow,
        panel_fill: t.panel,
        ..before
    }
}

/// Relative luminance of an opaque colour (WCAG 2.2).
fn luminance(color: Color32) -> f64 {
    let [r, g, b] = [color.r(), color.g(), color.b()].map(|c| srgb::decode(f64::from(c) / 255.0));
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Contrast of two opaque colours, 1 to 21 (WCAG 2.2).
pub fn contrast(a: Color32, b: Color32) -> f64 {
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

/// The ink that is more legible on an opaque ground: dark or white.
pub fn ink_on(ground: Color32) -> Color32 {
    if contrast(DARK_INK, ground) >= contrast(ON_IMAGE, ground) { DARK_INK } else { ON_IMAGE }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contrast_is_that_of_the_standard() {
        assert!((contrast(Color32::BLACK, Color32::WHITE) - 21.0).abs() < 1e-9);
        // #767676 on white: 4.54 to 1, the example of the standard's techniques (G18).
        assert!((contrast(hex(0x767676), Color32::WHITE) - 4.54).abs() < 0.005);
    }

    #[test]
    fn text_and_marks_are_legible_on_their_grounds() {
        for (name, t) in [("dark", DARK), ("light", LIGHT)] {
            for (ground_name, ground) in [("panel", t.panel), ("raised", t.raised), ("viewport", t.viewport)]
            {
                for (ink_name, ink, least) in [
                    ("text", t.text, 4.5),
                    ("second", t.second, 4.5),
                    ("warning", t.warning, 4.5),
                    ("error", t.error, 4.5),
                    ("interaction", t.interaction, 4.5),
                    ("growth", t.growth, 3.0),
                    ("shrinkage", t.shrinkage, 3.0),
                ] {
                    let found = contrast(ink, ground);
                    assert!(
                        found >= least,
                        "{name}: {ink_name} on {ground_name}: {found:.2}, expected {least}"
                    );
                }
            }
            for (ground_name, ground) in [("chosen", t.chosen), ("warning", t.warning_ground)] {
                let found = contrast(t.text, ground);
                assert!(found >= 4.5, "{name}: text on {ground_name}: {found:.2}");
            }
        }
        // Marks on an image: black, white and grey are all legible with the edge.
        let over = |ground: u8| {
            let alpha = f64::from(EDGE.a()) / 255.0;
            Color32::from_gray((f64::from(ground) * (1.0 - alpha)) as u8)
        };
        for ground in [0, 128, 255] {
            for ink in [ON_IMAGE, WARNING_ON_IMAGE, RULER] {
                assert!(contrast(ink, over(ground)) >= 4.5, "{ink:?} on {ground}");
            }
        }
    }

    #[test]
    fn growth_and_shrinkage_differ_in_lightness_too() {
        for t in [DARK, LIGHT] {
            // For print in grey: a tenth of the range of L*.
            let lightness = |c| 116.0 * luminance(c).cbrt() - 16.0;
            assert!((lightness(t.growth) - lightness(t.shrinkage)).abs() > 10.0);
        }
    }
}
