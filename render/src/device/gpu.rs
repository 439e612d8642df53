//! The graphics device: a GPU, or Mesa's software driver.

use std::{
    fmt,
    sync::{Arc, Mutex, PoisonError},
};

use super::error::RenderError;

/// Which adapter is requested.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AdapterPreference {
    /// Discrete, then integrated, then virtual, then software.
    #[default]
    RealFirst,
    /// Software only: the same pixels on every machine with the same Mesa.
    SoftwareOnly,
}

/// No graphics device to render with.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// Neither a real adapter nor a software one.
    #[error(
        "found no graphics adapter ({0}), expected a Vulkan, Metal or DirectX 12 driver, or Mesa's software \
         one: on Debian or Ubuntu install the packages mesa-vulkan-drivers and libvulkan1"
    )]
    NoAdapter(String),
    /// The adapter gave no device.
    #[error("found graphics adapter {adapter}, which gave no device: {reason}")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
}

/// Device errors since the last [`Gpu::check`].
#[derive(Debug, Default)]
struct DeviceErrors {
    /// Why the device was lost; stays.
    lost: Option<String>,
    first: Option<String>,
}

/// Adapter, device and queue. Created once per program; cheap to clone.
#[derive(Clone)]
pub struct Gpu {
    /// The adapter.
    pub adapter: wgpu::Adapter,
    /// The device opened on the adapter.
    pub device: wgpu::Device,
    /// The queue that work is submitted to.
    pub queue: wgpu::Queue,
    errors: Arc<Mutex<DeviceErrors>>,
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Gpu({})", self.describe())
    }
}

fn rank(info: &wgpu::AdapterInfo) -> u32 {
    match info.device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// Features that are used where the adapter has them; none is required.
pub fn wanted_features(adapter: &wgpu::Adapter) -> wgpu::Features {
    adapter.features() & wgpu::Features::TIMESTAMP_QUERY
}

/// Limits to open the device with: WebGPU's defaults, with sizes of textures and buffers raised to the
/// adapter's limits, and nothing above these.
pub fn wanted_limits(adapter: &wgpu::Adapter) -> wgpu::Limits {
    let available = adapter.limits();
    let wanted = wgpu::Limits {
        max_buffer_size: available.max_buffer_size,
        max_storage_buffer_binding_size: available.max_storage_buffer_binding_size,
        ..wgpu::Limits::default().using_resolution(available.clone())
    };
    wanted.or_worse_values_from(&available)
}

/// Descriptor of the instance, also for the window's own set-up. Labels aren't passed to the driver: Mesa's
/// software Vulkan 22.3 (Debian 12) crashes in `vkCmdBeginDebugUtilsLabelEXT`.
/// `WGPU_DISCARD_HAL_LABELS=0` passes them on, for graphics debuggers.
pub fn instance_descriptor() -> wgpu::InstanceDescriptor {
    let plain = wgpu::InstanceDescriptor::new_without_display_handle();
    wgpu::InstanceDescriptor {
        // Vulkan, Metal and Direct3D: with OpenGL requested too, Mesa prints errors on stderr.
        backends: wgpu::Backends::PRIMARY,
        flags: plain.flags | wgpu::InstanceFlags::DISCARD_HAL_LABELS,
        ..plain
    }
    .with_env()
}

/// Descriptor of the device to open on `adapter`, also for the window's own set-up.
pub fn device_descriptor(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
    wgpu::DeviceDescriptor {
        label: Some("Gpu::device"),
        required_features: wanted_features(adapter),
        required_limits: wanted_limits(adapter),
        ..Default::default()
    }
}

/// The adapter that `preference` selects among those that can run compute shaders; `None` if there is none.
pub fn choose_adapter(adapters: &[wgpu::Adapter], preference: AdapterPreference) -> Option<&wgpu::Adapter> {
    adapters
        .iter()
        .filter(|a| {
            a.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
                && (preference == AdapterPreference::RealFirst
                    || a.get_info().device_type == wgpu::DeviceType::Cpu)
        })
        .min_by_key(|a| rank(&a.get_info()))
}

impl Gpu {
    /// Bytes of the device's memory that are in use by buffers and textures; `None` where the driver's allocator can't tell.
    pub fn memory_bytes(&self) -> Option<u64> {
        self.device.generate_allocator_report().map(|report| report.total_allocated_bytes)
    }

    /// A device without a window.
    ///
    /// # Errors
    /// [`GpuError`] when there is no adapter of that kind, or it gives no device.
    pub fn headless(preference: AdapterPreference) -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(instance_descriptor());
        let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
        let Some(adapter) = choose_adapter(&adapters, preference) else {
            let names: Vec<String> = adapters.iter().map(|a| a.get_info().name).collect();
            return Err(GpuError::NoAdapter(match (names.is_empty(), preference) {
                (true, _) => "no driver at all".to_owned(),
                (false, AdapterPreference::SoftwareOnly) => {
                    format!("no software one among {}", names.join(", "))
                }
                (false, AdapterPreference::RealFirst) => {
                    format!("none with compute shaders among {}", names.join(", "))
                }
            }));
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&device_descriptor(adapter)))
            .map_err(|e| GpuError::NoDevice { adapter: adapter.get_info().name, reason: e.to_string() })?;
        Ok(Self::from_parts(adapter.clone(), device, queue))
    }

    /// The window's device. It must have been opened with [`device_descriptor`].
    /// From then on its errors are returned by [`Gpu::check`] instead of ending the program.
    pub fn from_parts(adapter: wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let errors = Arc::new(Mutex::new(DeviceErrors::default()));
        let reported = Arc::clone(&errors);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut reported = reported.lock().unwrap_or_else(PoisonError::into_inner);
            if reported.first.is_none() {
                reported.first = Some(error.to_string());
            }
        }));
        let reported = Arc::clone(&errors);
        device.set_device_lost_callback(move |_, message| {
            reported.lock().unwrap_or_else(PoisonError::into_inner).lost =
                Some(if message.is_empty() { "no reason given".to_owned() } else { message });
        });
        Self { adapter, device, queue, errors }
    }

    /// Reports the first device error since the last call; a lost device stays lost.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn check(&self) -> Result<(), RenderError> {
        // A lost device is reported by polling; errors of the poll itself are returned last.
        let polled = self.device.poll(wgpu::PollType::Poll);
        let mut reported = self.errors.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(lost) = &reported.lost {
            return Err(RenderError::Device(format!("it was lost: {lost}")));
        }
        reported.first.take().map_or(Ok(()), |first| Err(RenderError::Device(first)))?;
        polled.map(|_| ()).map_err(|e| RenderError::Device(e.to_string()))
    }

    /// Waits until all submitted work is done.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn wait(&self) -> Result<(), RenderError> {
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        waited.map(|_| ()).map_err(|e| RenderError::Device(e.to_string()))
    }

    /// Whether the adapter runs on the CPU.
    pub fn is_software(&self) -> bool {
        self.adapter.get_info().device_type == wgpu::DeviceType::Cpu
    }

    /// Name, back end, driver, and whether it is software or hardware, as one line.
    pub fn describe(&self) -> String {
        let info = self.adapter.get_info();
        let driver = [info.driver.as_str(), info.driver_info.as_str()]
            .into_iter()
            .filter(|s| !s.is_empty())
            .collect::<Vec<_>>()
            .join(" ");
        let driver = if driver.is_empty() { "driver unknown".to_owned() } else { driver };
        let kind = if self.is_software() { "software" } else { "hardware" };
        format!("{}, {:?}, {driver}, {kind}", info.name, info.backend)
    }

    /// Whether the device supports timestamp queries.
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }
}
