//! Compounds of Equalizer.
//! In: trees of compounds. Out: ways of stereo for channels, and, in configurations of the first kind that have no
//! canvases, pictures for channels whose compound states a wall. What is below such a channel shares the work of drawing.

use std::collections::HashMap;

use super::canvases::choose_eye;
use super::frustum::{self, Eyes, Mode};
use super::machines::Machines;
use super::observers::Observers;
use super::{global_of, refer, shares_of};
use crate::draft::Builder;
use crate::error::Trouble;
use crate::place::{Picture, region_of_shares};
use crate::room::Corners;
use crate::source::At;

const ATTRIBUTES: [&str; 3] = [
    "stereo_mode",
    "stereo_anaglyph_left_mask",
    "stereo_anaglyph_right_mask",
];
const GLOBAL_ATTRIBUTES: [&str; 3] = [
    "EQ_COMPOUND_IATTR_STEREO_MODE",
    "EQ_COMPOUND_IATTR_STEREO_ANAGLYPH_LEFT_MASK",
    "EQ_COMPOUND_IATTR_STEREO_ANAGLYPH_RIGHT_MASK",
];

/// How channels show both eyes.
pub(super) struct Modes {
    default: Mode,
    of_channels: HashMap<String, Mode>,
}

impl Modes {
    pub(super) fn of(&self, channel: &str) -> Mode {
        self.of_channels
            .get(channel)
            .copied()
            .unwrap_or(self.default)
    }
}

/// Finds how channels show both eyes: their compounds say it, or those above, or the global defaults.
pub(super) fn stereo_modes(config: At<'_>, global: Option<At<'_>>) -> Result<Modes, Trouble> {
    let has_default = GLOBAL_ATTRIBUTES
        .iter()
        .any(|key| global_of(global, key).is_some());
    let mut modes = Modes {
        default: Mode::read(
            global.filter(|_| has_default),
            GLOBAL_ATTRIBUTES,
            Mode::default(),
        )?,
        of_channels: HashMap::new(),
    };
    for compound in config.all("compound") {
        let default = modes.default;
        find_modes(config, compound, default, &mut modes)?;
    }
    Ok(modes)
}

fn find_modes(
    config: At<'_>,
    compound: At<'_>,
    above: Mode,
    modes: &mut Modes,
) -> Result<(), Trouble> {
    let mode = Mode::read(compound.get("attributes"), ATTRIBUTES, above)?;
    if let Some(channel) = compound.get("channel")
        && let Some(name) = channel_name(config, channel)?
    {
        modes.of_channels.entry(name.to_owned()).or_insert(mode);
    }
    for child in compound.all("compound") {
        find_modes(config, child, mode, modes)?;
    }
    Ok(())
}

/// The channel that a compound names, or that of the segment that it refers to.
fn channel_name<'t>(config: At<'t>, channel: At<'t>) -> Result<Option<&'t str>, Trouble> {
    if let [word] = channel.words() {
        return Ok(Some(&word.text));
    }
    let canvas = match channel.get("canvas") {
        Some(reference) => refer(reference, config.all("canvas"))?,
        None => config.all("canvas").next(),
    };
    let segments = canvas.into_iter().flat_map(|canvas| canvas.all("segment"));
    let segment = match channel.get("segment") {
        Some(reference) => refer(reference, segments)?,
        None => segments.into_iter().next(),
    };
    Ok(segment
        .and_then(|segment| segment.get("channel"))
        .and_then(|name| name.words().first().map(|word| word.text.as_str())))
}

/// What a compound has from those above it.
#[derive(Clone, Copy)]
struct Above {
    corners: Option<Corners>,
    eyes: Eyes,
}

/// Reads the pictures of compounds with walls. Other compounds stay unread, and are listed.
pub(super) fn read<'t>(
    config: At<'t>,
    modes: &Modes,
    observers: &mut Observers<'t>,
    machines: &mut Machines<'t>,
    builder: &mut Builder,
) -> Result<(), Trouble> {
    let above = Above {
        corners: None,
        eyes: Eyes::ALL,
    };
    for compound in config.all("compound").filter(|at| states_wall(*at)) {
        read_compound(compound, above, modes, observers, machines, builder)?;
    }
    Ok(())
}

/// Whether a compound, or one below it, states a wall or a projection.
fn states_wall(compound: At<'_>) -> bool {
    compound.children().any(|at| match at.key() {
        "wall" | "projection" => true,
        "compound" => states_wall(at),
        _ => false,
    })
}

fn read_compound<'t>(
    at: At<'t>,
    above: Above,
    modes: &Modes,
    observers: &mut Observers<'t>,
    machines: &mut Machines<'t>,
    builder: &mut Builder,
) -> Result<(), Trouble> {
    at.carry();
    let shares = shares_of(at)?;
    let own = frustum::read(at, builder)?;
    let corners = own.or(above.corners).map(|corners| corners.part(shares));
    let here = Above {
        corners,
        eyes: Eyes::read(at, above.eyes)?,
    };
    let Some(reference) = at.get("channel") else {
        for child in at.all("compound") {
            read_compound(child, here, modes, observers, machines, builder)?;
        }
        return Ok(());
    };
    let (Some(corners), [word]) = (corners, reference.words()) else {
        builder.ledger.list(
            at,
            "it shares the work of drawing among channels; here every node draws what it shows",
            "nothing",
        );
        return Ok(());
    };
    let Some(channel) = machines.channel(&word.text) else {
        return Err(reference.expected("the name of a channel of this file"));
    };
    if machines.is_used(&word.text) {
        builder.ledger.list(
            at,
            "another compound or a canvas shows something in its channel already",
            "check which of them holds",
        );
        return Ok(());
    }
    machines.set_used(&word.text);
    reference.carry();
    let observer = match observers.list.first() {
        Some((_, observer)) => *observer,
        None => observers.nobody(at, builder)?,
    };
    // A wall of its own is that of the whole channel; one from above is cut for it.
    let part = if own.is_some() {
        shares
    } else {
        [0.0, 0.0, 1.0, 1.0]
    };
    let [x, y, width, height] = channel.region_px;
    let Some(region) = region_of_shares(part, [width, height]) else {
        return Err(at.expected("a viewport within 0…1 that is not empty"));
    };
    let states_both = here.eyes.left && here.eyes.right && !here.eyes.centre;
    let is_stereo = states_both || here.eyes.single().is_some();
    let Some((output, is_quad)) = machines.output(&channel) else {
        return Ok(());
    };
    let mode = modes.of(&word.text);
    let (eye, stereo) = choose_eye(at, here.eyes, is_stereo, mode, is_quad, builder);
    let eye = builder.join(at, output, eye, stereo);
    let picture = Picture {
        name: &word.text,
        observer,
        eye,
        region_px: [x + region[0], y + region[1], region[2], region[3]],
        calibration: None,
    };
    builder.show(at, output, corners, picture)
}
