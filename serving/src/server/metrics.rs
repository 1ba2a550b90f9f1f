//! What the server did, as numbers that Prometheus reads at `/metrics`.

use std::{sync::Arc, time::Instant};

use prometheus_client::{
    encoding::{EncodeLabelSet, EncodeLabelValue, text::encode},
    metrics::{counter::Counter, family::Family, gauge::Gauge, histogram::Histogram},
    registry::{Registry, Unit},
};

/// Upper ends of the histogram of seconds: from a file in memory to a phone on the edge of a cell.
const SECONDS: [f64; 11] = [0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 1.0, 5.0, 30.0];

/// Why the server closed a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, EncodeLabelValue)]
pub(super) enum Cut {
    /// More were open than allowed.
    Full,
    /// No whole request came in time.
    NoRequest,
    /// Nothing moved.
    Idle,
    /// The viewer did not take the answer.
    Stalled,
    /// The server stopped and the request was not done at the deadline.
    Stopped,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Status {
    status: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Reason {
    reason: Cut,
}

/// All figures of one server.
#[derive(Debug)]
pub(super) struct Metrics {
    registry: Registry,
    requests: Family<Status, Counter>,
    cuts: Family<Reason, Counter>,
    seconds: Histogram,
    in_flight: Gauge,
    connections: Gauge,
    /// Bytes given to sockets, TLS and headers included.
    pub(super) bytes_sent: Counter,
}

impl Metrics {
    pub(super) fn new() -> Self {
        let mut registry = Registry::with_prefix("holopitch");
        let requests = Family::default();
        let cuts = Family::default();
        let seconds = Histogram::new(SECONDS);
        let (in_flight, connections) = (Gauge::default(), Gauge::default());
        let bytes_sent = Counter::default();
        registry.register("requests", "Requests answered, by class of status", requests.clone());
        registry.register("connections_cut", "Connections closed by the server, by reason", cuts.clone());
        registry.register_with_unit(
            "request",
            "From the request's head to the last byte of the answer",
            Unit::Seconds,
            seconds.clone(),
        );
        registry.register(
            "requests_in_flight",
            "Requests whose answer is not given in full",
            in_flight.clone(),
        );
        registry.register("connections_open", "Connections open", connections.clone());
        registry.register_with_unit(
            "sent",
            "Given to sockets, TLS and headers included",
            Unit::Bytes,
            bytes_sent.clone(),
        );
        Self { registry, requests, cuts, seconds, in_flight, connections, bytes_sent }
    }

    /// Counts a connection that the server closes.
    pub(super) fn cut(&self, reason: Cut) {
        self.cuts.get_or_create(&Reason { reason }).inc();
    }

    /// A connection counts as open until the guard is dropped.
    pub(super) fn connection(self: &Arc<Self>) -> OpenConnection {
        self.connections.inc();
        OpenConnection(self.clone())
    }

    /// A request is under way until the guard is dropped.
    pub(super) fn request(self: &Arc<Self>) -> RequestUnderWay {
        self.in_flight.inc();
        RequestUnderWay { metrics: self.clone(), started: Instant::now() }
    }

    /// Counts an answer by its status.
    pub(super) fn answered(&self, status: hyper::StatusCode) {
        let status = match status.as_u16() / 100 {
            1 => "1xx",
            2 => "2xx",
            3 => "3xx",
            4 => "4xx",
            _ => "5xx",
        };
        self.requests.get_or_create(&Status { status }).inc();
    }

    /// The OpenMetrics text.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        if let Err(error) = encode(&mut text, &self.registry) {
            // Writing into a String does not fail.
            tracing::error!("the figures cannot be written: {error}");
        }
        text
    }
}

/// See [`Metrics::connection`].
#[derive(Debug)]
pub(super) struct OpenConnection(Arc<Metrics>);

impl Drop for OpenConnection {
    fn drop(&mut self) {
        self.0.connections.dec();
    }
}

/// See [`Metrics::request`].
#[derive(Debug)]
pub(super) struct RequestUnderWay {
    metrics: Arc<Metrics>,
    started: Instant,
}

impl Drop for RequestUnderWay {
    fn drop(&mut self) {
        self.metrics.in_flight.dec();
        self.metrics.seconds.observe(self.started.elapsed().as_secs_f64());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_holds_what_happened() {
        let metrics = Arc::new(Metrics::new());
        let connection = metrics.connection();
        let request = metrics.request();
        metrics.answered(hyper::StatusCode::PARTIAL_CONTENT);
        metrics.cut(Cut::NoRequest);
        metrics.bytes_sent.inc_by(5);
        let text = metrics.text();
        for line in [
            "holopitch_requests_total{status=\"2xx\"} 1",
            "holopitch_connections_cut_total{reason=\"NoRequest\"} 1",
            "holopitch_requests_in_flight 1",
            "holopitch_connections_open 1",
            "holopitch_sent_bytes_total 5",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} is not in\n{text}");
        }
        drop((connection, request));
        let text = metrics.text();
        for line in [
            "holopitch_requests_in_flight 0",
            "holopitch_connections_open 0",
            "holopitch_request_seconds_count 1",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} is not in\n{text}");
        }
    }
}
