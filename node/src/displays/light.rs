//! How bright each pixel of a channel is to be: ramps towards neighbours, and the black level beside them.
//! In: a channel's blending, its screen. Out: a map of light, or nothing where all stays as it is.

use calibration::{Map, Region};
use glam::DVec3;
use protocol::wall::{Blend, Channel, CylinderCanvas, Screen, ScreenShape};
use render::{LightMap, Uplift};

/// From a place in a channel, in pixels from its upper left corner, to how far to the right that is in the screen's own
/// measure. `None` where the channel lights nothing.
type Across<'a> = dyn Fn(f64, f64) -> Option<f64> + 'a;

/// The light of a channel by what the wall says of its blending. `None` where that changes nothing.
pub(super) fn of_channel(screen: &Screen, channel: &Channel) -> Option<LightMap> {
    match azimuths(screen, channel) {
        None => ramps(&channel.blend, channel.size_px, None),
        Some(across) => ramps(&channel.blend, channel.size_px, Some(&across)),
    }
}

/// Angles about a cylinder's axis, in radians from the middle of a channel. Columns of a picture that is aligned on a
/// chord plane are not equally wide on the cylinder, and those of its neighbour, which lies the other way round, are wide
/// where its own are narrow: what is even in pixels would add up to more or less than one. What is even in angles adds up.
/// `None` where columns are equally wide, or a calibration says where they are.
fn azimuths<'a>(
    screen: &'a Screen,
    channel: &'a Channel,
) -> Option<impl Fn(f64, f64) -> Option<f64> + use<'a>> {
    let ScreenShape::Cylinder {
        foot_m,
        axis,
        canvas: CylinderCanvas::Chord { .. },
        ..
    } = &screen.shape
    else {
        return None;
    };
    if channel.calibration.is_some() {
        return None;
    }
    let shape = screen.shape.smooth()?;
    let foot_m = DVec3::from(*foot_m);
    let axis = DVec3::from(*axis).try_normalize()?;
    let canvas_px = channel.canvas_px;
    let size_px = screen.size_px.map(f64::from);
    let from_axis = move |x_px: f64, y_px: f64| {
        let point_m = shape.point_m(
            (f64::from(canvas_px.x) + x_px) / size_px[0],
            (f64::from(canvas_px.y) + y_px) / size_px[1],
        )?;
        let from_foot = point_m - foot_m;
        Some(from_foot - axis * from_foot.dot(axis))
    };
    let [width, height] = channel.size_px.map(f64::from);
    let middle = from_axis(0.5 * width, 0.5 * height)?;
    // A chord plane is seen from within the cylinder, so a channel spans less than half a turn to either side. Seen from
    // inside, angles rise to the right where they fall about an axis that points up.
    Some(move |x_px: f64, y_px: f64| {
        let here = from_axis(x_px, y_px)?;
        Some(here.cross(middle).dot(axis).atan2(here.dot(middle)))
    })
}

/// The light of a channel of `size_px` pixels. `None` where blending changes nothing. Ramps from side to side are even in
/// what `across` measures, or in pixels without it.
fn ramps(blend: &Blend, size_px: [u32; 2], across: Option<&Across<'_>>) -> Option<LightMap> {
    if blend.is_plain() {
        return None;
    }
    let [width, height] = size_px;
    let [left, right, top, bottom] = blend.ramps_px;
    let pixels = |place: f64| Some(place);
    let even_columns = line(width, [left, right], blend.gamma, &pixels);
    let rows = line(height, [top, bottom], blend.gamma, &pixels);
    // As many projectors as light a pixel bring their black to it. All are raised to the most there are.
    let sides = |first: u32, last: u32| if first.max(last) > 0 { 2.0 } else { 1.0 };
    let most: f64 = sides(left, right) * sides(top, bottom);
    let mut alpha = Vec::with_capacity(even_columns.len() * rows.len());
    let mut beta = Vec::with_capacity(even_columns.len() * rows.len());
    for ((row, in_row), y) in rows.iter().zip(0_u32..) {
        let measured = across.map(|across| {
            let in_this_row = |x: f64| across(x, f64::from(y) + 0.5);
            line(width, [left, right], blend.gamma, &in_this_row)
        });
        for (column, in_column) in measured.as_ref().unwrap_or(&even_columns) {
            alpha.push([(row * column) as f32; 3]);
            let here = if *in_row { 2.0 } else { 1.0 } * if *in_column { 2.0 } else { 1.0 };
            beta.push([(blend.black_level * (most / here - 1.0)).min(1.0) as f32; 3]);
        }
    }
    if blend.black_level <= 0.0 {
        beta.clear();
    }
    Some(LightMap {
        size_px,
        alpha,
        beta,
        uplift: Uplift::default(),
    })
}

/// The light of a channel that has a calibration: its maps, and ramps besides. A black level of the file takes the place
/// of the ramps' own. `None` where all stays as it is.
pub(super) fn calibrated(
    region: &Region,
    size_px: [u32; 2],
    ramps: Option<LightMap>,
) -> Option<LightMap> {
    if region.alpha.is_none() && region.beta.is_none() {
        return ramps;
    }
    let mut light = ramps.unwrap_or_else(|| LightMap {
        size_px,
        alpha: vec![[1.0; 3]; size_px[0] as usize * size_px[1] as usize],
        beta: Vec::new(),
        uplift: Uplift::default(),
    });
    if let Some(map) = &region.alpha {
        let own = values(map, region.gamma.alpha, size_px);
        for (alpha, own) in light.alpha.iter_mut().zip(own) {
            *alpha = std::array::from_fn(|component| alpha[component] * own[component]);
        }
    }
    if let Some(map) = &region.beta {
        light.beta = values(map, region.gamma.beta, size_px).collect();
        light.uplift = Uplift {
            dark: region.uplift.dark,
            bright: region.uplift.bright,
        };
    }
    Some(light)
}

/// A map's light at the pixels of a channel.
fn values(map: &Map, gamma: f32, [width, height]: [u32; 2]) -> impl Iterator<Item = [f32; 3]> {
    let share = |pixel: u32, of: u32| (f64::from(pixel) + 0.5) / f64::from(of);
    (0..height).flat_map(move |y| {
        (0..width).map(move |x| {
            let value = map.sample(share(x, width), share(y, height));
            value.unwrap_or([0.0; 3]).map(|value| value.powf(gamma))
        })
    })
}

/// The share of light along a side, pixel by pixel, and whether a pixel is within a ramp. `measure` tells how far along
/// the side a place in pixels is; ramps are even in it.
fn line(
    length: u32,
    [first, last]: [u32; 2],
    gamma: f64,
    measure: &dyn Fn(f64) -> Option<f64>,
) -> Vec<(f64, bool)> {
    let end = f64::from(length);
    // The edge of the channel and the inner end of the ramp, for each of both ramps.
    let spans = [
        [0.0, f64::from(first)],
        [end, f64::from(length.saturating_sub(last))],
    ]
    .map(|[edge, inner]| Some([measure(edge)?, measure(inner)?]));
    let share = |pixel: u32, span: Option<[f64; 2]>| {
        let [edge, inner] = span?;
        let here = measure(f64::from(pixel) + 0.5)?;
        Some(curve(
            ((here - edge) / (inner - edge)).clamp(0.0, 1.0),
            gamma,
        ))
    };
    (0..length)
        .map(|pixel| {
            let is_within = [pixel < first, length - 1 - pixel < last];
            let factors = is_within
                .iter()
                .zip(spans)
                .filter(|(is_within, _)| **is_within);
            // What lights nothing gives no light.
            let light: f64 = factors
                .map(|(_, span)| share(pixel, span).unwrap_or(0.0))
                .product();
            (light, is_within.contains(&true))
        })
        .collect()
}

/// From 0 to 1, such that what one projector gives up another adds: curve(t) + curve(1 − t) = 1 (P. Bourke, "Edge
/// blending using commodity projectors", 2004).
fn curve(t: f64, gamma: f64) -> f64 {
    if t < 0.5 {
        0.5 * (2.0 * t).powf(gamma)
    } else {
        1.0 - 0.5 * (2.0 * (1.0 - t)).powf(gamma)
    }
}

#[cfg(test)]
mod tests;
