//! Checks that every struct in a shader's buffers has the same layout in Rust and WGSL: offsets and sizes from naga's
//! reflection. Each module lists its structs; lighting modes in their rows, views in [`crate::views::VIEW_LAYOUTS`].

use std::collections::BTreeMap;

use naga::TypeInner;

use crate::{force_field, image, light::LIGHTS, solid, views::VIEW_LAYOUTS};

/// A struct's layout in Rust: its name in WGSL, its size in bytes, its fields with their offsets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub name: &'static str,
    pub bytes: usize,
    pub fields: &'static [(&'static str, usize)],
}

/// `layout!(RustType, "WgslName": field, …)`: every field must be listed, as the test compares them all.
macro_rules! layout {
    ($t:ty, $name:literal: $($field:ident),* $(,)?) => {
        crate::layouts::Layout {
            name: $name,
            bytes: size_of::<$t>(),
            fields: &[$((stringify!($field), std::mem::offset_of!($t, $field))),*],
        }
    };
}
pub(crate) use layout;

fn all() -> impl Iterator<Item = &'static Layout> {
    let modules = [solid::LAYOUTS, image::uniforms::LAYOUTS, force_field::LAYOUTS];
    let lights = LIGHTS.iter().flat_map(|row| row.suite.layouts);
    modules.into_iter().flatten().chain(lights).chain(VIEW_LAYOUTS.iter().copied().flatten())
}

/// Structs that a buffer's type contains, itself included.
fn structs_of(
    module: &naga::Module,
    ty: naga::Handle<naga::Type>,
    found: &mut Vec<naga::Handle<naga::Type>>,
) {
    match &module.types[ty].inner {
        TypeInner::Array { base, .. } => structs_of(module, *base, found),
        TypeInner::Struct { members, .. } if !found.contains(&ty) => {
            found.push(ty);
            members.iter().for_each(|member| structs_of(module, member.ty, found));
        }
        _ => {}
    }
}

#[test]
fn struct_layouts_match_between_rust_and_wgsl() {
    let layouts: BTreeMap<&str, &Layout> = all().map(|layout| (layout.name, layout)).collect();
    let mut uses: BTreeMap<&str, usize> = layouts.keys().map(|name| (*name, 0)).collect();
    let mut mismatches = Vec::new();
    for entry in glioscope_shaders::entry_points() {
        let module = naga::front::wgsl::parse_str(&glioscope_shaders::compose(entry).unwrap()).unwrap();
        let mut structs = Vec::new();
        for (_, global) in module.global_variables.iter().filter(|(_, global)| global.binding.is_some()) {
            structs_of(&module, global.ty, &mut structs);
        }
        for ty in structs {
            let (name, TypeInner::Struct { members, span }) =
                (module.types[ty].name.as_deref().unwrap_or("unnamed"), &module.types[ty].inner)
            else {
                unreachable!("structs only")
            };
            let Some(layout) = layouts.get(name) else {
                mismatches.push(format!("{entry}: {name} is bound but not listed"));
                continue;
            };
            *uses.get_mut(layout.name).unwrap() += 1;
            let found: Vec<(&str, usize)> =
                members.iter().map(|m| (m.name.as_deref().unwrap_or(""), m.offset as usize)).collect();
            if (layout.bytes, layout.fields) != (*span as usize, &found[..]) {
                mismatches.push(format!(
                    "{entry}: {name} is {layout:?} in Rust, {span} bytes and {found:?} in WGSL"
                ));
            }
        }
    }
    mismatches
        .extend(uses.iter().filter(|(_, n)| **n == 0).map(|(name, _)| format!("{name}: no shader binds it")));
    assert!(mismatches.is_empty(), "{}", mismatches.join("\n"));
}
