//! The command line of `reconstructor`: what can be asked for, in which words.

use std::{net::SocketAddr, ops::Range, path::PathBuf};

use clap::{Args, Parser, Subcommand};
use protocol::{manifest::Profile, pitch::Pitch};
use reconstructor::{calibration::is_possible, tracking::TrackingMethod};
use serving::server::{self, ServeOptions, Tls};

/// Turns a broadcast football clip into a match that stands on a table.
#[derive(Debug, Parser)]
#[command(version, about, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Reconstruct a clip into a stream that players show.
    #[command(
        after_help = "Example:\n  reconstructor reconstruct clip.mp4 --frames 150..450 --out stream --work work --report report.json"
    )]
    Reconstruct(Reconstruct),
    /// Find the camera of every frame of a clip, or of pictures of one shot.
    #[command(
        after_help = "Examples:\n  reconstructor calibrate clip.mp4 --out cameras.json --overlay overlay.mp4\n  reconstructor calibrate clip.mp4 --pitch 100x64 --calibration points.json --out cameras.json"
    )]
    Calibrate(Calibrate),
    /// Render a broadcast clip of a match together with its ground truth.
    #[command(
        after_help = "Examples:\n  reconstructor synthesize --out demo --seed 7 --frames 100 --size 1280x720\n  reconstructor synthesize --out mine --frames 1500 --maps --camera 0,22,70 --player-px 60 --size 1920x1080\n  reconstructor synthesize --out cuts --frames 300 --shots main:150~0,close-up:50~8,main"
    )]
    Synthesize(Synthesize),
    /// Measure results against ground truth.
    #[command(subcommand)]
    Evaluate(Evaluate),
    /// Write a stream of one profile as one of the other.
    #[command(
        after_help = "Example:\n  reconstructor convert stream --profile plain --out plain     # chunks that every glTF viewer plays"
    )]
    Convert(Convert),
    /// Serve a stream over HTTP until Ctrl-C.
    #[command(
        after_help = "Examples:\n  reconstructor serve stream --listen 127.0.0.1:8420\n  reconstructor serve stream --listen 0.0.0.0:8420 --tls-cert cert.pem --tls-key key.pem --max-connections 2000"
    )]
    Serve(Serve),
}

#[derive(Debug, Args)]
pub(crate) struct Reconstruct {
    /// The clip: H.264, HEVC or AV1 in any common file.
    pub(crate) clip: PathBuf,
    /// Folder for the stream; an older stream in it is replaced.
    #[arg(long, value_name = "STREAM")]
    pub(crate) out: PathBuf,
    /// Points of the pitch in one frame, or cameras (SoccerNet's JSON or what `calibrate` wrote): they win for their shots, all
    /// others are found without.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) calibration: Option<PathBuf>,
    /// Length and width of the pitch in metres; 105x68 when neither this nor the calibration says.
    #[arg(long, value_name = "LxW", value_parser = pitch)]
    pub(crate) pitch: Option<Pitch>,
    /// Frames of the clip, from A up to but without B; all when not given.
    #[arg(long, value_name = "A..B", value_parser = frame_range)]
    pub(crate) frames: Option<Range<u32>>,
    /// How chunks are made: `compact` has three qualities and is small, `plain` plays in every glTF viewer.
    #[arg(long, value_name = "compact|plain", default_value = "compact", value_parser = profile)]
    pub(crate) profile: Profile,
    /// Folder that keeps the results of stages, so that interrupted work resumes.
    #[arg(long, value_name = "DIR")]
    pub(crate) work: Option<PathBuf>,
    /// Write figures per frame and stage, and everything that was left out.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) report: Option<PathBuf>,
    /// Folder for pictures with masks, ids, lines and the ball drawn in, or an .mp4 file for a video of them (needs ffmpeg).
    #[arg(long, value_name = "DIR|FILE.mp4")]
    pub(crate) overlay: Option<PathBuf>,
    /// How people are followed: `global` is the usual one, `greedy` the paper's, as a baseline.
    #[arg(long, value_name = "global|greedy", default_value = "global", value_parser = tracking)]
    pub(crate) tracking: TrackingMethod,
    /// Triangles per body at most.
    #[arg(long, value_name = "N", default_value_t = 1_000, value_parser = clap::value_parser!(u32).range(50..=100_000))]
    pub(crate) triangles: u32,
    /// Frames worked on at a time; one per core when not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) threads: Option<u16>,
}

#[derive(Debug, Args)]
pub(crate) struct Calibrate {
    /// One clip, or pictures of one shot in order.
    #[arg(required = true, value_name = "CLIP|IMAGE")]
    pub(crate) inputs: Vec<PathBuf>,
    /// Points of the pitch in one frame, or cameras (SoccerNet's JSON or what this command wrote): they win for their shots,
    /// all others are found without.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) calibration: Option<PathBuf>,
    /// Length and width of the pitch in metres; 105x68 when neither this nor the calibration says.
    #[arg(long, value_name = "LxW", value_parser = pitch)]
    pub(crate) pitch: Option<Pitch>,
    /// Where the cameras go.
    #[arg(long, value_name = "CAMERAS.json")]
    pub(crate) out: PathBuf,
    /// Frames of the clip, from A up to but without B; all when not given.
    #[arg(long, value_name = "A..B", value_parser = frame_range)]
    pub(crate) frames: Option<Range<u32>>,
    /// Folder for pictures with the pitch lines drawn in, or an .mp4 file for a video of them (needs ffmpeg).
    #[arg(long, value_name = "DIR|FILE.mp4")]
    pub(crate) overlay: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct Synthesize {
    /// Folder for the clip and its truth.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Everything random follows from it: the same seed gives the same clip.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Length of the clip in frames.
    #[arg(long, value_name = "N", default_value_t = 125, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) frames: u32,
    /// Width and height of the picture in pixels, even numbers.
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = size)]
    pub(crate) size: (u32, u32),
    /// Recorded paths of players and ball (form: assets/demo/README.md); made up when not given.
    #[arg(long, value_name = "FILE")]
    pub(crate) trajectories: Option<PathBuf>,
    /// Where in the recording the clip starts, seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    pub(crate) start: f64,
    /// Cameras on air: KIND:FRAMES~DISSOLVE, …; kinds are main, high-behind and close-up.
    #[arg(long, value_name = "SHOTS", default_value = "main")]
    pub(crate) shots: synthesis::shots::Shots,
    /// Where your main camera stands: metres along the touchline from the halfway line, up, and towards it from the centre mark.
    #[arg(long, value_name = "X,Y,Z", value_parser = place, allow_hyphen_values = true)]
    pub(crate) camera: Option<[f64; 3]>,
    /// How high that camera shows a player in the middle of the picture.
    #[arg(long, value_name = "PIXELS", requires = "camera")]
    pub(crate) player_px: Option<f64>,
    /// Ground, light, camera and broadcast chain: all drawn from the seed, or one plain evening ground.
    #[arg(long, value_name = "drawn|plain", default_value = "drawn")]
    pub(crate) setting: synthesis::venue::Setting,
    /// Quality of the H.264 file, x264's CRF 0..51; a broadcaster's bitrate drawn from the seed when not given.
    #[arg(long, value_name = "CRF", value_parser = clap::value_parser!(u8).range(0..=51))]
    pub(crate) crf: Option<u8>,
    /// Triangles of each true surface, about.
    #[arg(long, value_name = "N", default_value_t = 1_500, value_parser = clap::value_parser!(u32).range(50..=100_000))]
    pub(crate) truth_triangles: u32,
    /// Also write every frame's maps: people, lines, first and last surfaces (PNG).
    #[arg(long)]
    pub(crate) maps: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Evaluate {
    /// A reconstructed stream against the true one in DATA/truth.
    #[command(
        after_help = "Example:\n  reconstructor evaluate match --data assets/demo --stream target/demo/stream --json match.json"
    )]
    Match(EvaluateMatch),
    /// What the compact profile costs and loses, rung by rung, against one Draco mesh and JPEG per frame.
    #[command(
        after_help = "Example:\n  reconstructor reconstruct clip.mp4 --profile plain --out plain\n  reconstructor evaluate stream --stream plain --json stream.json"
    )]
    Stream(EvaluateStream),
    /// Depth of rendered players against their true depth.
    #[command(after_help = "Example:\n  reconstructor evaluate depth --data heldout --json depth.json")]
    Depth(EvaluateDepth),
    /// Cameras against the true ones of a rendered clip, or against annotated pitch points of pictures.
    #[command(
        after_help = "Example:\n  reconstructor evaluate calibration --data assets/demo --json calibration.json"
    )]
    Calibration(EvaluateCalibration),
    /// Share of the people on the pitch that are found in labelled pictures, and how much else is.
    #[command(
        after_help = "Example:\n  cargo xtask dataset frames-test --count 48\n  reconstructor evaluate detection --data target/datasets/frames-test --json detection.json"
    )]
    Detection(EvaluateDetection),
    /// Who is who over time in a rendered clip, against its truth: HOTA, identities, teams, with the greedy baseline beside it.
    #[command(
        after_help = "Example:\n  reconstructor synthesize --out target/clip --seed 7 --frames 250 --shots main:100,high-behind:50,main\n  reconstructor evaluate tracking --data target/clip --json tracking.json"
    )]
    Tracking(EvaluateTracking),
    /// How well masks fit the true visible pixels of people in a rendered clip, method by method, and how far joints are off.
    #[command(
        after_help = "Example:\n  reconstructor synthesize --out clip --seed 7 --frames 100 --maps\n  reconstructor evaluate segmentation --data clip --json segmentation.json"
    )]
    Segmentation(EvaluateSegmentation),
    /// How like real broadcasts rendered pictures are: both measured alike, worst measure first.
    #[command(
        after_help = "Example:\n  cargo xtask dataset frames-test --count 48\n  reconstructor evaluate realism --real ../shared/data/detection/dfl --ours target/datasets/frames-test --json realism.json"
    )]
    Realism(EvaluateRealism),
}

#[derive(Debug, Args)]
pub(crate) struct EvaluateDetection {
    /// Labelled pictures: `images/` and `labels/` in the YOLO form (classes ball, goalkeeper, player, referee).
    #[arg(long, value_name = "DIR")]
    pub(crate) data: PathBuf,
    /// Where the figures go.
    #[arg(long, value_name = "FILE")]
    pub(crate) json: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct EvaluateTracking {
    /// Folder that `synthesize` wrote.
    #[arg(long, value_name = "DIR")]
    pub(crate) data: PathBuf,
    /// Where the figures go.
    #[arg(long, value_name = "FILE")]
    pub(crate) json: PathBuf,
    /// Folder that keeps the results of stages, so that interrupted work resumes.
    #[arg(long, value_name = "DIR")]
    pub(crate) work: Option<PathBuf>,
    /// Also write our tracks in the form of the MOT Challenge, for TrackEval and others.
    #[arg(long, value_name = "FILE.txt")]
    pub(crate) tracks: Option<PathBuf>,
    /// Frames worked on at a time; one per core when not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) threads: Option<u16>,
}

#[derive(Debug, Args)]
pub(crate) struct EvaluateSegmentation {
    /// Folder that `synthesize --maps` wrote.
    #[arg(long, value_name = "DIR")]
    pub(crate) data: PathBuf,
    /// Folder that keeps the results of the stages before, so that interrupted work resumes.
    #[arg(long, value_name = "DIR")]
    pub(crate) work: Option<PathBuf>,
    /// Where the figures go.
    #[arg(long, value_name = "FILE")]
    pub(crate) json: PathBuf,
    /// Measure only this method; may be repeated. The default's figures come first when none is given, then all others'.
    #[arg(long, value_name = "METHOD")]
    pub(crate) segmentation: Vec<reconstructor::segmentation::Method>,
}

#[derive(Debug, Args)]
pub(crate) struct EvaluateRealism {
    /// Real labelled pictures: `images/` and `labels/` in the YOLO form (classes ball, goalkeeper, player, referee).
    #[arg(long, value_name = "DIR")]
    pub(crate) real: PathBuf,
    /// Rendered pictures in the same form, as `cargo xtask dataset frames-test` writes them.
    #[arg(long, value_name = "DIR")]
    pub(crate) ours: PathBuf,
    /// Where the figures go.
    #[arg(long, value_name = "FILE")]
    pub(crate) json: PathBuf,
    /// Also draw real pictures beside rendered ones of the same camera.
    #[arg(long, value_name = "OUT.png", requires = "annotated")]
    pub(crate) sheet: Option<PathBuf>,
    /// Where the sheet's real pictures are: SoccerNet keypoints (`pitch_points.json`, `images/`, `labels/`).
    #[arg(long, value_name = "DIR")]
    pub(crate) annotated: Option<PathBuf>,
    /// The seed of the sheet's first rendered picture.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
}

#[derive(Debug, Args)]
pub(crate) struct EvaluateCalibration {
    /// Folder that `synthesize` or `cargo xtask dataset frames-test` wrote, SoccerNet keypoints (`pitch_points.json`, `images/`,
    /// `labels/`), or World Cup 2014 homographies (`homographies.json`).
    #[arg(long, value_name = "DIR")]
    pub(crate) data: PathBuf,
    /// Where the figures go.
    #[arg(long, value_name = "FILE")]
    pub(crate) json: PathBuf,
    /// Give points as a person would: four annotated ones of each picture, measured at the others; a rendered clip's
    /// correspondences.
    #[arg(long)]
    pub(crate) clicks: bool,
    /// Leave a part of the fit out, to see what it is worth; may be repeated.
    #[arg(long, value_name = "PART", conflicts_with = "clicks")]
    pub(crate) without: Vec<reconstructor::evaluate::calibration::Part>,
}

#[derive(Debug, Args)]
pub(crate) struct EvaluateMatch {
    /// Folder that holds the true stream as `truth/match.json`.
    #[arg(long, value_name = "DIR")]
    pub(crate) data: PathBuf,
    /// The reconstructed stream.
    #[arg(long, value_name = "STREAM")]
    pub(crate) stream: PathBuf,
    /// Where the figures go.
    #[arg(long, value_name = "FILE")]
    pub(crate) json: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Convert {
    /// The stream; its best quality is taken.
    pub(crate) stream: PathBuf,
    /// How the new stream's chunks are made. To `plain` nothing is lost but a thirtieth of a millimetre.
    #[arg(long, value_name = "compact|plain", value_parser = profile)]
    pub(crate) profile: Profile,
    /// Folder for the new stream; an older stream in it is replaced.
    #[arg(long, value_name = "STREAM")]
    pub(crate) out: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct EvaluateStream {
    /// A stream of the plain profile: what the codec is given.
    #[arg(long, value_name = "STREAM")]
    pub(crate) stream: PathBuf,
    /// Also draw rate over distortion.
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) plot: Option<PathBuf>,
    /// Measure one chunk of so many; all when not given.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) every: u32,
    /// Where the figures go.
    #[arg(long, value_name = "FILE")]
    pub(crate) json: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct EvaluateDepth {
    /// Folder of rendered players with their depth.
    #[arg(long, value_name = "DIR")]
    pub(crate) data: PathBuf,
    /// Where the figures go.
    #[arg(long, value_name = "FILE")]
    pub(crate) json: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Serve {
    /// Folder of the stream.
    pub(crate) stream: PathBuf,
    /// Address and port.
    #[arg(long, value_name = "ADDR", default_value = server::DEFAULT_ADDRESS)]
    pub(crate) listen: SocketAddr,
    /// Certificate chain for HTTPS, the server's own certificate first.
    #[arg(long, value_name = "FILE.pem", requires = "tls_key")]
    pub(crate) tls_cert: Option<PathBuf>,
    /// Private key of that certificate.
    #[arg(long, value_name = "FILE.pem", requires = "tls_cert")]
    pub(crate) tls_key: Option<PathBuf>,
    /// HTTPS with a certificate made for this run; its fingerprint is printed.
    #[arg(long, conflicts_with = "tls_cert")]
    pub(crate) tls_self_made: bool,
    /// Connections open at a time; further ones are closed at once. More than 400 may need a higher `ulimit -n`.
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) max_connections: u32,
}

impl Serve {
    /// The server's options.
    pub(crate) fn options(&self) -> ServeOptions {
        let tls = match (&self.tls_cert, &self.tls_key) {
            (Some(certificate), Some(key)) => {
                Tls::Files { certificate: certificate.clone(), key: key.clone() }
            }
            _ if self.tls_self_made => Tls::SelfMade,
            _ => Tls::Off,
        };
        let max_connections = usize::try_from(self.max_connections).unwrap_or(usize::MAX);
        ServeOptions { address: self.listen, tls, max_connections, ..ServeOptions::default() }
    }
}

/// `X,Y,Z` in metres.
fn place(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text.split(',').map_while(|word| word.trim().parse().ok()).collect();
    <[f64; 3]>::try_from(numbers)
        .ok()
        .filter(|place| text.split(',').count() == 3 && place.iter().all(|v| v.is_finite()))
        .ok_or_else(|| format!("`{text}` is no place; write it in metres as 0,22,70"))
}

/// `A..B` as a range of frames that is not empty.
fn frame_range(text: &str) -> Result<Range<u32>, String> {
    let wrong = || format!("`{text}` is not a range of frames; write it as 150..450");
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    let (start, end) = (start.trim().parse().map_err(|_| wrong())?, end.trim().parse().map_err(|_| wrong())?);
    if start < end {
        Ok(start..end)
    } else {
        Err(format!("`{text}` holds no frames; the end must be larger"))
    }
}

/// The name of a way to follow people.
fn profile(text: &str) -> Result<Profile, String> {
    match text {
        "compact" => Ok(Profile::Compact),
        "plain" => Ok(Profile::Plain),
        _ => Err(format!("`{text}` is no profile; write compact or plain")),
    }
}

fn tracking(text: &str) -> Result<TrackingMethod, String> {
    match text {
        "global" => Ok(TrackingMethod::Global),
        "greedy" => Ok(TrackingMethod::Greedy),
        _ => Err(format!("`{text}` is no way to follow people; write global or greedy")),
    }
}

/// `LxW` as a pitch in metres.
fn pitch(text: &str) -> Result<Pitch, String> {
    let wrong = || format!("`{text}` is no pitch; write length and width in metres as 105x68");
    let (length, width) = text.split_once('x').ok_or_else(wrong)?;
    let pitch = Pitch {
        length_m: length.trim().parse().map_err(|_| wrong())?,
        width_m: width.trim().parse().map_err(|_| wrong())?,
    };
    is_possible(&pitch)
        .then_some(pitch)
        .ok_or_else(|| format!("`{text}`: length is 40 to 150 m, width 30 to 110 m"))
}

/// `WxH` as a size in pixels.
fn size(text: &str) -> Result<(u32, u32), String> {
    let wrong = || format!("`{text}` is not a size; write it as 1280x720");
    let (width, height) = text.split_once('x').ok_or_else(wrong)?;
    Ok((width.parse().map_err(|_| wrong())?, height.parse().map_err(|_| wrong())?))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_certificate_goes_with_its_key() {
        let options = |words: &[&str]| {
            let words = ["reconstructor", "serve", "stream"].iter().chain(words);
            match Cli::try_parse_from(words).map(|cli| cli.command) {
                Ok(Command::Serve(serve)) => Some(serve.options()),
                _ => None,
            }
        };
        assert_eq!(options(&[]), Some(ServeOptions::default()));
        let files = Tls::Files { certificate: "a".into(), key: "b".into() };
        assert_eq!(options(&["--tls-cert", "a", "--tls-key", "b"]).map(|options| options.tls), Some(files));
        assert_eq!(options(&["--tls-self-made"]).map(|options| options.tls), Some(Tls::SelfMade));
        assert_eq!(options(&["--max-connections", "9"]).map(|options| options.max_connections), Some(9));
        for wrong in [
            &["--tls-cert", "a"] as &[_],
            &["--tls-key", "b"],
            &["--tls-self-made", "--tls-cert", "a", "--tls-key", "b"],
            &["--max-connections", "0"],
        ] {
            assert_eq!(options(wrong), None, "{wrong:?}");
        }
    }

    #[test]
    fn ranges_are_read_and_bad_ones_explained() {
        assert_eq!(frame_range("150..450"), Ok(150..450));
        for wrong in ["", "5", "5..", "..5", "a..b", "-1..5", "5..5", "9..5", "0..4294967296"] {
            let message = frame_range(wrong).unwrap_err();
            assert!(message.contains(wrong), "{message}");
        }
    }

    #[test]
    fn sizes_are_read_and_bad_ones_explained() {
        assert_eq!(size("1280x720"), Ok((1280, 720)));
        for wrong in ["", "1280", "1280x", "x720", "-1x5", "a×b"] {
            assert!(size(wrong).unwrap_err().contains("1280x720"));
        }
    }

    #[test]
    fn pitches_are_read_and_bad_ones_explained() {
        assert_eq!(pitch("100.5x64"), Ok(Pitch { length_m: 100.5, width_m: 64.0 }));
        for wrong in ["", "105", "105x", "-105x68", "10x68", "105x999", "NaNx68"] {
            assert!(pitch(wrong).unwrap_err().contains(wrong), "{wrong}");
        }
    }

    #[test]
    fn every_command_shows_an_example() {
        fn check(command: &clap::Command) {
            let children: Vec<_> = command.get_subcommands().collect();
            if children.is_empty() {
                let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
                assert!(help.contains("Example"), "{} has no example", command.get_name());
            }
            children.into_iter().for_each(check);
        }
        check(&Cli::command());
    }
}
