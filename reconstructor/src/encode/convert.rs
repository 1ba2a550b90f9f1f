//! A stream of one profile as one of the other.

use std::{io::Cursor, path::Path};

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use protocol::{
    chunk::{Atlas, Chunk, ChunkFrame, EncodedImage, ImageFormat, PixelImage, Quantisation},
    manifest::{Manifest, Profile},
};

use super::{
    EncodeError, StreamError, StreamReader,
    folder::{Content, StreamFolder},
    sequence_of,
};

/// Rounding of plain chunks made from compact ones: a thirtieth of a millimetre, so that nothing is lost that can be seen.
const FINE: Quantisation = Quantisation { position_bits: 16, uv_bits: 14 };

/// Why a stream cannot be converted.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// The given stream cannot be read.
    #[error(transparent)]
    Read(#[from] StreamError),
    /// The new one cannot be written.
    #[error(transparent)]
    Write(#[from] EncodeError),
}

/// Writes the best quality of a stream to the folder `out` in `profile`; `done` is called after every chunk. To plain nothing is lost but rounding
/// ([`FINE`]; pictures become PNG); to compact bodies are followed anew, and the ladder's losses apply.
///
/// # Errors
/// When a chunk cannot be read or written.
pub fn convert(
    reader: &StreamReader,
    out: &Path,
    profile: Profile,
    mut done: impl FnMut(),
) -> Result<Manifest, ConvertError> {
    let manifest = reader.manifest();
    let static_scene = reader.static_scene()?;
    let mut folder = StreamFolder::create(out, manifest.timescale, profile, static_scene.as_deref())?;
    for index in 0..reader.chunk_count() {
        let chunk = reader.any_chunk(index)?;
        let content = match profile {
            Profile::Compact => Content::Runs(sequence_of(&chunk)?),
            Profile::Plain | Profile::Other => {
                let frames = chunk.into_frames().frames.into_iter().map(with_files);
                Content::Frames(Chunk { frames: frames.collect::<Result<_, _>>()? }, FINE)
            }
        };
        folder.put(&content)?;
        done();
    }
    Ok(folder.finish(manifest.clone())?)
}

/// A frame whose atlas is a file.
fn with_files(frame: ChunkFrame) -> Result<ChunkFrame, EncodeError> {
    let Some(Atlas::Pixels(pixels)) = &frame.atlas else { return Ok(frame) };
    let file = png(pixels)
        .map_err(|error| EncodeError::Texture { clip_frame: frame.clip_frame, message: error.to_string() })?;
    Ok(ChunkFrame { atlas: Some(Atlas::Encoded(file)), ..frame })
}

fn png(pixels: &PixelImage) -> Result<EncodedImage, image::ImageError> {
    let rgb: Vec<u8> = pixels.rgba.as_chunks::<4>().0.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect();
    let mut bytes = Cursor::new(Vec::new());
    PngEncoder::new(&mut bytes).write_image(
        &rgb,
        pixels.width_px,
        pixels.height_px,
        ExtendedColorType::Rgb8,
    )?;
    Ok(EncodedImage { format: ImageFormat::Png, bytes: bytes.into_inner() })
}

#[cfg(test)]
mod tests {
    use protocol::{
        compact::{self, Quality},
        content::AnyChunk,
        hash,
        limits::Limits,
        manifest::FILE_NAME,
        sample,
    };

    use super::*;

    /// A compact stream of one chunk.
    fn compact_stream(folder: &Path) {
        let mut manifest = sample::match_of(6, 3).unwrap().manifest;
        let bytes =
            compact::encode(&sample::sequence_of(0, 6, 3), sample::TIMESCALE, &Quality::HIGH).unwrap();
        std::fs::create_dir_all(folder.join("high")).unwrap();
        std::fs::write(folder.join("high/00000.glb"), &bytes).unwrap();
        manifest.representations[0].profile = Profile::Compact;
        manifest.representations[0].chunks[0].file = hash::entry("high/00000.glb", &bytes);
        std::fs::write(folder.join(FILE_NAME), manifest.to_json().unwrap()).unwrap();
    }

    #[test]
    fn a_compact_stream_becomes_a_plain_one_that_shows_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let (from, to) = (folder.path().join("compact"), folder.path().join("plain"));
        compact_stream(&from);
        let reader = StreamReader::open(&from, &Limits::default()).unwrap();
        let manifest = convert(&reader, &to, Profile::Plain, || ()).unwrap();
        assert_eq!(manifest.representations[0].profile, Profile::Plain);
        let converted = StreamReader::open(&to, &Limits::default()).unwrap();
        assert!(matches!(converted.any_chunk(0), Ok(AnyChunk::Plain(_))));
        let (given, plain) = (reader.chunk(0).unwrap(), converted.chunk(0).unwrap());
        for (given, plain) in given.frames.iter().zip(&plain.frames) {
            assert_eq!(
                (given.clip_frame, given.start, given.ball),
                (plain.clip_frame, plain.start, plain.ball)
            );
            let (Some(Atlas::Pixels(pixels)), Some(Atlas::Encoded(file))) = (&given.atlas, &plain.atlas)
            else {
                panic!("not pixels and a file")
            };
            let file = image::load_from_memory(&file.bytes).unwrap().to_rgb8();
            let same = file.pixels().zip(pixels.rgba.as_chunks::<4>().0);
            assert!(same.into_iter().all(|(file, given)| file.0 == given[..3]));
            for (given, plain) in given.bodies.iter().zip(&plain.bodies) {
                assert_eq!((given.person, given.anchor_m), (plain.person, plain.anchor_m));
                assert_eq!(given.mesh.triangles.len(), plain.mesh.triangles.len());
                for position in &given.mesh.positions_m {
                    let apart =
                        |other: &[f32; 3]| (0..3).map(|k| (position[k] - other[k]).abs()).fold(0.0, f32::max);
                    let nearest = plain.mesh.positions_m.iter().map(apart).fold(f32::INFINITY, f32::min);
                    assert!(nearest < 0.000_05, "{nearest} m");
                }
            }
        }
        let again = folder.path().join("again");
        let manifest = convert(&converted, &again, Profile::Compact, || ()).unwrap();
        let names: Vec<&str> = manifest.representations.iter().map(|rung| rung.id.as_str()).collect();
        assert_eq!(names, ["low", "medium", "high"]);
        let people = |folder: &Path| {
            let frames = StreamReader::open(folder, &Limits::default()).unwrap().chunk(0).unwrap().frames;
            frames
                .iter()
                .map(|frame| frame.bodies.iter().map(|body| body.person).collect())
                .collect::<Vec<Vec<_>>>()
        };
        assert_eq!(people(&again), people(&from));
    }
}
