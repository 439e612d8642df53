//! Where panes are: the default is Fig. 7.1's arrangement.

use egui_tiles::{Container, Linear, LinearDir, Tiles, Tree};
use glioscope_render::slices::Plane;

use crate::document::Pane;

/// Closeup over context at the left, ellipsoids over the overlap diagram with its table (behind it what
/// is in the lens, and the measurements), three slices at the right. With several dates the change view
/// is behind the closeup, and the dates behind the context view.
pub fn default_layout(dates: usize) -> Tree<Pane> {
    let mut tiles = Tiles::default();
    let views = [Pane::Closeup, Pane::Context, Pane::Ellipsoids];
    let [closeup, context, ellipsoids] = views.map(|pane| tiles.insert_pane(pane));
    let (closeup, context) = match dates {
        0 | 1 => (closeup, context),
        _ => {
            let others = [Pane::Change, Pane::Dates].map(|pane| tiles.insert_pane(pane));
            (tiles.insert_tab_tile(vec![closeup, others[0]]), tiles.insert_tab_tile(vec![context, others[1]]))
        }
    };
    let numbers = [Pane::Overlap, Pane::Lens, Pane::Measurements].map(|pane| tiles.insert_pane(pane));
    let overlap = tiles.insert_tab_tile(numbers.to_vec());
    let slices =
        [Plane::Axial, Plane::Coronal, Plane::Sagittal].map(|plane| tiles.insert_pane(Pane::Slice(plane)));
    let right = linear(&mut tiles, LinearDir::Vertical, &slices.map(|s| (s, 1.0)));
    let left = linear(&mut tiles, LinearDir::Vertical, &[(closeup, 1.25), (context, 1.0)]);
    let middle = linear(&mut tiles, LinearDir::Vertical, &[(ellipsoids, 1.0), (overlap, 1.55)]);
    let root = linear(&mut tiles, LinearDir::Horizontal, &[(left, 1.25), (middle, 1.0), (right, 0.85)]);
    Tree::new(egui::Id::unique("layout"), root, tiles)
}

fn linear(
    tiles: &mut Tiles<Pane>,
    dir: LinearDir,
    children: &[(egui_tiles::TileId, f32)],
) -> egui_tiles::TileId {
    let mut container = Linear::new(dir, children.iter().map(|c| c.0).collect());
    for &(child, share) in children {
        container.shares.set_share(child, share);
    }
    tiles.insert_container(Container::Linear(container))
}

/// One pane alone over the whole window.
pub fn single(pane: Pane) -> Tree<Pane> {
    let mut tiles = Tiles::default();
    let root = tiles.insert_pane(pane);
    Tree::new(egui::Id::unique("layout"), root, tiles)
}

/// Whether `pane` has a place in `layout`.
pub fn contains(layout: &Tree<Pane>, pane: Pane) -> bool {
    layout.tiles.find_pane(&pane).is_some()
}

/// Gives `pane` a place at the right, or takes it away.
pub fn toggle(layout: &mut Tree<Pane>, pane: Pane) {
    if let Some(tile) = layout.tiles.find_pane(&pane) {
        layout.remove_recursively(tile);
    } else {
        let tile = layout.tiles.insert_pane(pane);
        match layout.root() {
            Some(root) => layout.move_tile_to_container(tile, root, usize::MAX, true),
            None => *layout = single(pane),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_has_every_view_and_toggling_undoes_itself() {
        let mut layout = default_layout(1);
        for pane in
            [Pane::Closeup, Pane::Context, Pane::Ellipsoids, Pane::Overlap, Pane::Slice(Plane::Coronal)]
        {
            assert!(contains(&layout, pane));
        }
        assert!(!contains(&layout, Pane::Diagnostics));
        toggle(&mut layout, Pane::Diagnostics);
        assert!(contains(&layout, Pane::Diagnostics));
        toggle(&mut layout, Pane::Diagnostics);
        assert!(!contains(&layout, Pane::Diagnostics));
    }
}
