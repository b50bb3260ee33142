//! Canvases: planar screens as one picture in pixels, cut into blocks that everybody renders alike.
//!
//! In: a screen relative to the viewer's eye, its size in pixels, and the rectangles that are wanted of it.
//! Out: per block the exact transform, the rays and the scissor rectangle. A pixel's arithmetic depends
//! on its block alone, never on which output of which node asked for it: that is why a tiled wall equals
//! the single picture bit for bit. It touches no device.

use geodesy::frame::{matrix_f32, scalar_f32, vector_f32};
use glam::{DMat3, DMat4, DVec3, DVec4, Mat4, Vec3};

/// The largest side of a block in pixels. Blocks are aligned to the canvas.
pub const BLOCK_PX: u32 = 2048;
/// The near plane in metres. With an infinite reversed depth range in f32 it costs no precision.
pub(crate) const NEAR_M: f64 = 0.1;

/// A planar screen in room axes, relative to the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarScreen {
    /// From the eye to the screen's lower left corner, in metres.
    pub lower_left_m: DVec3,
    /// Unit vector along the lower edge.
    pub right: DVec3,
    /// Unit vector along the left edge.
    pub up: DVec3,
    /// Width and height in metres.
    pub size_m: [f64; 2],
    /// Width and height in pixels.
    pub size_px: [u32; 2],
}

/// A rectangle in pixels, origin at the top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PixelRect {
    /// Left edge.
    pub x: u32,
    /// Top edge.
    pub y: u32,
    /// Width, > 0.
    pub width: u32,
    /// Height, > 0.
    pub height: u32,
}

impl PixelRect {
    /// What two rectangles have in common.
    #[must_use]
    pub fn intersection(self, other: Self) -> Option<Self> {
        let x = self.x.max(other.x);
        let y = self.y.max(other.y);
        let right = (self.x + self.width).min(other.x + other.width);
        let bottom = (self.y + self.height).min(other.y + other.height);
        (right > x && bottom > y).then(|| Self {
            x,
            y,
            width: right - x,
            height: bottom - y,
        })
    }
}

/// One block of a canvas with the part of it that is wanted.
#[derive(Clone, Debug)]
pub struct Block {
    /// The whole block on the canvas.
    pub area: PixelRect,
    /// The wanted part, relative to the block's top left corner.
    pub wanted: PixelRect,
    /// Viewer-relative ECEF metres to the block's clip space.
    pub clip_from_relative: Mat4,
    /// Directions in ECEF axes from the eye to the corners of the wanted part: left bottom, right bottom,
    /// right top, left top. For culling.
    pub corner_directions: [DVec3; 4],
    /// Ray in ECEF axes through the block's top left corner, and its change per pixel right and down,
    /// scaled so that f32 keeps them.
    pub ray: [Vec3; 3],
}

impl PlanarScreen {
    /// The direction in room axes from the eye through a place on the canvas, in pixels, y down. Not of unit length.
    #[must_use]
    pub fn ray_through(&self, canvas_px: [f64; 2]) -> DVec3 {
        let [x, y] = canvas_px;
        let share = |pixels: f64, of: u32| pixels / f64::from(of.max(1));
        let right = self.right * (self.size_m[0] * share(x, self.size_px[0]));
        let up = self.up * (self.size_m[1] * (1.0 - share(y, self.size_px[1])));
        self.lower_left_m + right + up
    }

    /// The blocks that meet `wanted` (in canvas pixels). `room` holds the room's x, y and z axes in ECEF
    /// as columns.
    #[must_use]
    pub fn blocks(&self, wanted: PixelRect, room: DMat3) -> Vec<Block> {
        let [width, height] = self.size_px;
        let mut blocks = Vec::new();
        for y in (0..height).step_by(BLOCK_PX as usize) {
            for x in (0..width).step_by(BLOCK_PX as usize) {
                let area = PixelRect {
                    x,
                    y,
                    width: BLOCK_PX.min(width - x),
                    height: BLOCK_PX.min(height - y),
                };
                if let Some(part) = area.intersection(wanted) {
                    blocks.push(self.block(area, part, room));
                }
            }
        }
        blocks
    }

    /// All of the canvas as one block, for a picture that is sampled: it has no seams inside.
    #[must_use]
    pub(crate) fn whole(&self, room: DMat3) -> Option<Block> {
        let [width, height] = self.size_px;
        let whole = PixelRect {
            x: 0,
            y: 0,
            width,
            height,
        };
        (width > 0 && height > 0).then(|| self.block(whole, whole, room))
    }

    fn block(&self, area: PixelRect, part: PixelRect, room: DMat3) -> Block {
        // Axes of the screen in ECEF: right, up, and out of the screen towards the viewer.
        let right = room * self.right;
        let up = room * self.up;
        let out = right.cross(up);
        let [pixels_x, pixels_y] = self.size_px.map(f64::from);
        let metres_x = self.size_m[0] / pixels_x;
        let metres_y = self.size_m[1] / pixels_y;
        // The block's edges in the screen plane, measured from the foot of the eye's perpendicular.
        let normal = self.right.cross(self.up);
        let distance = -self.lower_left_m.dot(normal);
        let edge_x = |pixel: u32| self.lower_left_m.dot(self.right) + f64::from(pixel) * metres_x;
        let edge_y =
            |pixel: u32| self.lower_left_m.dot(self.up) + (pixels_y - f64::from(pixel)) * metres_y;
        let (left, right_edge) = (edge_x(area.x), edge_x(area.x + area.width));
        let (bottom, top) = (edge_y(area.y + area.height), edge_y(area.y));
        // Off-axis projection (R. Kooima, "Generalized Perspective Projection", 2008) with reversed,
        // infinite depth: z_clip = near, w = distance along −out.
        let (w, h) = (right_edge - left, top - bottom);
        let projection = DMat4::from_cols(
            DVec4::new(2.0 * distance / w, 0.0, 0.0, 0.0),
            DVec4::new(0.0, 2.0 * distance / h, 0.0, 0.0),
            DVec4::new((right_edge + left) / w, (top + bottom) / h, 0.0, -1.0),
            DVec4::new(0.0, 0.0, NEAR_M, 0.0),
        );
        let screen_from_ecef = DMat4::from_mat3(DMat3::from_cols(right, up, out).transpose());
        let direction = |pixel_x: u32, pixel_y: u32| {
            right * edge_x(pixel_x) + up * edge_y(pixel_y) - out * distance
        };
        let (x0, x1) = (part.x, part.x + part.width);
        let (y0, y1) = (part.y, part.y + part.height);
        let ray = [direction(area.x, area.y), right * metres_x, -up * metres_y];
        Block {
            area,
            wanted: PixelRect {
                x: part.x - area.x,
                y: part.y - area.y,
                ..part
            },
            clip_from_relative: matrix_f32(projection * screen_from_ecef),
            corner_directions: [
                direction(x0, y1),
                direction(x1, y1),
                direction(x1, y0),
                direction(x0, y0),
            ],
            ray: ray.map(|vector| vector_f32(vector / distance)),
        }
    }
}

impl Block {
    /// True where the body of these semi-axes fills the wanted part for a viewer outside it: the rays
    /// through all four corners meet it, and it is convex. No sky can show there.
    #[must_use]
    pub(crate) fn is_filled_by(&self, semi_axes_m: DVec3, eye: DVec3) -> bool {
        let viewer = eye / semi_axes_m;
        let outside = viewer.length_squared() - 1.0;
        let meets = |direction: &DVec3| {
            let ray = *direction / semi_axes_m;
            let towards = -viewer.dot(ray);
            towards > 0.0 && towards * towards >= ray.length_squared() * outside
        };
        outside > 0.0 && self.corner_directions.iter().all(meets)
    }
}

/// Scales a direction into the space where the ellipsoid is the unit sphere.
#[must_use]
pub(crate) fn to_sphere_space(direction: Vec3, semi_major_m: f64, semi_minor_m: f64) -> [f32; 4] {
    // Only the ratio of the axes matters to a direction.
    let ratio = scalar_f32(semi_major_m / semi_minor_m);
    [direction.x, direction.y, direction.z * ratio, 0.0]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    fn screen() -> PlanarScreen {
        PlanarScreen {
            lower_left_m: DVec3::new(-2.0, -1.0, -3.0),
            right: DVec3::X,
            up: DVec3::Y,
            size_m: [4.0, 2.25],
            size_px: [5120, 2880],
        }
    }

    fn room() -> DMat3 {
        DMat3::from_euler(glam::EulerRot::ZYX, 0.4, -1.1, 2.3)
    }

    fn project(block: &Block, point: DVec3) -> [f64; 2] {
        let clip = block.clip_from_relative.as_dmat4() * point.extend(1.0);
        let x = (clip.x / clip.w * 0.5 + 0.5) * f64::from(block.area.width);
        let y = (0.5 - clip.y / clip.w * 0.5) * f64::from(block.area.height);
        [x + f64::from(block.area.x), y + f64::from(block.area.y)]
    }

    #[test]
    fn a_point_of_the_screen_lands_on_its_pixel_in_every_block() {
        let screen = screen();
        let whole = PixelRect {
            x: 0,
            y: 0,
            width: 5120,
            height: 2880,
        };
        let blocks = screen.blocks(whole, room());
        assert_eq!(blocks.len(), 6);
        for block in &blocks {
            for (px, py) in [(100.0, 50.0), (3000.5, 1111.25), (5119.0, 2879.0)] {
                let on_screen = screen.lower_left_m
                    + screen.right * (px / 5120.0 * 4.0)
                    + screen.up * ((1.0 - py / 2880.0) * 2.25);
                let [x, y] = project(block, room() * on_screen * 1000.0);
                assert!(
                    (x - px).abs() < 1e-2 && (y - py).abs() < 1e-2,
                    "{x} {y} {px} {py}"
                );
            }
        }
    }

    #[test]
    fn blocks_depend_on_the_canvas_and_not_on_what_is_wanted_of_it() {
        let screen = screen();
        let whole = screen.blocks(
            PixelRect {
                x: 0,
                y: 0,
                width: 5120,
                height: 2880,
            },
            room(),
        );
        let part = screen.blocks(
            PixelRect {
                x: 2100,
                y: 700,
                width: 640,
                height: 360,
            },
            room(),
        );
        assert_eq!(part.len(), 1);
        let twin = whole
            .iter()
            .find(|block| block.area == part[0].area)
            .unwrap();
        assert_eq!(part[0].clip_from_relative, twin.clip_from_relative);
        assert_eq!(part[0].ray, twin.ray);
        assert_eq!(
            part[0].wanted,
            PixelRect {
                x: 52,
                y: 700,
                width: 640,
                height: 360
            }
        );
    }

    #[test]
    fn rays_and_transform_agree() {
        let block = &screen().blocks(
            PixelRect {
                x: 0,
                y: 0,
                width: 16,
                height: 16,
            },
            room(),
        )[0];
        let [corner, right, down] = block.ray.map(Vec3::as_dvec3);
        let [x, y] = project(block, (corner + right * 300.0 + down * 200.0) * 500.0);
        assert!(
            (x - 300.0).abs() < 1e-2 && (y - 200.0).abs() < 1e-2,
            "{x} {y}"
        );
    }

    #[test]
    fn a_planet_fills_a_block_only_without_a_gap_at_any_corner() {
        let whole = PixelRect {
            x: 0,
            y: 0,
            width: 2048,
            height: 2048,
        };
        let block = &screen().blocks(whole, DMat3::IDENTITY)[0];
        let unit = DVec3::splat(1000.0);
        // The screen is seen along −z.
        assert!(block.is_filled_by(unit, DVec3::new(0.0, 0.0, 1010.0)));
        assert!(
            !block.is_filled_by(unit, DVec3::new(0.0, 0.0, 9000.0)),
            "too small"
        );
        assert!(
            !block.is_filled_by(unit, DVec3::new(0.0, 0.0, -1010.0)),
            "behind"
        );
        assert!(
            !block.is_filled_by(unit, DVec3::new(0.0, 0.0, 500.0)),
            "inside"
        );
    }

    #[test]
    fn depth_is_reversed_and_infinite() {
        let block = &screen().blocks(
            PixelRect {
                x: 0,
                y: 0,
                width: 16,
                height: 16,
            },
            room(),
        )[0];
        let middle = block.corner_directions[0].normalize();
        let depth = |metres: f64| {
            let clip = block.clip_from_relative.as_dmat4() * (middle * metres).extend(1.0);
            clip.z / clip.w
        };
        assert!(depth(10.0) > depth(1e8) && depth(1e8) > 0.0);
    }
}
