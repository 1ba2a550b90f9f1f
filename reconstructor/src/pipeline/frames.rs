//! Frames in parallel: one thread decodes, a few work on whole frames, results come back in order of time.
//! Each worker owns its networks, and a bounded channel keeps the decoder only a few frames ahead.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Arc, Mutex, PoisonError, mpsc},
};

use super::PipelineError;
use crate::ingest::{Frame, IngestError};

/// Runs `work` on every frame that `wanted` names, on `threads` workers made by `make`; hands each result to `done` in
/// order of the frames. `open` starts the reading. The first error ends it all; otherwise returns how many frames were
/// done, fewer than wanted when the reading ended early.
pub(super) fn each_frame<I, W, R>(
    open: impl FnOnce() -> Result<I, IngestError> + Send,
    threads: usize,
    wanted: &[bool],
    make: impl Fn() -> Result<W, PipelineError> + Sync,
    work: impl Fn(&mut W, &Frame) -> Result<R, PipelineError> + Sync,
    mut done: impl FnMut(usize, R) -> Result<(), PipelineError>,
) -> Result<usize, PipelineError>
where
    I: Iterator<Item = Result<Frame, IngestError>>,
    R: Send,
{
    let is_wanted = |index: usize| wanted.get(index).copied().unwrap_or(false);
    let mut due: VecDeque<usize> = (0..wanted.len()).filter(|&index| is_wanted(index)).collect();
    if due.is_empty() {
        return Ok(0);
    }
    let (frame_sender, frames) = mpsc::sync_channel::<Frame>(threads.max(1));
    let frames = Arc::new(Mutex::new(frames));
    let (sender, results) = mpsc::channel::<Result<(usize, R), PipelineError>>();
    std::thread::scope(|scope| {
        let decoder = sender.clone();
        scope.spawn(move || {
            let read = || -> Result<(), IngestError> {
                for frame in open()? {
                    let frame = frame?;
                    // A closed channel: the workers have stopped and the reason is on its way.
                    if is_wanted(frame.index) && frame_sender.send(frame).is_err() {
                        break;
                    }
                }
                Ok(())
            };
            if let Err(error) = read() {
                let _ = decoder.send(Err(error.into()));
            }
        });
        for _ in 0..threads.max(1) {
            // Only workers hold the receiver, so that the decoder is released when the last of them stops.
            let (frames, sender, make, work) = (Arc::clone(&frames), sender.clone(), &make, &work);
            scope.spawn(move || {
                let mut worker = match make() {
                    Ok(worker) => worker,
                    Err(error) => {
                        let _ = sender.send(Err(error));
                        return;
                    }
                };
                loop {
                    let next = frames.lock().unwrap_or_else(PoisonError::into_inner).recv();
                    let Ok(frame) = next else { return };
                    let result = work(&mut worker, &frame).map(|result| (frame.index, result));
                    let failed = result.is_err();
                    if sender.send(result).is_err() || failed {
                        return;
                    }
                }
            });
        }
        drop((frames, sender));
        let mut early = BTreeMap::new();
        let mut read = 0;
        for result in results {
            let (index, result) = result?;
            early.insert(index, result);
            while let Some(result) = due.front().and_then(|next| early.remove(next)) {
                if let Some(index) = due.pop_front() {
                    done(index, result)?;
                    read += 1;
                }
            }
        }
        Ok(read)
    })
}

#[cfg(test)]
mod tests {
    use std::{path::PathBuf, time::Duration};

    use image::RgbImage;

    use super::*;

    fn frames(count: usize) -> impl Iterator<Item = Result<Frame, IngestError>> {
        (0..count).map(|index| Ok(Frame { index, image: RgbImage::new(2, 2) }))
    }

    #[test]
    fn results_come_in_order_whatever_each_takes() {
        let wanted: Vec<bool> = (0..40).map(|index| index % 3 != 1).collect();
        let mut seen = Vec::new();
        let done = each_frame(
            || Ok(frames(40)),
            4,
            &wanted,
            || Ok(()),
            |(), frame| {
                std::thread::sleep(Duration::from_millis((frame.index * 7 % 5) as u64));
                Ok(frame.index * 2)
            },
            |index, result| {
                assert_eq!(result, index * 2);
                seen.push(index);
                Ok(())
            },
        );
        let expected: Vec<usize> = (0..40).filter(|index| index % 3 != 1).collect();
        assert_eq!(done.unwrap(), expected.len());
        assert_eq!(seen, expected);
    }

    #[test]
    fn an_error_anywhere_ends_the_work() {
        let missing = || IngestError::NoFrames { path: PathBuf::from("clip.mp4") };
        let run = |bad_read: bool, bad_make: bool, bad_work: bool, bad_done: bool| {
            each_frame(
                || Ok(frames(100).map(move |frame| if bad_read { Err(missing()) } else { frame })),
                2,
                &[true; 100],
                || if bad_make { Err(missing().into()) } else { Ok(()) },
                |(), frame| if bad_work && frame.index == 50 { Err(missing().into()) } else { Ok(()) },
                |index, ()| if bad_done && index == 50 { Err(missing().into()) } else { Ok(()) },
            )
        };
        assert!(run(true, false, false, false).is_err());
        assert!(run(false, true, false, false).is_err());
        assert!(run(false, false, true, false).is_err());
        assert!(run(false, false, false, true).is_err());
        assert_eq!(run(false, false, false, false).unwrap(), 100);
    }

    #[test]
    fn frames_that_never_come_are_counted() {
        let done = each_frame(|| Ok(frames(7)), 2, &[true; 10], || Ok(()), |(), _| Ok(()), |_, ()| Ok(()));
        assert_eq!(done.unwrap(), 7);
    }
}
