//! The tissue at each point of the head, and its brightness in each image.

use glam::DVec3;

use super::marks::{Ellipsoid, Mark};
use crate::Scaling;

/// The three imaging modalities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Modality {
    /// T1-weighted MR with contrast agent.
    T1c = 1,
    /// FLAIR MR.
    Flair = 2,
    /// PET of an amino-acid tracer, as uptake ratio.
    Pet = 3,
}

impl Modality {
    /// Stored numbers are 0 to 255; PET's represent uptake ratios up to 5.1.
    pub(super) fn scaling(self) -> Scaling {
        match self {
            Self::T1c | Self::Flair => Scaling::NONE,
            // As a header's f32 stores it.
            Self::Pet => Scaling { slope: f64::from(0.02_f32), intercept: 0.0 },
        }
    }
}

#[derive(Clone, Copy)]
enum Tissue {
    Air,
    Fat,
    Muscle,
    Bone,
    Marrow,
    Fluid,
    Grey,
    White,
    Blood,
    Capsule,
    Oedema,
    Enhancing,
    Core,
}

impl Tissue {
    /// Stored brightness of T1c, FLAIR and PET.
    fn brightness(self) -> [f32; 3] {
        match self {
            Self::Air => [0.0, 0.0, 0.0],
            Self::Fat => [174.0, 138.0, 24.0],
            Self::Muscle => [84.0, 78.0, 42.0],
            Self::Bone => [18.0, 18.0, 12.0],
            Self::Marrow => [72.0, 54.0, 24.0],
            Self::Fluid => [30.0, 24.0, 18.0],
            Self::Grey => [90.0, 126.0, 66.0],
            Self::White => [138.0, 96.0, 42.0],
            Self::Blood => [222.0, 60.0, 48.0],
            Self::Capsule => [240.0, 198.0, 18.0],
            Self::Oedema => [102.0, 198.0, 66.0],
            Self::Enhancing => [222.0, 162.0, 96.0],
            Self::Core => [66.0, 90.0, 48.0],
        }
    }
}

const fn at(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

const HEAD: Ellipsoid = Ellipsoid::new(at(0.0, 0.0, 0.0), at(74.0, 94.0, 86.0));
const NOSE: Ellipsoid = Ellipsoid::new(at(0.0, 92.0, -26.0), at(11.0, 17.0, 17.0));
/// Marks the right side.
const CAPSULE: Ellipsoid = Ellipsoid::new(at(51.0, 66.5, 22.0), at(5.0, 5.0, 5.0));
const SINUS: Ellipsoid = Ellipsoid::new(at(0.0, 62.0, -54.0), at(13.0, 20.0, 13.0));
const CEREBELLUM: Ellipsoid = Ellipsoid::new(at(0.0, -46.0, -40.0), at(46.0, 30.0, 21.0));
const STEM: Ellipsoid = Ellipsoid::new(at(0.0, -14.0, -38.0), at(12.0, 12.0, 34.0));
/// The left one is compressed by the tumour.
const VENTRICLES: [Ellipsoid; 3] = [
    Ellipsoid::new(at(11.0, -2.0, 14.0), at(6.0, 32.0, 9.0)),
    Ellipsoid::new(at(-8.0, -9.0, 12.0), at(3.5, 25.0, 6.5)),
    Ellipsoid::new(at(1.0, -10.0, 0.0), at(2.5, 12.0, 9.0)),
];

/// Symmetric structures: `x` is mirrored onto the right.
const EAR: Ellipsoid = Ellipsoid::new(at(73.0, -10.0, -18.0), at(6.0, 10.0, 17.0));
const ORBIT: Ellipsoid = Ellipsoid::new(at(31.0, 74.0, -24.0), at(17.0, 18.0, 16.0));
const EYE: Ellipsoid = Ellipsoid::new(at(31.0, 77.0, -24.0), at(12.0, 12.0, 12.0));
const THALAMUS: Ellipsoid = Ellipsoid::new(at(12.0, -14.0, 4.0), at(9.0, 14.0, 8.0));
const PUTAMEN: Ellipsoid = Ellipsoid::new(at(25.0, 2.0, 4.0), at(5.0, 17.0, 10.0));

/// Height of the skull's base: higher in front, above the face.
fn base_mm(y: f64) -> f64 {
    if y > 10.0 { -32.0 } else { (-32.0 + 0.75 * (y - 10.0)).max(-64.0) }
}

/// Signed distance to the skin of head and neck, negative inside.
fn skin_mm(p: DVec3) -> f64 {
    let neck = Ellipsoid::new(at(0.0, -18.0, p.z), at(52.0, 58.0, 1.0));
    let neck_mm = (neck.radius_at(p) - 1.0) * 54.0;
    let head_mm = HEAD.distance_mm(p);
    if p.z < -30.0 { head_mm.min(neck_mm.max(p.z + 30.0)) } else { head_mm }
}

/// A sine approximated by parabolas, period 1. The platform's `sin` may differ in the last bit
/// between machines, and the sample must be the same on all.
fn wave(turns: f64) -> f64 {
    let t = turns - turns.floor();
    if t < 0.5 { 16.0 * t * (0.5 - t) } else { -16.0 * (t - 0.5) * (1.0 - t) }
}

/// Cortex and white matter, folded along a gyroid surface.
fn cerebrum(p: DVec3, depth_mm: f64) -> Tissue {
    if depth_mm > 24.0 {
        return Tissue::White;
    }
    let w = p / 27.0 + at(0.06, 0.175, 0.0);
    let [sx, sy, sz] = [wave(w.x), wave(w.y), wave(w.z)];
    let [cx, cy, cz] = [wave(w.x + 0.25), wave(w.y + 0.25), wave(w.z + 0.25)];
    let fold = sx * cy + sy * cz + sz * cx;
    // Sulci narrow with depth; the grey ribbon lines them and the surface.
    let sulcus = 0.16 * (1.0 - depth_mm / 15.0);
    if fold.abs() < sulcus {
        Tissue::Fluid
    } else if depth_mm < 3.5 || fold.abs() < 0.62 * (1.0 - depth_mm / 24.0) + 0.05 {
        Tissue::Grey
    } else {
        Tissue::White
    }
}

fn inside_skull(p: DVec3, mirrored: DVec3, depth_mm: f64) -> Tissue {
    let over_base_mm = p.z - base_mm(p.y);
    let depth_mm = depth_mm.min(over_base_mm - 1.5);
    if p.x.abs() < 2.6 && (-4.0..2.0).contains(&depth_mm) && p.z > -20.0 {
        return Tissue::Blood; // the superior sagittal sinus
    }
    if depth_mm < 0.0 {
        return Tissue::Fluid;
    }
    if STEM.contains(p) {
        return Tissue::White;
    }
    let cerebellum_mm = CEREBELLUM.distance_mm(p);
    if cerebellum_mm < 0.0 {
        let folium = wave((p.z + 0.35 * p.y + 2.0 * wave(p.x / 88.0 + 0.25)) / 6.0);
        return if folium > 0.82 && cerebellum_mm > -9.0 {
            Tissue::Fluid
        } else if folium > -0.25 && cerebellum_mm > -13.0 {
            Tissue::Grey
        } else {
            Tissue::White
        };
    }
    let falx = p.x.abs() < 1.1 && (p.z > 24.0 || p.y.abs() > 42.0);
    if cerebellum_mm < 2.0 || falx || VENTRICLES.iter().any(|e| e.contains(p)) {
        return Tissue::Fluid;
    }
    if THALAMUS.contains(mirrored) || PUTAMEN.contains(mirrored) {
        return Tissue::Grey;
    }
    cerebrum(p, depth_mm)
}

fn healthy(p: DVec3) -> Tissue {
    let mirrored = at(p.x.abs(), p.y, p.z);
    if CAPSULE.contains(p) {
        return Tissue::Capsule;
    }
    let skin_mm = skin_mm(p);
    if skin_mm > 0.0 {
        let soft = NOSE.contains(p) || EAR.contains(mirrored);
        return if soft { Tissue::Muscle } else { Tissue::Air };
    }
    if EYE.contains(mirrored) {
        return Tissue::Fluid;
    }
    if ORBIT.contains(mirrored) {
        return Tissue::Fat;
    }
    let over_base_mm = p.z - base_mm(p.y);
    match -skin_mm {
        d if d < 1.5 => Tissue::Muscle, // skin
        d if d < 5.5 => Tissue::Fat,
        _ if over_base_mm < -5.0 => {
            if SINUS.contains(p) {
                Tissue::Air
            } else if STEM.contains(p) {
                Tissue::White
            } else {
                Tissue::Muscle
            }
        }
        d if d < 7.5 => Tissue::Bone,
        d if d < 9.5 => Tissue::Marrow,
        d if d < 11.5 => Tissue::Bone,
        _ if over_base_mm < 0.0 => {
            if STEM.contains(p) {
                Tissue::White
            } else {
                Tissue::Bone
            }
        }
        d => inside_skull(p, mirrored, d - 14.0),
    }
}

/// The tumour at a point: necrotic core, enhancing rim, oedema, in this order.
fn tumour(p: DVec3, t1: &Mark, t2: &Mark) -> Option<Tissue> {
    if t1.contains(p) {
        let core = Ellipsoid { semi_axes_mm: t1.parts[0].semi_axes_mm * 0.62, ..t1.parts[0] };
        return Some(if core.contains(p) { Tissue::Core } else { Tissue::Enhancing });
    }
    t2.contains(p).then_some(Tissue::Oedema)
}

/// Stored brightness, 0 to 255, of an image at a point; `marks` are those of T1, T2 and PET.
pub(super) fn intensity(modality: Modality, [t1, t2, pet]: &[Mark; 3], p: DVec3) -> f32 {
    let tissue = tumour(p, t1, t2).unwrap_or_else(|| healthy(p));
    let brightness = tissue.brightness()[modality as usize - 1];
    let pet_radius = pet.parts[0].radius_at(p);
    if modality == Modality::Pet && pet_radius < 1.3 {
        // Drops to half its height at the mask's border.
        let edge = ((1.3 - pet_radius) / 0.6).clamp(0.0, 1.0);
        let height = edge * edge * (3.0 - 2.0 * edge) * (1.0 - 0.25 * pet_radius * pet_radius);
        let glow = 245.0 * height as f32;
        return brightness.max(glow);
    }
    brightness
}
