//! One pass over the video stream of a file: pictures in presentation order with their times.
//!
//! Frame numbers count decoded pictures from the start, as `ffmpeg -vf select=eq(n\,N)` does: packets before the edit list's
//! start are decoded and dropped by FFmpeg, so a container's own frame count may be larger.

use std::{ffi::OsString, path::Path, sync::Once};

use ffmpeg_the_third as ffmpeg;

use ffmpeg::{
    Dictionary, Rational, Rescale, codec, decoder, format, format::stream::Disposition, log, media,
    util::frame::video::Video,
};
use protocol::time::Timescale;

use super::{IngestError, MAX_SIDE_PX, MIN_SIDE_PX, colour};

/// Containers that hold broadcast video. Play lists and the like, which make FFmpeg open other files, are not among them.
const CONTAINERS: &str = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,mpegts,mpeg,avi,flv,mxf,ivf,obu,h264,hevc,asf,gxf,nut,\
                          ogg,wav,mp3,aac,flac";

/// A file opened for decoding, one picture at a time.
pub(super) struct Source {
    input: format::context::Input,
    decoder: decoder::Video,
    stream: usize,
    time_base: Rational,
    rate: Rational,
    picture: Video,
    /// The picture was decoded by [`Self::seek`] and has not been given yet.
    pending: bool,
    at_end: bool,
    /// Pictures given so far, counted from the start of the file.
    decoded: u32,
    /// Damage before this frame is passed over.
    start: u32,
    path: std::path::PathBuf,
}

impl Source {
    /// Opens `path`; damage before frame `start` will be passed over.
    pub(super) fn open(path: &Path, start: u32) -> Result<Self, IngestError> {
        static QUIET: Once = Once::new();
        QUIET.call_once(|| log::set_level(log::Level::Quiet)); // Every failure is returned as an error with its place.
        let opened = std::fs::File::open(path).and_then(|file| file.metadata());
        let metadata = opened.map_err(|source| IngestError::Open { path: path.into(), source })?;
        if metadata.is_dir() {
            let source = std::io::Error::from(std::io::ErrorKind::IsADirectory);
            return Err(IngestError::Open { path: path.into(), source });
        }
        let container =
            |e: ffmpeg::Error| IngestError::Container { path: path.into(), reason: e.to_string() };
        let mut options = Dictionary::new();
        options.set("protocol_whitelist", "file");
        options.set("format_whitelist", CONTAINERS);
        let mut url = OsString::from("file:");
        url.push(path);
        let input = format::input_with_dictionary(&url, options).map_err(container)?;

        let stream = input
            .streams()
            .best(media::Type::Video)
            .filter(|stream| !stream.disposition().contains(Disposition::ATTACHED_PIC))
            .ok_or_else(|| IngestError::NoVideo { path: path.into() })?;
        let (index, time_base, rate) = (stream.index(), stream.time_base(), stream.rate());
        let id = stream.parameters().id();
        let unsupported = |e: ffmpeg::Error| IngestError::Codec {
            path: path.into(),
            codec: id.name().to_owned(),
            reason: e.to_string(),
        };
        let context = codec::Context::from_parameters(stream.parameters()).map_err(unsupported)?;
        let implementation = decoder::find(id).ok_or_else(|| unsupported(ffmpeg::Error::DecoderNotFound))?;
        let mut options = Dictionary::new();
        options.set("max_pixels", (u64::from(MAX_SIDE_PX) * u64::from(MAX_SIDE_PX)).to_string());
        // One thread: errors then come with the frame they belong to, and the stages after this one need the cores.
        options.set("threads", "1");
        let decoder = context
            .decoder()
            .open_as_with(implementation, options)
            .and_then(|opened| opened.video())
            .map_err(unsupported)?;
        Ok(Self {
            input,
            decoder,
            stream: index,
            time_base,
            rate,
            picture: Video::empty(),
            pending: false,
            at_end: false,
            decoded: 0,
            start,
            path: path.into(),
        })
    }

    /// Ticks per second of the stream's times.
    pub(super) fn timescale(&self) -> Option<Timescale> {
        let numerator = u32::try_from(self.time_base.denominator()).ok()?;
        let denominator = u32::try_from(self.time_base.numerator()).ok()?;
        Timescale::new(numerator, denominator)
    }

    /// The nominal frame duration in ticks, at least 1.
    pub(super) fn nominal_duration(&self) -> Option<i64> {
        (self.rate.numerator() > 0 && self.rate.denominator() > 0)
            .then(|| 1.rescale(self.rate.invert(), self.time_base).max(1))
    }

    /// The picture of the last successful [`Self::advance`].
    pub(super) fn picture(&self) -> &Video {
        &self.picture
    }

    /// When that picture is shown, in ticks of the stream, if the file says.
    pub(super) fn timestamp(&self) -> Option<i64> {
        self.picture.timestamp()
    }

    /// Goes to the key frame shown at `timestamp`, whose index in the clip is `frame`; the next [`Self::advance`] gives it.
    /// `false` when the container does not lead there: the source is then of no more use.
    pub(super) fn seek(&mut self, timestamp: i64, frame: u32) -> Result<bool, IngestError> {
        let microseconds = timestamp.rescale(self.time_base, Rational::new(1, 1_000_000));
        if self.input.seek(microseconds, ..=microseconds).is_err() {
            return Ok(false);
        }
        self.decoder.flush();
        // Pictures that lean on what came before the key frame may be damaged and come out first; they are skipped.
        while self.advance()? {
            match self.timestamp() {
                Some(t) if t < timestamp => self.decoded = 0,
                Some(t) if t == timestamp => {
                    self.decoded = frame;
                    self.pending = true;
                    return Ok(true);
                }
                _ => break,
            }
        }
        Ok(false)
    }

    /// Decodes the next picture; `false` at the end of the stream.
    pub(super) fn advance(&mut self) -> Result<bool, IngestError> {
        if std::mem::take(&mut self.pending) {
            self.decoded = self.decoded.saturating_add(1);
            return Ok(true);
        }
        loop {
            match self.decoder.receive_frame(&mut self.picture) {
                Ok(()) => return self.accept().map(|()| true),
                Err(ffmpeg::Error::Eof) => return Ok(false),
                Err(ffmpeg::Error::Other { errno }) if wants_more(errno) => {}
                Err(e) => self.pass_over(&e.to_string())?,
            }
            if self.at_end {
                return Ok(false);
            }
            self.feed()?;
        }
    }

    /// Hands the decoder the next packet of the stream, or the end.
    fn feed(&mut self) -> Result<(), IngestError> {
        let packet = loop {
            match self.input.packets().next() {
                None => break None,
                Some(Ok((stream, packet))) if stream.index() == self.stream => break Some(packet),
                Some(Ok(_)) => {}
                Some(Err(e)) => return Err(self.damaged(&e.to_string())),
            }
        };
        let result = match &packet {
            Some(packet) if packet.is_corrupt() => return self.pass_over("the file ends inside a frame"),
            Some(packet) => self.decoder.send_packet(packet),
            None => self.decoder.send_eof(),
        };
        match result {
            Ok(()) | Err(ffmpeg::Error::Eof) => {}
            Err(e) => self.pass_over(&e.to_string())?,
        }
        if packet.is_none() {
            // The decoder still holds pictures; they are drained before `Eof` comes.
            self.at_end = !matches!(result, Ok(()));
        }
        Ok(())
    }

    fn accept(&mut self) -> Result<(), IngestError> {
        let (width, height) = (self.picture.width(), self.picture.height());
        let sides = MIN_SIDE_PX..=MAX_SIDE_PX;
        if !sides.contains(&width) || !sides.contains(&height) {
            let (path, frame) = (self.path.clone(), self.decoded);
            return Err(IngestError::PictureSize {
                path,
                frame,
                width,
                height,
                min: MIN_SIDE_PX,
                max: MAX_SIDE_PX,
            });
        }
        if colour::is_damaged(&self.picture) {
            self.pass_over("parts of the picture are missing")?;
        }
        self.decoded = self.decoded.saturating_add(1);
        Ok(())
    }

    /// Damage before the wanted frames, or before the first picture of a recording that starts mid-way, is only reported.
    fn pass_over(&self, reason: &str) -> Result<(), IngestError> {
        if self.decoded == 0 || self.decoded < self.start {
            tracing::warn!(clip = %self.path.display(), frame = self.decoded, reason, "passed over damaged video");
            return Ok(());
        }
        Err(self.damaged(reason))
    }

    fn damaged(&self, reason: &str) -> IngestError {
        IngestError::Damaged { path: self.path.clone(), frame: self.decoded, reason: reason.to_owned() }
    }
}

/// Whether an errno is EAGAIN: the decoder needs another packet.
fn wants_more(errno: i32) -> bool {
    std::io::Error::from_raw_os_error(errno).kind() == std::io::ErrorKind::WouldBlock
}
