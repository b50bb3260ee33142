//! Where the pixels of a wall are: screens as seen from a head, pixel density, and which output shows
//! which part of a canvas. In: a validated wall, heads in room metres. Out: room vectors and rectangles.
//! For planar screens only the four basic operations and square roots, so that all machines compute the same bits.

use glam::DVec3;
use screens::Shape;

use super::{
    Channel, CylinderCanvas, Eye, Head, Output, PlanarCorners, Rect, Screen, ScreenShape,
    SphereCanvas, Stereo, Wall,
};

/// A screen as seen from a head: what an off-axis frustum is made of. All vectors in room axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeToScreen {
    /// From the head to the lower left corner of the canvas, in metres.
    pub lower_left_m: [f64; 3],
    /// Unit vector along the lower edge.
    pub right: [f64; 3],
    /// Unit vector along the left edge, at right angles to `right`.
    pub up: [f64; 3],
    /// Unit normal of the screen, on the viewer's side.
    pub back: [f64; 3],
    /// Width of the canvas in metres.
    pub width_m: f64,
    /// Height of the canvas in metres.
    pub height_m: f64,
    /// From the head to the screen's plane in metres, > 0.
    pub distance_m: f64,
}

/// How many pixels there are to a radian of view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelDensity {
    /// The fewest on the canvas's plane: at the foot of the perpendicular from the head.
    pub sparsest: f64,
    /// The most on the canvas: at the corner farthest from that foot, in radial direction.
    pub densest: f64,
}

/// A piece of a canvas and the place in an output where it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanvasPiece {
    /// Index into [`Wall::screens`].
    pub screen: usize,
    /// Index into [`Wall::hosts`].
    pub host: usize,
    /// Index into that host's outputs.
    pub output: usize,
    /// The part of the canvas.
    pub canvas_px: Rect,
    /// Upper left corner of the piece in the output's picture.
    pub output_px: [u32; 2],
}

impl EyeToScreen {
    /// From the head to a point of the canvas in metres. `x_px`, `y_px` count from the upper left corner
    /// of the canvas; the middle of its first pixel is (0.5, 0.5).
    #[must_use]
    pub fn to_canvas_m(&self, size_px: [u32; 2], x_px: f64, y_px: f64) -> [f64; 3] {
        let x_m = x_px / f64::from(size_px[0]) * self.width_m;
        let y_m = (1.0 - y_px / f64::from(size_px[1])) * self.height_m;
        let corner = DVec3::from(self.lower_left_m);
        (corner + DVec3::from(self.right) * x_m + DVec3::from(self.up) * y_m).to_array()
    }
}

impl PlanarCorners {
    /// The screen from an eye in room metres. `None` for an eye on or behind the screen's plane, which
    /// a tracker can report: such an eye sees no picture.
    #[must_use]
    pub fn eye_to_screen(&self, eye_m: [f64; 3]) -> Option<EyeToScreen> {
        let bottom_left = DVec3::from(self.bottom_left);
        let along_width = DVec3::from(self.bottom_right) - bottom_left;
        let along_height = DVec3::from(self.top_left) - bottom_left;
        let (width_m, height_m) = (along_width.length(), along_height.length());
        let right = along_width / width_m;
        // The corners may be off a rectangle by a millimetre; the frustum must not be.
        let back = right.cross(along_height / height_m).normalize();
        let up = back.cross(right);
        let lower_left = bottom_left - DVec3::from(eye_m);
        let distance_m = -lower_left.dot(back);
        (distance_m > 0.0 && distance_m.is_finite()).then(|| EyeToScreen {
            lower_left_m: lower_left.to_array(),
            right: right.to_array(),
            up: up.to_array(),
            back: back.to_array(),
            width_m,
            height_m,
            distance_m,
        })
    }

    /// As `screens` knows it.
    #[must_use]
    pub fn surface(&self) -> screens::Planar {
        screens::Planar {
            bottom_left_m: DVec3::from(self.bottom_left),
            bottom_right_m: DVec3::from(self.bottom_right),
            top_left_m: DVec3::from(self.top_left),
        }
    }
}

impl ScreenShape {
    /// The corners of a planar screen.
    #[must_use]
    pub fn planar(&self) -> Option<&PlanarCorners> {
        match self {
            Self::Planar(corners) => Some(corners),
            _ => None,
        }
    }

    /// The surface, unless a file says what it is.
    #[must_use]
    pub fn smooth(&self) -> Option<Shape> {
        Some(match self {
            Self::Planar(corners) => Shape::Planar(corners.surface()),
            Self::Cylinder {
                foot_m,
                axis,
                radius_m,
                canvas,
            } => Shape::Cylinder(screens::Cylinder {
                foot_m: DVec3::from(*foot_m),
                axis: DVec3::from(*axis),
                radius_m: *radius_m,
                mapping: match canvas {
                    CylinderCanvas::Arc {
                        azimuth_deg,
                        height_m,
                    } => screens::CylinderMapping::Arc {
                        azimuth_deg: *azimuth_deg,
                        height_m: *height_m,
                    },
                    CylinderCanvas::Chord {
                        corners_m,
                        aligned_from_m,
                    } => screens::CylinderMapping::Chord {
                        corners: corners_m.surface(),
                        aligned_from_m: DVec3::from(*aligned_from_m),
                    },
                },
            }),
            Self::Sphere {
                centre_m,
                radius_m,
                tilt_deg,
                canvas,
            } => Shape::Sphere(screens::Sphere {
                centre_m: DVec3::from(*centre_m),
                radius_m: *radius_m,
                tilt_deg: *tilt_deg,
                mapping: match canvas {
                    SphereCanvas::Fisheye { field_deg } => screens::SphereMapping::Fisheye {
                        field_deg: *field_deg,
                    },
                    SphereCanvas::Grid {
                        azimuth_deg,
                        elevation_deg,
                    } => screens::SphereMapping::Grid {
                        azimuth_deg: *azimuth_deg,
                        elevation_deg: *elevation_deg,
                    },
                },
            }),
            Self::Surface { .. } => return None,
        })
    }
}

impl Screen {
    /// A planar screen from an eye. `None` for other screens, and for an eye on or behind the plane.
    #[must_use]
    pub fn eye_to_screen(&self, eye_m: [f64; 3]) -> Option<EyeToScreen> {
        self.shape.planar()?.eye_to_screen(eye_m)
    }

    /// Pixels per radian of view from an eye. At distance ρ from the foot of the perpendicular of
    /// length d, a radian covers (d² + ρ²)/d metres of a plane in radial direction and √(d² + ρ²) across: least at
    /// the foot, and convex, so most at a corner. `None` for an eye that does not see the screen, and where a file says
    /// what the screen is.
    #[must_use]
    pub fn pixels_per_radian(&self, eye_m: [f64; 3]) -> Option<PixelDensity> {
        if self.shape.planar().is_none() {
            return of_surface(&self.shape.smooth()?, self.size_px, eye_m);
        }
        let seen = self.eye_to_screen(eye_m)?;
        let [width, height] = self.size_px.map(f64::from);
        let (across, along) = (width / seen.width_m, height / seen.height_m);
        let d = seen.distance_m;
        let farthest_squared = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]
            .map(|(x, y)| DVec3::from(seen.to_canvas_m(self.size_px, x, y)).length_squared())
            .into_iter()
            .fold(0.0, f64::max);
        Some(PixelDensity {
            sparsest: across.min(along) * d,
            densest: across.max(along) * farthest_squared / d,
        })
    }
}

pub(super) fn of_surface(
    shape: &Shape,
    size_px: [u32; 2],
    eye_m: [f64; 3],
) -> Option<PixelDensity> {
    screens::pixel_density(shape, size_px, DVec3::from(eye_m)).map(|density| PixelDensity {
        sparsest: density.sparsest,
        densest: density.densest,
    })
}

/// A screen and an eye that it is drawn for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Sight {
    /// Index into [`Wall::screens`].
    pub screen: usize,
    /// The eye of that screen's observer.
    pub eye: Eye,
}

impl Wall {
    /// Every screen with every eye that some output draws it for, in order.
    #[must_use]
    pub fn sights(&self) -> Vec<Sight> {
        let outputs = self.hosts.iter().flat_map(|host| &host.outputs);
        let mut sights: Vec<Sight> = outputs.flat_map(Output::sights).collect();
        sights.sort_unstable();
        sights.dedup();
        sights
    }

    /// Where the eye of a sight is, in room metres: by its observer's head, resting where `heads` has none.
    #[must_use]
    pub fn eye_m(&self, sight: Sight, heads: &[Head]) -> [f64; 3] {
        let observer = self
            .screens
            .get(sight.screen)
            .and_then(|screen| Some((screen.observer, self.observers.get(screen.observer)?)));
        observer.map_or([0.0; 3], |(index, observer)| {
            heads
                .get(index)
                .copied()
                .unwrap_or_else(|| observer.resting_head())
                .eye_m(sight.eye, observer.eye_separation_m)
        })
    }

    /// The most pixels there are to a radian of view anywhere on the wall, seen from its observers.
    /// An error of one part in this many of a radian is at most one pixel on every channel.
    #[must_use]
    pub fn pixels_per_radian(&self) -> f64 {
        self.pixels_per_radian_from(&self.heads())
    }

    /// As [`Wall::pixels_per_radian`], for tracked heads in the order of the observers. Eyes without a
    /// view of their screen do not count, nor do screens that files describe, and calibrated channels count as
    /// their canvas: see [`super::Surfaces`].
    #[must_use]
    pub fn pixels_per_radian_from(&self, heads: &[Head]) -> f64 {
        let density = |sight: Sight| {
            let eye_m = self.eye_m(sight, heads);
            let screen = self.screens.get(sight.screen)?;
            Some(screen.pixels_per_radian(eye_m)?.densest)
        };
        let sights = self.sights().into_iter();
        sights.filter_map(density).fold(0.0, f64::max)
    }

    /// Where each piece of each canvas is shown: what composes the outputs' pictures into one picture
    /// per screen, of [`Screen::size_px`]. What no piece covers lies behind bezels, or where a calibration says.
    #[must_use]
    pub fn canvas_layout(&self) -> Vec<CanvasPiece> {
        let mut pieces = Vec::new();
        for (host_index, host) in self.hosts.iter().enumerate() {
            for (output_index, output) in host.outputs.iter().enumerate() {
                let plain = |channel: &&Channel| channel.calibration.is_none();
                pieces.extend(
                    output
                        .channels
                        .iter()
                        .filter(plain)
                        .map(|channel| CanvasPiece {
                            screen: channel.screen,
                            host: host_index,
                            output: output_index,
                            canvas_px: channel.canvas_px,
                            output_px: channel.output_px,
                        }),
                );
            }
        }
        pieces
    }
}

impl Output {
    /// The screens that it shows, and for which eyes.
    pub fn sights(&self) -> impl Iterator<Item = Sight> {
        self.channels
            .iter()
            .flat_map(|channel| self.sights_of(channel))
    }

    /// For which eyes one of its channels shows its screen.
    pub fn sights_of(&self, channel: &Channel) -> impl Iterator<Item = Sight> + use<> {
        let eyes = if self.stereo == Stereo::Off {
            vec![channel.eye]
        } else {
            vec![Eye::Left, Eye::Right]
        };
        let screen = channel.screen;
        eyes.into_iter().map(move |eye| Sight { screen, eye })
    }
}
