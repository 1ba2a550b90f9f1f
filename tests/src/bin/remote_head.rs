//! Holds the head of Monado's `remote` driver still, so that the pictures of a headset can be compared.
//!
//! The driver listens on port 4242 and takes packets of 376 bytes (Monado's `r_interface.h`, protocol `mndrmt3`): both eyes'
//! fields of view and poses, the head's pose, two controllers. This sends one and holds the connection until it is killed;
//! with the argument `point` the right controller points at the table of the tests, with `select` it also pulls its trigger
//! every second.

use std::{
    io::{self, Read, Write},
    net::TcpStream,
    thread,
    time::Duration,
};

/// Tangents do not matter here: angles to the left, right, up and down, radians.
const FOV: [f32; 4] = [-0.8, 0.8, 0.7, -0.7];
/// Half the distance of the eyes, metres.
const HALF_EYES_M: f32 = 0.032;
/// Height of the head above the floor at which Monado has the origin of its `LOCAL` space, metres.
const STANDING_M: f32 = 1.6;
/// Looking down by 30 degrees: half the angle's sine and cosine.
const DOWN: [f32; 4] = [-0.258_819, 0.0, 0.0, 0.965_926];
const UPRIGHT: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
const PACKET_BYTES: usize = 376;

fn floats(packet: &mut Vec<u8>, values: &[f32]) {
    packet.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

/// Down by 35 degrees: from the hand over the panel to the table.
const AT_THE_TABLE: [f32; 4] = [-0.300_706, 0.0, 0.0, 0.953_717];

fn packet(at_the_table: bool, pressed: bool) -> Vec<u8> {
    let mut packet = b"mndrmt3\0".to_vec();
    for x in [-HALF_EYES_M, HALF_EYES_M] {
        floats(&mut packet, &FOV);
        floats(&mut packet, &UPRIGHT);
        floats(&mut packet, &[x, 0.0, 0.0]);
        packet.extend([0; 4]);
    }
    floats(&mut packet, &DOWN);
    floats(&mut packet, &[0.0, STANDING_M, 0.0]);
    // The poses of the eyes are valid.
    packet.extend([1, 0, 0, 0]);
    for (x, points) in [(-0.2, false), (0.2, at_the_table)] {
        floats(&mut packet, if points { &AT_THE_TABLE } else { &UPRIGHT });
        floats(&mut packet, &[x, STANDING_M, -0.3]);
        // Velocities, sticks, fingers.
        floats(&mut packet, &[0.0; 19]);
        // Active, and of the buttons at most the trigger.
        let mut buttons = [0; 16];
        (buttons[0], buttons[1]) = (1, 1);
        buttons[8] = u8::from(points && pressed);
        packet.extend(buttons);
    }
    packet
}

fn main() -> io::Result<()> {
    let argument = std::env::args().nth(1).unwrap_or_default();
    let selects = argument == "select";
    let points = selects || argument == "point";
    let first = packet(points, false);
    assert_eq!(first.len(), PACKET_BYTES);
    let mut connection = loop {
        match TcpStream::connect(("127.0.0.1", 4242)) {
            Ok(connection) => break connection,
            Err(_) => thread::sleep(Duration::from_millis(100)),
        }
    };
    // The driver first tells its own state.
    let mut greeting = [0; PACKET_BYTES];
    connection.read_exact(&mut greeting)?;
    connection.write_all(&first)?;
    println!("head set");
    if selects {
        for pressed in [true, false].into_iter().cycle() {
            thread::sleep(Duration::from_millis(500));
            connection.write_all(&packet(points, pressed))?;
        }
    }
    let mut rest = [0; 1024];
    while connection.read(&mut rest)? > 0 {}
    Ok(())
}
