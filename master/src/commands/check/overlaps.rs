//! What several outputs show together of one canvas: overlaps without ramps, ramps of another width.
//!
//! In: a wall. Out: its channels by screen, and sentences. Channels with a calibration bring ramps of their own and are
//! left out.

use protocol::Wall;
use protocol::wall::{Channel, Eye, Output, Rect, Stereo};

/// How much a ramp may be wider or narrower than the overlap, in pixels.
const TOLERANCE_PX: u32 = 5;
/// Edges of a channel as `Blend::ramps_px` has them.
pub(super) const EDGES: [&str; 4] = ["left", "right", "top", "bottom"];

/// A channel, and who shows it.
#[derive(Clone, Copy)]
pub(super) struct Shown<'a> {
    host: &'a str,
    output: &'a Output,
    pub(super) channel: &'a Channel,
}

impl Shown<'_> {
    pub(super) fn name(&self) -> String {
        format!("output \"{}\" of host \"{}\"", self.output.name, self.host)
    }

    fn shows(&self, eye: Eye) -> bool {
        match self.output.stereo {
            Stereo::Off => self.channel.eye == eye,
            _ => eye != Eye::Centre,
        }
    }

    pub(super) fn shares_eye(&self, other: &Self) -> bool {
        [Eye::Centre, Eye::Left, Eye::Right]
            .into_iter()
            .any(|eye| self.shows(eye) && other.shows(eye))
    }

    pub(super) fn ramp(&self, edge: usize) -> u32 {
        self.channel.blend.ramps_px.get(edge).copied().unwrap_or(0)
    }
}

/// The channels of each screen that no calibration puts in place, from left to right.
pub(super) fn by_screen(wall: &Wall) -> Vec<Vec<Shown<'_>>> {
    let mut by_screen: Vec<Vec<Shown<'_>>> = vec![Vec::new(); wall.screens.len()];
    for host in &wall.hosts {
        for output in &host.outputs {
            let plain = output
                .channels
                .iter()
                .filter(|channel| channel.calibration.is_none());
            for channel in plain {
                if let Some(shown) = by_screen.get_mut(channel.screen) {
                    shown.push(Shown {
                        host: &host.name,
                        output,
                        channel,
                    });
                }
            }
        }
    }
    for shown in &mut by_screen {
        shown.sort_by_key(|shown| shown.channel.canvas_px.x);
    }
    by_screen
}

pub(super) fn warn(wall: &Wall, by_screen: &[Vec<Shown<'_>>], warnings: &mut Vec<String>) {
    for (shown, screen) in by_screen.iter().zip(&wall.screens) {
        for (index, first) in shown.iter().enumerate() {
            let rect = first.channel.canvas_px;
            let within = shown.iter().skip(index + 1);
            within
                .take_while(|second| second.channel.canvas_px.x < rect.right())
                .filter(|second| second.channel.canvas_px.overlaps(&rect))
                .filter(|second| first.shares_eye(second))
                .for_each(|second| pair(&screen.name, first, second, warnings));
        }
    }
}

/// What two rectangles share.
fn intersection(a: &Rect, b: &Rect) -> Rect {
    let (x, y) = (a.x.max(b.x), a.y.max(b.y));
    Rect {
        x,
        y,
        width: a.right().min(b.right()).saturating_sub(x),
        height: a.bottom().min(b.bottom()).saturating_sub(y),
    }
}

/// Two channels that show the same pixels to the same eye.
fn pair(screen: &str, first: &Shown<'_>, second: &Shown<'_>, warnings: &mut Vec<String>) {
    let (a, b) = (first.channel.canvas_px, second.channel.canvas_px);
    let both = intersection(&a, &b);
    // Who is left of or above whom: not if one reaches farther to both sides.
    let shift = |from_a: u32, to_a: u32, from_b: u32, to_b: u32| {
        if from_a < from_b && to_a < to_b {
            Some([first, second])
        } else if from_b < from_a && to_b < to_a {
            Some([second, first])
        } else {
            None
        }
    };
    let across = shift(a.x, a.right(), b.x, b.right()).map(|order| (order, [1, 0], both.width));
    let down = shift(a.y, a.bottom(), b.y, b.bottom()).map(|order| (order, [3, 2], both.height));
    let pixels = u64::from(both.width) * u64::from(both.height);
    let same = format!(
        "{} and {} show the same {pixels} pixels of screen \"{screen}\" to the same eye",
        first.name(),
        second.name()
    );
    let shifts: Vec<_> = [across, down].into_iter().flatten().collect();
    let ([before, after], [end, start], overlap_px) = match shifts.as_slice() {
        [] => {
            warnings.push(format!(
                "{same}, one over the other, so that no ramp can blend them; make their canvas_px meet, or give them different eyes"
            ));
            return;
        }
        [one] => *one,
        // At the corner of four the ramps of either direction do.
        both_ways => {
            let ramps = both_ways
                .iter()
                .flat_map(|([before, after], edges, _)| [(before, edges[0]), (after, edges[1])]);
            let has_ramp = |shown: &Shown<'_>| {
                ramps
                    .clone()
                    .any(|(of, edge)| std::ptr::eq(of.channel, shown.channel) && of.ramp(edge) > 0)
            };
            if !(has_ramp(first) && has_ramp(second)) {
                warnings.push(format!(
                    "{same} without blend ramps there, so that it is too bright; write blend_px for both, or make their canvas_px meet"
                ));
            }
            return;
        }
    };
    let ramps = [(before, end), (after, start)];
    match ramps.map(|(shown, edge)| shown.ramp(edge) > 0) {
        [false, false] => warnings.push(format!(
            "{same} without blend ramps there, so that it is too bright; write blend_px = {{ {} = {overlap_px} }} and {{ {} = {overlap_px} }}, or make their canvas_px meet",
            EDGES[end], EDGES[start]
        )),
        [true, true] => {
            for (shown, edge) in ramps {
                let ramp_px = shown.ramp(edge);
                if ramp_px.abs_diff(overlap_px) > TOLERANCE_PX {
                    warnings.push(format!(
                        "the {} ramp of {} is {ramp_px} pixels wide, but {overlap_px} pixels of screen \"{screen}\" overlap there; write blend_px = {{ {} = {overlap_px} }}",
                        EDGES[edge],
                        shown.name(),
                        EDGES[edge]
                    ));
                }
            }
        }
        [has, _] => {
            let (shown, edge) = if has { ramps[1] } else { ramps[0] };
            warnings.push(format!(
                "{same}, but {} has no ramp there; write blend_px = {{ {} = {overlap_px} }}",
                shown.name(),
                EDGES[edge]
            ));
        }
    }
}
