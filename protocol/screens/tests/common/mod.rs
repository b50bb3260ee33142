//! What the tests of screens share: numbers by chance, the screens of a few real and thinkable sites.
//! In: seeds. Out: the same screens and heads in every run. It checks nothing.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "each test takes its share; a test that panics has failed"
)]

pub mod examine;

use glam::DVec3;
use screens::{Cylinder, CylinderMapping, Planar, Points, PointsAt, Shape, Sphere, SphereMapping};

/// The place for which the projectors of the laboratory in Siegen were aligned.
pub const SIEGEN_HEAD: DVec3 = DVec3::new(0.0, 1.78, 0.0);
/// Radius of its cylinder in metres.
pub const SIEGEN_RADIUS_M: f64 = 2.4912;
/// Its wall segments: lower left, lower right and upper left corner, as its public configuration gives them.
pub const SIEGEN_WALLS: [[[f64; 3]; 3]; 4] = [
    [
        [-2.49, 0.0, -0.0771964],
        [-1.5598, 0.0, -1.94244],
        [-2.49, 2.6, -0.0771964],
    ],
    [
        [-1.78883, 0.0, -1.73382],
        [0.1549, 0.0, -2.48638],
        [-1.78883, 2.6, -1.73382],
    ],
    [
        [-0.1549, 0.0, -2.48638],
        [1.78883, 0.0, -1.73382],
        [-0.1549, 2.6, -2.48638],
    ],
    [
        [1.5598, 0.0, -1.94244],
        [2.49, 0.0, -0.0771964],
        [1.5598, 2.6, -1.94244],
    ],
];

/// Numbers by chance (xorshift64*, Vigna 2016).
pub struct Random(pub u64);

impl Random {
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11;
        low + (high - low) * (bits as f64 / (1_u64 << 53) as f64)
    }

    pub fn direction(&mut self) -> DVec3 {
        loop {
            let place = self.within(1.0);
            if place.length() > 0.01 {
                return place.normalize();
            }
        }
    }

    /// Within a ball around the origin.
    pub fn within(&mut self, radius: f64) -> DVec3 {
        loop {
            let place = DVec3::new(
                self.between(-1.0, 1.0),
                self.between(-1.0, 1.0),
                self.between(-1.0, 1.0),
            );
            if place.length_squared() <= 1.0 {
                return place * radius;
            }
        }
    }
}

pub fn rectangle([bottom_left, bottom_right, top_left]: [[f64; 3]; 3]) -> Planar {
    Planar {
        bottom_left_m: bottom_left.into(),
        bottom_right_m: bottom_right.into(),
        top_left_m: top_left.into(),
    }
}

/// A wall segment of Siegen.
pub fn siegen(wall: usize) -> Shape {
    Shape::Cylinder(Cylinder {
        foot_m: DVec3::ZERO,
        axis: DVec3::Y,
        radius_m: SIEGEN_RADIUS_M,
        mapping: CylinderMapping::Chord {
            corners: rectangle(SIEGEN_WALLS[wall]),
            aligned_from_m: SIEGEN_HEAD,
        },
    })
}

pub fn planar() -> Shape {
    Shape::Planar(rectangle([
        [-2.0, 0.3, -1.0],
        [1.0, 0.3, -2.0],
        [-2.0, 2.4, -1.0],
    ]))
}

pub fn arc(azimuth_deg: [f64; 2]) -> Shape {
    Shape::Cylinder(Cylinder {
        foot_m: DVec3::new(0.1, -0.2, 0.3),
        axis: DVec3::new(0.1, 2.0, -0.1),
        radius_m: 3.0,
        mapping: CylinderMapping::Arc {
            azimuth_deg,
            height_m: [0.0, 2.6],
        },
    })
}

fn dome_of(mapping: SphereMapping) -> Sphere {
    Sphere {
        centre_m: DVec3::new(0.0, 1.5, 0.0),
        radius_m: 5.0,
        tilt_deg: 20.0,
        mapping,
    }
}

pub fn fisheye(field_deg: f64) -> Shape {
    Shape::Sphere(dome_of(SphereMapping::Fisheye { field_deg }))
}

pub fn grid(azimuth_deg: [f64; 2], elevation_deg: [f64; 2]) -> Shape {
    Shape::Sphere(dome_of(SphereMapping::Grid {
        azimuth_deg,
        elevation_deg,
    }))
}

/// Points of another shape.
pub fn points_of(shape: &Shape, width: u32, height: u32, at: PointsAt) -> Shape {
    let place = |index: u32, count: u32| match at {
        PointsAt::CellCentres => (f64::from(index) + 0.5) / f64::from(count),
        PointsAt::Corners => f64::from(index) / f64::from(count - 1),
    };
    let points_m = (0..height)
        .flat_map(|row| (0..width).map(move |column| [place(column, width), place(row, height)]))
        .map(|[x, y]| {
            shape
                .point_m(x, y)
                .unwrap_or(DVec3::NAN)
                .as_vec3()
                .to_array()
        })
        .collect();
    Shape::Points(Points::new(width, height, points_m, at).unwrap())
}

/// Every smooth kind of screen by name, with the room in which its heads are: a ball.
pub fn smooth_screens() -> Vec<(&'static str, Shape, DVec3, f64)> {
    let dome_m = DVec3::new(0.0, 1.5, 0.0);
    let mut screens: Vec<_> = (0..4)
        .map(|wall| ("Siegen", siegen(wall), DVec3::new(0.0, 1.5, 0.0), 1.2))
        .collect();
    screens.extend([
        ("planar", planar(), DVec3::new(0.0, 1.5, 1.0), 1.5),
        ("arc", arc([-115.0, 80.0]), DVec3::new(0.0, 1.2, 0.0), 2.0),
        ("ring", arc([-180.0, 180.0]), DVec3::new(0.0, 1.2, 0.0), 2.0),
        ("fisheye", fisheye(180.0), dome_m, 3.0),
        ("wide fisheye", fisheye(240.0), dome_m, 3.0),
        ("grid", grid([-120.0, 120.0], [-10.0, 60.0]), dome_m, 3.0),
    ]);
    screens
}
