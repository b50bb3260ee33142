//! Scenes as JSON: random scenes survive the way there and back, and no JSON makes the reader panic.
#![allow(
    clippy::unwrap_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

use proptest::prelude::*;
use protocol::scene::{
    Aspect, Blend, Elevation, Fusion, Hillshade, Imagery, Isolines, Layer, LayerKind,
    LayerParameters, Process, Ramp, RampName, RampStop, Sar, SarMapping, Scene, Slope,
};
use serde_json::{Map, Value, json};

fn everything() -> Scene {
    Scene::parse(include_str!("support/everything.toml"), "everything.toml").unwrap()
}

fn colour() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(0.0..=1.0)
}

/// Two ends that differ clearly, within a range.
fn interval(low: f64, high: f64) -> impl Strategy<Value = [f64; 2]> {
    (low..=high, low..=high)
        .prop_map(|(a, b)| [a.min(b), a.max(b)])
        .prop_filter("too narrow", move |[a, b]| b - a > 1e-5 * (high - low))
}

fn ramp() -> impl Strategy<Value = Ramp> {
    const NAMES: &[RampName] = &[
        RampName::LandAndSea,
        RampName::Land,
        RampName::Sea,
        RampName::Grey,
        RampName::Hypsometric,
    ];
    let stops = (
        -11_000.0..9000.0,
        prop::collection::vec((0.1..500.0, colour()), 2..=32),
    );
    let own = stops.prop_map(|(lowest_m, steps)| {
        let mut height_m = lowest_m;
        let stops = steps.into_iter().map(|(step_m, colour)| {
            height_m += step_m;
            RampStop { height_m, colour }
        });
        Ramp {
            name: None,
            stops: stops.collect(),
        }
    });
    prop_oneof![prop::sample::select(NAMES).prop_map(Ramp::named), own]
}

fn process() -> impl Strategy<Value = Process> {
    const MAPPINGS: &[SarMapping] = &[
        SarMapping::Linear,
        SarMapping::Logarithmic,
        SarMapping::Gamma,
    ];
    prop_oneof![
        (0.0..=100.0, -1e5..=1e5, -1e3..=1e3, interval(-5e5, 5e5)).prop_map(
            |(scale, offset_m, datum_shift_m, clamp_m)| Process::Elevation(Elevation {
                scale,
                offset_m,
                datum_shift_m,
                clamp_m
            })
        ),
        (
            -16.0..=16.0,
            0.0..=8.0,
            0.0..=8.0,
            0.1..=10.0,
            prop::array::uniform3(0_u8..=15),
            prop::option::of(interval(-1e12, 1e12)),
            colour()
        )
            .prop_map(
                |(exposure_stops, contrast, saturation, gamma, channels, range, tint)| {
                    Process::Imagery(Imagery {
                        exposure_stops,
                        contrast,
                        saturation,
                        gamma,
                        channels,
                        range,
                        tint,
                    })
                }
            ),
        (
            prop::sample::select(MAPPINGS),
            prop::option::of(interval(0.0, 1e12)),
            1.0..=1e6,
            0.01..=1.0,
            colour()
        )
            .prop_map(
                |(mapping, range, strength, exponent, tint)| Process::Sar(Sar {
                    mapping,
                    range,
                    strength,
                    exponent,
                    tint
                })
            ),
        ramp().prop_map(Process::Ramp),
        (0.01..=1e5, 0.1..=20.0, 0_u32..=100, 0.1..=20.0, colour()).prop_map(
            |(spacing_m, width_px, bold_every, bold_width_px, colour)| Process::Isolines(
                Isolines {
                    spacing_m,
                    width_px,
                    bold_every,
                    bold_width_px,
                    colour
                }
            )
        ),
        (interval(0.0, 90.0), colour(), colour()).prop_map(|(range_deg, gentle, steep)| {
            Process::Slope(Slope {
                range_deg,
                gentle,
                steep,
            })
        }),
        (0.0..=1.0, 0.0..=1.0, 0.0..=90.0).prop_map(|(saturation, brightness, flat_below_deg)| {
            Process::Aspect(Aspect {
                saturation,
                brightness,
                flat_below_deg,
            })
        }),
        (0.0..=360.0, 0.0..=90.0, 0.0..=100.0).prop_map(
            |(azimuth_deg, altitude_deg, exaggeration)| Process::Hillshade(Hillshade {
                azimuth_deg,
                altitude_deg,
                exaggeration
            })
        ),
    ]
}

fn parameters() -> impl Strategy<Value = LayerParameters> {
    const BLENDS: &[Blend] = &[Blend::Normal, Blend::Multiply, Blend::Screen, Blend::Add];
    let fusion = (
        -1000..=1000,
        0.0..=1000.0,
        0.0..=1.0,
        prop::sample::select(BLENDS),
    );
    (fusion, process()).prop_map(|((priority, weight, opacity, mut blend), process)| {
        if process.kind() == LayerKind::Elevation && blend == Blend::Screen {
            blend = Blend::Add;
        }
        LayerParameters {
            fusion: Fusion {
                priority,
                weight,
                opacity,
                blend,
            },
            process,
        }
    })
}

fn scene_of(layers: Vec<(String, LayerParameters)>) -> Scene {
    let mut scene = everything();
    scene.lenses.clear();
    scene.layers = layers
        .into_iter()
        .map(|(name, parameters)| Layer {
            name,
            repository: parameters
                .process
                .kind()
                .has_repository()
                .then(|| "data/x".to_owned()),
            parameters,
        })
        .collect();
    scene
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn to_json_and_from_json_are_the_identity(
        layers in prop::collection::btree_map("[a-zA-Z0-9_-]{1,12}", parameters(), 0..=8),
        others in prop::collection::vec(parameters(), 12),
        lenses in prop::collection::btree_map("[a-z]{1,8}", (-90.0..=90.0, -180.0..=180.0, 1e-3..=5e6), 0..=8),
        keep in prop::collection::vec(any::<prop::sample::Index>(), 40),
    ) {
        let scene = scene_of(layers.into_iter().collect());
        scene.validate().unwrap();
        prop_assert_eq!(&Scene::from_json(&scene.to_json(), "json").unwrap(), &scene);
        // Lenses: some of the values of other parameters of the same kind, over each layer that has such.
        let other_json = scene_of(others.iter().cloned().enumerate().map(|(index, other)| (format!("other{index:02}"), other)).collect()).to_json();
        let mut picks = keep.iter().cycle();
        let mut given = Map::new();
        for (name, (latitude_deg, longitude_deg, radius_m)) in lenses {
            let mut inside = Map::new();
            for layer in &scene.layers {
                let Some(index) = others.iter().position(|other| other.process.kind() == layer.kind()) else { continue };
                let mut values = other_json["layers"][format!("other{index:02}")].as_object().unwrap().clone();
                values.retain(|key, _| key != "kind" && key != "repository" && picks.next().unwrap().index(2) == 0);
                inside.insert(layer.name.clone(), Value::Object(values));
            }
            given.insert(name, json!({ "latitude_deg": latitude_deg, "longitude_deg": longitude_deg, "radius_m": radius_m, "layers": inside }));
        }
        let patch = json!({ "lenses": given });
        let patched = scene.patched(&patch).unwrap();
        patched.validate().unwrap();
        prop_assert_eq!(&patched.to_json()["lenses"], &patch["lenses"]);
        prop_assert_eq!(&Scene::from_json(&patched.to_json(), "json").unwrap(), &patched);
    }

    #[test]
    fn no_json_makes_it_panic(path in prop::collection::vec(any::<prop::sample::Index>(), 1..6), junk in junk()) {
        let scene = everything();
        let mut value = scene.to_json();
        put(&mut value, &path, &junk);
        match Scene::from_json(&value, "json") {
            Ok(read) => read.validate().unwrap(),
            Err(error) => prop_assert!(error.to_string().starts_with("json: ")),
        }
        if let Ok(patched) = scene.patched(&junk) {
            patched.validate().unwrap();
        }
    }
}

/// Puts junk somewhere within: `path` chooses a member of each object on the way.
fn put(value: &mut Value, path: &[prop::sample::Index], junk: &Value) {
    if let (Some((step, rest)), Value::Object(members)) = (path.split_first(), &mut *value)
        && !members.is_empty()
    {
        let chosen = step.index(members.len());
        let (_, member) = members.iter_mut().nth(chosen).unwrap();
        put(member, rest, junk);
    } else {
        value.clone_from(junk);
    }
}

fn junk() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<u64>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        "\\PC{0,12}".prop_map(Value::from),
        any::<String>().prop_map(Value::from),
        prop::sample::select(&["automatic", "sea", "normal", "imagery", "earth"][..])
            .prop_map(Value::from),
    ];
    leaf.prop_recursive(4, 32, 5, |inner| {
        let key = prop_oneof![
            any::<String>(),
            prop::sample::select(
                &[
                    "layers", "lenses", "heights", "kind", "scale", "stops", "height_m"
                ][..]
            )
            .prop_map(str::to_owned),
        ];
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
            prop::collection::btree_map(key, inner, 0..5)
                .prop_map(|members| Value::Object(members.into_iter().collect())),
        ]
    })
}
