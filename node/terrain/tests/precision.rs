//! What reaches the screen, against f64: within 0.01 pixel from 2 m to 40,000 km.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;

use common::{Noise, PLACES, Random, Resident, build_one, lookup};
use geodesy::frame::{FixedPoint, matrix_f32};
use geodesy::{Ellipsoid, LatticePoint, TilePosition};
use glam::{DMat4, DVec3, DVec4};
use terrain::{Lattice, Patch, Seams};

/// Wall pixels per radian, the densest that must hold.
const PIXELS_PER_RADIAN: f64 = 2000.0;
/// Canvas of the test picture in pixels; a view of 88° from side to side.
const CANVAS_PX: f64 = 3840.0;

#[test]
fn vertices_land_within_a_hundredth_of_a_pixel() {
    let mut random = Random(9);
    let (mut worst_px, mut seen) = (0.0_f64, 0_usize);
    for (round, altitude_m) in [2.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6, 1e7, 4e7]
        .iter()
        .cycle()
        .take(270)
        .enumerate()
    {
        let ellipsoid = [Ellipsoid::EARTH, Ellipsoid::MOON, Ellipsoid::MARS][round / 9 % 3];
        let (latitude, longitude) = PLACES[round / 3 % PLACES.len()];
        let over = (Ellipsoid::normal(latitude, longitude) + random.direction() * 1e-3).normalize();
        // A tile near the viewer, of the size that is selected there or larger.
        let size = (altitude_m / ellipsoid.semi_major_m).clamp(1e-7, 1.0);
        let level = (((1.0 / size).log2() as i64) + 3 - random.below(6) as i64).clamp(0, 22) as u8;
        let tile =
            TilePosition::of_normal((over + random.direction() * size).normalize(), level).tile;
        let noise = Noise {
            tile,
            seed: random.next(),
            amplitude: 16 * 500,
            holes: 7,
        };
        let quantum_m = 1.0 / 16.0;
        let resident = Resident::from([(tile, noise)]);
        let mut vertices = Vec::new();
        let levels = Seams::uniform(level as i8).levels;
        build_one(
            &ellipsoid,
            tile,
            &levels,
            &Patch::new(4).unwrap(),
            quantum_m,
            &lookup(&resident),
            &mut vertices,
        )
        .unwrap();

        let eye = ellipsoid.point(over, altitude_m + 500.0 * random.unit());
        let viewer = FixedPoint::from_ecef(eye);
        // Several cameras, because what is at the side of one is in the middle of another.
        for _ in 0..4 {
            let towards = vertices[random.below(vertices.len() as u64) as usize]
                .point()
                .to_ecef()
                - eye;
            let back = -(towards.normalize() + 0.3 * random.direction()).normalize();
            let right = back.cross(random.direction()).normalize();
            let up = back.cross(right);
            let scale = PIXELS_PER_RADIAN / (0.5 * CANVAS_PX);
            // Reversed depth and an infinite far plane.
            let projection = DMat4::from_cols(
                DVec4::X * scale,
                DVec4::Y * scale,
                DVec4::new(0.0, 0.0, 0.0, -1.0),
                DVec4::new(0.0, 0.0, 0.1, 0.0),
            );
            let rotation = DMat4::from_cols(
                right.extend(0.0),
                up.extend(0.0),
                back.extend(0.0),
                DVec4::W,
            );
            let clip_from_relative = projection * rotation.transpose();
            let on_gpu = matrix_f32(clip_from_relative);
            for vertex in &vertices {
                let [i, j] = vertex.lattice.map(i64::from);
                let height_m = f64::from(noise.height(i, j).unwrap_or(0)) * quantum_m;
                let exact =
                    ellipsoid.point(LatticePoint::of_tile(tile, i, j).normal(), height_m) - eye;
                let reference = clip_from_relative * exact.extend(1.0);
                if exact.length() < 2.0
                    || reference.w <= 0.0
                    || reference.truncate().truncate().abs().max_element() > reference.w
                {
                    continue;
                }
                let shader = on_gpu * vertex.point().relative_to(viewer).extend(1.0);
                let pixel = |clip: DVec4| clip.truncate().truncate() / clip.w * (0.5 * CANVAS_PX);
                let error_px = pixel(shader.as_dvec4()).distance(pixel(reference));
                worst_px = worst_px.max(error_px);
                seen += 1;
            }
        }
    }
    assert!(seen > 100_000, "{seen} vertices were in view");
    assert!(worst_px <= 0.01, "{worst_px} px");
}

#[test]
fn normals_are_those_of_the_ellipsoid() {
    let ellipsoid = Ellipsoid::MARS;
    let tile = geodesy::Tile::new(4, 3, 5, 2).unwrap();
    let mut vertices = Vec::new();
    build_one(
        &ellipsoid,
        tile,
        &Seams::uniform(-1).levels,
        &Patch::new(3).unwrap(),
        1.0,
        &|_| None,
        &mut vertices,
    )
    .unwrap();
    for vertex in vertices {
        let [i, j] = vertex.lattice.map(i64::from);
        let exact = LatticePoint::of_tile(tile, i, j).normal();
        let [x, y, z, none] = vertex.normal;
        let stored = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) / 32_767.0;
        assert!(stored.distance(exact) < 3e-5 && none == 0);
        assert_eq!(vertex.point().words(), vertex.position);
        let bytes = vertex.to_bytes();
        assert_eq!(bytes[..4], vertex.position[0].to_le_bytes());
        assert_eq!(bytes[24..26], x.to_le_bytes());
        assert_eq!(bytes[34..], vertex.lattice[1].to_le_bytes());
        assert_eq!(size_of::<terrain::Vertex>(), terrain::Vertex::BYTES);
    }
}
