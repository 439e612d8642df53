//! Half-angle slicing and the lamp's light on opaque geometry on the CPU in `f64`: in world space, with the transfer function
//! itself, without bricks, with voxels found by sorting instead of stepping.

use glam::{DVec2, DVec3};
use glioscope_core::optics::{Ray, Sight, march::converged, medium::Medium, srgb, voxels::OpaqueVoxels};
use rayon::prelude::*;

use super::plan::{Case, HalfAnglePlan};
use crate::{
    scene::Lamp,
    views::context::{
        ContextScene,
        reference::{box_interval, in_index_space, sample, visible_interval},
    },
};

/// A scene that a lamp shines at.
pub struct LampTwin<'a> {
    pub scene: &'a ContextScene,
    pub sight: &'a Sight,
    /// Of camera space.
    pub reference_mm: f64,
    /// Direction that light travels in, camera space.
    pub light: DVec3,
    /// The shown voxels.
    pub voxels: Option<OpaqueVoxels>,
    /// By how much edges of shadows are moved, millimetres: where that changes a result, rounding may decide.
    pub shift_mm: f64,
}

/// A texel's light.
#[derive(Clone, Copy)]
struct Texel {
    light: f64,
    near: f64,
    far: f64,
    /// Scalar product with the normal where masks are met.
    hit: f64,
}

impl LampTwin<'_> {
    pub fn turned(&self, v: DVec3) -> DVec3 {
        self.sight.right * v.x + self.sight.up * v.y + self.sight.forward * v.z
    }

    /// A point of camera space.
    pub fn world(&self, c: DVec3) -> DVec3 {
        self.sight.eye_mm + self.turned(c + DVec3::Z * self.reference_mm)
    }

    /// The interval of a ray in the image's box, behind the eye's plane, not clipped.
    pub fn span(&self, ray: &Ray) -> (f64, f64) {
        let Some(volume) = &self.scene.volume else { return (0.0, 0.0) };
        let (mut near, mut far) = box_interval(volume.grid(), ray);
        let eye = (-self.sight.forward, -self.sight.forward.dot(self.sight.eye_mm));
        for (normal, offset) in self.scene.clip.iter().map(|p| (p.normal, p.offset_mm)).chain([eye]) {
            let (room, rate) = (offset - normal.dot(ray.origin_mm), normal.dot(ray.direction));
            if rate.abs() <= 1e-12 {
                far = if room < 0.0 { near } else { far };
            } else if rate > 0.0 {
                far = far.min(room / rate);
            } else {
                near = near.max(room / rate);
            }
        }
        (near, far)
    }

    /// Extinction per millimetre at a point; 0 in and before the masks' box.
    pub fn extinction(&self, at_mm: DVec3) -> f64 {
        let sight = match self.sight.growth() > 0.0 {
            true => at_mm - self.sight.eye_mm,
            false => self.sight.forward * self.sight.depth_mm(at_mm),
        };
        let far_mm = sight.length();
        let ray = Ray { origin_mm: at_mm - sight, direction: sight / far_mm };
        let in_front = self.scene.tumor.as_ref().is_some_and(|tumor| {
            let (enter, leave) = box_interval(tumor.grid(), &ray);
            enter.max(0.0) < leave && far_mm + self.shift_mm < leave
        });
        if in_front { 0.0 } else { -(1.0 - self.material(at_mm).1).max(1e-30).ln() }
    }

    /// Encoded colour and opacity of 1 mm.
    fn material(&self, at_mm: DVec3) -> ([f64; 3], f64) {
        let Some(volume) = &self.scene.volume else { return ([0.0; 3], 0.0) };
        let ray = Ray { origin_mm: at_mm, direction: DVec3::X };
        sample(self.scene, in_index_space(volume.grid(), &ray).0)
    }

    /// How far a ray from a point, at most `far_mm` long, is from masks.
    fn to_masks(&self, ray: &Ray, far_mm: f64) -> f64 {
        let Some(voxels) = self.voxels.as_ref().filter(|v| v.hidden(ray, far_mm)) else {
            return f64::INFINITY;
        };
        let (mut free, mut hidden) = (0.0, far_mm);
        for _ in 0..44 {
            let middle = 0.5 * (free + hidden);
            if voxels.hidden(ray, middle) { hidden = middle } else { free = middle }
        }
        hidden
    }

    fn begin_light(&self, plan: &HalfAnglePlan, case: &Case) -> Vec<Texel> {
        let [width, height] = plan.texels.map(|t| t as usize);
        (0..width * height)
            .into_par_iter()
            .map(|i| {
                let at =
                    (DVec2::new((i % width) as f64, (i / width) as f64) + 0.5 + plan.origin) / plan.per_mm;
                let c = at.x * plan.across + at.y * plan.down;
                let (world, direction) = (self.world(c), self.turned(self.light));
                let (near, far) = self.span(&Ray { origin_mm: world, direction });
                // From the eye's plane or from far away.
                let to_eye = (-self.reference_mm - c.z) / self.light.z;
                // The scenes of the tests are smaller.
                let begin = if self.light.z > 1e-12 { to_eye.max(-60.0) } else { -60.0 };
                let length = if self.light.z < -1e-12 { (to_eye - begin).clamp(0.0, 120.0) } else { 120.0 };
                let ray = Ray { origin_mm: world + begin * direction, direction };
                let hit = begin + self.to_masks(&ray, length);
                let hit = case.normal.dot(c) + hit * case.normal.dot(self.light);
                Texel { light: 1.0, near, far, hit }
            })
            .collect()
    }

    /// Radiance and transmittance of every pixel of the image, rows from the top, before what is opaque at these view depths
    /// from the eye (infinite where nothing is).
    pub fn slabs(&self, plan: &HalfAnglePlan, opaque_mm: &[f64], strength: f64) -> Vec<[f64; 4]> {
        let pixels = self.sight.size[0] as usize * self.sight.size[1] as usize;
        let mut out = vec![[0.0; 4]; pixels];
        for case in &plan.cases {
            for (sum, found) in out.iter_mut().zip(self.case(plan, case, opaque_mm, strength)) {
                (0..4).for_each(|c| sum[c] += case.weight * found[c]);
            }
        }
        out
    }

    fn case(&self, plan: &HalfAnglePlan, case: &Case, opaque_mm: &[f64], strength: f64) -> Vec<[f64; 4]> {
        let width = self.sight.size[0] as usize;
        let mut eyes = vec![[0.0, 0.0, 0.0, 1.0]; opaque_mm.len()];
        let mut lights = self.begin_light(plan, case);
        for slab in &case.slabs {
            let before = &lights;
            eyes.par_iter_mut().enumerate().for_each(|(i, eye)| {
                let pixel = [(i % width) as u32, (i / width) as u32];
                self.eye(plan, case, slab.front, before, (pixel, opaque_mm[i]), strength, eye);
            });
            let across = plan.texels[0] as usize;
            lights.par_iter_mut().enumerate().for_each(|(i, texel)| {
                let at = DVec2::new((i % across) as f64, (i / across) as f64) + 0.5 + plan.origin;
                let c = (at.x * plan.across + at.y * plan.down) / plan.per_mm;
                let rate = case.normal.dot(self.light);
                let front = (slab.front - case.normal.dot(c)) / rate;
                let (begin, end) = (front.max(texel.near), (front + plan.slab_mm / rate).min(texel.far));
                if begin < end {
                    let at_mm = self.world(c + 0.5 * (begin + end) * self.light);
                    texel.light *= (-self.extinction(at_mm) * (end - begin)).exp();
                }
            });
        }
        eyes
    }

    #[allow(clippy::too_many_arguments, reason = "a pixel of a slab of a case of a plan")]
    fn eye(
        &self,
        plan: &HalfAnglePlan,
        case: &Case,
        front: f64,
        lights: &[Texel],
        (pixel, opaque_mm): ([u32; 2], f64),
        strength: f64,
        eye: &mut [f64; 4],
    ) {
        let slant = self.sight.slant(pixel);
        let origin_mm = self.sight.at_mm(pixel, 0.0);
        let direction = (self.sight.at_mm(pixel, 1.0) - origin_mm) / slant;
        let Some((near, far)) = visible_interval(self.scene, &Ray { origin_mm, direction }) else { return };
        let (near, far) = (near / slant, (far / slant).min(opaque_mm));
        // In camera space, by depth from the eye.
        let point = |depth: f64| {
            (self.sight.from_middle(pixel) * self.sight.pixel_mm(depth)).extend(depth - self.reference_mm)
        };
        let rate = case.normal.dot(point(1.0) - point(0.0));
        let at = (front - case.normal.dot(point(0.0))) / rate;
        let back = at + plan.slab_mm / rate;
        let (near, far) = (near.max(at.min(back)), far.min(at.max(back)));
        if near >= far {
            return;
        }
        let c = point(0.5 * (near + far));
        let (color, per_mm) = self.material(self.world(c));
        let thickness = -(1.0 - per_mm).max(1e-30).ln() * (far - near);
        let (seen, lit) = (thickness * slant, thickness * rate.abs() / case.normal.dot(self.light));
        if seen <= 0.0 {
            return;
        }
        let place = DVec2::new(c.dot(plan.across), c.dot(plan.down)) * plan.per_mm - plan.origin - 0.5;
        let (low, f) = (place.floor(), place - place.floor());
        let along = c.dot(case.normal);
        let texel = |x: f64, y: f64| {
            let most = plan.texels.map(|t| f64::from(t) - 1.0);
            let (x, y) = ((low.x + x).clamp(0.0, most[0]), (low.y + y).clamp(0.0, most[1]));
            let texel = lights[y as usize * plan.texels[0] as usize + x as usize];
            if texel.hit + self.shift_mm < along { 0.0 } else { texel.light }
        };
        let light = (1.0 - f.y) * ((1.0 - f.x) * texel(0.0, 0.0) + f.x * texel(1.0, 0.0))
            + f.y * ((1.0 - f.x) * texel(0.0, 1.0) + f.x * texel(1.0, 1.0));
        // Light scattered to the eye over a homogeneous slab, by Simpson's rule instead of its closed form.
        let steps = 40;
        let scattered: f64 = (0..=steps)
            .map(|i| {
                let t = f64::from(i) / f64::from(steps);
                let passed = if case.ahead { t } else { 1.0 - t };
                let weight = if i == 0 || i == steps { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
                weight / (3.0 * f64::from(steps)) * seen * (-seen * t - lit * passed).exp()
            })
            .sum();
        let shown = strength * light * scattered - (1.0 - strength) * (-seen).exp_m1();
        let [.., transmittance] = *eye;
        for (value, color) in eye.iter_mut().zip(color) {
            let here = srgb::decode(color) * shown;
            *value = if case.ahead { *value + transmittance * here } else { here + (-seen).exp() * *value };
        }
        eye[3] = transmittance * (-seen).exp();
    }

    /// Share of the lamp's light that reaches a point of opaque geometry in camera space with this normal, past the masks
    /// within `far_mm` and through the image in these steps.
    pub fn on_opaque(&self, c: DVec3, normal: DVec3, far_mm: f64, step_mm: f64) -> f64 {
        let facing = -normal.dot(self.light);
        let direction = -self.turned(self.light);
        let (at_mm, outwards) = (self.world(c), self.turned(normal));
        if facing <= 0.0 {
            return 0.0;
        }
        // To the eye's plane.
        let from_plane = self.sight.depth_mm(at_mm);
        let to_eye = if self.light.z > 0.0 { from_plane / self.light.z } else { f64::INFINITY };
        if let Some(voxels) = &self.voxels {
            let origin_mm = at_mm + outwards * voxels.step_height_mm(outwards);
            let to_eye = to_eye * self.sight.depth_mm(origin_mm) / from_plane;
            if voxels.hidden(&Ray { origin_mm, direction }, far_mm.min(to_eye).clamp(0.0, 60.0)) {
                return 0.0;
            }
        }
        let (near, far) = self.span(&Ray { origin_mm: at_mm, direction });
        let (mut t, mut thickness) = (near.max(0.0), 0.0);
        while t < far {
            let end = far.min(t + step_mm);
            thickness += self.extinction(at_mm + 0.5 * (t + end) * direction) * (end - t);
            t = end;
        }
        facing * (-thickness).exp()
    }
}

/// Linear radiance of each pixel in the light of a lamp, unlit tissue black: the exact integral of single scattering.
pub fn exact(scene: &ContextScene, lamp: Lamp, size: [u32; 2]) -> Vec<DVec3> {
    let medium = scene.medium().unwrap();
    let towards = lamp.direction(&scene.camera);
    let light = |at_mm: DVec3| {
        (-medium.thickness(&Ray { origin_mm: at_mm, direction: towards }, f64::INFINITY)).exp()
    };
    (0..size[0] * size[1])
        .into_par_iter()
        .map(|i| {
            let pixel = DVec2::new(f64::from(i % size[0]), f64::from(i / size[0])) + 0.5;
            let ray = scene.camera.ray(pixel, DVec2::new(f64::from(size[0]), f64::from(size[1])));
            converged(&medium, &ray, 1.0, 1e-4, &light, DVec3::ZERO).radiance
        })
        .collect()
}

/// Root mean square difference from the exact integral of the same light, of pixels with opacity above 0.01.
pub fn error(found: &[[f64; 4]], truth: &[DVec3]) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (found, truth) in found.iter().zip(truth).filter(|(f, _)| f[3] > 0.01) {
        sum += (DVec3::new(found[0], found[1], found[2]) - *truth).length_squared();
        n += 3.0;
    }
    assert!(n > 300.0, "{n}");
    f64::sqrt(sum / n)
}
