//! Where `verify --error` looks from, and what it changes: places and patches drawn from a seed.
//!
//! In: a scene, numbers of the finest tiles, a seed. Out: places, their altitudes above ground, and scene patches, the same
//! for the same seed on every machine. It reads no file and draws no picture.

use protocol::camera::ground_of_tile;
use protocol::scene::LayerKind;
use protocol::{Place, Scene};
use serde_json::{Map, Value, json};

/// Lowest eye above the ground, metres.
const LOWEST_M: f64 = 2.0;
/// Highest eye, in radii of the planet.
const HIGHEST_RADII: f64 = 3.0;
/// Highest eye over the finest data, metres.
const HIGHEST_OVER_FINEST_M: f64 = 100_000.0;
/// Number of the tile that is a whole face is this and the face's.
const FIRST_FACE: u64 = 8;
/// Altitudes that a camera may have, metres.
const ALTITUDES_M: (f64, f64) = (-12_000.0, 1e11);

/// Numbers drawn from a seed: `SplitMix64` (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
#[derive(Clone, Debug)]
pub(super) struct Draws(u64);

impl Draws {
    /// The numbers of one view. Neighbouring seeds and views have nothing in common.
    pub(super) fn new(seed: u64, view: u64) -> Self {
        let mut draws = Self(seed);
        let mixed = draws.next();
        Self(mixed ^ view.wrapping_mul(0xD1B5_4A32_D192_ED03))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    /// 0 ≤ x < 1.
    pub(super) fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(super) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }

    /// Between two numbers above 0, all magnitudes alike.
    fn log_within(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.share())
    }

    fn index(&mut self, count: usize) -> usize {
        ((self.share() * count as f64) as usize).min(count.saturating_sub(1))
    }

    fn chance(&mut self, share: f64) -> bool {
        self.share() < share
    }
}

/// A place whose ground is not known yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wanted {
    pub(super) latitude_deg: f64,
    pub(super) longitude_deg: f64,
    /// Metres above the ground.
    pub(super) height_m: f64,
    heading_deg: f64,
    pitch_deg: f64,
    roll_deg: f64,
}

impl Wanted {
    /// A place of a planet with this radius. `finest` are numbers of tiles.
    pub(super) fn draw(draws: &mut Draws, radius_m: f64, finest: &[u64]) -> Self {
        let mut highest_m = radius_m * HIGHEST_RADII;
        let kind = draws.share();
        let found = if kind < 0.3 && !finest.is_empty() {
            highest_m = HIGHEST_OVER_FINEST_M;
            let tile = finest.get(draws.index(finest.len())).copied();
            let point = [draws.share(), draws.share()];
            tile.and_then(|tile| ground_of_tile(tile, point))
        } else if kind < 0.4 {
            let pole: f64 = if draws.chance(0.5) { 90.0 } else { -90.0 };
            let off_deg = near(draws) * 10.0;
            Some([pole - pole.signum() * off_deg, draws.within(-180.0, 180.0)])
        } else if kind < 0.7 {
            // An edge of the cube, or a corner, and a little inside.
            let face = FIRST_FACE + draws.index(6) as u64;
            let mut side = || {
                let inside = near(draws);
                if draws.chance(0.5) {
                    inside
                } else {
                    1.0 - inside
                }
            };
            let point = if kind < 0.5 {
                [side(), side()]
            } else {
                let side = side();
                let along = draws.share();
                if draws.chance(0.5) {
                    [side, along]
                } else {
                    [along, side]
                }
            };
            ground_of_tile(face, point)
        } else {
            let latitude_deg = draws.within(-1.0, 1.0).asin().to_degrees();
            Some([latitude_deg, draws.within(-180.0, 180.0)])
        };
        let [latitude_deg, longitude_deg] = found.unwrap_or_default();
        let height_m = draws.log_within(LOWEST_M, highest_m);
        // How far below the horizontal the horizon is.
        let dip_deg = (radius_m / (radius_m + height_m)).acos().to_degrees();
        let pitch_deg = match draws.index(4) {
            0 => -90.0,
            1 => draws.within(-90.0, -dip_deg.max(30.0)),
            2 => -dip_deg + draws.within(-5.0, 5.0),
            _ => -dip_deg + draws.within(0.0, 15.0),
        };
        Self {
            latitude_deg,
            longitude_deg,
            height_m,
            heading_deg: draws.within(0.0, 360.0),
            pitch_deg: pitch_deg.clamp(-90.0, 90.0),
            roll_deg: if draws.chance(0.25) {
                draws.within(-180.0, 180.0)
            } else {
                0.0
            },
        }
    }

    /// The place above ground of this height.
    pub(super) fn over(&self, ground_m: f64) -> Place {
        let altitude_m = ground_m + self.height_m;
        Place {
            latitude_deg: self.latitude_deg.clamp(-90.0, 90.0),
            longitude_deg: self.longitude_deg.clamp(-180.0, 180.0),
            altitude_m: altitude_m.clamp(ALTITUDES_M.0, ALTITUDES_M.1),
            heading_deg: self.heading_deg,
            pitch_deg: self.pitch_deg,
            roll_deg: self.roll_deg,
        }
    }
}

/// How far from a pole or an edge, as a share of the way to the next: none at all, or any magnitude.
fn near(draws: &mut Draws) -> f64 {
    if draws.chance(0.3) {
        0.0
    } else {
        draws.log_within(1e-7, 0.1)
    }
}

/// A change of elevation and lenses, as a merge patch. `None` for a scene that has neither.
pub(super) fn change(draws: &mut Draws, scene: &Scene) -> Option<Value> {
    let mut layers = Map::new();
    let of_elevation = scene.layers.iter();
    let of_elevation: Vec<_> = of_elevation
        .filter(|layer| layer.kind() == LayerKind::Elevation)
        .collect();
    let certain = draws.index(of_elevation.len());
    for (index, layer) in of_elevation.iter().enumerate() {
        if index == certain || draws.chance(0.5) {
            let mut keys = Map::new();
            let scale = rounded(draws.within(0.5, 3.0));
            keys.insert("scale".to_owned(), json!(scale));
            if draws.chance(0.5) {
                let offset_m = rounded(draws.within(-500.0, 500.0));
                keys.insert("offset_m".to_owned(), json!(offset_m));
            }
            if draws.chance(0.5) {
                let opacity = rounded(draws.within(0.1, 1.0));
                keys.insert("opacity".to_owned(), json!(opacity));
            }
            if draws.chance(0.5) {
                let weight = rounded(draws.within(0.1, 2.0));
                keys.insert("weight".to_owned(), json!(weight));
            }
            layers.insert(layer.name.clone(), Value::Object(keys));
        }
    }
    let mut lenses = Map::new();
    for lens in &scene.lenses {
        let radius_m = rounded(lens.radius_m * draws.log_within(0.3, 3.0)).clamp(1.0, 5e6);
        lenses.insert(lens.name.clone(), json!({ "radius_m": radius_m }));
    }
    let parts = [("layers", layers), ("lenses", lenses)].into_iter();
    let parts = parts.filter(|(_, map)| !map.is_empty());
    let patch: Map<String, Value> = parts
        .map(|(key, map)| (key.to_owned(), Value::Object(map)))
        .collect();
    (!patch.is_empty()).then_some(Value::Object(patch))
}

/// Three digits after the point: enough, and easy to write again.
fn rounded(number: f64) -> f64 {
    (number * 1e3).round() / 1e3
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    const RADIUS_M: f64 = 6_378_137.0;
    const SCENE: &str = r#"
        [camera]
        mode = "fixed"
        place = { latitude_deg = 45.8, longitude_deg = 6.9, altitude_m = 9000 }
        [layers.relief]
        kind = "elevation"
        repository = "/data/relief"
        [layers.alps]
        kind = "elevation"
        repository = "/data/alps"
        [layers.photo]
        kind = "imagery"
        repository = "/data/photo"
        [lenses.loupe]
        latitude_deg = 45.8
        longitude_deg = 6.9
        radius_m = 4_000_000
    "#;

    fn all(seed: u64, finest: &[u64]) -> Vec<Wanted> {
        let draw = |view| Wanted::draw(&mut Draws::new(seed, view), RADIUS_M, finest);
        (0..2_000).map(draw).collect()
    }

    #[test]
    fn a_seed_gives_the_same_places_and_another_one_others() {
        assert_eq!(all(1, &[8]), all(1, &[8]));
        let (one, two) = (all(1, &[8]), all(2, &[8]));
        assert!(one.iter().zip(&two).all(|(one, two)| one != two));
        // The first numbers of seed 0, as the generator's authors give them.
        let mut draws = Draws(0);
        assert_eq!(draws.next(), 0xE220_A839_7B1D_CDAF);
        assert_eq!(draws.next(), 0x6E78_9E6A_A1B9_65F4);
    }

    #[test]
    fn places_are_everywhere_and_such_as_cameras_may_have() {
        let places = all(7, &[8 + 2]);
        for wanted in &places {
            let place = wanted.over(100.0);
            let scene = Scene::parse(SCENE, "test").unwrap();
            let camera = protocol::Camera::Fixed(place);
            Scene { camera, ..scene }.validate().unwrap();
            assert!((LOWEST_M..=RADIUS_M * HIGHEST_RADII).contains(&wanted.height_m));
        }
        let count = |wanted: &dyn Fn(&Wanted) -> bool| places.iter().filter(|p| wanted(p)).count();
        assert!(count(&|place| place.height_m < 100.0) > 300);
        assert!(count(&|place| place.height_m > 1e6) > 100);
        assert!(count(&|place| place.pitch_deg == -90.0) > 300);
        assert!(count(&|place| place.pitch_deg > 0.0) > 50);
        assert!(count(&|place| place.latitude_deg.abs() > 89.999) > 80);
        assert!(count(&|place| place.latitude_deg == 90.0) > 10);
        // On the edges between the four faces around the equator.
        let on_edge = |place: &Wanted| (place.longitude_deg.abs() % 90.0 - 45.0).abs() < 1e-4;
        assert!(count(&|place| on_edge(place)) > 50);
        let corner_deg = (1.0_f64 / 2.0_f64.sqrt()).atan().to_degrees();
        let in_corner = |place: &Wanted| (place.latitude_deg.abs() - corner_deg).abs() < 1e-4;
        assert!(count(&|place| on_edge(place) && in_corner(place)) > 20);
        // All of the finest data lies on the north face, and a third of the places are there.
        let north = count(&|place| place.latitude_deg > 45.0);
        let elsewhere = all(7, &[]);
        let north_of_none = elsewhere.iter().filter(|place| place.latitude_deg > 45.0);
        assert!(north > north_of_none.count() + 200, "{north}");
    }

    #[test]
    fn changes_are_valid_and_touch_elevation_and_lenses_alone() {
        let scene = Scene::parse(SCENE, "test").unwrap();
        let (mut relief, mut alps) = (0, 0);
        for view in 0..200 {
            let patch = change(&mut Draws::new(3, view), &scene).unwrap();
            let patched = scene.patched(&patch).unwrap();
            assert_ne!(patched, scene);
            assert_eq!(patched.mesh, scene.mesh);
            assert_eq!(patched.camera, scene.camera);
            assert!(patch["layers"]["photo"].is_null());
            assert!(patch["lenses"]["loupe"]["radius_m"].as_f64().unwrap() <= 5e6);
            relief += usize::from(!patch["layers"]["relief"].is_null());
            alps += usize::from(!patch["layers"]["alps"].is_null());
            for layer in ["relief", "alps"] {
                let scale = patch["layers"][layer]["scale"].as_f64().unwrap_or(1.0);
                assert!((0.5..=3.0).contains(&scale));
            }
        }
        assert!((100..200).contains(&relief) && (100..200).contains(&alps));
        let mut bare = scene;
        bare.layers.clear();
        bare.lenses.clear();
        assert_eq!(change(&mut Draws::new(1, 1), &bare), None);
    }
}
