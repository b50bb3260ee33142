//! How bright each pixel of a channel is to be: ramps towards neighbours, and the black level beside them.
//! In: a channel's blending. Out: a map of light, or nothing where all stays as it is.

use calibration::{Map, Region};
use protocol::wall::Blend;
use render::{LightMap, Uplift};

/// The light of a channel of `size_px` pixels. `None` where blending changes nothing.
pub(super) fn ramps(blend: &Blend, size_px: [u32; 2]) -> Option<LightMap> {
    if blend.is_plain() {
        return None;
    }
    let [width, height] = size_px;
    let [left, right, top, bottom] = blend.ramps_px;
    let columns = line(width, left, right, blend.gamma);
    let rows = line(height, top, bottom, blend.gamma);
    // As many projectors as light a pixel bring their black to it. All are raised to the most there are.
    let sides = |first: u32, last: u32| if first.max(last) > 0 { 2.0 } else { 1.0 };
    let most: f64 = sides(left, right) * sides(top, bottom);
    let mut alpha = Vec::with_capacity(columns.len() * rows.len());
    let mut beta = Vec::with_capacity(columns.len() * rows.len());
    for (row, in_row) in &rows {
        for (column, in_column) in &columns {
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

/// The share of light along a side, pixel by pixel, and whether a pixel is within a ramp.
fn line(length: u32, first: u32, last: u32, gamma: f64) -> Vec<(f64, bool)> {
    let at = |from_edge: u32, ramp: u32| {
        if from_edge < ramp {
            curve((f64::from(from_edge) + 0.5) / f64::from(ramp), gamma)
        } else {
            1.0
        }
    };
    (0..length)
        .map(|pixel| {
            let rest = length - 1 - pixel;
            let share = at(pixel, first) * at(rest, last);
            (share, pixel < first || rest < last)
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
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    #[test]
    fn two_projectors_add_up_to_one_over_their_overlap() {
        for gamma in [0.3, 1.0, 2.0, 4.5] {
            let blend = |ramps_px| Blend {
                ramps_px,
                gamma,
                black_level: 0.02,
            };
            let left = ramps(&blend([0, 40, 0, 0]), [100, 3]).unwrap();
            let right = ramps(&blend([40, 0, 0, 0]), [100, 3]).unwrap();
            for column in 0..160_usize {
                let of = |map: &LightMap, first: usize| {
                    let own = column.checked_sub(first).filter(|own| *own < 100)?;
                    Some((map.alpha[100 + own][1], map.beta[100 + own][1]))
                };
                let parts = [of(&left, 0), of(&right, 60)];
                let light: f32 = parts.iter().flatten().map(|(alpha, _)| alpha).sum();
                assert!((light - 1.0).abs() < 1e-6, "{column}: {light}");
                // Each projector's own black, and what is added to it.
                let black: f32 = parts.iter().flatten().map(|(_, beta)| 0.02 + beta).sum();
                assert!((black - 0.04).abs() < 1e-6, "{column}: {black}");
            }
        }
    }

    #[test]
    fn where_four_meet_all_blacks_are_alike() {
        let blend = Blend {
            ramps_px: [0, 10, 0, 10],
            gamma: 1.0,
            black_level: 0.01,
        };
        let map = ramps(&blend, [30, 30]).unwrap();
        let black =
            |x: usize, y: usize, projectors: f32| projectors * (0.01 + map.beta[30 * y + x][0]);
        for (x, y, projectors) in [(5, 5, 1.0), (25, 5, 2.0), (5, 25, 2.0), (25, 25, 4.0)] {
            assert!((black(x, y, projectors) - 0.04).abs() < 1e-6, "{x} {y}");
        }
        assert!(ramps(&Blend::default(), [30, 30]).is_none());
    }
}
