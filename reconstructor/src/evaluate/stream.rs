//! What the codec costs and loses (DESIGN §6, Stream): every rung of the ladder against its own input, and against one Draco mesh and JPEG per frame.
//!
//! The input is what `motion` makes of a plain stream's bodies: meshes that move and their textures. The baseline writes the same meshes and textures
//! with Draco (speed 3) and JPEG (quality 75), its positions rounded more or less coarsely. For each baseline the cheapest setting of ours that is
//! nowhere worse, in geometry and in texture, is the one that it is held against.

use std::time::Instant;

use glam::Vec3;
use image::RgbImage;
use protocol::{
    chunk::{ChunkFrame, PixelImage, Quantisation},
    compact::{self, ByteParts, CompactChunk, Run, Sequence},
    content::AnyChunk,
    limits::Limits,
    mesh::Mesh,
    time::Timescale,
};
use rayon::iter::{IntoParallelIterator, IntoParallelRefIterator, ParallelIterator};
use serde::Serialize;

use super::baseline::Baseline;
use crate::{
    encode::{self, LADDER},
    motion::sampled,
    surface::{MeshPlace, Surface, Triangle, spread, spread_places},
};

/// Points of a surface that are measured.
const POINTS: usize = 200;
/// Every so many frames of a run are measured; all are coded.
const MEASURED: usize = 5;
/// The match that rates are told for.
const PEOPLE: f64 = 22.0;
const FRAMES_PER_S: f64 = 25.0;
/// Bits of positions that the baseline tries, coarsest first.
const BASELINE_BITS: std::ops::RangeInclusive<u8> = 7..=12;

/// Settings of the codec beside the rungs.
const POINT_STEPS_M: [f32; 4] = [0.003, 0.006, 0.0135, 0.024];
const TEXTURE_STEPS: [f32; 4] = [10.0, 15.0, 21.0, 30.0];

fn setting(point_step_m: f32) -> impl Iterator<Item = compact::Quality> {
    let best = compact::Quality::HIGH;
    TEXTURE_STEPS.into_iter().map(move |texture_step| compact::Quality { point_step_m, texture_step, ..best })
}

/// Figures of one way to store a match.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RateFigures {
    /// The rung, or the baseline.
    pub id: String,
    /// All chunks.
    pub bytes: u64,
    /// Bytes of a body in a frame.
    pub bytes_per_body: f64,
    /// For 22 people at 25 frames per second.
    pub mbit_s: f64,
    /// Surface distance from the encoder's input, both ways, root mean square, millimetres.
    pub error_mm: f64,
    /// Peak signal-to-noise ratio of the texture on the surface, decibels.
    pub psnr_db: f64,
}

/// Figures of a rung.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RungFigures {
    /// Rate and distortion.
    #[serde(flatten)]
    pub rate: RateFigures,
    /// Shares of the bytes: meshes at rest, motion, head, document.
    pub rest_share: f64,
    /// See `rest_share`.
    pub motion_share: f64,
    /// See `rest_share`.
    pub head_share: f64,
    /// See `rest_share`.
    pub index_share: f64,
    /// Time on one thread to decode a frame of 22 people, its share of the chunk included, milliseconds.
    pub decode_ms_p50: f64,
    /// See `decode_ms_p50`.
    pub decode_ms_p95: f64,
}

/// Figures of a stream.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StreamFigures {
    /// Frames coded.
    pub frames: usize,
    /// Bodies in them.
    pub bodies: usize,
    /// Meshes that they share.
    pub runs: usize,
    /// The ladder, best last.
    pub rungs: Vec<RungFigures>,
    /// Other settings of the codec: rate over distortion.
    pub curve: Vec<RateFigures>,
    /// One Draco mesh and JPEG per frame, and ours beside it.
    pub baselines: Vec<Comparison>,
    /// Of the baseline whose geometry is as far off as that of the best rung, or next to that.
    pub bytes_ratio: Option<f64>,
}

/// A baseline, and the cheapest setting of ours that is no worse.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Comparison {
    /// Bits of the baseline's positions.
    pub position_bits: u8,
    /// The baseline.
    #[serde(flatten)]
    pub rate: RateFigures,
    /// Which setting of ours; none when all are worse in something.
    pub ours: Option<String>,
    /// Our bytes for one of the baseline's.
    pub bytes_ratio: Option<f64>,
}

/// Sums over bodies.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    squares_m2: f64,
    places: usize,
    colours: f64,
    channels: usize,
}

impl Errors {
    fn plus(self, other: Self) -> Self {
        Self {
            squares_m2: self.squares_m2 + other.squares_m2,
            places: self.places + other.places,
            colours: self.colours + other.colours,
            channels: self.channels + other.channels,
        }
    }

    fn error_mm(&self) -> f64 {
        (self.squares_m2 / self.places.max(1) as f64).sqrt() * 1e3
    }

    fn psnr_db(&self) -> f64 {
        10.0 * (255.0 * 255.0 * self.channels.max(1) as f64 / self.colours.max(1e-9)).log10()
    }
}

/// Measures the codec on `chunks` of a stream.
///
/// # Errors
/// When a chunk cannot be read, or what the codec wrote cannot.
pub fn stream<E: From<encode::EncodeError>>(
    chunks: impl Iterator<Item = Result<AnyChunk, E>>,
    timescale: Timescale,
) -> Result<StreamFigures, E> {
    let mut figures = StreamFigures::default();
    let mut tallies: Vec<Tally> = LADDER.iter().map(|_| Tally::default()).collect();
    let settings: Vec<compact::Quality> = POINT_STEPS_M.iter().flat_map(|step| setting(*step)).collect();
    let mut curve: Vec<Tally> = settings.iter().map(|_| Tally::default()).collect();
    let mut baselines: Vec<Tally> = BASELINE_BITS.map(|_| Tally::default()).collect();
    for chunk in chunks {
        let sequence = encode::sequence_of(&chunk?)?;
        figures.frames += sequence.frames.len();
        figures.runs += sequence.runs.len();
        figures.bodies += sequence.runs.iter().map(|run| run.frames.len()).sum::<usize>();
        for (tally, rung) in tallies.iter_mut().zip(&LADDER) {
            let kept = sequence.runs.par_iter().map(|run| rung.of(run)).collect();
            let kept = Sequence { frames: sequence.frames.clone(), runs: kept };
            tally.rung(&sequence, &kept, timescale, &rung.quality).map_err(encode::EncodeError::Codec)?;
        }
        for (tally, quality) in curve.iter_mut().zip(&settings) {
            tally.rung(&sequence, &sequence, timescale, quality).map_err(encode::EncodeError::Codec)?;
        }
        for (tally, position_bits) in baselines.iter_mut().zip(BASELINE_BITS) {
            tally.baseline(&sequence, Quantisation { position_bits, uv_bits: position_bits.min(10) })?;
        }
    }
    let bodies = figures.bodies;
    figures.rungs =
        tallies.iter().zip(&LADDER).map(|(tally, rung)| tally.rung_figures(rung.id, bodies)).collect();
    figures.curve = curve
        .iter()
        .zip(&settings)
        .map(|(tally, quality)| {
            let id = format!("points {} m, texture {}", quality.point_step_m, quality.texture_step);
            tally.rate(&id, bodies)
        })
        .collect();
    let ours = || figures.rungs.iter().map(|rung| &rung.rate).chain(&figures.curve);
    let compared = baselines.iter().zip(BASELINE_BITS).map(|(tally, position_bits)| {
        let rate = tally.rate("Draco speed 3, JPEG 75", bodies);
        let no_worse = |own: &&RateFigures| own.error_mm <= rate.error_mm && own.psnr_db >= rate.psnr_db;
        let cheapest = ours().filter(no_worse).min_by_key(|own| own.bytes);
        Comparison {
            position_bits,
            ours: cheapest.map(|own| own.id.clone()),
            bytes_ratio: cheapest.map(|own| own.bytes as f64 / rate.bytes.max(1) as f64),
            rate,
        }
    });
    let compared: Vec<Comparison> = compared.collect();
    let high_mm = figures.rungs.last().map_or(0.0, |high| high.rate.error_mm);
    let like_high = compared
        .iter()
        .min_by(|a, b| (a.rate.error_mm - high_mm).abs().total_cmp(&(b.rate.error_mm - high_mm).abs()));
    figures.bytes_ratio = like_high.and_then(|baseline| baseline.bytes_ratio);
    figures.baselines = compared;
    Ok(figures)
}

/// What one way of storing came to.
#[derive(Clone, Debug, Default)]
struct Tally {
    bytes: u64,
    parts: ByteParts,
    errors: Errors,
    decode_ms: Vec<f64>,
}

impl Tally {
    /// Writes and reads `kept`, which a rung keeps of `given`.
    fn rung(
        &mut self,
        given: &Sequence,
        kept: &Sequence,
        timescale: Timescale,
        quality: &compact::Quality,
    ) -> Result<(), protocol::chunk::ChunkError> {
        let limits = Limits::default();
        let bytes = compact::encode(kept, timescale, quality)?;
        self.bytes += bytes.len() as u64;
        let parts = compact::byte_parts(&bytes, &limits)?;
        self.parts.rest += parts.rest;
        self.parts.motion += parts.motion;
        self.parts.head += parts.head;
        self.parts.index += parts.index;
        let started = Instant::now();
        let decoded = CompactChunk::decode(&bytes, &limits)?;
        let share_ms = 1e3 * started.elapsed().as_secs_f64() / given.frames.len() as f64;
        let mut frames = Vec::with_capacity(given.frames.len());
        for index in 0..given.frames.len() {
            let started = Instant::now();
            let Some(frame) = decoded.frame(index) else { continue };
            let own_ms = 1e3 * started.elapsed().as_secs_f64();
            if !frame.bodies.is_empty() {
                self.decode_ms.push((share_ms + own_ms) * PEOPLE / frame.bodies.len() as f64);
            }
            frames.push(ChunkFrame { atlas: None, ..frame });
        }
        let errors = (0..given.runs.len()).into_par_iter().map(|index| {
            let run = &given.runs[index];
            let measured = (0..run.frames.len()).step_by(MEASURED).filter_map(|at| {
                let body = frames[run.frames[at]].bodies.iter().find(|body| body.person == run.person)?;
                let texture = rgb(&decoded.texture(index, at)?);
                Some(errors(run, at, &body.mesh, |[u, v]| colour(&texture, u, v)))
            });
            measured.fold(Errors::default(), Errors::plus)
        });
        self.errors = self.errors.plus(errors.reduce(Errors::default, Errors::plus));
        Ok(())
    }

    /// Writes every frame of `given` by itself.
    fn baseline(&mut self, given: &Sequence, quantisation: Quantisation) -> Result<(), encode::EncodeError> {
        let coded = (0..given.frames.len()).into_par_iter().map(|frame| {
            let present =
                given.runs.iter().filter_map(|run| Some((run, run.frames.binary_search(&frame).ok()?)));
            let bodies: Vec<(&Run, usize)> = present.collect();
            if bodies.is_empty() {
                return Ok((0, Errors::default()));
            }
            let pictures: Vec<RgbImage> = bodies.iter().map(|(run, at)| rgb(&run.textures[*at])).collect();
            let coded = Baseline::new(&bodies, &pictures, given.frames[frame].clip_frame, quantisation)?;
            let measured =
                bodies.iter().zip(&coded.meshes).enumerate().filter(|(_, ((_, at), _))| at % MEASURED == 0);
            let errors = measured.map(|(index, ((run, at), mesh))| {
                errors(run, *at, mesh, |uv| {
                    let [u, v] = coded.atlas_uv(index, uv);
                    colour(&coded.atlas, u, v)
                })
            });
            Ok((coded.bytes, errors.fold(Errors::default(), Errors::plus)))
        });
        let coded: Vec<(usize, Errors)> = coded.collect::<Result<_, encode::EncodeError>>()?;
        for (bytes, errors) in coded {
            self.bytes += bytes as u64;
            self.errors = self.errors.plus(errors);
        }
        Ok(())
    }

    fn rate(&self, id: &str, bodies: usize) -> RateFigures {
        let bytes_per_body = self.bytes as f64 / bodies.max(1) as f64;
        RateFigures {
            id: id.to_owned(),
            bytes: self.bytes,
            bytes_per_body,
            mbit_s: bytes_per_body * PEOPLE * FRAMES_PER_S * 8.0 / 1e6,
            error_mm: self.errors.error_mm(),
            psnr_db: self.errors.psnr_db(),
        }
    }

    fn rung_figures(&self, id: &str, bodies: usize) -> RungFigures {
        let share = |bytes: usize| bytes as f64 / self.bytes.max(1) as f64;
        let mut sorted = self.decode_ms.clone();
        sorted.sort_by(f64::total_cmp);
        let quantile = |part: f64| {
            let at = ((sorted.len().max(1) - 1) as f64 * part).round() as usize;
            sorted.get(at).copied().unwrap_or(0.0)
        };
        RungFigures {
            rate: self.rate(id, bodies),
            rest_share: share(self.parts.rest),
            motion_share: share(self.parts.motion),
            head_share: share(self.parts.head),
            index_share: share(self.parts.index),
            decode_ms_p50: quantile(0.5),
            decode_ms_p95: quantile(0.95),
        }
    }
}

/// How far a stored body is from the run's frame `at`; `stored_colour` is asked for texture coordinates of the run.
fn errors(run: &Run, at: usize, stored: &Mesh, stored_colour: impl Fn([f64; 2]) -> [f64; 3]) -> Errors {
    let given = triangles(&run.positions_m[at], &run.mesh.triangles);
    let ours = triangles(&stored.positions_m, &stored.triangles);
    let (Some(given_surface), Some(our_surface)) = (Surface::new(&given), Surface::new(&ours)) else {
        return Errors::default();
    };
    let forth = spread(&ours, POINTS).into_iter().map(|point| given_surface.distance(point));
    let back = spread(&given, POINTS).into_iter().map(|point| our_surface.distance(point));
    let mut errors = Errors::default();
    for distance in forth.chain(back) {
        errors.squares_m2 += distance * distance;
        errors.places += 1;
    }
    let texture = rgb(&run.textures[at]);
    for MeshPlace { triangle, weights } in spread_places(&given, POINTS) {
        let mut uv = [0.0; 2];
        for (corner, weight) in run.mesh.triangles[triangle].iter().zip(weights) {
            let [u, v] = run.mesh.uvs[*corner as usize];
            uv = [uv[0] + weight * f64::from(u), uv[1] + weight * f64::from(v)];
        }
        let [given, stored] = [colour(&texture, uv[0], uv[1]), stored_colour(uv)];
        for (given, stored) in given.iter().zip(stored) {
            errors.colours += (given - stored).powi(2);
            errors.channels += 1;
        }
    }
    errors
}

fn triangles(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<Triangle> {
    let point = |vertex: u32| positions.get(vertex as usize).map(|p| Vec3::from(*p).as_dvec3());
    triangles.iter().filter_map(|[a, b, c]| Some([point(*a)?, point(*b)?, point(*c)?])).collect()
}

fn rgb(picture: &PixelImage) -> RgbImage {
    let pixels = picture.rgba.as_chunks::<4>().0;
    RgbImage::from_fn(picture.width_px, picture.height_px, |x, y| {
        let pixel = pixels.get((y * picture.width_px + x) as usize).copied().unwrap_or_default();
        image::Rgb([pixel[0], pixel[1], pixel[2]])
    })
}

/// The colour at a texture coordinate, as a renderer reads it.
fn colour(picture: &RgbImage, u: f64, v: f64) -> [f64; 3] {
    sampled(picture, [u, v]).map(f64::from)
}
