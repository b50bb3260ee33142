// Moves the window over the worklist to what was added since. One invocation.
// In: the worklist's length. Out: the window, how many workgroups the next pass over it needs, at most what the
// device can run at once, and how many passes there were. Part of top_down; its twin is in node/terrain/src/refine/top_down.rs.

const MOST_GROUPS: u32 = 1024u;

struct Window {
    // Arguments of the indirect dispatch.
    groups: u32,
    groups_y: u32,
    groups_z: u32,
    start: u32,
    end: u32,
    // Passes that had anything to do.
    passes: u32,
}

struct Worklist {
    length: u32,
    entries: array<u32>,
}

@group(0) @binding(0) var<storage, read> worklist: Worklist;
@group(0) @binding(1) var<storage, read_write> window: Window;

@compute @workgroup_size(1, 1, 1)
fn main() {
    let start = window.end;
    let end = min(worklist.length, arrayLength(&worklist.entries));
    window.start = start;
    window.end = end;
    window.passes += select(0u, 1u, end > start);
    window.groups = min((end - start + 63u) / 64u, MOST_GROUPS);
    window.groups_y = 1u;
    window.groups_z = 1u;
}
