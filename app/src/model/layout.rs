//! The layout of panes; the default follows the thesis's Fig. 7.1.

use super::{fusion::is_pet, pane::PaneId};
use egui_tiles::{Container, Linear, LinearDir, Tile, TileId, Tiles, Tree};
use glioscope_core::case::{Case, TimePoint};
use strum::VariantArray;

/// What a case holds, by which its panes are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Held {
    /// Number of dates.
    pub dates: usize,
    /// Most images of a date.
    pub images: usize,
    /// Whether one of them but the first is PET, by its name.
    pub has_pet: bool,
    /// Most masks of a date.
    pub masks: usize,
}

impl Held {
    /// What so many dates hold, of which this is one.
    pub fn at(time_point: &TimePoint, dates: usize) -> Self {
        Self {
            dates,
            images: time_point.contexts.len(),
            has_pet: time_point.contexts.iter().skip(1).any(|context| is_pet(&context.id)),
            masks: time_point.masks.len(),
        }
    }

    /// What a case holds.
    pub fn of(case: &Case) -> Self {
        let all = || case.time_points.iter().map(|time| Self::at(time, case.time_points.len()));
        Self {
            dates: case.time_points.len(),
            images: all().map(|held| held.images).max().unwrap_or_default(),
            has_pet: all().any(|held| held.has_pet),
            masks: all().map(|held| held.masks).max().unwrap_or_default(),
        }
    }
}

/// The panes that a case opens with: of one date with PET and another image, and at most one mask, *PET and MR*; without a mask *Read*; of
/// several dates with images and one mask *Follow-up*; else [`default_layout`].
pub fn opening(held: Held) -> Tree<PaneId> {
    opening_task(held).map_or_else(|| default_layout(held), |task| task.layout(held))
}

/// Whether a layout is still that with which a case opens, as far as a reader sees.
pub fn is_as_opened(layout: &Tree<PaneId>, held: Held) -> bool {
    is_same(layout, &opening(held))
}

/// Whether two layouts are the same, as far as a reader sees.
pub fn is_same(a: &Tree<PaneId>, b: &Tree<PaneId>) -> bool {
    simplified(a.clone()) == simplified(b.clone())
}

/// As drawing it does.
fn simplified(mut layout: Tree<PaneId>) -> Tree<PaneId> {
    let options = egui_tiles::SimplificationOptions {
        all_panes_must_have_tabs: true,
        ..egui_tiles::SimplificationOptions::default()
    };
    layout.simplify(&options);
    layout
}

/// The task that a case is opened for; `None`: the default.
pub fn opening_task(held: Held) -> Option<Task> {
    match held {
        Held { dates: 2.., images: 1.., masks: 1, .. } => Some(Task::FollowUp),
        Held { dates: 2.., .. } => None,
        Held { images: 1.., masks: 0, .. } => Some(Task::Read),
        Held { images: 2.., has_pet: true, masks: 1, .. } => Some(Task::Fusion),
        _ => None,
    }
}

/// Panes by what the case holds. Right: the three slices. With one time point, left the closeup above the context view,
/// in the middle the ellipsoid diagram above the overlap diagram. With several, the change view takes the closeup's
/// place, the closeup that of the ellipsoid diagram, and ellipsoid diagram, dates, lesions and response are tabs behind closeup
/// and context view. Without an image there is no context view. The lens and measurements panes are tabs behind the overlap
/// diagram, which is low where one mask leaves it only its size.
pub fn default_layout(held: Held) -> Tree<PaneId> {
    let mut tiles = Tiles::default();
    let views = [PaneId::Closeup, PaneId::Ellipsoids];
    let [closeup, ellipsoids] = views.map(|pane| tiles.insert_pane(pane));
    let mut below: Vec<TileId> =
        (held.images > 0).then(|| tiles.insert_pane(PaneId::Context)).into_iter().collect();
    let (first, second) = if held.dates < 2 {
        (closeup, ellipsoids)
    } else {
        let more = [PaneId::Change, PaneId::Dates, PaneId::Lesions, PaneId::Response];
        let [change, dates, lesions, response] = more.map(|pane| tiles.insert_pane(pane));
        below.extend([dates, lesions, response]);
        (change, tiles.insert_tab_tile(vec![closeup, ellipsoids]))
    };
    let below = match below[..] {
        [] => None,
        [only] => Some(only),
        _ => Some(tiles.insert_tab_tile(below)),
    };
    let numbers = [PaneId::Overlap, PaneId::Lens, PaneId::Measurements].map(|pane| tiles.insert_pane(pane));
    let overlap = tiles.insert_tab_tile(numbers.to_vec());
    let overlap_share = if held.masks < 2 { 0.4 } else { 1.55 };
    let slices = [PaneId::Axial, PaneId::Coronal, PaneId::Sagittal].map(|pane| tiles.insert_pane(pane));
    let right = linear(&mut tiles, LinearDir::Vertical, &slices.map(|s| (s, 1.0)));
    let left: Vec<(TileId, f32)> =
        std::iter::once((first, 1.25)).chain(below.map(|below| (below, 1.0))).collect();
    let left = linear(&mut tiles, LinearDir::Vertical, &left);
    let middle = linear(&mut tiles, LinearDir::Vertical, &[(second, 1.0), (overlap, overlap_share)]);
    let root = linear(&mut tiles, LinearDir::Horizontal, &[(left, 1.25), (middle, 1.0), (right, 0.85)]);
    Tree::new(egui::Id::unique("layout"), root, tiles)
}

/// Arrangements of panes by what a reader does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, VariantArray)]
pub enum Task {
    /// Several masks of one date.
    CompareMasks,
    /// Several dates.
    FollowUp,
    /// What a reader states at the end: lesions, response, report.
    Response,
    /// Several images over each other.
    Fusion,
    /// To a patient or a colleague.
    Explain,
    /// Slices alone.
    Read,
}

impl Task {
    /// Its name in the menu.
    pub fn name(self) -> &'static str {
        match self {
            Self::CompareMasks => "Compare masks",
            Self::FollowUp => "Follow-up",
            Self::Response => "Response",
            Self::Fusion => "PET and MR",
            Self::Explain => "Explain",
            Self::Read => "Read",
        }
    }

    /// What it shows.
    pub fn detail(self) -> &'static str {
        match self {
            Self::CompareMasks => "Closeup, anatomy, ellipsoids, overlaps and slices of one date",
            Self::FollowUp => "Change in front, prior and current slices side by side",
            Self::Response => "Response by criteria, lesions, prior and current slices side by side",
            Self::Fusion => "Large slices with a second image over the first, and the anatomy",
            Self::Explain => "Ellipsoids, the tumour and its anatomy, without tables",
            Self::Read => "Slices only",
        }
    }

    /// Whether a case has anything to show in it.
    pub fn suits(self, held: Held) -> bool {
        let Held { dates, images, masks, .. } = held;
        match self {
            Self::CompareMasks => masks > 1,
            Self::FollowUp | Self::Response => dates > 1,
            Self::Fusion => images > 1,
            Self::Explain => masks > 0,
            Self::Read => images > 0,
        }
    }

    /// Its panes.
    pub fn layout(self, held: Held) -> Tree<PaneId> {
        use PaneId as P;
        let mut tiles = Tiles::default();
        let mut pane = |pane| tiles.insert_pane(pane);
        let [axial, coronal, sagittal] = SLICES.map(&mut pane);
        let rows = |tiles: &mut Tiles<PaneId>, all: &[(TileId, f32)]| linear(tiles, LinearDir::Vertical, all);
        let columns =
            |tiles: &mut Tiles<PaneId>, all: &[(TileId, f32)]| linear(tiles, LinearDir::Horizontal, all);
        let root = match self {
            Self::CompareMasks => return default_layout(Held { dates: 1, ..held }),
            Self::FollowUp => {
                let [change, side] = [P::Change, P::SideBySide].map(|pane| tiles.insert_pane(pane));
                let closeup = tiles.insert_pane(P::Closeup);
                let context = (held.images > 0).then(|| tiles.insert_pane(P::Context));
                let change =
                    tiles.insert_tab_tile([change, closeup].into_iter().chain(context).collect::<Vec<_>>());
                let numbers =
                    [P::Dates, P::Lesions, P::Response, P::Overlap].map(|pane| tiles.insert_pane(pane));
                let numbers = tiles.insert_tab_tile(numbers.to_vec());
                let left = rows(&mut tiles, &[(change, 1.3), (numbers, 1.0)]);
                let below = columns(&mut tiles, &[(axial, 1.0), (coronal, 1.0), (sagittal, 1.0)]);
                let right = rows(&mut tiles, &[(side, 1.3), (below, 1.0)]);
                columns(&mut tiles, &[(left, 1.0), (right, 1.6)])
            }
            Self::Response => {
                let _ = [axial, coronal, sagittal].map(|tile| tiles.remove(tile));
                let [response, lesions, side, change] =
                    [P::Response, P::Lesions, P::SideBySide, P::Change].map(|pane| tiles.insert_pane(pane));
                let left = rows(&mut tiles, &[(response, 1.6), (lesions, 1.0)]);
                let right = rows(&mut tiles, &[(side, 1.2), (change, 1.0)]);
                columns(&mut tiles, &[(left, 1.25), (right, 1.0)])
            }
            Self::Fusion => {
                let [context, overlap] = [P::Context, P::Overlap].map(|pane| tiles.insert_pane(pane));
                let middle = rows(&mut tiles, &[(coronal, 1.0), (sagittal, 1.0)]);
                let right = rows(&mut tiles, &[(context, 1.2), (overlap, 1.0)]);
                columns(&mut tiles, &[(axial, 1.6), (middle, 0.9), (right, 1.0)])
            }
            Self::Explain => {
                let [ellipsoids, closeup] = [P::Ellipsoids, P::Closeup].map(|pane| tiles.insert_pane(pane));
                let context = (held.images > 0).then(|| (tiles.insert_pane(P::Context), 1.0));
                let right: Vec<_> = context.into_iter().chain([(axial, 1.0)]).collect();
                let right = rows(&mut tiles, &right);
                let left = rows(&mut tiles, &[(ellipsoids, 1.0), (closeup, 1.0)]);
                let _ = [coronal, sagittal].map(|tile| tiles.remove(tile));
                columns(&mut tiles, &[(left, 1.4), (right, 1.0)])
            }
            Self::Read => {
                let slices = [(axial, 1.0), (coronal, 1.0), (sagittal, 1.0)];
                let all = columns(&mut tiles, &slices);
                if held.dates < 2 {
                    all
                } else {
                    let side = tiles.insert_pane(P::SideBySide);
                    rows(&mut tiles, &[(side, 1.2), (all, 1.0)])
                }
            }
        };
        Tree::new(egui::Id::unique("layout"), root, tiles)
    }
}

fn linear(tiles: &mut Tiles<PaneId>, dir: LinearDir, children: &[(TileId, f32)]) -> TileId {
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

/// The slices from top to bottom.
const SLICES: [PaneId; 3] = [PaneId::Axial, PaneId::Coronal, PaneId::Sagittal];

/// Adds `pane` as a tab beside a pane of its kind, in front, so that no other pane gets smaller, and a slice above or
/// below the other slices; or removes it where it is present.
pub fn toggle(layout: &mut Tree<PaneId>, pane: PaneId) {
    if let Some(tile) = layout.tiles.find_pane(&pane) {
        layout.remove_recursively(tile);
        return;
    }
    let tile = layout.tiles.insert_pane(pane);
    let others = neighbours(pane).iter().filter(|of| **of != pane);
    let neighbour = others.into_iter().find_map(|of| layout.tiles.find_pane(of));
    if let (Some(own), Some(neighbour)) = (row_of(pane), neighbour) {
        place_slice(layout, tile, own, neighbour);
        return;
    }
    let tabs = neighbour.and_then(|neighbour| {
        let parent = layout.tiles.parent_of(neighbour)?;
        matches!(layout.tiles.get_container(parent), Some(Container::Tabs(_))).then_some(parent)
    });
    match (tabs, neighbour, layout.root()) {
        (Some(tabs), ..) => layout.move_tile_to_container(tile, tabs, usize::MAX, false),
        (None, Some(neighbour), _) => wrap_in_tabs(layout, neighbour, tile),
        (None, None, Some(root)) => layout.move_tile_to_container(tile, root, usize::MAX, true),
        (None, None, None) => *layout = single(pane),
    }
    layout.make_active(|id, _| id == tile);
}

/// Panes of the same kind as `pane`, the nearest first.
fn neighbours(pane: PaneId) -> &'static [PaneId] {
    use PaneId as P;
    match pane {
        P::Closeup => &[P::Change, P::Ellipsoids, P::Context],
        P::Change => &[P::Closeup, P::Context],
        P::Context | P::Dates => &[P::Context, P::Dates, P::Lesions, P::Closeup],
        P::Lesions | P::Response => &[P::Lesions, P::Response, P::Dates, P::Context, P::Closeup],
        P::Ellipsoids => &[P::Closeup, P::Overlap],
        P::SideBySide => &[P::Change, P::Closeup, P::Context],
        P::Axial => &[P::Coronal, P::Sagittal],
        P::Coronal => &[P::Axial, P::Sagittal],
        P::Sagittal => &[P::Coronal, P::Axial],
        _ => &[P::Overlap, P::Lens, P::Measurements, P::Ellipsoids],
    }
}

/// The row of a slice among [`SLICES`]; `None` for other panes.
fn row_of(pane: PaneId) -> Option<usize> {
    SLICES.iter().position(|slice| *slice == pane)
}

/// Puts the slice of row `own` above or below the slice `neighbour`, in their column; a column is made where there is none
/// left.
fn place_slice(layout: &mut Tree<PaneId>, tile: TileId, own: usize, neighbour: TileId) {
    let below = layout.tiles.get_pane(&neighbour).is_some_and(|slice| row_of(*slice) < Some(own));
    let mut child = neighbour;
    let parent = loop {
        let parent = layout.tiles.parent_of(child);
        match parent.and_then(|parent| layout.tiles.get_container(parent)) {
            Some(Container::Linear(linear)) if linear.dir == LinearDir::Vertical => {
                let index = linear.children.iter().position(|c| *c == child).unwrap_or_default();
                if let Some(column) = parent {
                    layout.move_tile_to_container(tile, column, index + usize::from(below), true);
                }
                return;
            }
            Some(Container::Tabs(_)) => child = parent.unwrap_or(child),
            _ => break parent,
        }
    };
    let rows = if below { [child, tile] } else { [tile, child] };
    let column = linear(&mut layout.tiles, LinearDir::Vertical, &rows.map(|row| (row, 1.0)));
    replace(layout, parent, child, column);
}

/// Puts `new` in the place of `old`, a child of `parent` or the root.
fn replace(layout: &mut Tree<PaneId>, parent: Option<TileId>, old: TileId, new: TileId) {
    match parent.and_then(|parent| layout.tiles.get_mut(parent)) {
        Some(Tile::Container(container)) => {
            let _ = container.replace_child(old, new);
        }
        _ => layout.root = Some(new),
    }
}

/// Puts `tile` as a tab behind `neighbour`, which has none yet.
fn wrap_in_tabs(layout: &mut Tree<PaneId>, neighbour: TileId, tile: TileId) {
    let parent = layout.tiles.parent_of(neighbour);
    let tabs = layout.tiles.insert_tab_tile(vec![neighbour, tile]);
    replace(layout, parent, neighbour, tabs);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(dates: usize, images: usize, masks: usize) -> Held {
        Held { dates, images, has_pet: false, masks }
    }

    #[test]
    fn a_case_opens_with_what_it_holds() {
        use PaneId as P;
        let shows = |held, pane| contains(&opening(held), pane);
        // Without an image no context view, in no layout.
        for dates in [1, 3] {
            for masks in [1, 3] {
                assert!(!shows(held(dates, 0, masks), P::Context));
                assert!(shows(held(dates, 1, masks), P::Context));
                let explain = |images| Task::Explain.layout(held(dates, images, masks));
                assert!(!contains(&explain(0), P::Context) && contains(&explain(1), P::Context));
            }
        }
        let pet = |dates, masks| Held { has_pet: true, ..held(dates, 2, masks) };
        assert_eq!(opening_task(pet(1, 1)), Some(Task::Fusion));
        assert_eq!(opening_task(Held { images: 1, ..pet(1, 1) }), None, "nothing lies under it");
        assert_eq!([opening_task(pet(2, 3)), opening_task(pet(1, 3))], [None; 2]);
        assert_eq!([opening_task(pet(2, 1)), opening_task(held(2, 1, 1))], [Some(Task::FollowUp); 2]);
        assert_eq!([opening_task(held(2, 0, 1)), opening_task(held(2, 1, 2))], [None; 2]);
        // What drawing does to it is no arrangement; another tab in front is.
        for of in [held(1, 1, 3), held(2, 1, 1), held(2, 1, 3), held(1, 1, 0)] {
            let mut layout = simplified(opening(of));
            assert!(is_as_opened(&layout, of), "{of:?}");
            assert!(!is_as_opened(&layout, held(2, 0, 2)), "{of:?}");
            toggle(&mut layout, PaneId::Diagnostics);
            assert!(!is_as_opened(&layout, of), "{of:?}");
        }
        assert_eq!(opening_task(held(1, 1, 0)), Some(Task::Read));
        assert!(shows(held(2, 1, 1), P::Change) && !shows(held(1, 1, 1), P::Change));
    }

    #[test]
    fn default_layout_has_the_main_views_and_toggling_twice_restores_it() {
        let mut layout = default_layout(held(1, 1, 3));
        for pane in [PaneId::Closeup, PaneId::Context, PaneId::Ellipsoids, PaneId::Overlap, PaneId::Coronal] {
            assert!(contains(&layout, pane));
        }
        assert!(!contains(&layout, PaneId::Diagnostics));
        toggle(&mut layout, PaneId::Diagnostics);
        assert!(contains(&layout, PaneId::Diagnostics));
        toggle(&mut layout, PaneId::Diagnostics);
        assert!(!contains(&layout, PaneId::Diagnostics));
    }

    /// The children of the container that `pane` lies in.
    fn siblings(layout: &Tree<PaneId>, pane: PaneId) -> Vec<PaneId> {
        let tile = layout.tiles.find_pane(&pane).unwrap();
        let parent = layout.tiles.parent_of(tile).unwrap();
        let children = layout.tiles.get_container(parent).unwrap().children();
        children.filter_map(|child| layout.tiles.get_pane(child).copied()).collect()
    }

    #[test]
    fn a_pane_opens_in_front_of_one_of_its_kind_and_squeezes_none() {
        let mut layout = default_layout(held(1, 1, 3));
        toggle(&mut layout, PaneId::Transfer);
        let numbers = [PaneId::Overlap, PaneId::Lens, PaneId::Measurements, PaneId::Transfer];
        assert_eq!(siblings(&layout, PaneId::Transfer), numbers);
        let tile = layout.tiles.find_pane(&PaneId::Transfer).unwrap();
        assert!(layout.active_tiles().contains(&tile));
        // Alone in its place: it becomes a tab behind the new one.
        toggle(&mut layout, PaneId::Change);
        assert_eq!(siblings(&layout, PaneId::Change), [PaneId::Closeup, PaneId::Change]);
    }

    /// The panes of the column that `pane` lies in, from top to bottom.
    fn column(layout: &Tree<PaneId>, pane: PaneId) -> Vec<PaneId> {
        fn panes(layout: &Tree<PaneId>, tile: TileId) -> Vec<PaneId> {
            match layout.tiles.get(tile).unwrap() {
                Tile::Pane(pane) => vec![*pane],
                Tile::Container(all) => all.children().flat_map(|child| panes(layout, *child)).collect(),
            }
        }
        let mut tile = layout.tiles.find_pane(&pane).unwrap();
        loop {
            tile = layout.tiles.parent_of(tile).unwrap();
            match layout.tiles.get_container(tile) {
                Some(Container::Linear(linear)) if linear.dir == LinearDir::Vertical => {
                    return panes(layout, tile);
                }
                _ => {}
            }
        }
    }

    #[test]
    fn closed_slices_come_back_above_and_below_the_others() {
        let others = [[0, 1], [0, 2], [1, 0], [1, 2], [2, 0], [2, 1]].map(|pair| pair.map(|i| SLICES[i]));
        for closed in SLICES.map(|one| vec![one]).into_iter().chain(others.map(Vec::from)) {
            for backwards in [false, true] {
                let mut layout = simplified(default_layout(held(1, 1, 3)));
                for pane in &closed {
                    toggle(&mut layout, *pane);
                    layout = simplified(layout);
                    assert!(!contains(&layout, *pane));
                }
                let mut opened = closed.clone();
                if backwards {
                    opened.reverse();
                }
                for pane in opened {
                    toggle(&mut layout, pane);
                    layout = simplified(layout);
                }
                assert_eq!(column(&layout, PaneId::Axial), SLICES, "{closed:?} {backwards}");
                let root = layout.tiles.get_container(layout.root().unwrap()).unwrap();
                assert_eq!(root.num_children(), 3, "{closed:?}: no further column");
            }
        }
    }

    #[test]
    fn tasks_have_their_panes_once_and_in_front() {
        use PaneId as P;
        for (task, dates, front) in [
            (Task::CompareMasks, 1, vec![P::Closeup, P::Overlap, P::Axial]),
            (Task::FollowUp, 2, vec![P::Change, P::SideBySide, P::Dates, P::Axial]),
            (Task::Fusion, 1, vec![P::Axial, P::Coronal, P::Sagittal, P::Context]),
            (Task::Explain, 1, vec![P::Ellipsoids, P::Closeup, P::Context, P::Axial]),
            (Task::Read, 1, vec![P::Axial, P::Coronal, P::Sagittal]),
            (Task::Read, 3, vec![P::SideBySide, P::Axial]),
        ] {
            let layout = simplified(task.layout(held(dates, 2, 3)));
            let active = layout.active_tiles();
            for pane in front {
                let tile = layout.tiles.find_pane(&pane).unwrap_or_else(|| panic!("{task:?} {pane:?}"));
                assert!(active.contains(&tile), "{task:?} {pane:?}");
            }
            let panes = layout.tiles.iter().filter(|(_, tile)| matches!(tile, Tile::Pane(_))).count();
            let reached = active.iter().filter(|id| layout.tiles.get_pane(id).is_some()).count();
            // The follow-up has closeup and context view behind the change, and three panes behind the dates.
            let behind = if task == Task::FollowUp { 5 } else { 3 };
            assert!(panes >= reached && panes <= reached + behind, "{task:?}: {panes} {reached}");
        }
        assert!(!Task::FollowUp.suits(held(1, 3, 3)) && Task::FollowUp.suits(held(2, 1, 1)));
        assert!(
            !Task::Fusion.suits(held(2, 1, 1))
                && !Task::CompareMasks.suits(held(1, 1, 1))
                && !Task::Read.suits(held(1, 0, 2))
        );
    }

    #[test]
    fn change_is_in_front_where_there_are_dates() {
        let layout = default_layout(held(2, 1, 3));
        let front = layout.active_tiles();
        let in_front = |pane| front.contains(&layout.tiles.find_pane(&pane).unwrap());
        for pane in [PaneId::Change, PaneId::Closeup, PaneId::Context, PaneId::Overlap, PaneId::Axial] {
            assert!(in_front(pane), "{pane:?}");
        }
        assert!(!contains(&default_layout(held(1, 1, 3)), PaneId::Change));
    }
}
