//! Reads recorded positions in the table form of the Last Row set (Friends of Tracking): one line per track and frame,
//! 20 frames a second, x and y in percent of the pitch. Nothing of any recording is part of the project.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3};
use protocol::pitch::Pitch;

use crate::{
    SynthesisError,
    props::BALL_RADIUS_M,
    trajectories::{Path2, Role, Trajectories},
};

/// Frames per second of the set.
const RATE_HZ: f64 = 20.0;
/// The track of the ball.
const BALL: i64 = 0;
/// Who stays this close to a goal line is taken for its goalkeeper, metres.
const KEEPER_M: f32 = 20.0;

/// The columns that are read.
const COLUMNS: [&str; 6] = ["player", "frame", "x", "y", "z", "team"];

/// The cells of a line; commas between double quotes part nothing.
fn cells_of(line: &str) -> Vec<&str> {
    let mut quoted = false;
    line.split(|letter| {
        quoted ^= letter == '"';
        letter == ',' && !quoted
    })
    .collect()
}

/// Reads such a table; `what` names it in messages. Its heights are taken as metres. Goalkeepers are not marked in it:
/// the one of each side who is nearest to a goal line all the time is taken, if that is near.
pub fn last_row(text: &str, what: &str) -> Result<Trajectories, SynthesisError> {
    let broken = |reason: String| SynthesisError::Asset { what: what.to_owned(), reason };
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
    let mut columns = [0; COLUMNS.len()];
    for (column, name) in columns.iter_mut().zip(COLUMNS) {
        *column = header.iter().position(|have| *have == name).ok_or_else(|| {
            broken(format!(
                "its first line has no column `{name}`; a table in the form of Last Row is expected"
            ))
        })?;
    }
    let pitch = Pitch::default();
    let size = Vec2::new(pitch.length_m as f32, pitch.width_m as f32);
    let mut tracks: BTreeMap<i64, (Option<u8>, BTreeMap<i64, Vec3>)> = BTreeMap::new();
    for (index, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let cells = cells_of(line);
        let cell = |column: usize| cells.get(columns[column]).copied().unwrap_or_default().trim();
        let number = |column: usize| -> Result<f64, SynthesisError> {
            let value =
                cell(column).parse::<f64>().ok().filter(|value| value.is_finite() && value.abs() < 1e6);
            value.ok_or_else(|| {
                broken(format!("line {}: `{}` is no {}", index + 2, cell(column), COLUMNS[column]))
            })
        };
        let share = Vec2::new(number(2)? as f32, number(3)? as f32) / 100.0 - 0.5;
        let at = share * size;
        let high = number(4).unwrap_or(0.0) as f32;
        let team = match cell(5) {
            "attack" => Some(0),
            "defense" => Some(1),
            _ => None,
        };
        let track = tracks.entry(number(0)? as i64).or_insert((team, BTreeMap::new()));
        track.1.insert(number(1)? as i64, Vec3::new(at.x, high + BALL_RADIUS_M, at.y));
    }
    let ball = tracks.remove(&BALL).ok_or_else(|| broken("it has no track 0, the ball".into()))?.1;
    let frames: Vec<i64> = ball.keys().copied().collect();
    if frames.len() < 2 {
        return Err(broken("the ball has fewer than two frames".into()));
    }
    // Only whole tracks: people who come and go would appear out of nothing.
    let mut people: Vec<Path2> = tracks
        .into_values()
        .filter_map(|(team, places)| {
            let xz: Option<Vec<Vec2>> =
                frames.iter().map(|f| places.get(f).map(|p| Vec2::new(p.x, p.z))).collect();
            Some(Path2 { role: Role::Player, team: Some(team?), number: None, xz: xz? })
        })
        .collect();
    for team in 0..2u8 {
        let from_line =
            |person: &Path2| person.xz.iter().map(|p| size.x / 2.0 - p.x.abs()).fold(f32::MIN, f32::max);
        let mut number = 1;
        let own = people.iter_mut().filter(|person| person.team == Some(team));
        let mut own: Vec<&mut Path2> = own.collect();
        own.sort_by(|a, b| from_line(a).total_cmp(&from_line(b)));
        for (index, person) in own.into_iter().enumerate() {
            if index == 0 && from_line(person) < KEEPER_M {
                person.role = Role::Goalkeeper;
            }
            number += usize::from(index > 0 || person.role == Role::Player);
            person.number = u8::try_from(number).ok();
        }
    }
    Ok(Trajectories { rate_hz: RATE_HZ, people, ball: ball.into_values().collect() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{cast::Cast, play};
    use std::path::Path;

    const TABLE: &str = "player,frame,x,y,z,coords,team\n\
        0,0,50,50,0,\"(5, 5)\",\n0,1,52,50,0.5,,\n\
        7,0,50,0,0,\"(5, 0)\",attack\n7,1,51,0,0,,attack\n\
        9,0,99,50,0,,defense\n9,1,99,51,0,,defense\n\
        8,1,10,10,0,,defense\n";

    #[test]
    fn percents_become_metres_and_half_tracks_are_left_out() {
        let all = last_row(TABLE, "test").unwrap();
        assert_eq!((all.people.len(), all.ball.len(), all.rate_hz), (2, 2, 20.0));
        assert!(all.people[0].xz[0].distance(Vec2::new(0.0, -34.0)) < 1e-4);
        assert_eq!(
            (all.people[0].role, all.people[0].team, all.people[0].number),
            (Role::Player, Some(0), Some(2))
        );
        assert_eq!((all.people[1].role, all.people[1].number), (Role::Goalkeeper, Some(1)));
        assert!(all.ball[1].distance(Vec3::new(2.1, 0.61, 0.0)) < 1e-4);
    }

    #[test]
    fn a_broken_table_is_refused_with_its_line() {
        for (bad, says) in [
            (TABLE.replace("frame", "time"), "`frame`"),
            (TABLE.replace("52,50", "x,50"), "line 3"),
            (TABLE.replace("52,50", "inf,50"), "line 3"),
            (TABLE.replace("\n0,", "\n5,"), "ball"),
            (String::new(), "`player`"),
        ] {
            let error = last_row(&bad, "test").map(|_| ()).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn recorded_people_stand_on_their_feet() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/tracking/lastrow");
        for name in ["LIV_2-1_CHE.csv", "Real_vs_Barcelona_Calma.csv"] {
            let path = folder.join(name);
            if !path.exists() {
                println!("skipped: {} is not here", path.display());
                return;
            }
            let all = Trajectories::open(&path).unwrap();
            assert!(all.people.len() >= 18, "{} people", all.people.len());
            let paths = all.resampled(0.0, 25.0, (all.ball.len() as f64 * 1.25) as usize - 2);
            let found = play::events(&paths.people, &paths.ball, 25.0, &Pitch::default());
            println!(
                "{name}: {:?}",
                found.iter().map(|(who, e)| (who, e.kind, e.time_s)).collect::<Vec<_>>()
            );
            assert!(found.len() >= 3, "{} events", found.len());
            let cast = Cast::new(&paths, 25.0, &Pitch::default(), 3).unwrap();
            for (index, member) in cast.members.iter().enumerate() {
                crate::movement::tests::assert_stands(member, &format!("{name}, person {index}"));
            }
        }
    }
}
