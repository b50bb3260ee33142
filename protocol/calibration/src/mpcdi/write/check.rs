//! What an archive can hold.
//! In: a region, the profile and the regions before it. Out: nothing, or what cannot be written: what is written, the
//! reader takes. It changes nothing.

use super::super::document::Profile;
use super::{WriteError, profile_of};
use crate::read::check_mapping;
use crate::{CanvasPlace, Frustum, Mapping, Region};

pub(super) fn check(
    region: &Region,
    profile: Profile,
    before: &[Region],
) -> Result<(), WriteError> {
    let name = || region.name.clone();
    let is_plain = |name: &str| name.trim() == name && !name.contains(char::is_control);
    if region.name.is_empty()
        || !is_plain(&region.name)
        || before.iter().any(|known| known.name == region.name)
    {
        return Err(WriteError::BadName { region: name() });
    }
    if profile_of(&region.mapping) != profile {
        return Err(WriteError::MixedProfiles { region: name() });
    }
    if !region
        .size_px
        .iter()
        .all(|size| (1..=crate::MAX_SIZE_PX).contains(size))
    {
        return Err(WriteError::BadSize {
            region: name(),
            what: "output",
        });
    }
    if profile == Profile::ShaderLamp && region.distortion.is_none() {
        return Err(WriteError::NoDistortion { region: name() });
    }
    if region.beta.is_some() && region.uplift != crate::Uplift::default() {
        return Err(WriteError::Uplift { region: name() });
    }
    for (what, map) in [("alpha map", &region.alpha), ("beta map", &region.beta)] {
        let Some(map) = map else { continue };
        if [map.width, map.height] != region.size_px {
            return Err(WriteError::WrongSize {
                region: name(),
                what,
            });
        }
        if !map.is_full() {
            return Err(WriteError::BadSize {
                region: name(),
                what,
            });
        }
        if map.first_not_a_number().is_some() {
            return Err(WriteError::NotANumber {
                region: name(),
                what,
            });
        }
    }
    let gammas = [region.gamma.alpha, region.gamma.beta];
    if !gammas.iter().all(|gamma| (0.01..=100.0).contains(gamma)) {
        return Err(WriteError::NotANumber {
            region: name(),
            what: "its gamma",
        });
    }
    if check_mapping(&region.name, &region.mapping).is_err() {
        return Err(WriteError::NothingMapped { region: name() });
    }
    if let Some(what) = out_of_range(region) {
        return Err(WriteError::NotANumber {
            region: name(),
            what,
        });
    }
    Ok(())
}

/// What of the numbers that become text a reader would refuse.
fn out_of_range(region: &Region) -> Option<&'static str> {
    let frustum_fits = |frustum: &Frustum| {
        let turns = [frustum.yaw_deg, frustum.pitch_deg, frustum.roll_deg];
        let edges = [
            frustum.left_deg,
            frustum.right_deg,
            frustum.up_deg,
            frustum.down_deg,
        ];
        turns.iter().all(|turn| turn.abs() <= 360.0)
            && edges.iter().all(|edge| edge.abs() <= 89.999)
            && frustum.left_deg < frustum.right_deg
            && frustum.down_deg < frustum.up_deg
    };
    let place_fits = |place: &CanvasPlace| {
        let extents = [place.width, place.height];
        let lower = 1.0 - (place.y + place.height);
        [place.x, lower].iter().all(|share| share.abs() <= 100.0)
            && extents.iter().all(|extent| (1e-6..=100.0).contains(extent))
    };
    if !region.canvas.as_ref().is_none_or(place_fits) {
        return Some("its place on the canvas");
    }
    match &region.mapping {
        Mapping::Frustum { frustum, .. } if !frustum_fits(frustum) => Some("its frustum"),
        Mapping::Points {
            projector: Some(projector),
            ..
        } => {
            let is_near = projector.position_m.iter().all(|place| place.abs() <= 1e5);
            let fits =
                is_near && projector.axes.are_orthonormal() && frustum_fits(&projector.frustum);
            (!fits).then_some("its projector")
        }
        _ => None,
    }
}
