//! A refiner with leaves around some place on Earth, their geometry on the device, and the same on this side.

use geodesy::{Ellipsoid, NODES, Tile};
use glam::DVec3;
use shaders::{INVALID_WORD, RefineLeaf};
use terrain::{Domain, LodLimits, LodView, Selection};

use super::ground::{Ground, Noise};
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::process::SLOT_SIDE;
use crate::readback::read_buffer;
use crate::recorder::PassTimes;
use crate::refine::{GeometryBuffers, HeightsJob, MarkLimits, Marked, Method, Refiner};

/// No limit.
pub(super) const ANYTHING: u32 = u32::MAX;
/// Metres in a unit in all tests.
pub(super) const UNIT_M: f64 = 1.0 / 64.0;
/// Slots of the geometry buffers.
const SLOTS: u32 = 80;

/// Where leaves are refined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Amid a face.
    Face,
    /// Across the edge of two faces.
    FaceEdge,
    /// Around a corner where three faces meet.
    CubeCorner,
    /// Across an edge where one face's axis runs against the other's, and with leaves missing.
    Patchy,
}

impl Place {
    pub(super) const ALL: [Self; 4] = [Self::Face, Self::FaceEdge, Self::CubeCorner, Self::Patchy];

    /// Cube faces that its leaves lie on.
    pub(super) fn faces(self) -> usize {
        match self {
            Self::Face => 1,
            Self::FaceEdge | Self::Patchy => 2,
            Self::CubeCorner => 3,
        }
    }

    fn eye(self) -> DVec3 {
        let towards = match self {
            Self::Face => DVec3::new(1.0, 0.2, 0.1),
            Self::FaceEdge => DVec3::new(1.0, 0.98, 0.3),
            Self::CubeCorner => DVec3::new(1.0, -0.99, 0.98),
            Self::Patchy => DVec3::new(0.2, 1.0, 1.01),
        };
        towards.normalize() * 6_700_000.0
    }
}

pub(super) struct Rig {
    pub(super) gpu: Gpu,
    pub(super) refiner: Refiner,
    pub(super) buffers: GeometryBuffers,
    pub(super) tiles: Vec<Tile>,
    pub(super) domain: Domain,
    pub(super) leaves: Vec<RefineLeaf>,
    pub(super) heights: Vec<Vec<i32>>,
    pub(super) errors: Vec<Vec<u32>>,
    pub(super) times: Option<PassTimes>,
}

impl Rig {
    pub(super) fn new(gpu: Gpu) -> Self {
        Self {
            refiner: Refiner::new(&gpu),
            buffers: {
                let mut buffers = GeometryBuffers::new(&gpu, SLOTS);
                buffers.use_up_to(SLOTS);
                buffers
            },
            gpu,
            tiles: Vec::new(),
            domain: Domain { leaves: Vec::new() },
            leaves: Vec::new(),
            heights: Vec::new(),
            errors: Vec::new(),
            times: None,
        }
    }

    /// Takes the leaves nearest to a place and those around them. Their slots are not in their order.
    pub(super) fn go(&mut self, place: Place) {
        let selection = selection(place);
        let distance = |tile: &Tile| {
            let middle = geodesy::LatticePoint::of_tile(*tile, 128, 128).normal();
            (middle - place.eye().normalize()).length()
        };
        let mut near: Vec<Tile> = selection.leaves().to_vec();
        near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        near.truncate(7);
        self.tiles = terrain::ring(&selection, &near);
        if place == Place::Patchy {
            let mut number = 0;
            self.tiles.retain(|_| {
                number += 1;
                number % 4 != 0
            });
        }
        self.tiles.truncate(SLOTS as usize);
        self.domain = Domain::new(&selection, &self.tiles);
        let count = self.tiles.len();
        self.leaves = (0..count)
            .map(|place| {
                let slot = (place * 5 + 3) % count.next_multiple_of(7);
                RefineLeaf::from_words(self.domain.record(place, slot as u32 % SLOTS))
            })
            .collect();
        let mut slots: Vec<u32> = self.leaves.iter().map(|leaf| leaf.geometry).collect();
        slots.sort_unstable();
        slots.dedup();
        if slots.len() != count {
            for (leaf, slot) in self.leaves.iter_mut().zip((0..SLOTS).rev()) {
                leaf.geometry = slot;
            }
        }
        self.heights = vec![Vec::new(); count];
        self.errors = vec![Vec::new(); count];
    }

    /// Levels between the coarsest and the finest leaf.
    pub(super) fn level_range(&self) -> u8 {
        let levels = || self.tiles.iter().map(|tile| tile.level());
        levels().max().unwrap() - levels().min().unwrap()
    }

    /// Cube faces that leaves lie on.
    pub(super) fn faces(&self) -> usize {
        let mut faces: Vec<_> = self.tiles.iter().map(|tile| tile.face()).collect();
        faces.sort_unstable();
        faces.dedup();
        faces.len()
    }

    /// Gives every leaf ground, on the device and here.
    pub(super) fn fill(&mut self, ground: Ground) {
        let grounds: Vec<Vec<i32>> = (0..self.leaves.len())
            .map(|place| ground.heights(place as u64))
            .collect();
        let views: Vec<wgpu::TextureView> = grounds
            .iter()
            .map(|heights| texture(&self.gpu, &slot_words(heights)))
            .collect();
        for (place, heights) in grounds.iter().enumerate() {
            let words = self.border(place, heights);
            let anchors = self.anchors(place);
            let slot = self.leaves[place].geometry;
            self.refiner
                .write_border(&self.gpu, &self.buffers, slot, &words, &anchors);
        }
        let jobs: Vec<HeightsJob<'_>> = self
            .leaves
            .iter()
            .zip(&views)
            .map(|(leaf, view)| HeightsJob {
                slot: leaf.geometry,
                input: Some(view),
                origin: [0; 2],
                shift: 0,
                units_per_m: (1.0 / UNIT_M) as f32,
            })
            .collect();
        self.refiner
            .make_geometry(&self.gpu, &self.buffers, &jobs, true, &mut self.times)
            .unwrap();
        self.errors = grounds
            .iter()
            .map(|heights| terrain::pyramid(heights))
            .collect();
        self.heights = grounds;
    }

    /// A leaf's border words: any vertices, and the heights of its ground.
    pub(super) fn border(&self, place: usize, heights: &[i32]) -> Vec<u32> {
        let mut noise = Noise(place as u64 + 77);
        let mut words = Vec::new();
        for [x, y] in terrain::border_positions() {
            words.extend((0..8).map(|_| noise.next() << 1));
            words.push(u32::from(*x) | u32::from(*y) << 16);
            words.push(heights[usize::from(*y) * NODES as usize + usize::from(*x)].cast_unsigned());
        }
        words
    }

    pub(super) fn anchors(&self, place: usize) -> Vec<u32> {
        let mut noise = Noise(place as u64);
        let reference: Vec<i32> = (0..terrain::BLOCKS).map(|_| noise.within(3000)).collect();
        terrain::anchors(&Ellipsoid::EARTH, self.tiles[place], &reference, UNIT_M)
    }

    /// Tables in which nothing is allowed more than what it is a part of.
    pub(super) fn nested_allowances(&self, noise: &mut Noise) -> Vec<Vec<u32>> {
        let mut table = || {
            let steps = 1 + noise.next() % 600;
            let fine = noise.next() % 9000;
            let at = |levels: u32| (fine.saturating_sub(levels * steps) + 1).min(0xffff);
            let block = at(1) << 16 | at(0);
            let mut words = vec![block; terrain::BLOCKS];
            // Coarse marks: less, the larger the triangle.
            words.extend((0..17 * 17_u32).map(|n| {
                let (x, y) = (n % 17, n / 17);
                let size = (x | y | 16).trailing_zeros();
                let allowed = at(2 + 2 * size + u32::from((x >> size) & (y >> size) & 1 == 1));
                allowed << 16 | allowed
            }));
            words
        };
        self.leaves.iter().map(|_| table()).collect()
    }

    /// Tables without any order.
    pub(super) fn wild_allowances(&self, noise: &mut Noise) -> Vec<Vec<u32>> {
        let mut word = || {
            let any = noise.next();
            let high = (any >> 16) % 16_000;
            // Now and then something must be split whatever its error.
            let low = if any.is_multiple_of(61) {
                0
            } else {
                any % 14_000
            };
            high << 16 | low
        };
        let mut table = || (0..terrain::ALLOWANCE_WORDS).map(|_| word()).collect();
        self.leaves.iter().map(|_| table()).collect()
    }

    pub(super) fn mark(
        &mut self,
        allowances: &[Vec<u32>],
        method: &Method<'_>,
        most_triangles: u32,
    ) -> Result<Marked, RenderError> {
        let allowances = allowances.concat();
        self.refiner.mark(
            &self.gpu,
            &self.buffers,
            &self.leaves,
            &allowances,
            method,
            MarkLimits { most_triangles },
            &mut self.times,
        )
    }

    /// The words of all slots of a buffer.
    pub(super) fn read(&self, buffer: &wgpu::Buffer) -> Vec<u32> {
        bytemuck::pod_collect_to_vec(&read_buffer(&self.gpu, buffer).unwrap())
    }
}

fn selection(place: Place) -> Selection {
    let view = LodView {
        eye: place.eye(),
        pixels_per_radian: 900.0,
    };
    let limits = LodLimits {
        deepest_level: 9,
        tile_px: 400.0,
        ..LodLimits::default()
    };
    terrain::select(&Ellipsoid::EARTH, &view, &limits, &|_: Tile| (0.0, 0.0))
}

/// Heights as a slot of metres: holes outside the leaf's own nodes.
pub(super) fn slot_words(heights: &[i32]) -> Vec<u32> {
    let side = SLOT_SIDE as usize;
    let mut words = vec![INVALID_WORD; side * side];
    for (n, height) in heights.iter().enumerate() {
        let (x, y) = (n % NODES as usize, n / NODES as usize);
        let metres = (f64::from(*height) * UNIT_M) as f32;
        words[(y + 9) * side + x + 9] = metres.to_bits();
    }
    words
}

pub(super) fn texture(gpu: &Gpu, words: &[u32]) -> wgpu::TextureView {
    let size = wgpu::Extent3d {
        width: SLOT_SIDE,
        height: SLOT_SIDE,
        depth_or_array_layers: 1,
    };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::R32Uint,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(SLOT_SIDE * 4),
        rows_per_image: None,
    };
    let bytes = bytemuck::cast_slice(words);
    gpu.queue
        .write_texture(texture.as_image_copy(), bytes, layout, size);
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
