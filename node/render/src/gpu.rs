//! The graphics device: finds an adapter, opens it, names it.
//! In: an adapter's name or nothing. Out: device and queue. It draws nothing.

use thiserror::Error;

/// What is made use of where an adapter has it: times of passes, records of tiles by the first instance of an indirect
/// draw, triangles drawn as lines.
const WELCOME: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY
    .union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS)
    .union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES)
    .union(wgpu::Features::INDIRECT_FIRST_INSTANCE)
    .union(wgpu::Features::POLYGON_MODE_LINE);

/// An open graphics device.
#[derive(Debug)]
pub struct Gpu {
    /// Where adapters and surfaces come from.
    pub instance: wgpu::Instance,
    /// The adapter that was chosen.
    pub adapter: wgpu::Adapter,
    /// The logical device.
    pub device: wgpu::Device,
    /// Its one queue.
    pub queue: wgpu::Queue,
}

/// Why no device could be opened.
#[derive(Debug, Error)]
pub enum GpuError {
    /// No Vulkan driver offers an adapter at all.
    #[error(
        "no graphics adapter: no Vulkan driver answers on this machine. Install the driver of the graphics card, \
         or a software driver (on Debian and Ubuntu: apt-get install mesa-vulkan-drivers libvulkan1), and run \
         `vulkaninfo --summary` to see what is found"
    )]
    NoAdapter,
    /// An adapter was asked for by name and is not there.
    #[error("no graphics adapter \"{wanted}\": this machine has {known}")]
    UnknownAdapter {
        /// Part of a name, as it was asked for.
        wanted: String,
        /// The adapters that exist.
        known: String,
    },
    /// An adapter was asked for by number and is not there.
    #[error("no graphics adapter {number}: this machine has {known}")]
    UnknownNumber {
        /// The number, from 0.
        number: u32,
        /// The adapters that exist.
        known: String,
    },
    /// The adapter cannot do what the renderer needs.
    #[error("graphics adapter \"{adapter}\" cannot be used: {reason}")]
    Unusable {
        /// The adapter's name.
        adapter: String,
        /// What the driver said.
        reason: String,
    },
}

/// All adapters: fastest kinds first, and within a kind in the driver's order.
fn adapters(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    adapters
}

fn names(adapters: &[wgpu::Adapter]) -> String {
    let names = adapters.iter().enumerate();
    let names = names.map(|(number, adapter)| format!("{number}: \"{}\"", adapter.get_info().name));
    names.collect::<Vec<_>>().join(", ")
}

impl Gpu {
    /// Opens the adapter whose name contains `wanted`, or the fastest one. A real GPU is preferred to a
    /// software driver; among equals the order is the driver's.
    pub fn open(wanted: Option<&str>) -> Result<Self, GpuError> {
        Self::open_with(
            wgpu::InstanceDescriptor::new_without_display_handle(),
            wanted,
        )
    }

    /// As [`Gpu::open`], able to show windows on the display behind `display`.
    pub fn open_for_display(
        display: Box<dyn wgpu::wgt::WgpuHasDisplayHandle>,
        wanted: Option<&str>,
    ) -> Result<Self, GpuError> {
        Self::open_with(
            wgpu::InstanceDescriptor::new_with_display_handle(display),
            wanted,
        )
    }

    fn open_with(
        mut descriptor: wgpu::InstanceDescriptor,
        wanted: Option<&str>,
    ) -> Result<Self, GpuError> {
        descriptor.backends = wgpu::Backends::VULKAN;
        if !cfg!(debug_assertions) {
            // Arguments of indirect draws and dispatches are our own shaders' work. Checking them again costs a pass of
            // the device before each.
            descriptor.flags -= wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL;
        }
        let instance = wgpu::Instance::new(descriptor);
        let adapters = adapters(&instance);
        let known = names(&adapters);
        if adapters.is_empty() {
            return Err(GpuError::NoAdapter);
        }
        let chosen = adapters
            .into_iter()
            .find(|adapter| wanted.is_none_or(|part| adapter.get_info().name.contains(part)));
        let Some(adapter) = chosen else {
            return Err(GpuError::UnknownAdapter {
                wanted: wanted.unwrap_or_default().to_owned(),
                known,
            });
        };
        Self::on(instance, adapter)
    }

    /// Opens another adapter of this machine by its number, from 0: fastest kinds first, and within a kind in the
    /// driver's order. It can show windows where this one can.
    pub fn open_number(&self, number: u32) -> Result<Self, GpuError> {
        let mut adapters = adapters(&self.instance);
        if number as usize >= adapters.len() {
            return Err(GpuError::UnknownNumber {
                number,
                known: names(&adapters),
            });
        }
        Self::on(self.instance.clone(), adapters.swap_remove(number as usize))
    }

    fn on(instance: wgpu::Instance, adapter: wgpu::Adapter) -> Result<Self, GpuError> {
        let name = adapter.get_info().name;
        let available = adapter.limits();
        let limits = wgpu::Limits {
            max_texture_dimension_2d: available.max_texture_dimension_2d,
            max_texture_array_layers: available.max_texture_array_layers,
            max_buffer_size: available.max_buffer_size,
            max_storage_buffer_binding_size: available.max_storage_buffer_binding_size,
            ..wgpu::Limits::default()
        };
        let request = wgpu::DeviceDescriptor {
            label: Some("terrawall"),
            required_features: adapter.features() & WELCOME,
            required_limits: limits,
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) =
            pollster::block_on(adapter.request_device(&request)).map_err(|error| {
                GpuError::Unusable {
                    adapter: name,
                    reason: error.to_string(),
                }
            })?;
        Ok(Self {
            instance,
            adapter,
            device,
            queue,
        })
    }

    /// The adapter's name and driver, for reports.
    #[must_use]
    pub fn name(&self) -> String {
        let info = self.adapter.get_info();
        if info.driver_info.is_empty() {
            info.name
        } else {
            format!("{} ({})", info.name, info.driver_info)
        }
    }

    /// The largest side of a picture in pixels.
    #[must_use]
    pub fn largest_side_px(&self) -> u32 {
        self.device.limits().max_texture_dimension_2d
    }

    /// True for a driver that computes on the CPU.
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.adapter.get_info().device_type == wgpu::DeviceType::Cpu
    }

    /// True where all submitted work is done. Does not wait.
    pub fn is_idle(&self) -> Result<bool, GpuError> {
        self.device
            .poll(wgpu::PollType::Poll)
            .map(|status| status.is_queue_empty())
            .map_err(|error| self.failed(&error))
    }

    /// Waits until all submitted work is done.
    pub fn wait(&self) -> Result<(), GpuError> {
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map(|_| ())
            .map_err(|error| self.failed(&error))
    }

    fn failed(&self, error: &wgpu::PollError) -> GpuError {
        GpuError::Unusable {
            adapter: self.name(),
            reason: error.to_string(),
        }
    }
}
