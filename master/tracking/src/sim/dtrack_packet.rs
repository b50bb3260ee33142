//! DTrack's packets, written. In: bodies and flysticks. Out: the text of one packet. It sends nothing.

use std::fmt::Write;

use glam::{DMat3, DQuat};

/// A standard body to be written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimBody {
    /// From 0.
    pub id: u32,
    /// In millimetres.
    pub position_mm: [f64; 3],
    /// A unit quaternion x, y, z, w from the body's axes to the room's.
    pub orientation: [f64; 4],
}

/// A flystick to be written.
#[derive(Clone, Debug, PartialEq)]
pub struct SimFlystick {
    /// Where it is; `None` while its target is hidden.
    pub body: Option<SimBody>,
    /// From 0, without gaps.
    pub id: u32,
    /// At most 32.
    pub buttons: Vec<bool>,
    /// −1…1.
    pub controllers: Vec<f64>,
}

/// A packet with the lines `fr`, `ts`, `6dcal`, `6d` and `6df2`. `stamp_s` are seconds since midnight. Bodies that are
/// not tracked are left out by leaving them out.
#[must_use]
pub fn dtrack_packet(
    frame: u32,
    stamp_s: f64,
    bodies: &[SimBody],
    flysticks: &[SimFlystick],
) -> String {
    let mut text = format!(
        "fr {frame}\r\nts {stamp_s:.6}\r\n6dcal {}\r\n",
        bodies.len()
    );
    // Writing to a string cannot fail.
    let _ = write!(text, "6d {}", bodies.len());
    for body in bodies {
        let [x, y, z] = body.position_mm;
        let _ = write!(
            text,
            " [{} 1.000][{x:.3} {y:.3} {z:.3} 0.0000 0.0000 0.0000]",
            body.id
        );
        write_rotation(&mut text, Some(body.orientation));
    }
    let _ = write!(text, "\r\n6df2 {} {}", flysticks.len(), flysticks.len());
    for flystick in flysticks {
        let [x, y, z] = flystick.body.map_or([0.0; 3], |body| body.position_mm);
        let quality = if flystick.body.is_some() { 1.0 } else { -1.0 };
        let (buttons, controllers) = (flystick.buttons.len(), flystick.controllers.len());
        let _ = write!(
            text,
            " [{} {quality:.3} {buttons} {controllers}][{x:.3} {y:.3} {z:.3}]",
            flystick.id
        );
        write_rotation(&mut text, flystick.body.map(|body| body.orientation));
        let bits = (0..)
            .zip(flystick.buttons.iter().take(32))
            .fold(0_u32, |bits, (place, pressed)| {
                bits | u32::from(*pressed) << place
            });
        let _ = write!(text, "[{bits}");
        for controller in &flystick.controllers {
            let _ = write!(text, " {controller:.2}");
        }
        text.push(']');
    }
    text.push_str("\r\n");
    text
}

/// Nine numbers column by column; zeroes for what is hidden.
fn write_rotation(text: &mut String, orientation: Option<[f64; 4]>) {
    let numbers = orientation.map_or([0.0; 9], |orientation| {
        DMat3::from_quat(DQuat::from_array(orientation).normalize()).to_cols_array()
    });
    let numbers = numbers.map(|number| format!("{number:.6}"));
    let _ = write!(text, "[{}]", numbers.join(" "));
}
