//! Writes a tiny stream of walking box people:
//! `cargo run -p protocol --features sample --example sample_stream -- DIR [FRAMES] [PEOPLE]`

use std::{error::Error, path::PathBuf};

use protocol::{manifest::FILE_NAME, sample};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or("usage: sample_stream DIR [FRAMES] [PEOPLE]")?);
    let frames = arguments.next().map_or(Ok(100), |text| text.parse())?;
    let people = arguments.next().map_or(Ok(22), |text| text.parse())?;
    let stream = sample::match_of(frames, people)?;
    for (path, bytes) in &stream.files {
        let path = folder.join(path);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent)?;
        }
        std::fs::write(&path, bytes)?;
        println!("{} bytes  {}", bytes.len(), path.display());
    }
    std::fs::write(folder.join(FILE_NAME), stream.manifest.to_json()?)?;
    println!("{}", folder.join(FILE_NAME).display());
    Ok(())
}
