//! A socket that gives up on a peer that has gone quiet, and counts what is written to it.

use std::{
    io,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
    time::Duration,
};

use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    time::{Instant, Sleep, sleep_until},
};

use super::metrics::{Cut, Metrics};

/// `inner`, failing with [`io::ErrorKind::TimedOut`] when no byte has moved for too long.
///
/// Only one task may use it, as hyper does: reading and writing share one timer.
pub(super) struct Watched<S> {
    inner: S,
    metrics: Arc<Metrics>,
    idle: Duration,
    stall: Duration,
    /// When a byte last moved, or when writing came to a halt.
    moved: Instant,
    writing_waits: bool,
    timer: Pin<Box<Sleep>>,
}

impl<S> Watched<S> {
    pub(super) fn new(inner: S, metrics: Arc<Metrics>, idle: Duration, stall: Duration) -> Self {
        let moved = Instant::now();
        let timer = Box::pin(sleep_until(moved + idle));
        Self { inner, metrics, idle, stall, moved, writing_waits: false, timer }
    }

    fn progress(&mut self) {
        self.moved = Instant::now();
    }

    fn wrote(&mut self, bytes: usize) {
        self.metrics.bytes_sent.inc_by(bytes as u64);
        self.writing_waits = false;
        self.progress();
    }

    /// The peer takes nothing: from now on the shorter patience counts.
    fn wait_to_write<T>(&mut self, context: &mut Context<'_>) -> Poll<io::Result<T>> {
        if !self.writing_waits {
            self.writing_waits = true;
            self.timer.as_mut().reset(Instant::now() + self.stall.min(self.idle));
        }
        self.wait(context)
    }

    /// Pending, or an error when patience has run out.
    fn wait<T>(&mut self, context: &mut Context<'_>) -> Poll<io::Result<T>> {
        loop {
            ready!(self.timer.as_mut().poll(context));
            let patience = if self.writing_waits { self.stall.min(self.idle) } else { self.idle };
            let end = self.moved + patience;
            if end <= Instant::now() {
                self.metrics.cut(if self.writing_waits { Cut::Stalled } else { Cut::Idle });
                return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
            }
            self.timer.as_mut().reset(end);
        }
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Watched<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        match Pin::new(&mut self.inner).poll_read(context, buffer) {
            Poll::Ready(result) => {
                self.progress();
                Poll::Ready(result)
            }
            Poll::Pending => self.wait(context),
        }
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Watched<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        match Pin::new(&mut self.inner).poll_write(context, bytes) {
            Poll::Ready(Ok(count)) => {
                self.wrote(count);
                Poll::Ready(Ok(count))
            }
            Poll::Ready(error) => Poll::Ready(error),
            Poll::Pending => self.wait_to_write(context),
        }
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        match Pin::new(&mut self.inner).poll_write_vectored(context, slices) {
            Poll::Ready(Ok(count)) => {
                self.wrote(count);
                Poll::Ready(Ok(count))
            }
            Poll::Ready(error) => Poll::Ready(error),
            Poll::Pending => self.wait_to_write(context),
        }
    }

    fn is_write_vectored(&self) -> bool {
        self.inner.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        match Pin::new(&mut self.inner).poll_flush(context) {
            Poll::Pending => self.wait_to_write(context),
            ready => ready,
        }
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt, duplex};

    use super::*;

    const IDLE: Duration = Duration::from_secs(60);
    const STALL: Duration = Duration::from_secs(30);

    fn watched(buffer: usize) -> (Watched<tokio::io::DuplexStream>, tokio::io::DuplexStream, Arc<Metrics>) {
        let (near, far) = duplex(buffer);
        let metrics = Arc::new(Metrics::new());
        (Watched::new(near, metrics.clone(), IDLE, STALL), far, metrics)
    }

    // The clock of these tests stands still until everybody waits, and then jumps.
    #[tokio::test(start_paused = true)]
    async fn a_quiet_peer_is_given_up_after_the_idle_time() {
        let (mut near, mut far, _) = watched(64);
        let start = Instant::now();
        let talk = async {
            tokio::time::sleep(IDLE / 2).await;
            far.write_all(b"a").await.unwrap();
            // Still there, but silent.
            std::future::pending::<()>().await;
        };
        let listen = async {
            assert_eq!(near.read_u8().await.unwrap(), b'a');
            near.read_u8().await.unwrap_err()
        };
        let error = tokio::select! { () = talk => unreachable!(), error = listen => error };
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
        assert!((IDLE * 3 / 2..IDLE * 2).contains(&start.elapsed()), "{:?}", start.elapsed());
    }

    #[tokio::test(start_paused = true)]
    async fn a_peer_that_takes_nothing_is_given_up_sooner() {
        let (mut near, far, metrics) = watched(4);
        let start = Instant::now();
        let error = near.write_all(b"12345678").await.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
        assert!((STALL..IDLE).contains(&start.elapsed()), "{:?}", start.elapsed());
        assert_eq!(metrics.bytes_sent.get(), 4);
        drop(far);
    }

    #[tokio::test(start_paused = true)]
    async fn a_slow_peer_is_served_to_the_end() {
        let (mut near, mut far, metrics) = watched(4);
        let take = async {
            let mut taken = 0;
            while taken < 40 {
                tokio::time::sleep(STALL * 9 / 10).await;
                taken += far.read(&mut [0; 4]).await.unwrap();
            }
        };
        let (result, ()) = tokio::join!(near.write_all(&[7; 40]), take);
        result.unwrap();
        assert_eq!(metrics.bytes_sent.get(), 40);
    }
}
