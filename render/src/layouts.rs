//! Every struct of every shader's buffers is laid out as Rust has it: offsets and sizes from naga's reflection. Each
//! room lists its structs beside them; lights in their rows, views in [`crate::views::VIEW_LAYOUTS`].

use std::collections::BTreeMap;

use naga::TypeInner;

use crate::{force_field, image, light::LIGHTS, solid, views::VIEW_LAYOUTS};

/// A struct as Rust lays it out: its name in WGSL, its bytes, its fields with their offsets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub name: &'static str,
    pub bytes: usize,
    pub fields: &'static [(&'static str, usize)],
}

/// `layout!(Rust, "Name": field, …)`: every field must be named, or the bytes won't add up.
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
    let rooms = [solid::LAYOUTS, image::uniforms::LAYOUTS, force_field::LAYOUTS];
    let lights = LIGHTS.iter().flat_map(|row| row.suite.layouts);
    rooms.into_iter().flatten().chain(lights).chain(VIEW_LAYOUTS.iter().copied().flatten())
}

/// Structs that a buffer's type holds, itself included.
fn structs_of(
    module: &naga::Module,
    ty: naga::Handle<naga::Type>,
    found: &mut Vec<naga::Handle<naga::Type>>,
) {
    match &module.types[ty].inner {
        TypeInner::Array { base, .. } => structs_of(module, *base, found),
        TypeInner::Struct { members, .. } => {
            if !found.contains(&ty) {
                found.push(ty);
                members.iter().for_each(|member| structs_of(module, member.ty, found));
            }
        }
        _ => {}
    }
}

#[test]
fn rust_and_wgsl_lay_structs_out_alike() {
    let known: BTreeMap<&str, &Layout> = all().map(|layout| (layout.name, layout)).collect();
    let mut used: BTreeMap<&str, usize> = known.keys().map(|name| (*name, 0)).collect();
    let mut wrong = Vec::new();
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
            let Some(layout) = known.get(name) else {
                wrong.push(format!("{entry}: {name} is bound and in no list"));
                continue;
            };
            *used.get_mut(layout.name).unwrap() += 1;
            let found: Vec<(&str, usize)> =
                members.iter().map(|m| (m.name.as_deref().unwrap_or(""), m.offset as usize)).collect();
            if (layout.bytes, layout.fields) != (*span as usize, &found[..]) {
                wrong.push(format!(
                    "{entry}: {name} is {layout:?} in Rust, {span} bytes and {found:?} in WGSL"
                ));
            }
        }
    }
    wrong
        .extend(used.iter().filter(|(_, n)| **n == 0).map(|(name, _)| format!("{name}: no shader binds it")));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
