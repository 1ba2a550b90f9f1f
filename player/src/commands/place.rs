//! `player place`: find the table in a scan of a room.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::{Context, bail};
use glam::DVec3;
use player::{
    placement::{Finder, Finding, FoundSurface, Intrinsics, PointCloud, Refusal, SurfaceId, SurfaceKind, Up},
    scan,
};
use serde::{Deserialize, Serialize};

const EXAMPLES: &str = "Examples:
  player place --cloud scan.pcd --json table.json
  player place --cloud phone.ply --up 0,1,0
  player place --depth depth.png --intrinsics 525,525,319.5,239.5
  player place --depth depth.pgm --depth-scale 5000 --intrinsics camera.json

Prints JSON: the table (or null) as a plane n·p + d = 0 in the axes of the scan, metres, n towards the sensor; its
polygon; all planes; and for each level one that is not claimed, why. Exit code 0 also when there is no table.
Without --up, gravity is estimated from the planes and from how the sensor was held.";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct PlaceArguments {
    #[command(flatten)]
    scan: ScanArgument,
    #[command(flatten)]
    options: ScanOptions,
    /// Write the JSON here instead of printing it.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(clap::Args)]
#[group(required = true, multiple = false)]
struct ScanArgument {
    /// A point cloud, in rows and columns or without order.
    #[arg(long, value_name = "FILE.pcd|.ply")]
    cloud: Option<PathBuf>,
    /// A depth picture: 16 bits, distance along the optical axis.
    #[arg(long, value_name = "FILE.png|.pgm", requires = "intrinsics")]
    depth: Option<PathBuf>,
}

#[derive(clap::Args)]
struct ScanOptions {
    /// Pinhole of the depth picture: fx,fy,cx,cy in pixels, or a JSON file with width, height and intrinsic_matrix.
    #[arg(long, value_name = "FX,FY,CX,CY|FILE", value_parser = parse_intrinsics)]
    intrinsics: Option<IntrinsicsArgument>,
    /// Units of the depth picture in a metre.
    #[arg(long, value_name = "UNITS", default_value_t = 1000.0, value_parser = parse_scale)]
    depth_scale: f64,
    /// Direction against gravity, in the axes of the scan.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_direction, allow_hyphen_values = true)]
    up: Option<DVec3>,
}

#[derive(Clone)]
enum IntrinsicsArgument {
    Values(Intrinsics),
    File(PathBuf),
}

/// The camera file of Open3D: the matrix column by column.
#[derive(Deserialize)]
struct IntrinsicsFile {
    intrinsic_matrix: [f64; 9],
}

fn parse_intrinsics(text: &str) -> Result<IntrinsicsArgument, String> {
    if text.ends_with(".json") {
        return Ok(IntrinsicsArgument::File(text.into()));
    }
    let [fx, fy, cx, cy] = numbers(text)?;
    let intrinsics = Intrinsics { focal_px: [fx, fy], centre_px: [cx, cy] };
    is_camera(&intrinsics)
        .then_some(IntrinsicsArgument::Values(intrinsics))
        .ok_or_else(|| "focal lengths must be positive".into())
}

fn is_camera(intrinsics: &Intrinsics) -> bool {
    intrinsics.focal_px.iter().all(|focal| *focal > 0.0)
}

fn parse_scale(text: &str) -> Result<f64, String> {
    let scale: Option<f64> = text.parse().ok().filter(|scale: &f64| *scale > 0.0 && scale.is_finite());
    scale.ok_or_else(|| format!("`{text}` is not a number of units: 1000 for millimetres"))
}

fn parse_direction(text: &str) -> Result<DVec3, String> {
    let direction = DVec3::from_array(numbers(text)?);
    direction.try_normalize().ok_or_else(|| "the direction has no length: give one like 0,1,0".into())
}

/// Numbers with commas between them.
fn numbers<const COUNT: usize>(text: &str) -> Result<[f64; COUNT], String> {
    let read: Option<Vec<f64>> = text
        .split(',')
        .map(|word| word.trim().parse().ok().filter(|number: &f64| number.is_finite()))
        .collect();
    read.and_then(|read| read.try_into().ok())
        .ok_or_else(|| format!("`{text}` is not {COUNT} numbers with commas between them"))
}

/// What `--json` holds; metres in the axes of the scan.
#[derive(Serialize)]
struct Report<'a> {
    table: Option<PlaneReport<'a>>,
    planes: Vec<PlaneReport<'a>>,
    /// Level surfaces that are not claimed, and why.
    rejected: Vec<Rejection>,
    up: Up,
    points: usize,
    /// Time on the processor for the finding alone, without reading the file.
    find_ms: f64,
    /// The same by the clock on the wall.
    find_wall_ms: f64,
}

#[derive(Serialize)]
struct PlaneReport<'a> {
    id: SurfaceId,
    kind: SurfaceKind,
    normal: DVec3,
    offset_m: f64,
    polygon: &'a [DVec3],
    obstacles: &'a [Vec<DVec3>],
    confidence: f64,
    height_m: Option<f64>,
    tilt_degrees: f64,
    area_m2: f64,
    free_share: f64,
    rms_m: f64,
}

#[derive(Serialize)]
struct Rejection {
    id: SurfaceId,
    #[serde(flatten)]
    refusal: Refusal,
}

impl<'a> PlaneReport<'a> {
    fn new(found: &'a FoundSurface) -> Self {
        let surface = &found.surface;
        Self {
            id: surface.id,
            kind: surface.kind,
            normal: surface.plane.normal,
            offset_m: surface.plane.offset_m,
            polygon: &surface.outline_m,
            obstacles: &surface.obstacles_m,
            confidence: surface.confidence,
            height_m: found.height_m,
            tilt_degrees: found.tilt_degrees,
            area_m2: found.area_m2,
            free_share: found.free_share,
            rms_m: found.rms_m,
        }
    }
}

pub(super) fn run(arguments: &PlaceArguments) -> anyhow::Result<()> {
    let cloud = read(&arguments.scan, &arguments.options)?;
    let points = cloud.points_m().iter().filter(|point| point.is_finite()).count();
    if points == 0 {
        bail!("{}: no point was measured: scan again", arguments.scan.path().display());
    }
    let (on_processor, on_wall) = (processor_ms(), Instant::now());
    let finding = Finder::default().find(&cloud);
    let find_wall_ms = on_wall.elapsed().as_secs_f64() * 1e3;
    let find_ms = match (on_processor, processor_ms()) {
        (Some(before), Some(after)) => after - before,
        _ => {
            tracing::warn!("this system does not tell a thread's processor time: find_ms is by the clock");
            find_wall_ms
        }
    };
    let report = Report {
        table: finding.table().map(PlaneReport::new),
        planes: finding.surfaces.iter().map(PlaneReport::new).collect(),
        rejected: rejections(&finding),
        up: finding.up,
        points,
        find_ms,
        find_wall_ms,
    };
    match &arguments.json {
        Some(path) => super::write_json(path, &report),
        None => {
            println!("{}", serde_json::to_string_pretty(&report)?);
            Ok(())
        }
    }
}

fn rejections(finding: &Finding) -> Vec<Rejection> {
    let refused = |found: &FoundSurface| Some(Rejection { id: found.surface.id, refusal: found.refusal? });
    finding.surfaces.iter().filter_map(refused).collect()
}

/// Milliseconds that this thread has spent on a processor.
fn processor_ms() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds / 1e6)
}

impl ScanArgument {
    fn path(&self) -> &Path {
        self.cloud.as_deref().or(self.depth.as_deref()).unwrap_or(Path::new(""))
    }
}

fn read(scan: &ScanArgument, options: &ScanOptions) -> anyhow::Result<PointCloud> {
    let mut cloud = match (&scan.cloud, &scan.depth, &options.intrinsics) {
        (Some(path), _, _) => scan::read_cloud(path)?,
        (None, Some(path), Some(intrinsics)) => {
            let picture = scan::read_depth(path, 1.0 / options.depth_scale)?;
            PointCloud::from_depth(&picture, &intrinsics.read()?)
        }
        _ => bail!("give --cloud, or --depth with --intrinsics"),
    };
    if let Some(up) = options.up {
        cloud = cloud.with_up(up);
    }
    Ok(cloud)
}

impl IntrinsicsArgument {
    fn read(&self) -> anyhow::Result<Intrinsics> {
        let path = match self {
            Self::Values(intrinsics) => return Ok(*intrinsics),
            Self::File(path) => path,
        };
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("{}: the camera file cannot be read", path.display()))?;
        let file: IntrinsicsFile = serde_json::from_str(&text).with_context(|| {
            format!(
                "{}: not a camera: nine numbers in intrinsic_matrix, column by column, expected",
                path.display()
            )
        })?;
        let [fx, _, _, _, fy, _, cx, cy, _] = file.intrinsic_matrix;
        let intrinsics = Intrinsics { focal_px: [fx, fy], centre_px: [cx, cy] };
        if !is_camera(&intrinsics) {
            bail!("{}: focal lengths must be positive", path.display());
        }
        Ok(intrinsics)
    }
}
