//! Windows that cover each other on one monitor of a host.
//!
//! In: a wall. Out: sentences. It asks no window system.

use protocol::Wall;
use protocol::wall::Output;

pub(super) fn warn(wall: &Wall, warnings: &mut Vec<String>) {
    for host in &wall.hosts {
        for (index, first) in host.outputs.iter().enumerate() {
            let others = host.outputs.iter().skip(index + 1);
            for second in others.filter(|second| overlap(first, second)) {
                let monitor = first.window.and_then(|window| window.monitor);
                let (place, remedy) = match monitor {
                    Some(monitor) => (
                        format!("monitor {monitor}"),
                        "name another monitor for one of them",
                    ),
                    None => (
                        "its desktop".to_owned(),
                        "move one of them, or name monitors",
                    ),
                };
                warnings.push(format!(
                    "the windows of outputs \"{}\" and \"{}\" of host \"{}\" overlap on {place}; {remedy}",
                    first.name, second.name, host.name
                ));
            }
        }
    }
}

/// Whether two windows are on the same monitor, or both placed on the desktop, and cover each other there.
fn overlap(first: &Output, second: &Output) -> bool {
    let (Some(a), Some(b)) = (&first.window, &second.window) else {
        return false;
    };
    // Where a monitor is on the desktop, a wall does not say.
    if a.monitor != b.monitor {
        return false;
    }
    if a.monitor.is_some() && (a.fullscreen || b.fullscreen) {
        return true;
    }
    let apart = |axis: usize| {
        let end =
            |output: &Output, position: i32| i64::from(position) + i64::from(output.size_px[axis]);
        let (from_a, from_b) = (a.position_px[axis], b.position_px[axis]);
        end(first, from_a) <= i64::from(from_b) || end(second, from_b) <= i64::from(from_a)
    };
    !apart(0) && !apart(1)
}
