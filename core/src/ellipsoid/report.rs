//! The report of `ellipsoids --json`.

use serde::Serialize;

use super::{ComponentEllipsoid, Ellipsoid, EllipsoidError, Method, Of, Options, ellipsoids_of};
use crate::{Check, Progress, case::Case, components::Connectivity};

/// Every ellipsoid of a case. Field names are stable.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EllipsoidsReport {
    /// Name of the case.
    pub case: String,
    /// Neighbours of a voxel: 6, 18 or 26.
    pub connectivity: u32,
    /// `exchange`, `away-steps` or `khachiyan`.
    pub method: &'static str,
    /// Requested tolerance: volumes of at most `1 + tolerance` times the minimum.
    pub tolerance: f64,
    /// By date, and within a date in the order of [`ellipsoids_of`].
    pub components: Vec<ComponentReport>,
    /// All findings about the case, most severe first.
    pub warnings: Vec<Check>,
}

/// One component.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComponentReport {
    /// What it is a component of.
    pub of: OfReport,
    /// Label of the date; empty where the case has one without a name.
    pub time: String,
    /// Number of its voxels.
    pub voxels: u64,
    /// Volume of its voxels.
    pub volume_ml: f64,
    /// The enclosing ellipsoid.
    #[serde(flatten)]
    pub enclosing: EllipsoidReport,
    /// The enclosing volume is at most this times the minimum.
    pub volume_bound: f64,
    /// The enclosing volume over the component's.
    pub exaggeration: f64,
    /// The ellipsoid with the component's centroid, principal axes and volume.
    pub moment: EllipsoidReport,
}

/// A mask or a region.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OfReport {
    /// Id of the mask.
    Mask(String),
    /// Ids of exactly the masks that are active in the region.
    Region(Vec<String>),
}

/// An ellipsoid in RAS+ millimetres.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EllipsoidReport {
    /// Its centre.
    pub center_mm: [f64; 3],
    /// Its semi-axes, longest first.
    pub semi_axes_mm: [f64; 3],
    /// Three rows of a rotation whose columns are the axes: `rotation[r][k]` is coordinate r of axis k.
    pub rotation: [[f64; 3]; 3],
}

impl EllipsoidReport {
    /// The report of `ellipsoid`.
    pub fn of(ellipsoid: &Ellipsoid) -> Self {
        Self {
            center_mm: ellipsoid.center_mm.to_array(),
            semi_axes_mm: ellipsoid.semi_axes_mm.to_array(),
            rotation: ellipsoid.rotation.transpose().to_cols_array_2d(),
        }
    }
}

impl ComponentReport {
    /// The report of `component`, whose index has these masks.
    pub fn of(component: &ComponentEllipsoid, mask_ids: &[String], time: &str) -> Self {
        let of = match component.of {
            Of::Mask(k) => OfReport::Mask(mask_ids.get(k).cloned().unwrap_or_default()),
            Of::Region(bits) => {
                let active = mask_ids.iter().enumerate().filter(|(k, _)| bits >> k & 1 == 1);
                OfReport::Region(active.map(|(_, id)| id.clone()).collect())
            }
        };
        Self {
            of,
            time: time.to_owned(),
            voxels: component.voxels,
            volume_ml: component.volume_ml,
            enclosing: EllipsoidReport::of(&component.enclosing),
            volume_bound: component.volume_bound,
            exaggeration: component.exaggeration,
            moment: EllipsoidReport::of(&component.moment),
        }
    }
}

impl Method {
    /// Its name in reports and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exchange => "exchange",
            Self::AwaySteps => "away-steps",
            Self::Khachiyan => "khachiyan",
        }
    }
}

/// The ellipsoids of every time point of `case`.
///
/// # Errors
/// As [`ellipsoids_of`].
pub fn report(
    case: &Case,
    connectivity: Connectivity,
    options: &Options,
    progress: &Progress,
) -> Result<EllipsoidsReport, EllipsoidError> {
    let mut components = Vec::new();
    for time in &case.time_points {
        let found = ellipsoids_of(&time.index, connectivity, options, progress)?;
        let ids = time.index.mask_ids();
        components.extend(found.iter().map(|c| ComponentReport::of(c, ids, &time.label)));
    }
    Ok(EllipsoidsReport {
        case: case.name.clone(),
        connectivity: connectivity.neighbors(),
        method: options.method.name(),
        tolerance: options.tolerance,
        components,
        warnings: case.checks.clone(),
    })
}
