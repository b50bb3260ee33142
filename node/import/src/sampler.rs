//! Values between the samples of one source.
//! In: positions in the source. Out: bilinear values and whether they hold data. The same position gives the same bits,
//! whatever else is asked for and in whatever order.

use std::sync::Arc;

use crate::error::SourceError;
use crate::grid::Position;
use crate::source::{ChunkCache, Pixels, Samples, Source};

/// Chunks, and bytes of them, that a sampler keeps at hand without asking the cache.
const AT_HAND: usize = 8;
const AT_HAND_BYTES: u64 = 16 << 20;
/// Windows larger than this are not gathered; their nodes are looked up one by one.
const LARGEST_WINDOW: u64 = 1 << 13;

/// A value at a position: one number a channel. `ROOM` is at least the number of channels; what lies beyond them is 0.
pub(crate) type Value<const ROOM: usize> = [f64; ROOM];

/// Reads one source of up to `ROOM` channels for one thread.
pub(crate) struct Sampler<'source, const ROOM: usize> {
    source: &'source Source,
    number: usize,
    cache: &'source ChunkCache,
    at_hand: Vec<((u32, u32), Arc<Pixels>)>,
    window: Window,
}

/// A rectangle of samples.
#[derive(Default)]
struct Window {
    left: u32,
    top: u32,
    width: usize,
    height: usize,
    values: Vec<f64>,
    valid: Vec<bool>,
    full: bool,
}

type Error = Arc<SourceError>;

impl<'source, const ROOM: usize> Sampler<'source, ROOM> {
    /// A sampler of `source`, which the cache knows by `number`. Channels beyond `ROOM` are left out.
    pub(crate) fn new(source: &'source Source, number: usize, cache: &'source ChunkCache) -> Self {
        Self {
            source,
            number,
            cache,
            at_hand: Vec::new(),
            window: Window::default(),
        }
    }

    /// A chunk by its column and row among the chunks.
    fn chunk(&mut self, column: u32, row: u32) -> Result<&Pixels, Error> {
        let known = self
            .at_hand
            .iter()
            .position(|(key, _)| *key == (column, row));
        let place = match known {
            Some(place) => place,
            None => {
                let chunk = self.source.chunk(self.cache, self.number, column, row)?;
                let fitting = AT_HAND_BYTES / self.source.description.chunk_bytes.max(1);
                if self.at_hand.len() >= AT_HAND.min(fitting.max(1) as usize) {
                    self.at_hand.remove(0);
                }
                self.at_hand.push(((column, row), chunk));
                self.at_hand.len() - 1
            }
        };
        Ok(&self.at_hand[place].1)
    }

    /// One sample; columns and rows beyond the grid count as the nearest, or wrap around the planet.
    pub(crate) fn sample(&mut self, column: i64, row: i64) -> Result<(Value<ROOM>, bool), Error> {
        let grid = self.source.grid();
        let width = i64::from(grid.width);
        let column = if grid.wraps() {
            column.rem_euclid(width)
        } else {
            column.clamp(0, width - 1)
        };
        let row = row.clamp(0, i64::from(grid.height) - 1);
        self.sample_inside(column as u32, row as u32)
    }

    fn sample_inside(&mut self, column: u32, row: u32) -> Result<(Value<ROOM>, bool), Error> {
        let (across, down) = self.source.description.chunk;
        let channels = self.source.description.channels;
        let chunk = self.chunk(column / across, row / down)?;
        let pixel = (row % down) as usize * chunk.width as usize + (column % across) as usize;
        let mut value = [0.0; ROOM];
        for (channel, value) in value.iter_mut().enumerate().take(channels) {
            *value = chunk.samples.number(pixel * channels + channel);
        }
        let valid = chunk
            .valid
            .as_ref()
            .is_none_or(|v| v.get(pixel).copied().unwrap_or(false));
        Ok((value, valid))
    }

    /// The values at many positions; `None` for positions outside and where the nearest sample holds no data.
    pub(crate) fn values(
        &mut self,
        positions: &[Option<Position>],
        values: &mut [Option<Value<ROOM>>],
    ) -> Result<(), Error> {
        let mut corners = [u32::MAX, u32::MAX, 0, 0];
        for position in positions.iter().flatten() {
            let (column, row) = (position.column as u32, position.row as u32);
            corners[0] = corners[0].min(column);
            corners[1] = corners[1].min(row);
            corners[2] = corners[2].max(column);
            corners[3] = corners[3].max(row);
        }
        let [left, top, right, bottom] = corners;
        if left > right {
            values.fill(None);
            return Ok(());
        }
        let grid = self.source.grid();
        let wraps = grid.wraps() && right + 1 >= grid.width;
        let right = (right + 1).min(grid.width - 1);
        let bottom = (bottom + 1).min(grid.height - 1);
        let area = u64::from(right - left + 1) * u64::from(bottom - top + 1);
        if wraps || area > LARGEST_WINDOW {
            for (position, value) in positions.iter().zip(values) {
                *value = match position {
                    Some(position) => self.value_alone(*position)?,
                    None => None,
                };
            }
            return Ok(());
        }
        self.gather(left, top, right, bottom)?;
        let channels = self.source.description.channels;
        let window = &self.window;
        for (position, value) in positions.iter().zip(values) {
            *value = position.and_then(|position| window.value(position, channels));
        }
        Ok(())
    }

    fn value_alone(&mut self, position: Position) -> Result<Option<Value<ROOM>>, Error> {
        let (column, row) = (position.column as i64, position.row as i64);
        let (s, t) = (position.column - column as f64, position.row - row as f64);
        let mut corners = [([0.0; ROOM], false); 4];
        for (index, corner) in corners.iter_mut().enumerate() {
            *corner = self.sample(column + (index & 1) as i64, row + (index >> 1) as i64)?;
        }
        Ok(bilinear(&corners, s, t, self.source.description.channels))
    }

    fn gather(&mut self, left: u32, top: u32, right: u32, bottom: u32) -> Result<(), Error> {
        let (across, down) = self.source.description.chunk;
        let channels = self.source.description.channels;
        let mut window = std::mem::take(&mut self.window);
        window.left = left;
        window.top = top;
        window.width = (right - left + 1) as usize;
        window.height = (bottom - top + 1) as usize;
        window
            .values
            .resize(window.width * window.height * channels, 0.0);
        window.valid.clear();
        window.valid.resize(window.width * window.height, true);
        window.full = true;
        for chunk_row in top / down..=bottom / down {
            for chunk_column in left / across..=right / across {
                let chunk = self.chunk(chunk_column, chunk_row)?;
                window.copy(chunk, (chunk_column * across, chunk_row * down), channels);
            }
        }
        self.window = window;
        Ok(())
    }
}

impl Window {
    /// Copies the part of a chunk that lies in the window. `corner` is the chunk's first column and row.
    fn copy(&mut self, chunk: &Pixels, corner: (u32, u32), channels: usize) {
        let first_column = self.left.max(corner.0);
        let end_column = (self.left + self.width as u32).min(corner.0 + chunk.width);
        let first_row = self.top.max(corner.1);
        let end_row = (self.top + self.height as u32).min(corner.1 + chunk.height);
        if first_column >= end_column {
            return;
        }
        let count = (end_column - first_column) as usize;
        for row in first_row..end_row {
            let from = (row - corner.1) as usize * chunk.width as usize
                + (first_column - corner.0) as usize;
            let to = (row - self.top) as usize * self.width + (first_column - self.left) as usize;
            if let Some(target) = self.values.get_mut(to * channels..(to + count) * channels) {
                chunk.samples.copy_numbers(from * channels, target);
            }
            if let Some(valid) = &chunk.valid
                && let (Some(target), Some(source)) = (
                    self.valid.get_mut(to..to + count),
                    valid.get(from..from + count),
                )
            {
                target.copy_from_slice(source);
                self.full &= source.iter().all(|v| *v);
            }
        }
    }

    fn value<const ROOM: usize>(&self, position: Position, channels: usize) -> Option<Value<ROOM>> {
        // Placed positions are not negative: cutting off is rounding down.
        let (column, row) = (position.column as u32, position.row as u32);
        let (s, t) = (
            position.column - f64::from(column),
            position.row - f64::from(row),
        );
        let (i, j) = ((column - self.left) as usize, (row - self.top) as usize);
        // On the last column or row the far weight is zero.
        let right = usize::from(i + 1 < self.width);
        let below = if j + 1 < self.height { self.width } else { 0 };
        let near = j * self.width + i;
        let at = [near, near + right, near + below, near + below + right];
        if self.full {
            let mut value = [0.0; ROOM];
            for (channel, value) in value.iter_mut().enumerate().take(channels) {
                let number = |pixel: usize| {
                    self.values
                        .get(pixel * channels + channel)
                        .copied()
                        .unwrap_or(0.0)
                };
                *value = blend(
                    [number(at[0]), number(at[1]), number(at[2]), number(at[3])],
                    s,
                    t,
                );
            }
            return Some(value);
        }
        let corners = at.map(|pixel| {
            let mut value = [0.0; ROOM];
            if let Some(numbers) = self.values.get(pixel * channels..(pixel + 1) * channels) {
                for (value, number) in value.iter_mut().zip(numbers) {
                    *value = *number;
                }
            }
            (value, self.valid.get(pixel).copied().unwrap_or(false))
        });
        bilinear(&corners, s, t, channels)
    }
}

#[inline]
fn blend([a, b, c, d]: [f64; 4], s: f64, t: f64) -> f64 {
    let near = a + (b - a) * s;
    let far = c + (d - c) * s;
    near + (far - near) * t
}

/// Bilinear over the corners that hold data, if the nearest does.
#[inline]
fn bilinear<const ROOM: usize>(
    corners: &[(Value<ROOM>, bool); 4],
    s: f64,
    t: f64,
    channels: usize,
) -> Option<Value<ROOM>> {
    let mut value = [0.0; ROOM];
    if corners.iter().all(|(_, valid)| *valid) {
        for (channel, value) in value.iter_mut().enumerate().take(channels) {
            *value = blend(corners.map(|(v, _)| v[channel]), s, t);
        }
        return Some(value);
    }
    let nearest = usize::from(s >= 0.5) + 2 * usize::from(t >= 0.5);
    if !corners[nearest].1 {
        return None;
    }
    let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
    let mut total = 0.0;
    for ((corner, valid), weight) in corners.iter().zip(weights) {
        if *valid {
            total += weight;
            for (sum, number) in value.iter_mut().zip(corner) {
                *sum += weight * number;
            }
        }
    }
    Some(value.map(|sum| sum / total))
}

impl Samples {
    fn number(&self, index: usize) -> f64 {
        match self {
            Self::U8(v) => v.get(index).map_or(0.0, |n| f64::from(*n)),
            Self::U16(v) => v.get(index).map_or(0.0, |n| f64::from(*n)),
            Self::I16(v) => v.get(index).map_or(0.0, |n| f64::from(*n)),
            Self::F32(v) => v.get(index).map_or(0.0, |n| f64::from(*n)),
            Self::F64(v) => v.get(index).copied().unwrap_or(0.0),
        }
    }

    fn copy_numbers(&self, from: usize, target: &mut [f64]) {
        fn each<T: Copy + Into<f64>>(values: &[T], from: usize, target: &mut [f64]) {
            for (target, value) in target.iter_mut().zip(values.iter().skip(from)) {
                *target = (*value).into();
            }
        }
        match self {
            Self::U8(v) => each(v, from, target),
            Self::U16(v) => each(v, from, target),
            Self::I16(v) => each(v, from, target),
            Self::F32(v) => each(v, from, target),
            Self::F64(v) => each(v, from, target),
        }
    }
}
