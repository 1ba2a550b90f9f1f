//! How well the ball is followed and jumps are found in made-up matches whose truth is known, for detectors of several
//! qualities. Prints a table; no picture is rendered.
//!
//! `cargo run -p reconstructor --example ball_sweep -- 120..128 1500`

use std::{collections::BTreeMap, error::Error, ops::Range};

use protocol::chunk::{Ball, BallSpread};
use reconstructor::{
    ball,
    evaluate::{
        ball::{BallFigures, TrueBall, compare},
        jumps::{Height, JumpFigures},
        simulated::{Errors, SimulatedMatch, simulate},
    },
    jumps,
};

/// Cuts as a broadcast has them.
const SHOTS: &str = "main:400,high-behind:200,main:500,close-up:80,main";

/// Made-up detectors.
fn detectors() -> [(&'static str, Errors); 4] {
    let usual = Errors::default();
    [
        ("usual", usual),
        ("misses half", Errors { ball_missed: 0.5, ..usual }),
        ("twice the false ones", Errors { false_candidates: [1.8, 1.4, 1.4], ..usual }),
        (
            "all worse",
            Errors {
                ball_px: 1.8,
                ball_missed: 0.45,
                false_candidates: [1.8, 1.4, 1.4],
                joint_px: 2.5,
                person_missed: 0.15,
                camera_px: 0.8,
            },
        ),
    ]
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let seeds = range(&arguments.next().ok_or("give seeds, as in 120..128")?)?;
    let frames: usize = arguments.next().unwrap_or("1500".into()).parse()?;
    println!(
        "| detector | matches | coverage | median m | p90 m | flight median m | along | across | over 2 m | in 2 sigma | \
         flights in 2 sigma | jumps | found | height error m | lifted wrongly |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for (name, errors) in detectors() {
        let mut tally = Tally::default();
        // Test seeds, 7 by 8, are for nobody to choose settings on.
        for seed in seeds.clone().filter(|seed| seed % 8 != 7) {
            tally.add(&simulate(seed, frames, &SHOTS.parse()?, &errors)?);
        }
        tally.print(name);
    }
    Ok(())
}

fn range(text: &str) -> Result<Range<u64>, Box<dyn Error>> {
    let (first, end) = text.split_once("..").ok_or("seeds are written 120..128")?;
    Ok(first.parse()?..end.parse()?)
}

/// All matches of a detector after one another, with frames and people renumbered.
#[derive(Default)]
struct Tally {
    matches: u32,
    truth: BTreeMap<u32, TrueBall>,
    ours: BTreeMap<u32, Ball>,
    heights: Vec<Height>,
}

impl Tally {
    fn add(&mut self, seen: &SimulatedMatch) {
        let first = self.matches * 1_000_000;
        let mut people = seen.people.clone();
        let lifts = jumps::find(&people, &seen.tracks, &seen.cameras, &seen.clip);
        jumps::place(&mut people, &seen.cameras, &lifts);
        let found =
            ball::follow(&seen.candidates, &seen.cameras, &people, &seen.clip, &seen.shots, &seen.pitch);
        let lifted: BTreeMap<(usize, usize), f64> =
            lifts.iter().map(|lift| ((lift.frame, lift.person_index), lift.above_ground_m)).collect();
        for (frame, truth) in seen.ball_truth.iter().enumerate() {
            let number = first + frame as u32;
            let Some(camera) = seen.cameras[frame].camera else { continue };
            let (position_m, camera_m) = (truth.position_m, camera.position);
            self.truth.insert(number, TrueBall { position_m, camera_m, seen: truth.in_view });
            if let Some(ball) = found[frame] {
                let spread =
                    BallSpread { along_m: ball.sigma_along_m as f32, across_m: ball.sigma_across_m as f32 };
                let (position_m, height_known) = (ball.position_m, ball.height_known);
                self.ours.insert(number, Ball { position_m, height_known, spread: Some(spread) });
            }
            for (index, person) in seen.people_truth[frame].iter().enumerate() {
                self.heights.push(Height {
                    frame: number,
                    person: self.matches * 1_000 + person.id,
                    true_m: person.above_ground_m,
                    stands: person.stands,
                    goes_down: person.goes_down,
                    ours_m: Some(lifted.get(&(frame, index)).copied().unwrap_or(0.0)),
                });
            }
        }
        self.matches += 1;
    }

    fn print(&self, name: &str) {
        let ball: BallFigures = compare(&self.truth, &self.ours);
        let jumps: JumpFigures = reconstructor::evaluate::jumps::compare(&self.heights);
        let figure = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.2}"));
        println!(
            "| {name} | {} | {:.3} | {} | {} | {} | {} | {} | {:.3} | {} | {} | {} | {} | {} | {:.5} |",
            self.matches,
            ball.ball_coverage,
            figure(ball.ball_error_median_m),
            figure(ball.ball_error_p90_m),
            figure(ball.ball_error_flight_median_m),
            figure(ball.ball_error_along_median_m),
            figure(ball.ball_error_across_median_m),
            ball.ball_wrong_share.unwrap_or(0.0),
            figure(ball.ball_within_two_sigma),
            figure(ball.ball_within_two_sigma_flight),
            jumps.jumps_true,
            figure(jumps.jumps_recall),
            figure(jumps.jump_height_error_median_m),
            jumps.grounded_lifted_share.unwrap_or(0.0),
        );
    }
}
