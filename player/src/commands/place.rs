//! `player place`: find the table in a scan of a room, and draw the match on it.

use std::{
    io::Write,
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::{Context, bail};
use glam::DVec3;
use player::{
    placement::{Finder, Finding, FoundSurface, Intrinsics, PointCloud, Refusal, SurfaceId, SurfaceKind, Up},
    scan,
    xr::thread_cpu_time,
};
use serde::{Deserialize, Serialize};

use super::place_picture::{self, PictureArguments, PitchReport};

const EXAMPLES: &str = "Examples:
  player place --cloud scan.pcd --json table.json
  player place --cloud phone.ply --up 0,1,0
  player place --depth depth.png --intrinsics 525,525,319.5,239.5
  player place --depth depth.pgm --depth-scale 5000 --intrinsics camera.json
  player place --cloud scan.pcd --stream target/demo/stream --frame 30 --out table.png
  player place --cloud scan.pcd --stream target/demo/stream --out left.png --view left
  player place --depth 1.png --image colour.png --intrinsics 525,525,319.5,239.5 --stream STREAM --out table.png
  player place --sequence room --intrinsics 518,519,325.5,253.5 --stream STREAM --out from-3.png --view 3

Prints JSON: the table (or null) as a plane n·p + d = 0 in the axes of the scan, metres, n towards the sensor; its
polygon; all planes; and for each level one that is not claimed, why. Exit code 0 also when there is no table.
Without --up, gravity is estimated from the planes and from how the sensor was held.
With --stream and --out it also draws the match on the table: hidden by what stands in front, with a shadow, in the
light of the picture.";

/// Most views of a sequence that the table is searched in, evenly spread.
const MOST_LOOKS: usize = 12;

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct PlaceArguments {
    #[command(flatten)]
    scan: ScanArgument,
    #[command(flatten)]
    options: ScanOptions,
    #[command(flatten)]
    picture: PictureArguments,
    /// Write the JSON here instead of printing it.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(clap::Args)]
#[group(required = true, multiple = false)]
pub(super) struct ScanArgument {
    /// A point cloud, in rows and columns or without order.
    #[arg(long, value_name = "FILE.pcd|.ply")]
    pub(super) cloud: Option<PathBuf>,
    /// A depth picture: 16 bits, distance along the optical axis.
    #[arg(long, value_name = "FILE.png|.pgm", requires = "intrinsics")]
    pub(super) depth: Option<PathBuf>,
    /// A folder with posed views: depth/, color/ and pose.txt or trajectory.log. The table is looked for in up to 12.
    #[arg(long, value_name = "DIR", requires = "intrinsics")]
    pub(super) sequence: Option<PathBuf>,
}

#[derive(clap::Args)]
pub(super) struct ScanOptions {
    /// Pinhole of the depth picture: fx,fy,cx,cy in pixels, or a JSON file with width, height and intrinsic_matrix.
    #[arg(long, value_name = "FX,FY,CX,CY|FILE", value_parser = parse_intrinsics)]
    pub(super) intrinsics: Option<IntrinsicsArgument>,
    /// Units of the depth picture in a metre.
    #[arg(long, value_name = "UNITS", default_value_t = 1000.0, value_parser = parse_scale)]
    pub(super) depth_scale: f64,
    /// Direction against gravity, in the axes of the scan.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_direction, allow_hyphen_values = true)]
    pub(super) up: Option<DVec3>,
}

#[derive(Clone)]
pub(super) enum IntrinsicsArgument {
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
    /// Where the match stands, with --out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pitch: Option<PitchReport>,
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
    let asked = arguments.picture.asked();
    let room = asked
        .map(|_| place_picture::read(&arguments.scan, &arguments.options, &arguments.picture))
        .transpose()?;
    let looks = match &room {
        Some(room) if arguments.scan.sequence.is_none() => vec![room.found_in.cloud.clone()],
        _ => read(&arguments.scan, &arguments.options)?,
    };
    let measured = |look: &PointCloud| look.points_m().iter().filter(|point| point.is_finite()).count();
    let points = looks.iter().map(measured).sum();
    if points == 0 {
        bail!("{}: no point was measured: scan again", arguments.scan.path().display());
    }
    let (on_processor, on_wall) = (thread_cpu_time(), Instant::now());
    let finding = Finder::default().find_in_all(&looks).context("no look at the room")?;
    let find_wall_ms = on_wall.elapsed().as_secs_f64() * 1e3;
    let find_ms = (thread_cpu_time() - on_processor).as_secs_f64() * 1e3;
    let drawn = match (&room, asked) {
        (Some(room), Some(asked)) => {
            finding.table().map(|table| place_picture::draw(room, &table.surface, &asked))
        }
        _ => None,
    };
    let report = Report {
        pitch: drawn.transpose()?,
        table: finding.table().map(PlaneReport::new),
        planes: finding.surfaces.iter().map(PlaneReport::new).collect(),
        rejected: rejections(&finding),
        up: finding.up,
        points,
        find_ms,
        find_wall_ms,
    };
    let nothing_drawn = asked.is_some() && report.pitch.is_none();
    match &arguments.json {
        Some(path) => super::write_json(path, &report)?,
        None => writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&report)?)
            .context("standard output: cannot be written")?,
    }
    if nothing_drawn {
        bail!("{}: no table found, so there is no picture of one", arguments.scan.path().display());
    }
    Ok(())
}

fn rejections(finding: &Finding) -> Vec<Rejection> {
    let refused = |found: &FoundSurface| Some(Rejection { id: found.surface.id, refusal: found.refusal? });
    finding.surfaces.iter().filter_map(refused).collect()
}

impl ScanArgument {
    fn path(&self) -> &Path {
        let given = self.cloud.as_deref().or(self.depth.as_deref()).or(self.sequence.as_deref());
        given.unwrap_or(Path::new(""))
    }
}

/// The looks at the room that the table is searched in: one, or some of a sequence.
fn read(scan: &ScanArgument, options: &ScanOptions) -> anyhow::Result<Vec<PointCloud>> {
    let metres_per_unit = 1.0 / options.depth_scale;
    let looks = match (&scan.cloud, &scan.depth, &options.intrinsics) {
        (Some(path), _, _) => vec![scan::read_cloud(path)?],
        (None, Some(path), Some(intrinsics)) => {
            vec![PointCloud::from_depth(&scan::read_depth(path, metres_per_unit)?, &intrinsics.read()?)]
        }
        (None, None, Some(intrinsics)) => {
            let folder = scan.sequence.as_deref().unwrap_or(Path::new(""));
            let (views, intrinsics) = (scan::read_sequence(folder)?, intrinsics.read()?);
            let looks = views.iter().step_by(views.len().div_ceil(MOST_LOOKS).max(1)).map(|view| {
                let picture = scan::read_depth(&view.depth, metres_per_unit)?;
                Ok(PointCloud::from_depth(&picture, &intrinsics).moved(&view.room_from_camera))
            });
            looks.collect::<anyhow::Result<_>>()?
        }
        _ => bail!("give --cloud, or --depth or --sequence with --intrinsics"),
    };
    let Some(up) = options.up else { return Ok(looks) };
    Ok(looks.into_iter().map(|look| look.with_up(up)).collect())
}

impl IntrinsicsArgument {
    pub(super) fn read(&self) -> anyhow::Result<Intrinsics> {
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
