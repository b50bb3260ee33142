//! Geometries of leaves on the GPU: who holds which slot of the buffers that refinement reads.
//! In: leaves and a number that stands for all that their heights depend on. Out: slots, and what the CPU knows of each:
//! its unit, bounds of its heights, its border. A slot in use in this frame is never taken; of the others the one unused
//! for longest is. It computes nothing.

use std::collections::HashMap;
use std::sync::Arc;

use geodesy::Tile;
use terrain::{BlockRanges, EyeCell, TileGeometryError};

use crate::gpu::Gpu;
use crate::refine::GeometryBuffers;

/// A leaf, and a number that stands for all that its heights depend on.
pub(crate) type GeometryKey = (Tile, u64);

/// Slots that there are whatever the budget says: two scenes of a view of the roots and what lies around them.
const LEAST_SLOTS: u64 = 48;
/// Tables of allowances remembered for each slot: of two eyes, and of where they were just now.
const TABLES_PER_SLOT: usize = 4;

/// What the CPU knows of a leaf's heights.
#[derive(Debug)]
pub(crate) struct Ground {
    /// Metres in a unit of height.
    pub(crate) unit_m: f64,
    /// How far flat triangles are from the planet's curve.
    pub(crate) shape: TileGeometryError,
    /// Bounds of the heights in each block.
    pub(crate) blocks: BlockRanges,
    /// Bounds of all heights.
    pub(crate) range_m: (f64, f64),
    /// Heights of the border nodes in the order of [`terrain::border_positions`].
    pub(crate) border_m: Vec<f64>,
}

/// A leaf's geometry.
#[derive(Clone, Debug)]
pub(crate) struct Geometry {
    pub(crate) key: GeometryKey,
    pub(crate) slot: u32,
    pub(crate) ground: Arc<Ground>,
}

#[derive(Debug)]
struct Entry {
    slot: u32,
    ground: Arc<Ground>,
    used: u64,
}

/// What a table of allowances depends on beside the leaf's heights: bits of the eye's cell, the pixels per radian, τ.
pub(crate) type TableKey = [u64; 6];

#[derive(Debug)]
struct Table {
    allowances: Arc<Vec<u32>>,
    used: u64,
}

/// All geometries.
#[derive(Debug)]
pub(crate) struct Geometries {
    pub(crate) buffers: GeometryBuffers,
    known: HashMap<GeometryKey, Entry>,
    free: Vec<u32>,
    tables: HashMap<(GeometryKey, TableKey), Table>,
    /// The frame in which tables were last given up.
    trimmed: u64,
    /// The budget would hold more than the device can bind.
    is_device_full: bool,
}

impl Geometries {
    /// Slots within `budget_bytes`.
    pub(crate) fn new(gpu: &Gpu, budget_bytes: u64) -> Self {
        // Heights and errors are bound whole.
        let limit = gpu.device.limits().max_storage_buffer_binding_size;
        let bound = limit / (terrain::LATTICE_NODES as u64 * 4);
        let wanted = Self::slots_of(budget_bytes);
        let most = wanted.min(bound.max(LEAST_SLOTS)) as u32;
        Self {
            buffers: GeometryBuffers::new(gpu, most),
            known: HashMap::new(),
            free: (0..most).rev().collect(),
            tables: HashMap::new(),
            trimmed: 0,
            is_device_full: wanted >= bound,
        }
    }

    /// Leaves that so many bytes hold, wherever that much can be bound.
    pub(crate) fn slots_of(budget_bytes: u64) -> u64 {
        (budget_bytes / GeometryBuffers::bytes_per_slot()).max(LEAST_SLOTS)
    }

    /// Whether a larger budget would make no more room: the device binds no larger buffers.
    pub(crate) fn is_device_full(&self) -> bool {
        self.is_device_full
    }

    /// Leaves that there is room for.
    pub(crate) fn capacity(&self) -> usize {
        self.buffers.slots as usize
    }

    /// The geometry, which counts as used in this frame.
    pub(crate) fn get(&mut self, key: GeometryKey, frame: u64) -> Option<Geometry> {
        let entry = self.known.get_mut(&key)?;
        entry.used = frame;
        Some(Geometry {
            key,
            slot: entry.slot,
            ground: Arc::clone(&entry.ground),
        })
    }

    /// A slot for a geometry that has none, to be filled by the caller. `None` while all are in use in this frame.
    pub(crate) fn lend(
        &mut self,
        key: GeometryKey,
        ground: Ground,
        frame: u64,
    ) -> Option<Geometry> {
        let slot = self.free.pop().or_else(|| self.evict(frame))?;
        self.buffers.use_up_to(slot + 1);
        let ground = Arc::new(ground);
        let entry = Entry {
            slot,
            ground: Arc::clone(&ground),
            used: frame,
        };
        self.known.insert(key, entry);
        Some(Geometry { key, slot, ground })
    }

    /// Forgets a geometry that could not be made.
    pub(crate) fn forget(&mut self, key: GeometryKey) {
        if let Some(entry) = self.known.remove(&key) {
            self.free.push(entry.slot);
        }
    }

    /// The table of allowances of a geometry, made where it is not known.
    pub(crate) fn allowances(
        &mut self,
        geometry: &Geometry,
        table: TableKey,
        frame: u64,
        make: impl FnOnce() -> Vec<u32>,
    ) -> Arc<Vec<u32>> {
        // Once a frame at most: those in use stay, however many they are.
        if self.tables.len() > TABLES_PER_SLOT * self.capacity() && self.trimmed < frame {
            self.tables.retain(|_, table| table.used + 1 >= frame);
            self.trimmed = frame;
        }
        let entry = self
            .tables
            .entry((geometry.key, table))
            .or_insert_with(|| Table {
                allowances: Arc::new(make()),
                used: frame,
            });
        entry.used = frame;
        Arc::clone(&entry.allowances)
    }

    fn evict(&mut self, frame: u64) -> Option<u32> {
        let oldest = self
            .known
            .iter()
            .filter(|(_, entry)| entry.used < frame)
            .min_by_key(|(key, entry)| (entry.used, **key))
            .map(|(key, _)| *key)?;
        self.known.remove(&oldest).map(|entry| entry.slot)
    }
}

/// What stands for a view in a table of allowances.
pub(crate) fn table_key(cell: &EyeCell, pixels_per_radian: f64, tau_px: f64) -> TableKey {
    let [x, y, z, radius] = cell.to_bits();
    [
        x,
        y,
        z,
        radius,
        pixels_per_radian.to_bits(),
        tau_px.to_bits(),
    ]
}
