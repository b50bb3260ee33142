//! Observers of Equalizer.
//! In: `observer` blocks. Out: observers and trackers of the draft. Eyes are given from the head, and an untracked head
//! is at the room's origin.

use glam::DVec3;

use super::{global_of, name_of};
use crate::draft::{Builder, Observer, Tracker};
use crate::error::Trouble;
use crate::source::At;

/// From eye to eye where nothing says it.
const EYES_M: f64 = 0.05;

/// Observers by their order, and one for views that have none.
pub(super) struct Observers<'t> {
    pub(super) list: Vec<(At<'t>, usize)>,
    /// Where the configuration says how far eyes are apart.
    eyes: Option<At<'t>>,
    nobody: Option<usize>,
}

/// From eye to eye in metres: what the configuration says, else Equalizer's default. Reading it only where it holds
/// lets it be listed where it does not.
fn default_eyes_m(eyes: Option<At<'_>>) -> Result<f64, Trouble> {
    eyes.map_or(Ok(EYES_M), At::number)
}

/// Reads the observers of a configuration.
pub(super) fn read<'t>(
    config: At<'t>,
    global: Option<At<'t>>,
    builder: &mut Builder,
) -> Result<Observers<'t>, Trouble> {
    let attribute = config
        .get("attributes")
        .and_then(|attributes| attributes.get("eye_base"));
    let eyes = attribute.or_else(|| global_of(global, "EQ_CONFIG_FATTR_EYE_BASE"));
    let mut observers = Observers {
        list: Vec::new(),
        eyes,
        nobody: None,
    };
    for at in config.all("observer") {
        let index = read_observer(at, eyes, builder)?;
        observers.list.push((at, index));
    }
    Ok(observers)
}

impl Observers<'_> {
    /// The observer of a view that names none: a head at the origin.
    pub(super) fn nobody(&mut self, at: At<'_>, builder: &mut Builder) -> Result<usize, Trouble> {
        if let Some(index) = self.nobody {
            return Ok(index);
        }
        let eyes_m = default_eyes_m(self.eyes)?;
        builder.ledger.note(
            at,
            "no observer is stated",
            format!("Equalizer's head at the origin is taken, {eyes_m} m from eye to eye"),
            "measure where the head rests, and correct head_m",
        );
        let observer = Observer {
            name: "default".to_owned(),
            head_m: [0.0; 3],
            looks_deg: [0.0; 3],
            eye_separation_m: eyes_m,
            tracker: None,
        };
        let index = builder.add_observer(at, observer)?;
        self.nobody = Some(index);
        Ok(index)
    }
}

fn read_observer(
    at: At<'_>,
    eyes: Option<At<'_>>,
    builder: &mut Builder,
) -> Result<usize, Trouble> {
    let name = name_of(at.carry())?.unwrap_or("observer");
    let vector = |key: &'static str| {
        let numbers = at.get(key).map(At::numbers::<3>).transpose()?;
        Ok::<_, Trouble>(numbers.map(DVec3::from))
    };
    let (left, right) = (vector("eye_left")?, vector("eye_right")?);
    let middle = vector("eye_cyclop")?;
    let base_m = at.get("eye_base").map(At::number).transpose()?;
    let between = match (left, right) {
        (Some(left), Some(right)) => Some((right - left, 0.5 * (left + right))),
        (None, None) => None,
        (Some(left), None) => {
            let half = middle.unwrap_or_default() - left;
            Some((2.0 * half, left + half))
        }
        (None, Some(right)) => {
            let half = right - middle.unwrap_or_default();
            Some((2.0 * half, right - half))
        }
    };
    if let Some((across, _)) = between
        && (across.y.abs() > 1e-6 || across.z.abs() > 1e-6 || across.x < 0.0)
    {
        builder.ledger.note(
            at,
            format!("eyes that stand along {across}"),
            "eyes stand to the left and right of the head, so their distance alone is kept",
            "write looks_deg",
        );
    }
    if let (Some(middle), Some((_, centre))) = (middle, between)
        && middle.distance(centre) > 1e-6
    {
        builder.ledger.note(
            at,
            format!("eye_cyclop {middle}, which is not the middle {centre} between the eyes"),
            "one point of the head carries all eyes, so eye_cyclop is taken",
            "correct head_m",
        );
    }
    if let (Some(base_m), Some((across, _))) = (base_m, between)
        && (across.length() - base_m).abs() > 1e-6
    {
        builder.ledger.note(
            at,
            format!(
                "eye_base {base_m} beside eyes that are {:.4} m apart",
                across.length()
            ),
            "the places of the eyes hold",
            "correct eye_separation_m",
        );
    }
    let across_m = between.map(|(across, _)| across.length());
    let eye_separation_m = match across_m.or(base_m) {
        Some(metres) => metres,
        None => default_eyes_m(eyes)?,
    };
    if base_m.is_none() && between.is_none() {
        builder.ledger.note(
            at,
            "eye_base is not stated",
            format!("{eye_separation_m} m from eye to eye are taken, the configuration's or Equalizer's default"),
            "correct eye_separation_m",
        );
    }
    let head = middle
        .or(between.map(|(_, centre)| centre))
        .unwrap_or_default();
    if head == DVec3::ZERO {
        builder.ledger.note(
            at,
            "where the head rests is not stated",
            "Equalizer's is taken: the room's origin",
            "measure where the head rests, and correct head_m",
        );
    }
    let mut observer = Observer {
        name: name.to_owned(),
        head_m: head.to_array(),
        looks_deg: [0.0; 3],
        eye_separation_m,
        tracker: None,
    };
    if let Some(tracker) = at.get("vrpn_tracker") {
        let address = tracker.text()?;
        if let Some(source) = builder.vrpn_source(tracker, address) {
            builder.ledger.note(
                tracker,
                "the sensor is not stated",
                "the first one, 0, is taken",
                "write the sensor of the glasses as body, and to_room if the tracker has axes of its own",
            );
            let tracked = Tracker {
                name: format!("{name} tracker"),
                source,
                body: 0,
                to_room: None,
                unit_m: 1.0,
                to_head: (head != DVec3::ZERO).then_some([head.to_array(), [0.0; 3]]),
            };
            observer.tracker = Some(builder.add_tracker(tracker, tracked)?);
        }
    }
    builder.add_observer(at, observer)
}
