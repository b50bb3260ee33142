//! Lenses under the operator's pointer: which one it takes, and the scene with that one moved.
//! In: a scene, a place on the ground. Out: a name, a scene. What a lens shows and where exactly its rim runs is
//! none of its business.

use protocol::Scene;
use protocol::message::MoveLens;
use protocol::scene::Lens;

/// The lens that a pointer at this place takes: of those whose circle holds it the one with the nearest centre,
/// or else of all. `None` without lenses.
///
/// Distances are those on a sphere of the planet's mean radius: within a percent of the true ones, a pointer's
/// precision. What nodes draw does not depend on them.
pub(crate) fn under(scene: &Scene, place: &MoveLens) -> Option<String> {
    let radius_m = (scene.planet.largest_radius_m() + scene.planet.smallest_radius_m()) / 2.0;
    let measured = scene.lenses.iter().map(|lens| {
        let distance_m = radius_m * angle(lens, place);
        (distance_m > lens.radius_m, distance_m, &lens.name)
    });
    measured
        .min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)))
        .map(|(_, _, name)| name.clone())
}

/// The scene with the centre of a lens at another place. `None` where nothing is to be done: the lens is gone or
/// there already, or the place is none.
pub(crate) fn moved(scene: &Scene, name: &str, place: &MoveLens) -> Option<Scene> {
    let on_the_planet = (-90.0..=90.0).contains(&place.latitude_deg)
        && (-180.0..=180.0).contains(&place.longitude_deg);
    let index = scene.lenses.iter().position(|lens| lens.name == name)?;
    let mut scene = Some(scene).filter(|_| on_the_planet)?.clone();
    let lens = scene.lenses.get_mut(index)?;
    let centre = [place.latitude_deg, place.longitude_deg];
    if [lens.latitude_deg, lens.longitude_deg] == centre {
        return None;
    }
    [lens.latitude_deg, lens.longitude_deg] = centre;
    Some(scene)
}

/// The angle between two places as seen from the centre of a sphere, in radians: the haversine formula, which is
/// exact for small angles too (R. W. Sinnott, "Virtues of the Haversine", Sky & Telescope 68, 1984).
fn angle(lens: &Lens, place: &MoveLens) -> f64 {
    let [latitude, other_latitude] = [lens.latitude_deg, place.latitude_deg].map(f64::to_radians);
    let half_longitude = (place.longitude_deg - lens.longitude_deg).to_radians() / 2.0;
    let half_latitude = (other_latitude - latitude) / 2.0;
    let haversine = half_latitude.sin().powi(2)
        + latitude.cos() * other_latitude.cos() * half_longitude.sin().powi(2);
    2.0 * haversine.sqrt().min(1.0).asin()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    fn scene() -> Scene {
        let text = "layers = {}\n[camera]\nmode = \"fixed\"\n\
            place = { latitude_deg = 0.0, longitude_deg = 0.0, altitude_m = 1e7, pitch_deg = -90.0 }\n\
            [lenses.large]\nlatitude_deg = 0.0\nlongitude_deg = 179.0\nradius_m = 500e3\n\
            [lenses.small]\nlatitude_deg = 0.0\nlongitude_deg = -177.0\nradius_m = 50e3\n";
        Scene::parse(text, "test").unwrap()
    }

    fn place(latitude_deg: f64, longitude_deg: f64) -> MoveLens {
        MoveLens {
            latitude_deg,
            longitude_deg,
            grab: true,
        }
    }

    #[test]
    fn the_lens_that_holds_the_pointer_is_taken_or_else_the_nearest() {
        let scene = scene();
        for (place, taken) in [
            // One degree is 111 km: 445 km from the large lens across the antimeridian, 111 km from the small one.
            (place(0.0, -178.0), "large"),
            (place(0.0, -177.1), "small"),
            // Beside both.
            (place(0.0, -176.0), "small"),
            (place(60.0, 178.0), "large"),
        ] {
            assert_eq!(under(&scene, &place).unwrap(), taken, "{place:?}");
        }
        let mut bare = scene;
        bare.lenses.clear();
        assert_eq!(under(&bare, &place(0.0, 0.0)), None);
    }

    #[test]
    fn a_lens_moves_alone_and_only_on_the_planet() {
        let scene = scene();
        let after = moved(&scene, "small", &place(10.0, 20.0)).unwrap();
        assert_eq!(after.lenses[1].latitude_deg, 10.0);
        assert_eq!(after.lenses[1].longitude_deg, 20.0);
        assert_eq!(after.lenses[0], scene.lenses[0]);
        after.validate().unwrap();
        assert_eq!(
            moved(&after, "small", &place(10.0, 20.0)),
            None,
            "no change"
        );
        for off_the_planet in [
            place(f64::NAN, 0.0),
            place(0.0, f64::INFINITY),
            place(90.1, 0.0),
            place(0.0, -181.0),
        ] {
            assert_eq!(
                moved(&scene, "small", &off_the_planet),
                None,
                "{off_the_planet:?}"
            );
        }
        assert_eq!(moved(&scene, "gone", &place(0.0, 0.0)), None);
    }
}
