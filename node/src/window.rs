//! Nodes with windows: the window system's event loop drives the frame loop, and input becomes steering.
//! In: a frame loop, events. Out: windows for it to draw into, steering messages. It decides nothing about
//! frames, and a node without a display never comes here.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use protocol::Wall;
use protocol::wall::Output;
use winit::application::ApplicationHandler;
use winit::dpi::{PhysicalPosition, PhysicalSize};
use winit::event::{ElementState, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::PhysicalKey;
use winit::monitor::MonitorHandle;
use winit::window::{Fullscreen, Window, WindowId};

use crate::frame_loop::{FrameLoop, Next};
use crate::steering::Steering;
use crate::{NodeError, NodeOutcome};

/// Pixels of a touchpad that count as one step of a wheel.
const PX_PER_WHEEL_STEP: f64 = 40.0;

/// Something has arrived for the frame loop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wake;

/// Runs the frame loop inside the window system's event loop until the node has left.
pub(crate) fn run(
    event_loop: EventLoop<Wake>,
    frame_loop: FrameLoop,
) -> Result<NodeOutcome, NodeError> {
    let mut application = Application {
        frame_loop,
        windows: HashMap::new(),
        result: None,
    };
    event_loop
        .run_app(&mut application)
        .map_err(|error| NodeError::WindowSystem(error.to_string()))?;
    application.result.unwrap_or_else(|| {
        Err(NodeError::WindowSystem(
            "the event loop ended by itself".to_owned(),
        ))
    })
}

struct Application {
    frame_loop: FrameLoop,
    /// Index of each window's output, and its input.
    windows: HashMap<WindowId, (usize, Steering)>,
    result: Option<Result<NodeOutcome, NodeError>>,
}

impl Application {
    /// Opens a window for each output that has a place on the desktop.
    fn open_windows(
        &mut self,
        event_loop: &ActiveEventLoop,
        wall: &Wall,
        host: usize,
    ) -> Result<Vec<Option<Arc<Window>>>, NodeError> {
        self.windows.clear();
        let outputs = wall.hosts.get(host).map_or(&[][..], |host| &host.outputs);
        let steering = || Steering::new(1.0 / wall.pixels_per_radian().max(1.0));
        let mut windows = Vec::new();
        for (index, output) in outputs.iter().enumerate() {
            windows.push(match open_window(event_loop, output) {
                None => None,
                Some(Ok(window)) => {
                    self.windows.insert(window.id(), (index, steering()));
                    Some(Arc::new(window))
                }
                Some(Err(error)) => {
                    let name = &output.name;
                    let text = format!("cannot open a window for output \"{name}\": {error}");
                    return Err(NodeError::WindowSystem(text));
                }
            });
        }
        Ok(windows)
    }

    fn tell_master(&mut self) -> Option<i64> {
        let now_us = link::now_us();
        let frame_loop = &self.frame_loop;
        for (output, steering) in self.windows.values_mut() {
            if let Some(steer) = steering.take(now_us) {
                frame_loop.steer(steer);
            }
            let ground_under = |pixel| frame_loop.ground_under(*output, pixel);
            if let Some(moved) = steering.take_lens(now_us, ground_under) {
                frame_loop.move_lens(moved);
            }
        }
        self.windows
            .values()
            .filter_map(|(_, steering)| steering.next_repeat_us())
            .min()
    }
}

impl ApplicationHandler<Wake> for Application {
    fn resumed(&mut self, _: &ActiveEventLoop) {}

    fn user_event(&mut self, _: &ActiveEventLoop, _: Wake) {
        // The frame loop looks for what has arrived in `about_to_wait`.
    }

    fn window_event(&mut self, _: &ActiveEventLoop, id: WindowId, event: WindowEvent) {
        let Some((_, steering)) = self.windows.get_mut(&id) else {
            return;
        };
        match event {
            WindowEvent::CloseRequested => self.frame_loop.leave("its window was closed"),
            WindowEvent::CursorMoved { position, .. } => steering.pointer([position.x, position.y]),
            WindowEvent::MouseInput { state, button, .. } => {
                steering.button(button, state == ElementState::Pressed);
            }
            WindowEvent::MouseWheel { delta, .. } => steering.wheel(match delta {
                MouseScrollDelta::LineDelta(_, lines) => f64::from(lines),
                MouseScrollDelta::PixelDelta(pixels) => pixels.y / PX_PER_WHEEL_STEP,
            }),
            WindowEvent::KeyboardInput { event, .. } if !event.repeat => {
                if let PhysicalKey::Code(key) = event.physical_key {
                    steering.key(key, event.state == ElementState::Pressed);
                }
            }
            WindowEvent::Focused(false) => steering.focus_lost(),
            // The window system may have lost the picture: it must be shown again though nothing moved.
            WindowEvent::RedrawRequested | WindowEvent::Resized(_) => self.frame_loop.show_again(),
            _ => {}
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        if self.result.is_some() {
            return;
        }
        let repeat_us = self.tell_master();
        let until_us = loop {
            match self.frame_loop.step() {
                Next::Again => {}
                Next::Wait { until_us } => break until_us,
                Next::OpenWindows { wall, host } => {
                    match self.open_windows(event_loop, &wall, host) {
                        Ok(windows) => self.frame_loop.use_windows(windows),
                        Err(error) => self.frame_loop.fail(error),
                    }
                }
                Next::Finished(result) => {
                    self.result = Some(result);
                    event_loop.exit();
                    return;
                }
            }
        };
        event_loop.set_control_flow(match [until_us, repeat_us].into_iter().flatten().min() {
            None => ControlFlow::Wait,
            Some(moment_us) => {
                let left_us = moment_us.saturating_sub(link::now_us()).max(0);
                ControlFlow::WaitUntil(
                    Instant::now() + Duration::from_micros(left_us.unsigned_abs()),
                )
            }
        });
    }
}

/// The window of an output, `None` if it has no place on the desktop.
fn open_window(event_loop: &ActiveEventLoop, output: &Output) -> Option<Result<Window, String>> {
    let placement = output.window?;
    let monitor = match placement.monitor {
        None => None,
        Some(number) => match event_loop.available_monitors().nth(number as usize) {
            Some(monitor) => Some(monitor),
            None => return Some(Err(no_monitor(event_loop, number))),
        },
    };
    let corner = monitor
        .as_ref()
        .map_or(PhysicalPosition::new(0, 0), MonitorHandle::position);
    let [x, y] = placement.position_px;
    let [width, height] = output.size_px;
    // Size and place are set in any case: without a window manager nobody makes a window fullscreen.
    let mut attributes = Window::default_attributes()
        .with_title(format!("Terrawall: {}", output.name))
        .with_inner_size(PhysicalSize::new(width, height))
        .with_position(PhysicalPosition::new(
            corner.x.saturating_add(x),
            corner.y.saturating_add(y),
        ))
        .with_resizable(false)
        .with_decorations(false);
    if placement.fullscreen {
        attributes = attributes.with_fullscreen(Some(Fullscreen::Borderless(monitor)));
    }
    let window = event_loop.create_window(attributes);
    Some(window.map_err(|error| error.to_string()).inspect(|window| {
        window.set_cursor_visible(placement.pointer);
    }))
}

/// What to say of a monitor that is not there.
fn no_monitor(event_loop: &ActiveEventLoop, number: u32) -> String {
    let there: Vec<String> = event_loop
        .available_monitors()
        .enumerate()
        .map(|(number, monitor)| {
            let (name, size, at) = (monitor.name(), monitor.size(), monitor.position());
            let name = name.unwrap_or_else(|| "without a name".to_owned());
            format!(
                "{number} ({name}, {}×{} at {}, {})",
                size.width, size.height, at.x, at.y
            )
        })
        .collect();
    format!(
        "there is no monitor {number}; write one of {} as window.monitor, or leave it out",
        there.join(", ")
    )
}
