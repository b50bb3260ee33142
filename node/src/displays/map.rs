//! Which point of the room each pixel of a channel lights: by the screen's shape, or by a calibration file.
//! In: a channel, its screen. Out: maps for the renderer and for choosing views; nothing where pixels lie on a plane as
//! they do on its canvas.

use std::path::Path;
use std::sync::Arc;

use calibration::{Frustum, Mapping, ObjMeaning, Options, Placement, PointOrigin, Region};
use glam::{DMat3, DVec3};
use protocol::Wall;
use protocol::wall::{Calibration, Channel, Screen, ScreenShape, Surfaces};
use render::{LightMap, WarpMap};
use screens::{Points, PointsAt, SampledMap, Shape};

use super::light;

/// The maps of a channel that is warped.
pub(super) type Mapped = (Arc<WarpMap>, Arc<SampledMap>);

/// From pixels of a channel, the middle of the first one at (0.5, 0.5), to room points.
type PointOf<'a> = dyn Fn(f64, f64) -> Option<DVec3> + 'a;

/// Columns and rows of a surface that a mesh describes: a cell of it is then smaller than what meshes describe.
const SURFACE_SIDE: u32 = 1024;
/// How far the shape of a calibrated picture may be off its channel's.
const ASPECT_TOLERANCE: f64 = 0.01;

/// Reads the points of a screen's file.
pub(super) fn surface(file: &str, unit_m: f64) -> Result<Points, String> {
    let options = Options {
        obj: ObjMeaning::Surface,
        size_px: is_mesh(file).then_some([SURFACE_SIDE; 2]),
        unit_m: unit_m as f32,
        ..Options::default()
    };
    let read = calibration::load(Path::new(file), &options).map_err(|error| error.to_string())?;
    let Some(Mapping::Points { points_m, .. }) = read.regions.into_iter().next().map(|r| r.mapping)
    else {
        return Err(format!(
            "{file}: there are no points of a screen in it; give an OBJ with texture coordinates, or a PFM of points"
        ));
    };
    let at = match points_m.placement {
        Placement::Centres => PointsAt::CellCentres,
        Placement::Corners => PointsAt::Corners,
    };
    Points::new(points_m.width, points_m.height, points_m.values, at)
        .map_err(|error| format!("{file}: {error}"))
}

/// Whether a file's size in pixels must be told to its reader.
fn is_mesh(file: &str) -> bool {
    let extension = Path::new(file).extension();
    extension.is_some_and(|extension| extension.eq_ignore_ascii_case("obj"))
}

/// What a channel's pixels show and how bright they are. `ramps` is what its blending says.
pub(super) fn of_channel(
    wall: &Wall,
    screen: &Screen,
    channel: &Channel,
    surfaces: &Surfaces,
    ramps: Option<LightMap>,
) -> Result<(Option<Arc<LightMap>>, Option<Mapped>), String> {
    let shape = shape_of(screen, channel, surfaces)?;
    let Some(named) = &channel.calibration else {
        let light = ramps.map(Arc::new);
        if matches!(screen.shape, ScreenShape::Planar(_)) {
            return Ok((light, None));
        }
        let rect = channel.canvas_px;
        let rect = [rect.x, rect.y, rect.width, rect.height];
        let point_of = shape.channel_map(screen.size_px, rect);
        return Ok((light, Some(mapped(channel.size_px, &point_of)?)));
    };
    let region = region_of(named, channel.size_px)?;
    let refuse = |reason: String| format!("{}: {reason}", named.file);
    let calibrated = Calibrated::new(wall, screen, channel, shape, &region);
    let point_of = calibrated.point_of().map_err(refuse)?;
    let light = light::calibrated(&region, channel.size_px, ramps).map(Arc::new);
    let mapped = mapped(channel.size_px, &*point_of).map_err(refuse)?;
    Ok((light, Some(mapped)))
}

/// Where the pixels of a channel fall by the calibration file that it names.
pub(super) fn of_calibrated(
    wall: &Wall,
    screen: &Screen,
    channel: &Channel,
    named: &Calibration,
    surfaces: &Surfaces,
) -> Result<Arc<SampledMap>, String> {
    let shape = shape_of(screen, channel, surfaces)?;
    let region = region_of(named, channel.size_px)?;
    let calibrated = Calibrated::new(wall, screen, channel, shape, &region);
    calibrated
        .point_of()
        .and_then(|point_of| sampled(channel.size_px, &*point_of))
        .map_err(|reason| format!("{}: {reason}", named.file))
}

fn shape_of<'s>(
    screen: &Screen,
    channel: &Channel,
    surfaces: &'s Surfaces,
) -> Result<&'s Shape, String> {
    let shape = surfaces.shape(channel.screen);
    shape.ok_or_else(|| format!("screen \"{}\" has no surface", screen.name))
}

/// The region of a calibration file that a channel names. Its picture must have the channel's shape; it may have
/// another size, because maps are read between their samples.
fn region_of(named: &Calibration, size_px: [u32; 2]) -> Result<Region, String> {
    let options = Options {
        region: named.region.clone().map(calibration::Choice::Name),
        size_px: Some(size_px),
        ..Options::default()
    };
    let read = calibration::load(Path::new(&named.file), &options);
    let mut read = read.map_err(|error| error.to_string())?;
    if read.regions.len() > 1 {
        let names: Vec<&str> = read
            .regions
            .iter()
            .map(|region| region.name.as_str())
            .collect();
        return Err(format!(
            "{}: it has {} regions; write one of them as calibration.region: {}",
            named.file,
            names.len(),
            names.join(", ")
        ));
    }
    let region = read
        .regions
        .pop()
        .ok_or_else(|| format!("{}: there is no region in it", named.file))?;
    for note in &read.notes {
        tracing::warn!(
            file = named.file,
            note,
            "a calibration is not wholly understood"
        );
    }
    let aspect = |[width, height]: [u32; 2]| f64::from(width) / f64::from(height);
    let off = aspect(region.size_px) / aspect(size_px) - 1.0;
    if off.abs() > ASPECT_TOLERANCE {
        return Err(format!(
            "{}: region \"{}\" is made for {}×{} pixels, but its channel has {}×{}; write size_px = [{}, {}] for the channel",
            named.file,
            region.name,
            region.size_px[0],
            region.size_px[1],
            size_px[0],
            size_px[1],
            region.size_px[0],
            region.size_px[1]
        ));
    }
    Ok(region)
}

/// A channel with its calibration.
struct Calibrated<'a> {
    screen: &'a Screen,
    channel: &'a Channel,
    shape: &'a Shape,
    /// The head for which the wall was made.
    head_m: DVec3,
    region: &'a Region,
}

impl<'a> Calibrated<'a> {
    fn new(
        wall: &Wall,
        screen: &'a Screen,
        channel: &'a Channel,
        shape: &'a Shape,
        region: &'a Region,
    ) -> Self {
        let observer = wall.observers.get(screen.observer);
        Self {
            screen,
            channel,
            shape,
            head_m: observer.map_or(DVec3::ZERO, |observer| DVec3::from(observer.head_m)),
            region,
        }
    }

    /// From pixels of the channel to room points.
    fn point_of(&self) -> Result<Box<PointOf<'a>>, String> {
        let [width, height] = self.channel.size_px.map(f64::from);
        let region = self.region;
        // The lens of a projector shows a pixel elsewhere in its picture.
        let share = move |x: f64, y: f64| {
            let own = [x / width, y / height];
            match &region.distortion {
                None => Some(own),
                Some(lens) => Some(lens.sample(own[0], own[1])?.map(f64::from)),
            }
        };
        let on_canvas = self.on_canvas();
        Ok(match &region.mapping {
            Mapping::Identity => Box::new(move |x, y| {
                let [u, v] = share(x, y)?;
                on_canvas(u, v)
            }),
            Mapping::Canvas(uv) => Box::new(move |x, y| {
                let [x, y] = share(x, y)?;
                let [u, v] = uv.sample(x, y)?.map(f64::from);
                on_canvas(u, v)
            }),
            Mapping::Frustum { frustum, uv } => {
                let (shape, head_m) = (self.shape, self.head_m);
                let ray = ray_of(frustum);
                Box::new(move |x, y| {
                    let [x, y] = share(x, y)?;
                    let [u, v] = uv.sample(x, y)?.map(f64::from);
                    let [x, y] = shape.locate(head_m, ray(u, v))?;
                    shape.point_m(x, y)
                })
            }
            Mapping::Points {
                points_m, origin, ..
            } => {
                let from_m = match origin {
                    PointOrigin::IdealEyePoint => self.head_m,
                    PointOrigin::FloorCentre | PointOrigin::Unknown => DVec3::ZERO,
                    PointOrigin::CentreOfMass => {
                        return Err(
                            "its points count from the screen's centre of mass, which is nowhere in the room; export them from the eye or from the floor's middle"
                                .to_owned(),
                        );
                    }
                };
                Box::new(move |x, y| {
                    let [x, y] = share(x, y)?;
                    let point = points_m.sample(x, y)?.map(f64::from);
                    Some(from_m + DVec3::from(point))
                })
            }
        })
    }

    /// From shares of the region's picture to room points: the region is a part of what the channel shows of the
    /// canvas, as its file says, or all of it.
    fn on_canvas(&self) -> impl Fn(f64, f64) -> Option<DVec3> + use<'a> {
        let rect = self.channel.canvas_px;
        let [canvas_width, canvas_height] = self.screen.size_px.map(f64::from);
        let place = self.region.canvas.as_ref();
        let part = place.map_or([0.0, 0.0, 1.0, 1.0], |place| {
            [place.x, place.y, place.width, place.height]
        });
        let shape = self.shape;
        move |u, v| {
            if !((0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v)) {
                return None;
            }
            let x_px = f64::from(rect.x) + (part[0] + u * part[2]) * f64::from(rect.width);
            let y_px = f64::from(rect.y) + (part[1] + v * part[3]) * f64::from(rect.height);
            shape.point_m(x_px / canvas_width, y_px / canvas_height)
        }
    }
}

/// The direction in the room of a place in a frustum's picture.
fn ray_of(frustum: &Frustum) -> impl Fn(f64, f64) -> DVec3 + use<> {
    let turned = DMat3::from_rotation_y(-frustum.yaw_deg.to_radians())
        * DMat3::from_rotation_x(frustum.pitch_deg.to_radians())
        * DMat3::from_rotation_z(-frustum.roll_deg.to_radians());
    let edge = |degrees: f64| degrees.to_radians().tan();
    let (left, right) = (edge(frustum.left_deg), edge(frustum.right_deg));
    let (up, down) = (edge(frustum.up_deg), edge(frustum.down_deg));
    move |u, v| turned * DVec3::new(left + (right - left) * u, up + (down - up) * v, -1.0)
}

fn mapped(size_px: [u32; 2], point_of: &PointOf<'_>) -> Result<Mapped, String> {
    let sampled = sampled(size_px, point_of)?;
    let [width, height] = size_px;
    let centre = |pixel: u32| f64::from(pixel) + 0.5;
    let points_m: Vec<[f32; 3]> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| {
            point_of(centre(x), centre(y)).map_or([f32::NAN; 3], |point| point.as_vec3().to_array())
        })
        .collect();
    Ok((Arc::new(WarpMap { size_px, points_m }), sampled))
}

fn sampled(size_px: [u32; 2], point_of: &PointOf<'_>) -> Result<Arc<SampledMap>, String> {
    let [width, height] = size_px;
    let sampled = SampledMap::new(point_of, size_px)
        .ok_or_else(|| format!("a channel of {width}×{height} pixels cannot be warped"))?;
    if sampled.is_empty() {
        return Err("no pixel of the channel lights any point of its screen".to_owned());
    }
    Ok(Arc::new(sampled))
}

#[cfg(test)]
mod tests;
