//! Walls and scenes that benches need and nobody has to write: a row of headless nodes, a bare Earth.
//!
//! In: how many nodes, how large. Out: texts of a wall and of a scene file.

use std::fmt::Write as _;

/// A bare Earth that turns under the viewer: nothing to load, something to draw.
pub(crate) const SCENE: &str = "\
layers = {}

[camera]
mode = \"orbit\"
place = { latitude_deg = 20.0, longitude_deg = 10.0, altitude_m = 12e6, pitch_deg = -90.0 }
centre = { latitude_deg = 90.0, longitude_deg = 0.0 }
degrees_per_second = 10.0
";

/// A wall of `nodes` headless hosts `node0`, `node1`… side by side on one screen.
pub(crate) fn wall_text(nodes: u32, [width, height]: [u32; 2], fps: f64) -> String {
    const PITCH_M: f64 = 0.004;
    let half_m = f64::from(nodes * width) * PITCH_M / 2.0;
    let top_m = 1.0 + f64::from(height) * PITCH_M;
    let mut text = format!(
        "[wall]\nname = \"bench\"\nfps = {fps:?}\n\n\
         [[observers]]\nname = \"viewer\"\nhead_m = [0.0, 1.5, {:?}]\n\n\
         [[screens]]\nname = \"front\"\nkind = \"planar\"\nobserver = \"viewer\"\nsize_px = [{}, {height}]\n\
         corners_m = {{ bottom_left = [{:?}, 1.0, 0.0], bottom_right = [{half_m:?}, 1.0, 0.0], \
         top_left = [{:?}, {top_m:?}, 0.0] }}\n",
        2.0 * half_m,
        nodes * width,
        -half_m,
        -half_m
    );
    for node in 0..nodes {
        let _ = write!(
            text,
            "\n[[hosts]]\nname = \"node{node}\"\n[[hosts.outputs]]\nname = \"out\"\nsize_px = [{width}, {height}]\n\
             headless = true\nchannels = [{{ screen = \"front\", canvas_px = [{}, 0, {width}, {height}] }}]\n",
            node * width
        );
    }
    text
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    #[test]
    fn the_texts_are_valid() {
        for nodes in [1, 8, 150] {
            let wall = protocol::Wall::parse(&wall_text(nodes, [96, 54], 60.0), "bench").unwrap();
            assert_eq!(wall.hosts.len(), nodes as usize);
        }
        protocol::Scene::parse(SCENE, "bench").unwrap();
    }
}
