//! Planar views that cover what an eye sees of a channel: the rectangle is halved until each part fits into a cone.
//! In: a sampled map, an eye, limits. Out: parts, each with its view. A pure function of these, without history and by the
//! four basic operations and square roots: every node, and every run, finds the same. It renders nothing.

use glam::DVec3;

use crate::gather::{Extents, Gaze, Glance, Span};
use crate::{PlanarView, SampledMap};

/// Beyond the outermost place that is shown, for bilinear sampling, in pixels of the view.
const MARGIN_PX: f64 = 2.0;
/// Sizes are multiples of this, so that they seldom change with the head.
const QUANTUM_PX: u32 = 16;
/// How much finer views are than samples demand, for what lies between them.
const RESERVE: f64 = 1.01;
/// The cosine of the widest half angle that a view may have at all: 80°.
const WIDEST_COSINE: f64 = 0.173_648_177_666_930_35;
/// Pixels that any view may have, however small its part is.
const ALWAYS_AFFORDABLE_PX: f64 = 65_536.0;
/// Pixels to a radian for a part without slopes or extent: a single pixel, of which any picture will do.
const LONE_PIXEL: f64 = 1024.0;

/// What views may be like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoverLimits {
    /// Directions of a part are within a cone of this half angle, in degrees, drawn into 5…75. Narrower: more views.
    pub half_angle_deg: f64,
    /// The largest side of a view in pixels, drawn into 64…65536 and rounded down to a multiple of 16.
    pub most_px: u32,
    /// The most pixels of a view to a pixel of its part, 1 or more: what an eye sees flatly, or from beside a curved screen,
    /// would ask for views without bound. 65536 pixels are always allowed.
    pub most_growth: f64,
    /// The most parts, 1 or more. Only an eye that is all but on the screen needs more than some twenty.
    pub most_parts: usize,
}

impl Default for CoverLimits {
    /// 40°, 8192 pixels, 16 for each pixel, 32 parts.
    fn default() -> Self {
        Self {
            half_angle_deg: 40.0,
            most_px: 8192,
            most_growth: 16.0,
            most_parts: 32,
        }
    }
}

impl CoverLimits {
    /// Of the half angle. Its last bit may differ between machines, which decides nothing: no part is so exactly as wide.
    fn cosine(&self) -> f64 {
        let half_angle_deg = match self.half_angle_deg {
            wide if wide > 75.0 => 75.0,
            usable if usable >= 5.0 => usable,
            // Too narrow, or not a number.
            _ => 5.0,
        };
        f64::to_radians(half_angle_deg).cos()
    }
}

/// The views that cover a channel for an eye.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cover {
    /// Rectangles that do not overlap, from the top, then from the left. Pixels in none of them show nothing.
    pub parts: Vec<Part>,
}

/// A rectangle of a channel and the view that its pixels are taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// x, y, width, height within the channel's rectangle, y downwards.
    pub rect_px: [u32; 4],
    /// What is rendered for it.
    pub view: PlanarView,
    /// Whether the view holds the direction of every pixel of the part. Not so only if the eye is all but on the
    /// screen, where directions go all around, or if there are not enough parts.
    pub whole: bool,
}

impl Cover {
    /// The views for a map that is used once; [`SampledMap`] keeps it for other eyes. Sizes that it refuses give no parts.
    #[must_use]
    pub fn of(
        map: &dyn Fn(f64, f64) -> Option<DVec3>,
        size_px: [u32; 2],
        eye_m: DVec3,
        limits: &CoverLimits,
    ) -> Self {
        SampledMap::new(map, size_px)
            .map(|map| map.cover(eye_m, limits))
            .unwrap_or_default()
    }

    /// The part that holds a place of the channel's rectangle, in pixels.
    #[must_use]
    pub fn part_at(&self, x_px: f64, y_px: f64) -> Option<&Part> {
        self.parts.iter().find(|part| {
            let [x, y, width, height] = part.rect_px.map(f64::from);
            (x..x + width).contains(&x_px) && (y..y + height).contains(&y_px)
        })
    }
}

/// A part on the way.
struct Piece {
    span: Span,
    glance: Glance,
    gaze: Gaze,
    /// Of the widest angle that is known.
    cosine: f64,
    /// `None` if it is too wide.
    extents: Option<Extents>,
}

impl SampledMap {
    /// The views that cover the channel for an eye (room metres). Parts are halved along their larger angular extent until
    /// their directions are within the cone. No parts for an eye that is not finite, or a map that shows nothing.
    ///
    /// Every pixel's direction is in its part's view, at least two view pixels from its edge, and neighbouring output
    /// pixels are at least one view pixel apart, or [`PlanarView::sampling`] tells how far they are. Between samples the
    /// surface is taken to bend by its second differences at most, times 1.5, and stretch to differ by at most 1 %.
    /// Pixels that the surface itself squeezes to more than 3:1 (poles of grids), if its least oblong ones are square,
    /// count as if they were 3:1.
    #[must_use]
    pub fn cover(&self, eye_m: DVec3, limits: &CoverLimits) -> Cover {
        if !eye_m.is_finite() {
            return Cover::default();
        }
        let cosine = limits.cosine();
        let all = Span {
            columns: [0, self.columns_px.len() - 1],
            rows: [0, self.rows_px.len() - 1],
        };
        let mut pieces: Vec<Piece> = self.piece(all, eye_m, cosine).into_iter().collect();
        while pieces.len() < limits.most_parts {
            let cuttable = |piece: &&Piece| piece.extents.is_none() && self.cut(piece).is_some();
            let Some(widest) = pieces
                .iter()
                .enumerate()
                .filter(|(_, piece)| cuttable(piece))
                .min_by(|(_, first), (_, second)| first.cosine.total_cmp(&second.cosine))
                .map(|(index, _)| index)
            else {
                break;
            };
            let piece = pieces.swap_remove(widest);
            let halves = self.cut(&piece).into_iter().flatten();
            pieces.extend(halves.filter_map(|half| self.piece(half, eye_m, cosine)));
        }
        let mut parts: Vec<Part> = pieces
            .iter()
            .filter_map(|piece| self.part(piece, eye_m, limits))
            .collect();
        parts.sort_by_key(|part| [part.rect_px[1], part.rect_px[0]]);
        Cover { parts }
    }

    fn piece(&self, span: Span, eye_m: DVec3, limit: f64) -> Option<Piece> {
        let glance = self.glance(&span, eye_m)?;
        let (gaze, cosine) = glance.gaze();
        let extents = (cosine >= limit)
            .then(|| self.extents(&span, eye_m, &gaze, limit, false))
            .flatten();
        Some(Piece {
            span,
            glance,
            gaze,
            cosine,
            extents,
        })
    }

    /// The halves of a piece along its larger extent; along the other one, if it has no border between pixels to be cut at.
    fn cut(&self, piece: &Piece) -> Option<[Span; 2]> {
        let Span { columns, rows } = piece.span;
        let across = || {
            let middle = middle_line(&self.columns_px, columns)?;
            Some([
                Span {
                    columns: [columns[0], middle],
                    rows,
                },
                Span {
                    columns: [middle, columns[1]],
                    rows,
                },
            ])
        };
        let along = || {
            let middle = middle_line(&self.rows_px, rows)?;
            Some([
                Span {
                    columns,
                    rows: [rows[0], middle],
                },
                Span {
                    columns,
                    rows: [middle, rows[1]],
                },
            ])
        };
        let [width, height] = piece.glance.reach();
        if width >= height {
            across().or_else(along)
        } else {
            along().or_else(across)
        }
    }

    fn part(&self, piece: &Piece, eye_m: DVec3, limits: &CoverLimits) -> Option<Part> {
        let extents = match piece.extents {
            Some(extents) => extents,
            None => self.extents(&piece.span, eye_m, &piece.gaze, WIDEST_COSINE, true)?,
        };
        let line = |lines: &[f64], index: usize| lines.get(index).map_or(0, |line| *line as u32);
        let Span { columns, rows } = piece.span;
        let [left, right] = columns.map(|column| line(&self.columns_px, column));
        let [top, bottom] = rows.map(|row| line(&self.rows_px, row));
        let rect_px = [left, top, right - left, bottom - top];
        Some(Part {
            rect_px,
            view: view(&extents, &piece.gaze, rect_px, limits),
            whole: extents.whole,
        })
    }
}

/// The line nearest to the middle that is a border between pixels.
fn middle_line(lines: &[f64], [first, last]: [usize; 2]) -> Option<usize> {
    let middle = (first + last) / 2;
    (first + 1..last)
        .filter(|index| lines.get(*index).is_some_and(|line| line.fract() == 0.0))
        .min_by_key(|index| index.abs_diff(middle))
}

fn view(extents: &Extents, gaze: &Gaze, rect_px: [u32; 4], limits: &CoverLimits) -> PlanarView {
    let most_px = limits.most_px.clamp(64, 65_536) / QUANTUM_PX * QUANTUM_PX;
    let [low, high] = [extents.low, extents.high];
    let extent = [high[0] - low[0], high[1] - low[1]];
    let stretch = extents.stretch_squared.sqrt();
    let wanted = if stretch.is_finite() {
        RESERVE / stretch
    } else {
        let fit = [rect_px[2], rect_px[3]].map(f64::from);
        (fit[0] / extent[0]).max(fit[1] / extent[1])
    };
    let fitting = (f64::from(most_px) - 2.0 * MARGIN_PX) / extent[0].max(extent[1]);
    let growth = limits.most_growth.max(1.0) * f64::from(rect_px[2]) * f64::from(rect_px[3]);
    let growth = growth.max(ALWAYS_AFFORDABLE_PX);
    let affordable = (growth / (extent[0] * extent[1])).sqrt();
    // Pixels to 1 m at 1 m.
    let scale = match wanted.min(fitting).min(affordable) {
        scale if scale.is_finite() => scale,
        _ => LONE_PIXEL,
    };
    let size_px = extent.map(|extent| {
        let size = (extent * scale + 2.0 * MARGIN_PX).ceil() as u32;
        size.next_multiple_of(QUANTUM_PX).min(most_px)
    });
    let size_m = size_px.map(|size| f64::from(size) / scale);
    // What rounding up adds is shared between both sides.
    let start = [0, 1].map(|axis: usize| 0.5 * (low[axis] + high[axis] - size_m[axis]));
    PlanarView {
        lower_left_m: gaze.forward + gaze.right * start[0] + gaze.up * start[1],
        right: gaze.right,
        up: gaze.up,
        size_m,
        size_px,
        sampling: if stretch.is_finite() {
            scale * stretch
        } else {
            1.0
        },
    }
}
