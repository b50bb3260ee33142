//! What tiles look like on the GPU: finished colour and relief as layers of two texture arrays.
//! In: results that are wanted. Out: layers that the terrain shader samples. Both arrays share one byte budget;
//! when it is spent, the layer unused for longest is overwritten.

use crate::gpu::Gpu;
use crate::layers::{LAYER_SIDE, LayerArrays};
use crate::pool::LayerPool;
use crate::process::NEUTRAL;

/// Bytes of one layer of either array.
pub(crate) const LAYER_BYTES: u64 = LAYER_SIDE as u64 * LAYER_SIDE as u64 * 4;

/// Layers of each array to begin with; what a view needs comes on top.
const FIRST_LAYERS: u32 = 64;
/// Layers of each array whatever the budget says.
const LEAST_LAYERS: u64 = 32;

/// The two arrays, and who holds which layer.
#[derive(Debug)]
pub(crate) struct SurfaceTextures {
    pub(crate) imagery: LayerPool,
    pub(crate) relief: LayerPool,
    pub(crate) arrays: LayerArrays,
    /// Layers of each array that the budget allows.
    most_layers: u32,
    /// The budget would hold more than the device's arrays can have.
    is_device_full: bool,
}

impl SurfaceTextures {
    /// Arrays that together stay within `budget_bytes`, with [`LEAST_LAYERS`] each at least.
    pub(crate) fn new(gpu: &Gpu, budget_bytes: u64) -> Self {
        let bound = u64::from(gpu.device.limits().max_texture_array_layers);
        let wanted = Self::layers_of(budget_bytes);
        let most_layers = wanted.min(bound) as u32;
        let arrays = LayerArrays::new(gpu, FIRST_LAYERS.min(most_layers));
        let textures = Self {
            imagery: LayerPool::new(arrays.layers),
            relief: LayerPool::new(arrays.layers),
            arrays,
            most_layers,
            is_device_full: wanted >= bound,
        };
        textures.write_bare_ground(gpu);
        textures
    }

    /// Layers of each array that so many bytes hold, wherever arrays can have as many.
    pub(crate) fn layers_of(budget_bytes: u64) -> u64 {
        (budget_bytes / (2 * LAYER_BYTES)).max(LEAST_LAYERS)
    }

    /// Layers that each array may have here.
    pub(crate) fn most_layers(&self) -> usize {
        self.most_layers as usize
    }

    /// Whether a larger budget would make no more room: the device's arrays have no more layers.
    pub(crate) fn is_device_full(&self) -> bool {
        self.is_device_full
    }

    /// Makes room for `layers` tiles in each array, as far as the budget goes. What is there stays.
    pub(crate) fn reserve(&mut self, gpu: &Gpu, layers: usize) {
        let wanted = u32::try_from(layers)
            .unwrap_or(u32::MAX)
            .min(self.most_layers);
        if wanted <= self.arrays.layers {
            return;
        }
        let grown = wanted.next_power_of_two().min(self.most_layers);
        self.arrays = self.arrays.grown(gpu, grown);
        self.imagery.grow(grown);
        self.relief.grow(grown);
    }

    /// Layer 0 of the imagery: ground that no layer of the scene covers.
    fn write_bare_ground(&self, gpu: &Gpu) {
        let [red, green, blue] = NEUTRAL;
        let texels = [red, green, blue, 255].repeat((LAYER_SIDE * LAYER_SIDE) as usize);
        gpu.queue.write_texture(
            self.arrays.imagery.as_image_copy(),
            &texels,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(LAYER_SIDE * 4),
                rows_per_image: Some(LAYER_SIDE),
            },
            wgpu::Extent3d {
                width: LAYER_SIDE,
                height: LAYER_SIDE,
                depth_or_array_layers: 1,
            },
        );
    }
}
