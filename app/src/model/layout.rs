//! The layout of panes; the default follows the thesis's Fig. 7.1.

use super::pane::PaneId;
use egui_tiles::{Container, Linear, LinearDir, Tiles, Tree};

/// Left: closeup above context view. Middle: ellipsoid diagram above overlap diagram, with the lens and measurements
/// panes as tabs behind it. Right: the three slices. With several time points, the change view is a tab behind the
/// closeup, and the dates pane one behind the context view.
pub fn default_layout(time_point_count: usize) -> Tree<PaneId> {
    let mut tiles = Tiles::default();
    let views = [PaneId::Closeup, PaneId::Context, PaneId::Ellipsoids];
    let [closeup, context, ellipsoids] = views.map(|pane| tiles.insert_pane(pane));
    let (closeup, context) = match time_point_count {
        0 | 1 => (closeup, context),
        _ => {
            let behind = [PaneId::Change, PaneId::Dates].map(|pane| tiles.insert_pane(pane));
            (tiles.insert_tab_tile(vec![closeup, behind[0]]), tiles.insert_tab_tile(vec![context, behind[1]]))
        }
    };
    let numbers = [PaneId::Overlap, PaneId::Lens, PaneId::Measurements].map(|pane| tiles.insert_pane(pane));
    let overlap = tiles.insert_tab_tile(numbers.to_vec());
    let slices = [PaneId::Axial, PaneId::Coronal, PaneId::Sagittal].map(|pane| tiles.insert_pane(pane));
    let right = linear(&mut tiles, LinearDir::Vertical, &slices.map(|s| (s, 1.0)));
    let left = linear(&mut tiles, LinearDir::Vertical, &[(closeup, 1.25), (context, 1.0)]);
    let middle = linear(&mut tiles, LinearDir::Vertical, &[(ellipsoids, 1.0), (overlap, 1.55)]);
    let root = linear(&mut tiles, LinearDir::Horizontal, &[(left, 1.25), (middle, 1.0), (right, 0.85)]);
    Tree::new(egui::Id::unique("layout"), root, tiles)
}

fn linear(
    tiles: &mut Tiles<PaneId>,
    dir: LinearDir,
    children: &[(egui_tiles::TileId, f32)],
) -> egui_tiles::TileId {
    let mut container = Linear::new(dir, children.iter().map(|c| c.0).collect());
    for &(child, share) in children {
        container.shares.set_share(child, share);
    }
    tiles.insert_container(Container::Linear(container))
}

/// A single pane that fills the window.
pub fn single(pane: PaneId) -> Tree<PaneId> {
    let mut tiles = Tiles::default();
    let root = tiles.insert_pane(pane);
    Tree::new(egui::Id::unique("layout"), root, tiles)
}

/// Whether `layout` contains `pane`.
pub fn contains(layout: &Tree<PaneId>, pane: PaneId) -> bool {
    layout.tiles.find_pane(&pane).is_some()
}

/// Adds `pane` at the end of the root container, or removes it where it is present.
pub fn toggle(layout: &mut Tree<PaneId>, pane: PaneId) {
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
    fn default_layout_has_the_main_views_and_toggling_twice_restores_it() {
        let mut layout = default_layout(1);
        for pane in [PaneId::Closeup, PaneId::Context, PaneId::Ellipsoids, PaneId::Overlap, PaneId::Coronal] {
            assert!(contains(&layout, pane));
        }
        assert!(!contains(&layout, PaneId::Diagnostics));
        toggle(&mut layout, PaneId::Diagnostics);
        assert!(contains(&layout, PaneId::Diagnostics));
        toggle(&mut layout, PaneId::Diagnostics);
        assert!(!contains(&layout, PaneId::Diagnostics));
    }
}
