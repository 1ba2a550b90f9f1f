use glam::DVec3;
use protocol::{manifest::PersonId, pitch::Pitch};

use super::*;
use crate::{pose::Lab, tracking::Sighting};

const FRAMES: usize = 30;

/// Somebody in a kit (sRGB of shirt, shorts, socks) who stands on a place.
fn person(kit: [[u8; 3]; 3], x: f64, z: f64, frame: usize) -> Person {
    // Shade and noise.
    let shade = |rgb: [u8; 3]| {
        let lab = Lab::from_srgb(rgb);
        Some(Lab { l: lab.l + (frame % 7) as f32 - 3.0, ..lab })
    };
    Person {
        score: 1.0,
        pose_score: 1.0,
        ground_m: DVec3::new(x, 0.0, z),
        neck_m: DVec3::new(x, 1.5, z),
        looks: Looks { kit: kit.map(shade), nose_m: None },
        ..Person::blank()
    }
}

type Standing = ([[u8; 3]; 3], f64, f64);

fn scene(everybody: &[Standing]) -> (Vec<Track>, Vec<Vec<Person>>) {
    let people: Vec<Vec<Person>> = (0..FRAMES)
        .map(|frame| everybody.iter().map(|(kit, x, z)| person(*kit, *x, *z, frame)).collect())
        .collect();
    let tracks: Vec<Track> = (0..everybody.len())
        .map(|person_index| Track {
            person: PersonId(person_index as u32 + 1),
            sightings: (0..FRAMES).map(|frame| Sighting { frame, person_index }).collect(),
        })
        .collect();
    (tracks, people)
}

fn members(everybody: &[Standing]) -> Vec<Member> {
    let (tracks, people) = scene(everybody);
    assign(&tracks, &people, &Pitch::default())
}

/// Ten against ten, two keepers, a referee and an assistant. Team a has the left half.
fn a_match() -> Vec<Standing> {
    let (red, blue) =
        ([[180, 30, 40], [240, 240, 240], [180, 30, 40]], [[30, 60, 170], [30, 60, 170], [240, 240, 240]]);
    let (green, orange, black) = ([[40, 200, 90]; 3], [[240, 140, 20]; 3], [[25, 25, 25]; 3]);
    let mut all: Vec<Standing> = Vec::new();
    for i in 0..10 {
        all.push((red, -30.0 + 4.0 * f64::from(i), -25.0 + 5.0 * f64::from(i)));
        all.push((blue, 30.0 - 4.0 * f64::from(i), -22.0 + 5.0 * f64::from(i)));
    }
    all.extend([(green, -47.0, 1.0), (orange, 45.0, 2.0), (black, 3.0, 5.0), (black, 10.0, -34.5)]);
    all
}

#[test]
fn teams_keepers_and_officials_are_told_apart() {
    let members = members(&a_match());
    let (red, blue) = (members[0].team.unwrap(), members[1].team.unwrap());
    assert_ne!(red, blue);
    for (place, member) in members.iter().enumerate().take(20) {
        assert_eq!(member.team, Some(if place % 2 == 0 { red } else { blue }), "{member:?}");
        assert_eq!(member.role, Some(Role::Player));
        assert!(member.team_confidence > 0.9);
    }
    assert_eq!(
        members[20..].iter().map(|m| m.role.unwrap()).collect::<Vec<_>>(),
        [Role::Goalkeeper, Role::Goalkeeper, Role::Referee, Role::Assistant]
    );
    assert_eq!(members[20..].iter().map(|m| m.team).collect::<Vec<_>>(), [Some(red), Some(blue), None, None]);
}

#[test]
fn a_referee_before_the_goal_is_no_keeper() {
    let mut everybody = a_match();
    // A short look at the referee in the penalty area: the kit is that of the one in midfield.
    everybody.push((everybody[22].0, 44.0, -8.0));
    everybody[23].1 = 12.0;
    let members = members(&everybody);
    assert_eq!(members[24].role, Some(Role::Referee), "{:?}", members[24]);
}

#[test]
fn who_stands_beside_the_pitch_takes_no_part() {
    let mut everybody = a_match();
    let all = everybody.len();
    let (black, red) = (everybody[22].0, everybody[0].0);
    // A photographer, a substitute, a player at a throw-in.
    everybody.extend([(black, 20.0, 36.5), (red, -10.0, 35.2), (red, 5.0, 34.4)]);
    let (tracks, people) = scene(&everybody);
    let kept = on_the_pitch(tracks, &people, &Pitch::default());
    let ids: Vec<u32> = kept.iter().map(|track| track.person.0).collect();
    assert_eq!(ids, (1..=all as u32).chain([all as u32 + 3]).collect::<Vec<_>>());
}

#[test]
fn nothing_to_go_by_is_no_team() {
    assert_eq!(members(&[]), []);
    let alone = members(&[([[200, 200, 200]; 3], 0.0, 0.0)]);
    assert_eq!((alone[0].team, alone[0].team_confidence), (None, 0.0));
}
