//! From the device back to memory: finished pictures, and what pictures are measured by. No mesh that is drawn comes
//! this way. In: buffers and slots. Out: their bytes and words. It waits for the device.

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::process::SLOT_SIDE;

/// What errors call meshes and heights.
const MESH: &str = "the mesh";

/// All bytes of a buffer.
pub(crate) fn read_buffer(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<u8>, RenderError> {
    let staging = staging(gpu, buffer.size());
    let mut encoder = gpu
        .device
        .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
    gpu.queue.submit([encoder.finish()]);
    map(gpu, &staging, staging.size(), MESH, <[u8]>::to_vec)
}

/// All 275×275 words of a slot.
pub(crate) fn read_slot(gpu: &Gpu, texture: &wgpu::Texture) -> Result<Vec<u32>, RenderError> {
    let row_bytes = (SLOT_SIDE * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let staging = staging(gpu, u64::from(row_bytes) * u64::from(SLOT_SIDE));
    let mut encoder = gpu
        .device
        .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &staging,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(row_bytes),
                rows_per_image: Some(SLOT_SIDE),
            },
        },
        texture.size(),
    );
    gpu.queue.submit([encoder.finish()]);
    map(gpu, &staging, staging.size(), MESH, |bytes| {
        let rows = bytes.chunks(row_bytes as usize);
        let words = rows.flat_map(|row| row.chunks_exact(4).take(SLOT_SIDE as usize));
        words
            .filter_map(|word| word.try_into().ok().map(u32::from_le_bytes))
            .collect()
    })
}

/// A buffer that can be read from here.
pub(crate) fn staging(gpu: &Gpu, size: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    })
}

/// Waits for what was copied into a buffer and reads its first bytes. `what` names it in errors.
pub(crate) fn map<T>(
    gpu: &Gpu,
    staging: &wgpu::Buffer,
    bytes: u64,
    what: &str,
    read: impl FnOnce(&[u8]) -> T,
) -> Result<T, RenderError> {
    let failed = |reason: String| RenderError::Readback {
        output: what.to_owned(),
        reason,
    };
    let slice = staging.slice(..bytes);
    let (sender, receiver) = std::sync::mpsc::channel();
    slice.map_async(wgpu::MapMode::Read, move |result| {
        // The receiver lives until the wait below has returned.
        let _ = sender.send(result);
    });
    gpu.wait()?;
    receiver
        .recv()
        .map_err(|error| failed(error.to_string()))?
        .map_err(|error| failed(error.to_string()))?;
    let mapped = slice
        .get_mapped_range()
        .map_err(|error| failed(error.to_string()))?;
    let found = read(&mapped);
    drop(mapped);
    staging.unmap();
    Ok(found)
}
