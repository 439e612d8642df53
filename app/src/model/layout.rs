//! Where panes are: the default is Fig. 7.1's arrangement.

use super::pane::PaneId;
use egui_tiles::{Container, Linear, LinearDir, Tiles, Tree};

/// Closeup over context at the left, ellipsoids over the overlap diagram with its table (behind it what
/// is in the lens, and the measurements), three slices at the right. With several dates the change view
/// is behind the closeup, and the dates behind the context view.
pub fn default_layout(dates: usize) -> Tree<PaneId> {
    let mut tiles = Tiles::default();
    let views = [PaneId::Closeup, PaneId::Context, PaneId::Ellipsoids];
    let [closeup, context, ellipsoids] = views.map(|pane| tiles.insert_pane(pane));
    let (closeup, context) = match dates {
        0 | 1 => (closeup, context),
        _ => {
            let others = [PaneId::Change, PaneId::Dates].map(|pane| tiles.insert_pane(pane));
            (tiles.insert_tab_tile(vec![closeup, others[0]]), tiles.insert_tab_tile(vec![context, others[1]]))
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

/// One pane alone over the whole window.
pub fn single(pane: PaneId) -> Tree<PaneId> {
    let mut tiles = Tiles::default();
    let root = tiles.insert_pane(pane);
    Tree::new(egui::Id::unique("layout"), root, tiles)
}

/// Whether `pane` has a place in `layout`.
pub fn contains(layout: &Tree<PaneId>, pane: PaneId) -> bool {
    layout.tiles.find_pane(&pane).is_some()
}

/// Gives `pane` a place at the right, or takes it away.
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
    fn the_default_has_every_view_and_toggling_undoes_itself() {
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
