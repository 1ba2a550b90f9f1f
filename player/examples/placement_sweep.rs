//! How the table finder holds out against noise, wild points, a leaning table and few points, in rooms whose truth is
//! known. Writes `placement-sweep.csv` and `placement-sweep.svg` into a folder.
//!
//! `cargo run -p player --example placement_sweep -- docs`

use std::{error::Error, fmt::Write, path::PathBuf};

use glam::{DMat3, DVec3};
use player::placement::{
    Finder, Plane, PointCloud,
    synthetic::{Body, Sensor, bare_room, clutter, room_from_camera, seen_plane, table},
};

/// Rooms for each value.
const RUNS: u64 = 24;

/// What is changed, and to which values.
struct Sweep {
    name: &'static str,
    axis: &'static str,
    values: &'static [f64],
    scan: fn(f64, u64) -> (PointCloud, Plane),
}

const SWEEPS: [Sweep; 4] = [
    Sweep {
        name: "noise",
        axis: "noise, times a Kinect's",
        values: &[0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0],
        scan: |value, seed| seen(Sensor { noise: value, seed, ..Sensor::default() }, 0.0),
    },
    Sweep {
        name: "outliers",
        axis: "share of wild points",
        values: &[0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5],
        scan: |value, seed| seen(Sensor { outliers: value, seed, ..Sensor::default() }, 0.0),
    },
    Sweep {
        name: "tilt",
        axis: "table leans, degrees (gravity given)",
        values: &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0],
        scan: |value, seed| {
            let (cloud, plane) = seen(Sensor { seed, ..Sensor::default() }, value);
            let up = camera(seed).0.transpose() * DVec3::Y;
            (cloud.with_up(up), plane)
        },
    },
    Sweep {
        name: "points",
        axis: "points of a phone, 8 mm noise",
        values: &[200.0, 400.0, 700.0, 1000.0, 1500.0, 2500.0, 4000.0, 8000.0],
        scan: |value, seed| {
            let (_, eye) = camera(seed);
            let sensor = Sensor { outliers: 0.03, seed, ..Sensor::default() };
            (sensor.gather(&room(0.0), eye, DVec3::Y * 0.65, value as usize, 0.008), table().top())
        },
    },
];

/// Figures of one value.
struct Row {
    value: f64,
    found: f64,
    angle_deg: [f64; 2],
    offset_mm: [f64; 2],
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder: PathBuf = std::env::args().nth(1).unwrap_or_else(|| "target".into()).into();
    std::fs::create_dir_all(&folder)?;
    let mut csv = String::from(
        "sweep,value,rooms,found_share,angle_deg_median,angle_deg_p95,height_mm_median,height_mm_p95\n",
    );
    let mut charts = Vec::new();
    for sweep in SWEEPS {
        let rows: Vec<Row> = sweep.values.iter().map(|value| measure(&sweep, *value)).collect();
        for row in &rows {
            let ([a, b], [c, d]) = (row.angle_deg, row.offset_mm);
            writeln!(
                csv,
                "{},{},{RUNS},{:.3},{a:.4},{b:.4},{c:.3},{d:.3}",
                sweep.name, row.value, row.found
            )?;
            println!(
                "{} {}: found {:.2}, {a:.3}/{b:.3} degrees, {c:.2}/{d:.2} mm",
                sweep.name, row.value, row.found
            );
        }
        charts.push((sweep.axis, rows));
    }
    std::fs::write(folder.join("placement-sweep.csv"), csv)?;
    std::fs::write(folder.join("placement-sweep.svg"), picture(&charts)?)?;
    Ok(())
}

fn room(leans_degrees: f64) -> Vec<Body> {
    let mut room = bare_room();
    room.push(table().leaning(leans_degrees));
    if leans_degrees == 0.0 {
        room.extend(clutter());
    }
    room
}

/// Where the sensor stands: another place for every seed. Its axes and its position.
fn camera(seed: u64) -> (DMat3, DVec3) {
    // The golden ratio spreads the places evenly.
    let place = |factor: f64| (seed as f64 * factor).fract();
    let (angle, away) = (place(0.618_034) * 2.4 - 1.2, 0.9 + 0.6 * place(0.754_878));
    let eye = DVec3::new(angle.sin() * away, 1.3 + 0.4 * place(0.569_84), angle.cos() * away);
    (room_from_camera(eye, DVec3::Y * 0.65).matrix3, eye)
}

fn seen(sensor: Sensor, leans_degrees: f64) -> (PointCloud, Plane) {
    let (_, eye) = camera(sensor.seed);
    let room_from_camera = room_from_camera(eye, DVec3::Y * 0.65);
    let plane = seen_plane(&table().leaning(leans_degrees).top(), &room_from_camera);
    (sensor.scan(&room(leans_degrees), &room_from_camera), plane)
}

fn measure(sweep: &Sweep, value: f64) -> Row {
    let (mut angles, mut offsets) = (Vec::new(), Vec::new());
    for seed in 0..RUNS {
        let (cloud, truth) = (sweep.scan)(value, seed);
        let finding = Finder::default().find(&cloud);
        // A find counts when it is the table and not something else that is level.
        if let Some(found) = finding.table()
            && found.surface.plane.normal.angle_between(truth.normal) < 0.1
            && (found.surface.plane.offset_m - truth.offset_m).abs() < 0.05
        {
            angles.push(found.surface.plane.normal.angle_between(truth.normal).to_degrees());
            // The height in the middle of what was found: at the sensor a tilt would count twice.
            let corners = &found.surface.outline_m;
            let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
            offsets.push(truth.distance_m(found.surface.plane.project(middle)).abs() * 1e3);
        }
    }
    let found = angles.len() as f64 / RUNS as f64;
    Row { value, found, angle_deg: middle_and_high(angles), offset_mm: middle_and_high(offsets) }
}

/// Median and 95th percentile; NaN of nothing.
fn middle_and_high(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get((share * values.len() as f64) as usize).copied().unwrap_or(f64::NAN);
    [at(0.5), at(0.95)]
}

/// Small charts: a column for each sweep; the share found, the angle and the height below one another.
fn picture(charts: &[(&str, Vec<Row>)]) -> Result<String, std::fmt::Error> {
    let (width, height) = (250.0, 150.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0}\" height=\"{:.0}\" font-family=\"sans-serif\" \
         font-size=\"11\"><rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        width * charts.len() as f64 + 10.0,
        height * 3.0 + 34.0
    );
    for (column, (axis, rows)) in charts.iter().enumerate() {
        let titles = ["share found", "angle, degrees: median, 95 %", "height, mm: median, 95 %"];
        let lines: [Vec<Vec<f64>>; 3] = [
            vec![rows.iter().map(|row| row.found).collect()],
            (0..2).map(|which| rows.iter().map(|row| row.angle_deg[which]).collect()).collect(),
            (0..2).map(|which| rows.iter().map(|row| row.offset_mm[which]).collect()).collect(),
        ];
        for (place, (title, lines)) in titles.iter().zip(lines).enumerate() {
            let (left, top) = (width * column as f64 + 42.0, height * place as f64 + 24.0);
            let values: Vec<f64> = rows.iter().map(|row| row.value).collect();
            chart(&mut svg, [left, top, width - 58.0, height - 46.0], title, &values, &lines)?;
        }
        let middle = width * column as f64 + 42.0 + (width - 58.0) / 2.0;
        writeln!(
            svg,
            "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{axis}</text>",
            height * 3.0 + 22.0
        )?;
    }
    svg.push_str("</svg>\n");
    Ok(svg)
}

fn chart(
    svg: &mut String,
    [left, top, width, height]: [f64; 4],
    title: &str,
    values: &[f64],
    lines: &[Vec<f64>],
) -> std::fmt::Result {
    let most = lines.iter().flatten().copied().filter(|value| value.is_finite()).fold(0.0, f64::max);
    let most = if most > 0.0 { most * 1.1 } else { 1.0 };
    let last = values.last().copied().unwrap_or(1.0);
    let bottom = top + height;
    writeln!(svg, "<text x=\"{left}\" y=\"{}\" fill=\"#333\">{title}</text>", top - 7.0)?;
    writeln!(
        svg,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#bbb\"/>"
    )?;
    for share in [0.0, 0.5, 1.0] {
        let (x, y) = (left + width * share, bottom - height * share);
        let (value, high) = (last * share, most * share);
        writeln!(
            svg,
            "<text x=\"{x}\" y=\"{}\" text-anchor=\"middle\" fill=\"#666\">{value}</text>",
            bottom + 13.0
        )?;
        writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"#666\">{high:.2}</text>",
            left - 4.0,
            y + 4.0
        )?;
    }
    for (line, colour) in lines.iter().zip(["#1565c0", "#ef6c00"]) {
        let points: Vec<String> = values
            .iter()
            .zip(line)
            .filter(|(_, height)| height.is_finite())
            .map(|(value, high)| {
                format!("{:.1},{:.1}", left + width * value / last, bottom - height * high / most)
            })
            .collect();
        writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"/>",
            points.join(" ")
        )?;
        for point in points {
            let (x, y) = point.split_once(',').unwrap_or(("0", "0"));
            writeln!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"2\" fill=\"{colour}\"/>")?;
        }
    }
    Ok(())
}
