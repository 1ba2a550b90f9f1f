//! Writes an H.264 file through the `ffmpeg` program.

use std::{
    io::Write,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
};

use image::RgbImage;

use crate::SynthesisError;
pub use crate::chain::Rate;

/// An H.264 file being written.
pub struct Video {
    path: PathBuf,
    process: Child,
}

impl Video {
    /// Begins a file for pictures of one size, at a number of frames per second (a fraction).
    ///
    /// # Errors
    /// When the `ffmpeg` program cannot be started.
    pub fn start(
        path: &Path,
        (width, height): (u32, u32),
        (frames, seconds): (u32, u32),
        rate: Rate,
    ) -> Result<Self, SynthesisError> {
        let budget: Vec<String> = match rate {
            Rate::Quality(crf) => {
                ["-preset", "slow", "-crf", &crf.to_string(), "-g", "50"].map(str::to_owned).into()
            }
            Rate::Budget { bits_per_second, key_every } => {
                // Encoders of live pictures have little time and a small buffer.
                let (bits, buffer) = (bits_per_second.to_string(), bits_per_second.to_string());
                let key = key_every.to_string();
                ["-preset", "veryfast", "-b:v", &bits, "-maxrate", &bits, "-bufsize", &buffer, "-g", &key]
                    .map(str::to_owned)
                    .into()
            }
        };
        let process = Command::new("ffmpeg")
            .args(["-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"])
            .args(["-s", &format!("{width}x{height}"), "-r", &format!("{frames}/{seconds}"), "-i", "-"])
            .args(["-vf", "scale=out_color_matrix=bt709:out_range=tv", "-pix_fmt", "yuv420p"])
            .args(["-c:v", "libx264", "-threads", "1"])
            .args(budget)
            .args([
                "-colorspace",
                "bt709",
                "-color_primaries",
                "bt709",
                "-color_trc",
                "bt709",
                "-color_range",
                "tv",
            ])
            .args(["-fflags", "+bitexact", "-flags:v", "+bitexact", "-movflags", "+faststart"])
            .arg(path)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::inherit())
            .spawn()
            .map_err(SynthesisError::Encoder)?;
        Ok(Self { path: path.to_owned(), process })
    }

    /// Adds the next picture.
    ///
    /// # Errors
    /// When `ffmpeg` has stopped.
    pub fn push(&mut self, picture: &RgbImage) -> Result<(), SynthesisError> {
        let stopped = || std::io::Error::new(std::io::ErrorKind::BrokenPipe, "it takes no pictures");
        let pipe = self.process.stdin.as_mut().ok_or_else(stopped).map_err(SynthesisError::Encoder)?;
        pipe.write_all(picture.as_raw()).map_err(SynthesisError::Encoder)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// When `ffmpeg` reports a failure.
    pub fn finish(mut self) -> Result<(), SynthesisError> {
        drop(self.process.stdin.take());
        let status = self.process.wait().map_err(SynthesisError::Encoder)?;
        if !status.success() {
            let message = format!("ffmpeg left with {status} while writing {}", self.path.display());
            return Err(SynthesisError::Options(message));
        }
        Ok(())
    }
}
