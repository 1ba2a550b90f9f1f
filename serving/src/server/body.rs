//! What an answer carries: nothing, a few bytes, or a file in pieces.
//!
//! A task of its own reads the file one piece ahead. A viewer that takes no piece for too long loses its connection, whichever
//! way it holds back: over HTTP/2 a viewer can leave one answer untaken while the connection itself stays lively.

use std::{
    io::{self, SeekFrom},
    ops::Range,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};

use hyper::body::{Bytes, Frame, SizeHint};
use tokio::{
    io::{AsyncReadExt, AsyncSeekExt},
    sync::{Notify, mpsc},
};

use super::metrics::{Cut, Metrics, RequestUnderWay};

/// How much of a file is in memory per answer, twice: one piece being sent and one waiting.
const PIECE: usize = 64 * 1024;

/// The body of an answer.
#[derive(Debug)]
pub(super) struct Body {
    source: Source,
    left: u64,
    /// Counts the request as under way until the body is given in full or dropped.
    under_way: Option<RequestUnderWay>,
}

#[derive(Debug)]
enum Source {
    Bytes(Option<Bytes>),
    Pieces(mpsc::Receiver<io::Result<Bytes>>),
}

impl Body {
    /// Nothing.
    pub(super) fn empty() -> Self {
        Self { source: Source::Bytes(None), left: 0, under_way: None }
    }

    /// These bytes.
    pub(super) fn bytes(bytes: impl Into<Bytes>) -> Self {
        let bytes = bytes.into();
        Self { left: bytes.len() as u64, source: Source::Bytes(Some(bytes)), under_way: None }
    }

    /// `part` of `file`. When nobody takes the next piece within `patience`, `cut` is notified.
    pub(super) fn file(
        file: std::fs::File,
        part: Range<u64>,
        patience: Duration,
        cut: Arc<Notify>,
        metrics: Arc<Metrics>,
    ) -> Self {
        let (sender, receiver) = mpsc::channel(1);
        let left = part.end - part.start;
        tokio::spawn(async move {
            if let Err(Untaken) = feed(file, part, patience, &sender).await {
                metrics.cut(Cut::Stalled);
                cut.notify_one();
            }
        });
        Self { source: Source::Pieces(receiver), left, under_way: None }
    }

    /// Keeps the request counted as under way while this body lasts.
    pub(super) fn during(self, under_way: RequestUnderWay) -> Self {
        Self { under_way: Some(under_way), ..self }
    }
}

/// Nobody took a piece in time.
struct Untaken;

async fn feed(
    file: std::fs::File,
    part: Range<u64>,
    patience: Duration,
    sender: &mpsc::Sender<io::Result<Bytes>>,
) -> Result<(), Untaken> {
    let mut file = tokio::fs::File::from_std(file);
    file.set_max_buf_size(PIECE);
    let mut left = part.end - part.start;
    let mut error = file.seek(SeekFrom::Start(part.start)).await.err();
    while left > 0 {
        let piece = match error.take() {
            Some(error) => Err(error),
            None => read(&mut file, left).await,
        };
        let taken = piece.as_ref().map_or(left, |piece| piece.len() as u64);
        match sender.send_timeout(piece, patience).await {
            Ok(()) => left -= taken,
            Err(mpsc::error::SendTimeoutError::Timeout(_)) => return Err(Untaken),
            // The viewer left.
            Err(mpsc::error::SendTimeoutError::Closed(_)) => return Ok(()),
        }
    }
    Ok(())
}

/// The next piece, not empty and not more than `left` bytes.
async fn read(file: &mut tokio::fs::File, left: u64) -> io::Result<Bytes> {
    let size = usize::try_from(left).map_or(PIECE, |left| left.min(PIECE));
    let mut piece = Vec::with_capacity(size);
    file.take(size as u64).read_to_end(&mut piece).await?;
    if piece.len() < size {
        // Somebody cut the file in place. The viewer sees an answer that breaks off, not a short one that looks whole.
        return Err(io::Error::new(
            io::ErrorKind::UnexpectedEof,
            "the file became shorter while it was sent",
        ));
    }
    Ok(piece.into())
}

impl hyper::body::Body for Body {
    type Data = Bytes;
    type Error = io::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, io::Error>>> {
        if self.left == 0 {
            self.under_way = None;
            return Poll::Ready(None);
        }
        let next = match &mut self.source {
            Source::Bytes(bytes) => Poll::Ready(bytes.take().map(Ok)),
            Source::Pieces(receiver) => receiver.poll_recv(context),
        };
        match next {
            Poll::Ready(Some(Ok(bytes))) => {
                self.left = self.left.saturating_sub(bytes.len() as u64);
                Poll::Ready(Some(Ok(Frame::data(bytes))))
            }
            Poll::Ready(Some(Err(error))) => Poll::Ready(Some(Err(error))),
            Poll::Ready(None) => Poll::Ready(Some(Err(io::ErrorKind::UnexpectedEof.into()))),
            Poll::Pending => Poll::Pending,
        }
    }

    fn is_end_stream(&self) -> bool {
        self.left == 0
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.left)
    }
}

#[cfg(test)]
mod tests {
    use std::{io::Write, time::Instant};

    use http_body_util::BodyExt;

    use super::*;

    fn file(bytes: &[u8]) -> std::fs::File {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        file
    }

    fn body(file: std::fs::File, part: Range<u64>, patience: Duration, cut: &Arc<Notify>) -> Body {
        Body::file(file, part, patience, cut.clone(), Arc::new(Metrics::new()))
    }

    #[tokio::test]
    async fn a_part_of_a_file_comes_in_pieces() {
        let bytes: Vec<u8> = (0..300_000u32).map(|index| (index % 251) as u8).collect();
        let cut = Arc::new(Notify::new());
        for part in [0..300_000, 1..2, 65_536..65_537, 100..200_101, 299_999..300_000] {
            let whole =
                body(file(&bytes), part.clone(), Duration::from_secs(60), &cut).collect().await.unwrap();
            assert_eq!(whole.to_bytes(), &bytes[part.start as usize..part.end as usize]);
        }
    }

    #[tokio::test]
    async fn a_file_that_became_shorter_breaks_off() {
        let cut = Arc::new(Notify::new());
        let error = body(file(&[1; 100]), 0..101, Duration::from_secs(60), &cut).collect().await.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::UnexpectedEof);
    }

    #[tokio::test]
    async fn who_takes_nothing_is_cut_off() {
        let cut = Arc::new(Notify::new());
        let start = Instant::now();
        let patience = Duration::from_millis(50);
        let mut untaken = body(file(&[1; 10 * PIECE]), 0..10 * PIECE as u64, patience, &cut);
        untaken.frame().await.unwrap().unwrap();
        cut.notified().await;
        assert!(start.elapsed() >= patience);
    }
}
