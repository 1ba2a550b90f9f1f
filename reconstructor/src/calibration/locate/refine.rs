//! One camera fitted to everything the network named: points and lines together, with the places where broadcast cameras
//! stand as priors. Robust: what the network got wrong pulls no more than a bounded amount. Goals only vouch for the camera:
//! the paper's template is flat, and crossbars stay free to measure the fit.

use glam::{DVec2, DVec3};
use protocol::{camera::Camera, pitch::Pitch};

use super::{
    super::fit::geman_mcclure,
    super::least_squares::{
        LOG_FOCAL, Normal, PARAMETERS, POSITION, RADIAL, ROTATION, Row, minimise, project_with_derivatives,
    },
    evidence::{Evidence, FoundLine},
};

/// Distances at which a point counts half, one after the other, as shares of the picture's width.
const SCALES: [f64; 3] = [0.03, 0.012, 0.006];
/// Error of a named point and of a cell of a line, as shares of the picture's width: a quarter of a cell of the network.
const POINT_SIGMA: f64 = 0.002;
const LINE_SIGMA: f64 = 0.0015;
/// Error of a named point where the painted lines fix the camera to a pixel: what is left is of the network, not of the camera.
const POINT_SIGMA_ON_LINES: f64 = 0.003;
/// Cells of a line share one error: where the network is wrong about a line, it is wrong about a long stretch of it.
const CELLS_PER_ERROR: f64 = 12.0;
/// Main cameras: usual place and its spread, metres.
const MAIN: (DVec3, DVec3) = (DVec3::new(0.0, 17.0, 60.0), DVec3::new(30.0, 20.0, 45.0));
/// Cameras behind the goal: height, distance from the goal line and spread, metres.
const BEHIND: (DVec3, DVec3) = (DVec3::new(-25.0, 16.0, 0.0), DVec3::new(45.0, 22.0, 20.0));
/// Usual size of k1, and of the sine of the angle between picture and horizon.
const RADIAL_SIGMA: f64 = 0.15;
const ROLL_SIGMA: f64 = 0.05;

/// How much wider the priors are when they are left out; without any, few points leave the place open.
const WITHOUT_PRIORS: f64 = 20.0;

/// What the network can name, on a pitch of known size.
pub(super) struct Named {
    /// In the order of [`super::names::points`].
    pub(super) points: Vec<DVec3>,
    /// In the order of [`super::names::lines`].
    pub(super) lines: Vec<Vec<DVec3>>,
    half_length_m: f64,
}

impl Named {
    pub(super) fn new(pitch: &Pitch) -> Self {
        Self {
            points: super::names::points(pitch),
            lines: super::names::lines(pitch),
            half_length_m: pitch.length_m / 2.0,
        }
    }
}

/// Which parts of the fit are used: all, but for measuring what each is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Terms {
    /// Named points.
    pub(crate) points: bool,
    /// Named lines, and the crossings of lines drawn on.
    pub(crate) lines: bool,
    /// Where broadcast cameras usually stand, level, with an ordinary lens; without, twenty times as wide.
    pub(crate) priors: bool,
    /// Radial distortion.
    pub(crate) radial: bool,
    /// The last step onto the painted lines of the picture.
    pub(crate) polish: bool,
}

impl Default for Terms {
    fn default() -> Self {
        Self { points: true, lines: true, priors: true, radial: true, polish: true }
    }
}

/// The camera near `start` that explains the evidence best, and its cost.
pub(super) fn refine(start: &Camera, evidence: &Evidence, named: &Named, terms: Terms) -> (Camera, f64) {
    let mut free = [true; PARAMETERS];
    free[RADIAL] = terms.radial;
    let first = (*start, f64::INFINITY);
    SCALES.iter().fold(first, |(camera, _), scale| {
        minimise(camera, free, 15, |candidate| energy(candidate, evidence, named, terms, *scale))
    })
}

/// What holds a camera while it is moved onto the painted lines: named points, and where cameras stand. The lines that the
/// network names are the painted ones, and not counted twice.
pub(super) fn beside_lines(camera: &Camera, evidence: &Evidence, named: &Named, terms: Terms) -> Normal {
    let mut normal = priors(camera, named, terms);
    if terms.points {
        let [.., finest] = SCALES;
        normal.join(&points(camera, evidence, named, POINT_SIGMA_ON_LINES, finest));
    }
    normal
}

fn energy(camera: &Camera, evidence: &Evidence, named: &Named, terms: Terms, scale: f64) -> Normal {
    let mut normal = priors(camera, named, terms);
    if terms.points {
        normal.join(&points(camera, evidence, named, POINT_SIGMA, scale));
    }
    if terms.lines {
        normal.join(&lines(camera, evidence, named, scale));
    }
    normal
}

/// Distances of the named points; `sigma` and `scale` are shares of the picture's width.
fn points(camera: &Camera, evidence: &Evidence, named: &Named, sigma: f64, scale: f64) -> Normal {
    let mut normal = Normal::new();
    let width = f64::from(camera.width_px);
    let (unit, scale_px) = ((sigma * width).powi(-2), scale * width);
    for point in &evidence.points {
        let Some(&world) = named.points.get(point.name).filter(|world| world.y == 0.0) else { continue };
        let unit = unit * point.score;
        let Some((pixel, rows)) = project_with_derivatives(camera, world) else {
            normal.cost += unit * scale_px * scale_px;
            continue;
        };
        let offset = pixel - point.pixel;
        let bounded = geman_mcclure(offset.length_squared(), scale_px);
        for (axis, row) in rows.iter().enumerate() {
            normal.add(row, offset[axis], unit * bounded * bounded, 0.0);
        }
        normal.cost += unit * offset.length_squared() * bounded;
    }
    normal
}

/// Distances of the cells of named lines.
fn lines(camera: &Camera, evidence: &Evidence, named: &Named, scale: f64) -> Normal {
    let mut normal = Normal::new();
    let width = f64::from(camera.width_px);
    let (unit, scale_px) = ((LINE_SIGMA * width).powi(-2) / CELLS_PER_ERROR, scale * width);
    for (name, cells) in by_name(&evidence.lines) {
        let flat = named.lines.get(name).filter(|line| line.iter().all(|point| point.y == 0.0));
        let Some(drawn) = flat.map(|line| draw(camera, line)) else { continue };
        for cell in cells {
            let unit = unit * cell.score;
            let Some((row, residual)) = nearest(&drawn, cell.pixel) else {
                normal.cost += unit * scale_px * scale_px;
                continue;
            };
            let bounded = geman_mcclure(residual * residual, scale_px);
            normal.add(&row, residual, unit * bounded * bounded, unit * residual * residual * bounded);
        }
    }
    normal
}

/// How far a camera is from where cameras stand, how they are held, and an ordinary lens.
fn priors(camera: &Camera, named: &Named, terms: Terms) -> Normal {
    let mut normal = Normal::new();
    let free = if terms.priors { 1.0 } else { WITHOUT_PRIORS };
    let (usual, spread) = expected_place(camera, named);
    for axis in 0..3 {
        normal.expect(POSITION + axis, camera.position[axis] - usual[axis], spread[axis] * free);
    }
    normal.expect(RADIAL, camera.k1, RADIAL_SIGMA * free);
    // Turning about the optical axis moves the x axis up by as much as the y axis points down.
    let (sideways, down) = (camera.rotation.row(0).y, -camera.rotation.row(1).y);
    normal.expect(ROTATION + 2, sideways / down.max(0.2), ROLL_SIGMA * free);
    // Keeps the focal length from running away while nothing is near.
    normal.expect(LOG_FOCAL, (camera.focal_px / f64::from(camera.width_px) / 1.9).ln(), free);
    normal
}

fn expected_place(camera: &Camera, named: &Named) -> (DVec3, DVec3) {
    if camera.position.x < -named.half_length_m {
        (BEHIND.0 - DVec3::X * named.half_length_m, BEHIND.1)
    } else {
        MAIN
    }
}

fn by_name(lines: &[FoundLine]) -> impl Iterator<Item = (usize, &[FoundLine])> {
    lines.chunk_by(|a, b| a.name == b.name).filter_map(|cells| Some((cells.first()?.name, cells)))
}

type Drawn = Vec<Option<(DVec2, [Row; 2])>>;

fn draw(camera: &Camera, line: &[DVec3]) -> Drawn {
    line.iter().map(|&point| project_with_derivatives(camera, point)).collect()
}

/// Signed distance of a pixel from a drawn line and its derivatives.
fn nearest(drawn: &Drawn, pixel: DVec2) -> Option<(Row, f64)> {
    let mut best: Option<(f64, usize, f64)> = None;
    for (k, pair) in drawn.windows(2).enumerate() {
        let [Some((a, _)), Some((b, _))] = pair else { continue };
        let along = *b - *a;
        let t = ((pixel - *a).dot(along) / along.length_squared().max(1e-9)).clamp(0.0, 1.0);
        let squared = pixel.distance_squared(*a + along * t);
        if best.is_none_or(|(least, ..)| squared < least) {
            best = Some((squared, k, t));
        }
    }
    let (_, k, t) = best?;
    let (Some(Some((a, rows_a))), Some(Some((b, rows_b)))) = (drawn.get(k), drawn.get(k + 1)) else {
        return None;
    };
    let offset = a.lerp(*b, t) - pixel;
    // Beyond the end of the line the distance is to the end, else across the line.
    let normal = if (0.0..1.0).contains(&t) && t > 0.0 { (*b - *a).perp() } else { offset };
    let normal = normal.try_normalize().or_else(|| (*b - *a).perp().try_normalize())?;
    let row = std::array::from_fn(|i| {
        let mixed = |axis: usize| rows_a[axis][i] * (1.0 - t) + rows_b[axis][i] * t;
        normal.x * mixed(0) + normal.y * mixed(1)
    });
    Some((row, offset.dot(normal)))
}

/// How far the named points and lines are from where the camera puts them, pixels: one number each, in their order.
pub(super) fn distances(camera: &Camera, evidence: &Evidence, named: &Named) -> (Vec<f64>, Vec<f64>) {
    let off = |name: usize, pixel: DVec2| {
        let world = *named.points.get(name)?;
        Some(camera.project(world)?.distance(pixel))
    };
    let points = evidence.points.iter().map(|p| off(p.name, p.pixel).unwrap_or(f64::INFINITY)).collect();
    let mut lines = Vec::with_capacity(evidence.lines.len());
    for (name, cells) in by_name(&evidence.lines) {
        let drawn = named.lines.get(name).map(|line| draw(camera, line)).unwrap_or_default();
        lines.extend(
            cells.iter().map(|cell| nearest(&drawn, cell.pixel).map_or(f64::INFINITY, |(_, d)| d.abs())),
        );
    }
    (points, lines)
}
