//! The graphics card, or Mesa's software one.

use std::{
    fmt,
    sync::{Arc, Mutex, PoisonError},
};

use super::error::RenderError;

/// Which adapter is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AdapterPreference {
    /// Discrete, then integrated, then virtual, then software.
    #[default]
    RealFirst,
    /// Software only: the same pixels on every machine with the same Mesa.
    SoftwareOnly,
}

/// No card to draw with.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// Neither a real adapter nor a software one.
    #[error(
        "found no graphics adapter ({0}), expected a Vulkan, Metal or DirectX 12 driver, or Mesa's software \
         one: on Debian or Ubuntu install the packages mesa-vulkan-drivers and libvulkan1"
    )]
    NoAdapter(String),
    /// The adapter would not make a device.
    #[error("found graphics adapter {adapter}, which gave no device: {reason}")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// What the driver says.
        reason: String,
    },
}

/// What the device has complained about since it was last asked.
#[derive(Debug, Default)]
struct Complaints {
    lost: Option<String>,
    first: Option<String>,
}

/// Adapter, device and queue. Made once a program; cheap to clone.
#[derive(Clone)]
pub struct Gpu {
    /// The card.
    pub adapter: wgpu::Adapter,
    /// The opened card.
    pub device: wgpu::Device,
    /// Where work goes.
    pub queue: wgpu::Queue,
    complaints: Arc<Mutex<Complaints>>,
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

/// Features that are used where the adapter has them; none is needed.
pub fn wanted_features(adapter: &wgpu::Adapter) -> wgpu::Features {
    adapter.features() & wgpu::Features::TIMESTAMP_QUERY
}

/// Limits to open the device with: WebGPU's defaults, sizes of textures and buffers raised to what
/// the adapter has, and nothing above what it has.
pub fn wanted_limits(adapter: &wgpu::Adapter) -> wgpu::Limits {
    let has = adapter.limits();
    let wanted = wgpu::Limits {
        max_buffer_size: has.max_buffer_size,
        max_storage_buffer_binding_size: has.max_storage_buffer_binding_size,
        ..wgpu::Limits::default().using_resolution(has.clone())
    };
    wanted.or_worse_values_from(&has)
}

/// Descriptor of the instance, for the window's own set-up too. Labels stay on our side of the
/// driver: Mesa's software Vulkan 22.3 (Debian 12) crashes in `vkCmdBeginDebugUtilsLabelEXT`.
/// `WGPU_DISCARD_HAL_LABELS=0` passes them on, for graphics debuggers.
pub fn instance_descriptor() -> wgpu::InstanceDescriptor {
    let plain = wgpu::InstanceDescriptor::new_without_display_handle();
    wgpu::InstanceDescriptor {
        // Vulkan, Metal and Direct3D: asking for OpenGL too makes Mesa complain on stderr.
        backends: wgpu::Backends::PRIMARY,
        flags: plain.flags | wgpu::InstanceFlags::DISCARD_HAL_LABELS,
        ..plain
    }
    .with_env()
}

/// Descriptor of the device to open on `adapter`, for the window's own set-up too.
pub fn device_descriptor(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
    wgpu::DeviceDescriptor {
        label: Some("Gpu::device"),
        required_features: wanted_features(adapter),
        required_limits: wanted_limits(adapter),
        ..Default::default()
    }
}

/// The adapter that `preference` asks for, of those that can run compute shaders.
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
    /// From here on its errors come back from [`Gpu::check`] instead of ending the program.
    pub fn from_parts(adapter: wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let complaints = Arc::new(Mutex::new(Complaints::default()));
        let heard = Arc::clone(&complaints);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut heard = heard.lock().unwrap_or_else(PoisonError::into_inner);
            if heard.first.is_none() {
                heard.first = Some(error.to_string());
            }
        }));
        let heard = Arc::clone(&complaints);
        device.set_device_lost_callback(move |_, message| {
            heard.lock().unwrap_or_else(PoisonError::into_inner).lost =
                Some(if message.is_empty() { "no reason given".to_owned() } else { message });
        });
        Self { adapter, device, queue, complaints }
    }

    /// What has gone wrong on the device since the last call; a lost device stays lost.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn check(&self) -> Result<(), RenderError> {
        // Losses are told when the device is polled; what polling itself fails at is told here too.
        let polled = self.device.poll(wgpu::PollType::Poll);
        let mut heard = self.complaints.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(lost) = &heard.lost {
            return Err(RenderError::Device(format!("it was lost: {lost}")));
        }
        heard.first.take().map_or(Ok(()), |first| Err(RenderError::Device(first)))?;
        polled.map(|_| ()).map_err(|e| RenderError::Device(e.to_string()))
    }

    /// Waits until everything submitted is done.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn wait(&self) -> Result<(), RenderError> {
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        waited.map(|_| ()).map_err(|e| RenderError::Device(e.to_string()))
    }

    /// Whether the adapter computes on the CPU.
    pub fn is_software(&self) -> bool {
        self.adapter.get_info().device_type == wgpu::DeviceType::Cpu
    }

    /// Name, back end, driver, and whether it is software.
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

    /// Whether passes can be timed on the device itself.
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }
}
