//! Calibrated channels on a plan: what they light, wherever their canvas is.
//!
//! In: a screen as it is drawn so far, the wall's calibrated channels. Out: the same with what these light. It knows no page.

use glam::DVec3;
use protocol::Wall;
use protocol::wall::Surfaces;

use super::scene::{Calibrated, Cell, Drawn, Part};

/// Cells of density on a side of a channel.
const CELLS: usize = 16;

/// Adds the calibrated channels of a screen. Where nothing else shows it, their densities take the place of its canvas's.
pub(super) fn add(drawn: &mut Drawn<'_>, wall: &Wall, surfaces: &Surfaces) {
    let observer = wall.observers.get(drawn.screen.observer);
    let head_m = observer.map_or(DVec3::NAN, |observer| DVec3::from(observer.head_m));
    for calibrated in surfaces.calibrated() {
        let Some((output, channel)) = calibrated.in_wall(wall) else {
            continue;
        };
        if channel.screen != drawn.index {
            continue;
        }
        if drawn.calibrated.is_empty() && drawn.parts.is_empty() {
            drawn.cells.clear();
        }
        let patches = calibrated.map.patches(head_m, CELLS);
        let middles = patches.iter().map(|patch| patch.middle_m);
        let count = patches.len() as f64;
        let host = wall.hosts.get(calibrated.host);
        let host = host.map_or("", |host| host.name.as_str());
        drawn.parts.push(Part {
            is_whole: false,
            middle_m: (count > 0.0).then(|| middles.sum::<DVec3>() / count),
            outline_m: calibrated.map.outline_m(),
            ramps_m: Vec::new(),
            names: vec![format!("{host}: {}", output.name)],
        });
        drawn.cells.extend(patches.into_iter().map(|patch| Cell {
            corners_m: patch.corners_m,
            density: patch.pixels_per_radian.unwrap_or(f64::NAN),
        }));
        drawn.calibrated.push(Calibrated {
            name: format!("{host}/{}", output.name),
            size_px: channel.size_px,
            density: calibrated.map.density(head_m),
        });
    }
}
