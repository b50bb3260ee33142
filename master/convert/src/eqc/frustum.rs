//! Walls and projections of Equalizer, its eyes and its ways of stereo.
//! In: `wall`, `projection`, `eye` and `attributes` entries. Out: corners in the room, eyes, ways of stereo.

use glam::{DMat3, DVec3};

use crate::draft::Builder;
use crate::error::Trouble;
use crate::room::Corners;
use crate::source::At;
use crate::stereo::{Eye, QUAD_BUFFER, Stereo};

/// Equalizer's wall where a block states no corner (eq/fabric/wall.cpp).
pub(super) const WALL: [[f64; 3]; 3] = [[-0.8, -0.5, -1.0], [0.8, -0.5, -1.0], [-0.8, 0.5, -1.0]];

/// The corners that a block states: of a wall and a projection, the later one holds.
pub(super) fn read(block: At<'_>, builder: &mut Builder) -> Result<Option<Corners>, Trouble> {
    let last = block
        .children()
        .filter(|at| matches!(at.key(), "wall" | "projection"))
        .last();
    match last {
        Some(at) if at.key() == "wall" => read_wall(at, builder).map(Some),
        Some(at) => read_projection(at, builder).map(Some),
        None => Ok(None),
    }
}

fn read_wall(at: At<'_>, builder: &mut Builder) -> Result<Corners, Trouble> {
    at.carry();
    let mut missing = Vec::new();
    let mut corners = WALL;
    let keys = ["bottom_left", "bottom_right", "top_left"];
    for (corner, key) in corners.iter_mut().zip(keys) {
        match at.get(key) {
            Some(stated) => *corner = stated.numbers()?,
            None => missing.push(key),
        }
    }
    assume(
        at,
        &missing,
        "1.6 m × 1 m, one metre in front of the origin",
        builder,
    );
    if let Some(kind) = at.get("type")
        && kind.one_of(&[("fixed", false), ("HMD", true)])?
    {
        builder.ledger.note(
            kind,
            kind.source(),
            "screens stand in the room, so it stays where it is for the resting head",
            "nothing, unless it was worn on the head",
        );
    }
    let [bottom_left, bottom_right, top_left] = corners;
    Ok(Corners::new(bottom_left, bottom_right, top_left))
}

fn assume(at: At<'_>, missing: &[&str], what: &str, builder: &mut Builder) {
    if missing.is_empty() {
        return;
    }
    builder.ledger.note(
        at,
        format!("not stated: {}", missing.join(", ")),
        format!("Equalizer's default is taken: {what}"),
        "measure the screen and correct corners_m",
    );
}

/// A projector at `origin` with its screen at `distance` along its third axis. The screen is
/// 2·distance·tan(fov/2) wide and high, along the first and second axis. With heading h, pitch p and roll r, the axes are
/// the rows-to-columns product that eq/fabric/wall.cpp writes out.
fn read_projection(at: At<'_>, builder: &mut Builder) -> Result<Corners, Trouble> {
    at.carry();
    let mut missing = Vec::new();
    let mut read = |key: &'static str, default: [f64; 3]| match at.get(key) {
        Some(stated) => stated.numbers(),
        None => {
            missing.push(key);
            Ok(default)
        }
    };
    let origin = DVec3::from(read("origin", [0.0, 0.0, 0.5])?);
    let [heading, pitch, roll] = read("hpr", [0.0; 3])?.map(f64::to_radians);
    let distance_m = match at.get("distance") {
        Some(distance) => distance.number()?,
        None => {
            missing.push("distance");
            3.0
        }
    };
    let [across, along] = match at.get("fov") {
        Some(field) => field.numbers()?,
        None => {
            missing.push("fov");
            [54.0, 47.0]
        }
    };
    assume(
        at,
        &missing,
        "origin 0 0 0.5, hpr 0 0 0, distance 3, fov 54 47",
        builder,
    );
    let ((sin_h, cos_h), (sin_p, cos_p), (sin_r, cos_r)) =
        (heading.sin_cos(), pitch.sin_cos(), roll.sin_cos());
    let turn = DMat3::from_cols(
        DVec3::new(cos_h * cos_r, -cos_h * sin_r, -sin_h),
        DVec3::new(
            -sin_p * sin_h * cos_r + cos_p * sin_r,
            sin_p * sin_h * sin_r + cos_p * cos_r,
            -sin_p * cos_h,
        ),
        DVec3::new(
            cos_p * sin_h * cos_r + sin_p * sin_r,
            -cos_p * sin_h * sin_r + sin_p * cos_r,
            cos_p * cos_h,
        ),
    );
    if ![across, along]
        .iter()
        .all(|field| (0.0..179.0).contains(field))
    {
        return Err(at.expected("a fov of two angles within 0…179"));
    }
    let half = |field: f64| distance_m.abs() * (0.5 * field).to_radians().tan();
    let (right, up) = (half(across), half(along));
    let corner = |x: f64, y: f64| origin + turn * DVec3::new(x, y, distance_m);
    Ok(Corners {
        bottom_left: corner(-right, -up),
        bottom_right: corner(right, -up),
        top_left: corner(-right, up),
    })
}

/// Eyes that a segment or a compound is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Eyes {
    pub(super) centre: bool,
    pub(super) left: bool,
    pub(super) right: bool,
}

impl Eyes {
    pub(super) const ALL: Self = Self {
        centre: true,
        left: true,
        right: true,
    };

    /// The eyes of a block; `otherwise` where it states none.
    pub(super) fn read(block: At<'_>, otherwise: Self) -> Result<Self, Trouble> {
        let Some(at) = block.get("eye") else {
            return Ok(otherwise);
        };
        let mut eyes = Self {
            centre: false,
            left: false,
            right: false,
        };
        for word in at.carry().words() {
            match word.text.as_str() {
                "CYCLOP" => eyes.centre = true,
                "LEFT" => eyes.left = true,
                "RIGHT" => eyes.right = true,
                _ => return Err(at.expected("eyes: CYCLOP, LEFT, RIGHT")),
            }
        }
        Ok(eyes)
    }

    /// The one eye that it is for, where it is for one of the two.
    pub(super) fn single(self) -> Option<Eye> {
        match (self.left, self.right) {
            (true, false) => Some(Eye::Left),
            (false, true) => Some(Eye::Right),
            _ => None,
        }
    }
}

/// How a compound shows both eyes in one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Mode {
    /// Pairs of pictures if the window has them, else an anaglyph.
    #[default]
    Auto,
    QuadBuffer,
    Passive,
    Anaglyph(Stereo),
    /// Masks that no anaglyph here has.
    OtherAnaglyph,
}

impl Mode {
    /// The mode of a block of attributes; `otherwise` where it states none.
    pub(super) fn read(
        attributes: Option<At<'_>>,
        keys: [&'static str; 3],
        otherwise: Self,
    ) -> Result<Self, Trouble> {
        let Some(attributes) = attributes else {
            return Ok(otherwise);
        };
        let [mode, left, right] = keys.map(|key| attributes.get(key));
        let mask = |at: Option<At<'_>>| {
            let mut words: Vec<&str> = match at {
                Some(at) => at
                    .carry()
                    .words()
                    .iter()
                    .map(|word| word.text.as_str())
                    .collect(),
                None => return None,
            };
            words.sort_unstable();
            Some(words.join(" "))
        };
        let (left, right) = (mask(left), mask(right));
        let masks = (
            left.as_deref().unwrap_or("RED"),
            right.as_deref().unwrap_or("BLUE GREEN"),
        );
        let anaglyph = match masks {
            ("RED", "BLUE GREEN") => Self::Anaglyph(Stereo::RedCyan),
            ("GREEN", "BLUE RED") => Self::Anaglyph(Stereo::GreenMagenta),
            ("GREEN RED", "BLUE") => Self::Anaglyph(Stereo::AmberBlue),
            _ => Self::OtherAnaglyph,
        };
        let Some(mode) = mode else {
            return Ok(match (left.or(right), otherwise) {
                (Some(_), Self::Auto) => anaglyph,
                _ => otherwise,
            });
        };
        match mode.carry().words() {
            [word] => Ok(match word.text.as_str() {
                "QUAD" => Self::QuadBuffer,
                "PASSIVE" => Self::Passive,
                "ANAGLYPH" => anaglyph,
                "AUTO" => Self::Auto,
                _ => return Err(mode.expected("one of AUTO, QUAD, PASSIVE, ANAGLYPH")),
            }),
            _ => Err(mode.expected("one of AUTO, QUAD, PASSIVE, ANAGLYPH")),
        }
    }

    /// The way of stereo for a channel that shows both eyes.
    pub(super) fn stereo(self, at: At<'_>, quad: bool, builder: &mut Builder) -> Stereo {
        match self {
            Self::Anaglyph(stereo) => stereo,
            Self::Auto if !quad => {
                builder.ledger.note(
                    at,
                    "how both eyes share the channel is not stated",
                    "Equalizer shows a red-cyan anaglyph where the window has no quad buffers",
                    "write stereo as the projector wants it",
                );
                Stereo::RedCyan
            }
            Self::OtherAnaglyph => {
                builder.ledger.note(
                    at,
                    "colour masks of an anaglyph",
                    "red-cyan, green-magenta and amber-blue are known, so red-cyan is taken",
                    "choose the stereo that suits the glasses",
                );
                Stereo::RedCyan
            }
            Self::Passive => {
                builder.ledger.note(
                    at,
                    "passive stereo in one channel",
                    "passive stereo has an output for each eye, so it shows the middle between the eyes",
                    "write one channel with eye = \"left\" and one with eye = \"right\"",
                );
                Stereo::Off
            }
            Self::QuadBuffer | Self::Auto => {
                builder
                    .ledger
                    .note(at, "quad-buffered stereo", QUAD_BUFFER.0, QUAD_BUFFER.1);
                Stereo::Off
            }
        }
    }
}
