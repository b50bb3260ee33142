// The planet's surface: fixed-point vertices to clip space, imagery under sun light and haze.
// In: base patches, per-tile records, imagery and relief layers. Out: colour (gamma encoded, alpha 1) and
// reverse depth. It must not depend on where in a wall the pixel lies, except through its position.

#import shared::fixed_point
#import shared::cube
#import shared::frame
#import shared::vertex

struct TileRecord {
    // Lattice units to texture coordinates: offset x, y; scale; layer.
    imagery: vec4<f32>,
    relief: vec4<f32>,
    // Cube face; three unused.
    face: vec4<u32>,
}

@group(0) @binding(1) var<storage, read> tiles: array<TileRecord>;
@group(0) @binding(2) var imagery_layers: texture_2d_array<f32>;
@group(0) @binding(3) var relief_layers: texture_2d_array<f32>;
@group(0) @binding(4) var bilinear: sampler;

struct VertexOut {
    @builtin(position) clip: vec4<f32>,
    @location(0) imagery: vec2<f32>,
    @location(1) relief: vec2<f32>,
    // The sun in the vertex' tangent frame, and the share of haze.
    @location(2) sun: vec4<f32>,
    @location(3) @interpolate(flat, either) layers: vec2<u32>,
}

// The share of haze over a point: the path of the ray through a layer of constant density.
fn haze_share(relative: vec3<f32>, normal: vec3<f32>) -> f32 {
    if frame.haze.w <= 0.0 { return 0.0; }
    let distance = length(relative);
    let rise = abs(dot(relative, normal)) / max(distance, 1e-3);
    let path = min(min(frame.haze.w / max(rise, 1e-3), frame.shading.y), distance);
    return 1.0 - exp(-path / frame.shading.y);
}

@vertex
fn vertex_main(vertex: VertexIn, @builtin(instance_index) instance: u32) -> VertexOut {
    let tile = tiles[instance];
    let relative = relative_position(vertex);
    let normal = normalize(vertex.normal.xyz);
    let axis = face_u(tile.face.x);
    let e1 = normalize(axis - normal * dot(axis, normal));
    let e2 = cross(normal, e1);
    let sun = frame.sun.xyz;
    let lattice = vec2<f32>(vertex.lattice);
    var out: VertexOut;
    out.clip = frame.clip_from_relative * vec4<f32>(relative, 1.0);
    out.imagery = tile.imagery.xy + lattice * tile.imagery.z;
    out.relief = tile.relief.xy + lattice * tile.relief.z;
    let up = dot(sun, normal);
    let day = smoothstep(-0.2, 0.3, up);
    out.sun = vec4<f32>(dot(sun, e1), dot(sun, e2), up, haze_share(relative, normal) * day);
    out.layers = vec2<u32>(u32(tile.imagery.w), u32(tile.relief.w));
    return out;
}

@fragment
fn fragment_main(in: VertexOut) -> @location(0) vec4<f32> {
    let ground = textureSampleLevel(imagery_layers, bilinear, in.imagery, in.layers.x, 0.0).rgb;
    let relief = textureSampleLevel(relief_layers, bilinear, in.relief, in.layers.y, 0.0).xy;
    let tilt = relief * abs(relief);
    let rise = sqrt(max(1.0 - dot(tilt, tilt), 1e-4));
    let steep = tilt * frame.shading.x;
    let lambert = (dot(steep, in.sun.xy) + rise * in.sun.z) * inverseSqrt(dot(steep, steep) + rise * rise);
    let light = frame.sun.w + (1.0 - frame.sun.w) * clamp(lambert, 0.0, 1.0);
    // Imagery stays gamma encoded (c²): multiplying its light by L multiplies the code by sqrt(L).
    let lit = ground * sqrt(light);
    return vec4<f32>(mix(lit, frame.haze.rgb, in.sun.w), 1.0);
}
