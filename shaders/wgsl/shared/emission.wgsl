// What a mesh to be written is made of and where it goes. Field for field as in render's refine/emission.rs.

struct Emission {
    // Place among the leaves that were marked.
    place: u32,
    // Slot in the geometry buffers.
    geometry: u32,
    first_vertex: u32,
    first_index: u32,
    // Metres in a unit of height.
    unit_m: f32,
    // Which indirect arguments draw it, and the instance that they name.
    argument: u32,
    record: u32,
    // Where its vertices begin in the list of all that are written.
    first_entry: u32,
    vertices: u32,
    triangles: u32,
    // Entries of the whole list.
    entries: u32,
    // Where what is bound of the two buffers begins: the same in all meshes.
    window_vertex: u32,
    window_index: u32,
}
