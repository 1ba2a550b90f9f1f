//! Rate over distortion as a picture: geometry on the left, texture on the right.

use std::fmt::Write as _;

use super::stream::{RateFigures, StreamFigures};

/// Size of a chart, and of the room round it, pixels.
const CHART: [f64; 2] = [330.0, 240.0];
const ROOM: f64 = 56.0;
/// The rates shown, Mbit/s.
const RATES: [f64; 2] = [0.0, 40.0];

/// What a chart shows upwards: its name, its range, and the value of a figure. What is beyond the range is drawn at its edge.
type Measure = (&'static str, [f64; 2], fn(&RateFigures) -> f64);

const MEASURES: [Measure; 2] = [
    ("surface error, mm (lower is better)", [0.0, 18.0], |figures| figures.error_mm),
    ("texture, dB (higher is better)", [24.0, 40.0], |figures| figures.psnr_db),
];

/// Draws the figures as an SVG file.
#[must_use]
pub fn plot(figures: &StreamFigures) -> String {
    let [width, height] = [2.0 * (CHART[0] + ROOM) + ROOM, CHART[1] + 2.0 * ROOM];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for (place, measure) in MEASURES.iter().enumerate() {
        chart(&mut svg, ROOM + place as f64 * (CHART[0] + ROOM), measure, figures);
    }
    svg.push_str("</svg>\n");
    svg
}

fn chart(svg: &mut String, left: f64, (name, range, value): &Measure, figures: &StreamFigures) {
    let along = |value: f64, [low, high]: [f64; 2]| ((value - low) / (high - low)).clamp(0.0, 1.0);
    let x = |rate: f64| left + CHART[0] * along(rate, RATES);
    let y = |value: f64| ROOM + CHART[1] * (1.0 - along(value, *range));
    // Writing to a string does not fail.
    let mut put = |line: String| {
        let _ = writeln!(svg, "{line}");
    };
    put(format!("<text x=\"{left}\" y=\"{}\">{name}</text>", ROOM - 10.0));
    for step in 0..=4 {
        let part = f64::from(step) / 4.0;
        let (rate, level) =
            (RATES[0] + part * (RATES[1] - RATES[0]), range[0] + part * (range[1] - range[0]));
        let (right, bottom) = (left + CHART[0], ROOM + CHART[1]);
        put(format!(
            "<path d=\"M{left} {0}H{right}M{1} {ROOM}V{bottom}\" stroke=\"#ddd\"/>",
            y(level),
            x(rate)
        ));
        put(format!(
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{level:.1}</text>",
            left - 6.0,
            y(level) + 4.0
        ));
        put(format!(
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{rate:.0}</text>",
            x(rate),
            bottom + 16.0
        ));
    }
    let middle = left + CHART[0] / 2.0;
    put(format!(
        "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">Mbit/s for 22 people</text>",
        ROOM + CHART[1] + 34.0
    ));
    let dot = |figures: &RateFigures, radius: f64, colour: &str| {
        let (x, y) = (x(figures.mbit_s), y(value(figures)));
        format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{colour}\"/>")
    };
    for baseline in &figures.baselines {
        put(dot(&baseline.rate, 4.0, "#c33"));
    }
    for setting in &figures.curve {
        put(dot(setting, 2.5, "#9bd"));
    }
    for rung in &figures.rungs {
        put(dot(&rung.rate, 5.0, "#147"));
        let (x, y) = (x(rung.rate.mbit_s) + 8.0, y(value(&rung.rate)) + 4.0);
        put(format!("<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"#147\">{}</text>", rung.rate.id));
    }
    let legend = [("#147", "the ladder"), ("#9bd", "other settings"), ("#c33", "Draco and JPEG per frame")];
    for (line, (colour, name)) in legend.into_iter().enumerate() {
        let (x, y) = (left + CHART[0] - 175.0, ROOM + 16.0 + 16.0 * line as f64);
        put(format!("<circle cx=\"{x}\" cy=\"{}\" r=\"4\" fill=\"{colour}\"/>", y - 4.0));
        put(format!("<text x=\"{}\" y=\"{y}\">{name}</text>", x + 10.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::stream::RungFigures;

    #[test]
    fn every_figure_has_a_dot_in_both_charts() {
        let rate = |mbit_s| RateFigures { mbit_s, error_mm: 2.0, psnr_db: 36.0, ..RateFigures::default() };
        let figures = StreamFigures {
            rungs: vec![RungFigures { rate: rate(6.0), ..RungFigures::default() }],
            curve: vec![rate(5.0), rate(4.0)],
            ..StreamFigures::default()
        };
        let picture = plot(&figures);
        // Three of the legend and three figures, twice.
        assert_eq!(picture.matches("<circle").count(), 12);
        assert!(picture.starts_with("<svg") && picture.ends_with("</svg>\n"));
    }
}
